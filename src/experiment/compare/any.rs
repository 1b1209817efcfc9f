//! Trees of others along a path, compared as those of this project are.

use std::ops::Range;

use construction::progress::Progress;
use selection::view::View;
use testing::brute_force::BruteForce;
use vertex_tree::{NullSink, Refine, TreeError, VertexTree};

use super::error::CompareError;
use super::loading::Loading;
use super::opening::Opening;
use super::options::Options;
use super::replay::{Named, Replay};
use super::run::{Check, Run};
use crate::experiment::path::Path;

/// Replays `frames` of a path with every strategy of the options, over the trees that `open` gives, each of which is wholly folded and
/// started by nobody. How they page, and on what time, is `open`'s to say; [`Options::paging`] and [`Options::prefetch`] are not looked at, and
/// of [`Options::pace`] how time passes between frames. Strategies that may miss something, and where the options ask for a check
/// all others, are compared with brute force in every frame. `progress` counts frames.
///
/// # Errors
/// [`CompareError::View`], [`CompareError::Tree`], and [`CompareError::Differs`] where the options ask for a check.
pub fn replay_any<T: VertexTree>(
    named: Named,
    mut open: impl FnMut() -> Result<T, TreeError>,
    path: &Path,
    frames: Range<usize>,
    options: &Options,
    progress: Progress,
) -> Result<Vec<Run>, CompareError> {
    let wrap = |source| CompareError::Tree { scene: named.scene.to_owned(), source };
    let views: Vec<View> = frames.clone().map(|frame| options.view(path, frame)).collect::<Result<_, _>>()?;
    let speed = options.declared_speed(path);
    let opening = Opening { pace: options.pace, ..Opening::SETTLED };
    let is_checked = |at: usize| options.check || !options.strategies[at].is_exact();
    let replays: usize = (0..options.strategies.len()).map(|at| 1 + usize::from(is_checked(at))).sum();
    let (mut done, total) = (0, (replays * views.len()) as u64);
    let mut count = || {
        done += 1;
        progress(done, total);
    };
    let mut check = None;
    let mut runs = Vec::with_capacity(options.strategies.len());
    for (at, &strategy) in options.strategies.iter().enumerate() {
        let replay = Replay {
            named,
            path,
            frames: frames.clone(),
            views: &views,
            settings: options.settings(strategy, &speed),
            opening,
            stop: options.stop,
        };
        let mut measured = replay.measure(opening.wrap(open().map_err(wrap)?), &mut count)?;
        if is_checked(at) {
            let check = match &mut check {
                Some(check) => check,
                none => {
                    let mut whole = Opening::SETTLED.wrap(open().map_err(wrap)?);
                    whole.start(&mut NullSink).map_err(wrap)?;
                    none.insert(Check::Nodes(BruteForce::new(&mut whole).map_err(wrap)?))
                }
            };
            replay.check(opening.wrap(open().map_err(wrap)?), check, &mut measured.rows, &mut count)?;
        }
        runs.push(replay.run_of(Loading::None, speed, measured));
    }
    Ok(runs)
}
