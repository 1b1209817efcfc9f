//! One strategy along one path.

use std::ops::Range;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use vertex_tree::{Hierarchy, NodeId, NullSink, Refine, TreeError, VertexTree};

use super::error::{CompareError, WrongCut};
use super::loading::Loading;
use super::opening::Opening;
use super::options::{Pace, is_raised};
use super::run::{Check, Measured, Row, Run};
use crate::experiment::path::Path;
use selection::active_mesh::ActiveMesh;
use selection::engine::{Engine, FrameReport, Settings};
use selection::motion::Speed;
use selection::refine::Strategy;
use selection::settled::Settled;
use selection::view::View;

/// A tree of whatever backend, that is compared: what it is of, and what the backend is called.
#[derive(Clone, Copy, Debug)]
pub struct Named<'a> {
    /// What is walked through.
    pub scene: &'a str,
    /// The backend, as in a report.
    pub backend: &'static str,
    /// Whether a node may wait for one that is neither above nor below it.
    pub has_dependencies: bool,
}

pub(super) struct Replay<'a> {
    pub named: Named<'a>,
    pub path: &'a Path,
    pub frames: Range<usize>,
    pub views: &'a [View],
    pub settings: Settings,
    pub opening: Opening,
    pub stop: Option<&'static AtomicBool>,
}

/// Rounds of waiting for a first frame: as many as its pages can lie below each other.
const FIRST_ROUNDS: usize = 200;

impl Replay<'_> {
    fn tree_error(&self, source: TreeError) -> CompareError {
        CompareError::Tree { scene: self.named.scene.to_owned(), source }
    }

    /// What has been measured as a run.
    pub fn run_of(&self, prefetch: Loading, speed: Speed, measured: Measured) -> Run {
        let Measured { rows, fault } = measured;
        Run {
            scene: self.named.scene.to_owned(),
            path: self.path.name.clone(),
            backend: self.named.backend,
            strategy: self.settings.strategy,
            prefetch,
            speed,
            rows,
            fault,
        }
    }

    /// Replays the path, and calls `after` with each frame, its view and its report.
    fn run<T: Refine<S>, S>(
        &self,
        tree: Settled<T>,
        sink: S,
        mut after: impl FnMut(usize, &mut Engine<Settled<T>, S>, FrameReport) -> Result<(), CompareError>,
    ) -> Result<(), CompareError> {
        let wrap = |e| self.tree_error(e);
        let mut engine = Engine::new(tree, sink, self.settings).map_err(wrap)?;
        let mut start = Instant::now();
        // While a frame waits for the store the path does not go on.
        let mut stalled = Duration::ZERO;
        for (at, (frame, view)) in self.frames.clone().zip(self.views).enumerate() {
            if is_raised(self.stop) {
                return Err(CompareError::Interrupted);
            }
            let views = std::slice::from_ref(view);
            match self.opening.pace {
                Pace::Settled => {}
                _ if at == 0 => {
                    let report = self.first_frame(&mut engine, views)?;
                    start = Instant::now();
                    after(frame, &mut engine, report)?;
                    continue;
                }
                Pace::Simulated(time, _) => engine.tree_mut().pass(time).map_err(wrap)?,
                Pace::WallClock(time) => {
                    let due = start + time.mul_f64(at as f64) + stalled;
                    std::thread::sleep(due.saturating_duration_since(Instant::now()));
                }
            }
            let report = engine.advance(views).map_err(wrap)?;
            stalled += report.pages.stalled;
            after(frame, &mut engine, report)?;
        }
        Ok(())
    }

    /// A viewer shows nothing before it has what its first frame needs. All of that is reported as one frame.
    fn first_frame<T: Refine<S>, S>(
        &self,
        engine: &mut Engine<Settled<T>, S>,
        views: &[View],
    ) -> Result<FrameReport, CompareError> {
        let wrap = |e| self.tree_error(e);
        let mut all = engine.advance(views).map_err(wrap)?;
        for _ in 0..FIRST_ROUNDS {
            if all.misses == 0 {
                break;
            }
            engine.tree_mut().settle().map_err(wrap)?;
            let report = engine.advance(views).map_err(wrap)?;
            all = all.followed_by(&report);
        }
        Ok(all)
    }

    pub fn measure<T: VertexTree>(
        &self,
        tree: Settled<T>,
        count: &mut impl FnMut(),
    ) -> Result<Measured, CompareError> {
        let mut rows = Vec::with_capacity(self.views.len());
        let mut fault = None;
        self.run(tree, ActiveMesh::new(), |frame, engine, report| {
            engine.sink_mut().clear_changes();
            if report.pages.faults > 0 && fault.is_none() {
                fault = engine.take_fault().map(|fault| fault.to_string());
            }
            rows.push(Row { frame, report, wrong: None });
            count();
            Ok(())
        })?;
        Ok(Measured { rows, fault })
    }

    /// Compares every frame with brute force. What a store on virtual time refuses is the same as when that was measured.
    pub fn check<T: VertexTree>(
        &self,
        tree: Settled<T>,
        check: &mut Check,
        rows: &mut [Row],
        count: &mut impl FnMut(),
    ) -> Result<(), CompareError> {
        let mut rows = rows.iter_mut();
        self.run(tree, NullSink, |frame, engine, report| {
            // What is carried over or blocked is not wrong, it is late, and what was refused keeps back just what depends
            // on it.
            let is_exact = self.settings.strategy.is_exact() && report.carried + report.blocked == 0;
            let (scene, path) = (self.named.scene.to_owned(), self.path.name.clone());
            let wrong = match check {
                Check::Log(oracle) => {
                    let difference = oracle.compare(engine);
                    if let Some(difference) = difference.filter(|_| is_exact && report.misses == 0) {
                        return Err(CompareError::Wrong(Box::new(WrongCut {
                            scene,
                            path,
                            frame,
                            strategy: self.settings.strategy,
                            difference,
                            views: engine.views().to_vec(),
                            criterion: self.settings.criterion,
                        })));
                    }
                    difference.map_or(0, |d| d.count as u64)
                }
                Check::Nodes(brute_force) => {
                    let [wrong, unexplained] = brute_force.judge(engine, self.named.has_dependencies);
                    if unexplained > 0 && is_exact {
                        let (strategy, backend) = (self.settings.strategy.name(), self.named.backend);
                        let wrong = unexplained;
                        return Err(CompareError::Differs { scene, path, frame, strategy, backend, wrong });
                    }
                    wrong
                }
            };
            if let Some(row) = rows.next() {
                row.wrong = Some(wrong);
            }
            count();
            Ok(())
        })
    }

    /// How many nodes differ from the cut of an exact strategy that waits for its pages, in every frame.
    pub fn compare<T: VertexTree>(
        &self,
        tree: Settled<T>,
        beside: Settled<T>,
        count: &mut impl FnMut(),
    ) -> Result<Vec<u64>, CompareError> {
        let wrap = |e| self.tree_error(e);
        let mut differs = vec![0_u64; tree.node_limit().div_ceil(64) as usize];
        let settings = Settings { strategy: Strategy::Front, ..self.settings };
        let mut exact = Engine::new(beside, NullSink, settings).map_err(wrap)?;
        let mut all = Vec::with_capacity(self.views.len());
        self.run(tree, NullSink, |_, engine, _| {
            exact.advance_relative(engine.views()).map_err(wrap)?;
            let mut wrong = 0;
            if exact.front().cut_hash() != engine.front().cut_hash() {
                let mut turn = |node: NodeId| differs[node.index() / 64] ^= 1 << (node.0 % 64);
                exact.for_each_active(&mut turn);
                engine.for_each_active(&mut turn);
                // What differs is turned back as it is counted.
                let words = differs.iter_mut().map(std::mem::take);
                wrong = words.map(|word| u64::from(word.count_ones())).sum();
            }
            all.push(wrong);
            count();
            Ok(())
        })?;
        Ok(all)
    }
}
