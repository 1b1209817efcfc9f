//! The reference backend: the whole hierarchy resident, nothing clever.
