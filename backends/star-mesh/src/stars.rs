//! The star of each displayed vertex: which corners of displayed triangles are there.
//!
//! Most vertices have about six. A star of up to 12 lies in one cache line; a larger one moves to a list of its own.

use vertex_tree::{NONE, TriangleId, VertexId, prefetch};

/// Corner `c` of the triangle in slot `t` is numbered `4 t + c`: the triangle is found by a shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Corner(u32);

impl Corner {
    const NONE: Self = Self(NONE);

    #[inline(always)]
    pub fn new(triangle: TriangleId, index: usize) -> Self {
        Self(triangle << 2 | index as u32)
    }

    #[inline(always)]
    pub fn triangle(self) -> TriangleId {
        self.0 >> 2
    }

    /// 0, 1 or 2.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & 3) as usize
    }
}

/// Corners that fit beside the rest of a star.
const NEAR: usize = 12;

/// The bit that says that what follows is the number of a list, see [`Star::brought`].
const LISTED: u32 = 1 << 31;

/// The number of the list of the triangles that came with a vertex, where there are more than two.
#[inline(always)]
fn list([_, second]: [TriangleId; 2]) -> Option<u32> {
    (second != NONE && second & LISTED != 0).then_some(second & !LISTED)
}

#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Star {
    /// The leaf whose vertex is shown here; [`NONE`] in a hole.
    leaf: u32,
    /// How many corners are in `near`, or [`FAR`] where they are in the list of which `near[0]` has the number.
    count: u32,
    /// The triangles that came with the vertex and go with it, [`NONE`] where there are fewer than two. Where there are more,
    /// the second is [`LISTED`] and the number of a list of all.
    brought: [TriangleId; 2],
    near: [Corner; NEAR],
}

const FAR: u32 = u32::MAX;

impl Star {
    /// Takes out the corner of a triangle; the last one takes its place.
    #[inline(always)]
    fn take(&mut self, triangle: TriangleId) {
        // All places are compared, also unused ones: where a loop would end can not be predicted.
        let mut found = 0;
        for (at, corner) in self.near.iter().enumerate() {
            found |= u32::from(corner.triangle() == triangle) << at;
        }
        let used = (1 << self.count) - 1;
        if found & used != 0 {
            self.count -= 1;
            self.near[found.trailing_zeros() as usize % NEAR] = self.near[self.count as usize % NEAR];
        }
    }
}

/// Lists that are used again, each known by its number.
#[derive(Clone, Debug)]
struct Lists<T> {
    lists: Vec<Vec<T>>,
    unused: Vec<u32>,
}

impl<T> Default for Lists<T> {
    fn default() -> Self {
        Self { lists: Vec::new(), unused: Vec::new() }
    }
}

impl<T: Copy> Lists<T> {
    /// A new list, which is empty.
    fn add(&mut self) -> u32 {
        self.unused.pop().unwrap_or_else(|| {
            self.lists.push(Vec::with_capacity(4 * NEAR));
            self.lists.len() as u32 - 1
        })
    }

    fn remove(&mut self, number: u32) {
        self.lists[number as usize].clear();
        self.unused.push(number);
    }
}

/// The stars of all displayed vertices, by the vertex's slot.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stars {
    stars: Vec<Star>,
    holes: Vec<VertexId>,
    far: Lists<Corner>,
    listed: Lists<TriangleId>,
}

impl Stars {
    /// A vertex appears; returns its slot. Slots are used again last in, first out.
    #[inline(always)]
    pub fn add(&mut self, leaf: u32) -> VertexId {
        match self.holes.pop() {
            Some(slot) => {
                let star = &mut self.stars[slot as usize];
                star.leaf = leaf;
                star.count = 0;
                star.brought = [NONE; 2];
                slot
            }
            None => {
                self.stars.push(Star { leaf, count: 0, brought: [NONE; 2], near: [Corner::NONE; NEAR] });
                self.stars.len() as u32 - 1
            }
        }
    }

    /// A vertex disappears, and whatever corners are left there.
    #[inline(always)]
    pub fn remove(&mut self, slot: VertexId) {
        let star = &mut self.stars[slot as usize];
        star.leaf = NONE;
        if star.count == FAR {
            self.far.remove(star.near[0].0);
        }
        star.count = 0;
        if let Some(list) = list(star.brought) {
            self.listed.remove(list);
        }
        star.brought = [NONE; 2];
        self.holes.push(slot);
    }

    /// The leaf that is shown in a slot; [`NONE`] in a hole.
    #[inline(always)]
    pub fn leaf(&self, slot: VertexId) -> u32 {
        self.stars[slot as usize].leaf
    }

    /// Whether a slot shows a leaf, and not that of another vertex.
    #[inline(always)]
    pub fn shows(&self, slot: VertexId, leaf: u32) -> bool {
        self.stars.get(slot as usize).is_some_and(|star| star.leaf == leaf)
    }

    /// The slots in use, and the leaf that is shown in each.
    pub fn leaves(&self) -> impl Iterator<Item = (VertexId, u32)> + '_ {
        (0..).zip(&self.stars).map(|(slot, star)| (slot, star.leaf)).filter(|&(_, leaf)| leaf != NONE)
    }

    /// Checks the slots to use again, and the lists.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        let mut listed = vec![false; self.stars.len()];
        for &hole in &self.holes {
            let twice = std::mem::replace(&mut listed[hole as usize], true);
            assert!(!twice, "vertex {hole} is listed as a hole twice");
        }
        let (mut far, mut many) = (0, 0);
        for (slot, (star, listed)) in self.stars.iter().zip(listed).enumerate() {
            assert_eq!(star.leaf == NONE, listed, "vertex {slot} is listed as a hole if it is one");
            assert!(
                star.count == FAR || star.count as usize <= NEAR,
                "corners at vertex {slot}: {}",
                star.count
            );
            far += usize::from(star.count == FAR);
            many += usize::from(list(star.brought).is_some());
        }
        assert_eq!(far + self.far.unused.len(), self.far.lists.len(), "lists of corners");
        assert_eq!(many + self.listed.unused.len(), self.listed.lists.len(), "lists of triangles");
    }

    #[inline(always)]
    pub fn prefetch(&self, slot: VertexId) {
        prefetch(&self.stars, slot as usize);
    }

    /// The first few corners at a vertex, and perhaps others that have been there: as many whatever the count, so that a loop
    /// over them has no branch to mispredict.
    #[inline(always)]
    pub fn first(&self, slot: VertexId) -> [Corner; 7] {
        let Some(star) = self.stars.get(slot as usize) else { return [Corner::NONE; 7] };
        std::array::from_fn(|at| star.near[at])
    }

    /// The corners at a vertex; none where there is no vertex.
    pub fn corners(&self, slot: VertexId) -> &[Corner] {
        let Some(star) = self.stars.get(slot as usize) else { return &[] };
        match star.near.get(..star.count as usize) {
            Some(near) => near,
            None => &self.far.lists[star.near[0].0 as usize],
        }
    }

    #[inline(always)]
    pub fn push(&mut self, slot: VertexId, corner: Corner) {
        let star = &mut self.stars[slot as usize];
        match star.near.get_mut(star.count as usize) {
            Some(place) => {
                *place = corner;
                star.count += 1;
            }
            None => self.push_far(slot, corner),
        }
    }

    #[cold]
    fn push_far(&mut self, slot: VertexId, corner: Corner) {
        let star = &mut self.stars[slot as usize];
        if star.count != FAR {
            let number = self.far.add();
            self.far.lists[number as usize].extend_from_slice(&star.near);
            star.near[0] = Corner(number);
            star.count = FAR;
        }
        self.far.lists[star.near[0].0 as usize].push(corner);
    }

    /// Takes the corner of a triangle out of a star; the last one takes its place.
    #[inline(always)]
    pub fn take(&mut self, slot: VertexId, triangle: TriangleId) {
        let star = &mut self.stars[slot as usize];
        if star.count == FAR {
            let far = &mut self.far.lists[star.near[0].0 as usize];
            if let Some(at) = far.iter().position(|corner| corner.triangle() == triangle) {
                far.swap_remove(at);
            }
        } else {
            star.take(triangle);
        }
    }

    /// Moves the corners for which `moves` says so from one star to another, which is empty.
    #[inline(always)]
    pub fn split(&mut self, from: VertexId, to: VertexId, moves: impl Fn(Corner) -> bool) {
        let Ok([star, other]) = self.stars.get_disjoint_mut([from as usize, to as usize]) else { return };
        if star.count == FAR {
            return self.split_far(from, to, &moves);
        }
        // Both lists are written whether a corner goes there or not: only their lengths depend on it.
        let (mut stay, mut go) = (0, 0);
        for at in 0..(star.count as usize).min(NEAR) {
            let corner = star.near[at];
            let moves = usize::from(moves(corner));
            star.near[stay] = corner;
            other.near[go] = corner;
            go += moves;
            stay += 1 - moves;
        }
        star.count = stay as u32;
        other.count = go as u32;
    }

    #[cold]
    fn split_far(&mut self, from: VertexId, to: VertexId, moves: &dyn Fn(Corner) -> bool) {
        let number = self.stars[from as usize].near[0].0 as usize;
        let mut corners = std::mem::take(&mut self.far.lists[number]);
        corners.iter().filter(|&&corner| moves(corner)).for_each(|&corner| self.push(to, corner));
        corners.retain(|&corner| !moves(corner));
        self.far.lists[number] = corners;
    }

    /// Moves all corners from one star to another, and tells `moved` of each.
    #[inline(always)]
    pub fn merge(&mut self, from: VertexId, to: VertexId, mut moved: impl FnMut(Corner)) {
        let Ok([star, other]) = self.stars.get_disjoint_mut([from as usize, to as usize]) else { return };
        let (count, others) = (star.count as usize, other.count as usize);
        if count > NEAR || others > NEAR || count + others > NEAR {
            return self.merge_far(from, to, &mut moved);
        }
        for (place, &corner) in other.near[others..].iter_mut().zip(&star.near[..count]) {
            *place = corner;
            moved(corner);
        }
        other.count += star.count;
        star.count = 0;
    }

    #[cold]
    fn merge_far(&mut self, from: VertexId, to: VertexId, moved: &mut dyn FnMut(Corner)) {
        for at in 0..self.corners(from).len() {
            let corner = self.corners(from)[at];
            self.push(to, corner);
            moved(corner);
        }
    }

    /// A triangle that has a corner in the star has moved to another slot.
    pub fn replace(&mut self, slot: VertexId, triangle: TriangleId, by: TriangleId) {
        let found = self.corners(slot).iter().find(|corner| corner.triangle() == triangle);
        if let Some(index) = found.map(|corner| corner.index()) {
            self.take(slot, triangle);
            self.push(slot, Corner::new(by, index));
        }
    }

    /// The triangles that came with a vertex; none where there is no vertex.
    #[inline(always)]
    pub fn brought(&self, slot: VertexId) -> &[TriangleId] {
        let Some(Star { brought, .. }) = self.stars.get(slot as usize) else { return &[] };
        match *brought {
            [NONE, _] => &[],
            [_, NONE] => &brought[..1],
            both => match list(both) {
                None => brought,
                Some(list) => &self.listed.lists[list as usize],
            },
        }
    }

    /// A triangle comes with a vertex.
    #[inline(always)]
    pub fn bring(&mut self, slot: VertexId, triangle: TriangleId) {
        let brought = &mut self.stars[slot as usize].brought;
        match *brought {
            [NONE, _] => brought[0] = triangle,
            [_, NONE] => brought[1] = triangle,
            _ => self.bring_many(slot, triangle),
        }
    }

    #[cold]
    fn bring_many(&mut self, slot: VertexId, triangle: TriangleId) {
        let brought = &mut self.stars[slot as usize].brought;
        let list = list(*brought).unwrap_or_else(|| {
            let list = self.listed.add();
            self.listed.lists[list as usize].extend_from_slice(brought);
            brought[1] = LISTED | list;
            list
        });
        self.listed.lists[list as usize].push(triangle);
    }

    /// A triangle that came with a vertex has moved to another slot.
    pub fn bring_instead(&mut self, slot: VertexId, triangle: TriangleId, by: TriangleId) {
        let brought = &mut self.stars[slot as usize].brought;
        let all = match list(*brought) {
            None => &mut brought[..],
            Some(list) => &mut self.listed.lists[list as usize],
        };
        if let Some(place) = all.iter_mut().find(|place| **place == triangle) {
            *place = by;
        }
    }
}
