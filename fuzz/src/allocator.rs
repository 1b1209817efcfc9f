//! An allocator that refuses what no small file is worth, and counts the rest.
//!
//! There is no way on from a refused allocation: whoever asked may not be able to do without, and to unwind from here is not allowed. So
//! the process says what it was about and ends.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The first size that is refused.
pub const LIMIT: usize = 64 << 20;

/// Allocations since the count began, and their bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Count {
    pub allocations: u64,
    pub bytes: u64,
}

thread_local! {
    /// What is called with a size that is refused, while a run is under way.
    static REFUSE: Cell<Option<fn(usize) -> !>> = const { Cell::new(None) };
    static COUNT: Cell<Count> = const { Cell::new(Count { allocations: 0, bytes: 0 }) };
}

/// From here on this thread's allocations are counted and limited.
pub fn begin(refuse: fn(usize) -> !) {
    COUNT.set(Count::default());
    REFUSE.set(Some(refuse));
}

/// Neither counted nor limited any more.
pub fn end() -> Count {
    REFUSE.set(None);
    COUNT.get()
}

struct Limited;

#[global_allocator]
static ALLOCATOR: Limited = Limited;

fn count(bytes: usize) {
    if let Some(refuse) = REFUSE.get() {
        if bytes >= LIMIT {
            REFUSE.set(None);
            refuse(bytes);
        }
        let Count { allocations, bytes: before } = COUNT.get();
        COUNT.set(Count { allocations: allocations + 1, bytes: before + bytes as u64 });
    }
}

#[expect(unsafe_code, reason = "an allocator is unsafe to implement; all of it is the system's")]
// SAFETY: every call is handed on to the system's allocator as it came. What is counted has no destructor and takes no memory.
unsafe impl GlobalAlloc for Limited {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller's promise is handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        count(bytes);
        // SAFETY: as above.
        unsafe { System.realloc(at, layout, bytes) }
    }
}
