//! Pictures of displayed meshes, by a small software rasteriser: what the camera sees, and how the detail follows the
//! view, seen from outside.
//!
//! Triangles are drawn by edge functions (Pineda 1988) into a depth buffer, with 2 x 2 samples a pixel. Wires are
//! drawn with the triangles, from the distance of a sample to the nearest edge (Bærentzen et al. 2006, "Single-pass
//! Wireframe Rendering"), so that hidden lines are removed and no depth offset is needed. The same input gives the
//! same picture, whatever the number of threads.

// Pictures are off the selection path.
#![expect(clippy::disallowed_methods, reason = "off the selection path")]

mod image;
mod outside;
mod projection;
mod raster;
mod style;

pub use image::{Image, ImageError};
pub use outside::outside_camera;
pub use style::{Shading, Style};

use collapse_log::Mesh;
use glam::DVec3;
use rayon::prelude::*;

use crate::experiment::frustum::{Clipped, Frustum};
use projection::Projection;
use raster::{Colour, Facet, Line, Scene, Veil};
use selection::view::Camera;

/// The near plane, as a fraction of the mesh's extent.
const NEAR: f64 = 1e-5;
/// Triangles are projected in pieces of this many.
const CHUNK: usize = 4096;
/// The mesh as the camera sees it; in a picture from outside, the part that is in view.
const IN_VIEW: Colour = Colour::new(0x9d, 0xb7, 0xd8);
/// The part of the mesh that is out of view.
const OUT_OF_VIEW: Colour = Colour::new(0xe3, 0xdf, 0xd8);
/// The camera's pyramid in a picture from outside.
const PYRAMID: Colour = Colour::new(0xc8, 0x5a, 0x24);
/// How much of what lies behind is covered by a side of the pyramid.
const PYRAMID_OPACITY: f32 = 0.07;

/// Brightness of a surface that no light falls on.
const AMBIENT: f64 = 0.25;
/// The light is as if from a large source: it reaches around the edge of a surface, until the cosine of the angle to
/// the normal is minus this.
const WRAP: f64 = 0.25;
/// Where the light is, seen from the camera: over the left shoulder. Not a unit vector.
const LIGHT: DVec3 = DVec3::new(-0.45, 0.6, 1.0);
/// A back face is darker by this factor.
const BACK_FACE: f64 = 0.6;

/// Draws what `camera` sees of `mesh`.
#[must_use]
pub fn render(mesh: &Mesh, camera: &Camera, style: &Style) -> Image {
    let camera = camera.about(mesh.georeference.origin);
    let projection = Projection::new(&camera, style, NEAR * mesh.extent());
    let facets = facets(mesh, &projection, style, |_| IN_VIEW);
    Scene { facets, veils: Vec::new(), lines: Vec::new(), wires: style.wires }.draw(&projection)
}

/// Draws `mesh` and the pyramid that `view` sees, from [`outside_camera`]. Triangles of which any part is in view are
/// blue, the others grey.
#[must_use]
pub fn render_outside(mesh: &Mesh, view: &Camera, style: &Style) -> Image {
    let bounds = mesh.bounding_box().unwrap_or_default();
    let view = &view.about(mesh.georeference.origin);
    let camera = outside::outside(view, bounds);
    let near = NEAR * mesh.extent();
    let projection = Projection::new(&camera, style, near);
    let in_view = Frustum::new(view, near, 1.0);
    let facets = facets(mesh, &projection, style, |corners| match in_view.clip(corners) {
        Clipped::Outside => OUT_OF_VIEW,
        _ => IN_VIEW,
    });
    let pyramid = outside::Pyramid::new(view, bounds);
    let veils = pyramid
        .sides()
        .into_iter()
        .flat_map(|side| projection.triangle(side))
        .map(|(corners, _)| Veil { corners, colour: PYRAMID, opacity: PYRAMID_OPACITY })
        .collect();
    let lines = pyramid
        .edges()
        .into_iter()
        .filter_map(|edge| projection.segment(edge))
        .map(|ends| Line { ends, colour: PYRAMID })
        .collect();
    Scene { facets, veils, lines, wires: style.wires }.draw(&projection)
}

/// Clips, projects and lights the triangles, in their order.
fn facets(
    mesh: &Mesh,
    projection: &Projection,
    style: &Style,
    colour: impl Fn([DVec3; 3]) -> Colour + Sync,
) -> Vec<Facet> {
    let at = |v: u32| DVec3::from(mesh.positions[v as usize].map(f64::from));
    let normals = match style.shading {
        Shading::Smooth => vertex_normals(mesh),
        Shading::Flat => Vec::new(),
    };
    let chunks = mesh.triangles.par_chunks(CHUNK).map(|triangles| {
        let mut facets = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            let corners = triangle.map(at);
            let parts = projection.triangle(corners);
            if parts.is_empty() {
                continue;
            }
            let face_normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let center = (corners[0] + corners[1] + corners[2]) / 3.0;
            let from_behind = face_normal.dot(projection.eye() - center) < 0.0;
            let brightness = |normal: DVec3| brightness(normal, from_behind, projection);
            let brightness = match style.shading {
                Shading::Flat => [brightness(face_normal); 3],
                Shading::Smooth => triangle.map(|v| brightness(normals[v as usize])),
            };
            let colour = colour(corners);
            for (corners, weights) in parts {
                let brightness = weights.map(|w| w.dot(DVec3::from(brightness)) as f32);
                // An edge of a part is one of the triangle where it lies along the side opposite to a corner.
                let wired = [(1, 2), (2, 0), (0, 1)].map(|(from, to): (usize, usize)| {
                    (0..3).any(|side| weights[from][side] == 0.0 && weights[to][side] == 0.0)
                });
                facets.push(Facet { corners, brightness, colour, wired });
            }
        }
        facets
    });
    chunks.collect::<Vec<_>>().concat()
}

/// How bright a surface with this normal (of any length) is.
fn brightness(normal: DVec3, from_behind: bool, projection: &Projection) -> f64 {
    let facing = if from_behind { -normal } else { normal };
    let cosine = projection.to_object(LIGHT).normalize().dot(facing.normalize_or_zero());
    let lit = ((cosine + WRAP) / (1.0 + WRAP)).max(0.0);
    (AMBIENT + (1.0 - AMBIENT) * lit) * if from_behind { BACK_FACE } else { 1.0 }
}

/// Sums of the normals of the triangles around each vertex, weighted by their areas.
fn vertex_normals(mesh: &Mesh) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| DVec3::from(mesh.positions[v as usize].map(f64::from)));
        let normal = (b - a).cross(c - a);
        for &v in triangle {
            normals[v as usize] += normal;
        }
    }
    normals
}

#[cfg(test)]
mod tests;
