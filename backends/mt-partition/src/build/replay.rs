//! Another way to the arcs, for tests: the log is replayed on the mesh.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use collapse_log::external::Scratch;
use collapse_log::{Collapse, CollapseLog, Mesh};
use proptest::prelude::*;
use vertex_tree::{Bounds, NONE};

use super::history::History;
use super::work::Work;
use super::{LEAST_MEMORY, versions};

/// Triangles on each arc, given by the collapses above and below.
fn replay(log: &CollapseLog) -> BTreeMap<[u32; 2], u32> {
    let doubled = |[a, b, c]: [u32; 3]| a == b || b == c || c == a;
    let mut shown: Vec<([u32; 3], u32)> =
        log.mesh.triangles.iter().filter(|t| !doubled(**t)).map(|&t| (t, NONE)).collect();
    let mut arcs = BTreeMap::new();
    // For each vertex, the collapse that last took a triangle from it and gave it none, and the one that last merged
    // another into it, if that made no triangle at all.
    let mut trace = vec![NONE; log.mesh.positions.len()];
    let mut barren = trace.clone();
    for (n, c) in (0..).zip(&log.collapses) {
        let star: Vec<([u32; 3], u32)> =
            shown.iter().filter(|(t, _)| t.contains(&c.removed)).copied().collect();
        shown.retain(|(t, _)| !t.contains(&c.removed));
        for &(_, below) in &star {
            *arcs.entry([n, below]).or_default() += 1;
        }
        let remaining = || star.iter().filter(|(t, _)| !t.contains(&c.kept));
        let is_left = |v: u32| remaining().any(|(t, _)| t.contains(&v));
        let vanishing = star.iter().filter(|(t, _)| t.contains(&c.kept)).flat_map(|(t, _)| t);
        let mut bereaved: Vec<u32> =
            vanishing.copied().filter(|&v| v != c.removed && v != c.kept && !is_left(v)).collect();
        bereaved.dedup();
        let mut below = vec![trace[c.removed as usize], barren[c.removed as usize], barren[c.kept as usize]];
        below.extend(bereaved.iter().map(|&v| trace[v as usize]));
        for below in below.into_iter().filter(|&below| below != NONE) {
            arcs.entry([n, below]).or_default();
        }
        bereaved.iter().for_each(|&v| trace[v as usize] = n);
        barren[c.kept as usize] = if remaining().next().is_none() { n } else { NONE };
        shown.extend(remaining().map(|(t, _)| (t.map(|v| if v == c.removed { c.kept } else { v }), n)));
    }
    for (_, below) in shown {
        *arcs.entry([NONE, below]).or_default() += 1;
    }
    arcs
}

/// Any triangles, and collapses of any two vertices that are there, whether they have triangles or not.
fn any_log() -> impl Strategy<Value = CollapseLog> {
    let triangles = prop::collection::vec(prop::array::uniform3(0_u32..24), 0..60);
    (triangles, prop::collection::vec((0_usize..24, 1_usize..24), 0..24)).prop_map(|(triangles, picks)| {
        let mut there: Vec<u32> = (0..24).collect();
        let bounds = |v: u32| Bounds { center: [v as f32, 0.0, 1.0], radius: 1.0, eps: 0.5 };
        let mut collapses = Vec::new();
        for (at, step) in picks {
            let count = there.len();
            let (removed, kept) = (there[at % count], there[(at % count + step) % count]);
            if removed != kept {
                there.retain(|&v| v != removed);
                collapses.push(Collapse { removed, kept, bounds: bounds(kept) });
            }
        }
        let positions = (0..24).map(|v| [v as f32, (v * v % 7) as f32, 0.0]).collect();
        CollapseLog { mesh: Mesh { positions, triangles, ..Mesh::default() }, collapses }
    })
}

proptest! {
    /// Following triangles one by one gives the arcs that a replay gives, those without triangles included.
    #[test]
    fn triangles_can_be_followed_by_themselves(log in any_log()) {
        log.forest().unwrap();
        let (scratch, stop) = (Scratch { folder: std::env::temp_dir() }, AtomicBool::new(false));
        let work = Work { log: &log, scratch: &scratch, memory: LEAST_MEMORY as usize, stop: &stop };
        let Ok(mut history) = History::new(work) else { panic!("the log is refused") };
        let Ok(mut arcs) = versions::arcs(work, &mut history) else { panic!("no temporary files") };
        let collapses: Vec<u32> = history.ends.read().unwrap().map(|end| end.unwrap()[0]).collect();
        let collapse = |place: u32| collapses.get(place as usize).copied().unwrap_or(NONE);
        let found: BTreeMap<[u32; 2], u32> = arcs
            .spool
            .read()
            .unwrap()
            .map(|arc| arc.map(|[above, below, t]| ([collapse(above), collapse(below)], t)).unwrap())
            .collect();
        let expected = replay(&log);
        prop_assert_eq!(arcs.totals.0, expected.len() as u64);
        for (n, &collapse) in collapses.iter().enumerate() {
            let side = |i: usize| expected.iter().filter(|(arc, _)| arc[i] == collapse).map(|(_, t)| t).sum();
            prop_assert_eq!(history.states.get(n).unwrap().sizes, [side(0), side(1)]);
        }
        prop_assert_eq!(found, expected);
    }
}
