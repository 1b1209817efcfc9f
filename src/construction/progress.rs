//! How long work reports how far it has come.

/// Called now and then with the amount of work done and the amount there is in all, in a unit of the caller's.
pub type Progress<'a> = &'a mut dyn FnMut(u64, u64);
