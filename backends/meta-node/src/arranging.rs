//! From a log that may be larger than memory to an arrangement.
//!
//! The log is read in sequence: once forwards for the number of leaves below each vertex, once backwards for their places,
//! with 4 bytes a vertex in memory; everything else is sorted in temporary files. To find the node that brings a triangle,
//! subtrees that fit in memory are loaded one after the other, each with the triangles that have two corners in it; the
//! few nodes above these, and the triangles that have no two corners in the same one, stay in memory.

use std::cell::RefCell;
use std::io;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

use collapse_log::external::{Scratch, Sorter, Spool, Workspace, check_stop, too_few};
use collapse_log::{Collapse, LogError, LogSource};
use vertex_tree::{Bounds, NONE};

use crate::arrange::{Arrangement, Stored};
use crate::error::MetaNodeError;
use crate::subtree::{Span, Subtree};

/// Arranges a log.
pub(crate) fn arrange<'a>(
    log: &dyn LogSource,
    workspace: &Workspace<'a>,
) -> Result<Arrangement<'a>, MetaNodeError> {
    let scratch = Scratch { folder: workspace.folder.clone() };
    let memory = usize::try_from(workspace.memory).unwrap_or(usize::MAX) / 4;
    let arranging = Arranging { log, scratch, memory, base_leaves: Vec::new(), stop: workspace.stop };
    arranging.run().map_err(|error| match error {
        Failure::Log(error) => error.into(),
        Failure::Io(source) => workspace.error(source).into(),
    })
}

/// What can go wrong.
enum Failure {
    Log(LogError),
    Io(io::Error),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<LogError> for Failure {
    fn from(error: LogError) -> Self {
        Self::Log(error)
    }
}

/// What the nodes above the subtrees that are loaded are to each other, and which subtrees there are.
#[derive(Default)]
struct Upper {
    subtree: Subtree,
    /// The leaves of the subtrees.
    below: Vec<Range<u32>>,
}

impl Upper {
    /// The subtree in which a leaf is.
    fn below(&self, leaf: u32) -> Option<usize> {
        let at = self.below.partition_point(|leaves| leaves.start <= leaf).checked_sub(1)?;
        self.below[at].contains(&leaf).then_some(at)
    }
}

/// A log that is being arranged.
struct Arranging<'a, 's> {
    log: &'a dyn LogSource,
    scratch: Scratch,
    /// Bytes that a sort, or what is loaded, may take.
    memory: usize,
    /// Empty at first.
    base_leaves: Vec<u32>,
    stop: &'s AtomicBool,
}

impl<'s> Arranging<'_, 's> {
    fn run(mut self) -> Result<Arrangement<'s>, Failure> {
        let counts = self.log.counts();
        // Leaves below each vertex, then their places: one array for both.
        let mut leaves = vec![1_u32; counts.vertices as usize];
        let mut halves = self.count_leaves(&mut leaves)?;
        let nodes = self.place_leaves(&mut halves, &mut leaves)?;
        drop(halves);
        let most = u32::try_from(self.memory / SUBTREE_BYTES).unwrap_or(u32::MAX).max(2);
        let (mut upper, mut sorted) = self.sort_nodes(nodes, most)?;
        let places = self.sort_positions(&leaves)?;
        let (mut triangles, numbers, above, doubled) = self.sort_triangles(&leaves, &upper)?;
        drop(leaves);

        // Those brought by the nodes above, and those that nothing brings.
        let mut base_triangles = Vec::new();
        upper.subtree.finish();
        for leaves in above {
            match upper.subtree.bringer(leaves) {
                NONE => base_triangles.push(leaves),
                n => upper.subtree.add(n, leaves),
            }
        }
        let (brought_above, starts_above) = upper.subtree.sorted();

        let mut stored = Storing {
            nodes: self.scratch.spool()?,
            brought: self.scratch.spool()?,
            above: Vec::new(),
            roots: Vec::new(),
        };
        let mut sorted = sorted.read()?;
        let mut triangles = triangles.read()?;
        let (mut at_above, mut at_below) = (0, 0);
        let mut loaded = Vec::new();
        while let Some(node) = sorted.next() {
            check_stop(self.stop)?;
            let node = node?;
            let count = node[2] - node[0];
            if count > most {
                let range = starts_above[at_above] as usize..starts_above[at_above + 1] as usize;
                stored.push(node, &brought_above[range])?;
                at_above += 1;
                continue;
            }
            let mut subtree = Subtree::default();
            loaded.clear();
            loaded.push(node);
            for _ in 2..count {
                loaded.push(sorted.next().ok_or_else(too_few)??);
            }
            loaded.iter().for_each(|&[first, pivot, end, ..]| subtree.push(Span { first, pivot, end }));
            subtree.finish();
            for _ in 0..numbers[at_below] {
                let leaves = triangles.next().ok_or_else(too_few)??;
                subtree.add(subtree.bringer(leaves), leaves);
            }
            let (brought, starts) = subtree.sorted();
            for (&node, ends) in loaded.iter().zip(starts.windows(2)) {
                stored.push(node, &brought[ends[0] as usize..ends[1] as usize])?;
            }
            at_below += 1;
        }
        Ok(Arrangement {
            leaves: counts.vertices as u32,
            triangles: counts.triangles as u32,
            doubled,
            nodes: stored.nodes.len() as u32,
            roots: stored.roots,
            base_leaves: self.base_leaves,
            base_triangles,
            stored: RefCell::new(Stored {
                nodes: stored.nodes.into_paged(2 * self.memory)?,
                brought: stored.brought.into_paged(self.memory / 2)?,
                places: places.into_paged(self.memory / 2)?,
                failed: None,
            }),
            stop: self.stop,
        })
    }

    /// Counts the leaves below each vertex, and gives for each collapse those of the kept and of the removed one. Finds
    /// whether the collapses make a log.
    fn count_leaves(&self, below: &mut [u32]) -> Result<Spool<2>, Failure> {
        let mut halves = self.scratch.spool()?;
        for (n, c) in self.log.collapses().enumerate() {
            check_stop(self.stop)?;
            let c = c?;
            check(n, &c, below)?;
            let [kept, removed] = [c.kept, c.removed].map(|v| below[v as usize]);
            halves.push([kept, removed])?;
            // What is removed has no leaves any more.
            below[c.kept as usize] = kept + removed;
            below[c.removed as usize] = 0;
        }
        Ok(halves)
    }

    /// Finds the leaf of each vertex, and puts the nodes in preorder: by their first leaf, and the larger ones first.
    fn place_leaves(&mut self, halves: &mut Spool<2>, place: &mut [u32]) -> Result<Sorter<9>, Failure> {
        let mut nodes = Sorter::new(&self.scratch, self.memory);
        place.fill(NONE);
        let (mut next, mut n) = (0, halves.len() as u32);
        for (c, halves) in self.log.collapses_back().zip(halves.read_back()?) {
            check_stop(self.stop)?;
            let (c, [kept, removed]) = (c?, halves?);
            n -= 1;
            if place[c.kept as usize] == NONE {
                // A tree takes the next free interval; the place of any other node is fixed by its parent.
                place[c.kept as usize] = next;
                self.base_leaves.push(next);
                next += kept + removed;
            }
            let first = place[c.kept as usize];
            place[c.removed as usize] = first + kept;
            let Bounds { center: [x, y, z], radius, eps } = c.bounds;
            let [x, y, z, radius, eps] = [x, y, z, radius, eps].map(f32::to_bits);
            nodes.push([first, !(kept + removed), first + kept, n, x, y, z, radius, eps])?;
        }
        for place in place.iter_mut().filter(|place| **place == NONE) {
            *place = next;
            self.base_leaves.push(next);
            next += 1;
        }
        Ok(nodes)
    }

    /// Sorts the nodes, and finds the subtrees of at most so many leaves and the nodes above them.
    fn sort_nodes(&self, nodes: Sorter<9>, most: u32) -> io::Result<(Upper, Spool<9>)> {
        let (mut upper, mut sorted, mut covered) = (Upper::default(), self.scratch.spool()?, 0);
        nodes.finish(|[first, leaves, pivot, rest @ ..]| {
            let end = first + !leaves;
            if end - first > most {
                upper.subtree.push(Span { first, pivot, end });
            } else if first >= covered {
                upper.below.push(first..end);
                covered = end;
            }
            let [n, x, y, z, radius, eps] = rest;
            sorted.push([first, pivot, end, n, x, y, z, radius, eps])
        })?;
        Ok((upper, sorted))
    }

    /// The places of the leaves in order.
    fn sort_positions(&self, leaf: &[u32]) -> Result<Spool<3>, Failure> {
        let mut by_leaf = Sorter::<4>::new(&self.scratch, self.memory);
        for (vertex, position) in self.log.positions().enumerate() {
            check_stop(self.stop)?;
            let position = position?;
            if !position.iter().all(|x| x.is_finite()) {
                return Err(LogError::BadPosition { vertex, position }.into());
            }
            let [x, y, z] = position.map(f32::to_bits);
            by_leaf.push([leaf[vertex], x, y, z])?;
        }
        let mut places = self.scratch.spool()?;
        by_leaf.finish(|[_, x, y, z]| places.push([x, y, z]))?;
        Ok(places)
    }

    /// The triangles as three leaves each: those of each subtree, one subtree after the other; how many each has; those with no
    /// two corners in the same one; and how many have a doubled corner.
    #[expect(clippy::type_complexity, reason = "it is taken apart at once")]
    fn sort_triangles(
        &self,
        leaf: &[u32],
        upper: &Upper,
    ) -> Result<(Spool<3>, Vec<u32>, Vec<[u32; 3]>, u32), Failure> {
        let mut by_subtree = Sorter::<5>::new(&self.scratch, self.memory);
        let (mut above, mut doubled) = (Vec::new(), 0);
        for (t, corners) in self.log.triangles().enumerate() {
            check_stop(self.stop)?;
            let corners = corners?;
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= leaf.len()) {
                return Err(LogError::CornerOutOfRange { triangle: t, vertex, vertices: leaf.len() }.into());
            }
            let leaves = corners.map(|v| leaf[v as usize]);
            let mut ordered = leaves;
            ordered.sort_unstable();
            if ordered[0] == ordered[1] || ordered[1] == ordered[2] {
                doubled += 1;
                continue;
            }
            let [a, b, c] = ordered.map(|leaf| upper.below(leaf));
            match b.filter(|_| a == b || b == c) {
                Some(subtree) => {
                    by_subtree.push([subtree as u32, t as u32, leaves[0], leaves[1], leaves[2]])?;
                }
                None => above.push(leaves),
            }
        }
        let (mut triangles, mut numbers) = (self.scratch.spool()?, vec![0; upper.below.len()]);
        by_subtree.finish(|[subtree, _, a, b, c]| {
            numbers[subtree as usize] += 1;
            triangles.push([a, b, c])
        })?;
        Ok((triangles, numbers, above, doubled))
    }
}

/// Bytes of memory that a subtree takes while it is loaded, for each of its leaves: 52 for a node and its place, and 40 for
/// two triangles.
const SUBTREE_BYTES: usize = 96;

/// Fails if a collapse is none that can be. `below` has the leaves below each vertex: none if it has been removed.
fn check(n: usize, c: &Collapse, below: &[u32]) -> Result<(), LogError> {
    for vertex in [c.removed, c.kept] {
        if below.get(vertex as usize).is_none_or(|&leaves| leaves == 0) {
            return Err(LogError::NoSuchVertex { collapse: n, vertex });
        }
    }
    c.check(n)
}

/// The nodes and their triangles on their way to disk.
struct Storing {
    nodes: Spool<12>,
    brought: Spool<3>,
    /// The nodes above the next one: where their leaves end, and their numbers.
    above: Vec<(u32, u32)>,
    roots: Vec<u32>,
}

impl Storing {
    fn push(&mut self, node: [u32; 9], brought: &[[u32; 3]]) -> io::Result<()> {
        let [first, pivot, end, n, x, y, z, radius, eps] = node;
        let (number, start) = (self.nodes.len() as u32, self.brought.len() as u32);
        while self.above.last().is_some_and(|&(end, _)| end <= first) {
            self.above.pop();
        }
        let parent = self.above.last().map_or(NONE, |&(_, above)| above);
        if parent == NONE {
            self.roots.push(number);
        }
        self.above.push((end, number));
        brought.iter().try_for_each(|&leaves| self.brought.push(leaves))?;
        let count = brought.len() as u32;
        self.nodes.push([first, pivot, end, n, x, y, z, radius, eps, parent, start, count])
    }
}
