//! The collapse log, from which every backend is built: a mesh, and the half-edge collapses that simplify it, in order.
//!
//! It may be in memory ([`CollapseLog`]) or in a file ([`LogFile`]); whoever reads it in sequence, as [`LogSource`], need not
//! know. A log may be larger than memory: [`external`] has what it takes to sort and to look up its records then, and
//! [`z_order`] puts those that are near in space near to each other.

mod curve;
pub mod external;
mod log;
mod log_file;
mod log_source;
mod mesh;

pub use curve::z_order;
pub use log::{Collapse, CollapseLog, Forest, LogError};
pub use log_file::{LogCounts, LogFileError, log_file_version, read_log, write_log, write_log_from};
pub use log_source::{LogFile, LogSource, Records};
pub use mesh::Mesh;
