//! Whether a scan of everything would cost less than queue and scan together.
//!
//! Where most nodes are near, the events of the others and the looks that tell them apart can cost more than they spare. So
//! both are added up, in tests of a scan, and for a while the cheaper is done.

/// What an event, a first look, another look and a clock cost, in tests of a scan (`cargo bench --bench plane`).
const EVENT: f64 = 24.0;
const FIRST: f64 = 20.0;
const AGAIN: f64 = 4.0;
const CLOCK: f64 = 40.0;

/// Frames at the very beginning that do not count: the first motion sorts all nodes, which does not come again.
const SETTLING: u32 = 8;
/// Frames that are added up.
const WINDOW: u32 = 64;
/// Frames for which everything is scanned when that is found to be cheaper, and at most where it is found again and again.
const LEAST: u32 = 384;
const MOST: u32 = 4096;
/// A camera that is so many times slower than it was then is a reason to end it.
const SLOWER: f64 = 4.0;

/// What has been looked at in a frame, beside what is scanned.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Looks {
    /// Events that have come up.
    pub due: u64,
    /// Nodes that have come to be watched, and were tested.
    pub first: u64,
    /// Nodes that were scanned and looked at again.
    pub again: u64,
    /// Clocks that events wait on.
    pub clocks: u64,
}

impl Looks {
    fn cost(self) -> f64 {
        EVENT * self.due as f64
            + FIRST * self.first as f64
            + AGAIN * self.again as f64
            + CLOCK * self.clocks as f64
    }
}

#[derive(Debug)]
pub(super) struct Balance {
    /// What the frames that have been added up have cost, and a scan of everything would have.
    cost: f64,
    all: f64,
    frames: u32,
    /// Frames that have passed before they count.
    begins: u32,
    /// Frames for which everything is scanned yet, and for how many when it is next.
    left: u32,
    next: u32,
    /// The pace at which it began.
    pace: f64,
}

impl Balance {
    pub fn new() -> Self {
        Self { cost: 0.0, all: 0.0, frames: 0, begins: 0, left: 0, next: LEAST, pace: 1.0 }
    }

    /// A frame has passed at a pace. `scans` is what the scan of the nodes that are near has cost, and what one of all would have.
    /// Whether it is the last before those in which everything is scanned.
    pub fn add(&mut self, looks: Looks, scans: [f64; 2], pace: f64) -> bool {
        if self.left > 0 {
            self.left -= 1;
            return false;
        }
        if self.begins < SETTLING {
            self.begins += 1;
            return false;
        }
        self.cost += scans[0] + looks.cost();
        self.all += scans[1];
        self.frames += 1;
        if self.frames < WINDOW {
            return false;
        }
        let is_dear = self.cost > self.all;
        if is_dear {
            (self.left, self.pace) = (self.next, pace);
            self.next = (2 * self.next).min(MOST);
        } else if self.cost < self.all / 2.0 {
            self.next = LEAST;
        }
        (self.cost, self.all, self.frames) = (0.0, 0.0, 0);
        is_dear
    }

    /// Whether everything is to be scanned.
    #[inline(always)]
    pub fn scans_everything(&self) -> bool {
        self.left > 0
    }

    /// The pace is another.
    pub fn slow_down(&mut self, pace: f64) {
        if pace < self.pace / SLOWER {
            self.left = 0;
        }
    }

    /// The pace is measured in a new unit, so many times the old one.
    pub fn change_unit(&mut self, times: f64) {
        self.slow_down(self.pace * times);
        self.pace = 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FEW: Looks = Looks { due: 10, first: 10, again: 0, clocks: 1 };
    const MANY: Looks = Looks { due: 20, first: 20, again: 20, clocks: 1 };

    /// Frames until everything is scanned, and for how many it is then.
    fn run(balance: &mut Balance, looks: Looks) -> [u32; 2] {
        let before = (1..10_000).find(|_| balance.add(looks, [300.0, 1_000.0], 1.0)).unwrap_or(0);
        let after =
            (1..10_000).find(|_| !balance.scans_everything() || balance.add(looks, [300.0, 1_000.0], 1.0));
        [before, after.map_or(0, |frames| frames - 1)]
    }

    #[test]
    fn what_is_dear_is_given_up_for_longer_and_longer() {
        let mut balance = Balance::new();
        // 10 events and 10 first looks cost 480 tests with the clock, and 300 nodes are scanned, of 1000.
        assert_eq!(run(&mut balance, FEW), [0, 0]);
        assert!(!balance.scans_everything());
        let mut balance = Balance::new();
        (0..SETTLING).for_each(|_| assert!(!balance.add(MANY, [300.0, 1_000.0], 1.0)));
        for frames in [LEAST, 2 * LEAST, 4 * LEAST, 8 * LEAST, MOST, MOST] {
            assert_eq!(run(&mut balance, MANY), [WINDOW, frames]);
        }
        // Once it was cheap, it begins with few frames again.
        (0..WINDOW).for_each(|_| _ = balance.add(Looks::default(), [300.0, 1_000.0], 1.0));
        assert_eq!(run(&mut balance, MANY), [WINDOW, LEAST]);
    }

    #[test]
    fn a_camera_that_is_slower_ends_it() {
        let dear = || {
            let mut balance = Balance::new();
            while !balance.add(MANY, [300.0, 1_000.0], 2.0) {}
            balance
        };
        for (pace, ends) in [(2.0, false), (0.6, false), (0.4, true)] {
            let mut balance = dear();
            balance.slow_down(pace);
            assert_eq!(balance.scans_everything(), !ends, "pace {pace}");
        }
        for (times, ends) in [(2.0, false), (0.3, false), (0.2, true)] {
            let mut balance = dear();
            balance.change_unit(times);
            assert_eq!(balance.scans_everything(), !ends, "a unit of {times}");
        }
    }
}
