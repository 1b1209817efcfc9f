//! Construction within a given memory, for meshes that are larger.
//!
//! After El-Sana & Chiang, "External memory view-dependent simplification" (2000), section 3.1. There, the shortest edges
//! of the whole mesh are taken as spanning edges until the sub-meshes that they span fill the memory; the sub-meshes
//! are simplified up to the longest spanning edge, written back, and so on. The shortest edges lie scattered all over
//! the mesh, so each brings its surroundings along, and one load of memory sees few collapses.
//!
//! Here a pass is a round of the construction in memory: its spanning edges are the candidates up to the round's limit,
//! the median key, and the sub-meshes that they span are the blocks in which they lie. These are not loaded all at once,
//! but one after the other along a curve through space, as many as fit, and written back, so that a pass reads and
//! writes the mesh about once, whatever the memory. The invariant is that of the paper: no collapse has a key above the
//! longest spanning edge of its pass, and within its sub-mesh candidates come up in ascending order.
//!
//! A round in memory goes through the same blocks in the same order, and what it does to a vertex depends on no more
//! than the stars around it. So the result is, bit for bit, that of the construction in memory, whatever memory there
//! is, unless components are to be merged.
//!
//! | stage | memory | on disk |
//! |---|---|---|
//! | reading | buffers | positions and triangles of the input |
//! | placing about the middle, unless 32 bits hold all coordinates | a cache of positions | positions in 64 bits |
//! | sorting (`prepare`) | sort buffers, a cache of vertex numbers | sorted runs |
//! | passes (`passes`) | one window of blocks | all blocks twice (`blocks`), the collapses so far |
//! | the rest | all blocks, once they fit | the collapses so far |
//! | writing | buffers | the log |
//!
//! Bounds must be nested over all that a collapse depends on: the nodes at its vertices and the creators of its
//! triangles. A block has a table of the nodes that its vertices and triangles refer to, so they are always there.
//!
//! Blocks come up in an order (`order`) in which parts of the mesh have nothing to do with each other until the blocks on
//! their borders come up, so several threads work on a pass, each in a window of its own (`pass`), and the result does not
//! depend on how many there are. Where records are sorted before the passes, each half of a run is sorted by a thread.
//! Everything else runs on the thread that calls.

mod blocks;
mod log;
mod parts;
mod pass;
mod passes;
mod prepare;
mod stop;
mod store;
mod window;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use collapse_log::external::Scratch;
use collapse_log::{Collapse, LogCounts, LogError, LogFileError, write_log_from};
use container::{DegreeMap, Georeference};
use vertex_tree::{Bounds, NONE};

use super::key_counts::KeyCounts;
use super::options::Options;
use super::order::PARTS;
use super::remains::Remains;
use super::report::Report;
use crate::edge_lengths::power_of_two;
use crate::mesh_io::{MeshIoError, Receiver};
use crate::progress::Progress;
use log::Log;
use passes::{FIRST_PARITY, Passes};
use prepare::Input;
use stop::Interrupted;
use window::Whole;

/// What a construction may take.
#[derive(Clone, Debug)]
pub struct Limits<'a> {
    /// Bytes of memory, for everything that grows with the mesh. A single block of the construction, with its
    /// surroundings, is taken into memory even if it is larger; less than [`LEAST_MEMORY`] is taken for that much.
    pub memory: u64,
    /// Where temporary files are made.
    pub temporary: PathBuf,
    /// How many threads may work at the same time, at least 1 and at most [`MOST_THREADS`]. They share the memory. The
    /// result does not depend on it.
    pub threads: usize,
    /// About how many triangles there will be, to see before they are read whether there is room; 0 where nobody knows.
    pub expected_triangles: u64,
    /// Set by whoever wants the construction to end: it fails with [`OutOfCoreError::Interrupted`] soon afterwards.
    pub stop: &'a AtomicBool,
}

/// More threads than this would find nothing to do.
pub const MOST_THREADS: usize = PARTS as usize;

/// Less memory than this can not be asked for.
pub const LEAST_MEMORY: u64 = 1 << 16;

/// A construction within given limits has failed. Nothing is left behind.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutOfCoreError {
    /// The input can not be read.
    #[error(transparent)]
    Input(#[from] MeshIoError),
    /// The log can not be written.
    #[error(transparent)]
    Log(#[from] LogFileError),
    /// A temporary file can not be written or read.
    #[error("temporary files in {}: {source}", folder.display())]
    Temporary {
        /// Where they are made.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// There is not as much room for temporary files as will be needed.
    #[error(
        "temporary files in {}: about {} MB will be needed for {triangles} triangles, {} MB are free",
        folder.display(), needed >> 20, free >> 20
    )]
    Room {
        /// Where they are made.
        folder: PathBuf,
        /// Bytes, as estimated.
        needed: u64,
        /// Bytes.
        free: u64,
        /// Of the input.
        triangles: u64,
    },
    /// A triangle names a vertex that is not there, or a coordinate is not finite.
    #[error(transparent)]
    Mesh(#[from] LogError),
    /// There are more vertices or triangles than numbers of 32 bits.
    #[error("{vertices} vertices and {triangles} triangles, at most 2^32 - 2 can be simplified")]
    TooMany {
        /// How many.
        vertices: u64,
        /// How many.
        triangles: u64,
    },
    /// [`Limits::stop`] was set.
    #[error("interrupted")]
    Interrupted,
}

/// Simplifies the mesh that `read` gives piece by piece until no legal collapse is left, and writes the log to `output`.
///
/// # Errors
/// Whatever `read` says, a full disk, and everything else that can go wrong with files.
pub fn build_within(
    read: impl FnOnce(&mut dyn Receiver, Progress<'_>) -> Result<(), MeshIoError>,
    output: &Path,
    options: &Options,
    limits: &Limits<'_>,
    progress: Progress<'_>,
) -> Result<Report, OutOfCoreError> {
    check_room(limits.expected_triangles, &limits.temporary)?;
    let scratch = Scratch { folder: limits.temporary.clone() };
    let temporary = |source| temporary(&limits.temporary, source);
    let start = Instant::now();
    let mut input = Input::new(&scratch).map_err(temporary)?;
    let mut receiver = Receiving { input: &mut input, limits, failed: None };
    let outcome = read(&mut receiver, &mut |done, all| progress(100 * done / all.max(1), 1000));
    if let Some(failed) = receiver.failed {
        return Err(failed);
    }
    outcome?;
    let (vertices, triangles) = (input.vertices(), input.triangles.len());
    if vertices.max(triangles) >= u64::from(NONE) {
        return Err(OutOfCoreError::TooMany { vertices, triangles });
    }
    let memory = limits.memory.max(LEAST_MEMORY);
    check_room(triangles, &limits.temporary)?;
    input.place(memory as usize / 2, || stop::check(limits.stop)).map_err(temporary)?;
    let (blocks, live_triangles) = prepare::first_blocks(&mut input, &scratch, memory as usize, |part| {
        progress(100 + part / 10, 1000);
        stop::check(limits.stop)
    })
    .map_err(temporary)?;
    let whole = Whole {
        unit: power_of_two(input.lengths.median()),
        extent: input.extent(),
        live_triangles,
        first_id: 0,
        gives_up: false,
        leans: false,
        parity: FIRST_PARITY,
        merge: false,
    };
    let mut passes = Passes {
        blocks,
        whole,
        next_id: 0,
        stop: limits.stop,
        threads: limits.threads.max(1),
        // The allocator keeps back what windows have taken, for each thread that has freed them: there must be room beside
        // it for all that is left, and for several threads' windows. Components are joined only once all of them fit.
        whole_bytes: if options.merge_components { memory - memory / 8 } else { memory / 8 * 5 },
        window_bytes: if limits.threads > 1 { memory / 8 * 5 } else { memory - memory / 8 },
        sort_bytes: (memory / 32) as usize,
        log: Log::new(&scratch).map_err(temporary)?,
        scratch,
        merge_components: options.merge_components,
        numbers: vertices as u32,
        all: 0,
        live: 0,
        counts: KeyCounts::default(),
        windows: 0,
        loaded: 0,
        roots: 0,
        remains: Remains::default(),
        followers: 0,
        rounds: 0,
    };
    passes.begin().map_err(temporary)?;
    let preparation = start.elapsed();

    let start = Instant::now();
    let all = passes.all;
    passes
        .run(|live| progress(200 + 700 * (all - live) as u64 / all.max(1) as u64, 1000))
        .map_err(temporary)?;
    let simplification = start.elapsed();

    let start = Instant::now();
    let (log, base_triangles) = (&mut passes.log, passes.whole.live_triangles);
    let collapses = log.collapses.len();
    let counts = LogCounts { vertices, triangles, collapses };
    write(output, counts, &input.georeference.clone(), &mut input, log, limits.stop).map_err(|error| {
        match error {
            LogFileError::Io { source, .. } if is_interruption(&source) => OutOfCoreError::Interrupted,
            error => error.into(),
        }
    })?;
    progress(1000, 1000);
    Ok(Report {
        triangles: triangles as usize,
        collapses: collapses as usize,
        rounds: std::mem::take(&mut log.rounds),
        followers: passes.followers,
        attempted_rounds: passes.rounds,
        roots: passes.roots,
        tree_depth: log.tree_depth,
        dependency_depth: log.dependency_depth,
        base_triangles,
        remains: passes.remains,
        largest_eps: log.largest_eps,
        inversions: log.inversions,
        windows: passes.windows,
        loaded: passes.loaded,
        georeference: input.georeference,
        preparation,
        simplification,
        conclusion: start.elapsed(),
    })
}

fn write(
    output: &Path,
    counts: LogCounts,
    georeference: &Georeference,
    input: &mut Input,
    log: &mut Log,
    stop: &AtomicBool,
) -> Result<(), LogFileError> {
    let io = |source| LogFileError::Io { file: output.to_owned(), source };
    let positions = input.positions.read().map_err(io)?.map(|p| Ok(p?.map(f32::from_bits)));
    let triangles = input.triangles.read().map_err(io)?;
    let collapses = log.collapses.read().map_err(io)?.map(|record| {
        let [removed, kept, x, y, z, radius, eps] = record?;
        let center = [x, y, z].map(f32::from_bits);
        let [radius, eps] = [radius, eps].map(f32::from_bits);
        stop::check(stop)?;
        Ok(Collapse { removed, kept, bounds: Bounds { center, radius, eps } })
    });
    write_log_from(output, counts, georeference, positions, triangles, collapses)
}

/// Bytes of temporary files a triangle at the worst moment. The most is needed in the first passes: the input, and all
/// blocks twice, some of them more often. Measured: 153 for 11.5 million triangles of terrain within 256 MB.
const DISK_BYTES_A_TRIANGLE: u64 = 240;

/// Fails if there is not enough room for temporary files.
fn check_room(triangles: u64, folder: &Path) -> Result<(), OutOfCoreError> {
    let needed = DISK_BYTES_A_TRIANGLE * triangles;
    match fs4::available_space(folder) {
        Ok(free) if free < needed => {
            Err(OutOfCoreError::Room { folder: folder.to_owned(), needed, free, triangles })
        }
        // Where nobody can say, it will be seen.
        _ => Ok(()),
    }
}

/// Puts what is read on disk.
struct Receiving<'a> {
    input: &'a mut Input,
    limits: &'a Limits<'a>,
    /// What has gone wrong: the reader only knows that something has.
    failed: Option<OutOfCoreError>,
}

impl Receiving<'_> {
    fn fail(&mut self, error: OutOfCoreError) -> io::Error {
        self.failed.get_or_insert(error);
        io::ErrorKind::Other.into()
    }

    fn keep<T>(&mut self, outcome: io::Result<T>) -> io::Result<T> {
        outcome.map_err(|source| self.fail(temporary(&self.limits.temporary, source)))
    }
}

impl Receiver for Receiving<'_> {
    fn position(&mut self, position: [f64; 3]) -> io::Result<()> {
        let short = position.map(|x| x as f32);
        if !short.iter().all(|x| x.is_finite()) {
            let vertex = self.input.vertices() as usize;
            return Err(self.fail(LogError::BadPosition { vertex, position: short }.into()));
        }
        let outcome = stop::check(self.limits.stop).and_then(|()| self.input.push_position(position));
        self.keep(outcome)
    }

    fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()> {
        let vertices = self.input.vertices();
        if let Some(&vertex) = corners.iter().find(|&&v| u64::from(v) >= vertices) {
            let (triangle, vertices) = (self.input.triangles.len() as usize, vertices as usize);
            return Err(self.fail(LogError::CornerOutOfRange { triangle, vertex, vertices }.into()));
        }
        let outcome = stop::check(self.limits.stop).and_then(|()| self.input.triangles.push(corners));
        self.keep(outcome)
    }

    fn position_of(&mut self, vertex: u32) -> io::Result<[f64; 3]> {
        let outcome = self.input.position_of(vertex);
        self.keep(outcome)
    }

    fn georeference(&mut self, coordinate_system: &str, degrees: Option<DegreeMap>) {
        coordinate_system.clone_into(&mut self.input.georeference.coordinate_system);
        self.input.georeference.degrees = degrees;
    }
}

/// The error for temporary files in a folder, unless somebody wanted the construction to stop.
fn temporary(folder: &Path, source: io::Error) -> OutOfCoreError {
    if is_interruption(&source) {
        OutOfCoreError::Interrupted
    } else {
        OutOfCoreError::Temporary { folder: folder.to_owned(), source }
    }
}

/// Whether an error says that somebody wanted the construction to stop.
fn is_interruption(error: &io::Error) -> bool {
    matches!(error.get_ref(), Some(source) if source.is::<Interrupted>())
}
