//! Trees of detail blocks under the engine: they fly, forced cuts are what they should be, and a bad store delays.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

use detail_block::{Arrangement, Io, XfmFile, XfmTree};
use foldfront::experiment::path::around;
use foldfront::page_store::source::{Faults, Faulty, MemorySource};
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::front::mix;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::{View, theta_of_pixels};
use foldfront::vertex_tree::{Hierarchy, NONE};
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;

use crate::common::detail_block::{OwnCut, advance_settled, file, options, reading};
use crate::common::{random_step, random_view, seeded};

/// A view of a walk around the origin, brought to a mesh.
pub fn placed(mesh: &Mesh, view: View) -> View {
    let (lo, hi) = mesh.bounding_box().unwrap();
    let [lo, hi] = [lo, hi].map(|p| DVec3::from(p.map(f64::from)));
    view.with_eye((lo + hi) / 2.0 + mesh.extent() / 2.0 * view.eye()).unwrap()
}

pub fn settings(mesh: &Mesh, strategy: Strategy) -> Settings {
    Settings { strategy, rho: 0.01 * mesh.extent(), ..Settings::default() }
}

/// Builds a file of a log, checks all of it, and flies around: every cut that is looked at is the brute-force one and a
/// manifold mesh, closed where the input is.
pub fn flies(name: &str, log: &CollapseLog, is_manifold: bool, is_closed: bool) {
    let arrangement = Arrangement::new(log, &options(false, true)).unwrap();
    let report = arrangement.report();
    eprintln!("{name}: {report:?}");
    if is_manifold {
        let split = (report.cut_edges, report.added_vertices, report.left_out);
        assert_eq!(split, (0, 0, 0), "{name} is manifold");
    }
    let file = file(&arrangement);
    file.verify().unwrap();
    let effective = arrangement.effective_log();
    drop(arrangement);
    let mut cut = OwnCut::new(&effective);
    let path = around(&log.mesh).unwrap();
    let tree = XfmTree::new(file, reading(Io::Blocking)).unwrap();
    let settings = settings(&log.mesh, Strategy::Event);
    let mut engine = Engine::new(tree, ActiveMesh::new(), settings).unwrap();
    let mut most = 0;
    for frame in (0..path.frames.len()).step_by(60) {
        let view = path.view(frame, theta_of_pixels(1.0, 1080)).unwrap();
        let report = advance_settled(&mut engine, &[view]);
        let found = (report.cut_hash, report.active_nodes, report.displayed);
        assert_eq!(found, cut.find(&settings, engine.views()), "{name}, frame {frame}");
        assert_eq!(report.forced, 0, "{name}, frame {frame}: bounds are nested over all needs");
        engine.assert_well_formed();
        if is_closed {
            assert_closed(engine.sink());
        }
        most = report.displayed.max(most);
    }
    assert!(most > report.initial_faces + 1000, "{name}: next to nothing is shown");
    // Looking in all directions, with every sphere too large: the input, triangle for triangle.
    let settings = Settings { criterion: Criterion::SphereSize, ..settings };
    let tree = XfmTree::new(engine.tree().file().clone(), reading(Io::Blocking)).unwrap();
    let mut engine = Engine::new(tree, ActiveMesh::new(), settings).unwrap();
    let ahead = path.view(0, 1.0).unwrap().with_cone(0.5, 0.75_f64.sqrt()).unwrap().with_k(1e15).unwrap();
    let views = [DVec3::X, DVec3::Y, DVec3::Z].map(|d| [d, -d]).as_flattened().to_vec();
    let views: Vec<View> = views.iter().map(|&direction| ahead.with_direction(direction).unwrap()).collect();
    advance_settled(&mut engine, &views);
    engine.assert_well_formed();
    let key = |mesh: &Mesh, corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|v| mesh.positions[v as usize].map(f32::to_bits));
        [a, b, c].min([b, c, a]).min([c, a, b])
    };
    let keys = |mesh: &Mesh| {
        let shown = mesh.triangles.iter().filter(|[a, b, c]| a != b && b != c && c != a);
        let mut keys: Vec<_> = shown.map(|t| key(mesh, t)).collect();
        keys.sort_unstable();
        keys
    };
    let (positions, triangles) = engine.sink().gathered();
    let shown = Mesh { positions, triangles, ..Mesh::default() };
    assert!(keys(&shown) == keys(&log.mesh), "{name}: fully refined it is not the input");
}

pub fn assert_closed(mesh: &ActiveMesh) {
    let edges: HashSet<(u32, u32)> =
        mesh.displayed_triangles().flat_map(|(_, [a, b, c])| [(a, b), (b, c), (c, a)]).collect();
    assert_eq!(edges.len(), 3 * mesh.displayed());
    assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "a hole in a closed mesh");
}

/// Bounds that are not nested over needs: what is displayed is the closure of what is wanted, with every strategy.
pub fn forced_cuts_are_the_closure(log: &CollapseLog, frames: usize) {
    let arrangement = Arrangement::new(log, &options(false, false)).unwrap();
    let (effective, needs) = (arrangement.effective_log(), arrangement.needs());
    let forest = effective.forest().unwrap();
    let file = file(&arrangement);
    let mut oracle = OwnCut::new(&effective).oracle;
    let strategies = [Strategy::TopDown, Strategy::Front, Strategy::Event];
    let mut engines = strategies.map(|strategy| {
        let tree = XfmTree::new(file.clone(), reading(Io::Blocking)).unwrap();
        Engine::new(tree, ActiveMesh::new(), settings(&log.mesh, strategy)).unwrap()
    });
    let mut random = seeded(8);
    let mut view = random_view(&mut random).with_k(300.0).unwrap();
    let (mut forced, mut changes) = (0, 0);
    let mut stack = Vec::new();
    for frame in 0..frames {
        random_step(&mut view, &mut random);
        let views = [placed(&log.mesh, view)];
        let mut active = oracle.cut(engines[0].settings().criterion, &views).to_vec();
        stack.extend((0..active.len()).filter(|&n| active[n]));
        while let Some(n) = stack.pop() {
            for &m in needs[n].iter().chain(Some(&forest.parent[n]).filter(|&&p| p != NONE)) {
                if !std::mem::replace(&mut active[m as usize], true) {
                    stack.push(m as usize);
                }
            }
        }
        let numbers = (0..active.len() as u32).filter(|&n| active[n as usize]);
        let expected = (numbers.clone().map(mix).fold(0, u64::wrapping_add), numbers.count() as u64);
        for engine in &mut engines {
            let report = engine.advance(&views).unwrap();
            let name = engine.settings().strategy.name();
            assert_eq!((report.cut_hash, report.active_nodes), expected, "{name}, frame {frame}");
            (forced, changes) = (forced + report.forced, changes + report.unfolds);
            if frame % 50 == 0 {
                engine.assert_well_formed();
                assert_closed(engine.sink());
            }
        }
    }
    eprintln!("{forced} of {changes} unfolds were forced");
    assert!(forced > 100 && changes > 10_000);
}

/// A store that fails, brings damaged pages and is late, and quotas on top: nothing wrong is shown, and when the store
/// has recovered the cut is what it should be.
pub fn a_bad_store_delays_and_no_more(log: &CollapseLog) {
    let arrangement = Arrangement::new(log, &options(true, true)).unwrap();
    let mut bytes = Vec::new();
    arrangement.write_to(&mut bytes).unwrap();
    let mut cut = OwnCut::new(&arrangement.effective_log());
    for (seed, how) in [(1, Io::Background), (2, Io::Blocking)] {
        let source = Arc::new(Faulty::new(MemorySource::new("m", bytes.clone()), seed, Faults::default()));
        let file = Arc::new(XfmFile::open(source.clone()).unwrap());
        let all = file.resident_bytes_of_all();
        let mut tree = XfmTree::new(file, reading(how)).unwrap();
        tree.set_quotas(all / 20, u64::MAX);
        let settings = settings(&log.mesh, Strategy::Event);
        let mut engine = Engine::new(tree, ActiveMesh::new(), settings).unwrap();
        let mut random = seeded(seed);
        let mut view = random_view(&mut random).with_k(300.0).unwrap();
        let delay = Duration::from_micros(100);
        let mut faults = 0;
        for round in 0..20 {
            source.set(Faults { errors: 100, short: 100, flips: 100, delays: 20, delay });
            for _ in 0..60 {
                random_step(&mut view, &mut random);
                faults += engine.advance(&[placed(&log.mesh, view)]).unwrap().pages.faults;
            }
            engine.assert_well_formed();
            source.set(Faults::default());
            engine.tree_mut().settle().unwrap();
            let report = advance_settled(&mut engine, &[placed(&log.mesh, view)]);
            let found = (report.cut_hash, report.active_nodes, report.displayed);
            assert_eq!(found, cut.find(&settings, engine.views()), "round {round}");
        }
        eprintln!("{faults} faults counted, {} befallen, {:?}", source.befallen(), engine.tree().counts());
        assert!(source.befallen() > 200 && faults > 200);
    }
}
