//! What paging backends share: where pages come from, and requests for them.
//!
//! A backend says what one read is and what it brings ([`Pages`]): a page, a run of detail blocks, the nodes of a partition. It
//! asks for reads, each with an urgency, through [`Requests`], the tree's end of a [`Store`]; takes them back, makes them
//! more urgent; and finds what has come at the start of each frame ([`Arrival`]). What a page is, which is asked for first and
//! which leaves is the backend's own. It needs no thread and no lock.
//!
//! # Who owns what
//!
//! A store has one thread, which takes the most urgent request from its queue, reads and checks. Or it is on virtual
//! time ([`Simulated`]): then there is no thread, and whoever lets time pass reads what has ended by then. Several trees can
//! share a store. Everything else belongs to the thread of the tree.
//!
//! Shared are the queue, under a lock that is never held while a thread reads; a channel for each tree's answers; and what is
//! known of a tree by the store: its frame, whether it is gone, and how many of its requests wait. So a frame never waits. A tree that goes away takes
//! its requests back; the thread ends when the last handle of its store is gone, after the read that it is at. Nobody waits for
//! that: a read that never returns keeps nobody from dropping a tree.

mod failures;
mod look_ahead;
mod pages;
mod queue;
mod requests;
mod simulated;
pub mod source;
mod store;
mod sync;

pub use failures::Failures;
pub use pages::Pages;
pub use queue::NOW;
pub use requests::{Arrival, Requests, Ticket};
pub use simulated::Simulated;
pub use store::{Store, ThreadError};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
