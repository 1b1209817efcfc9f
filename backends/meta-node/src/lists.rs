//! Place holders in order: each is in one of four lists or in none.

use vertex_tree::NONE;

/// What a place holder is to the navigation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// Its page is neither in use nor referred to: the free list, first in, first out. The page stays where it
    /// is until its place is taken: its second chance.
    Free,
    /// Some page in use refers to its page.
    Prefetched,
    /// Nodes of the front are on its page.
    InUse,
    /// A change on its page is foreseen.
    Foreseen,
}

impl Class {
    /// Those of least use first.
    pub const ALL: [Self; KINDS] = [Self::Free, Self::Prefetched, Self::InUse, Self::Foreseen];
}

const KINDS: usize = 4;

/// In no list: on its way, never evicted, or empty.
const OUTSIDE: u8 = KINDS as u8;

/// Doubly linked lists through arrays: every move is O(1) and none allocates.
#[derive(Debug)]
pub(crate) struct Lists {
    /// Neighbours of each place holder, and last those of the heads of the lists.
    before: Vec<u32>,
    after: Vec<u32>,
    class: Vec<u8>,
    len: [u32; KINDS],
    holders: usize,
}

impl Lists {
    pub fn new(holders: usize) -> Self {
        let heads = (0..KINDS).map(|head| (holders + head) as u32);
        let links: Vec<u32> = std::iter::repeat_n(NONE, holders).chain(heads).collect();
        Self { before: links.clone(), after: links, class: vec![OUTSIDE; holders], len: [0; KINDS], holders }
    }

    pub fn len(&self, class: Class) -> u32 {
        self.len[class as usize]
    }

    pub fn class(&self, holder: u32) -> Option<Class> {
        Class::ALL.get(usize::from(self.class[holder as usize])).copied()
    }

    /// The holder that has been in a list for longest.
    pub fn front(&self, class: Class) -> Option<u32> {
        let front = self.after[self.holders + class as usize];
        ((front as usize) < self.holders).then_some(front)
    }

    /// The holders in a list, in order.
    pub fn iter(&self, class: Class) -> impl Iterator<Item = u32> + '_ {
        let next = |&holder: &u32| Some(self.after[holder as usize]).filter(|&h| (h as usize) < self.holders);
        std::iter::successors(self.front(class), next)
    }

    pub fn remove(&mut self, holder: u32) {
        let h = holder as usize;
        if self.class[h] != OUTSIDE {
            let (before, after) = (self.before[h], self.after[h]);
            self.after[before as usize] = after;
            self.before[after as usize] = before;
            self.len[usize::from(self.class[h])] -= 1;
            self.class[h] = OUTSIDE;
        }
    }

    /// Moves a holder to the end of a list.
    pub fn push(&mut self, holder: u32, class: Class) {
        self.remove(holder);
        let head = self.holders + class as usize;
        let last = self.before[head];
        self.before[holder as usize] = last;
        self.after[holder as usize] = head as u32;
        self.after[last as usize] = holder;
        self.before[head] = holder;
        self.class[holder as usize] = class as u8;
        self.len[class as usize] += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_keep_their_order() {
        let mut lists = Lists::new(4);
        assert_eq!(lists.front(Class::Free), None);
        (0..4).for_each(|h| lists.push(h, Class::Free));
        lists.push(0, Class::Free);
        lists.push(2, Class::InUse);
        assert_eq!(lists.iter(Class::Free).collect::<Vec<_>>(), [1, 3, 0]);
        assert_eq!(lists.iter(Class::Foreseen).next(), None);
        let mut order = Vec::new();
        while let Some(h) = lists.front(Class::Free) {
            assert_eq!(lists.class(h), Some(Class::Free));
            order.push(h);
            lists.remove(h);
            lists.remove(h);
        }
        assert_eq!(order, [1, 3, 0]);
        assert_eq!(
            (lists.front(Class::InUse), lists.len(Class::InUse), lists.len(Class::Free)),
            (Some(2), 1, 0)
        );
        assert_eq!(lists.class(1), None);
    }
}
