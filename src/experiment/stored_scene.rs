//! The objects of a `.scene` file, which may be of several backends, and meshes.

mod any;
mod scene_file;
mod stored;
mod stored_error;

pub use any::StoredObjects;
pub use scene_file::{SceneFileError, read_scene};
pub use stored::{ScenePaging, StoredObject, StoredScene};
pub use stored_error::{ObjectLine, StoredSceneError};
