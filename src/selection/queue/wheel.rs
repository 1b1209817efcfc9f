//! Buckets by deadline, on one clock.

use super::event::{Event, HORIZON, TICKS_PER_FRAME};
use super::pool::{Bucket, Pool};

/// Slots a level. Deadlines go to the level on which they are at least half of this away.
pub(super) const SLOTS: u64 = 16;
/// Level 28 reaches 2^32 ticks ahead, which is further than any deadline: those are `u32` ticks ahead, and what is
/// further is scheduled again.
pub(super) const LEVELS: usize = 29;
/// A clock goes no further than this tick: beyond it, deadlines would leave 64 bits. Years of frames at a billion times the
/// declared speed get there. From then on all events come up at every advance, which is right and slow.
const LAST_TICK: u64 = 1 << 62;

/// Buckets of events on one clock.
#[derive(Debug)]
pub(super) struct Wheel {
    /// `levels[l][s]` has the events whose deadline tick, divided by `2^l`, is `s` modulo 16.
    pub levels: [[Bucket; SLOTS as usize]; LEVELS],
    /// For each level, a bit for each slot that may hold events.
    occupied: [u16; LEVELS],
    /// A bit for each level that has such slots.
    in_use: u32,
    /// No such slot starts before this tick, so that a clock that does not get there costs a comparison.
    next: u64,
    /// The tick that the clock is in.
    tick: u64,
}

impl Wheel {
    pub fn new() -> Self {
        let levels = [[0; SLOTS as usize]; LEVELS];
        Self { levels, occupied: [0; LEVELS], in_use: 0, next: u64::MAX, tick: 0 }
    }

    /// Whether it holds no events.
    pub fn is_empty(&self) -> bool {
        self.in_use == 0
    }

    /// Puts an event where it comes up before the clock is more than `ahead` ticks further.
    #[inline(always)]
    pub fn push(&mut self, pool: &mut Pool, ahead: u32, event: Event) {
        let ahead = ahead.min(HORIZON);
        let deadline = self.tick + u64::from(ahead);
        // On level l, `ahead` spans (ahead >> l) slots, and one more where it straddles their borders: at most 15.
        let level = (32 - ahead.leading_zeros()).saturating_sub(4);
        let straddles = (deadline >> level) - (self.tick >> level) >= SLOTS;
        let level = level + u32::from(straddles);
        let number = deadline >> level;
        self.next = self.next.min((number << level).min(LAST_TICK));
        self.in_use |= 1 << level;
        let slot = number as u32 % SLOTS as u32;
        // Never more than there are, which spares a panic.
        let level = level as usize % LEVELS;
        self.occupied[level] |= 1 << slot;
        pool.push(&mut self.levels[level][slot as usize], event);
    }

    /// Moves each bucket that the clock reaches on its way to `now` to `ripe`.
    pub fn advance(&mut self, now: f64, ripe: &mut Vec<Bucket>) {
        let before = self.tick;
        let after = tick(now);
        debug_assert!(after >= before, "the clock went back from tick {before} to {after}");
        self.tick = after;
        if after < self.next {
            return;
        }
        if after == LAST_TICK {
            self.take_all(ripe);
            return;
        }
        self.next = u64::MAX;
        for level in bits(self.in_use) {
            let (first, last) = (before >> level, after >> level);
            // The slot of the present tick is drained every time, that of a wider level once, when it is reached.
            let first = if level == 0 { first } else { first + 1 };
            if first <= last {
                // The slots from `first` to `last`, round the ring.
                let count = (last - first + 1).min(SLOTS);
                let reached = (((1_u32 << count) - 1) as u16).rotate_left((first % SLOTS) as u32);
                self.take(level, reached, ripe);
            }
            if self.occupied[level] != 0 {
                // What is left lies after the present slot, once round at most.
                let ahead = self.occupied[level].rotate_right(((last + 1) % SLOTS) as u32).trailing_zeros();
                self.next = self.next.min(((last + 1 + u64::from(ahead)) << level).min(LAST_TICK));
            }
        }
    }

    pub fn take_all(&mut self, ripe: &mut Vec<Bucket>) {
        for level in bits(self.in_use) {
            self.take(level, u16::MAX, ripe);
        }
        self.next = u64::MAX;
    }

    /// The buckets that an advance to `now` would reach.
    pub fn due_within(&self, now: f64) -> impl Iterator<Item = Bucket> + '_ {
        let last = tick(now);
        let levels = bits(if last < self.next { 0 } else { self.in_use });
        levels.flat_map(move |level| {
            // The present slot of a wider level has been drained.
            let first = (self.tick >> level) + u64::from(level > 0);
            let round = first + SLOTS - 1;
            let last = if last == LAST_TICK { round } else { (last >> level).min(round) };
            let slots = &self.levels[level];
            (first..=last).map(move |slot| slots[(slot % SLOTS) as usize])
        })
    }

    /// Moves the buckets in some slots of a level, one bit each.
    fn take(&mut self, level: usize, slots: u16, ripe: &mut Vec<Bucket>) {
        let mut slots = slots & self.occupied[level];
        self.occupied[level] &= !slots;
        if self.occupied[level] == 0 {
            self.in_use &= !(1 << level);
        }
        while slots != 0 {
            let bucket = std::mem::take(&mut self.levels[level][slots.trailing_zeros() as usize]);
            // Nothing may be left in it but its bit.
            if bucket != 0 {
                ripe.push(bucket);
            }
            slots &= slots - 1;
        }
    }

    /// Checks that a bucket that is not empty is marked, and that its turn has not been passed over.
    ///
    /// # Panics
    /// If not.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        for (level, slots) in self.levels.iter().enumerate() {
            let occupied = self.occupied[level];
            assert_eq!(occupied != 0, self.in_use >> level & 1 == 1, "whether level {level} is in use");
            for (slot, _) in slots.iter().enumerate().filter(|&(_, &bucket)| bucket != 0) {
                assert!(occupied >> slot & 1 == 1, "slot {slot} of level {level} is not marked");
                // The present slot of a wider level has been drained.
                let first = (self.tick >> level) + u64::from(level > 0);
                let number = first + (slot as u64).wrapping_sub(first) % SLOTS;
                assert!(self.next <= number << level, "slot {slot} of level {level} is passed over");
            }
        }
    }
}

/// The tick in which a time lies, in frames.
fn tick(now: f64) -> u64 {
    ((now * TICKS_PER_FRAME) as u64).min(LAST_TICK)
}

/// The bits that are set, the lowest first.
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (bit < u32::BITS).then_some(bit as usize)
    })
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    fn ticks(count: u64) -> f64 {
        count as f64 / TICKS_PER_FRAME
    }

    /// A wheel at tick 1000 with an event in each of some slots.
    fn wheel() -> (Wheel, Pool) {
        let (mut wheel, mut pool) = (Wheel::new(), Pool::new());
        wheel.advance(ticks(1_000), &mut Vec::new());
        [0, 3, 9, 100, 101, 5_000, 5_700]
            .iter()
            .for_each(|&ahead| wheel.push(&mut pool, ahead, Event::BLANK));
        wheel.assert_well_formed();
        (wheel, pool)
    }

    /// A clock that does not get as far as the next event costs a comparison, so it has to know how far that is.
    #[test]
    fn a_wheel_knows_when_it_has_to_look() {
        let (mut wheel, _) = wheel();
        let mut ripe = Vec::new();
        let mut advance = |wheel: &mut Wheel, tick: u64| {
            wheel.advance(ticks(tick), &mut ripe);
            wheel.assert_well_formed();
            std::mem::take(&mut ripe).len()
        };
        // Up to 15 ticks ahead a slot is a tick wide; 100 and 101 ticks ahead it is 8, and both lie in that of 1096.
        // 5000 and 5700 ticks ahead it is 512: those of 5632 and of 6656.
        assert_eq!(wheel.next, 1_000);
        assert_eq!((advance(&mut wheel, 1_000), wheel.next), (1, 1_003));
        assert_eq!((advance(&mut wheel, 1_002), wheel.next), (0, 1_003));
        assert_eq!((advance(&mut wheel, 1_020), wheel.next), (2, 1_096));
        assert_eq!((advance(&mut wheel, 1_095), wheel.next), (0, 1_096));
        assert_eq!((advance(&mut wheel, 1_096), wheel.next), (1, 5_632));
        assert_eq!((advance(&mut wheel, 5_633), wheel.next), (1, 6_656));
        assert!(!wheel.is_empty());
        assert_eq!((advance(&mut wheel, 1 << 40), wheel.next, wheel.is_empty()), (1, u64::MAX, true));
    }

    #[test]
    fn what_a_wheel_would_let_come_up_it_does() {
        for last in [1_000, 1_003, 1_008, 1_009, 1_095, 1_096, 1_200, 5_631, 5_632, 6_656, 1 << 30, LAST_TICK]
        {
            let (mut wheel, _) = wheel();
            let mut due: Vec<Bucket> = wheel.due_within(ticks(last)).filter(|&bucket| bucket != 0).collect();
            let mut ripe = Vec::new();
            wheel.advance(ticks(last), &mut ripe);
            due.sort_unstable();
            ripe.sort_unstable();
            assert_eq!(due, ripe, "at tick {last}");
            assert!(!ripe.is_empty());
        }
    }

    /// Each check of a wheel's state finds what it is for.
    #[test]
    fn a_wheel_that_is_not_well_formed_is_found() {
        let check = |spoil: &dyn Fn(&mut Wheel)| {
            let (mut wheel, _) = wheel();
            spoil(&mut wheel);
            catch_unwind(AssertUnwindSafe(|| wheel.assert_well_formed())).is_err()
        };
        assert!(!check(&|_| {}));
        for level in [0, 3, 9] {
            assert!(check(&|wheel| wheel.in_use &= !(1 << level)), "level {level} is not marked");
            assert!(
                check(&|wheel| wheel.occupied[level] &= wheel.occupied[level] - 1),
                "a slot of level {level} is not"
            );
        }
        assert!(check(&|wheel| wheel.in_use |= 1 << 20), "a level that has nothing");
        assert!(check(&|wheel| wheel.next = 1_001), "a slot of the narrowest level is passed over");
        let passed_over = |tick: u64, next: u64| {
            check(&|wheel| {
                wheel.advance(ticks(tick), &mut Vec::new());
                wheel.next = next;
            })
        };
        // The present slot of a wider level has been drained: what is in it comes a round later, and may.
        let fill_present = |wheel: &mut Wheel| {
            wheel.levels[3][(1_000 >> 3) % 16] = 1;
            wheel.occupied[3] |= 1 << ((1_000 >> 3) % 16);
            wheel.next = 1_000 + 64;
            (0..16).for_each(|slot| wheel.levels[0][slot] = 0);
        };
        assert!(!check(&fill_present), "a round later");
        assert!(passed_over(1_020, 1_097) && !passed_over(1_020, 1_096));
        assert!(passed_over(1_100, 5_633) && !passed_over(1_100, 5_632));
    }
}
