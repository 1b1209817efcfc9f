//! What the crate does as others see it.

mod sections;
