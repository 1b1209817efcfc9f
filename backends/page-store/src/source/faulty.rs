use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use super::page_source::PageSource;

/// How often a [`Faulty`] source does what, in reads out of 1000, each by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// Reads that fail.
    pub errors: u32,
    /// Reads that end before the buffer is full.
    pub short: u32,
    /// Reads that bring one flipped bit.
    pub flips: u32,
    /// Reads that take [`delay`](Self::delay) longer.
    pub delays: u32,
    /// See [`delays`](Self::delays).
    pub delay: Duration,
}

/// Another source with faults, for tests: which reads they befall follows from the seed and the number of the read.
#[derive(Debug)]
pub struct Faulty<S> {
    source: S,
    seed: u64,
    faults: [AtomicU64; 5],
    reads: AtomicU64,
    befallen: AtomicU64,
}

impl<S> Faulty<S> {
    /// Faults from the start.
    pub fn new(source: S, seed: u64, faults: Faults) -> Self {
        let faulty = Self {
            source,
            seed,
            faults: Default::default(),
            reads: AtomicU64::new(0),
            befallen: AtomicU64::new(0),
        };
        faulty.set(faults);
        faulty
    }

    /// Other faults from now on; none with [`Faults::default`].
    pub fn set(&self, faults: Faults) {
        let Faults { errors, short, flips, delays, delay } = faults;
        let values = [
            errors.into(),
            short.into(),
            flips.into(),
            delays.into(),
            delay.as_nanos().min(u64::MAX.into()) as u64,
        ];
        for (fault, value) in self.faults.iter().zip(values) {
            fault.store(value, Ordering::SeqCst);
        }
    }

    /// Reads that failed, ended early or brought a flipped bit.
    pub fn befallen(&self) -> u64 {
        self.befallen.load(Ordering::SeqCst)
    }
}

/// 64 well-spread bits (the finaliser of splitmix64, Steele et al. 2014).
fn mix(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl<S: PageSource> PageSource for Faulty<S> {
    fn name(&self) -> &str {
        self.source.name()
    }

    fn len(&self) -> u64 {
        self.source.len()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        let read = self.reads.fetch_add(1, Ordering::SeqCst);
        let dice = |which: u64| mix(self.seed ^ mix(read * 8 + which));
        let befalls = |which: usize| dice(which as u64) % 1000 < self.faults[which].load(Ordering::SeqCst);
        if befalls(3) {
            std::thread::sleep(Duration::from_nanos(self.faults[4].load(Ordering::SeqCst)));
        }
        if befalls(0) {
            self.befallen.fetch_add(1, Ordering::SeqCst);
            return Err(io::Error::other("the store failed"));
        }
        self.source.read_at(offset, buffer)?;
        if befalls(1) {
            self.befallen.fetch_add(1, Ordering::SeqCst);
            let kept = (dice(5) % (buffer.len() as u64).max(1)) as usize;
            buffer[kept..].fill(0);
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        if befalls(2) && !buffer.is_empty() {
            self.befallen.fetch_add(1, Ordering::SeqCst);
            let bit = dice(6) % (8 * buffer.len() as u64);
            buffer[(bit / 8) as usize] ^= 1 << (bit % 8);
        }
        Ok(())
    }
}
