//! What a replay comes to, and what its cuts are checked with.

use super::loading::Loading;
use selection::engine::FrameReport;
use selection::motion::Speed;
use selection::refine::Strategy;
use testing::brute_force::BruteForce;
use testing::oracle::Oracle;

/// One frame of a replay.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Number of the frame in the path.
    pub frame: usize,
    /// What the engine reports.
    pub report: FrameReport,
    /// Nodes that differ from the oracle, where that was looked at.
    pub wrong: Option<u64>,
}

/// One strategy along one path.
#[derive(Clone, Debug)]
pub struct Run {
    /// What was looked at.
    pub scene: String,
    /// Name of the path.
    pub path: String,
    /// Where the hierarchy was kept.
    pub backend: &'static str,
    /// How the nodes that must change were found.
    pub strategy: Strategy,
    /// How pages were loaded.
    pub prefetch: Loading,
    /// Declared speed.
    pub speed: Speed,
    /// The frames.
    pub rows: Vec<Row>,
    /// The first of the faults, if there were any: in which file, where, and what is wrong there.
    pub fault: Option<String>,
}

/// What a replay that is measured gives.
pub(super) struct Measured {
    pub rows: Vec<Row>,
    pub fault: Option<String>,
}

/// Brute force, over the collapse log or over a backend's own nodes.
pub(super) enum Check {
    Log(Oracle),
    Nodes(BruteForce),
}
