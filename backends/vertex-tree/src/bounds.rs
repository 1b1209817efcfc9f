//! What the refinement criterion knows of a node.

/// Bounding sphere and error of a node, in object space and object units, as stored.
///
/// The sphere holds every input triangle incident to any leaf below the node, and the spheres of all nodes that
/// must be folded before this one can be: a node whose sphere is out of view has nothing in view below it. `eps`
/// estimates how far the input surface under the node lies from the surface shown while the node is folded; it is
/// never less than that of a node that must be folded first.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// Centre of the sphere.
    pub center: [f32; 3],
    /// Radius of the sphere, at least 0.
    pub radius: f32,
    /// Geometric error, at least 0.
    pub eps: f32,
}

impl Bounds {
    /// Whether everything is finite, and radius and error are not negative: what a file may not hold otherwise.
    #[must_use]
    pub fn is_sane(&self) -> bool {
        let Self { center, radius, eps } = self;
        center.iter().all(|x| x.is_finite()) && [radius, eps].iter().all(|x| x.is_finite() && **x >= 0.0)
    }
}

/// A cone that holds the normals of all input triangles incident to any leaf below a node, and the cones of all nodes that
/// must be folded before this one can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalCone {
    /// The direction of its axis.
    pub axis: [f32; 3],
    /// Sine of its half-angle, which is below 90 degrees; 1 and above say that there is no such cone.
    pub sine: f32,
}

impl NormalCone {
    /// All directions.
    pub const NONE: Self = Self { axis: [0.0; 3], sine: 2.0 };
}
