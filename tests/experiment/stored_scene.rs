//! Scene files whose objects are of any backend: replayed, checked against brute force, and damaged.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::common::graph_cut::GraphCut;
use crate::common::{bumpy_grid, data, direction, random_step, random_view, seeded};
use detail_block::Arrangement;
use foldfront::CollapseLog;
use foldfront::construction::mesh_io;
use foldfront::experiment::store::{self, Backend, BuildOptions, Store};
use foldfront::experiment::stored_scene::{ScenePaging, StoredScene, StoredSceneError};
use foldfront::page_store::Simulated;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::{FrameReport, Settings};
use foldfront::selection::objects::Placement;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::Prefetch;
use glam::{DQuat, DVec3};
use mt_partition::{Memory, Reader};

use crate::workplace::Workplace;
use rand::RngExt;
use rand_pcg::Pcg64;

const EXACT: [Strategy; 3] = [Strategy::TopDown, Strategy::Front, Strategy::Event];

/// The twelve numbers of a random place.
fn matrix(random: &mut Pcg64, spread: f64) -> String {
    let scale = random.random_range(0.2..2.2);
    let rotation = DQuat::from_axis_angle(direction(random), random.random_range(0.0..6.0));
    let t = spread * direction(random) * random.random::<f64>();
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| rotation * (scale * axis));
    let rows = [x.x, y.x, z.x, t.x, x.y, y.y, z.y, t.y, x.z, y.z, z.z, t.z];
    rows.map(|x| x.to_string()).join(" ")
}

/// A walk through the middle of a scene.
fn walk(random: &mut Pcg64, frames: usize) -> Vec<View> {
    let mut view = random_view(random).with_k(150.0).unwrap();
    let next = |_| {
        random_step(&mut view, random);
        view.with_eye(2.0 * view.eye()).unwrap()
    };
    (0..frames).map(next).collect()
}

/// The cut of one file by brute force, from the log that its nodes stand for or from the nodes themselves: nothing here is
/// shared with an engine.
enum Cut {
    Log(Box<Oracle>),
    Graph(Box<GraphCut>),
}

impl Cut {
    fn new(store: &Store, log: &CollapseLog) -> Self {
        let oracle = |log: &CollapseLog| Self::Log(Box::new(Oracle::new(log).unwrap()));
        match store {
            Store::InMemory(..) | Store::MetaNode(_) => oracle(log),
            Store::DetailBlock(_) => {
                let arrangement = Arrangement::new(log, &detail_block::BuildOptions::default());
                oracle(&arrangement.unwrap().effective_log())
            }
            Store::MtPartition(file) => Self::Graph(Box::new(GraphCut::new(file))),
        }
    }

    /// Its hash and size.
    fn find(&mut self, views: &[View]) -> (u64, u64) {
        match self {
            Self::Log(oracle) => {
                oracle.cut(Criterion::ScreenError, views);
                (oracle.cut_hash(), oracle.active_nodes() as u64)
            }
            Self::Graph(cut) => {
                let (hash, nodes, _) = cut.find(Criterion::ScreenError, views);
                (hash, nodes)
            }
        }
    }
}

/// Files of every backend, and a mesh; from two logs, so that the numbers of one are none of the other's.
fn write_files(folder: &Path) -> Vec<(&'static str, CollapseLog)> {
    let mut random = seeded(21);
    let logs = [24, 17].map(|side| data::log(bumpy_grid(side, &mut random)));
    let options =
        BuildOptions { levels: Some(2), patch: Some(4.0), partition: Some(6), ..BuildOptions::default() };
    let names = ["grid.log", "grid.meta", "grid.xfm", "grid.mt"];
    let mut files = Vec::new();
    for (at, (name, backend)) in names.into_iter().zip(Backend::ALL).enumerate() {
        let log = &logs[at % 2];
        // Levels mean something else to detail blocks.
        let options =
            BuildOptions { levels: options.levels.filter(|_| backend == Backend::MetaNode), ..options };
        store::write(backend, &folder.join(name), log, &options).unwrap();
        files.push((name, log.clone()));
    }
    mesh_io::write_ply(&folder.join("grid.ply"), &logs[0].mesh, None).unwrap();
    let read = mesh_io::read(&[folder.join("grid.ply")], &mut |_, _| ()).unwrap();
    files.push(("grid.ply", data::log(read)));
    files
}

fn scene_of(folder: &Path, names: &[&str], objects: usize, random: &mut Pcg64) -> StoredScene {
    let line = |i: usize| format!("{} {}\n", names[i % names.len()], matrix(random, 8.0));
    let file = folder.join("all.scene");
    std::fs::write(&file, (0..objects).map(line).collect::<String>()).unwrap();
    StoredScene::open(&file).unwrap()
}

/// Hash and nodes that the scene should have.
fn expected(scene: &StoredScene, cuts: &mut [Cut], view: &View) -> (u64, u64) {
    let (mut hash, mut nodes) = (0_u64, 0);
    for (number, object) in (0_u64..).zip(scene.objects()) {
        let own = object.placement.view(view).unwrap();
        let (of_object, count) = cuts[object.file].find(&[own]);
        hash = hash.wrapping_add(of_object.wrapping_mul(2 * number + 1));
        nodes += count;
    }
    (hash, nodes)
}

fn settings(strategy: Strategy) -> Settings {
    Settings { strategy, rho: 0.05, ..Settings::default() }
}

fn replay(
    scene: &StoredScene,
    views: &[View],
    strategy: Strategy,
    paging: &ScenePaging,
    frame: Option<Duration>,
) -> Vec<FrameReport> {
    let mut reports = Vec::new();
    let after = |at: usize, objects: &mut foldfront::experiment::stored_scene::StoredObjects, report| {
        if at.is_multiple_of(10) {
            objects.assert_well_formed();
        }
        reports.push(report);
        std::ops::ControlFlow::Continue(())
    };
    scene.replay(views, settings(strategy), paging, frame, after).unwrap();
    reports
}

fn limited(bytes: u64, prefetch: Prefetch) -> ScenePaging {
    let mut paging = ScenePaging::default();
    paging.meta_node = meta_node::Settings { page_memory: bytes, prefetch, ..paging.meta_node };
    paging.detail_block = detail_block::Settings { prefetch, ..paging.detail_block };
    paging.mt_partition =
        mt_partition::Settings { memory: Memory::new(bytes), prefetch, ..paging.mt_partition };
    paging
}

/// Every strategy, every way to fetch ahead, plenty of memory and little: in every frame the cut of every object is that of
/// brute force.
#[test]
fn objects_of_all_backends_make_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let files = write_files(folder.path());
    let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    let mut random = seeded(22);
    let scene = scene_of(folder.path(), &names, 20, &mut random);
    assert_eq!((scene.files().len(), scene.objects().len(), scene.backend()), (5, 20, "several"));
    let mut cuts: Vec<Cut> =
        scene.files().iter().zip(&files).map(|(store, (_, log))| Cut::new(store, log)).collect();
    let views = walk(&mut random, 60);
    let expected: Vec<(u64, u64)> = views.iter().map(|view| expected(&scene, &mut cuts, view)).collect();
    let mut changes = 0;
    for strategy in EXACT {
        for prefetch in Prefetch::ALL {
            for bytes in [u64::MAX, scene.least_memory() * 2] {
                let what = format!("{}, {}, {bytes} bytes", strategy.name(), prefetch.name());
                let reports = replay(&scene, &views, strategy, &limited(bytes, prefetch), None);
                for (frame, (report, &(hash, nodes))) in reports.iter().zip(&expected).enumerate() {
                    assert_eq!(report.misses, 0, "{what}, frame {frame}");
                    assert_eq!(
                        (report.cut_hash, report.active_nodes),
                        (hash, nodes),
                        "{what}, frame {frame}"
                    );
                    changes += report.unfolds + report.folds;
                }
            }
        }
    }
    assert!(changes > 50_000, "{changes}");
}

/// A frame that waits misses nothing here either, and says how long it has waited on stores that are all slow.
#[test]
fn a_scene_waits_for_its_stores() {
    let folder = tempfile::tempdir().unwrap();
    let files = write_files(folder.path());
    let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    let mut random = seeded(23);
    let scene = scene_of(folder.path(), &names, 15, &mut random);
    let mut cuts: Vec<Cut> =
        scene.files().iter().zip(&files).map(|(store, (_, log))| Cut::new(store, log)).collect();
    let views = walk(&mut random, 60);
    let latency = Duration::from_millis(20);
    let store = Simulated::with_latency(latency);
    let frame = Some(Duration::from_millis(16));
    let paging = |waits| {
        let mut paging = limited(u64::MAX, Prefetch::None);
        paging.meta_node.io = meta_node::Io::Simulated(store);
        paging.detail_block.io = detail_block::Io::Simulated(store);
        paging.mt_partition.reader = Some(Reader::simulated(store));
        ScenePaging { waits, ..paging }
    };
    for strategy in EXACT {
        let waited = replay(&scene, &views, strategy, &paging(true), frame);
        let again = replay(&scene, &views, strategy, &paging(true), frame);
        for (at, ((report, again), view)) in waited.iter().zip(&again).zip(&views).enumerate() {
            let (hash, nodes) = expected(&scene, &mut cuts, view);
            assert_eq!((report.misses, report.cut_hash, report.active_nodes), (0, hash, nodes), "frame {at}");
            assert_eq!(report.pages, again.pages, "frame {at}: a replay differs");
            assert_eq!(report.pages.stalled > Duration::ZERO, report.pages.reads > 0, "frame {at}");
        }
        let stalled: Duration = waited[1..].iter().map(|report| report.pages.stalled).sum();
        assert!(stalled >= 10 * latency, "{stalled:?}");
        let late = replay(&scene, &views, strategy, &paging(false), frame);
        assert!(late[1..].iter().map(|report| report.misses).sum::<u64>() > 20);
        assert!(late.iter().all(|report| report.pages.stalled.is_zero()));
    }
}

/// A scene file of a hundred objects of two files is replayed with every strategy and too little memory for all: the budget of
/// multi-triangulations is one, and holds in every frame.
#[test]
fn a_hundred_multi_triangulations_share_a_budget() {
    let mut random = seeded(7);
    let folder = tempfile::tempdir().unwrap();
    let names = ["small.mt", "large.mt"];
    let logs = [12, 20].map(|side| data::log(bumpy_grid(side, &mut random)));
    for (name, log) in names.into_iter().zip(&logs) {
        let options = mt_partition::BuildOptions { patch: 4.0, ..Default::default() };
        mt_partition::write(&folder.path().join(name), log, &options).unwrap();
    }
    let scene = scene_of(folder.path(), &names, 100, &mut random);
    assert_eq!((scene.files().len(), scene.objects().len(), scene.backend()), (2, 100, "mt-partition"));
    let mut cuts: Vec<Cut> =
        scene.files().iter().zip(&logs).map(|(store, log)| Cut::new(store, log)).collect();
    let views = walk(&mut random, 40);
    let memory = Memory::new(scene.least_memory().max(60_000));
    let mut paging = ScenePaging::default();
    paging.mt_partition.memory = memory.clone();
    for strategy in EXACT {
        let reports = replay(&scene, &views, strategy, &paging, None);
        assert_eq!(memory.used(), 0, "all is given back");
        for (frame, (report, view)) in reports.iter().zip(&views).enumerate() {
            let (hash, nodes) = expected(&scene, &mut cuts, view);
            assert_eq!(
                (report.misses, report.cut_hash, report.active_nodes),
                (0, hash, nodes),
                "frame {frame}"
            );
            assert!(report.pages.resident_bytes <= memory.limit(), "frame {frame}");
        }
        assert!(reports.iter().map(|report| report.unfolds + report.folds).sum::<u64>() > 500);
    }
}

/// What is wrong with a file is said with the scene and the line that name it.
#[test]
fn a_scene_says_which_line_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let files = write_files(folder.path());
    let scene = folder.path().join("broken.scene");
    let unit = "1 0 0 0 0 1 0 0 0 0 1 0";
    let wrong = |name: &str| {
        std::fs::write(&scene, format!("# one is wrong\ngrid.mt {unit}\n{name} {unit}\n")).unwrap();
        let error = StoredScene::open(&scene).map(drop).unwrap_err();
        let line = error.to_string();
        assert!(line.contains(&format!("{}: line 3: ", scene.display())), "{line}");
        assert_eq!(line.matches(&*folder.path().join(name).to_string_lossy()).count(), 1, "{line}");
        error
    };
    assert!(matches!(wrong("absent.mt"), StoredSceneError::File { .. }));
    for (name, _) in &files {
        let bytes = std::fs::read(folder.path().join(name)).unwrap();
        std::fs::write(folder.path().join("half.ply"), &bytes[..bytes.len() / 2]).unwrap();
        let error = wrong("half.ply");
        match &error {
            StoredSceneError::File { at, .. } | StoredSceneError::Mesh { at, .. } => assert_eq!(at.line, 3),
            _ => panic!("{name}: {error:?}"),
        }
    }
    std::fs::write(folder.path().join("text.mt"), "no hierarchy, and not a mesh either").unwrap();
    assert!(matches!(wrong("text.mt"), StoredSceneError::Mesh { .. }));
    // Too little memory is the first object's that has not enough.
    std::fs::write(&scene, format!("\ngrid.log {unit}\ngrid.meta {unit}\ngrid.mt {unit}\n")).unwrap();
    let opened = StoredScene::open(&scene).unwrap();
    let least = opened.least_memory();
    let trees = |bytes| opened.trees(settings(Strategy::Event), &limited(bytes, Prefetch::None)).map(drop);
    assert!(trees(least).is_ok(), "{least}");
    let line = trees(least / 8).unwrap_err().to_string();
    assert!(line.contains("broken.scene: line 3: ") && line.contains("grid.meta"), "{line}");
}

/// Through the command line: all kinds in one scene, checked, whatever loads the pages.
#[test]
fn the_command_line_replays_all_kinds() {
    let place = Workplace::new();
    let mut scene = String::from("# one of each\n");
    for (i, backend) in Backend::ALL.into_iter().enumerate() {
        let name = backend.name();
        place.succeed(&format!(
            "build grid.ply --backend {name} --levels 3 --partition 6 --patch 4 -o grid.{name}"
        ));
        scene += &format!("grid.{name} 1 0 0 {} 0 1 0 0 0 0 1 0\n", i as f64 - 2.0);
    }
    scene += "grid.ply 1 0 0 2 0 1 0 0 0 0 1 0\n";
    place.write("all.scene", &scene);
    let compare = "compare all.scene --path descent.path --pixels 5 --strategy top-down,front,event --check";
    place.succeed(&format!("{compare} --out settled"));
    place.succeed(&format!("{compare} --out timed --fps 60 --prefetch blocking,none,paper,schedule"));
    place.succeed(&format!("{compare} --out small --page-memory 200K"));
    let rows = |folder: &str| -> Vec<Vec<String>> {
        let text = place.text(&format!("{folder}/frames.csv"));
        text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
    };
    let settled = rows("settled");
    assert_eq!(settled.len(), 3 * 3);
    for row in settled.iter().chain(&rows("small")) {
        assert_eq!([&row[0], &row[2], &row[14], &row[15]], ["all", "several", "0", "0"], "{row:?}");
        let same = settled.iter().find(|other| other[5] == row[5]).unwrap();
        assert_eq!(row[22], same[22], "{row:?}");
    }
    let timed = rows("timed");
    assert_eq!(timed.len(), 4 * 3 * 3);
    for row in timed.iter().filter(|row| row[4] == "blocking") {
        let same = settled.iter().find(|other| other[5] == row[5]).unwrap();
        assert_eq!((&row[14], &row[15], &row[22]), (&"0".to_owned(), &"0".to_owned(), &same[22]), "{row:?}");
    }

    place.fail(
        "compare all.scene --path descent.path --backend meta-node",
        1,
        &["all.scene", "line 2", "in-memory"],
    );
    place.fail("compare all.scene --path descent.path --prefetch printed", 2, &["printed", "meta-node"]);
    // Two buildings a stone's throw apart are one where that is asked for, in a scene as elsewhere.
    let house = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 3 0 0\nv 4 0 0\nv 3 1 0\nv 3 0 1\n";
    let faces: String = [0, 4]
        .map(|at| {
            format!(
                "f {0} {2} {1}\nf {0} {1} {3}\nf {1} {2} {3}\nf {2} {0} {3}\n",
                at + 1,
                at + 2,
                at + 3,
                at + 4
            )
        })
        .concat();
    place.write("houses.obj", format!("{house}{faces}"));
    place.write("houses.scene", "houses.obj 1 0 0 0 0 1 0 0 0 0 1 0\n");
    let coarsest = |joined: &str| {
        place.succeed(&format!(
            "compare houses.scene --path descent.path --frames 0..1 --pixels 2000 --strategy event {joined} --out houses"
        ));
        rows("houses")[0][18].clone()
    };
    assert_ne!(coarsest(""), coarsest("--merge-components"));
    place.write("meta.scene", "grid.meta-node 1 0 0 0 0 1 0 0 0 0 1 0\n");
    place.succeed(
        "compare meta.scene --path descent.path --backend meta-node --prefetch printed --check --out printed",
    );

    // A page that is damaged is only seen when it is read.
    for name in ["detail-block", "meta-node", "mt-partition", "in-memory"] {
        let whole = place.read(&format!("grid.{name}"));
        place.write(&format!("cut.{name}"), &whole[..whole.len() - 40]);
        place.write(
            "cut.scene",
            format!("grid.ply 1 0 0 0 0 1 0 0 0 0 1 0\ncut.{name} 1 0 0 0 0 1 0 0 0 0 1 0\n"),
        );
        let said = ["cut.scene", "line 2", &format!("cut.{name}")];
        place.fail("compare cut.scene --path descent.path", 1, &said);
    }
    let whole = place.read("grid.detail-block");
    let mut damaged = whole.clone();
    let last = damaged.len() - 9;
    damaged[last] ^= 16;
    place.write("damaged.detail-block", damaged);
    place.write(
        "damaged.scene",
        "grid.ply 1 0 0 0 0 1 0 0 0 0 1 0\n\ndamaged.detail-block 1 0 0 0 0 1 0 0 0 0 1 0\n",
    );
    let said = ["damaged.scene", "line 3", "damaged.detail-block"];
    place.fail("compare damaged.scene --path descent.path --pixels 0.01", 1, &said);
}

/// What is placed where is as the file says.
#[test]
fn objects_are_where_their_lines_put_them() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    let file = folder.path().join("two.scene");
    std::fs::write(&file, "grid.xfm 1 0 0 0 0 1 0 0 0 0 1 0\n# a line\ngrid.xfm 2 0 0 5 0 2 0 0 0 0 2 0\n")
        .unwrap();
    let scene = StoredScene::open(&file).unwrap();
    assert_eq!((scene.files().len(), scene.backend()), (1, "detail-block"));
    let [a, b] = scene.objects() else { panic!("two objects") };
    assert_eq!((a.placement, a.at.line, b.at.line), (Placement::IDENTITY, 1, 3));
    assert_eq!((b.placement.scale, b.placement.translation), (2.0, DVec3::new(5.0, 0.0, 0.0)));
    assert!(Arc::ptr_eq(
        match &scene.files()[a.file] {
            Store::DetailBlock(file) => file,
            _ => panic!("detail blocks"),
        },
        match &scene.files()[b.file] {
            Store::DetailBlock(file) => file,
            _ => panic!("detail blocks"),
        }
    ));
}
