//! Hierarchies that page: opened, verified, and walked through with all kinds of settings. What `verify` passes has to be without a
//! fault in any walk.

use std::sync::Arc;
use std::time::Duration;

use foldfront::detail_block::{self, XfmFile, XfmTree};
use foldfront::meta_node::{self, Dependencies, InUse, MetaNodeFile, MetaNodeTree};
use foldfront::mt_partition::{self, CacheMode, Memory, MtFile, MtTree, Reader};
use foldfront::page_store::Simulated;
use foldfront::page_store::source::{Counted, MemorySource};
use foldfront::vertex_tree::Prefetch;

use super::walk::{Outcome, follow};
use super::{Desk, check_error, choice};

/// Reads of pages in a run, each of which is at least one change that was wanted.
const MOST_READS: u64 = 200_000;

type Source = Arc<Counted<MemorySource>>;

fn source(name: &str, bytes: &[u8]) -> Source {
    Arc::new(Counted::new(MemorySource::new(name, bytes)))
}

/// Whether a file has been opened, or passes; if not, what is said is looked at.
fn checked<T, E: std::error::Error>(outcome: Result<T, E>) -> Option<T> {
    outcome.inspect_err(|error| check_error(error)).ok()
}

fn store() -> Simulated {
    Simulated::with_latency(Duration::from_millis(5))
}

/// Memory for everything, for the least, or for little more.
fn memory(choice: u64, least: u64) -> u64 {
    match choice % 4 {
        0 | 1 => u64::MAX,
        2 => least,
        _ => least.saturating_mul(3),
    }
}

/// What verify passes is without a fault. Where every cut can be reached, it is.
fn check(verified: bool, reaches: bool, outcome: &Outcome, source: &Source) {
    assert!(!verified || outcome.is_clean(), "verify passes what a walk comes upon: {outcome:?}");
    assert!(
        !verified || !reaches || outcome.at_rest,
        "a file that is verified, and a cut that is not reached"
    );
    let (reads, _) = source.totals();
    assert!(reads <= MOST_READS, "{reads} reads");
}

pub fn meta_node(bytes: &[u8], _: &Desk) -> bool {
    let source = source("input.meta", bytes);
    let Some(file) = checked(MetaNodeFile::open(source.clone())) else { return false };
    let file = Arc::new(file);
    assert!(!file.facts().is_empty());
    let verified = checked(file.verify()).is_some();
    let choice = choice(bytes) >> 12;
    let in_use = [InUse::Yields, InUse::Yields, InUse::Stays, InUse::Printed][choice as usize % 4];
    let dependencies = match choice / 4 % 6 {
        0 => Dependencies::Force,
        1 => Dependencies::Block,
        _ => Dependencies::Off,
    };
    let settings = meta_node::Settings {
        page_memory: memory(choice / 24, file.least_memory()),
        dependencies,
        in_use,
        prefetch: Prefetch::ALL[choice as usize / 96 % Prefetch::ALL.len()],
        io: meta_node::Io::Simulated(store()),
    };
    let Some(mut tree) = checked(MetaNodeTree::new(file, settings)) else {
        assert!(!verified, "a file that is verified, and no tree");
        return true;
    };
    if (choice / 400).is_multiple_of(4) {
        tree.load_all();
    }
    let outcome = follow(tree, choice / 1600, bytes.len(), verified);
    check(verified, in_use == InUse::Yields && dependencies == Dependencies::Off, &outcome, &source);
    true
}

pub fn detail_block(bytes: &[u8], _: &Desk) -> bool {
    let source = source("input.xfm", bytes);
    let Some(file) = checked(XfmFile::open(source.clone())) else { return false };
    let file = Arc::new(file);
    assert!(!file.facts().is_empty());
    let verified = checked(file.verify()).is_some();
    let choice = choice(bytes) >> 12;
    let hard_quota = memory(choice, file.least_memory());
    let settings = detail_block::Settings {
        io: if (choice / 4).is_multiple_of(3) {
            detail_block::Io::Blocking
        } else {
            detail_block::Io::Simulated(store())
        },
        prefetch: Prefetch::ALL[choice as usize / 12 % Prefetch::ALL.len()],
        soft_quota: if (choice / 60).is_multiple_of(2) { hard_quota } else { file.least_memory() },
        hard_quota,
        grace: if (choice / 120).is_multiple_of(2) { 0 } else { 180 },
    };
    let Some(tree) = checked(XfmTree::new(file, settings)) else {
        assert!(!verified, "a file that is verified, and no tree");
        return true;
    };
    let outcome = follow(tree, choice / 240, bytes.len(), verified);
    check(verified, hard_quota == u64::MAX, &outcome, &source);
    true
}

pub fn mt_partition(bytes: &[u8], _: &Desk) -> bool {
    let source = source("input.mt", bytes);
    let Some(file) = checked(MtFile::open(source.clone())) else { return false };
    assert!(!file.facts().is_empty());
    let verified = checked(file.verify()).is_some();
    let choice = choice(bytes) >> 12;
    let settings = mt_partition::Settings {
        cache: CacheMode::ALL[choice as usize % CacheMode::ALL.len()],
        memory: Memory::new(memory(choice / 5, file.least_memory())),
        reader: Some(Reader::simulated(store())),
        prefetch: Prefetch::ALL[choice as usize / 20 % Prefetch::ALL.len()],
    };
    let Some(tree) = checked(MtTree::new(Arc::new(file), settings)) else {
        assert!(!verified, "a file that is verified, and no tree");
        return true;
    };
    let outcome = follow(tree, choice / 100, bytes.len(), verified);
    check(verified, true, &outcome, &source);
    true
}
