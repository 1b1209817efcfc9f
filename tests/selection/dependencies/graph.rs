//! A backend that does everything the trait allows and the in-memory tree does not: several structural parents, further
//! dependencies, pages that are not there, and a store that fails.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::Rc;

use crate::common::{direction, seeded};
use foldfront::Bounds;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{Hierarchy, MeshSink, NodeId, PageStats, Step, TreeError, VertexTree};
use glam::DVec3;
use rand::RngExt;
use rand_pcg::Pcg64;

/// What depends on what. Every prerequisite of a node has a smaller number.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    pub bounds: Vec<Bounds>,
    pub parents: Vec<Vec<NodeId>>,
    pub children: Vec<Vec<NodeId>>,
    /// Prerequisites beyond structure.
    pub needs: Vec<Vec<NodeId>>,
    pub needed_by: Vec<Vec<NodeId>>,
    pub roots: Vec<NodeId>,
}

/// What a random graph is like.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub nodes: usize,
    /// Most structural parents of a node.
    pub parents: usize,
    /// Nodes with further prerequisites, in percent.
    pub needing: usize,
}

impl Graph {
    pub fn random(shape: Shape, random: &mut Pcg64) -> Self {
        let Shape { nodes, parents, needing } = shape;
        let mut graph = Self {
            parents: vec![Vec::new(); nodes],
            children: vec![Vec::new(); nodes],
            needs: vec![Vec::new(); nodes],
            needed_by: vec![Vec::new(); nodes],
            ..Self::default()
        };
        for n in 0..nodes {
            if n < 3 {
                graph.roots.push(NodeId(n as u32));
                continue;
            }
            // Near in number, so that the graph is deep; now and then from far up, so that some nodes have many
            // children.
            let mut above: Vec<usize> = (0..=random.random_range(0..parents))
                .map(|_| {
                    let lowest = if random.random_ratio(1, 4) { 0 } else { n.saturating_sub(40) };
                    lowest + random.random_range(0..n - lowest)
                })
                .collect();
            above.sort_unstable();
            above.dedup();
            for p in above {
                graph.parents[n].push(NodeId(p as u32));
                graph.children[p].push(NodeId(n as u32));
            }
            if random.random_range(0..100) < needing {
                for _ in 0..=random.random_range(0..3) {
                    // Anywhere, or next to it, where two parents of one node may need each other.
                    let lowest = if random.random() { 0 } else { n.saturating_sub(8) };
                    let needed = lowest + random.random_range(0..n - lowest);
                    graph.needs[n].push(NodeId(needed as u32));
                    graph.needed_by[needed].push(NodeId(n as u32));
                }
            }
        }
        graph.bounds = vec![Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 }; nodes];
        for n in (0..nodes).rev() {
            // Small and anywhere at the bottom, and around everything below further up.
            let center = 0.9 * direction(random) * random.random::<f64>();
            let eps = (random.random_range(0.0..0.004) * random.random::<f64>()) as f32;
            let own = Bounds { center: center.as_vec3().to_array(), radius: 0.02, eps };
            let below = graph.children[n].iter().map(|c| graph.bounds[c.index()]);
            graph.bounds[n] = below.fold(own, around);
        }
        graph
    }

    /// The closure of what the views want under all prerequisites, by brute force.
    pub fn cut(&self, criterion: Criterion, views: &[View]) -> Vec<bool> {
        let mut active: Vec<bool> = self.bounds.iter().map(|b| criterion.unfold(views, b)).collect();
        // Prerequisites have smaller numbers: one pass from the end carries a flag all the way.
        for n in (0..active.len()).rev().filter(|&n| active[n]).collect::<Vec<_>>() {
            self.activate(n, &mut active);
        }
        active
    }

    fn activate(&self, n: usize, active: &mut [bool]) {
        let mut stack = vec![n];
        while let Some(n) = stack.pop() {
            active[n] = true;
            let prerequisites = self.parents[n].iter().chain(&self.needs[n]);
            stack.extend(prerequisites.map(|p| p.index()).filter(|&p| !active[p]));
        }
    }
}

/// A sphere around two, with the room that construction leaves.
fn around(a: Bounds, b: Bounds) -> Bounds {
    let center = |s: Bounds| DVec3::from(s.center.map(f64::from));
    let middle = (center(a) + center(b)) / 2.0;
    let center_of_both = middle.as_vec3().to_array();
    let middle = DVec3::from(center_of_both.map(f64::from));
    let reach = |s: Bounds| center(s).distance(middle) + f64::from(s.radius);
    let radius = (reach(a).max(reach(b)) * (1.0 + 1e-6)) as f32;
    Bounds { center: center_of_both, radius, eps: a.eps.max(b.eps) }
}

/// When the store refuses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paging {
    /// Nodes that are not there when they are asked for the first time in a while, in percent.
    pub missing: usize,
    /// The longest that a page takes to come, in frames.
    pub latency: usize,
}

/// Where a failing store fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    Begin,
    Change,
    End,
}

/// What the store does and has seen; shared with the test.
#[derive(Debug, Default)]
pub struct Log {
    pub active: Vec<bool>,
    /// Nodes refused for want of a page, in this frame or before, until it comes or is not waited for any more.
    pub refused: BTreeSet<u32>,
    /// Refusals of all frames, each node once a frame for as long as it is waited for.
    pub refusals: u64,
    /// How often a node was asked for again that is waited for.
    pub in_vain: u64,
    /// Steps that something else was needed for.
    pub still_needed: u64,
    pub named: u64,
    /// Fail at this call when the count comes down to 0.
    pub fail: Option<(Call, usize)>,
}

/// The backend.
pub struct GraphTree {
    graph: Rc<Graph>,
    pub log: Rc<RefCell<Log>>,
    paging: Option<Paging>,
    random: Pcg64,
    frame: u64,
    /// For each node, until which frame it is there, and when it comes if it has been asked for.
    resident_until: Vec<u64>,
    arriving: Vec<Option<u64>>,
    /// Nodes that [`Step::Needs`] has named, and what is above those: these may be asked about as well.
    named: Vec<bool>,
}

/// Frames that a page stays.
const STAYS: u64 = 30;

impl GraphTree {
    pub fn new(graph: Rc<Graph>, paging: Option<Paging>) -> Self {
        let nodes = graph.bounds.len();
        let log = Log { active: vec![false; nodes], ..Log::default() };
        Self {
            graph,
            log: Rc::new(RefCell::new(log)),
            paging,
            random: seeded(77),
            frame: 0,
            resident_until: vec![0; nodes],
            arriving: vec![None; nodes],
            named: vec![false; nodes],
        }
    }

    fn is_active(&self, node: NodeId) -> bool {
        self.log.borrow().active[node.index()]
    }

    fn is_in_play(&self, node: NodeId) -> bool {
        self.graph.parents[node.index()].iter().all(|&p| self.is_active(p))
    }

    /// What may be asked about: see the trait's section on residency.
    fn may_be_asked(&self, node: NodeId) -> bool {
        let below_active = || self.graph.parents[node.index()].iter().any(|&p| self.is_active(p));
        self.named[node.index()] || self.is_in_play(node) || below_active()
    }

    fn name(&mut self, node: NodeId) {
        let mut stack = vec![node];
        while let Some(node) = stack.pop() {
            if !std::mem::replace(&mut self.named[node.index()], true) {
                stack.extend(&self.graph.parents[node.index()]);
            }
        }
    }

    /// Whether a node's page is there; asks for it if it is not.
    fn is_resident(&mut self, node: NodeId) -> bool {
        let Some(Paging { missing, latency }) = self.paging else { return true };
        let n = node.index();
        if self.resident_until[n] >= self.frame {
            return true;
        }
        if self.arriving[n].is_none() {
            if self.random.random_range(0..100) >= missing {
                self.resident_until[n] = self.frame + STAYS;
                return true;
            }
            self.arriving[n] = Some(self.frame + 1 + self.random.random_range(0..latency) as u64);
        }
        let mut log = self.log.borrow_mut();
        log.in_vain += u64::from(!log.refused.insert(node.0));
        false
    }

    fn may_fail(&self, call: Call) -> Result<(), TreeError> {
        let mut log = self.log.borrow_mut();
        match &mut log.fail {
            Some((at, left)) if *at == call => {
                if *left == 0 {
                    log.fail = None;
                    return Err(TreeError::Damaged { file: "graph".into(), offset: 0, reason: "on purpose" });
                }
                *left -= 1;
            }
            _ => {}
        }
        Ok(())
    }
}

impl Hierarchy for GraphTree {
    fn node_limit(&self) -> u32 {
        self.graph.bounds.len() as u32
    }

    fn displayed(&self) -> u64 {
        self.log.borrow().active.iter().filter(|&&active| active).count() as u64
    }

    fn roots(&self) -> &[NodeId] {
        &self.graph.roots
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        assert!(self.may_be_asked(node), "bounds of {node:?}, which is not in play");
        self.graph.bounds[node.index()]
    }

    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        assert!(self.is_in_play(node), "children of {node:?}, which is not in play");
        self.graph.children[node.index()].iter().copied()
    }

    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        assert!(self.may_be_asked(node), "parents of {node:?}, which is not in play");
        self.graph.parents[node.index()].iter().copied()
    }

    fn log_number(&self, node: NodeId) -> u32 {
        self.node_limit() - 1 - node.0
    }

    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        let below = &self.graph.children[node.index()];
        children.extend(below.iter().map(|&child| (child, self.graph.bounds[child.index()])));
        true
    }

    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        self.frame += 1;
        self.may_fail(Call::Begin)?;
        for (n, arriving) in self.arriving.iter_mut().enumerate() {
            if arriving.is_some_and(|at| at <= self.frame) {
                *arriving = None;
                self.resident_until[n] = self.frame + STAYS;
                self.log.borrow_mut().refused.remove(&(n as u32));
                arrived.push(NodeId(n as u32));
            }
        }
        Ok(())
    }

    fn give_up(&mut self, node: NodeId) {
        self.log.borrow_mut().refused.remove(&node.0);
    }

    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        let refused = self.log.borrow().refused.len() as u64;
        self.log.borrow_mut().refusals += refused;
        self.may_fail(Call::End)?;
        Ok(PageStats::default())
    }
}

impl VertexTree for GraphTree {
    fn base_mesh<M: MeshSink>(&mut self, _: &mut M) -> Result<(), TreeError> {
        Ok(())
    }

    fn unfold<M: MeshSink>(&mut self, node: NodeId, _: &mut M) -> Result<Step, TreeError> {
        assert!(self.is_in_play(node) && !self.is_active(node), "{node:?} is no boundary node");
        self.may_fail(Call::Change)?;
        if !self.is_resident(node) {
            return Ok(Step::NotResident);
        }
        let needed = self.graph.needs[node.index()].iter().copied().find(|&q| !self.is_active(q));
        if let Some(needed) = needed {
            self.name(needed);
            self.log.borrow_mut().named += 1;
            return Ok(Step::Needs(needed));
        }
        self.log.borrow_mut().active[node.index()] = true;
        Ok(Step::Done)
    }

    fn fold<M: MeshSink>(&mut self, node: NodeId, _: &mut M) -> Result<Step, TreeError> {
        let folded = self.graph.children[node.index()].iter().all(|&c| !self.is_active(c));
        assert!(folded && self.is_active(node), "{node:?} is not collapsible");
        self.may_fail(Call::Change)?;
        if self.graph.needed_by[node.index()].iter().any(|&n| self.is_active(n)) {
            self.log.borrow_mut().still_needed += 1;
            return Ok(Step::StillNeeded);
        }
        if !self.is_resident(node) {
            return Ok(Step::NotResident);
        }
        self.log.borrow_mut().active[node.index()] = false;
        Ok(Step::Done)
    }
}
