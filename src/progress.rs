//! How long work reports how far it has come.

/// Called now and then with (units of work done, units of work in all). Units are the caller's business only as a
/// ratio; the total may be refined between calls.
pub type Progress<'a> = &'a mut dyn FnMut(u64, u64);
