//! A walkthrough for anything: once around, from afar to near.

use collapse_log::Mesh;
use glam::DVec3;

use super::walkthrough::{Path, Pose};
use selection::view::{Camera, ViewError, check_eye};

const FRAMES: usize = 720;
const RATE: f64 = 60.0;
pub(crate) const FOV_Y: f64 = std::f64::consts::FRAC_PI_3;
const ASPECT: f64 = 16.0 / 9.0;

/// Twelve seconds around a mesh, looking at its middle: from a distance of one and a half times its extent to where
/// it fills the view and more, then on at that distance, in world coordinates. A flat mesh is taken for terrain, seen from above with z up;
/// anything else has y up, as scans do.
///
/// # Errors
/// Where the mesh is too small for directions, or too far away to stand anywhere.
pub fn around(mesh: &Mesh) -> Result<Path, ViewError> {
    let (lo, hi) = mesh.bounding_box().unwrap_or_default();
    let (lo, hi) = (DVec3::from(lo.map(f64::from)), DVec3::from(hi.map(f64::from)));
    let origin = DVec3::from(mesh.georeference.origin);
    let (center, size) = ((lo + hi) / 2.0, hi - lo);
    let extent = if mesh.extent() > 0.0 { mesh.extent() } else { 1.0 };
    let flat = size.z < 0.3 * size.x.min(size.y);
    let up = if flat { DVec3::Z } else { DVec3::Y };
    let (ahead, side) = if flat { (DVec3::Y, DVec3::X) } else { (DVec3::Z, DVec3::X) };
    let height = if flat { 0.35 } else { 0.15 };
    let frames = (0..FRAMES)
        .map(|frame| {
            let share = frame as f64 / FRAMES as f64;
            let angle = share * std::f64::consts::TAU;
            let left = 1.0 - (2.0 * share).min(1.0);
            let approach = 1.0 - left * left;
            let distance = extent * (1.5 - 1.05 * approach);
            let outwards = ahead * libm::cos(angle) + side * libm::sin(angle);
            let position = center + (outwards + up * height).normalize() * distance;
            let orientation = Camera::look_at(position, center, up, FOV_Y, ASPECT)?.orientation();
            let position = check_eye(origin + position)?;
            Ok(Pose { time: frame as f64 / RATE, position, orientation })
        })
        .collect::<Result<_, ViewError>>()?;
    Ok(Path { name: "around".to_owned(), units: "units".to_owned(), fov_y: FOV_Y, aspect: ASPECT, frames })
}

#[cfg(test)]
mod tests {
    use container::Georeference;

    use super::*;

    #[test]
    fn looks_at_the_middle_from_outside() {
        let mesh = Mesh {
            positions: vec![[1.0, 2.0, 3.0], [5.0, 8.0, 9.0]],
            triangles: Vec::new(),
            ..Mesh::default()
        };
        let path = around(&mesh).unwrap();
        for frame in 0..path.frames.len() {
            let camera = path.camera(frame).unwrap();
            let to_center = (DVec3::new(3.0, 5.0, 6.0) - camera.position()).normalize();
            assert!(camera.direction().dot(to_center) > 1.0 - 1e-9);
            assert!(camera.up().dot(DVec3::Y) > 0.5);
        }
    }

    #[test]
    fn a_mesh_elsewhere_has_the_same_path_there() {
        let mut mesh = Mesh { positions: vec![[1.0, 2.0, 3.0], [5.0, 8.0, 3.5]], ..Mesh::default() };
        let here = around(&mesh).unwrap();
        mesh.georeference = Georeference { origin: [5e5, 5.4e6, 300.0], ..Georeference::default() };
        let there = around(&mesh).unwrap();
        assert_eq!(
            mesh.world_box(),
            Some(([500_001.0, 5_400_002.0, 303.0], [500_005.0, 5_400_008.0, 303.5]))
        );
        for (here, there) in here.frames.iter().zip(&there.frames) {
            let moved = there.position - here.position;
            assert!(moved.distance(DVec3::new(5e5, 5.4e6, 300.0)) < 2e-9);
            assert_eq!(there.orientation, here.orientation);
        }
    }
}
