//! What the crate does as others see it.

mod virtual_time;
