//! A backend that does as it should passes; one that lies is found, however it lies.

use vertex_tree::{Bounds, Hierarchy, MeshSink, NodeId, NormalCone, Step, TreeError, VertexTree};

use crate::{conforms, conforms_with_mesh};

/// What is wrong with a backend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Lie {
    Nothing,
    /// It counts one triangle too many once enough is shown.
    Displayed,
    /// A node sticks out of its parent.
    Bounds,
    /// It refuses to unfold a node.
    Refusal,
    /// It never lets go of a triangle that it has shown.
    Mesh,
    /// It has no nodes.
    Empty,
}

/// A strip of triangles along a line, halved over and over: node `n` has the children `2 n + 1` and `2 n + 2`, and shows one triangle
/// while it is folded.
pub(crate) struct Strip {
    lie: Lie,
    roots: Vec<NodeId>,
    displayed: u64,
}

const NODES: u32 = (1 << 10) - 1;

impl Strip {
    pub(crate) fn new(lie: Lie) -> Self {
        Self { lie, roots: if lie == Lie::Empty { vec![] } else { vec![NodeId(0)] }, displayed: 1 }
    }

    /// Where a node, or a leaf, is.
    fn extent(node: u32) -> [f32; 2] {
        let level = (node + 1).ilog2();
        let length = 8.0 / (1 << level) as f32;
        let start = (node + 1 - (1 << level)) as f32 * length;
        [start, start + length]
    }

    fn show<M: MeshSink>(&mut self, node: u32, mesh: &mut M) {
        let [a, b] = Self::extent(node);
        for (corner, place) in [[a, 0.0, 0.0], [b, 0.0, 0.0], [a, 1.0, 0.0]].into_iter().enumerate() {
            mesh.vertex_added(3 * node + corner as u32, place);
        }
        mesh.triangle_added(node, [3 * node, 3 * node + 1, 3 * node + 2]);
        self.displayed += 1;
    }

    fn hide<M: MeshSink>(&mut self, node: u32, mesh: &mut M) {
        mesh.triangle_removed(node);
        (0..3).for_each(|corner| mesh.vertex_removed(3 * node + corner));
        self.displayed -= 1;
    }
}

impl Hierarchy for Strip {
    const IS_TREE: bool = true;
    const HAS_CONES: bool = true;

    fn node_limit(&self) -> u32 {
        NODES
    }

    fn displayed(&self) -> u64 {
        self.displayed + u64::from(self.lie == Lie::Displayed && self.displayed > 20)
    }

    fn roots(&self) -> &[NodeId] {
        &self.roots
    }

    fn bounds(&self, NodeId(node): NodeId) -> Bounds {
        let [a, b] = Self::extent(node);
        let level = (node + 1).ilog2();
        let radius = if self.lie == Lie::Bounds && node == 77 { 9.0 } else { 0.75 * (b - a) + 1.0 };
        Bounds { center: [(a + b) / 2.0, 0.0, 0.0], radius, eps: 1.0 / (1 << level) as f32 }
    }

    /// All triangles face the same way; the fewer there are, the more the cone says so.
    fn normal_cone(&self, NodeId(node): NodeId) -> NormalCone {
        NormalCone { axis: [0.0, 0.0, 1.0], sine: 0.8 - 0.07 * (node + 1).ilog2() as f32 }
    }

    fn children(&self, NodeId(node): NodeId) -> impl Iterator<Item = NodeId> {
        [2 * node + 1, 2 * node + 2].into_iter().filter(|&child| child < NODES).map(NodeId)
    }

    fn parents(&self, NodeId(node): NodeId) -> impl Iterator<Item = NodeId> {
        node.checked_sub(1).map(|n| NodeId(n / 2)).into_iter()
    }
}

impl VertexTree for Strip {
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        self.displayed = 0;
        self.show(0, mesh);
        Ok(())
    }

    fn unfold<M: MeshSink>(&mut self, NodeId(node): NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        if self.lie == Lie::Refusal && node == 100 {
            return Ok(Step::Blocked);
        }
        self.hide(node, mesh);
        self.show(2 * node + 1, mesh);
        self.show(2 * node + 2, mesh);
        Ok(Step::Done)
    }

    fn fold<M: MeshSink>(&mut self, NodeId(node): NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        self.hide(2 * node + 1, mesh);
        if self.lie == Lie::Mesh {
            self.displayed -= 1;
        } else {
            self.hide(2 * node + 2, mesh);
        }
        self.show(node, mesh);
        Ok(Step::Done)
    }
}

#[test]
fn a_backend_that_does_as_it_should_passes() {
    let totals = conforms_with_mesh(|| Strip::new(Lie::Nothing));
    assert_eq!((totals.nodes, totals.frames), (u64::from(NODES), 600));
    assert!(totals.changes > 4_000 && totals.tests[0] < totals.tests[1] / 4, "{totals:?}");
}

#[test]
#[should_panic(expected = "what is displayed")]
fn one_that_miscounts_is_found() {
    conforms(|| Strip::new(Lie::Displayed));
}

#[test]
#[should_panic(expected = "sticks out")]
fn one_whose_bounds_are_not_nested_is_found() {
    conforms(|| Strip::new(Lie::Bounds));
}

#[test]
#[should_panic(expected = "nodes are wrong")]
fn one_that_refuses_is_found() {
    // By brute force it unfolds everything, and then not.
    let mut opened = 0;
    conforms(|| {
        opened += 1;
        Strip::new(if opened == 1 { Lie::Nothing } else { Lie::Refusal })
    });
}

#[test]
#[should_panic(expected = "triangle")]
fn one_whose_mesh_is_none_is_found() {
    conforms_with_mesh(|| Strip::new(Lie::Mesh));
}

#[test]
#[should_panic(expected = "proves nothing")]
fn nothing_proves_nothing() {
    conforms(|| Strip::new(Lie::Empty));
}
