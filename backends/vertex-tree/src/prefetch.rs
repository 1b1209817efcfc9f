//! A hint to the processor that memory will be read soon.
//!
//! Status changes follow chains of references through structures much larger than the caches. Hints for a handful of
//! nodes, one step of the chain for all of them before the next step for any, let the misses overlap.

/// Starts to fetch the cache line at which an element starts; nothing where there is no such element. Changes nothing
/// but time.
#[inline(always)]
pub fn prefetch<T>(elements: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(element) = elements.get(index) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch reads nothing that the program can see and never faults, whatever the address; this one is
        // that of an element.
        #[expect(
            unsafe_code,
            reason = "the hint is not to be had without, and worth a third of a status change"
        )]
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(element).cast());
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (elements, index);
}
