//! Soups and difficult places: meshes with whatever can be wrong with one, through construction and every backend.

mod cases;
mod check;
mod crowds;
mod follow;
mod one;
mod scales;

use one::check_soup;

/// The faults of the first soups, each with its seed.
fn assert_all(count: u64, everywhere: bool) {
    let folder = tempfile::tempdir().unwrap();
    let fault = |seed| check_soup(seed, everywhere, folder.path()).err().map(|f| format!("{seed}: {f}"));
    let faults: Vec<String> = (0..count).filter_map(fault).collect();
    let some = faults[..faults.len().min(20)].join("\n");
    assert!(faults.is_empty(), "{} of {count} soups:\n{some}", faults.len());
}

#[test]
fn soups_end_and_keep_what_they_promise() {
    assert_all(4_000, false);
}

#[test]
fn soups_in_every_backend() {
    assert_all(300, true);
}

/// Each kind comes up, in many sizes, and most soups show something.
#[test]
fn soups_are_of_all_kinds() {
    let soups: Vec<_> = (0..2_000).map(crate::soup::soup).collect();
    for kind in crate::soup::Kind::ALL {
        let count = soups.iter().filter(|soup| soup.kind == kind).count();
        assert!(count > 80, "{kind:?}: {count}");
    }
    assert!(soups.iter().all(|soup| (4..=40).contains(&soup.mesh.positions.len())));
    assert!(soups.iter().all(|soup| soup.mesh.positions.iter().flatten().all(|x| x.is_finite())));
    let empty = soups.iter().filter(|soup| soup.mesh.triangles.is_empty()).count();
    assert!(empty == 0, "{empty}");
}
