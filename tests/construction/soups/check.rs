//! What must hold of any mesh whatever: its construction ends, its log keeps what a log promises, and every backend gives the
//! mesh back and follows the brute-force cut.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use foldfront::collapse_log::read_log;
use foldfront::construction::mesh_io::{MeshIoError, Receiver};
use foldfront::construction::simplify::{LEAST_MEMORY, Limits, Options, Report, build, build_within};
use foldfront::experiment::compare::Subject;
use foldfront::experiment::store::{self, Backend, BuildOptions, Store};
use foldfront::selection::criterion::Criterion;
use foldfront::selection::view::View;
use foldfront::{CollapseLog, Mesh};

use super::follow::{Facets, Truth, facets, follow, unfolded};
use crate::replay::Replay;

/// What does not hold.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The construction took more rounds than it may.
    Endless { rounds: usize, bound: usize },
    /// Anything else, in words.
    Wrong(String),
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Endless { rounds, bound } => write!(f, "{rounds} rounds, where {bound} are enough"),
            Self::Wrong(what) => f.write_str(what),
        }
    }
}

/// An error as a fault.
pub fn wrong(what: impl std::fmt::Display) -> Fault {
    Fault::Wrong(what.to_string())
}

/// A fault unless it holds.
pub fn ensure(holds: bool, what: impl FnOnce() -> String) -> Result<(), Fault> {
    if holds { Ok(()) } else { Err(Fault::Wrong(what())) }
}

/// Rounds that the construction of a soup may take: a bound by experience, which none of the first hundred thousand soups
/// reaches. What is certain by construction grows with the square of the number of vertices.
pub fn most_rounds(vertices: usize) -> usize {
    60 + 4 * vertices
}

pub fn options(merge_components: bool) -> Options {
    let mut options = Options::default();
    options.merge_components = merge_components;
    options
}

/// Builds the log of a mesh in no more than so many rounds.
pub fn log_within(mesh: &Mesh, merge: bool, bound: usize) -> Result<(CollapseLog, Report), Fault> {
    let (log, report) = build(mesh.clone(), &options(merge), &mut |_, _| ()).map_err(wrong)?;
    match report.attempted_rounds {
        rounds if rounds > bound => Err(Fault::Endless { rounds, bound }),
        _ => Ok((log, report)),
    }
}

/// Builds the log of a mesh and checks all that it promises, also of the cuts for these views.
pub fn construction(mesh: &Mesh, merge: bool, views: &[View]) -> Result<(CollapseLog, Report), Fault> {
    let (log, report) = log_within(mesh, merge, most_rounds(mesh.positions.len()))?;
    ensure(log.mesh == *mesh, || "the log is of another mesh".to_owned())?;
    let forest = log.forest().map_err(wrong)?;
    ensure(report.roots == forest.roots().count(), || "roots".to_owned())?;
    let shown = facets(mesh, mesh.triangles.iter().copied());
    ensure((report.base_triangles > 0) != shown.is_empty(), || "nothing is left to be seen".to_owned())?;
    held(|| {
        let replay = Replay::new(&log);
        assert_eq!(report.base_triangles, replay.base_triangles());
        replay.assert_nested();
        replay.assert_leaves_contained();
        for view in views {
            for criterion in [Criterion::ScreenError, Criterion::SphereSize] {
                let view = std::slice::from_ref(view);
                let active: Vec<bool> =
                    log.collapses.iter().map(|c| criterion.unfold(view, &c.bounds)).collect();
                replay.assert_closed(&active);
                replay.assert_consistent(&active);
            }
        }
    })?;
    Ok((log, report))
}

/// A fault where an assertion fails.
fn held(assertions: impl FnOnce()) -> Result<(), Fault> {
    catch_unwind(AssertUnwindSafe(assertions)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        wrong(text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("an assertion"))
    })
}

/// Builds the log piece by piece within the least memory, in `folder`: it must be the same.
pub fn same_within_little_memory(mesh: &Mesh, log: &CollapseLog, folder: &Path) -> Result<(), Fault> {
    let (file, stop) = (folder.join("within"), AtomicBool::new(false));
    let limits = Limits {
        memory: LEAST_MEMORY,
        temporary: folder.to_owned(),
        threads: 1,
        expected_triangles: 0,
        stop: &stop,
    };
    let send = |receiver: &mut dyn Receiver, _: &mut dyn FnMut(u64, u64)| {
        mesh.positions
            .iter()
            .try_for_each(|&p| receiver.position(p.map(f64::from)))
            .map_err(MeshIoError::Receiver)?;
        mesh.triangles.iter().try_for_each(|&t| receiver.triangle(t)).map_err(MeshIoError::Receiver)
    };
    build_within(send, &file, &options(false), &limits, &mut |_, _| ()).map_err(wrong)?;
    let within = read_log(&file).map_err(wrong)?;
    ensure(within == *log, || "another log within little memory".to_owned())
}

/// Writes the log for every backend into `folder`, opens it, and looks at what comes back unfolded, and for these views.
pub fn backends(log: &CollapseLog, folder: &Path, views: &[View]) -> Result<(), Fault> {
    let expected = facets(&log.mesh, log.mesh.triangles.iter().copied());
    Backend::ALL.into_iter().try_for_each(|backend| {
        one_backend(backend, log, &expected, folder, views).map_err(|fault| match fault {
            Fault::Wrong(what) => Fault::Wrong(format!("{}: {what}", backend.name())),
            endless @ Fault::Endless { .. } => endless,
        })
    })
}

fn one_backend(
    backend: Backend,
    log: &CollapseLog,
    expected: &Facets,
    folder: &Path,
    views: &[View],
) -> Result<(), Fault> {
    let file = folder.join(backend.name());
    store::write(backend, &file, log, &BuildOptions::default()).map_err(wrong)?;
    let store = Store::open(&file).map_err(wrong)?;
    store.verify().map_err(wrong)?;
    let finest = Subject::of_store("soup", store.clone()).finest().map_err(wrong)?;
    let same = |shown: Facets| {
        ensure(shown == *expected, || {
            format!("{} triangles in, {} other ones back", expected.len(), shown.len())
        })
    };
    same(facets(&finest, finest.triangles.iter().copied()))?;
    match store {
        Store::InMemory(hierarchy, _) => {
            use foldfront::in_memory::InMemoryTree;
            let open = || Ok(InMemoryTree::new(hierarchy.clone()));
            same(unfolded(open)?)?;
            follow(open, &mut Truth::log(log.clone())?, views)
        }
        Store::MetaNode(file) => {
            use meta_node::{MetaNodeTree, Settings};
            let open = || MetaNodeTree::new(file.clone(), Settings::default()).map_err(wrong);
            follow(open, &mut Truth::log(log.clone())?, views)
        }
        Store::DetailBlock(file) => {
            use detail_block::{Arrangement, BuildOptions, Settings, XfmTree};
            // Bounds, and where the mesh is not manifold, collapses, are the backend's own.
            let own = Arrangement::new(log, &BuildOptions::default()).map_err(wrong)?.effective_log();
            let open = || XfmTree::new(file.clone(), Settings::default()).map_err(wrong);
            follow(open, &mut Truth::log(own)?, views)
        }
        Store::MtPartition(file) => {
            use foldfront::mt_partition::{MtTree, Settings};
            let open = || MtTree::new(file.clone(), Settings::default()).map_err(wrong);
            follow(open, &mut Truth::nodes(open)?, views)
        }
    }
}
