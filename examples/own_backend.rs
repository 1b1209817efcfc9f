//! A backend of one's own, that depends on the crate `vertex_tree` alone: a disc whose rim is as round as it has to be.
//!
//! Its hierarchy is not stored anywhere, it is a formula. A node is an arc of the rim, shown as one triangle between its
//! ends and the middle of the disc. To unfold it puts a vertex on the middle of the arc, and shows each half by itself:
//!
//! ```text
//!        b                 b
//!       /|                /|\
//!      / |    unfold     / | m        the triangle of the arc goes on as that of its first half,
//!     /  |   ------>    /  |/|        the one of the second half is new
//!    c---a             c---a-+
//! ```
//!
//! `cargo run --release --example own_backend`

#![expect(clippy::disallowed_methods, reason = "a shape to show")]

use foldfront::glam::DVec3;
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::view::{Camera, View, theta_of_pixels};

/// The backend.
mod disc {
    use std::collections::HashMap;

    use vertex_tree::{
        Bounds, Hierarchy, MeshSink, NodeId, Step, TreeError, TriangleId, VertexId, VertexTree,
    };

    /// Arcs of the base mesh, and how often each can be halved.
    const ROOTS: u32 = 4;
    const LEVELS: u32 = 20;

    /// A disc of radius 1 about the origin, in the plane of x and y.
    pub struct Disc {
        roots: Vec<NodeId>,
        /// For each arc that is shown, its triangle, and the vertices at its ends.
        shown: HashMap<Arc, (TriangleId, [VertexId; 2])>,
        /// Slots that have been used and are free again, of vertices and of triangles.
        free: [Vec<u32>; 2],
        /// Slots that have been used.
        used: [u32; 2],
    }

    /// An arc is a root and a number as in a heap: the halves of `n` are `2n` and `2n + 1`.
    type Arc = (u32, u32);

    /// Arcs with numbers below this are nodes; those beyond can not be halved.
    const HEAP: u32 = 1 << LEVELS;

    fn arc_of(node: NodeId) -> Arc {
        (node.0 / HEAP, node.0 % HEAP)
    }

    fn halves((root, n): Arc) -> [Arc; 2] {
        [(root, 2 * n), (root, 2 * n + 1)]
    }

    /// The vertex in the middle of the disc is the first.
    const MIDDLE: VertexId = 0;

    /// Where an arc begins and how long it is, in radians.
    fn extent((root, n): Arc) -> (f64, f64) {
        let quarter = std::f64::consts::TAU / f64::from(ROOTS);
        let halvings = 1 << n.ilog2();
        let length = quarter / f64::from(halvings);
        (f64::from(root) * quarter + f64::from(n - halvings) * length, length)
    }

    fn point(angle: f64) -> [f32; 3] {
        [angle.cos() as f32, angle.sin() as f32, 0.0]
    }

    impl Disc {
        pub fn new() -> Self {
            let roots = (0..ROOTS).map(|root| NodeId(root * HEAP + 1)).collect();
            Self { roots, shown: HashMap::new(), free: Default::default(), used: [0; 2] }
        }

        fn slot(&mut self, what: usize) -> u32 {
            self.free[what].pop().unwrap_or_else(|| {
                self.used[what] += 1;
                self.used[what] - 1
            })
        }
    }

    impl Hierarchy for Disc {
        const IS_TREE: bool = true;

        fn node_limit(&self) -> u32 {
            ROOTS * HEAP
        }
        fn displayed(&self) -> u64 {
            self.shown.len() as u64
        }
        fn roots(&self) -> &[NodeId] {
            &self.roots
        }
        /// About the middle of the arc, half its length in radius, and a little more so that halves are inside. The error
        /// is the height of the arc over its chord.
        fn bounds(&self, node: NodeId) -> Bounds {
            let (start, length) = extent(arc_of(node));
            let radius = (0.5 * length * 1.001) as f32;
            let eps = (2.0 * (0.25 * length).sin().powi(2)) as f32;
            Bounds { center: point(start + 0.5 * length), radius, eps }
        }
        fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
            let nodes = halves(arc_of(node)).into_iter().filter(|&(_, n)| n < HEAP);
            nodes.map(|(root, n)| NodeId(root * HEAP + n))
        }
        fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
            let (root, n) = arc_of(node);
            (n > 1).then_some(NodeId(root * HEAP + n / 2)).into_iter()
        }
        /// There is no collapse log: any number will do that no other node has.
        fn log_number(&self, node: NodeId) -> u32 {
            node.0
        }
    }

    impl VertexTree for Disc {
        fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
            let middle = self.slot(0);
            assert_eq!(middle, MIDDLE);
            mesh.vertex_added(MIDDLE, [0.0; 3]);
            let ends: Vec<VertexId> = (0..ROOTS).map(|_| self.slot(0)).collect();
            for (at, &end) in ends.iter().enumerate() {
                mesh.vertex_added(end, point(extent(arc_of(self.roots[at])).0));
            }
            for at in 0..ROOTS as usize {
                let (ends, triangle) = ([ends[at], ends[(at + 1) % ends.len()]], self.slot(1));
                mesh.triangle_added(triangle, [MIDDLE, ends[0], ends[1]]);
                self.shown.insert(arc_of(self.roots[at]), (triangle, ends));
            }
            Ok(())
        }

        fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
            let Some((triangle, [a, b])) = self.shown.remove(&arc_of(node)) else { return Ok(Step::Blocked) };
            let (start, length) = extent(arc_of(node));
            let (m, second) = (self.slot(0), self.slot(1));
            mesh.vertex_added(m, point(start + 0.5 * length));
            mesh.corner_moved(triangle, 2, m);
            mesh.triangle_added(second, [MIDDLE, m, b]);
            let [first_half, second_half] = halves(arc_of(node));
            self.shown.insert(first_half, (triangle, [a, m]));
            self.shown.insert(second_half, (second, [m, b]));
            Ok(Step::Done)
        }

        fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
            let [first, second] = halves(arc_of(node)).map(|half| self.shown.remove(&half));
            let (Some((triangle, [a, m])), Some((second, [_, b]))) = (first, second) else {
                return Ok(Step::Blocked);
            };
            mesh.corner_moved(triangle, 2, b);
            mesh.triangle_removed(second);
            mesh.vertex_removed(m);
            self.free[0].push(m);
            self.free[1].push(second);
            self.shown.insert(arc_of(node), (triangle, [a, b]));
            Ok(Step::Done)
        }
    }
}

/// Flies along the rim, ever closer, and says how round it is.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut engine = Engine::new(disc::Disc::new(), ActiveMesh::new(), Settings::default())?;
    for frame in 0..400 {
        let angle = 0.01 * f64::from(frame);
        let height = 0.5 * 0.97_f64.powi(frame);
        let rim = DVec3::new(angle.cos(), angle.sin(), 0.0);
        let camera = Camera::look_at(rim * (1.0 + height) + DVec3::Z * height, rim, DVec3::Z, 1.0, 1.5)?;
        let report = engine.advance(&[View::new(&camera, theta_of_pixels(0.5, 1080))?])?;
        engine.sink_mut().clear_changes();
        assert_eq!(report.displayed, engine.sink().displayed() as u64);
        // Every triangle has its share of the disc: together they have the area of the polygon.
        let mesh = engine.sink();
        let at = |v: u32| DVec3::from(mesh.positions()[v as usize].map(f64::from));
        let area = |[a, b, c]: [u32; 3]| 0.5 * (at(b) - at(a)).cross(at(c) - at(a)).z;
        let area: f64 = mesh.displayed_triangles().map(|(_, corners)| area(corners)).sum();
        assert!(area > 1.99 && area < std::f64::consts::PI, "frame {frame}: {area}");
        if frame % 100 == 99 {
            println!("{height:.6} above the rim: {} triangles, {area:.6} of pi", report.displayed);
        }
    }
    Ok(())
}
