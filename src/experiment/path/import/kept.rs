//! A resampled trajectory where it was recorded.

use collapse_log::Mesh;
use glam::{DQuat, DVec3};

use super::placement::{ahead, frames};
use super::trajectory::Sample;
use crate::experiment::path::Pose;

/// Frames from samples at a steady rate, the first at the time `start`. Where no orientation was recorded, the camera
/// looks where it goes, with the up of the mesh, to whose axes `to_mesh` leads from z up.
pub(super) fn keep(samples: &[Sample], start: f64, to_mesh: DQuat, rate: f64) -> Vec<Pose> {
    let positions = samples.iter().map(|sample| sample.position);
    let recorded: Option<Vec<_>> = samples.iter().map(|sample| sample.orientation).collect();
    let orientations = recorded.unwrap_or_else(|| {
        let upright: Vec<DVec3> = positions.clone().map(|p| to_mesh.inverse() * p).collect();
        ahead(&upright, rate, 0.0).into_iter().map(|orientation| to_mesh * orientation).collect()
    });
    let times = samples.iter().map(|sample| start + sample.time);
    frames(times.zip(positions).zip(orientations))
}

/// The boxes of a path and of a mesh, in world coordinates, if no camera is in the box of the mesh or within its
/// diagonal on each side.
pub(super) fn elsewhere(path: &[Pose], mesh: &Mesh) -> Option<[[DVec3; 2]; 2]> {
    let (low, high) = mesh.world_box()?;
    let [low, high] = [low, high].map(DVec3::from);
    let around = DVec3::splat(mesh.extent());
    let near = |p: DVec3| p.cmpge(low - around).all() && p.cmple(high + around).all();
    if path.iter().any(|pose| near(pose.position)) {
        return None;
    }
    let bounds = path.iter().fold([DVec3::MAX, DVec3::MIN], |[low, high], pose| {
        [low.min(pose.position), high.max(pose.position)]
    });
    Some([bounds, [low, high]])
}
