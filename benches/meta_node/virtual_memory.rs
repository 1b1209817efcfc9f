//! What meta-nodes are compared with: the arrays of the in-memory tree in a file, mapped into memory and paged by the
//! operating system (El-Sana & Chiang 2000, section 4, "Virt.").
//!
//! The layout is that of the backend `in-memory`: a node is a cache line with the bounds of its children, nodes in
//! preorder, leaves in the order of that walk, triangles by the node that brings them.
//!
//! ```text
//! header, 16 u32: nodes, leaves, triangles, of these brought by nodes, roots, base vertices, 0...
//! nodes, 64 bytes each; places, 12 bytes a leaf; corners, 12 bytes a triangle
//! roots, 24 bytes each (node, bounds); base vertices, 4 bytes each
//! ```

use std::io::Write;
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use foldfront::collapse_log::CollapseLog;
use foldfront::container::output;
use foldfront::page_store::source::MappedSource;
use foldfront::star_mesh::{LeafTriangle, StarMesh};
use foldfront::vertex_tree::{
    Bounds, Hierarchy, MeshSink, NONE, NodeId, PageStats, Step, TreeError, VertexTree,
};

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Node {
    first: u32,
    pivot: u32,
    end: u32,
    parent: u32,
    triangles: u32,
    log_number: u32,
    child_bounds: [Bounds; 2],
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Root {
    node: u32,
    bounds: Bounds,
}

/// Writes the arrays of a log.
pub fn write(path: &Path, log: &CollapseLog) {
    let forest = log.forest().expect("a valid log");
    let (count, leaves) = (log.collapses.len(), log.mesh.positions.len());
    let mut nodes = vec![Node::zeroed(); count];
    let mut below = vec![0_u32; count];
    let of = |below: &[u32], child: u32| if child == NONE { 1 } else { below[child as usize] };
    for n in 0..count {
        below[n] = of(&below, forest.kept_child[n]) + of(&below, forest.removed_child[n]);
    }
    let (mut number, mut first) = (vec![0_u32; count], vec![0_u32; count]);
    let (mut roots, mut base, mut vertex) = (Vec::new(), Vec::new(), vec![0_u32; leaves]);
    let (mut next, mut next_leaf) = (0, 0);
    for n in (0..count).rev() {
        let c = &log.collapses[n];
        if forest.parent[n] == NONE {
            (number[n], first[n]) = (next, next_leaf);
            roots.push(Root { node: next, bounds: c.bounds });
            base.push(next_leaf);
            next += below[n] - 1;
            next_leaf += below[n];
        }
        let (kept, removed, id) = (forest.kept_child[n], forest.removed_child[n], number[n]);
        let left = of(&below, kept);
        let pivot = first[n] + left;
        let node = &mut nodes[id as usize];
        (node.first, node.pivot, node.end, node.log_number) =
            (first[n], pivot, first[n] + below[n], n as u32);
        node.parent = if forest.parent[n] == NONE { NONE } else { number[forest.parent[n] as usize] };
        let sides = [(kept, c.kept, id + 1, first[n]), (removed, c.removed, id + left, pivot)];
        for (side, (child, v, child_id, at)) in sides.into_iter().enumerate() {
            if child == NONE {
                vertex[at as usize] = v;
            } else {
                (number[child as usize], first[child as usize]) = (child_id, at);
                node.child_bounds[side] = log.collapses[child as usize].bounds;
            }
        }
    }
    for (v, _) in forest.root_of_vertex.iter().enumerate().filter(|&(_, &root)| root == NONE) {
        vertex[next_leaf as usize] = v as u32;
        base.push(next_leaf);
        next_leaf += 1;
    }
    let (triangles, brought) = sort(log, &mut nodes, &vertex);
    let mut header = [0_u32; 16];
    let counts = [count, leaves, triangles.len(), brought, roots.len(), base.len()];
    header.iter_mut().zip(counts).for_each(|(word, count)| *word = count as u32);
    let places: Vec<[f32; 3]> = vertex.iter().map(|&v| log.mesh.positions[v as usize]).collect();
    output::write_with(path, |file| {
        file.write_all(bytemuck::cast_slice(&header))?;
        file.write_all(bytemuck::cast_slice(&nodes))?;
        file.write_all(bytemuck::cast_slice(&places))?;
        file.write_all(bytemuck::cast_slice(&triangles))?;
        file.write_all(bytemuck::cast_slice(&roots))?;
        file.write_all(bytemuck::cast_slice(&base))
    })
    .expect("target is writable");
}

/// The triangles by the node that brings them, those of the base mesh last; how many some node brings.
fn sort(log: &CollapseLog, nodes: &mut [Node], vertex: &[u32]) -> (Vec<[u32; 3]>, usize) {
    let mut leaf_of = vec![0_u32; vertex.len()];
    vertex.iter().enumerate().for_each(|(leaf, &v)| leaf_of[v as usize] = leaf as u32);
    let mut above = vec![NONE; vertex.len()];
    for (id, node) in nodes.iter().enumerate() {
        for (start, end) in [(node.first, node.pivot), (node.pivot, node.end)] {
            if end - start == 1 {
                above[start as usize] = id as u32;
            }
        }
    }
    let meet = |low: u32, high: u32| {
        let mut n = above[low as usize];
        while n != NONE && nodes[n as usize].end <= high {
            n = nodes[n as usize].parent;
        }
        n
    };
    let span = |n: u32| if n == NONE { u32::MAX } else { nodes[n as usize].end - nodes[n as usize].first };
    let mut all: Vec<(u32, [u32; 3])> = Vec::new();
    for corners in &log.mesh.triangles {
        let leaves = corners.map(|v| leaf_of[v as usize]);
        let [a, b, c] = {
            let mut sorted = leaves;
            sorted.sort_unstable();
            sorted
        };
        if a != b && b != c {
            let (ab, bc) = (meet(a, b), meet(b, c));
            let bringer = if span(ab) <= span(bc) { ab } else { bc };
            let mut leaves = leaves;
            if let Some(&Node { first, end, .. }) = nodes.get(bringer as usize) {
                // The corner that is not below the node comes first.
                let far = leaves.iter().position(|leaf| !(first..end).contains(leaf)).unwrap_or(0);
                leaves.rotate_left(far);
            }
            all.push((bringer, leaves));
        }
    }
    all.sort_by_key(|&(bringer, _)| bringer);
    let mut at = 0;
    for (id, node) in nodes.iter_mut().enumerate() {
        node.triangles = at as u32;
        while all.get(at).is_some_and(|&(bringer, _)| bringer == id as u32) {
            at += 1;
        }
    }
    (all.into_iter().map(|(_, leaves)| leaves).collect(), at)
}

/// The in-memory tree over a mapped file.
pub struct MappedTree {
    map: MappedSource,
    counts: [usize; 6],
    roots: Vec<NodeId>,
    root_bounds: Vec<Bounds>,
    base: Vec<u32>,
    mesh: Option<StarMesh>,
    displayed: u64,
}

const HEADER: usize = 64;

impl MappedTree {
    /// `is_random` tells the operating system not to read around what is touched.
    pub fn open(path: &Path, is_random: bool) -> Self {
        #[expect(unsafe_code, reason = "virtual memory is what is compared with")]
        // SAFETY: the file is in a temporary folder of this process, which does not touch it any more.
        let map = unsafe { MappedSource::open(path) }.expect("just written");
        if is_random {
            map.expect_random_access().expect("advice is taken");
        }
        let words: &[u32] = bytemuck::cast_slice(&map.bytes()[..HEADER]);
        let counts: [usize; 6] = std::array::from_fn(|i| words[i] as usize);
        let mut tree = Self {
            map,
            counts,
            roots: Vec::new(),
            root_bounds: Vec::new(),
            base: Vec::new(),
            mesh: None,
            displayed: 0,
        };
        let [nodes, leaves, triangles, _, roots, base] = counts;
        let at = HEADER + 64 * nodes + 12 * leaves + 12 * triangles;
        let all: Vec<Root> = tree.array(at, roots).to_vec();
        tree.roots = all.iter().map(|root| NodeId(root.node)).collect();
        tree.root_bounds = all.iter().map(|root| root.bounds).collect();
        tree.base = tree.array(at + 24 * roots, base).to_vec();
        tree
    }

    #[inline(always)]
    fn array<T: Pod>(&self, at: usize, count: usize) -> &[T] {
        bytemuck::cast_slice(&self.map.bytes()[at..at + count * size_of::<T>()])
    }
    #[inline(always)]
    fn nodes(&self) -> &[Node] {
        self.array(HEADER, self.counts[0])
    }
    #[inline(always)]
    fn places(&self) -> &[[f32; 3]] {
        self.array(HEADER + 64 * self.counts[0], self.counts[1])
    }
    #[inline(always)]
    fn corners(&self) -> &[[u32; 3]] {
        self.array(HEADER + 64 * self.counts[0] + 12 * self.counts[1], self.counts[2])
    }
    #[inline(always)]
    fn brought(&self, node: NodeId) -> std::ops::Range<usize> {
        let nodes = self.nodes();
        let end = nodes.get(node.index() + 1).map_or(self.counts[3], |next| next.triangles as usize);
        nodes[node.index()].triangles as usize..end
    }
}

impl Hierarchy for MappedTree {
    const IS_TREE: bool = true;

    fn node_limit(&self) -> u32 {
        self.counts[0] as u32
    }
    fn displayed(&self) -> u64 {
        self.displayed
    }
    fn roots(&self) -> &[NodeId] {
        &self.roots
    }
    fn bounds(&self, node: NodeId) -> Bounds {
        match self.nodes()[node.index()].parent {
            NONE => self.root_bounds[self.roots.partition_point(|&root| root < node)],
            parent => self.nodes()[parent as usize].child_bounds[usize::from(node.0 != parent + 1)],
        }
    }
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.children_and_bounds(node).map(|(child, _)| child)
    }
    fn children_and_bounds(&self, node: NodeId) -> impl Iterator<Item = (NodeId, Bounds)> {
        let &Node { first, pivot, end, child_bounds, .. } = &self.nodes()[node.index()];
        let left = (pivot - first > 1).then_some((NodeId(node.0 + 1), child_bounds[0]));
        let right = (end - pivot > 1).then_some((NodeId(node.0 + (pivot - first)), child_bounds[1]));
        left.into_iter().chain(right)
    }
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        Some(self.nodes()[node.index()].parent).filter(|&p| p != NONE).map(NodeId).into_iter()
    }
    fn log_number(&self, node: NodeId) -> u32 {
        self.nodes()[node.index()].log_number
    }
    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        Ok(PageStats::default())
    }
}

impl VertexTree for MappedTree {
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        self.displayed = (self.counts[2] - self.counts[3]) as u64;
        let base = &self.corners()[self.counts[3]..];
        if M::KEEPS_MESH {
            let mut stars = StarMesh::new(self.counts[1]);
            for &leaf in &self.base {
                stars.add_vertex(leaf, self.places()[leaf as usize], mesh);
            }
            base.iter().for_each(|&leaves| stars.add_triangle(LeafTriangle::new(leaves, 0, 0), mesh));
            self.mesh = Some(stars);
        }
        Ok(())
    }
    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let brought = self.brought(node);
        self.displayed += brought.len() as u64;
        if let Some(mut stars) = self.mesh.take() {
            let Node { first, pivot, .. } = self.nodes()[node.index()];
            let brought = self.corners()[brought].iter().map(|&leaves| LeafTriangle::new(leaves, 0, 0));
            stars.split([first, pivot], self.places()[pivot as usize], brought, mesh);
            self.mesh = Some(stars);
        }
        Ok(Step::Done)
    }
    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        self.displayed -= self.brought(node).len() as u64;
        let Node { first, pivot, .. } = self.nodes()[node.index()];
        if let Some(stars) = &mut self.mesh {
            stars.merge([first, pivot], mesh);
        }
        Ok(Step::Done)
    }
    fn update_mesh<M: MeshSink>(&mut self, mesh: &mut M) {
        if let Some(stars) = &mut self.mesh {
            stars.update(mesh);
        }
    }
}
