//! The brute-force cut of a multi-triangulation that has nodes of its own: every node is tested, and the cut is the
//! closure upwards of those that are wanted, over all parents.

use std::sync::Arc;

use foldfront::page_store::source::MemorySource;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::Engine;
use foldfront::selection::front::mix;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{NodeId, Refine};
use foldfront::{Bounds, CollapseLog};
use mt_partition::{BuildOptions, MtFile};

/// Writes a log to a file and opens it from memory.
pub fn file(log: &CollapseLog, options: &BuildOptions) -> Arc<MtFile> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.mt");
    mt_partition::write(&path, log, options).unwrap();
    let source = MemorySource::new("test.mt", std::fs::read(&path).unwrap());
    Arc::new(MtFile::open(Arc::new(source)).unwrap())
}

/// All nodes of a file, parents before their children.
#[derive(Clone, Debug)]
pub struct GraphCut {
    nodes: Vec<u32>,
    pub bounds: Vec<Bounds>,
    pub parents: Vec<Vec<NodeId>>,
    /// What each node's unfolding adds to the triangles displayed.
    gains: Vec<i64>,
    log_numbers: Vec<u32>,
    base: i64,
    pub active: Vec<bool>,
    /// What the last cut was found for, its hash, nodes and triangles.
    found: (Criterion, Vec<View>),
    totals: (u64, u64, u64),
}

impl GraphCut {
    pub fn new(file: &MtFile) -> Self {
        let stored: Vec<_> = (0..file.nodes()).map(|n| file.node(NodeId(n)).unwrap()).collect();
        let mut nodes: Vec<u32> = (0..file.nodes()).collect();
        nodes.sort_by_key(|&n| stored[n as usize].layer);
        Self {
            nodes,
            bounds: stored.iter().map(|n| n.bounds).collect(),
            gains: stored.iter().map(|n| i64::from(n.triangles[1]) - i64::from(n.triangles[0])).collect(),
            log_numbers: stored.iter().map(|n| n.log_number).collect(),
            active: vec![false; stored.len()],
            parents: stored.into_iter().map(|n| n.parents).collect(),
            base: file.base_triangles().into(),
            found: (Criterion::default(), Vec::new()),
            totals: (0, 0, file.base_triangles().into()),
        }
    }

    /// Finds the cut for these views, if it is not the last one; returns its hash, nodes and triangles.
    pub fn find(&mut self, criterion: Criterion, views: &[View]) -> (u64, u64, u64) {
        if self.found.0 == criterion && self.found.1 == views {
            return self.totals;
        }
        self.found = (criterion, views.to_vec());
        for (active, bounds) in self.active.iter_mut().zip(&self.bounds) {
            *active = criterion.unfold(views, bounds);
        }
        // Children come before their parents here: one pass carries a flag all the way up.
        let (mut hash, mut count, mut triangles) = (0_u64, 0, self.base);
        for &n in self.nodes.iter().rev() {
            if self.active[n as usize] {
                self.parents[n as usize].iter().for_each(|p| self.active[p.index()] = true);
                hash = hash.wrapping_add(mix(self.log_numbers[n as usize]));
                count += 1;
                triangles += self.gains[n as usize];
            }
        }
        self.totals = (hash, count, triangles as u64);
        self.totals
    }

    /// The first nodes that an engine has otherwise, with whether the cut has them active, and how many there are.
    pub fn difference<T: Refine<S>, S>(&self, engine: &Engine<T, S>) -> Option<(Vec<(usize, bool)>, usize)> {
        let mut differs = self.active.clone();
        engine.for_each_active(|node| differs[node.index()] = !differs[node.index()]);
        let nodes: Vec<usize> = (0..differs.len()).filter(|&n| differs[n]).collect();
        let first = nodes.iter().take(8).map(|&n| (n, self.active[n])).collect();
        (!nodes.is_empty()).then_some((first, nodes.len()))
    }
}
