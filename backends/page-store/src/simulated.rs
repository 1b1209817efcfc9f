//! A store on virtual time: a line of a given latency and bandwidth.
//!
//! A replay in real time is only worth comparing if it can be repeated. Here the clock is told how much time has passed
//! (see [`Hierarchy::pass`](vertex_tree::Hierarchy::pass)), so that the same replay has the same misses on any machine,
//! and disks, network drives and object stores can all be tried on one.
//!
//! The model: up to `depth` reads are under way at a time. Each takes the latency, which passes for all of them at
//! once, and then the line for its bytes, which is for one at a time, in the order in which they were started.

use std::collections::VecDeque;
use std::time::Duration;

/// What a store on virtual time is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Simulated {
    /// From the start of a read to its first byte.
    pub latency: Duration,
    /// Bytes a second that the line carries, or `None` for as many as there are.
    pub bandwidth: Option<u64>,
    /// Reads that may be under way at a time, at least 1.
    pub depth: usize,
}

impl Simulated {
    /// A store of so much latency, without a limit on bandwidth, and 32 reads under way: what NVMe and SATA disks queue.
    #[must_use]
    pub fn with_latency(latency: Duration) -> Self {
        Self { latency, bandwidth: None, depth: 32 }
    }

    /// How long the line is taken by so many bytes.
    fn transfer(&self, bytes: u64) -> Duration {
        match self.bandwidth {
            None => Duration::ZERO,
            Some(bandwidth) => Duration::from_secs_f64(bytes as f64 / bandwidth.max(1) as f64),
        }
    }
}

/// What wants to read, and where that goes.
pub(crate) trait Reads {
    /// What stands for one read while it is under way.
    type Read;
    /// The read to start next, the most urgent one, and how many bytes it takes; `None` if there is nothing to read.
    fn start(&mut self) -> Option<(Self::Read, u64)>;
    /// A read has ended: its bytes may be fetched and handed on. This may lead to other reads.
    fn end(&mut self, read: Self::Read);
}

/// Reads under way on a simulated store.
#[derive(Debug)]
pub(crate) struct Line<R> {
    store: Simulated,
    now: Duration,
    /// When the line has carried all that was started.
    free: Duration,
    /// Each with the time at which it ends, which is in this order.
    under_way: VecDeque<(Duration, R)>,
}

impl<R> Line<R> {
    /// A line that nothing is under way on.
    pub fn new(store: Simulated) -> Self {
        Self { store, now: Duration::ZERO, free: Duration::ZERO, under_way: VecDeque::new() }
    }

    /// Lets time pass: starts what can be started, ends what has come.
    pub fn pass(&mut self, time: Duration, reads: &mut impl Reads<Read = R>) {
        let until = self.now + time;
        self.run(until, reads);
        self.now = until;
    }

    /// Lets time pass until nothing is under way or wanted. Returns how long that took.
    pub fn settle(&mut self, reads: &mut impl Reads<Read = R>) -> Duration {
        let before = self.now;
        self.run(Duration::MAX, reads);
        self.now - before
    }

    fn run(&mut self, until: Duration, reads: &mut impl Reads<Read = R>) {
        loop {
            while self.under_way.len() < self.store.depth.max(1) {
                let Some((read, bytes)) = reads.start() else { break };
                let first = (self.now + self.store.latency).max(self.free);
                self.free = first + self.store.transfer(bytes);
                self.under_way.push_back((self.free, read));
            }
            if self.under_way.front().is_none_or(|(end, _)| *end > until) {
                return;
            }
            let Some((end, read)) = self.under_way.pop_front() else { return };
            self.now = self.now.max(end);
            reads.end(read);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Reads of 1000 bytes each, by number; the first leads to number 100.
    #[derive(Default)]
    struct Pages {
        wanted: VecDeque<u32>,
        ended: Vec<u32>,
    }

    impl Reads for Pages {
        type Read = u32;
        fn start(&mut self) -> Option<(u32, u64)> {
            Some((self.wanted.pop_front()?, 1000))
        }
        fn end(&mut self, read: u32) {
            if read == 0 {
                self.wanted.push_back(100);
            }
            self.ended.push(read);
        }
    }

    fn line(bandwidth: Option<u64>, depth: usize) -> (Line<u32>, Pages) {
        let pages = Pages { wanted: (0..5).collect(), ended: Vec::new() };
        (Line::new(Simulated { latency: 5 * MS, bandwidth, depth }), pages)
    }

    #[test]
    fn latency_passes_for_all_at_once() {
        let (mut line, mut pages) = line(None, 32);
        line.pass(4 * MS, &mut pages);
        assert!(pages.ended.is_empty());
        line.pass(MS, &mut pages);
        assert_eq!(pages.ended, [0, 1, 2, 3, 4]);
        // What the first led to was started when that came, so comes as much later.
        line.pass(4 * MS, &mut pages);
        assert_eq!(pages.ended.len(), 5);
        line.pass(MS, &mut pages);
        assert_eq!(pages.ended[5..], [100]);
        assert_eq!(line.under_way.len(), 0);
    }

    #[test]
    fn the_line_is_for_one_at_a_time() {
        // A millisecond for each: the first comes after 6, the others one by one.
        let (mut line, mut pages) = line(Some(1_000_000), 32);
        line.pass(6 * MS, &mut pages);
        assert_eq!(pages.ended, [0]);
        line.pass(2 * MS, &mut pages);
        assert_eq!(pages.ended, [0, 1, 2]);
        assert_eq!(line.settle(&mut pages), 4 * MS);
        assert_eq!(pages.ended, [0, 1, 2, 3, 4, 100]);
    }

    #[test]
    fn depth_bounds_what_is_under_way() {
        let (mut line, mut pages) = line(None, 2);
        line.pass(5 * MS, &mut pages);
        assert_eq!((pages.ended.len(), line.under_way.len()), (2, 2));
        assert_eq!(line.settle(&mut pages), 10 * MS);
        assert_eq!(pages.ended, [0, 1, 2, 3, 4, 100]);
    }
}
