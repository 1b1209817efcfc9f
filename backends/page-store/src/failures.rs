//! Reads that have failed, and when each may be tried again.

use std::hash::Hash;

use rustc_hash::FxHashMap;

#[derive(Clone, Copy, Debug, Default)]
struct Failure {
    /// In a row.
    times: u32,
    /// Not to be asked for before this frame.
    until: u64,
}

/// What is known of pages that could not be read, or were damaged. Such a page is left alone for 1, 2, 4 and so on frames, up to
/// a limit: a store that is away for a while is not asked in every frame, and one that is back is soon found to be.
#[derive(Debug)]
pub struct Failures<K> {
    of: FxHashMap<K, Failure>,
    longest_rest: u64,
}

impl<K: Copy + Eq + Hash> Failures<K> {
    /// None has failed yet. A page is left alone for at most so many frames; with 0, it is not.
    #[must_use]
    pub fn new(longest_rest: u64) -> Self {
        Self { of: FxHashMap::default(), longest_rest }
    }

    /// A page has failed, in a frame. Returns how many times in a row it has.
    pub fn failed(&mut self, page: K, frame: u64) -> u32 {
        let failure = self.of.entry(page).or_default();
        failure.until = frame + (1 << failure.times.min(63)).min(self.longest_rest);
        failure.times = failure.times.saturating_add(1);
        failure.times
    }

    /// A page has failed that nobody has missed: it is known to, and that is all.
    pub fn suspect(&mut self, page: K) {
        self.of.entry(page).or_default();
    }

    /// A page has come as it should, or nothing shall be held against it any more.
    pub fn forget(&mut self, page: K) {
        self.of.remove(&page);
    }

    /// Whether a page has failed the last time that it was asked for.
    #[must_use]
    pub fn holds(&self, page: K) -> bool {
        !self.of.is_empty() && self.of.contains_key(&page)
    }

    /// Whether a page has failed so recently that it is left alone in a frame.
    #[must_use]
    pub fn rests(&self, page: K, frame: u64) -> bool {
        !self.of.is_empty() && self.of.get(&page).is_some_and(|failure| failure.until > frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fails_is_left_alone_for_longer_each_time() {
        let mut failures = Failures::new(5);
        let mut frame = 10;
        let mut rests = Vec::new();
        for times in 1..=6 {
            assert!(!failures.rests(7, frame));
            assert_eq!(failures.failed(7, frame), times);
            let since = frame;
            while failures.rests(7, frame) {
                frame += 1;
            }
            rests.push(frame - since);
        }
        assert_eq!(rests, [1, 2, 4, 5, 5, 5]);
        assert!(failures.holds(7) && !failures.holds(8) && !failures.rests(8, 0));
        failures.suspect(8);
        assert!(failures.holds(8) && !failures.rests(8, 0));
        failures.forget(7);
        assert_eq!(failures.failed(7, frame), 1, "it begins anew");
        // However often.
        (0..200).for_each(|_| _ = failures.failed(7, frame));
        assert!(failures.rests(7, frame + 4) && !failures.rests(7, frame + 5));
    }

    #[test]
    fn without_a_rest_it_is_counted_only() {
        let mut failures = Failures::new(0);
        assert_eq!([failures.failed(1, 3), failures.failed(1, 3)], [1, 2]);
        assert!(!failures.rests(1, 3));
    }
}
