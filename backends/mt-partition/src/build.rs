//! Writes a file from a collapse log.
//!
//! The log may be larger than memory: it is read in sequence, and what is made of it lies in sorted records in temporary
//! files and in arrays of which only a part is in memory.
//!
//! | stage | what it does |
//! |---|---|
//! | `history` | puts the collapses in order along a curve through space, and finds what becomes of each vertex |
//! | `versions` | follows each triangle of the input through the collapses that change it; arcs are counted |
//! | `rounds`, `region`, `arcs` | the reduction, in regions of the curve that fit in memory |
//! | `arranging` | nested bounds, layers, partitions and numbers |
//! | `writing` | follows the triangles once more, sorts them by the arcs that they lie on, and writes |
//!
//! Until nodes have their numbers in the file a node is known by its *place*, the number of its collapse along the curve:
//! what is near each other is then mostly on the same page of an array.

mod arcs;
mod arranging;
mod history;
mod region;
#[cfg(test)]
mod replay;
mod report;
mod rounds;
mod versions;
mod work;
mod writing;

use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use collapse_log::external::{Scratch, Workspace};
use collapse_log::{CollapseLog, LogCounts, LogSource};
use container::{FileError, output};
use vertex_tree::NONE;

pub use self::report::WriteReport;
use super::error::MtError;
use crate::options::BuildOptions;
use arranging::Arranged;
use history::History;
use rounds::Rounds;
use work::{Failure, Work};

/// Less memory than this is taken for so much.
pub const LEAST_MEMORY: u64 = 1 << 16;

/// Arranges a log that is in memory as a reduced, partitioned multi-triangulation and writes it to a file, whole or not at
/// all. Temporary files are made beside `path`, and as much memory is taken as serves: about 200 bytes for each triangle.
///
/// # Errors
/// As for [`write_within`].
pub fn write(path: &Path, log: &CollapseLog, options: &BuildOptions) -> Result<WriteReport, MtError> {
    write_within(path, log, options, &Workspace::beside(path, &AtomicBool::new(false)))
}

/// Arranges a log that may be larger than memory as a reduced, partitioned multi-triangulation and writes it to a file,
/// whole or not at all. With enough memory for the whole graph the file is that of [`write()`]. With less, nodes are merged in
/// another order, which depends on nothing but the log, the options and the memory. The base mesh has to fit in memory, as
/// it has to for whoever opens the file.
///
/// # Errors
/// [`MtError::Log`] if the log does not fit its mesh, [`MtError::TooLarge`], [`FileError::Write`] and
/// [`MtError::Workspace`].
pub fn write_within(
    path: &Path,
    log: &dyn LogSource,
    options: &BuildOptions,
    workspace: &Workspace<'_>,
) -> Result<WriteReport, MtError> {
    let counts = log.counts();
    check_counts(counts)?;
    let scratch = Scratch { folder: workspace.folder.clone() };
    let memory = usize::try_from(workspace.memory.max(LEAST_MEMORY)).unwrap_or(usize::MAX);
    let work = Work { log, scratch: &scratch, memory, stop: workspace.stop };
    let name = |failure| -> MtError {
        match failure {
            Failure::Log(error) => error.into(),
            Failure::Output(source) if !workspace.stop.load(Ordering::Relaxed) => {
                FileError::write(path, source).into()
            }
            Failure::Output(source) | Failure::Temporary(source) => workspace.error(source).into(),
        }
    };
    let arranged = arrange(work, options).map_err(name)?;
    // Errors of the closure are those of the operating system alone: ours are kept beside it.
    let mut outcome = Ok(WriteReport::default());
    let written = output::write_with(path, |file| {
        outcome = writing::write(work, arranged, options, file);
        if outcome.is_ok() { Ok(()) } else { Err(io::ErrorKind::Other.into()) }
    });
    let report = outcome.map_err(name)?;
    written.map_err(|source| FileError::write(path, source))?;
    Ok(report)
}

/// Fails if there is more than the format can number.
fn check_counts(counts: LogCounts) -> Result<(), MtError> {
    let LogCounts { vertices, triangles, collapses } = counts;
    for (what, value) in [("vertices", vertices), ("triangles", triangles), ("collapses", collapses)] {
        // The reduction counts triangles of a node, and there are at most this many versions of each, in 32 bits.
        if value >= u64::from(NONE) / 16 {
            return Err(MtError::TooLarge { what, value });
        }
    }
    Ok(())
}

fn arrange(work: Work<'_>, options: &BuildOptions) -> Result<Arranged, Failure> {
    let mut history = History::new(work)?;
    let arcs = versions::arcs(work, &mut history)?;
    let fates = history.store_fates(work)?;
    let mut rounds = Rounds::new(work, history, arcs)?;
    rounds.run(options.patch)?;
    Arranged::new(work, options, fates, rounds)
}
