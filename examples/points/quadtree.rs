//! A quadtree of points: a hierarchy whose items are no triangles, and whose refinement adds.
//!
//! A cell shows a sample of its points, about [`SAMPLE`] a side, spread evenly; the others are in its quarters, of which each does the
//! same. A node is a cell with quarters. Unfolding it adds the points that they show, and its own stay.

use std::ops::Range;

use foldfront::vertex_tree::{Bounds, Hierarchy, NodeId, NullSink, Refine, Step, TreeError};

/// Displays points.
pub trait PointSink {
    /// Some points appear: their numbers in the tree, and where they are.
    fn points_added(&mut self, numbers: Range<u32>, positions: &[[f32; 3]]);
    /// Some points disappear.
    fn points_removed(&mut self, numbers: Range<u32>);
}

impl PointSink for NullSink {
    fn points_added(&mut self, _: Range<u32>, _: &[[f32; 3]]) {}
    fn points_removed(&mut self, _: Range<u32>) {}
}

/// Places for points of a cell's sample, along a side.
const SAMPLE: usize = 8;
/// Quarters of quarters: where points are as close as this, a cell shows them all.
const DEEPEST: u32 = 24;

struct Node {
    bounds: Bounds,
    parent: Option<NodeId>,
    children: Vec<NodeId>,
    /// What unfolding adds.
    adds: Range<u32>,
}

/// Points in a quadtree over x and y. All of it is in memory.
#[derive(Default)]
pub struct PointTree {
    nodes: Vec<Node>,
    /// Those that one node adds stand together; first those of the whole square.
    points: Vec<[f32; 3]>,
    at_first: u32,
    roots: Vec<NodeId>,
    displayed: u64,
}

/// A square, and the points in it that are not shown yet.
struct Cell {
    corner: [f32; 2],
    side: f32,
    rest: Vec<[f32; 3]>,
}

impl Cell {
    /// The place of a point on a grid of so many cells along a side.
    fn place(&self, point: [f32; 3], along: usize) -> usize {
        let [x, y] = [0, 1].map(|i| ((point[i] - self.corner[i]) / self.side * along as f32) as usize);
        along * y.min(along - 1) + x.min(along - 1)
    }

    /// Moves the sample from `rest` to `points`.
    fn show(&mut self, points: &mut Vec<[f32; 3]>, level: u32) {
        let mut taken = [false; SAMPLE * SAMPLE];
        let rest = std::mem::take(&mut self.rest);
        for point in rest {
            let place = self.place(point, SAMPLE);
            if std::mem::replace(&mut taken[place], true) && level < DEEPEST {
                self.rest.push(point);
            } else {
                points.push(point);
            }
        }
    }

    fn quarters(self) -> [Cell; 4] {
        let side = self.side / 2.0;
        let [x, y] = self.corner;
        let mut quarters = [[x, y], [x + side, y], [x, y + side], [x + side, y + side]].map(|corner| Cell {
            corner,
            side,
            rest: Vec::new(),
        });
        self.rest.iter().for_each(|&point| quarters[self.place(point, 2)].rest.push(point));
        quarters
    }
}

impl PointTree {
    /// A tree of points, all of which are finite.
    pub fn new(points: &[[f32; 3]]) -> Self {
        let corner = [0, 1].map(|i| points.iter().map(|p| p[i]).fold(f32::MAX, f32::min));
        let side = |i: usize| points.iter().map(|p| p[i] - corner[i]).fold(f32::MIN_POSITIVE, f32::max);
        let mut square = Cell { corner, side: side(0).max(side(1)), rest: points.to_vec() };
        let mut tree = Self::default();
        square.show(&mut tree.points, 0);
        tree.at_first = tree.points.len() as u32;
        let root = tree.add(square, None, 0);
        tree.roots.extend(root);
        tree
    }

    /// Adds the node of a cell whose sample is shown already, if it has points left, and those below it.
    fn add(&mut self, cell: Cell, parent: Option<NodeId>, level: u32) -> Option<NodeId> {
        if cell.rest.is_empty() {
            return None;
        }
        let node = NodeId(self.nodes.len() as u32);
        let eps = cell.side / SAMPLE as f32;
        let first = self.points.len();
        let bounds = Bounds { center: cell.rest[0], radius: 0.0, eps };
        self.nodes.push(Node { bounds, parent, children: Vec::new(), adds: 0..0 });
        let mut quarters = cell.quarters();
        quarters.iter_mut().for_each(|quarter| quarter.show(&mut self.points, level + 1));
        self.nodes[node.index()].adds = first as u32..self.points.len() as u32;
        let children = quarters.into_iter().filter_map(|quarter| self.add(quarter, Some(node), level + 1));
        let children: Vec<NodeId> = children.collect();
        // Around what unfolding adds and around the spheres of the children, a little wider than rounding.
        let center = bounds.center;
        let distance = |p: [f32; 3]| (0..3).map(|i| p[i] - center[i]).map(|d| d * d).sum::<f32>().sqrt();
        let points =
            self.points[first..self.nodes[node.index()].adds.end as usize].iter().map(|&p| distance(p));
        let below = children.iter().map(|child| self.bounds(*child)).map(|b| distance(b.center) + b.radius);
        let radius = points.chain(below).fold(0.0, f32::max) * (1.0 + 1e-6);
        let this = &mut self.nodes[node.index()];
        (this.bounds.radius, this.children) = (radius, children);
        Some(node)
    }

    fn positions(&self, numbers: &Range<u32>) -> &[[f32; 3]] {
        &self.points[numbers.start as usize..numbers.end as usize]
    }
}

impl Hierarchy for PointTree {
    const IS_TREE: bool = true;

    fn node_limit(&self) -> u32 {
        self.nodes.len() as u32
    }

    fn displayed(&self) -> u64 {
        self.displayed
    }

    fn roots(&self) -> &[NodeId] {
        &self.roots
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        self.nodes[node.index()].bounds
    }

    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.nodes[node.index()].children.iter().copied()
    }

    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.nodes[node.index()].parent.into_iter()
    }
}

impl<S: PointSink> Refine<S> for PointTree {
    fn start(&mut self, sink: &mut S) -> Result<(), TreeError> {
        self.displayed = u64::from(self.at_first);
        sink.points_added(0..self.at_first, self.positions(&(0..self.at_first)));
        Ok(())
    }

    fn unfold_into(&mut self, node: NodeId, sink: &mut S) -> Result<Step, TreeError> {
        let adds = self.nodes[node.index()].adds.clone();
        self.displayed += adds.len() as u64;
        sink.points_added(adds.clone(), self.positions(&adds));
        Ok(Step::Done)
    }

    fn fold_into(&mut self, node: NodeId, sink: &mut S) -> Result<Step, TreeError> {
        let adds = self.nodes[node.index()].adds.clone();
        self.displayed -= adds.len() as u64;
        sink.points_removed(adds);
        Ok(Step::Done)
    }
}
