//! Unfolds and folds a tree as the engine does, with a sink that checks every call, and no criterion.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::{Arrangement, Settings, XfmFile, XfmTree};
use collapse_log::CollapseLog;
use page_store::source::MemorySource;
use vertex_tree::{Hierarchy, MeshSink, NodeId, Step, TreeError, TriangleId, VertexId, VertexTree};

/// Keeps the displayed mesh and holds the tree to the order of calls that is promised.
#[derive(Default)]
pub struct StrictMesh {
    pub triangles: BTreeMap<TriangleId, [VertexId; 3]>,
    pub vertices: BTreeMap<VertexId, ([f32; 3], usize)>,
}

impl MeshSink for StrictMesh {
    fn vertex_added(&mut self, vertex: VertexId, position: [f32; 3]) {
        assert!(self.vertices.insert(vertex, (position, 0)).is_none(), "vertex {vertex} was there");
    }
    fn vertex_removed(&mut self, vertex: VertexId) {
        assert_eq!(self.vertices.remove(&vertex).map(|v| v.1), Some(0), "vertex {vertex}: corners");
    }
    fn triangle_added(&mut self, triangle: TriangleId, corners: [VertexId; 3]) {
        corners.iter().for_each(|v| self.vertices.get_mut(v).unwrap().1 += 1);
        assert!(self.triangles.insert(triangle, corners).is_none(), "triangle {triangle} was there");
    }
    fn triangle_removed(&mut self, triangle: TriangleId) {
        let corners = self.triangles.remove(&triangle).unwrap();
        corners.iter().for_each(|v| self.vertices.get_mut(v).unwrap().1 -= 1);
    }
    fn corner_moved(&mut self, triangle: TriangleId, corner: usize, to: VertexId) {
        let corners = self.triangles.get_mut(&triangle).unwrap();
        let from = std::mem::replace(&mut corners[corner], to);
        self.vertices.get_mut(&from).unwrap().1 -= 1;
        self.vertices.get_mut(&to).unwrap().1 += 1;
    }
}

/// A triangle by the positions of its corners, in the least of its three rotations (two corners may be at one place): what
/// meshes are compared by.
pub fn key([a, b, c]: [[u32; 3]; 3]) -> [[u32; 3]; 3] {
    [a, b, c].min([b, c, a]).min([c, a, b])
}

/// The triangles that a log shows for a set of active nodes, by brute force.
pub fn displayed(log: &CollapseLog, active: &BTreeSet<u32>) -> Vec<[[u32; 3]; 3]> {
    let mut at: Vec<u32> = (0..log.mesh.positions.len() as u32).collect();
    for (n, c) in log.collapses.iter().enumerate().rev() {
        if !active.contains(&(n as u32)) {
            at[c.removed as usize] = at[c.kept as usize];
        }
    }
    let shown = log.mesh.triangles.iter().map(|t| t.map(|v| at[v as usize]));
    let shown = shown.filter(|&[a, b, c]| a != b && b != c && c != a);
    let mut keys: Vec<_> =
        shown.map(|t| key(t.map(|v| log.mesh.positions[v as usize].map(f32::to_bits)))).collect();
    keys.sort_unstable();
    keys
}

/// A tree, its sink, and which of its nodes are active.
pub struct Driver {
    pub tree: XfmTree,
    pub mesh: StrictMesh,
    pub active: BTreeSet<NodeId>,
    pub forced: u64,
    pub still_needed: u64,
    pub not_resident: u64,
}

/// The bytes of a file.
pub fn bytes_of(arrangement: &Arrangement) -> Vec<u8> {
    let mut bytes = Vec::new();
    arrangement.write_to(&mut bytes).unwrap();
    assert_eq!(bytes.len() as u64, arrangement.report().bytes);
    bytes
}

pub fn open(bytes: Vec<u8>) -> Arc<XfmFile> {
    Arc::new(XfmFile::open(Arc::new(MemorySource::new("bytes", bytes))).unwrap())
}

impl Driver {
    pub fn new(file: &Arc<XfmFile>, settings: Settings) -> Self {
        let mut tree = XfmTree::new(file.clone(), settings).unwrap();
        let mut mesh = StrictMesh::default();
        tree.base_mesh(&mut mesh).unwrap();
        Self { tree, mesh, active: BTreeSet::new(), forced: 0, still_needed: 0, not_resident: 0 }
    }

    pub fn is_collapsible(&self, node: NodeId) -> bool {
        self.active.contains(&node) && self.tree.children(node).all(|c| !self.active.contains(&c))
    }

    /// Unfolds a boundary node and what it needs. Says whether it is active then.
    pub fn unfold(&mut self, node: NodeId) -> Result<bool, TreeError> {
        let mut stack = vec![node];
        while let Some(&node) = stack.last() {
            if self.active.contains(&node) {
                stack.pop();
                continue;
            }
            if let Some(parent) = self.tree.parents(node).find(|p| !self.active.contains(p)) {
                if stack.contains(&parent) {
                    return Ok(false);
                }
                stack.push(parent);
                continue;
            }
            match self.tree.unfold(node, &mut self.mesh)? {
                Step::Done => {
                    self.active.insert(node);
                    self.forced += u64::from(stack.len() > 1);
                    stack.pop();
                    // The engine asks for these at once.
                    assert!(self.tree.children_and_bounds(node).all(|(_, b)| b.radius >= 0.0));
                }
                Step::Needs(other) if !stack.contains(&other) => stack.push(other),
                Step::NotResident => {
                    self.not_resident += 1;
                    return Ok(false);
                }
                _ => return Ok(false),
            }
        }
        Ok(true)
    }

    /// Folds a collapsible node, unless it is still needed.
    pub fn fold(&mut self, node: NodeId) -> Result<bool, TreeError> {
        match self.tree.fold(node, &mut self.mesh)? {
            Step::Done => {
                self.active.remove(&node);
                Ok(true)
            }
            Step::StillNeeded => {
                self.still_needed += 1;
                Ok(false)
            }
            step => panic!("{step:?}"),
        }
    }

    /// Nodes that can be unfolded next.
    pub fn boundary(&self) -> Vec<NodeId> {
        let roots = self.tree.roots().iter().copied();
        let below = self.active.iter().flat_map(|&n| self.tree.children(n).collect::<Vec<_>>());
        roots.chain(below).filter(|n| !self.active.contains(n)).collect()
    }

    /// What is displayed is what the log shows.
    pub fn assert_shows(&self, log: &CollapseLog) {
        let numbers = self.active.iter().map(|&n| self.tree.log_number(n)).collect();
        let position = |v: VertexId| self.mesh.vertices[&v].0.map(f32::to_bits);
        let mut shown: Vec<_> = self.mesh.triangles.values().map(|t| key(t.map(position))).collect();
        shown.sort_unstable();
        assert!(shown == displayed(log, &numbers), "the displayed triangles are not those of the log");
        assert_eq!(self.tree.displayed(), shown.len() as u64);
    }
}
