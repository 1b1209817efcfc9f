//! The scan's own lists. That it finds what it must is in the tests of all strategies.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::*;

const NODE: Bounds = Bounds { center: [0.0; 3], radius: 1.0, eps: 1.0 };

fn watched(scan: &FrontScan) -> Vec<(u32, bool)> {
    let mut watched = Vec::new();
    scan.for_each_watched(&mut |slot, kind, _| watched.push((slot.0, kind == Kind::Fold)));
    watched.sort_unstable();
    watched
}

/// Slots with odd numbers to fold, the others to unfold.
fn scan() -> FrontScan {
    let mut scan = FrontScan::default();
    for slot in 1..60 {
        scan.put(Slot(slot), if slot % 2 == 1 { Kind::Fold } else { Kind::Unfold }, NODE);
    }
    scan
}

#[test]
fn what_is_watched_is_in_a_list_once() {
    let mut scan = scan();
    let all: Vec<_> = (1..60).map(|slot| (slot, slot % 2 == 1)).collect();
    assert_eq!(watched(&scan), all);
    scan.put(Slot(7), Kind::Fold, NODE);
    scan.refused(Slot(8), Kind::Unfold, NODE);
    assert_eq!(watched(&scan), all, "it is there already");
    scan.assert_well_formed();
    // From the middle and from the ends, until nothing is left.
    for (removed, slot) in [1, 2, 59, 58, 30, 31].into_iter().chain((1..80).rev()).enumerate() {
        scan.unwatch(Slot(slot));
        scan.assert_well_formed();
        assert!(watched(&scan).iter().all(|&(other, _)| other != slot));
        assert!(removed > 5 || watched(&scan).len() == 58 - removed);
    }
    assert_eq!(watched(&scan), []);
    scan.refused(Slot(8), Kind::Fold, NODE);
    assert_eq!(watched(&scan), [(8, true)]);
}

/// Each check finds what it is for.
#[test]
fn a_scan_that_is_not_well_formed_is_found() {
    let check = |spoil: &dyn Fn(&mut FrontScan)| {
        let mut scan = scan();
        spoil(&mut scan);
        catch_unwind(AssertUnwindSafe(|| scan.assert_well_formed())).is_err()
    };
    assert!(!check(&|_| {}));
    assert!(check(&|scan| scan.place[8] += 2), "another place");
    assert!(check(&|scan| scan.place[8] += 1), "another list");
    assert!(check(&|scan| scan.place[8] = 0), "no place");
    assert!(check(&|scan| scan.place[0] = 2), "a place that is another's");
    assert!(check(&|scan| scan.folded.push(&NODE, 7)), "an entry that is another's");
}
