//! What the test files share: random logs and files of meta-nodes in memory.
#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]
#![allow(dead_code)]

use std::sync::Arc;

use crate::{BuildOptions, MetaNodeError, MetaNodeFile, MetaNodeTree};
use collapse_log::{Collapse, CollapseLog, Mesh};
use page_store::source::MemorySource;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use vertex_tree::{Bounds, Hierarchy, NodeId, NullSink, Step, VertexTree};

/// A grid of `side * side` vertices, simplified at random to `left` vertices: spheres and errors are nested, and nothing
/// else is good about it.
pub fn random_log(side: usize, left: usize, seed: u64) -> CollapseLog {
    let mut random = Pcg64::seed_from_u64(seed);
    log_of(side, left, |limit| random.random_range(0..limit))
}

/// The same of any numbers below a limit.
pub fn log_of(side: usize, left: usize, mut below: impl FnMut(usize) -> usize) -> CollapseLog {
    let mut mesh = Mesh::default();
    let v = |x: usize, y: usize| (y * side + x) as u32;
    for y in 0..side {
        for x in 0..side {
            mesh.positions.push([x as f32, y as f32, below(100) as f32 / 100.0]);
        }
    }
    for y in 1..side {
        for x in 1..side {
            mesh.triangles.push([v(x - 1, y - 1), v(x, y - 1), v(x, y)]);
            mesh.triangles.push([v(x - 1, y - 1), v(x, y), v(x - 1, y)]);
        }
    }
    let leaf = |position: &[f32; 3]| Bounds { center: *position, radius: 2.0, eps: 0.0 };
    let mut top: Vec<Bounds> = mesh.positions.iter().map(leaf).collect();
    let mut live: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut collapses = Vec::new();
    while live.len() > left {
        let removed = live.swap_remove(below(live.len()));
        // Near in number is often near in space.
        let kept = *live.iter().min_by_key(|&&v| v.abs_diff(removed) as usize * 4 + below(64)).unwrap();
        let (a, b) = (top[removed as usize], top[kept as usize]);
        let distance = (0..3).map(|i| (a.center[i] - b.center[i]).powi(2)).sum::<f32>().sqrt();
        let eps = a.eps.max(b.eps) + below(10) as f32;
        let bounds = Bounds { center: b.center, radius: (b.radius.max(distance + a.radius)) * 1.001, eps };
        top[kept as usize] = bounds;
        collapses.push(Collapse { removed, kept, bounds });
    }
    CollapseLog { mesh, collapses }
}

pub fn bytes(log: &CollapseLog, options: &BuildOptions) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree");
    let report = crate::write(&path, log, options).unwrap();
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(report.bytes, bytes.len() as u64);
    bytes
}

pub fn open(bytes: impl Into<Arc<[u8]>>) -> Result<MetaNodeFile, MetaNodeError> {
    MetaNodeFile::open(Arc::new(MemorySource::new("tree", bytes)))
}

/// A front, as an engine keeps it: which nodes are active, and which can change.
pub struct Front {
    pub active: Vec<NodeId>,
    pub boundary: Vec<NodeId>,
}

impl Front {
    pub fn new(tree: &MetaNodeTree) -> Self {
        Self { active: Vec::new(), boundary: tree.roots().to_vec() }
    }

    /// Tries to unfold every boundary node once. Says how many did, and how many were refused.
    pub fn unfold(&mut self, tree: &mut MetaNodeTree) -> (usize, usize) {
        let (mut done, mut refused) = (0, 0);
        for node in std::mem::take(&mut self.boundary) {
            match tree.unfold(node, &mut NullSink).unwrap() {
                Step::Done => {
                    done += 1;
                    self.active.push(node);
                    self.boundary.extend(tree.children(node));
                }
                Step::NotResident => {
                    refused += 1;
                    self.boundary.push(node);
                }
                step => panic!("{step:?}"),
            }
        }
        (done, refused)
    }

    /// Tries to fold nodes, the last unfolded first, until one is refused.
    pub fn fold(&mut self, tree: &mut MetaNodeTree) -> usize {
        let mut done = 0;
        while let Some(&node) = self.active.last() {
            if tree.fold(node, &mut NullSink).unwrap() != Step::Done {
                break;
            }
            done += 1;
            self.active.pop();
            let children: Vec<NodeId> = tree.children(node).collect();
            self.boundary.retain(|node| !children.contains(node));
            self.boundary.push(node);
        }
        done
    }
}

pub fn frame<R>(
    tree: &mut MetaNodeTree,
    change: impl FnOnce(&mut MetaNodeTree) -> R,
) -> (R, vertex_tree::PageStats) {
    tree.begin_frame(&mut Vec::new()).unwrap();
    let changed = change(tree);
    (changed, tree.end_frame().unwrap())
}

pub fn holder_bytes(file: &MetaNodeFile) -> u64 {
    file.facts().iter().find(|(fact, _)| *fact == "largest page, bytes").unwrap().1.parse().unwrap()
}
