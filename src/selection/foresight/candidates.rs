//! The nodes in play that will be wrong at an instant ahead.
//!
//! Whatever a strategy has is passed on in blocks. The time bounds rule out, for the front scan and top-down, what the
//! camera can not reach; the event queue has done so before. What is left is tested with the views at each instant, first
//! by the filter, and by the predicate where that is not certain.

use glam::DVec3;
use multiversion::multiversion;
use vertex_tree::Bounds;

use super::ahead::{Ahead, Change, MOST_INSTANTS, Watched};
use crate::filter::{Lens, Lenses, Rates, certainly, doubtful, earliest, for_each_bit};
use crate::in_play::{Kind, Slot};
use crate::motion::{Course, Travel};
use crate::packed::{Block, LANES};
use crate::refine::Finder;
use crate::refine::front::FrontScan;

#[derive(Default)]
pub(super) struct Candidates {
    /// What is being gathered: boundary nodes, and collapsible nodes.
    folded: Gathered,
    unfolded: Gathered,
}

/// A block that is being filled.
struct Gathered {
    block: Block,
    count: usize,
}

impl Default for Gathered {
    fn default() -> Self {
        Self { block: Block::EMPTY, count: 0 }
    }
}

/// The views ahead as the filter takes them.
struct Glasses {
    now: Lenses,
    /// The time bounds' unit of time is all that is looked ahead.
    rates: Option<Rates>,
    ahead: [Option<Lenses>; MOST_INSTANTS],
    /// A node may fold because it turns its back, which the filter knows nothing of.
    has_cones: bool,
}

impl Candidates {
    /// Puts all of them on the agenda, at the instant at which they are wrong first.
    pub fn find(
        &mut self,
        ahead: &Ahead,
        Watched { front, finder, waiting, carried }: Watched,
        agenda: &mut [Vec<Change>; MOST_INSTANTS],
    ) {
        let Some(now) = Lenses::new(ahead.frame.criterion, ahead.frame.views) else { return };
        let lenses = |instant| if instant < ahead.instants { ahead.lenses(instant) } else { None };
        let has_cones = ahead.frame.cones.is_some();
        let glasses = Glasses { now, rates: reach(ahead), ahead: std::array::from_fn(lenses), has_cones };
        let mut put = |kind, instant: usize, slot| {
            agenda[instant].push(match kind {
                Kind::Unfold => Change::Unfold(front.node(slot)),
                Kind::Fold => Change::Fold(slot),
            });
        };
        let Self { folded, unfolded } = self;
        let mut take = |slot: Slot, kind, bounds: &Bounds| {
            let gathered = if kind == Kind::Unfold { &mut *folded } else { &mut *unfolded };
            gathered.block.set(gathered.count, bounds, slot.0);
            gathered.count += 1;
            if gathered.count == LANES {
                sift(gathered, kind, ahead, &glasses, &mut put);
            }
        };
        // What is refused now is wrong at the next instant too, if it is still in play.
        for change in waiting.changes.iter().filter(|change| front.is_waiting(change.slot)) {
            take(change.slot, change.kind, &front.bounds(change.slot));
        }
        // So is what is carried, which these strategies do not watch meanwhile.
        if matches!(finder, Finder::Event(_) | Finder::Front(_)) {
            carried.for_each(|kind, slot| take(slot, kind, &front.bounds(slot)));
        }
        match finder {
            Finder::Event(event) => {
                let travels =
                    || (0..ahead.instants).map(|at| Travel::between(ahead.frame.views, ahead.at(at)));
                event.for_each_due(travels, |event| take(event.slot, event.kind(), &event.bounds));
                if let Some(near) = event.near() {
                    pass_on(near, &glasses, &mut take);
                }
            }
            Finder::Front(scan) => pass_on(scan, &glasses, &mut take),
            Finder::TopDown(_) | Finder::Published(_) => {
                let mut blocks = [(Kind::Unfold, Gathered::default()), (Kind::Fold, Gathered::default())];
                let mut pass = |kind, gathered: &mut Gathered| {
                    for_each_bit(within_reach(&gathered.block, gathered.count, kind, &glasses), |lane| {
                        take(Slot(gathered.block.tag[lane]), kind, &gathered.block.bounds(lane));
                    });
                    gathered.count = 0;
                };
                front.for_each_watched(|slot, kind, bounds| {
                    let (_, gathered) = &mut blocks[usize::from(kind == Kind::Fold)];
                    gathered.block.set(gathered.count, bounds, slot.0);
                    gathered.count += 1;
                    if gathered.count == LANES {
                        pass(kind, gathered);
                    }
                });
                blocks.iter_mut().for_each(|(kind, gathered)| pass(*kind, gathered));
            }
        }
        sift(&mut self.folded, Kind::Unfold, ahead, &glasses, &mut put);
        sift(&mut self.unfolded, Kind::Fold, ahead, &glasses, &mut put);
    }
}

/// Passes on what is scanned and within reach.
fn pass_on(scan: &FrontScan, glasses: &Glasses, take: &mut impl FnMut(Slot, Kind, &Bounds)) {
    for (packed, kind) in scan.watched() {
        for (block, used) in packed.blocks() {
            for_each_bit(within_reach(block, used, kind, glasses), |lane| {
                take(Slot(block.tag[lane]), kind, &block.bounds(lane));
            });
        }
    }
}

/// The course on which one frame takes the views to any of the instants; `None` if there is none.
fn reach(ahead: &Ahead) -> Option<Rates> {
    let mut course = Course { heading: DVec3::ZERO, rho: 0.0, stray: 0.0, omega: 0.0, kappa: 0.0 };
    let mut last = DVec3::ZERO;
    for instant in 0..ahead.instants {
        let travel = Travel::between(ahead.frame.views, ahead.at(instant))?;
        for moved in travel.moves() {
            course.rho = course.rho.max(moved.length());
            last = moved;
        }
        course.omega = course.omega.max(travel.turned);
        course.kappa = course.kappa.max(travel.steered);
    }
    // More than the arithmetic of the views can have lost.
    let extent = ahead.frame.views.iter().map(|view| view.eye().length()).fold(0.0, f64::max);
    course.rho *= 1.0 + 1e-6;
    course.omega *= 1.0 + 1e-6;
    course.kappa *= 1.0 + 1e-6;
    course.stray = 1e-6 * course.rho + 1e-12 * extent;
    match ahead.frame.views {
        // The eye goes straight on.
        [_] => course.heading = last.normalize_or_zero(),
        _ => course.stray += course.rho,
    }
    if course.heading == DVec3::ZERO {
        (course.stray, course.rho) = (course.stray + course.rho, 0.0);
    }
    Some(Rates::new(&course))
}

/// The entries of a block whose status may have to change by the last instant.
fn within_reach(block: &Block, used: usize, kind: Kind, glasses: &Glasses) -> u32 {
    let all = ((1_u64 << used) - 1) as u32;
    match &glasses.rates {
        _ if glasses.has_cones && kind == Kind::Fold => all,
        None => all,
        Some(rates) => all & may_change(block, kind, glasses.now.as_slice(), rates),
    }
}

#[multiversion(targets("x86_64+avx2+lzcnt+bmi1+bmi2", "x86_64+sse4.1"))]
fn may_change(block: &Block, kind: Kind, now: &[Lens], rates: &Rates) -> u32 {
    let block = Block { tag: [u32::from(kind == Kind::Fold); LANES], ..*block };
    let frames = earliest(&block, now, rates);
    (0..LANES).fold(0, |mask, i| mask | (u32::from(frames[i] <= 1.0) << i))
}

/// Puts the nodes of a block on the agenda that will be wrong, and empties it.
fn sift(
    gathered: &mut Gathered,
    kind: Kind,
    ahead: &Ahead,
    glasses: &Glasses,
    put: &mut impl FnMut(Kind, usize, Slot),
) {
    let Gathered { block, count } = gathered;
    let mut left = ((1_u64 << *count) - 1) as u32;
    for (instant, lenses) in glasses.ahead.iter().enumerate() {
        let Some(lenses) = lenses.as_ref().filter(|_| left != 0) else { break };
        let doubtful = match kind {
            Kind::Fold if glasses.has_cones => left,
            _ => left & may_be_wrong(block, *count, kind, lenses.as_slice()),
        };
        for_each_bit(doubtful, |lane| {
            let slot = Slot(block.tag[lane]);
            if ahead.is_wrong(instant, kind, slot, &block.bounds(lane)) {
                left &= !(1 << lane);
                put(kind, instant, slot);
            }
        });
    }
    *count = 0;
}

/// The entries of a block that are not certain to be right.
#[multiversion(targets("x86_64+avx2+lzcnt+bmi1+bmi2", "x86_64+sse4.1"))]
fn may_be_wrong(block: &Block, used: usize, kind: Kind, lenses: &[Lens]) -> u32 {
    match kind {
        Kind::Unfold => doubtful(&certainly::<false>(block, lenses), used),
        Kind::Fold => doubtful(&certainly::<true>(block, lenses), used),
    }
}
