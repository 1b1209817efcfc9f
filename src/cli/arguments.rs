//! The arguments of every command.

use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use glam::{DQuat, DVec3};
use meta_node::Dependencies;
use mt_partition::CacheMode;
use page_store::Simulated;

use super::say::Misunderstood;
use super::values::{
    backend, cache, duration, frames, memory, positive, prefetch, rate, size, strategy, work_cap,
};
use crate::experiment::compare::{Loading, Pace};
use crate::experiment::path::import;
use crate::experiment::store::{Backend, BuildOptions};
use selection::budget::WorkCap;
use selection::criterion::Criterion;
use selection::refine::Strategy;
use selection::view::{Camera, View, theta_of_pixels};

/// Event-driven view-dependent level of detail: build hierarchies, replay walkthroughs, compare strategies.
#[derive(Debug, Parser)]
#[command(name = "foldfront", version, about)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Simplify a mesh into a hierarchy and write it to a file.
    Build(Build),
    /// Say what is in a hierarchy file.
    Info(Info),
    /// Check a hierarchy file wholly.
    Verify(Verify),
    /// Replay walkthroughs with every refinement strategy and write tables, curves and a report.
    Compare(Box<Compare>),
    /// Make, import and describe walkthrough paths.
    Path(PathCommand),
    /// Write the refined mesh of one frame.
    Export(Export),
    /// Draw the refined mesh of one frame.
    Render(Render),
    /// Measure how far the refined meshes of some frames are from the original.
    Deviation(Deviation),
}

#[derive(Debug, Args)]
pub(super) struct Build {
    /// Mesh files (.obj .ply .stl .off), heights (.hgt or .zip of them, several are one mosaic; .png .tif), or scene:NAME.
    #[arg(required = true)]
    pub input: Vec<PathBuf>,
    /// How the hierarchy will be stored.
    #[arg(long, default_value = "in-memory", value_parser = backend)]
    pub backend: Backend,
    /// The file to write.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Also merge near vertices of different components, so that many objects end in few roots.
    #[arg(long)]
    pub merge_components: bool,
    #[command(flatten)]
    pub storage: Storage,
    /// Memory to build within, such as 256M, for meshes that are larger; the rest is kept in temporary files. The result is
    /// the same, but for mt-partition, whose merges are made in another order where the graph does not fit.
    #[arg(long, value_name = "SIZE", value_parser = memory)]
    pub memory: Option<u64>,
    /// Threads that share this memory, 1 to 4; the result does not depend on it [default: one a core].
    #[arg(long, value_name = "N", requires = "memory", value_parser = clap::value_parser!(u8).range(1..=4))]
    pub threads: Option<u8>,
    /// Folder for temporary files [default: that of the output].
    #[arg(long, value_name = "DIR", requires = "memory")]
    pub temp: Option<PathBuf>,
}

/// How a backend arranges a hierarchy.
#[derive(Debug, Args)]
pub(super) struct Storage {
    /// Levels of the tree in a meta-node [default: fitted to a page] or in a detail block [default: 4].
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub levels: Option<u32>,
    /// Quantise the nodes of detail blocks.
    #[arg(long)]
    pub quantize: bool,
    /// Triangles on an arc of a multi-triangulation, on average [default: 10].
    #[arg(long, value_name = "N", value_parser = positive)]
    pub patch: Option<f64>,
    /// Most nodes in a partition of a multi-triangulation [default: 20].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub partition: Option<u32>,
}

impl From<&Storage> for BuildOptions {
    fn from(s: &Storage) -> Self {
        Self { levels: s.levels, quantize: s.quantize, patch: s.patch, partition: s.partition }
    }
}

#[derive(Debug, Args)]
pub(super) struct Info {
    /// What `build` wrote.
    pub file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub(super) struct Verify {
    /// What `build` wrote.
    pub file: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum CriterionName {
    /// Projected geometric error.
    Error,
    /// Projected radius of the bounding sphere.
    Sphere,
}

impl From<CriterionName> for Criterion {
    fn from(name: CriterionName) -> Self {
        match name {
            CriterionName::Error => Self::ScreenError,
            CriterionName::Sphere => Self::SphereSize,
        }
    }
}

/// When a node is refined.
#[derive(Debug, Args)]
pub(super) struct Refinement {
    /// What is compared with the tolerance.
    #[arg(long, value_enum, default_value = "error")]
    pub criterion: CriterionName,
    /// Leave coarse what is seen from behind (detail-block; others have no cones of normals).
    #[arg(long)]
    pub normal_cone: bool,
    /// Tolerance as a share of half the image's height.
    #[arg(long, value_parser = positive, conflicts_with = "pixels")]
    pub theta: Option<f64>,
    /// Tolerance in pixels of an image of 1080 lines [default: 1].
    #[arg(long, value_parser = positive)]
    pub pixels: Option<f64>,
}

/// Lines of the image that pixels are counted on.
pub(super) const LINES: u32 = 1080;

impl Refinement {
    pub fn theta(&self) -> f64 {
        self.theta.unwrap_or_else(|| theta_of_pixels(self.pixels.unwrap_or(1.0), LINES))
    }

    /// Before any work: whether the tolerance is one for a lens of this field of view, in radians.
    pub fn check(&self, fov_y: f64) -> Result<(), Misunderstood> {
        let view = Camera::new(DVec3::ZERO, DQuat::IDENTITY, fov_y, 1.0);
        let view = view.and_then(|camera| View::new(&camera, self.theta()));
        let argument = match (self.theta, self.pixels) {
            (Some(theta), _) => format!("--theta {theta:e}"),
            (None, pixels) => format!("--pixels {:e}", pixels.unwrap_or(1.0)),
        };
        view.map(drop).map_err(|wrong| Misunderstood(format!("{argument}: {wrong}")))
    }
}

#[derive(Debug, Args)]
pub(super) struct Compare {
    /// Meshes, hierarchy files, .scene files (several objects, a file and a matrix a line) and scene:NAME; by default the
    /// three built-in scenes. Tiles (.hgt) are one mosaic.
    pub input: Vec<PathBuf>,
    /// Walkthroughs to replay; by default those recorded for a built-in scene, and a flight around anything else.
    #[arg(long)]
    pub path: Vec<PathBuf>,
    /// Replay only these frames.
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub frames: Option<Range<usize>>,
    /// top-down, front, event, event-published, event-queue; by default all but the last.
    #[arg(long, value_delimiter = ',', value_name = "LIST", value_parser = strategy)]
    pub strategy: Vec<Strategy>,
    /// in-memory, meta-node, detail-block, mt-partition: where inputs are kept, each built on the fly; by default
    /// in-memory, and for what `build` wrote, what it was built for.
    #[arg(long, value_delimiter = ',', value_name = "LIST", value_parser = backend)]
    pub backend: Vec<Backend>,
    #[command(flatten)]
    pub storage: Storage,
    /// Memory for pages that a backend never exceeds, such as 64M; by default no limit.
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub page_memory: Option<u64>,
    /// Memory beyond which detail blocks that have not been used for long are removed; by default no limit.
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub soft_quota: Option<u64>,
    /// np-nc, p-nc, p-cc, p-c (Holst & Schumann), p-status: what a multi-triangulation reads at once and keeps.
    #[arg(long, value_name = "MODE", default_value = "p-c", value_parser = cache)]
    pub cache: CacheMode,
    /// What meta-nodes make of neighbours that are too coarse or too fine for a change.
    #[arg(long, value_enum, default_value = "off")]
    pub dependencies: DependencyRule,
    /// paper, printed, blocking, schedule, none: how pages are loaded. Each paper's own scheme, made asynchronous; El-Sana &
    /// Chiang's rules to the letter (meta-node only); on demand, and the frame waits; the engine's foresight; or on demand.
    #[arg(long, value_delimiter = ',', value_name = "LIST", default_value = "paper", value_parser = prefetch)]
    pub prefetch: Vec<Loading>,
    /// Replay in real time at N frames a second, so that pages can be late: on virtual time, with a simulated store. By
    /// default each frame waits for its pages.
    #[arg(long, value_name = "N", value_parser = rate)]
    pub fps: Option<f64>,
    /// Time from a read to its first byte [default: 5ms].
    #[arg(long, value_name = "TIME", value_parser = duration, requires = "fps", conflicts_with = "wall_clock")]
    pub store_latency: Option<Duration>,
    /// Bytes a second that the simulated store carries, such as 200M; by default no limit.
    #[arg(long, value_name = "SIZE", value_parser = size, requires = "fps", conflicts_with = "wall_clock")]
    pub store_bandwidth: Option<u64>,
    /// Replay by the wall clock, from the files as they are.
    #[arg(long, requires = "fps")]
    pub wall_clock: bool,
    #[command(flatten)]
    pub refinement: Refinement,
    /// Steer the tolerance so that no more triangles are displayed.
    #[arg(long, value_name = "N", conflicts_with_all = ["frame_time", "theta", "pixels"])]
    pub triangles: Option<u64>,
    /// Steer the tolerance so that a refinement step takes no longer, such as 5ms.
    #[arg(long, value_name = "TIME", value_parser = duration, conflicts_with_all = ["theta", "pixels"])]
    pub frame_time: Option<Duration>,
    /// Do no more in a frame than N folds and unfolds, or than fit a time such as 200us; the rest is carried over.
    #[arg(long, value_name = "N", value_parser = work_cap)]
    pub work_cap: Option<WorkCap>,
    /// Full speed of the eye in object units a frame, for event-queue and event-published; by default the path's 99th
    /// percentile.
    #[arg(long, value_parser = positive)]
    pub rho: Option<f64>,
    /// Full speed of turning in radians a frame, for event-queue and event-published; by default the path's 99th
    /// percentile.
    #[arg(long, value_parser = positive)]
    pub omega: Option<f64>,
    /// Join near components of meshes that are simplified for this, as with `build`.
    #[arg(long)]
    pub merge_components: bool,
    /// Compare every frame's cut with that of the other strategies and with the brute-force oracle.
    #[arg(long)]
    pub check: bool,
    /// Folder for the results.
    #[arg(long, default_value = "compare-out")]
    pub out: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum DependencyRule {
    /// They change first.
    Force,
    /// The change is refused, as in the paper.
    Block,
    /// Nothing: spheres and errors are nested over all dependencies.
    Off,
}

/// Latency of a store where none is given: that of a disk with moving heads, or of a network drive.
const STORE_LATENCY: Duration = Duration::from_millis(5);

impl Compare {
    /// How time passes.
    pub fn pace(&self) -> Pace {
        let Some(fps) = self.fps else { return Pace::Settled };
        let frame = Duration::from_secs_f64((1.0 / fps).min(1e6));
        if self.wall_clock {
            return Pace::WallClock(frame);
        }
        let latency = self.store_latency.unwrap_or(STORE_LATENCY);
        let store = Simulated { bandwidth: self.store_bandwidth, ..Simulated::with_latency(latency) };
        Pace::Simulated(frame, store)
    }
}

impl From<DependencyRule> for Dependencies {
    fn from(rule: DependencyRule) -> Self {
        match rule {
            DependencyRule::Force => Self::Force,
            DependencyRule::Block => Self::Block,
            DependencyRule::Off => Self::Off,
        }
    }
}

#[derive(Debug, Args)]
pub(super) struct PathCommand {
    #[command(subcommand)]
    pub command: PathSubcommand,
}

#[derive(Debug, Subcommand)]
pub(super) enum PathSubcommand {
    /// Make the recorded walkthroughs of the built-in scenes again.
    Generate {
        /// scene:city, scene:alps, scene:laserscan; by default all.
        scenes: Vec<String>,
        /// Folder to write to.
        #[arg(short, long, default_value = "paths")]
        output: PathBuf,
    },
    /// Describe paths.
    Info {
        /// Path files.
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Bring a recorded trajectory to a mesh: scaled, placed, oriented and resampled.
    ///
    /// Times may be in seconds, or since 1970 in milli-, micro- or nanoseconds; a header may name columns and units. The
    /// path is in world coordinates.
    Import {
        /// TUM, KITTI (converted), EuRoC and other tables with a header, Hoppe .frames, or positions only.
        trajectory: PathBuf,
        /// The mesh or scene or hierarchy that the path is for.
        #[arg(long, required = true, num_args = 1..)]
        fit: Vec<PathBuf>,
        /// The path file to write.
        #[arg(short, long)]
        output: PathBuf,
        /// How the trajectory is placed.
        #[arg(long, value_enum, default_value = "fly")]
        mode: ImportMode,
        /// Frames a second.
        #[arg(long, default_value = "60", value_parser = positive)]
        rate: f64,
        /// Keep place, scale and time: metres are the mesh's world coordinates, latitudes and longitudes are where the mesh
        /// has them.
        #[arg(long, conflicts_with = "mode")]
        no_fit: bool,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ImportMode {
    /// Over and around the mesh, clear of its surface.
    Fly,
    /// At eye height above the ground.
    Walk,
    /// Around the mesh, looking at it.
    Orbit,
}

impl From<ImportMode> for import::Mode {
    fn from(mode: ImportMode) -> Self {
        match mode {
            ImportMode::Fly => Self::Fly,
            ImportMode::Walk => Self::Walk,
            ImportMode::Orbit => Self::Orbit,
        }
    }
}

/// One frame of a walkthrough of something.
#[derive(Debug, Args)]
pub(super) struct FrameOf {
    /// A hierarchy file, a mesh, or scene:NAME.
    #[arg(required = true)]
    pub file: Vec<PathBuf>,
    /// The walkthrough.
    #[arg(long)]
    pub path: PathBuf,
    /// Number of the frame, from 0.
    #[arg(long)]
    pub frame: usize,
    #[command(flatten)]
    pub refinement: Refinement,
}

#[derive(Debug, Args)]
pub(super) struct Export {
    #[command(flatten)]
    pub frame: FrameOf,
    /// The .ply file to write.
    #[arg(short, long)]
    pub output: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct Render {
    #[command(flatten)]
    pub frame: FrameOf,
    /// The .png file to write.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Look from outside, with the frustum drawn.
    #[arg(long)]
    pub outside: bool,
    /// Draw the edges of the triangles too.
    #[arg(long)]
    pub wire: bool,
    /// Width of the picture in pixels.
    #[arg(long, default_value = "1280", value_parser = clap::value_parser!(u32).range(16..=8192))]
    pub width: u32,
}

#[derive(Debug, Args)]
pub(super) struct Deviation {
    /// A hierarchy file, a mesh, or scene:NAME.
    #[arg(required = true)]
    pub file: Vec<PathBuf>,
    /// The original to measure against; by default the input that the hierarchy holds.
    #[arg(long)]
    pub against: Vec<PathBuf>,
    /// The walkthrough.
    #[arg(long)]
    pub path: PathBuf,
    /// Numbers of the frames, from 0.
    #[arg(long, value_delimiter = ',', required = true)]
    pub frames: Vec<usize>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub refinement: Refinement,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn arguments_are_consistent() {
        Arguments::command().debug_assert();
    }
}
