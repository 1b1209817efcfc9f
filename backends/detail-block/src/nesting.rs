//! Spheres, errors and normal cones of the nodes, nested over everything that must be folded before.
//!
//! The file has no room for a centre: a sphere lies around the vertex that its node brings back. So the log's spheres do
//! not serve, and radii are found anew, as the least that nest. A node's predecessors, those that must be folded before it
//! can be, are
//!
//! * its two children in the tree;
//! * for each triangle around the removed vertex, the collapse that last moved a corner of it, and for the removed vertex
//!   and those that lose a triangle and get none, the collapse that last did the same to them: as in the log, so that
//!   every wanted cut is one that the simplification went through;
//! * the nodes that need this one's faces for their split (see [`replay`](crate::replay)). The first two kinds hold most of
//!   these already. What is missing is a face beside w or z that another collapse removes without touching anything that
//!   this one moved. To nest over these too is an option: then nothing is ever forced.
//!
//! For every predecessor `m` of `n`, `|c_n - c_m| + r_m <= r_n` and `eps_m <= eps_n`, and likewise for the angle of
//! the normal cone: `angle(axis_n, axis_m) + angle_m <= angle_n`. A leaf counts with the farthest corner, and the most
//! deviating normal, of its triangles.

use vertex_tree::{Bounds, NONE, NormalCone};

use crate::cone::{self, Angle};
use crate::half_edges::{Adjacent, BOUNDARY};
use crate::quantize::{self, Scale};
use crate::replay::Step;
use crate::split_apart::Manifold;
use crate::vector::{self, Vector};

/// By this part a sphere is larger than it need be, so that rounding in a later test can not invert parent and child.
const RELATIVE_SLACK: f64 = 1.0 / (1 << 19) as f64;
/// And by this part of the extent of the mesh.
const ABSOLUTE_SLACK: f64 = 1.0 / (1_u64 << 40) as f64;

/// Bounds of the nodes made so far.
pub(crate) struct Nesting {
    /// Of each vertex, as stored.
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub bounds: Vec<Bounds>,
    pub sines: Vec<f32>,
    /// Of each node, the normal of its removed vertex.
    axes: Vec<[f32; 3]>,
    leaf_radius: Vec<f64>,
    leaf_angle: Vec<Angle>,
    /// For each triangle, the collapse that last moved a corner of it.
    creator: Vec<u32>,
    /// For each vertex, the collapse that last took a triangle from it and gave none.
    trace: Vec<u32>,
    /// For each half-edge, the collapse that made its edge, if nesting is over needs too.
    edge_creator: Option<Vec<[u32; 3]>>,
    predecessors: Vec<u32>,
    slack: f64,
    quantised: Option<Scale>,
}

impl Nesting {
    /// `positions` are those of the manifold's vertices, as they will be stored.
    pub fn new(
        manifold: &Manifold,
        positions: Vec<[f32; 3]>,
        extent: f64,
        quantised: Option<Scale>,
        over_needs: bool,
    ) -> Self {
        let (vertices, triangles) = (positions.len(), manifold.edges.triangles.len());
        let shown = || manifold.edges.triangles.iter().map(|t| t.start).filter(|start| start[0] != NONE);
        let normal_of = |corners: [u32; 3]| {
            let [a, b, c] = corners.map(|v| vector::of(positions[v as usize]));
            vector::cross(vector::minus(b, a), vector::minus(c, a))
        };
        let mut sums: Vec<Vector> = vec![[0.0; 3]; vertices];
        let mut leaf_radius = vec![0.0_f64; vertices];
        for corners in shown() {
            let normal = normal_of(corners);
            for (i, &v) in corners.iter().enumerate() {
                let sum = &mut sums[v as usize];
                *sum = vector::plus(*sum, normal);
                for w in [corners[(i + 1) % 3], corners[(i + 2) % 3]] {
                    let distance = vector::distance(positions[v as usize], positions[w as usize]);
                    leaf_radius[v as usize] = leaf_radius[v as usize].max(distance);
                }
            }
        }
        let normals: Vec<[f32; 3]> = sums
            .iter()
            .map(|&sum| {
                let normal = vector::unit(sum).map_or([0.0, 0.0, 1.0], |n| n.map(|x| x as f32));
                if quantised.is_some() { quantize::decode_normal(quantize::normal(normal)) } else { normal }
            })
            .collect();
        let mut leaf_angle = vec![cone::ZERO; vertices];
        for corners in shown() {
            // A triangle without area is not seen from either side.
            let Some(normal) = vector::unit(normal_of(corners)) else { continue };
            for v in corners.map(|v| v as usize) {
                let angle = axis(normals[v]).and_then(|axis| cone::between(axis, normal));
                leaf_angle[v] = cone::larger(leaf_angle[v], angle);
            }
        }
        Self {
            positions,
            normals,
            bounds: Vec::new(),
            sines: Vec::new(),
            axes: Vec::new(),
            leaf_radius,
            leaf_angle,
            creator: vec![NONE; triangles],
            trace: vec![NONE; vertices],
            edge_creator: over_needs.then(|| vec![[NONE; 3]; triangles]),
            predecessors: Vec::new(),
            slack: extent * ABSOLUTE_SLACK,
            quantised,
        }
    }

    /// The bounds of the next node. Fails with the radius or the error if that can not be stored.
    pub fn add(&mut self, step: &Step<'_>) -> Result<(), f32> {
        let node = self.bounds.len() as u32;
        self.find_predecessors(step);
        let v = step.removed as usize;
        let (center, direction) = (self.positions[v], axis(self.normals[v]));
        let (mut radius, mut eps, mut angle) = (0.0_f64, step.eps, cone::ZERO);
        let turned = |from: [f32; 3]| direction.zip(axis(from)).and_then(|(a, b)| cone::between(a, b));
        for (leaf, child) in [step.kept, step.removed].into_iter().zip(step.children) {
            if child == NONE {
                let leaf = leaf as usize;
                radius = radius.max(vector::distance(center, self.positions[leaf]) + self.leaf_radius[leaf]);
                angle = cone::larger(angle, cone::sum(turned(self.normals[leaf]), self.leaf_angle[leaf]));
            }
        }
        for &m in &self.predecessors {
            let below = self.bounds[m as usize];
            radius = radius.max(vector::distance(center, below.center) + f64::from(below.radius));
            eps = eps.max(below.eps);
            let angle_of_m = cone::of_sine(self.sines[m as usize]);
            angle = cone::larger(angle, cone::sum(turned(self.axes[m as usize]), angle_of_m));
        }
        let mut radius = vector::round_up((radius + self.slack) * (1.0 + RELATIVE_SLACK));
        if let Some(scale) = &self.quantised {
            radius = scale.length(radius).map(|code| scale.decode_length(code)).ok_or(radius)?;
            eps = scale.length(eps).map(|code| scale.decode_length(code)).ok_or(eps)?;
        }
        if !(radius.is_finite() && eps.is_finite()) {
            return Err(radius);
        }
        let mut sine = cone::stored_sine(angle);
        if self.quantised.is_some() {
            sine = quantize::decode_sine(quantize::sine(sine));
        }
        self.bounds.push(Bounds { center, radius, eps });
        self.sines.push(sine);
        self.axes.push(self.normals[v]);
        self.record(step, node);
        Ok(())
    }

    /// The cone of normals of a node.
    pub fn cone(&self, node: u32) -> NormalCone {
        NormalCone { axis: self.axes[node as usize], sine: self.sines[node as usize] }
    }

    fn find_predecessors(&mut self, step: &Step<'_>) {
        let found = &mut self.predecessors;
        found.clear();
        found.extend(step.children);
        let removed = step.edge.into_iter().filter(|&h| h != BOUNDARY);
        found
            .extend(step.fan.iter().copied().chain(removed.clone()).map(|h| self.creator[(h >> 2) as usize]));
        found.push(self.trace[step.removed as usize]);
        found.extend(bereaved(step).map(|v| self.trace[v as usize]));
        if let Some(creator) = &self.edge_creator {
            found.extend(removed.flat_map(|h| creator[(h >> 2) as usize]));
        }
        found.retain(|&m| m != NONE);
        found.sort_unstable();
        found.dedup();
    }

    /// Remembers what the collapse has changed.
    fn record(&mut self, step: &Step<'_>, node: u32) {
        for &h in step.fan {
            self.creator[(h >> 2) as usize] = node;
        }
        for v in bereaved(step) {
            self.trace[v as usize] = node;
        }
        if let Some(creator) = &mut self.edge_creator {
            let Adjacent { w, x, y, z } = step.adjacent;
            for h in [w, x, y, z].into_iter().filter(|&h| h != BOUNDARY) {
                creator[(h >> 2) as usize][(h & 3) as usize] = node;
            }
        }
    }
}

/// The far corners that lose their only triangle at the removed vertex.
fn bereaved(step: &Step<'_>) -> impl Iterator<Item = u32> {
    let [p, q] = step.far;
    let Adjacent { x, y, .. } = step.adjacent;
    [(p, x), (q, y)].into_iter().filter(|&(v, beside)| v != NONE && beside == BOUNDARY).map(|(v, _)| v)
}

/// The axis of a cone. `None` for a normal that is none.
fn axis(normal: [f32; 3]) -> Option<Vector> {
    vector::unit(vector::of(normal))
}
