//! Spheres and errors of the nodes, nested and saturated over everything that must be folded before.
//!
//! A collapse replaces the star of a vertex. It can be made only where that star is as it was when the collapse was
//! recorded, so it depends on the collapses that made the star what it is:
//!
//! * its two children in the tree,
//! * for each triangle of the star, the collapse that last moved a corner of it (these are the arcs of a
//!   multi-triangulation: De Floriani, Magillo & Puppo 1997),
//! * the collapse that last took a triangle away from the removed vertex and left no trace in the others. That happens
//!   at boundaries: when an ear vanishes, its tip is merged away, and no triangle around the third corner changes. Were
//!   the third corner free to go first, it would drag the ear along. Such a collapse leaves its mark at the vertex, and
//!   depends on the mark that it overwrites.
//!
//! For each of these predecessors `m` of a node `n`
//!
//! ```text
//! |c_n - c_m| + r_m <= r_n    and    eps_m <= eps_n.
//! ```
//!
//! Both unfold tests of the criterion, `d < r` and `d <= r + eps k`, then pass for `n` wherever they pass for `m`, and
//! a view cone that touches the sphere of `m` touches that of `n`. So the set of nodes that want to be unfolded is
//! closed under all predecessors, whatever the camera, and every triangle it shows is one that the simplification
//! itself went through.

use collapse_log::Collapse;
use glam::DVec3;
use vertex_tree::{Bounds, NONE};

use super::ball::{Ball, enclosing_center, radius_around};

/// By this part a sphere is larger than it need be, so that rounding in a later test can not invert parent and
/// child. Twice 2^-20, because the promise is in terms of the larger radius.
const RELATIVE_SLACK: f64 = 1.0 / (1 << 19) as f64;
/// And by this part of the extent of the mesh,
const ABSOLUTE_SLACK: f64 = 1.0 / (1_u64 << 40) as f64;
/// but at most by this part of an edge, however far out a single vertex lies. It is needed where the eye is so far away that
/// 2^-20 of a radius drowns in the rounding of the distance, which is 2^-52 of that: beyond 2^30 radii, where nothing is wanted
/// unless `k` is as large.
const LARGEST_SLACK: f64 = 1.0 / (1 << 10) as f64;

/// The nodes made so far, in object units.
#[derive(Debug)]
pub(super) struct Nodes {
    pub collapses: Vec<Collapse>,
    /// For each node, the key of its collapse, or more: see [`add`](Self::add).
    pub keys: Vec<f32>,
    /// For each node, its number in the whole construction, where only some are here, in any order.
    pub ids: Option<Vec<u32>>,
    /// The number in the whole construction that the next node gets.
    pub next_id: u32,
    /// The number in the whole construction of the round's first node.
    pub first_of_round: u32,
    /// Nodes that depend on another of their round.
    pub followers: usize,
    /// For each node, the number of edges on the longest way down to a leaf.
    pub height: Vec<u32>,
    /// For each node, the length of the longest chain of predecessors down to the input, counting itself.
    pub depth: Vec<u32>,
    /// For each vertex, the node at which it now stands, or `NONE`.
    pub top: Vec<u32>,
    /// For each vertex, the node that last took a triangle from it and gave none, or `NONE`.
    pub trace: Vec<u32>,
    /// For each vertex, the distance to the farthest corner of its input triangles.
    pub leaf_radius: Vec<f32>,
    slack: f64,
    predecessors: Vec<u32>,
    balls: Vec<Ball>,
}

impl Nodes {
    /// `extent` is the diagonal of the mesh's bounding box, `unit` about the median length of an edge.
    pub fn new(leaf_radius: Vec<f32>, extent: f64, unit: f64) -> Nodes {
        Nodes {
            collapses: Vec::with_capacity(leaf_radius.len()),
            keys: Vec::with_capacity(leaf_radius.len()),
            ids: None,
            next_id: 0,
            first_of_round: 0,
            followers: 0,
            height: Vec::with_capacity(leaf_radius.len()),
            depth: Vec::with_capacity(leaf_radius.len()),
            top: vec![NONE; leaf_radius.len()],
            trace: vec![NONE; leaf_radius.len()],
            leaf_radius,
            slack: (extent * ABSOLUTE_SLACK).min(unit * LARGEST_SLACK),
            predecessors: Vec::new(),
            balls: Vec::new(),
        }
    }

    /// The number that the next node gets.
    pub fn next(&self) -> u32 {
        self.collapses.len() as u32
    }

    /// The number of a node in the whole construction.
    pub fn id(&self, node: u32) -> u32 {
        self.ids.as_ref().map_or(node, |ids| ids[node as usize])
    }

    /// Whether `node` is one of this round.
    pub fn is_new(&self, node: u32) -> bool {
        node != NONE && self.id(node) >= self.first_of_round
    }

    /// Makes the node of a collapse, unless its sphere is too large for single precision, and says whether it has.
    /// `creators` are the collapses that last changed the triangles around `removed`, `NONE` for untouched ones;
    /// `bereaved` are the vertices that lose a triangle and get none; `positions` are those of the two vertices. Where the
    /// collapse depends on another of the round, its key is no less than that one's, so that the order of keys is one in which
    /// they can be made.
    pub fn add(
        &mut self,
        [removed, kept]: [u32; 2],
        positions: [DVec3; 2],
        creators: impl Iterator<Item = u32>,
        bereaved: &[u32],
        error: f32,
        key: f32,
    ) -> bool {
        self.predecessors.clear();
        self.balls.clear();
        let mut height = 0;
        for (v, center) in [removed, kept].into_iter().zip(positions) {
            match self.top[v as usize] {
                NONE => self.balls.push(Ball { center, radius: f64::from(self.leaf_radius[v as usize]) }),
                node => {
                    height = self.height[node as usize].max(height);
                    self.predecessors.push(node);
                }
            }
        }
        let traces = bereaved.iter().chain([&removed]).map(|&v| self.trace[v as usize]);
        self.predecessors.extend(creators.chain(traces).filter(|&node| node != NONE));
        if let Some(ids) = &self.ids {
            self.predecessors.sort_unstable_by_key(|&node| ids[node as usize]);
            self.predecessors.dedup_by_key(|node| ids[*node as usize]);
        } else {
            self.predecessors.sort_unstable();
            self.predecessors.dedup();
        }
        let (mut eps, mut depth, mut key, mut follows) = (error, 0, key, false);
        for &node in &self.predecessors {
            let b = self.collapses[node as usize].bounds;
            self.balls.push(Ball { center: b.center.map(f64::from).into(), radius: f64::from(b.radius) });
            eps = eps.max(b.eps);
            depth = depth.max(self.depth[node as usize]);
            if self.is_new(node) {
                key = key.max(self.keys[node as usize]);
                follows = true;
            }
        }
        let center = enclosing_center(&mut self.balls).as_vec3();
        let radius = radius_around(center.as_dvec3(), &self.balls);
        let radius = round_up((radius + self.slack) * (1.0 + RELATIVE_SLACK));
        if !(radius.is_finite() && eps.is_finite()) {
            return false;
        }
        self.top[kept as usize] = self.next();
        for &v in bereaved {
            self.trace[v as usize] = self.next();
        }
        self.collapses.push(Collapse {
            removed,
            kept,
            bounds: Bounds { center: center.to_array(), radius, eps },
        });
        if let Some(ids) = &mut self.ids {
            ids.push(self.next_id);
        }
        self.next_id += 1;
        self.followers += usize::from(follows);
        self.height.push(height + 1);
        self.depth.push(depth + 1);
        self.keys.push(key);
        true
    }
}

/// The least single-precision number that is not below `x`.
pub(super) fn round_up(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}
