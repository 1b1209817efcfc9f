//! Soups by the hundred thousand: through construction, with and without merged components, and every backend.
//!
//! `cargo bench --bench soups -- 100000` checks the soups with seeds from 0 on as `tests/construction/soups` does, prints how many had no end (by
//! the bound in rounds), were wrong, or panicked, with the seeds, and exits with 1 if any did. A second number is the first
//! seed. A soup that is still at work after two minutes is given up, and the rest with it.

#[path = "../tests/construction/soups/check.rs"]
#[allow(dead_code)]
mod check;
#[path = "../tests/construction/soups/follow.rs"]
mod follow;
#[path = "../tests/construction/soups/one.rs"]
mod one;
#[path = "../tests/construction/simplify/replay.rs"]
#[allow(dead_code)]
mod replay;
#[path = "../tests/common/soup.rs"]
#[allow(dead_code)]
mod soup;

use std::panic::catch_unwind;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use check::Fault;

const THREADS: usize = 2;
const PATIENCE: Duration = Duration::from_secs(120);
/// Without an argument.
const FEW: u64 = 1000;
/// So many soups after each other go by without a word.
const QUIET: u64 = 10_000;

/// What was found so far.
#[derive(Default)]
struct Found {
    done: u64,
    endless: Vec<(u64, String)>,
    wrong: Vec<(u64, String)>,
    panicked: Vec<(u64, String)>,
    /// What each thread is at, and since when.
    at_work: [Option<(u64, Instant)>; THREADS],
}

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let (count, first) = (numbers.first().copied().unwrap_or(FEW), numbers.get(1).copied().unwrap_or(0));
    std::panic::set_hook(Box::new(|_| ()));
    // Files are synced, which costs nothing in memory.
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
    let folder = folder.expect("a folder for temporary files");

    let (found, next) = (Mutex::new(Found::default()), AtomicU64::new(first));
    std::thread::scope(|scope| {
        for thread in 0..THREADS {
            let (found, next, folder) = (&found, &next, folder.path().join(thread.to_string()));
            std::fs::create_dir(&folder).expect("a folder for temporary files");
            scope.spawn(move || work(thread, found, next, first + count, &folder));
        }
        watch(&found, count);
    });
    let found = found.into_inner().expect("nobody panics with it");
    if print(&found) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Checks one soup after the other.
fn work(thread: usize, found: &Mutex<Found>, next: &AtomicU64, end: u64, folder: &Path) {
    loop {
        let seed = next.fetch_add(1, Ordering::Relaxed);
        if seed >= end {
            return;
        }
        found.lock().expect("nobody panics with it").at_work[thread] = Some((seed, Instant::now()));
        let outcome = catch_unwind(|| one::check_soup(seed, true, folder));
        let mut found = found.lock().expect("nobody panics with it");
        found.at_work[thread] = None;
        found.done += 1;
        if found.done.is_multiple_of(QUIET) {
            let faults = found.endless.len() + found.wrong.len() + found.panicked.len();
            eprintln!("{} soups, {faults} faults", found.done);
        }
        match outcome {
            Ok(Ok(())) => {}
            Ok(Err(fault @ Fault::Endless { .. })) => found.endless.push((seed, fault.to_string())),
            Ok(Err(fault @ Fault::Wrong(_))) => found.wrong.push((seed, fault.to_string())),
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let text = text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no words");
                found.panicked.push((seed, text.to_owned()));
            }
        }
    }
}

/// Waits for the last soup, and ends it all where one does not end.
fn watch(found: &Mutex<Found>, count: u64) {
    loop {
        std::thread::sleep(Duration::from_millis(100));
        let mut found = found.lock().expect("nobody panics with it");
        let stuck = found.at_work.iter().flatten().find(|(_, since)| since.elapsed() > PATIENCE).copied();
        if let Some((seed, since)) = stuck {
            found.endless.push((seed, format!("at work for {} s", since.elapsed().as_secs())));
            print(&found);
            std::process::exit(1);
        }
        if found.done == count {
            return;
        }
    }
}

/// Prints a table, and whether all is well.
fn print(found: &Found) -> bool {
    println!("| soups | without an end | wrong | panicking |\n| --- | --- | --- | --- |");
    let Found { done, endless, wrong, panicked, .. } = found;
    println!("| {done} | {} | {} | {} |", endless.len(), wrong.len(), panicked.len());
    let all = [("without an end", endless), ("wrong", wrong), ("panicking", panicked)];
    for (what, seeds) in all {
        for (seed, words) in seeds {
            println!("{what}: {seed}: {}", words.lines().next().unwrap_or_default());
        }
    }
    all.iter().all(|(_, seeds)| seeds.is_empty())
}
