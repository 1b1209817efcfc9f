//! Every backend passes the test that is there for the backends of others.

use std::sync::Arc;

use ::detail_block::Arrangement;
use foldfront::CollapseLog;
use foldfront::experiment::compare::{Named, Options, Row, Subject, replay_any};
use foldfront::experiment::path::around;
use foldfront::experiment::store::{self, Backend, BuildOptions, TreeSettings};
use foldfront::selection::refine::Strategy;
use foldfront::testing::conformance::Totals;
use foldfront::testing::{conforms, conforms_with_mesh};
use in_memory::{InMemoryHierarchy, InMemoryTree};
use meta_node::MetaNodeTree;
use mt_partition::MtTree;

use crate::common::backends::meta_node_file;
use crate::common::quadtree::PointTree;
use crate::common::{data, detail_block, graph_cut, meshes, seeded};

fn scan() -> CollapseLog {
    data::log(meshes::scan(6, &mut seeded(1)))
}

fn is_worth_something(totals: Totals) {
    assert!(totals.nodes > 30 && totals.changes > 1_000, "{totals:?}");
}

#[test]
fn in_memory() {
    let hierarchy = Arc::new(InMemoryHierarchy::new(&scan()).unwrap());
    is_worth_something(conforms_with_mesh(|| InMemoryTree::new(hierarchy.clone())));
}

#[test]
fn meta_nodes() {
    let file = meta_node_file(&scan(), &meta_node::BuildOptions::default());
    let open = || MetaNodeTree::new(file.clone(), meta_node::Settings::default()).unwrap();
    is_worth_something(conforms_with_mesh(open));
}

#[test]
fn detail_blocks() {
    let arrangement = Arrangement::new(&scan(), &::detail_block::BuildOptions::default()).unwrap();
    let file = detail_block::file(&arrangement);
    let open = || ::detail_block::XfmTree::new(file.clone(), ::detail_block::Settings::default()).unwrap();
    is_worth_something(conforms_with_mesh(open));
}

#[test]
fn partitions() {
    let file = graph_cut::file(&scan(), &mt_partition::BuildOptions::default());
    let open = || MtTree::new(file.clone(), mt_partition::Settings::default()).unwrap();
    is_worth_something(conforms_with_mesh(open));
}

#[test]
fn points() {
    let positions = scan().mesh.positions;
    is_worth_something(conforms(|| PointTree::new(&positions)));
}

#[test]
fn a_backend_chosen_at_run_time() {
    let (log, folder) = (scan(), tempfile::tempdir().unwrap());
    for backend in Backend::ALL {
        let file = folder.path().join(backend.name());
        store::write(backend, &file, &log, &BuildOptions::default()).unwrap();
        is_worth_something(conforms_with_mesh(|| store::open(&file, &TreeSettings::default()).unwrap()));
    }
}

/// What `compare` says of a tree of whoever's is what it says of the same tree as one of its own.
#[test]
fn trees_of_others_are_compared_as_our_own() {
    let log = data::log(meshes::scan(8, &mut seeded(5)));
    let mut subject = Subject::new("scan", &log).unwrap();
    let path = around(&log.mesh).unwrap();
    let options = Options { strategies: Strategy::COMPARED.to_vec(), check: true, ..Options::default() };
    let own = subject.replay(&path, 0..80, &options, &mut |_, _| ()).unwrap();
    let hierarchy = Arc::new(InMemoryHierarchy::new(&log).unwrap());
    let named = Named { scene: "scan", backend: "of others", has_dependencies: false };
    let (mut calls, mut total) = (0, 0);
    let mut progress = |_, all| (calls, total) = (calls + 1, all);
    let open = || Ok(InMemoryTree::new(hierarchy.clone()));
    let others = replay_any(named, open, &path, 0..80, &options, &mut progress).unwrap();
    assert_eq!((calls, total), (2 * 4 * 80, 2 * 4 * 80));
    assert_eq!(own.len(), 4);
    for (own, other) in own.iter().zip(&others) {
        assert_eq!((own.strategy, other.backend), (other.strategy, "of others"));
        let what =
            |row: &Row| (row.frame, row.report.cut_hash, row.report.tests, row.report.displayed, row.wrong);
        let [own, other] = [own, other].map(|run| run.rows.iter().map(what).collect::<Vec<_>>());
        assert_eq!(own, other);
    }
}
