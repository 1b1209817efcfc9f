//! Strategies along a path through a scene of several objects, of whatever backends.
//!
//! All objects share one memory; see [`objects`](crate::experiment::stored_scene::StoredScene) for what else. A check compares every object in every
//! frame with the brute-force cut of its own nodes, in a replay of its own.

use std::ops::{ControlFlow, Range};

use super::error::CompareError;
use super::opening::Opening;
use super::options::{Options, Pace};
use super::run::{Row, Run};
use crate::experiment::path::Path;
use crate::experiment::store::Store;
use crate::experiment::stored_scene::StoredScene;
use construction::progress::Progress;
use selection::view::View;

/// Replays `frames` of a path through a scene with every strategy and every way to load of the options. Budgets are
/// those of each object. By the wall clock a scene can not be replayed; it is then on a settled replay. `progress` counts
/// replays.
///
/// # Errors
/// [`CompareError::NotPrinted`] before anything is done, [`CompareError::View`], [`CompareError::Objects`], and
/// [`CompareError::Differs`] where the options ask for a check.
pub fn replay_scene(
    name: &str,
    scene: &StoredScene,
    path: &Path,
    frames: Range<usize>,
    options: &Options,
    progress: Progress,
) -> Result<Vec<Run>, CompareError> {
    let wrap = |source| CompareError::Objects { scene: name.to_owned(), source: Box::new(source) };
    for &prefetch in &options.prefetch {
        let mut backends = scene.files().iter().map(Store::backend);
        if let Some(backend) = backends.find(|&backend| !prefetch.is_for(backend)) {
            return Err(CompareError::NotPrinted { scene: name.to_owned(), prefetch, backend });
        }
    }
    let mut brute_force = options.check.then(|| scene.brute_force()).transpose().map_err(wrap)?;
    let speed = options.declared_speed(path);
    let views: Vec<View> = frames.clone().map(|frame| options.view(path, frame)).collect::<Result<_, _>>()?;
    let replays = options.prefetch.len() * options.strategies.len() * (1 + usize::from(options.check));
    let mut done = 0;
    let mut count = || {
        done += 1;
        progress(done, replays as u64);
    };
    let goes_on = || if options.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let mut runs: Vec<Run> = Vec::new();
    for &prefetch in &options.prefetch {
        let opening = Opening { paging: options.paging, prefetch, pace: options.pace };
        let frame_time = match options.pace {
            Pace::Simulated(time, _) => Some(time),
            Pace::Settled | Pace::WallClock(_) => None,
        };
        for &strategy in &options.strategies {
            let settings = options.settings(strategy, &speed);
            let (backend, scene_name, path) = (scene.backend(), name.to_owned(), path.name.clone());
            let (mut rows, mut fault) = (Vec::with_capacity(views.len()), None);
            // A memory and a store for each replay.
            let measured =
                scene.replay(&views, settings, &opening.scene(), frame_time, |at, objects, report| {
                    if report.pages.faults > 0 && fault.is_none() {
                        fault = objects.take_fault().map(|fault| fault.to_string());
                    }
                    rows.push(Row { frame: frames.start + at, report, wrong: None });
                    goes_on()
                });
            measured.map_err(wrap)?;
            count();
            if let Some(brute_force) = &mut brute_force {
                let mut differs = None;
                let checked =
                    scene.replay(&views, settings, &opening.scene(), frame_time, |at, objects, report| {
                        let [wrong, unexplained] = objects.wrong(brute_force);
                        rows[at].wrong = Some(wrong);
                        let is_exact = strategy.is_exact() && report.carried + report.blocked == 0;
                        if is_exact && unexplained > 0 {
                            differs = differs.or(Some((frames.start + at, unexplained)));
                        }
                        goes_on()
                    });
                checked.map_err(wrap)?;
                count();
                if let Some((frame, wrong)) = differs {
                    let (scene, strategy) = (scene_name, strategy.name());
                    return Err(CompareError::Differs { scene, path, frame, strategy, backend, wrong });
                }
            }
            if options.is_stopped() {
                return Ok(runs);
            }
            runs.push(Run { scene: scene_name, path, backend, strategy, prefetch, speed, rows, fault });
        }
    }
    Ok(runs)
}
