//! The queue against lists: what comes up when, what is cancelled, and how much is kept.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::panic::{AssertUnwindSafe, catch_unwind};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;

const BOUNDS: Bounds = Bounds { center: [1.0, 2.0, 3.0], radius: 4.0, eps: 5.0 };

fn scheduled(queue: &mut EventQueue, clock: usize, slot: u32, ticks: u32) {
    let event = queue.event(Slot(slot), Kind::Unfold, BOUNDS);
    queue.on(clock).schedule_ticks(ticks, event);
}

/// The slots of every event that has come up, in order of slots.
fn all_due(queue: &mut EventQueue) -> Vec<u32> {
    let (mut all, mut due) = (Vec::new(), [Event::BLANK; DUE]);
    while let count @ 1.. = queue.next_due(&mut due) {
        all.extend(due[..count].iter().map(|event| event.slot.0));
    }
    assert!(!queue.is_ripe());
    all.sort_unstable();
    all
}

fn frames(ticks: u64) -> f64 {
    ticks as f64 / TICKS_PER_FRAME
}

/// A number of fewer bits than so many, of any number of them as likely as of any other.
fn of_any_size(bits: u32, random: &mut Pcg64Mcg) -> u64 {
    let bits = random.random_range(1..bits);
    random.random_range(0..1 << bits)
}

#[test]
fn an_event_says_what_it_is_for() {
    for ticket in [0, 1, 77, u16::MAX] {
        for kind in [Kind::Unfold, Kind::Fold] {
            let event = Event::new(BOUNDS, Slot(9), ticket, kind);
            assert_eq!(
                (event.kind(), event.ticket(), event.slot, event.bounds),
                (kind, ticket, Slot(9), BOUNDS)
            );
            // What vector code tells the kinds apart by.
            assert_eq!(event.tag() & 1, u32::from(kind == Kind::Fold));
        }
    }
}

/// A deadline is known to an eighth of itself, or to a quarter where it straddles the borders of the slots; and the tick
/// that a clock is in is drained at every advance.
#[test]
fn an_event_is_never_late_and_early_by_a_quarter_at_most() {
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let mut eighths = 0;
    for trial in 0..4_000_u32 {
        let mut queue = EventQueue::new(1);
        let start = of_any_size(40, &mut random);
        queue.advance(0, frames(start));
        let ahead = of_any_size(31, &mut random) as u32;
        scheduled(&mut queue, 0, 3, ahead);
        assert!(!queue.is_idle(0));
        let deadline = start + u64::from(ahead);
        let earliest = deadline - u64::from(ahead / 4);
        // It is the last tick before it is due that must not let it come up, and the deadline's that must.
        if earliest > start {
            // By one step or by two.
            if trial % 2 == 0 {
                queue.advance(0, frames(random.random_range(start..earliest)));
            }
            queue.advance(0, frames(earliest - 1));
            assert_eq!(all_due(&mut queue), [0; 0], "trial {trial}: {ahead} ticks after {start}");
        }
        if deadline - u64::from(ahead / 8) > earliest.max(start) {
            queue.advance(0, frames(deadline - u64::from(ahead / 8) - 1));
            eighths += usize::from(all_due(&mut queue).is_empty());
        }
        queue.assert_well_formed();
        queue.advance(0, frames(deadline));
        let found = all_due(&mut queue);
        assert!(
            queue.is_empty() && queue.is_idle(0),
            "trial {trial}: {ahead} ticks after {start}: {found:?}"
        );
    }
    assert!(eighths > 1_500, "an eighth early at most was the rule, and not {eighths} times");
}

/// An advance to the tick that the clock is in lets come up what is due in it, and nothing else.
#[test]
fn what_is_due_now_comes_up_now() {
    let mut queue = EventQueue::new(2);
    queue.advance(0, 7.25);
    for (slot, ticks) in [(1, 0), (2, 1), (3, 1000)] {
        scheduled(&mut queue, 0, slot, ticks);
    }
    scheduled(&mut queue, 1, 4, 0);
    queue.advance(0, 7.25);
    assert_eq!(all_due(&mut queue), [1]);
    queue.advance(1, 0.0);
    assert_eq!(all_due(&mut queue), [4]);
    queue.advance(0, 7.25 + frames(1));
    assert_eq!(all_due(&mut queue), [2]);
    queue.advance(0, 7.25 + frames(1000));
    assert_eq!(all_due(&mut queue), [3]);
    // In frames, rounded down to a tick; what is further than the horizon comes up there.
    for (slot, frames) in [(1, 1.0), (2, 10.9 / TICKS_PER_FRAME), (3, 1e300), (4, f64::INFINITY), (5, 0.0)] {
        let event = queue.event(Slot(slot), Kind::Fold, BOUNDS);
        queue.schedule(1, frames, event);
    }
    assert_eq!(queue.len(), 5);
    queue.advance(1, 0.0);
    assert_eq!(all_due(&mut queue), [5]);
    queue.advance(1, frames(9));
    assert_eq!(all_due(&mut queue), [0; 0]);
    queue.advance(1, frames(10));
    assert_eq!(all_due(&mut queue), [2]);
    queue.advance(1, 1.0);
    assert_eq!(all_due(&mut queue), [1]);
    queue.advance(1, frames(u64::from(HORIZON) / 2));
    assert_eq!(all_due(&mut queue), [0; 0]);
    queue.advance(1, frames(u64::from(HORIZON)));
    assert_eq!(all_due(&mut queue), [3, 4]);
    assert!(queue.is_empty());
}

#[test]
fn a_pressing_event_comes_up_at_the_next_advance_of_any_clock() {
    let mut queue = EventQueue::new(2);
    let pressing = |queue: &EventQueue| {
        let mut slots = Vec::new();
        queue.pressing(|event| slots.push(event.slot.0));
        slots
    };
    for round in 0..3 {
        for slot in [1, 2] {
            let event = queue.event(Slot(slot), Kind::Fold, BOUNDS);
            queue.press(event);
        }
        assert_eq!((pressing(&queue), queue.len(), queue.is_ripe()), (vec![1, 2], 2, false));
        assert!(queue.is_idle(0) && queue.is_idle(1));
        match round {
            0 => queue.advance(1, 0.0),
            1 => queue.take_pressing(),
            _ => queue.take_all(),
        }
        assert_eq!((pressing(&queue), queue.is_ripe()), (vec![], true));
        queue.assert_well_formed();
        assert_eq!(all_due(&mut queue), [1, 2]);
        queue.take_pressing();
        assert!(!queue.is_ripe() && queue.is_empty());
    }
    let event = queue.event(Slot(1), Kind::Fold, BOUNDS);
    queue.press(event);
    queue.cancel(Slot(1));
    assert_eq!((pressing(&queue), queue.is_valid(&event)), (vec![], false));
    queue.take_pressing();
    assert_eq!(all_due(&mut queue), [0; 0]);
}

/// What waits for what: a model of the queue, where each slot has one event at most.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Waits {
    Pressing,
    /// On a clock, from a tick to a tick.
    Until(usize, u64, u64),
}

/// Thousands of events at a time, so that buckets are many chunks long.
#[test]
fn a_queue_is_a_list_of_deadlines() {
    let mut random = Pcg64Mcg::seed_from_u64(6);
    let mut queue = EventQueue::new(3);
    let mut model: BTreeMap<u32, Waits> = BTreeMap::new();
    let mut ticks = [0_u64; 3];
    for step in 0..3_000 {
        let clock = random.random_range(0..3_usize);
        // Many at a time with deadlines near each other, or all over the place.
        let (near, count) = (of_any_size(14, &mut random) as u32, random.random_range(0..60));
        for _ in 0..count {
            let slot = random.random_range(0..2_000);
            if random.random_range(0..3) == 0 {
                model.remove(&slot);
                queue.cancel(Slot(slot));
            } else if let Entry::Vacant(entry) = model.entry(slot) {
                let ahead = near + random.random_range(0..4);
                let waits = if random.random_range(0..30) == 0 {
                    let event = queue.event(Slot(slot), Kind::Fold, BOUNDS);
                    queue.press(event);
                    Waits::Pressing
                } else {
                    scheduled(&mut queue, clock, slot, ahead);
                    Waits::Until(clock, ticks[clock], ticks[clock] + u64::from(ahead))
                };
                entry.insert(waits);
            }
        }
        assert!(queue.len() >= model.len());
        if step % 20 == 0 {
            queue.assert_well_formed();
            let mut all = Vec::new();
            queue.for_each(|event| all.push(event.slot.0));
            all.sort_unstable();
            assert_eq!(all, model.keys().copied().collect::<Vec<_>>());
        }
        let now = ticks[clock] + of_any_size(13, &mut random);
        let mut foreseen = Vec::new();
        queue.due_within(clock, frames(now), |event| foreseen.push(event.slot.0));
        queue.pressing(|event| foreseen.push(event.slot.0));
        foreseen.sort_unstable();
        let is_lost = random.random_range(0..100) == 0;
        if is_lost {
            queue.take_clock(clock);
        } else {
            ticks[clock] = now;
            queue.advance(clock, frames(now));
        }
        let found = all_due(&mut queue);
        if !is_lost {
            assert_eq!(found, foreseen, "step {step}: what an advance would let come up");
        }
        let before = model.len();
        for slot in &found {
            match model.remove(slot) {
                Some(Waits::Pressing) if !is_lost => {}
                Some(Waits::Until(its, since, deadline)) if its == clock => {
                    assert!(
                        is_lost || deadline - (deadline - since) / 4 <= now,
                        "step {step}: slot {slot} is early"
                    );
                }
                waits => panic!("step {step}: slot {slot} came up, and is {waits:?}"),
            }
        }
        assert_eq!(model.len() + found.len(), before, "each once");
        let late = model.values().find(|waits| match waits {
            Waits::Pressing => !is_lost,
            Waits::Until(its, _, deadline) => *its == clock && (is_lost || *deadline <= now),
        });
        assert_eq!(late, None, "step {step}");
    }
    queue.assert_well_formed();
    queue.take_all();
    assert_eq!(all_due(&mut queue), model.into_keys().collect::<Vec<_>>());
    assert!(queue.is_empty() && (0..3).all(|clock| queue.is_idle(clock)));
    queue.assert_well_formed();
}

/// Events that are in line when one is cancelled: it is passed over, and not counted among those that come up.
#[test]
fn what_is_cancelled_while_it_is_ripe_does_not_come_up() {
    let mut queue = EventQueue::new(1);
    for slot in 1..=100 {
        scheduled(&mut queue, 0, slot, slot);
    }
    queue.advance(0, 1.0);
    (1..=100).filter(|slot| slot % 3 != 0).for_each(|slot| queue.cancel(Slot(slot)));
    queue.assert_well_formed();
    let (mut due, mut counts) = ([Event::BLANK; DUE], Vec::new());
    while let count @ 1.. = queue.next_due(&mut due) {
        assert!(due[..count].iter().all(|event| event.slot.0 % 3 == 0));
        counts.push(count);
    }
    // As many at a time as there can be.
    assert_eq!(counts, [16, 16, 1]);
    assert_eq!((queue.stored, queue.cancelled, queue.dropped), (0, 0, 67));
    queue.assert_well_formed();
}

/// Events of a thousand slots are scheduled and cancelled over and over: what is kept of them is about as much as is valid.
#[test]
fn cancelled_events_are_swept_out() {
    let mut queue = EventQueue::new(2);
    let mut most = 0;
    for round in 0..300_u32 {
        for slot in 0..1_000 {
            scheduled(&mut queue, (slot % 2) as usize, slot, 100 + (slot * 37 + round) % 4_000);
            if slot % 10 != 0 || round % 10 != 9 {
                queue.cancel(Slot(slot));
            }
        }
        if round % 10 == 0 {
            queue.assert_well_formed();
        }
        most = most.max(queue.len());
        (0..1_000).step_by(10).for_each(|slot| queue.cancel(Slot(slot)));
    }
    // Sweeping begins at 1024 of them, and goes round while as many are cancelled as there are buckets.
    assert!(most < 4_000, "{most} events kept, of which 100 are valid");
    assert!(queue.dropped > 250_000, "{} have been dropped", queue.dropped);
    let mut valid = 0;
    queue.for_each(|_| valid += 1);
    assert_eq!(valid, 0);
}

/// A sweep keeps what has not been cancelled, wherever it is.
#[test]
fn a_ticket_that_has_come_round_brings_nothing_back() {
    for retire in [false, true] {
        let mut queue = EventQueue::new(1);
        for slot in 1..50 {
            // With the first ticket of all, which is the first again.
            scheduled(&mut queue, 0, slot, 20 * slot);
        }
        let event = queue.event(Slot(50), Kind::Fold, BOUNDS);
        queue.press(event);
        for _ in 1..=u16::MAX {
            if retire { queue.retire(Slot(7)) } else { queue.cancel(Slot(7)) }
        }
        queue.assert_well_formed();
        assert_eq!((queue.len(), queue.cancelled, queue.dropped), (49, 0, 1));
        // In line it would come back as well.
        queue.advance(0, frames(500));
        for _ in 1..=u16::MAX {
            if retire { queue.retire(Slot(9)) } else { queue.cancel(Slot(9)) }
        }
        assert_eq!(queue.len(), 48);
        queue.take_all();
        let expected: Vec<u32> = (1..=50).filter(|&slot| slot != 7 && slot != 9).collect();
        assert_eq!(all_due(&mut queue), expected);
        // Of a slot that has never had an event there is nothing to cancel.
        queue.cancel(Slot(1_000));
        queue.retire(Slot(1_000));
        assert_eq!((queue.cancelled, queue.tickets.len()), (0, 51));
    }
}

/// To retire is to cancel what is not there: it does not count as something to sweep out.
#[test]
fn what_is_retired_is_not_scheduled() {
    let mut queue = EventQueue::new(1);
    let event = queue.event(Slot(1), Kind::Fold, BOUNDS);
    queue.retire(Slot(1));
    assert!(!queue.is_valid(&event) && queue.cancelled == 0);
    let event = queue.event(Slot(1), Kind::Fold, BOUNDS);
    assert!(queue.is_valid(&event));
    queue.cancel(Slot(1));
    assert!(!queue.is_valid(&event) && queue.cancelled == 1);
    // Neither looks for what is stored: that is dropped as it comes up.
    scheduled(&mut queue, 0, 1, 10);
    queue.retire(Slot(1));
    scheduled(&mut queue, 0, 1, 10);
    queue.cancel(Slot(1));
    assert_eq!((queue.len(), queue.dropped), (2, 0));
    queue.advance(0, 1.0);
    assert_eq!((all_due(&mut queue), queue.len(), queue.dropped), (vec![], 0, 2));
}

/// Each count of a queue is checked.
#[test]
fn a_queue_that_is_not_well_formed_is_found() {
    let check = |spoil: &dyn Fn(&mut EventQueue)| {
        let mut queue = EventQueue::new(2);
        (1..100).for_each(|slot| scheduled(&mut queue, 1, slot, 30 * slot));
        queue.advance(1, 2.0);
        all_due(&mut queue);
        queue.cancel(Slot(90));
        queue.assert_well_formed();
        spoil(&mut queue);
        catch_unwind(AssertUnwindSafe(|| queue.assert_well_formed())).is_err()
    };
    assert!(!check(&|_| {}));
    assert!(check(&|queue| queue.stored += 1), "a wrong count");
    assert!(check(&|queue| queue.cancelled = 0), "more cancelled ones than are counted");
    assert!(check(&|queue| queue.pool = Pool::new()), "chunks that are not there");
    assert!(check(&|queue| queue.pool.open(&mut 0)), "a chunk that is nowhere");
    let repeat = |queue: &mut EventQueue| {
        queue.pressing = queue.wheels[1].levels.as_flattened().iter().copied().max().unwrap();
    };
    assert!(check(&repeat), "a bucket that is in two places");
    let misplace = |queue: &mut EventQueue| {
        let event = queue.event(Slot(1), Kind::Fold, BOUNDS);
        queue.stored += 1;
        queue.pool.push(&mut queue.wheels[0].levels[3][5], event);
    };
    assert!(check(&misplace), "a bucket that no advance looks at");
}

/// A clock at the end of its time lets everything come up, and foresees that.
#[test]
fn at_the_end_of_time_all_is_due() {
    for end in [frames(LAST), 1e300] {
        let mut queue = EventQueue::new(1);
        queue.advance(0, frames(LAST - 1_024));
        scheduled(&mut queue, 0, 1, 5_000);
        scheduled(&mut queue, 0, 2, 200_000);
        let mut foreseen = Vec::new();
        queue.due_within(0, end, |event| foreseen.push(event.slot.0));
        foreseen.sort_unstable();
        assert_eq!(foreseen, [1, 2]);
        queue.advance(0, end);
        assert_eq!(all_due(&mut queue), [1, 2]);
        // From then on, also what is not due for long.
        for round in 0..3 {
            scheduled(&mut queue, 0, round, 1 << 20);
            queue.assert_well_formed();
            queue.advance(0, end);
            assert_eq!(all_due(&mut queue), [round]);
        }
    }
}

const LAST: u64 = 1 << 62;
