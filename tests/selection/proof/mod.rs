//! The trials of an audit that looked for holes in the proof: motions chosen against the time bounds, and walks at the ends
//! of what numbers can be, each against brute force.

#![expect(clippy::disallowed_methods, reason = "random lenses and motions")]

mod bounds;
mod follow;
mod lenses;
mod long;
mod refused;
