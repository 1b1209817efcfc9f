//! Work in fixed pieces on however many threads there are: the pieces, and with them the results, do not depend on
//! the number of threads.

use std::ops::Range;
use std::sync::Mutex;
use std::thread;

/// Calls `work` for the chunks `0..chunk`, `chunk..2*chunk`, … of `0..count`, and returns its answers in their order.
pub(crate) fn map_chunks<T: Send>(
    count: usize,
    chunk: usize,
    work: impl Fn(Range<usize>) -> T + Sync,
) -> Vec<T> {
    let starts: Vec<usize> = (0..count).step_by(chunk).collect();
    map(starts, |start| work(start..count.min(start + chunk)))
}

/// Calls `work` for each item, and returns its answers in the order of the items.
pub(crate) fn map<I: Send, T: Send>(items: Vec<I>, work: impl Fn(I) -> T + Sync) -> Vec<T> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(items.len());
    if threads < 2 {
        return items.into_iter().map(work).collect();
    }
    let queue = Mutex::new(items.into_iter().enumerate());
    let take = || queue.lock().expect("taking an item does not panic").next();
    let run = || {
        let mut answers = Vec::new();
        while let Some((number, item)) = take() {
            answers.push((number, work(item)));
        }
        answers
    };
    let mut answers: Vec<(usize, T)> = thread::scope(|scope| {
        let workers: Vec<_> = (1..threads).map(|_| scope.spawn(run)).collect();
        let mut answers = run();
        for worker in workers {
            answers.extend(worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        answers
    });
    answers.sort_unstable_by_key(|&(number, _)| number);
    answers.into_iter().map(|(_, answer)| answer).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_come_in_the_order_of_the_chunks() {
        let chunks = map_chunks(1003, 10, |range| (range.start, range.len()));
        assert_eq!(chunks.len(), 101);
        assert!(chunks.iter().enumerate().all(|(i, &(start, _))| start == 10 * i));
        assert_eq!(chunks[100].1, 3);
        assert!(map_chunks(0, 10, |range| range).is_empty());
    }
}
