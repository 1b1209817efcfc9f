//! Event-driven view-dependent level of detail.
//!
//! A mesh is simplified once into a forest of vertex merges. At run time an *active front* through that forest is
//! the displayed mesh, and each frame the front must follow the camera. Classic systems test every node of the front
//! in every frame. Here a node is tested only when the camera could have changed the answer (Zach & Karner 2003),
//! with time bounds that never miss, so the displayed mesh is in every frame exactly the one that testing every
//! node would give.
//!
//! ```
//! use std::sync::Arc;
//!
//! use foldfront::selection::active_mesh::ActiveMesh;
//! use foldfront::selection::engine::{Engine, Settings};
//! use foldfront::glam::DVec3;
//! use foldfront::in_memory::{InMemoryHierarchy, InMemoryTree};
//! use foldfront::construction::simplify;
//! use foldfront::selection::view::{Camera, View, theta_of_pixels};
//! use foldfront::Mesh;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Once a model: a hierarchy. `mesh_io::read` reads files; this is a bumpy square of 2 by 2 units.
//! let mut mesh = Mesh::default();
//! for i in 0..64 * 64 {
//!     let (x, y) = ((i % 64) as f32 / 32.0 - 1.0, (i / 64) as f32 / 32.0 - 1.0);
//!     mesh.positions.push([x, y, 0.1 * (x * x * 9.0).fract() * y]);
//! }
//! for i in (0..63 * 64).filter(|i| i % 64 != 63) {
//!     mesh.triangles.push([i, i + 1, i + 65]);
//!     mesh.triangles.push([i, i + 65, i + 64]);
//! }
//! let (log, _) = simplify::build(mesh, &simplify::Options::default(), &mut |_, _| {})?;
//! let hierarchy = Arc::new(InMemoryHierarchy::new(&log)?);
//!
//! // Once a viewer: an engine, with the displayed mesh as vertex and index buffers.
//! let tree = InMemoryTree::new(hierarchy);
//! let buffers = ActiveMesh::new();
//! // How fast the camera is expected to move: object units and radians a frame. A faster one is no less exact.
//! let settings = Settings { rho: 0.02, omega: 0.02, ..Settings::default() };
//! let mut engine = Engine::new(tree, buffers, settings)?;
//!
//! // Every frame: say where the camera is, upload what changed, draw.
//! for frame in 0..60 {
//!     let eye = DVec3::new(0.02 * f64::from(frame), -2.0, 1.0);
//!     let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 1.0, 16.0 / 9.0)?;
//!     let report = engine.advance(&[View::new(&camera, theta_of_pixels(1.0, 1080))?])?;
//!     let buffers = engine.sink_mut();
//!     for &slot in buffers.changed_triangles() {
//!         // Upload `buffers.triangles()[slot]`, unless the slot is not used any more.
//!         let _ = buffers.triangles().get(slot as usize);
//!     }
//!     buffers.clear_changes();
//!     assert_eq!(report.displayed, buffers.displayed() as u64);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Data flows one way: input and hierarchy (`construction`, [`collapse_log`]), a backend behind the [`VertexTree`]
//! trait, the engine with its front, and the displayed mesh ([`selection`]). The engine itself knows no meshes: it works over any
//! [`Hierarchy`] that can [`Refine`] into a sink.
//!
//! # Features
//!
//! | feature | what it adds |
//! |---|---|
//! | none | [`selection`], [`collapse_log`], [`vertex_tree`]: no file, no thread, no clock |
//! | `clock` | frames are timed by the system's clock, where the caller gives no other |
//! | `in-memory` | the reference backend |
//! | `meta-node`, `detail-block`, `mt-partition` | the backends that page, with `page_store`, `container` and `clock` |
//! | `construct` | `construction`: meshes and terrain from files, and their simplification |
//! | `experiment` | `experiment`: scenes, paths, comparisons, reports, pictures, over every backend; `testing` |
//! | `cli` (default) | the command line program |

#![cfg_attr(docsrs, feature(doc_cfg))]

/// How do I: pages with code that compiles.
#[cfg(feature = "experiment")]
pub mod guide {
    #[doc = include_str!("../docs/guide/embed.md")]
    pub mod embed {}
    #[doc = include_str!("../docs/guide/glossary.md")]
    pub mod glossary {}
    #[doc = include_str!("../docs/guide/own_backend.md")]
    pub mod own_backend {}
    #[doc = include_str!("../docs/guide/page_from_disk.md")]
    pub mod page_from_disk {}
    #[doc = include_str!("../docs/guide/several_objects.md")]
    pub mod several_objects {}
}

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "experiment")]
pub mod experiment;

pub use collapse_log;
pub use collapse_log::{Collapse, CollapseLog, Mesh};
#[cfg(feature = "construct")]
pub use construction;
#[cfg(feature = "paging")]
pub use container;
#[cfg(feature = "detail-block")]
pub use detail_block;
pub use glam;
#[cfg(feature = "in-memory")]
pub use in_memory;
#[cfg(feature = "meta-node")]
pub use meta_node;
#[cfg(feature = "mt-partition")]
pub use mt_partition;
#[cfg(feature = "paging")]
pub use page_store;
pub use selection;
pub use star_mesh;
#[cfg(feature = "experiment")]
pub use testing;
pub use vertex_tree;
pub use vertex_tree::{Bounds, Hierarchy, NodeId, Refine, VertexTree};
