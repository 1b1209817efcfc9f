//! Fronts through made-up trees and graphs, against what their structure says.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;

/// Nodes with any parents among those before them, as a tree or as a graph.
struct Made<const IS_TREE: bool> {
    parents: Vec<Vec<u32>>,
    children: Vec<Vec<u32>>,
    roots: Vec<NodeId>,
}

impl<const IS_TREE: bool> Made<IS_TREE> {
    fn new(parents: Vec<Vec<u32>>) -> Self {
        let mut children = vec![Vec::new(); parents.len()];
        for (node, parents) in (0..).zip(&parents) {
            parents.iter().for_each(|&parent| children[parent as usize].push(node));
        }
        let roots =
            (0..).zip(&parents).filter(|(_, parents)| parents.is_empty()).map(|(node, _)| NodeId(node));
        Self { roots: roots.collect(), parents, children }
    }

    /// With several roots, and nodes with none to half a dozen children.
    fn random(nodes: u32, random: &mut Pcg64Mcg) -> Self {
        let parents = (0..nodes).map(|node| {
            let count = if node < 5 {
                0
            } else if IS_TREE {
                1
            } else {
                random.random_range(1..4)
            };
            let mut parents: Vec<u32> = (0..count).map(|_| random.random_range(node / 3..node)).collect();
            let mut seen = BTreeSet::new();
            parents.retain(|&parent| seen.insert(parent));
            parents
        });
        Self::new(parents.collect())
    }
}

impl<const IS_TREE: bool> Hierarchy for Made<IS_TREE> {
    const IS_TREE: bool = IS_TREE;

    fn node_limit(&self) -> u32 {
        self.parents.len() as u32
    }

    fn displayed(&self) -> u64 {
        0
    }

    fn roots(&self) -> &[NodeId] {
        &self.roots
    }

    fn bounds(&self, NodeId(node): NodeId) -> Bounds {
        Bounds { center: [node as f32; 3], radius: 1.0, eps: node as f32 / 2.0 }
    }

    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.children[node.index()].iter().copied().map(NodeId)
    }

    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.parents[node.index()].iter().copied().map(NodeId)
    }

    fn log_number(&self, node: NodeId) -> u32 {
        3 * node.0 + 1
    }
}

/// What is unfolded, and nothing else.
struct Model {
    active: Vec<bool>,
}

impl Model {
    fn is_boundary<const T: bool>(&self, tree: &Made<T>, node: u32) -> bool {
        !self.active[node as usize] && tree.parents[node as usize].iter().all(|&p| self.active[p as usize])
    }

    fn is_collapsible<const T: bool>(&self, tree: &Made<T>, node: u32) -> bool {
        self.active[node as usize] && !tree.children[node as usize].iter().any(|&c| self.active[c as usize])
    }

    fn is_in_play<const T: bool>(&self, tree: &Made<T>, node: u32) -> bool {
        tree.parents[node as usize].first().is_none_or(|&first| self.active[first as usize])
    }

    /// In order of nodes.
    fn watched<const T: bool>(&self, tree: &Made<T>) -> Vec<(u32, bool)> {
        let nodes = 0..self.active.len() as u32;
        nodes
            .filter(|&node| self.is_boundary(tree, node) || self.is_collapsible(tree, node))
            .map(|node| (node, self.active[node as usize]))
            .collect()
    }
}

/// Everything that a front says.
#[track_caller]
fn assert_agrees<const T: bool>(front: &Front, tree: &Made<T>, model: &Model) {
    front.assert_well_formed(tree);
    let active: Vec<u32> = (0..).zip(&model.active).filter(|(_, active)| **active).map(|(n, _)| n).collect();
    assert_eq!(front.active_nodes(), active.len());
    let hash = active.iter().fold(0_u64, |hash, &node| hash.wrapping_add(mix(3 * node + 1)));
    assert_eq!(front.cut_hash(), hash);
    let mut visited = Vec::new();
    front.for_each_active(|node| visited.push(node.0));
    visited.sort_unstable();
    assert_eq!(visited, active);

    let mut watched = Vec::new();
    front.for_each_watched(|slot, kind, bounds| {
        assert_eq!((*bounds, front.bounds(slot)), (tree.bounds(front.node(slot)), *bounds));
        watched.push((front.node(slot).0, kind == Kind::Fold));
    });
    watched.sort_unstable();
    assert_eq!(watched, model.watched(tree));

    let in_play: Vec<u32> = (0..tree.node_limit()).filter(|&node| model.is_in_play(tree, node)).collect();
    for node in 0..tree.node_limit() {
        let slot = front.find(tree, NodeId(node));
        assert_eq!(slot != Slot::NONE, model.is_in_play(tree, node), "whether {node} is in play");
        if slot == Slot::NONE {
            continue;
        }
        assert_eq!(front.node(slot), NodeId(node));
        assert!(slot.index() < front.slots());
        assert_eq!(front.record(slot).is_boundary(), model.is_boundary(tree, node));
        assert_eq!(front.record(slot).is_collapsible(), model.is_collapsible(tree, node));
        let mut parents: Vec<u32> = front.parents(tree, slot).map(|parent| front.node(parent).0).collect();
        parents.sort_unstable();
        let mut expected = tree.parents[node as usize].clone();
        expected.retain(|parent| in_play.contains(parent));
        expected.sort_unstable();
        assert_eq!(parents, expected, "parents of {node}");
        if model.active[node as usize] {
            let children: Vec<u32> = front.children(tree, slot).map(|child| front.node(child).0).collect();
            let mut expected = tree.children[node as usize].clone();
            expected.retain(|child| in_play.contains(child));
            assert_eq!(children, expected, "children of {node}");
            if T {
                let two = front.two_below(slot).map(|two| two.map(|child| front.node(child).0).to_vec());
                assert_eq!(two, Some(expected).filter(|expected| expected.len() == 2), "two below {node}");
            }
        }
    }
    let roots: Vec<NodeId> = front.roots().map(|root| front.node(root)).collect();
    assert_eq!(roots, tree.roots);
}

/// Unfolds and folds at random for a while, then folds everything.
fn follow<const T: bool>(nodes: u32, seed: u64) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let tree = Made::<T>::random(nodes, &mut random);
    let mut front = Front::new(&tree);
    let mut model = Model { active: vec![false; nodes as usize] };
    assert_agrees(&front, &tree, &model);
    let mut most_slots = 0;
    for step in 0..20 * nodes {
        // Mostly unfolding for a while, then mostly folding; in the end nothing else.
        let is_end = step > 10 * nodes;
        let folds = if is_end {
            10
        } else if (step / (2 * nodes)).is_multiple_of(2) {
            3
        } else {
            7
        };
        let kind = if random.random_range(0..10) < folds { Kind::Fold } else { Kind::Unfold };
        let mut watched = model.watched(&tree);
        watched.retain(|&(_, active)| active == (kind == Kind::Fold));
        if watched.is_empty() {
            continue;
        }
        let (node, _) = watched[random.random_range(0..watched.len())];
        let slot = front.find(&tree, NodeId(node));
        // A change that is made is not one that waits.
        front.set_waiting(slot, step % 5 == 0);
        let before = model.watched(&tree);
        model.active[node as usize] = kind == Kind::Unfold;
        let after = model.watched(&tree);
        let (mut ready, mut told) = (Vec::new(), Vec::new());
        let collect = |told: &mut Vec<u32>, slot: Slot| told.push(slot.0);
        match (T, kind) {
            (true, Kind::Unfold) => front.set_active(&tree, slot),
            (true, Kind::Fold) => front.set_folded(&tree, slot),
            (false, Kind::Unfold) => {
                let parents: Vec<u32> = tree.parents[node as usize]
                    .iter()
                    .filter(|&&parent| before.contains(&(parent, true)))
                    .map(|&parent| front.find(&tree, NodeId(parent)).0)
                    .collect();
                front.set_active_in_graph(&tree, slot, |slot| collect(&mut told, slot), &mut ready);
                assert_eq!(told, parents, "parents that were collapsible");
            }
            (false, Kind::Fold) => {
                let children: Vec<u32> = (tree.children[node as usize].iter())
                    .map(|&child| front.find(&tree, NodeId(child)).0)
                    .filter(|&slot| slot != 0)
                    .collect();
                front.set_folded_in_graph(&tree, slot, |slot| collect(&mut told, slot), &mut ready);
                assert_eq!(told, children, "children that were in play");
            }
        }
        if !T {
            // The node itself apart, which has changed sides.
            let mut ready: Vec<u32> = ready.iter().map(|&slot| front.node(slot).0).collect();
            ready.sort_unstable();
            let news = after.iter().filter(|entry| entry.0 != node && !before.contains(entry));
            assert_eq!(ready, news.map(|entry| entry.0).collect::<Vec<_>>(), "{kind:?} {node}");
        }
        if step % 8 == 0 || step < 100 {
            assert_agrees(&front, &tree, &model);
        }
        if step < 6 * nodes {
            most_slots = most_slots.max(front.slots());
        }
    }
    assert!(!model.active.contains(&true));
    assert_agrees(&front, &tree, &model);
    // Records are used again: no more than one for each node, or for each half of a pair.
    assert!(
        most_slots > nodes as usize && front.slots() <= 4 * nodes as usize,
        "{most_slots}, {}",
        front.slots()
    );
    assert_eq!(front.free.len() + front.roots.len() + 1, front.pairs.len());
}

#[test]
fn a_front_through_a_tree_says_what_is_unfolded() {
    (0..6).for_each(|seed| follow::<true>(80, seed));
    (0..6).for_each(|seed| follow::<true>(12, seed));
}

#[test]
fn a_front_through_a_graph_says_what_is_unfolded() {
    (0..6).for_each(|seed| follow::<false>(80, seed));
    (0..6).for_each(|seed| follow::<false>(12, seed));
}

/// A change that waits is not watched, until it is not set aside any more.
#[test]
fn what_waits_is_not_watched() {
    let tree = Made::<true>::new(vec![vec![], vec![], vec![], vec![0], vec![0], vec![0]]);
    let mut front = Front::new(&tree);
    let watched = |front: &Front| {
        let mut watched = Vec::new();
        front.for_each_watched(|slot, _, _| watched.push(front.node(slot).0));
        watched.sort_unstable();
        watched
    };
    let slots = [0, 1, 2].map(|node| front.find(&tree, NodeId(node)));
    assert_eq!(watched(&front), [0, 1, 2]);
    front.set_waiting(slots[1], true);
    assert_eq!(watched(&front), [0, 2]);
    assert_eq!(slots.map(|slot| front.is_waiting(slot)), [false, true, false]);
    front.set_waiting(slots[1], false);
    front.set_waiting(slots[1], false);
    assert_eq!(watched(&front), [0, 1, 2]);
    front.set_active(&tree, slots[0]);
    front.set_waiting(slots[0], true);
    assert_eq!(watched(&front), [1, 2, 3, 4, 5]);
    assert!(front.record(slots[0]).is_active() && front.record(slots[0]).is_collapsible());
    front.set_folded(&tree, slots[0]);
    assert_eq!(watched(&front), [0, 1, 2]);
}

/// The first number that splitmix64 makes of a seed: those of 0 and 1234567 are well known.
#[test]
fn numbers_are_mixed_as_splitmix_does() {
    assert_eq!(mix(0), 0xe220_a839_7b1d_cdaf);
    assert_eq!(mix(1_234_567), 6_457_827_717_110_365_317);
}

/// Each check of a front's state finds what it is for.
#[test]
fn a_front_that_is_not_well_formed_is_found() {
    // Node 0 has four children, of which the first has two and the last is below the root 1 too.
    let parents = |is_tree: bool| {
        let last = if is_tree { vec![0] } else { vec![0, 1] };
        vec![vec![], vec![], vec![0], vec![0], vec![0], last, vec![2], vec![2]]
    };
    let (tree, graph) = (Made::<true>::new(parents(true)), Made::<false>::new(parents(false)));
    let check_tree = |spoil: &dyn Fn(&mut Front)| {
        let mut front = Front::new(&tree);
        for node in [0, 2, 1, 3] {
            front.set_active(&tree, front.find(&tree, NodeId(node)));
        }
        for node in [1, 3, 2] {
            front.set_folded(&tree, front.find(&tree, NodeId(node)));
        }
        front.set_active(&tree, front.find(&tree, NodeId(4)));
        front.assert_well_formed(&tree);
        spoil(&mut front);
        catch_unwind(AssertUnwindSafe(|| front.assert_well_formed(&tree))).is_err()
    };
    let check_graph = |spoil: &dyn Fn(&mut Front)| {
        let mut front = Front::new(&graph);
        for node in [0, 2] {
            front.set_active_in_graph(&graph, front.find(&graph, NodeId(node)), |_| {}, &mut Vec::new());
        }
        front.assert_well_formed(&graph);
        spoil(&mut front);
        catch_unwind(AssertUnwindSafe(|| front.assert_well_formed(&graph))).is_err()
    };
    assert!(!check_tree(&|_| {}) && !check_graph(&|_| {}));
    let find = |front: &Front, node: u32| front.find(&tree, NodeId(node));

    assert!(check_tree(&|front| front.active += 1), "active nodes");
    assert!(check_tree(&|front| front.hash ^= 1), "their hash");
    assert!(check_tree(&|front| front.free.extend_from_within(..1)), "a pair that is free twice");
    assert!(check_tree(&|front| front.free.truncate(0)), "a pair that is nowhere");
    assert!(check_tree(&|front| front.free.push(front.roots[0])), "a pair that is free and linked");
    assert!(check_tree(&|front| front.roots.extend_from_within(..1)), "a root more");
    assert!(check_tree(&|front| front.root_slots.swap(0, 1)), "the order of roots");
    assert!(check_tree(&|front| front.spare.push(vec![1])), "a list in use that is not");
    assert!(check_tree(&|front| _ = front.many.insert(Vec::new())), "a list that is in use nowhere");
    assert!(check_tree(&|front| front.pairs[0].0[1].status = 0), "pair 0 is in play");
    assert!(check_tree(&|front| front.pairs[0].0[0].node = NodeId(3)), "pair 0 has a node");
    assert!(check_tree(&|front| front.above[front.roots[0] as usize] = Slot(3)), "something above a root");
    let cut_off = |front: &mut Front| {
        let pair = find(front, 4).pair();
        front.above[pair] = Slot::NONE;
    };
    assert!(check_tree(&cut_off), "nothing above a child");
    let status =
        |node: u32, bits: u32| check_tree(&|front| front.record_mut(find(front, node)).status ^= bits);
    assert!(status(0, 1) && status(0, 2), "active children");
    assert!(status(2, 1) && status(2, MANY) && status(2, ACTIVE), "a folded node");
    assert!(!status(2, WAITING) && !status(4, WAITING), "what waits is well-formed");
    assert!(
        check_tree(&|front| front.record_mut(find(front, 2)).children = 1),
        "a folded node with something below"
    );
    assert!(check_tree(&|front| front.record_mut(find(front, 5)).node = NodeId(6)), "another node's child");
    assert!(
        check_tree(&|front| {
            let slot = find(front, 5);
            *front.record_mut(slot) = Record::BLANK;
        }),
        "a child that is not linked"
    );
    assert!(
        check_tree(&|front| {
            let slot = find(front, 4);
            front.pairs[slot.pair()].0.swap(0, 1);
        }),
        "children in another order"
    );

    let find = |front: &Front, node: u32| front.find(&graph, NodeId(node));
    assert!(check_graph(&|front| front.active_bits[0] ^= 1 << 2), "a bit of an active node");
    assert!(check_graph(&|front| front.active_bits[0] ^= 1 << 6), "a bit of a folded node");
    assert!(check_graph(&|front| front.active_bits[0] ^= 1 << 40), "a bit of no node");
    let status =
        |node: u32, bits: u32| check_graph(&|front| front.record_mut(find(front, node)).status ^= bits);
    assert!(
        status(5, 1) && status(5, 3) && status(0, 1),
        "parents that a node waits for, and active children"
    );
    assert!(
        check_graph(&|front| _ = front.slots.as_mut().unwrap().set(6, Slot::NONE)),
        "a node without a slot"
    );
    assert!(check_graph(&|front| _ = front.slots.as_mut().unwrap().set(6, Slot(3))), "another slot");
    assert!(check_graph(&|front| front.slots = None), "no slots at all");
    assert!(check_graph(&|front| front.spare.push(vec![1])), "a list in use that is not");
}
