//! A model checker tries the interleavings of trees and the thread of their store.

use shuttle::thread;

use super::*;

/// Reads bring their own number, fail from 100 on, and panic from 200 on.
struct Numbers;

impl Pages for Numbers {
    type Read = u32;
    type Content = u32;
    type Error = u32;

    fn bytes(&self, read: &u32) -> u64 {
        (*read).into()
    }

    fn read(&self, &read: &u32, _: &mut Vec<u8>) -> Result<u32, u32> {
        thread::yield_now();
        match read {
            0..100 => Ok(read),
            100..200 => Err(read),
            _ => std::panic::resume_unwind(Box::new(read)),
        }
    }

    fn panicked(&self, read: &u32) -> u32 {
        1000 + read
    }
}

/// All would be millions.
const MOST: Option<usize> = Some(20_000);

fn requests(store: &Store<Numbers>) -> Requests<Numbers> {
    Requests::new(store.clone(), Arc::new(Numbers))
}

/// What has come, each with whether it was demanded, in ascending order.
fn come(requests: &mut Requests<Numbers>, frame: u64) -> Vec<(u32, bool)> {
    let mut arrivals = Vec::new();
    requests.begin_frame(frame, &mut arrivals);
    let mut come = Vec::new();
    for Arrival { read, is_demanded, content } in arrivals {
        let expected = match read {
            0..100 => Ok(read),
            100..200 => Err(read),
            _ => Err(1000 + read),
        };
        assert_eq!(content, expected);
        come.push((read, is_demanded));
    }
    come.sort_unstable();
    come
}

/// Asks, promotes, takes back and settles as a tree does. Every read must come to one end.
fn navigate(requests: &mut Requests<Numbers>) {
    let [zero, one, two] = [0, 1, 2].map(|read| requests.ask(read, 5));
    let hundred = requests.ask(100, NOW);
    requests.demand(one);
    requests.rank(two, 7);
    let mut come_early = come(requests, 1);
    let mut back = Vec::new();
    requests.withdraw_ahead(&mut back);
    assert!(!back.contains(&1) && !back.contains(&100), "{back:?} were not asked for ahead of time");
    back.extend(requests.withdraw(hundred).then_some(100));
    assert!(!requests.withdraw(zero) && !requests.withdraw(hundred), "it has been started, or taken back");
    requests.ask(3, 9);
    requests.ask(4, NOW);
    requests.ask(200, 8);
    back.extend(requests.withdraw_last(false));
    back.extend(requests.withdraw_last(true));
    requests.settle();
    assert_eq!((requests.waiting(), requests.withdraw_last(true)), ([0, 0], None));
    come_early.extend(come(requests, 2));
    // Whatever has come and was demanded says so.
    for &(read, is_demanded) in &come_early {
        assert_eq!(is_demanded, [1, 4, 100].contains(&read), "{read}");
    }
    let mut ends: Vec<u32> = come_early.into_iter().map(|(read, _)| read).chain(back).collect();
    ends.sort_unstable();
    assert_eq!(ends, [0, 1, 2, 3, 4, 100, 200]);
    assert!(requests.under_way.is_empty());
}

#[test]
fn every_request_comes_to_one_end() {
    let walk = || {
        let store = Store::new().unwrap();
        navigate(&mut requests(&store));
    };
    shuttle::check_random(walk, 4_000);
    shuttle::check_pct(walk, 4_000, 4);
}

#[test]
fn trees_that_share_a_store_get_what_is_theirs() {
    let walk = || {
        let store = Store::new().unwrap();
        let others = requests(&store);
        let other = thread::spawn(move || {
            let mut requests = others;
            navigate(&mut requests);
        });
        navigate(&mut requests(&store));
        other.join().unwrap();
    };
    shuttle::check_random(walk, 4_000);
    shuttle::check_pct(walk, 4_000, 4);
}

/// Interleavings of smaller walks, one after the other: the thread ends with the last handle, though requests wait and one is
/// being read, and whoever settles is woken.
#[test]
fn nobody_sleeps_forever() {
    let goes_in_flight = || {
        let store = Store::new().unwrap();
        let mut requests = requests(&store);
        requests.ask(0, 5);
        requests.ask(1, NOW);
        drop(store);
    };
    shuttle::check_dfs(goes_in_flight, MOST);
    shuttle::check_pct(goes_in_flight, 4_000, 3);
    let settles = || {
        let store = Store::new().unwrap();
        let mut requests = requests(&store);
        requests.ask(0, 5);
        requests.settle();
        assert_eq!(come(&mut requests, 1), [(0, false)]);
    };
    shuttle::check_dfs(settles, MOST);
    shuttle::check_pct(settles, 4_000, 3);
}

/// A tree goes while its requests wait; another's are served all the same.
#[test]
fn a_tree_that_goes_takes_its_requests_along() {
    let walk = || {
        let store = Store::new().unwrap();
        let [mut one, mut other] = [requests(&store), requests(&store)];
        drop(store);
        for read in 0..3 {
            one.ask(read, u64::from(read));
            other.ask(10 + read, u64::from(read));
        }
        drop(one);
        other.settle();
        assert_eq!(come(&mut other, 1), [(10, true), (11, false), (12, false)]);
    };
    shuttle::check_random(walk, 4_000);
}

/// Answers that come late, twice, or for what nobody has asked for change nothing; one that never comes keeps no frame waiting.
#[test]
fn wrong_answers_are_dropped() {
    let walk = || {
        let store = Store::new().unwrap();
        let mut requests = requests(&store);
        let answer = |requests: &Requests<Numbers>, id, started| {
            requests.tree.answers.send(Answer { id, started, content: Ok(0) }).unwrap();
        };
        requests.ask(0, NOW);
        requests.settle();
        // Twice: before the frame has taken the first, and after.
        answer(&requests, 1, 0);
        assert_eq!(come(&mut requests, 1), [(0, true)]);
        answer(&requests, 1, 0);
        assert_eq!(come(&mut requests, 2), []);
        // For what has been taken back, for what was never asked for, and from the future.
        let ticket = requests.ask(1, 3);
        if requests.withdraw(ticket) {
            answer(&requests, 2, 0);
        }
        answer(&requests, 77, u64::MAX);
        requests.settle();
        assert!(come(&mut requests, 3).len() <= 1);
        // One that is lost: somebody else has it.
        requests.ask(0, NOW);
        let is_lost = requests.store.lock().queue.start().is_some();
        let came = come(&mut requests, 4);
        assert!(!is_lost || came.is_empty());
        assert_eq!(requests.waiting(), [0, 0]);
    };
    shuttle::check_random(walk, 4_000);
}
