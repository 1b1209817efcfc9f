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

use std::io;

use bytemuck::{Pod, Zeroable};
use vertex_tree::{Bounds, NONE, NormalCone};

use crate::cone;
use crate::error::{Failure, XfmError};
use crate::half_edges::{Adjacent, BOUNDARY, triangle_of};
use crate::quantize::{self, Scale};
use crate::step::Step;
use crate::storage::{Elements, Storage};
use crate::surface::Surface;
use crate::vector::{self, Vector};

/// By this part a sphere is larger than it need be, so that rounding in a later test can not invert parent and child.
const RELATIVE_SLACK: f64 = 1.0 / (1 << 19) as f64;
/// And by this part of the extent of the mesh.
const ABSOLUTE_SLACK: f64 = 1.0 / (1_u64 << 40) as f64;

/// What is stored of a node and follows from nesting.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Node {
    /// The position of its removed vertex.
    pub center: [f32; 3],
    pub radius: f32,
    pub eps: f32,
    /// The normal of its removed vertex.
    pub axis: [f32; 3],
    pub sine: f32,
}

impl Node {
    pub fn bounds(&self) -> Bounds {
        Bounds { center: self.center, radius: self.radius, eps: self.eps }
    }

    /// The cone of normals.
    pub fn cone(&self) -> NormalCone {
        NormalCone { axis: self.axis, sine: self.sine }
    }
}

/// Bounds of the nodes made so far.
pub(crate) struct Nesting<S: Storage> {
    pub nodes: S::Array<Node>,
    over_needs: bool,
    predecessors: Vec<u32>,
    slack: f64,
    quantised: Option<Scale>,
}

impl<S: Storage> Nesting<S> {
    /// For the collapses of a mesh, as many as will be expected.
    pub fn new(surface: &Surface<S>, quantize: bool, over_needs: bool, storage: &S) -> Self {
        Self {
            nodes: storage.growing(surface.kept.len(), 14),
            over_needs,
            predecessors: Vec::new(),
            slack: surface.extent * ABSOLUTE_SLACK,
            quantised: quantize.then_some(surface.scale),
        }
    }

    /// Finds the bounds of the next node. Fails with the radius or the error if that can not be stored.
    pub fn add(&mut self, surface: &mut Surface<S>, step: &Step<'_>) -> Result<(), Failure> {
        let node = self.nodes.len() as u32;
        self.find_predecessors(surface, step)?;
        let removed = surface.leaves.get(step.removed as usize)?;
        let (center, direction) = (removed.position, axis(removed.normal));
        let (mut radius, mut eps, mut angle) = (0.0_f64, step.eps, cone::ZERO);
        let turned = |from: [f32; 3]| direction.zip(axis(from)).and_then(|(a, b)| cone::between(a, b));
        for (leaf, child) in [step.kept, step.removed].into_iter().zip(step.children) {
            if child == NONE {
                let leaf = surface.leaves.get(leaf as usize)?;
                radius = radius.max(vector::distance(center, leaf.position) + leaf.radius);
                angle = cone::larger(angle, cone::sum(turned(leaf.normal), leaf.angle()));
            }
        }
        for &m in &self.predecessors {
            let below = self.nodes.get(m as usize)?;
            radius = radius.max(vector::distance(center, below.center) + f64::from(below.radius));
            eps = eps.max(below.eps);
            angle = cone::larger(angle, cone::sum(turned(below.axis), cone::of_sine(below.sine)));
        }
        let mut radius = vector::round_up((radius + self.slack) * (1.0 + RELATIVE_SLACK));
        let unstorable = |length| XfmError::Length { length };
        if let Some(scale) = &self.quantised {
            let stored = |x| scale.length(x).map(|code| scale.decode_length(code));
            radius = stored(radius).ok_or(unstorable(radius))?;
            eps = stored(eps).ok_or(unstorable(eps))?;
        }
        if !(radius.is_finite() && eps.is_finite()) {
            return Err(unstorable(radius).into());
        }
        let mut sine = cone::stored_sine(angle);
        if self.quantised.is_some() {
            sine = quantize::decode_sine(quantize::sine(sine));
        }
        self.nodes.push(Node { center, radius, eps, axis: removed.normal, sine })?;
        self.record(surface, step, node)?;
        Ok(())
    }

    fn find_predecessors(&mut self, surface: &mut Surface<S>, step: &Step<'_>) -> io::Result<()> {
        let found = &mut self.predecessors;
        found.clear();
        found.extend(step.children);
        for &h in step.fan {
            found.push(surface.faces.0.get(triangle_of(h).0)?.creator);
        }
        for h in step.edge.into_iter().filter(|&h| h != BOUNDARY) {
            let face = surface.faces.0.get(triangle_of(h).0)?;
            found.push(face.creator);
            if self.over_needs {
                found.extend(face.edge_creator);
            }
        }
        found.push(surface.vertices.get(step.removed as usize)?.trace);
        for v in bereaved(step) {
            found.push(surface.vertices.get(v as usize)?.trace);
        }
        found.retain(|&m| m != NONE);
        found.sort_unstable();
        found.dedup();
        Ok(())
    }

    /// Remembers what the collapse has changed.
    fn record(&mut self, surface: &mut Surface<S>, step: &Step<'_>, node: u32) -> io::Result<()> {
        for &h in step.fan {
            surface.faces.0.get_mut(triangle_of(h).0)?.creator = node;
        }
        for v in bereaved(step) {
            surface.vertices.get_mut(v as usize)?.trace = node;
        }
        if self.over_needs {
            let Adjacent { w, x, y, z } = step.adjacent;
            for h in [w, x, y, z].into_iter().filter(|&h| h != BOUNDARY) {
                let (t, k) = triangle_of(h);
                surface.faces.0.get_mut(t)?.edge_creator[k] = node;
            }
        }
        Ok(())
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
