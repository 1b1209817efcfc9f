//! What the crate does as others see it.

pub mod common;
mod file;
mod foresight;
mod paging;
mod within;
