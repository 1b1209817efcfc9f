use std::io;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::page_source::PageSource;

/// Another source with the latency and the bandwidth of a slower store.
///
/// Latencies of reads that are under way at the same time overlap, as they do on a network; their bytes share the
/// bandwidth.
#[derive(Debug)]
pub struct Throttled<S> {
    source: S,
    latency: Duration,
    bytes_per_second: Option<u64>,
    /// When the line is free for the next bytes.
    free_at: Mutex<Option<Instant>>,
}

impl<S> Throttled<S> {
    /// Every read takes `latency`, and then as long as its bytes take at the bandwidth, if there is a limit.
    pub fn new(source: S, latency: Duration, bytes_per_second: Option<u64>) -> Self {
        Self { source, latency, bytes_per_second, free_at: Mutex::new(None) }
    }
}

impl<S: PageSource> PageSource for Throttled<S> {
    fn name(&self) -> &str {
        self.source.name()
    }

    fn len(&self) -> u64 {
        self.source.len()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        let first = Instant::now() + self.latency;
        let done = match self.bytes_per_second {
            Some(rate) => {
                let transfer = Duration::from_secs_f64(buffer.len() as f64 / rate.max(1) as f64);
                let mut free_at = self.free_at.lock().unwrap_or_else(PoisonError::into_inner);
                let done = free_at.map_or(first, |free| free.max(first)) + transfer;
                *free_at = Some(done);
                done
            }
            None => first,
        };
        self.source.read_at(offset, buffer)?;
        std::thread::sleep(done.saturating_duration_since(Instant::now()));
        Ok(())
    }
}
