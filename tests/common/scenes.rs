//! The built-in scenes at their own size and their hierarchies, made once for all tests of a target.

use std::sync::OnceLock;

use foldfront::experiment::scene::{Scene, SceneKind};
use foldfront::{CollapseLog, Mesh};

use super::data;

/// A scene's mesh.
pub fn mesh(kind: SceneKind) -> &'static Mesh {
    static MESHES: [OnceLock<Mesh>; SceneKind::ALL.len()] = [const { OnceLock::new() }; SceneKind::ALL.len()];
    MESHES[kind as usize].get_or_init(|| Scene::new(kind).mesh(&mut |_, _| ()))
}

/// A scene's hierarchy.
pub fn log(kind: SceneKind) -> &'static CollapseLog {
    static LOGS: [OnceLock<CollapseLog>; SceneKind::ALL.len()] =
        [const { OnceLock::new() }; SceneKind::ALL.len()];
    LOGS[kind as usize].get_or_init(|| data::log(mesh(kind).clone()))
}
