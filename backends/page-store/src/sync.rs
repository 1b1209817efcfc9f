//! What threads share, through one small seam: the real thing, or the model checker's.
//!
//! The tests of this crate run under shuttle, which tries interleavings of everything that goes through here.

#[cfg(not(test))]
pub use crossbeam_channel::{Receiver, Sender, unbounded};
#[cfg(not(test))]
pub use std::{
    sync::{
        Condvar, Mutex, MutexGuard,
        atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
    },
    thread,
};

#[cfg(test)]
pub use shuttle::{
    sync::{
        Condvar, Mutex, MutexGuard,
        atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
        mpsc::{Receiver, Sender, channel as unbounded},
    },
    thread,
};
