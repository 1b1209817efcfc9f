//! What the crate does as others see it.

mod log_file;
