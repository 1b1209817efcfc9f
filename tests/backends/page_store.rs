//! The page store on time of its own, as its own tests under the model checker can not have it: requests in order of
//! urgency, so many under way, and the same every time.

use std::sync::Arc;
use std::time::Duration;

use foldfront::page_store::{Arrival, NOW, Pages, Requests, Simulated, Store};

const MS: Duration = Duration::from_millis(1);

/// Reads of ten bytes that bring their own number, and fail if it is odd.
struct Numbers;

impl Pages for Numbers {
    type Read = u32;
    type Content = u32;
    type Error = &'static str;

    fn bytes(&self, _: &u32) -> u64 {
        10
    }

    fn read(&self, &read: &u32, _: &mut Vec<u8>) -> Result<u32, &'static str> {
        if read == 99 {
            std::panic::resume_unwind(Box::new("a source that panics"));
        }
        if read % 2 == 0 { Ok(read) } else { Err("odd") }
    }

    fn panicked(&self, _: &u32) -> &'static str {
        "panicked"
    }
}

fn store(depth: usize) -> Store<Numbers> {
    Store::simulated(Simulated { latency: 5 * MS, bandwidth: None, depth })
}

fn requests(store: &Store<Numbers>) -> Requests<Numbers> {
    Requests::new(store.clone(), Arc::new(Numbers))
}

/// What has come by the beginning of a frame, in that order.
fn come(requests: &mut Requests<Numbers>, frame: u64) -> Vec<u32> {
    let mut arrivals = Vec::new();
    requests.begin_frame(frame, &mut arrivals);
    arrivals.into_iter().map(|Arrival { read, .. }| read).collect()
}

#[test]
fn the_most_urgent_comes_first() {
    let mut requests = requests(&store(1));
    let tickets: Vec<_> =
        [(2, 7), (4, NOW), (6, 3), (8, 7), (10, 9)].map(|(read, urgency)| requests.ask(read, urgency)).into();
    assert_eq!(requests.waiting(), [1, 4]);
    requests.demand(tickets[3]);
    requests.rank(tickets[4], 4);
    assert_eq!(requests.waiting(), [2, 3]);
    // One at a time, each of 5 ms.
    let mut order = Vec::new();
    for frame in 1..=5 {
        requests.pass(5 * MS);
        order.extend(come(&mut requests, frame));
    }
    assert_eq!(order, [4, 8, 6, 10, 2]);
    let stats = requests.take_stats();
    assert_eq!((stats.reads, stats.read_bytes, stats.ahead, stats.faults), (5, 50, 3, 0));
}

#[test]
fn what_has_been_started_can_not_be_taken_back() {
    let mut requests = requests(&store(2));
    let tickets = [0, 2, 4, 6, 8].map(|read| requests.ask(read, 1 + u64::from(read)));
    requests.pass(MS);
    assert_eq!(requests.waiting(), [0, 3]);
    assert_eq!(tickets.map(|ticket| requests.withdraw(ticket)), [false, false, true, true, true]);
    let urgent = requests.ask(10, NOW);
    requests.ask(12, 4);
    requests.ask(14, 3);
    assert_eq!(requests.withdraw_last(false), Some(12));
    let mut ahead = Vec::new();
    requests.withdraw_ahead(&mut ahead);
    assert_eq!((ahead, requests.withdraw_last(false)), (vec![14], None));
    assert_eq!((requests.withdraw_last(true), requests.withdraw(urgent)), (Some(10), false));
    assert_eq!(requests.settle(), 4 * MS);
    assert_eq!(come(&mut requests, 1), [0, 2]);
}

/// A read that fails, or in which the source panics, is a fault, and the next is served.
#[test]
fn failures_are_answers() {
    let mut requests = requests(&store(4));
    for read in [1, 99, 2] {
        requests.ask(read, NOW);
    }
    requests.settle();
    let mut arrivals = Vec::new();
    requests.begin_frame(1, &mut arrivals);
    let contents: Vec<_> = arrivals.into_iter().map(|arrival| arrival.content).collect();
    assert_eq!(contents, [Err("odd"), Err("panicked"), Ok(2)]);
    let stats = requests.take_stats();
    assert_eq!((stats.reads, stats.read_bytes, stats.faults), (1, 10, 2));
    assert_eq!(requests.take_stats(), Default::default());
}

/// Trees that share a store share its clock: what has passed for both has passed once.
#[test]
fn time_passes_once_for_trees_that_share_a_store() {
    let store = store(1);
    let [mut one, mut other] = [requests(&store), requests(&store)];
    one.ask(0, NOW);
    other.ask(2, NOW);
    one.pass(5 * MS);
    assert_eq!((come(&mut one, 1), come(&mut other, 1)), (vec![0], vec![]));
    other.pass(5 * MS);
    assert_eq!(come(&mut other, 2), [0; 0], "as much as for the first, and no more");
    other.pass(5 * MS);
    assert_eq!(come(&mut other, 3), [2]);
    // Nobody serves a tree that is gone.
    one.ask(4, NOW);
    drop(one);
    other.ask(6, NOW);
    assert_eq!(other.settle(), 5 * MS);
    assert_eq!(come(&mut other, 4), [6]);
}

/// How far it is worth to look ahead follows from how long reads take, and how many requests wait.
#[test]
fn the_store_is_measured() {
    let mut requests = requests(&store(1));
    assert_eq!(requests.look_ahead(2), 2);
    requests.ask(0, NOW);
    for frame in 1..=3 {
        requests.pass(2 * MS);
        come(&mut requests, frame);
    }
    assert_eq!(requests.look_ahead(2), 6, "three frames, and as many again");
    (0..400).for_each(|read| _ = requests.ask(2 * read, NOW));
    for frame in 4..=20 {
        requests.pass(2 * MS);
        come(&mut requests, frame);
    }
    assert_eq!(requests.look_ahead(2), 0, "hundreds wait, and one comes in three frames");
}
