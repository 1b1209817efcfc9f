//! Makes room.
//!
//! What is needed last goes first: of what is not foreseen, that which no cut holds, least recently used first, then what
//! some cut holds, then what is foreseen, the farthest first, requests for it included.

use super::Paging;

/// What room is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Need {
    /// A change, as long as the frame lasts: only what no cut holds and nobody foresees gives way.
    Change,
    /// A change, at the end of the frame: everything gives way that is not needed at this moment.
    Pressing,
    /// Something needed in this frame at the earliest: nothing gives way that is needed as soon.
    Foreseen(u64),
}

impl Paging {
    /// Reserves room for those of some nodes that have none yet, and makes some if there is none. If that is not possible,
    /// returns how many bytes it takes.
    pub(super) fn reserve(&mut self, nodes: &[u32], need: Need) -> Result<(), u64> {
        let bytes = self.unreserved_bytes(nodes);
        while !self.residents.memory().try_reserve(bytes) {
            if !self.let_go_of_one(need) {
                return Err(bytes);
            }
        }
        // Making room may have withdrawn a request that had room for some of them.
        if self.unreserved_bytes(nodes) > bytes {
            self.residents.memory().release(bytes);
            return self.reserve(nodes, need);
        }
        nodes.iter().for_each(|&n| self.nodes[n as usize].is_reserved = true);
        Ok(())
    }

    fn unreserved_bytes(&self, nodes: &[u32]) -> u64 {
        let is_unreserved = |n: &&u32| !self.nodes[**n as usize].is_reserved;
        nodes.iter().filter(is_unreserved).map(|&n| self.bytes_of(n)).sum()
    }

    pub(super) fn let_go_of_one(&mut self, need: Need) -> bool {
        let (nodes, foresight) = (&self.nodes, &self.foresight);
        let is_foreseen = |n: u32| foresight.as_ref().is_some_and(|f| f.is_named(n));
        let mut node = self.residents.oldest(self.frame, |n| nodes[n as usize].links > 0 || is_foreseen(n));
        if node.is_none() && need != Need::Change {
            node = self.residents.any(self.frame, is_foreseen);
        }
        if let Some(node) = node {
            self.let_go(node);
            return true;
        }
        let earliest = match need {
            Need::Change => return false,
            Need::Pressing => 0,
            Need::Foreseen(frame) => frame + 1,
        };
        while let Some(node) = self.foresight.as_mut().and_then(|f| f.next_farthest(earliest)) {
            if self.residents.is_free(node, self.frame) {
                self.let_go(node);
                return true;
            }
            if self.nodes[node as usize].is_reserved && self.withdraw(self.unit_of(node)) {
                return true;
            }
        }
        false
    }

    pub(super) fn let_go(&mut self, node: u32) {
        self.residents.remove(node, self.bytes_of(node));
        if let Some(foresight) = &mut self.foresight {
            foresight.unused.remove(&node);
        }
        let partition = self.nodes[node as usize].partition as usize;
        let state = &mut self.partitions[partition];
        state.resident -= 1;
        if state.resident == 0 {
            state.forget();
        }
    }

    /// Takes back a read that is only foreseen and has not been started, and says whether it did.
    pub(super) fn withdraw(&mut self, unit: u32) -> bool {
        let Some(read) = self.reads.get(&unit) else { return false };
        if !read.waiting.is_empty() || !self.line.withdraw(read.ticket) {
            return false;
        }
        self.reads.remove(&unit);
        self.release_reserved(unit);
        true
    }

    /// What does not come needs no room.
    pub(super) fn release_reserved(&mut self, unit: u32) {
        for node in self.nodes_of(unit) {
            if std::mem::take(&mut self.nodes[node as usize].is_reserved) {
                self.residents.memory().release(self.bytes_of(node));
            }
        }
    }

    /// Makes room where the limit has been lowered, or where another tree could not have what it wants.
    pub(super) fn relieve(&mut self) {
        let mut excess = self.residents.memory().excess(self.member);
        self.pressed = if excess > 0 { self.pressed + 1 } else { 0 };
        while excess > 0 {
            let memory = self.residents.memory();
            let is_pressing = self.pressed > 1 || memory.used() > memory.limit();
            if !self.let_go_of_one(if is_pressing { Need::Pressing } else { Need::Change }) {
                break;
            }
            excess = self.residents.memory().excess(self.member);
        }
    }
}
