//! Checks a whole file: every block, every reference, nesting, that needs never go in a circle, and in the end that everything
//! can be unfolded: whether w x y z are around one vertex depends on all that has been unfolded before.
//!
//! Every block is read once. Takes memory for the whole hierarchy, and some 60 bytes a node beside it.

use std::sync::Arc;

use vertex_tree::{
    Bounds, Hierarchy, MeshSink, NONE, NodeId, NormalCone, Prefetch, Step, TreeError, TriangleId, VertexId,
    VertexTree,
};

use crate::block::Inflated;
use crate::cone;
use crate::error::XfmError;
use crate::file::XfmFile;
use crate::half_edges::Adjacent;
use crate::numbering::{Owner, owner};
use crate::settings::{Io, Settings};
use crate::tree::XfmTree;

/// For whom the mesh is followed that nobody looks at.
struct Nobody;

impl MeshSink for Nobody {
    fn vertex_added(&mut self, _: VertexId, _: [f32; 3]) {}
    fn vertex_removed(&mut self, _: VertexId) {}
    fn triangle_added(&mut self, _: TriangleId, _: [VertexId; 3]) {}
    fn triangle_removed(&mut self, _: TriangleId) {}
    fn corner_moved(&mut self, _: TriangleId, _: usize, _: VertexId) {}
}

/// Half of the relative slack that building leaves between nested spheres.
const SLACK: f64 = 1.0 / (1 << 21) as f64;

/// What is kept of every node: bounds, w x y z as nodes, and whether it has the two triangles.
struct Kept {
    bounds: Vec<Bounds>,
    cones: Vec<NormalCone>,
    above: Vec<[u32; 5]>,
    sides: Vec<[bool; 2]>,
    flags: Vec<u32>,
}

impl XfmFile {
    /// Reads every block and checks every reference in the file.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn verify(self: &Arc<Self>) -> Result<(), XfmError> {
        self.verify_unknown()?;
        let header = self.header();
        let (levels, count) = (header.levels, header.nodes as usize);
        let mut kept = Kept {
            bounds: Vec::with_capacity(count),
            cones: Vec::with_capacity(count),
            above: Vec::with_capacity(count),
            sides: Vec::with_capacity(count),
            flags: Vec::with_capacity(header.blocks as usize),
        };
        let mut half_edges = Vec::with_capacity(count);
        let settings = Settings { io: Io::Blocking, prefetch: Prefetch::None, ..Settings::default() };
        let mut tree = XfmTree::new(self.clone(), settings)?;
        // What is above each block, as its parent's block says.
        let mut named = vec![NONE; header.blocks as usize];
        let mut bytes = Vec::new();
        let mut triangles = header.initial_faces;
        for number in 0..header.blocks as u32 {
            let Inflated { block, nodes } = self.read_block(number, &mut bytes)?;
            let root = levels.node(number, 0);
            let listed = self.roots().binary_search_by_key(&root, |&(root, _)| root).ok();
            if block.parent != named[number as usize] || listed.is_some() != (block.parent == NONE) {
                return Err(self.damaged(number, "root list, parent and child blocks do not agree"));
            }
            if listed.is_some_and(|i| self.roots()[i].1 != nodes[0].stored.bounds()) {
                return Err(self.damaged(number, "the root list has another sphere"));
            }
            for place in 0..levels.fan_out() {
                if let Some(child) = block.child_block(place) {
                    if named[child as usize] != NONE {
                        return Err(self.damaged(number, "a child block has two parents"));
                    }
                    named[child as usize] = levels.node(number, levels.lowest() + place / 2).0;
                }
            }
            for (offset, index) in (0..levels.full()).filter_map(|o| Some((o, block.index_of(o)?))) {
                let node = &nodes[index].stored;
                let [w, x, y, z] = node.adjacent;
                let sides = Adjacent { w, x, y, z }.sides();
                triangles += sides.iter().map(|&side| u64::from(side)).sum::<u64>();
                kept.bounds.push(node.bounds());
                kept.cones.push(node.cone());
                kept.sides.push(sides);
                half_edges.push(node.adjacent);
                let parent = match offset {
                    0 => block.parent,
                    _ => levels.node(number, (offset - 1) / 2).0,
                };
                kept.above.push([parent, NONE, NONE, NONE, NONE]);
            }
            kept.flags.push(block.flags);
            tree.paging.insert(Inflated { block, nodes });
        }
        if triangles != header.triangles {
            return Err(XfmError::Field {
                file: self.name().to_owned(),
                offset: 64,
                field: "the number of triangles",
                value: header.triangles,
                expected: "but initial faces and nodes bring others",
            });
        }
        self.check_references(&mut kept, &half_edges)?;
        self.check_order(&kept)?;
        drop((kept, half_edges));
        self.unfold_all(&mut tree)
    }

    /// Unfolds everything, needs first.
    fn unfold_all(&self, tree: &mut XfmTree) -> Result<(), XfmError> {
        let wrong = |node: NodeId, reason| {
            let offset = self.place(self.levels().block(node)).0;
            XfmError::Node { file: self.name().to_owned(), offset, node: node.0, reason }
        };
        let damaged = |node| {
            move |error| match error {
                TreeError::Damaged { reason, .. } => wrong(node, reason),
                _ => wrong(node, "it can not be unfolded"),
            }
        };
        tree.base_mesh(&mut Nobody).map_err(damaged(NodeId(0)))?;
        let mut waiting: Vec<NodeId> = tree.roots().to_vec();
        while let Some(&node) = waiting.last() {
            if tree.paging.blocks.is_active(node) {
                waiting.pop();
                continue;
            }
            match tree.unfold(node, &mut Nobody).map_err(damaged(node))? {
                Step::Done => {
                    waiting.pop();
                    waiting.extend(tree.children(node));
                }
                // It comes first, and what is above it before. That this ends follows from the order that has been checked.
                Step::Needs(other) => {
                    let mut above = Some(other);
                    while let Some(node) = above.filter(|&node| !tree.paging.blocks.is_active(node)) {
                        waiting.push(node);
                        above = tree.parents(node).next();
                    }
                }
                Step::Blocked | Step::StillNeeded | Step::NotResident => {
                    return Err(wrong(node, "it can not be unfolded"));
                }
            }
        }
        Ok(())
    }

    /// The place of a node among all, if it is there.
    fn ordinal(&self, flags: &[u32], node: NodeId) -> Option<usize> {
        let (block, offset) = (self.levels().block(node), self.levels().offset(node));
        let flags = *flags.get(block as usize)?;
        let before = (flags & ((1 << offset) - 1)).count_ones();
        (flags & 1 << offset != 0).then(|| (self.nodes_before(block) + before) as usize)
    }

    fn wrong(&self, ordinal: usize, reason: &'static str) -> XfmError {
        let blocks = 0..self.header().blocks as u32;
        let block = blocks.rev().find(|&block| self.nodes_before(block) as usize <= ordinal).unwrap_or(0);
        let node = self.levels().node(block, 0).0;
        XfmError::Node { file: self.name().to_owned(), offset: self.place(block).0, node, reason }
    }

    /// Turns what is above each node into ordinals, and checks nesting.
    fn check_references(&self, kept: &mut Kept, half_edges: &[[u32; 4]]) -> Result<(), XfmError> {
        for n in 0..kept.above.len() {
            for (i, h) in half_edges[n].into_iter().enumerate() {
                let Owner::Node(needed, side, _) = owner(h) else { continue };
                let Some(m) = self.ordinal(&kept.flags, needed).filter(|&m| kept.sides[m][side]) else {
                    return Err(self.wrong(n, "it needs a triangle that there is not"));
                };
                kept.above[n][i + 1] = m as u32;
                if self.header().nested && !kept.is_nested(n, m) {
                    return Err(self.wrong(n, "its bounds are not nested in those of a node that it needs"));
                }
            }
            let parent = kept.above[n][0];
            if parent != NONE {
                let Some(m) = self.ordinal(&kept.flags, NodeId(parent)) else {
                    return Err(self.wrong(n, "its parent is not there"));
                };
                kept.above[n][0] = m as u32;
                if !kept.is_nested(n, m) {
                    return Err(self.wrong(n, "its bounds are not nested in those of its parent"));
                }
            }
        }
        Ok(())
    }

    /// Needs and parents have no circle: a walk with an explicit stack, in which no node is met below itself.
    fn check_order(&self, kept: &Kept) -> Result<(), XfmError> {
        const NEW: u8 = 0;
        const OPEN: u8 = 1;
        const DONE: u8 = 2;
        let mut state = vec![NEW; kept.above.len()];
        let mut stack = Vec::new();
        for start in 0..kept.above.len() {
            if state[start] != NEW {
                continue;
            }
            stack.push((start, 0));
            state[start] = OPEN;
            while let Some((n, next)) = stack.last_mut() {
                let Some(&m) = kept.above[*n].get(*next) else {
                    state[*n] = DONE;
                    stack.pop();
                    continue;
                };
                *next += 1;
                match state.get(m as usize) {
                    Some(&NEW) => {
                        state[m as usize] = OPEN;
                        stack.push((m as usize, 0));
                    }
                    Some(&OPEN) => return Err(self.wrong(m as usize, "it needs itself, by way of others")),
                    _ => {}
                }
            }
        }
        Ok(())
    }
}

impl Kept {
    /// Whether the outer sphere holds the inner, with room for rounding, the outer error is no less, and the outer cone
    /// holds the inner.
    fn is_nested(&self, inner: usize, outer: usize) -> bool {
        let (cones, inner, outer) =
            ([inner, outer].map(|n| &self.cones[n]), &self.bounds[inner], &self.bounds[outer]);
        let distance = crate::vector::distance(inner.center, outer.center);
        let room = f64::from(outer.radius) - f64::from(inner.radius) - distance;
        room >= f64::from(outer.radius) * SLACK
            && outer.eps >= inner.eps
            && cone::is_nested(cones[0], cones[1])
    }
}
