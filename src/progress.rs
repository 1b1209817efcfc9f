//! How long work tells its caller how far it has come.

/// Called now and then with the work done and the work in all, in units of the callee's choice.
pub type Progress<'a> = &'a mut dyn FnMut(u64, u64);
