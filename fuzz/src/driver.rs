//! Runs, one after the other in one thread, and what becomes of finds: a line, and the input in a file.

use std::any::Any;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{LazyLock, Mutex};
use std::time::{Duration, Instant};

use crate::allocator;
use crate::inputs::Inputs;
use crate::targets::{self, Desk, Target};

/// Allocations in a run, and their bytes: the measure of how many steps it takes.
const MOST_ALLOCATIONS: u64 = 2_000_000;
const MOST_BYTES: u64 = 4 << 30;
/// After so long a run is taken to be without end. It says which input that was, and is no measure.
const PATIENCE: Duration = Duration::from_secs(60);
/// Inputs that are kept of finds in one place.
const KEPT: u64 = 3;

#[derive(Debug)]
pub struct Options {
    runs: u64,
    minutes: f64,
    seed: u64,
    finds: PathBuf,
}

impl Options {
    pub fn parse(arguments: &[&str]) -> Result<Self, String> {
        let mut options = Self { runs: u64::MAX, minutes: f64::INFINITY, seed: 1, finds: "finds".into() };
        for pair in arguments.chunks(2) {
            let &[name, value] = pair else { return Err(format!("{} wants a value", pair[0])) };
            let wrong = || format!("{name} {value} is not understood");
            match name {
                "--runs" => options.runs = value.parse().map_err(|_| wrong())?,
                "--minutes" => options.minutes = value.parse().map_err(|_| wrong())?,
                "--seed" => options.seed = value.parse().map_err(|_| wrong())?,
                "--finds" => options.finds = value.into(),
                _ => return Err(wrong()),
            }
        }
        Ok(options)
    }
}

/// The run that is under way: where its input goes if the process has to end, and the input.
static CURRENT: LazyLock<Mutex<(PathBuf, Vec<u8>)>> = LazyLock::new(Mutex::default);
/// Goes up with each run.
static BEGUN: AtomicU64 = AtomicU64::new(0);

thread_local! {
    /// Where the last panic was, and what it said.
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Says what the input of the run that is under way has come to, and keeps it.
fn last_words(what: &str) {
    let current = CURRENT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let (path, bytes) = &*current;
    let written = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(path, bytes));
    println!("FIND {}: {what}", path.display());
    if let Err(error) = written {
        println!("{}: {error}", path.display());
    }
}

/// An allocation that is too large. There is no way on.
fn refuse(bytes: usize) -> ! {
    let trace = std::backtrace::Backtrace::force_capture().to_string();
    last_words(&format!("an allocation of {bytes} bytes at once{}", ours(&trace)));
    std::process::exit(3);
}

/// The places of our own in a trace.
fn ours(trace: &str) -> String {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/");
    let root = root.trim_end_matches("fuzz/");
    let places = trace.lines().filter_map(|line| line.split_once(root)).map(|(_, place)| place);
    places.take(8).map(|line| format!("\n    {}", line.trim())).collect()
}

/// Whoever has waited too long for a run says which it is, and ends.
fn watch() {
    std::thread::spawn(|| {
        let (mut last, mut since) = (0, Instant::now());
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let now = BEGUN.load(Ordering::Relaxed);
            if now != last || now.is_multiple_of(2) {
                (last, since) = (now, Instant::now());
            } else if since.elapsed() > PATIENCE {
                last_words("no end");
                std::process::exit(4);
            }
        }
    });
}

fn listen() {
    panic::set_hook(Box::new(|info: &PanicHookInfo<'_>| {
        let place = info.location().map_or_else(String::new, ToString::to_string);
        let trace = std::backtrace::Backtrace::force_capture().to_string();
        PANIC.set(format!("{place}: {}{}", message(info.payload()), ours(&trace)));
    }));
}

fn message(payload: &dyn Any) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("a panic")
}

/// What came of a run: whether the input was taken, or what is wrong.
fn one(target: &Target, input: &[u8], path: PathBuf, desk: &Desk) -> Result<bool, String> {
    {
        let mut current = CURRENT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        current.0 = path;
        current.1.clear();
        current.1.extend_from_slice(input);
    }
    // Odd while a run is under way.
    BEGUN.fetch_add(1, Ordering::Relaxed);
    allocator::begin(refuse);
    let outcome = panic::catch_unwind(AssertUnwindSafe(|| (target.run)(input, desk)));
    let count = allocator::end();
    BEGUN.fetch_add(1, Ordering::Relaxed);
    let taken = outcome.map_err(|_| PANIC.take())?;
    if count.allocations > MOST_ALLOCATIONS || count.bytes > MOST_BYTES {
        return Err(format!("{} allocations of {} bytes in all", count.allocations, count.bytes));
    }
    Ok(taken)
}

/// A folder in memory, where there is one.
fn desk() -> Result<(Desk, PathBuf), String> {
    let memory = Path::new("/dev/shm");
    let above = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    let folder = above.join(format!("foldfront-fuzz-{}", std::process::id()));
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    Ok((Desk::new(&folder), folder))
}

/// Runs a target. Whether nothing was found.
pub fn run(name: &str, options: &Options) -> Result<bool, String> {
    let Some(target) = targets::ALL.iter().find(|target| target.name == name) else {
        return Err(format!("no target {name}"));
    };
    let (desk, folder) = desk()?;
    watch();
    listen();
    let seconds = 60.0 * options.minutes;
    let inputs =
        Inputs::new(target.name, options.seed).map_err(|error| format!("{}: {error}", target.name))?;
    let begin = Instant::now();
    let (mut taken, mut finds) = (0_u64, 0_u64);
    let mut places: BTreeMap<String, u64> = BTreeMap::new();
    let mut run = 0;
    while run < options.runs {
        // The clock is looked at now and then.
        if run.is_multiple_of(16) && begin.elapsed().as_secs_f64() >= seconds {
            break;
        }
        let input = inputs.get(run);
        let path = options.finds.join(target.name).join(format!("seed-{}-run-{run}", options.seed));
        match one(target, &input, path, &desk) {
            Ok(was_taken) => taken += u64::from(was_taken),
            Err(what) => {
                finds += 1;
                let line = what.lines().next().unwrap_or("");
                let place: String = line.split(": ").next().unwrap_or("").to_owned();
                let known = places.entry(place).or_default();
                *known += 1;
                if *known <= KEPT {
                    last_words(&what);
                }
            }
        }
        run += 1;
        if run.is_multiple_of(100_000) {
            println!("... {} {run} runs, {:.0} s", target.name, begin.elapsed().as_secs_f64());
        }
    }
    let elapsed = begin.elapsed().as_secs_f64();
    println!(
        "{:8} seed {} {run:9} runs {:8.0} a second {:5.1} % read {finds:6} finds in {} places",
        target.name,
        options.seed,
        run as f64 / elapsed,
        100.0 * taken as f64 / run.max(1) as f64,
        places.len()
    );
    // Nothing is lost if it stays.
    let _ = fs::remove_dir_all(folder);
    Ok(finds == 0)
}

/// Runs files again. Whether nothing was found.
pub fn replay<'a>(files: impl Iterator<Item = &'a Path>) -> Result<bool, String> {
    let (desk, folder) = desk()?;
    watch();
    listen();
    let mut is_good = true;
    for file in files {
        let name = file.parent().and_then(Path::file_name).unwrap_or_default();
        let Some(target) = targets::ALL.iter().find(|target| *target.name == *name) else {
            return Err(format!("{}: the folder is not called as a target is", file.display()));
        };
        let input = fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
        match one(target, &input, std::env::temp_dir().join("foldfront-fuzz-replayed"), &desk) {
            Ok(taken) => println!("{}: {}", file.display(), if taken { "read" } else { "refused" }),
            Err(what) => {
                is_good = false;
                println!("FIND {}: {what}", file.display());
            }
        }
    }
    let _ = fs::remove_dir_all(folder);
    Ok(is_good)
}
