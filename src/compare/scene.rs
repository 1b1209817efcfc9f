//! Strategies along a path through a scene of several objects.
//!
//! All objects share one memory and one reader. There is no brute force over a whole scene: a check compares the exact
//! strategies with each other.

use std::ops::Range;

use super::{CompareError, Opening, Options, Pace, Row, Run};
use crate::objects::StoredScene;
use crate::path::Path;
use crate::progress::Progress;
use crate::store::Backend;
use crate::view::View;

/// Replays `frames` of a path through a scene with every strategy and every way to prefetch of the options. Budgets are
/// those of each object. By the wall clock a scene can not be replayed; it is then on a settled replay. `progress` counts
/// replays.
///
/// # Errors
/// [`CompareError::View`], [`CompareError::Objects`], and [`CompareError::Disagree`] where the options ask for a check.
pub fn replay_scene(
    name: &str,
    scene: &StoredScene,
    path: &Path,
    frames: Range<usize>,
    options: &Options,
    progress: Progress,
) -> Result<Vec<Run>, CompareError> {
    let wrap = |source| CompareError::Objects { scene: name.to_owned(), source };
    let speed = options.declared_speed(path);
    let views: Vec<View> = frames.clone().map(|frame| options.view(path, frame)).collect::<Result<_, _>>()?;
    let total = (options.prefetch.len() * options.strategies.len()) as u64;
    let mut runs: Vec<Run> = Vec::new();
    for &prefetch in &options.prefetch {
        let opening = Opening { paging: options.paging, prefetch, pace: options.pace };
        let frame_time = match options.pace {
            Pace::Simulated(time, _) => Some(time),
            Pace::Settled | Pace::WallClock(_) => None,
        };
        for &strategy in &options.strategies {
            let settings = options.settings(strategy, &speed);
            // A memory and a store for each replay.
            let reports =
                scene.replay(&views, settings, &opening.mt_partition(), frame_time).map_err(wrap)?;
            let rows = frames
                .clone()
                .zip(reports)
                .map(|(frame, report)| Row { frame, report, wrong: None })
                .collect();
            let backend = Backend::MtPartition.name();
            let (scene, path) = (name.to_owned(), path.name.clone());
            runs.push(Run { scene, path, backend, strategy, prefetch, speed, rows });
            progress(runs.len() as u64, total);
        }
    }
    if options.check {
        agree(&runs)?;
    }
    Ok(runs)
}

/// Whether all exact strategies have the same cut in every frame in which none has been refused anything.
fn agree(runs: &[Run]) -> Result<(), CompareError> {
    let mut exact = runs.iter().filter(|run| run.strategy.is_exact());
    let Some(first) = exact.next() else { return Ok(()) };
    for run in exact {
        for (a, b) in first.rows.iter().zip(&run.rows) {
            let is_late = |row: &Row| row.report.misses + row.report.carried > 0;
            if a.report.cut_hash != b.report.cut_hash && !is_late(a) && !is_late(b) {
                return Err(CompareError::Disagree {
                    scene: run.scene.clone(),
                    path: run.path.clone(),
                    frame: a.frame,
                    strategies: [first.strategy.name(), run.strategy.name()],
                });
            }
        }
    }
    Ok(())
}
