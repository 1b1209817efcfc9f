//! Whether a queue is what it should be.

use super::EventQueue;
use super::event::Event;
use super::pool::{Bucket, CHUNK};
use super::wheel::Wheel;

impl EventQueue {
    /// Calls `f` with every event that has not been cancelled.
    pub(crate) fn for_each(&self, mut f: impl FnMut(&Event)) {
        self.buckets().for_each(|bucket| self.read(bucket, &mut f));
    }

    fn buckets(&self) -> impl Iterator<Item = Bucket> + '_ {
        let waiting = self.wheels.iter().flat_map(|wheel| wheel.levels.as_flattened());
        waiting.chain(&self.ripe).chain([&self.pressing]).copied()
    }

    /// Checks that every chunk is in one bucket or free, that no bucket can be overlooked by an advance, and the counts.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub(crate) fn assert_well_formed(&self) {
        let (mut stored, mut valid, mut chunks) = (0, 0, 0);
        for bucket in self.buckets() {
            let mut count = 0_usize;
            // What is pressing comes up with the next advance, cancelled or not, and is not swept.
            let is_pressing = bucket != 0 && bucket == self.pressing;
            self.pool.read(bucket, |event| {
                count += 1;
                valid += usize::from(is_pressing || self.is_valid(event));
            });
            stored += count;
            chunks += count.div_ceil(CHUNK as usize);
        }
        assert_eq!(stored, self.stored, "events in all buckets");
        assert!(self.stored - valid <= self.cancelled, "more events are cancelled than {}", self.cancelled);
        self.pool.assert_used(chunks);
        self.wheels.iter().for_each(Wheel::assert_well_formed);
    }
}
