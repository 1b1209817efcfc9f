//! As many threads as there are to be had.

use std::sync::{Mutex, PoisonError};

/// Starts the threads that share what is computed in parallel: one for each core, or as many as the system allows. Where it
/// allows none, this one does the work. Asked for more than there are, rayon would end the process.
pub(super) fn take_what_there_is() {
    let wanted = std::thread::available_parallelism().map_or(1, usize::from);
    let gate = Mutex::new(());
    let allowed = std::thread::scope(|scope| {
        // All at once: those that have ended would not count.
        let closed = gate.lock().unwrap_or_else(PoisonError::into_inner);
        let start = |_| std::thread::Builder::new().spawn_scoped(scope, || drop(gate.lock())).ok();
        let started = (0..wanted).map_while(start).count();
        drop(closed);
        started
    });
    let threads = rayon::ThreadPoolBuilder::new().num_threads(allowed.max(1));
    let threads = if allowed == 0 { threads.use_current_thread() } else { threads };
    // If there are fewer by now, the first that wants one says so.
    drop(threads.build_global());
}
