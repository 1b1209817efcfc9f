//! Where all buckets keep their events.

use vertex_tree::prefetch;

use super::event::{DUE, Event};

/// Events in a chunk.
pub(super) const CHUNK: u32 = 16;

/// A list of chunks of events, of which all but the newest are full: the place after its last event, counted through
/// all chunks of the pool; 0 while it is empty.
///
/// To append is one store where the event goes and one here, in an array that is small enough to stay near. A count in
/// the chunk itself would be a read that misses the cache, for every event.
pub(super) type Bucket = u32;

/// Where all buckets keep their events. Chunks are used again last in, first out: what is written next was read just
/// before and is in the nearest cache, and once there are enough of them nothing is allocated any more.
#[derive(Debug)]
pub(super) struct Pool {
    /// The first one is not used, as place 0 says that a bucket is empty.
    chunks: Vec<[Event; CHUNK as usize]>,
    /// For each chunk, the one before it in its bucket, or 0.
    previous: Vec<u32>,
    free: Vec<u32>,
}

impl Pool {
    pub fn new() -> Self {
        Self { chunks: vec![[Event::BLANK; CHUNK as usize]], previous: vec![0], free: Vec::new() }
    }

    #[inline(always)]
    pub fn push(&mut self, bucket: &mut Bucket, event: Event) {
        if bucket.is_multiple_of(CHUNK) {
            self.open(bucket);
        }
        let (chunk, place) = ((*bucket / CHUNK) as usize, (*bucket % CHUNK) as usize);
        self.chunks[chunk][place] = event;
        *bucket += 1;
        // Where the bucket's next event but one goes: stores leave the processor in order, and one that misses the
        // nearest cache holds up all others.
        prefetch(self.chunks.as_flattened(), *bucket as usize + 1);
    }

    /// Adds an empty chunk to a bucket.
    #[inline(never)]
    pub fn open(&mut self, bucket: &mut Bucket) {
        let previous = bucket.saturating_sub(1) / CHUNK;
        let chunk = self.free.pop().unwrap_or_else(|| {
            self.chunks.push([Event::BLANK; CHUNK as usize]);
            self.previous.push(0);
            self.chunks.len() as u32 - 1
        });
        if let Some(&next) = self.free.last() {
            prefetch(&self.chunks, next as usize);
        }
        self.previous[chunk as usize] = previous;
        *bucket = chunk * CHUNK;
    }

    /// Takes events off the end of a bucket that is not empty, no more than there is room for in `due` after the first
    /// `count`, and none but those that `keep` says to keep. Returns how many there are in `due` then, and how many
    /// were taken off.
    #[inline(always)]
    pub fn take(
        &mut self,
        bucket: &mut Bucket,
        due: &mut [Event; DUE],
        mut count: usize,
        keep: impl Fn(&Event) -> bool,
    ) -> (usize, usize) {
        let chunk = (*bucket - 1) / CHUNK;
        let start = chunk * CHUNK;
        let used = (*bucket - start) as usize;
        let taken = used.min(DUE - count);
        for event in &self.chunks[chunk as usize][used - taken..used] {
            due[count % DUE] = *event;
            count += usize::from(keep(event));
        }
        *bucket -= taken as u32;
        if *bucket == start {
            self.free.push(chunk);
            let previous = self.previous[chunk as usize];
            *bucket = if previous == 0 { 0 } else { (previous + 1) * CHUNK };
            if previous != 0 {
                self.prefetch_chunk(previous);
            }
        }
        (count, taken)
    }

    #[inline(always)]
    pub fn prefetch_chunk(&self, chunk: u32) {
        for event in (0..CHUNK).step_by(2) {
            prefetch(self.chunks.as_flattened(), (chunk * CHUNK + event) as usize);
        }
    }

    /// Checks that so many chunks are in buckets and all others free, each once.
    ///
    /// # Panics
    /// If not.
    #[track_caller]
    pub fn assert_used(&self, used: usize) {
        let mut free = self.free.clone();
        free.sort_unstable();
        assert!(free.windows(2).all(|two| two[0] < two[1]), "a chunk is free twice");
        assert_eq!(
            1 + used + free.len(),
            self.chunks.len(),
            "chunks in buckets, and {} free ones",
            free.len()
        );
    }

    /// Calls `f` with every event in a bucket, the newest chunk first.
    pub fn read(&self, mut bucket: Bucket, mut f: impl FnMut(&Event)) {
        while bucket != 0 {
            let chunk = (bucket - 1) / CHUNK;
            let used = (bucket - chunk * CHUNK) as usize;
            self.chunks[chunk as usize][..used].iter().for_each(&mut f);
            let previous = self.previous[chunk as usize];
            bucket = if previous == 0 { 0 } else { (previous + 1) * CHUNK };
        }
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;
    use crate::in_play::{Kind, Slot};

    fn event(number: u32) -> Event {
        Event::new(Event::BLANK.bounds, Slot(number), 0, Kind::Fold)
    }

    fn numbers(pool: &Pool, bucket: Bucket) -> Vec<u32> {
        let mut numbers = Vec::new();
        pool.read(bucket, |event| numbers.push(event.slot.0));
        numbers
    }

    /// A bucket is a stack of chunks, read from the newest one.
    #[test]
    fn what_is_pushed_is_read_and_taken() {
        let (mut pool, mut buckets) = (Pool::new(), [0; 3]);
        // Three buckets that grow in turn, so that their chunks are mixed.
        for number in 0..120 {
            pool.push(&mut buckets[number as usize % 3], event(number));
        }
        pool.assert_used(9);
        for (at, bucket) in (0..).zip(buckets) {
            let own = |range: std::ops::Range<u32>| range.map(move |place| 3 * place + at);
            let newest_first: Vec<u32> = own(32..40).chain(own(16..32)).chain(own(0..16)).collect();
            assert_eq!(numbers(&pool, bucket), newest_first);
        }
        let mut due = [Event::BLANK; DUE];
        let slots = |due: &[Event]| due.iter().map(|event| event.slot.0).collect::<Vec<_>>();
        let bucket = &mut buckets[1];
        // No more than there is room for behind those that there are.
        due[..12].fill(event(1_000));
        assert_eq!(pool.take(bucket, &mut due, 12, |_| true), (16, 4));
        assert_eq!(slots(&due), [[1_000; 12].as_slice(), &[109, 112, 115, 118]].concat());
        // To the border of a chunk, and only those to keep.
        assert_eq!(pool.take(bucket, &mut due, 0, |event| event.slot.0 % 2 == 0), (2, 4));
        assert_eq!(slots(&due[..2]), [100, 106]);
        pool.assert_used(8);
        assert_eq!(pool.take(bucket, &mut due, 0, |_| true), (16, 16));
        assert_eq!(slots(&due), (16..32).map(|place| 3 * place + 1).collect::<Vec<_>>());
        assert_eq!(pool.take(bucket, &mut due, 0, |_| false), (0, 16));
        assert_eq!(*bucket, 0);
        pool.assert_used(6);
        // The others are as they were, and what has become free is used again.
        assert_eq!(numbers(&pool, buckets[2]).len(), 40);
        (0..48).for_each(|number| pool.push(&mut buckets[1], event(number)));
        assert_eq!((pool.chunks.len(), pool.free.len()), (10, 0));
        pool.assert_used(9);
    }

    /// Each check of a pool finds what it is for.
    #[test]
    fn a_pool_that_is_not_well_formed_is_found() {
        let check = |used: usize, free: &[u32]| {
            let (mut pool, mut bucket) = (Pool::new(), 0);
            (0..80).for_each(|number| pool.push(&mut bucket, event(number)));
            pool.free.extend_from_slice(free);
            catch_unwind(AssertUnwindSafe(|| pool.assert_used(used))).is_err()
        };
        assert!(!check(5, &[]) && !check(2, &[2, 5, 4]));
        assert!(check(4, &[]) && check(6, &[]), "a wrong count");
        assert!(check(3, &[4, 4]), "a chunk that is free twice");
    }
}
