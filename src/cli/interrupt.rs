//! Ctrl-C: nothing is left behind, and the exit code is 130.
//!
//! A command that can end well before its work is done says so ([`end_well`]), and looks at the flag from time to time. Any other is
//! ended at once, and so is one that is interrupted twice; its temporary folders go first. The handler is a thread of its own.

use std::sync::atomic::{AtomicBool, Ordering};

use container::temporary;

/// As shells have it: 128, and the number of the signal.
pub(super) const EXIT_CODE: u8 = 130;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static ENDS_WELL: AtomicBool = AtomicBool::new(false);

/// From now on, an interrupt removes what is temporary and ends the process, or waits for a command that ends well. Where it
/// can not be listened for, as there is no thread to be had, the system ends the process.
pub(super) fn listen() {
    drop(ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) || !ENDS_WELL.load(Ordering::Relaxed) {
            temporary::remove_all();
            std::process::exit(EXIT_CODE.into());
        }
    }));
}

/// Says that from now on the command looks at the flag, which is raised when it is interrupted.
pub(super) fn end_well() -> &'static AtomicBool {
    ENDS_WELL.store(true, Ordering::Relaxed);
    flag()
}

/// What is raised when the command is interrupted.
pub(super) fn flag() -> &'static AtomicBool {
    &INTERRUPTED
}

/// Whether it is.
pub(super) fn is_raised() -> bool {
    flag().load(Ordering::Relaxed)
}

/// Says that from now on it does not.
pub(super) fn end_at_once() {
    ENDS_WELL.store(false, Ordering::Relaxed);
}
