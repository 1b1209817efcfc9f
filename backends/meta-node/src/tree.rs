//! The tree that the engine unfolds and folds.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use star_mesh::{LeafTriangle, StarMesh};
use vertex_tree::{Bounds, Hierarchy, MeshSink, NodeId, PageStats, Step, TreeError, VertexTree};

use crate::dependencies::{Half, Rules};
use crate::error::MetaNodeError;
use crate::file::MetaNodeFile;
use crate::page::{Child, Node, Page};
use crate::pager::{Pager, Switch};
use crate::settings::Settings;

/// A file of meta-nodes, and the state of one front through it.
///
/// Everything here runs on the caller's thread, and place holders belong to it; one more thread, of the page store, reads pages.
/// It starts with the tree and ends after it. With [`Io::Simulated`](crate::Io::Simulated) there is none.
pub struct MetaNodeTree {
    pager: Pager,
    roots: Vec<NodeId>,
    slot_bits: u32,
    /// Kept for a sink that wants it, and for the rules of dependencies.
    mesh: Option<StarMesh>,
    rules: Option<Rules>,
    displayed: u64,
    /// Nodes that were refused and whose page is under way, those of one page together.
    refused: BTreeSet<NodeId>,
    /// Nodes that were refused and ask again in the next frame: no page is under way for them, or a rule of dependencies
    /// holds others for as long as they are asked for.
    again: Vec<NodeId>,
}

impl MetaNodeTree {
    /// A tree with every node folded. With the paper's prefetching the root pages have been asked for.
    ///
    /// # Errors
    /// [`FileError::Memory`](crate::FileError::Memory) if that is less than [`MetaNodeFile::least_memory`],
    /// [`MetaNodeError::Thread`].
    pub fn new(file: Arc<MetaNodeFile>, settings: Settings) -> Result<Self, MetaNodeError> {
        let (slot_bits, leaves) = (file.header.slot_bits, file.header.leaves);
        let roots = file.roots.iter().map(|root| root.node).collect();
        let mut tree = Self {
            pager: Pager::new(file, &settings)?,
            roots,
            slot_bits,
            mesh: None,
            rules: Rules::new(settings.dependencies, leaves),
            displayed: 0,
            refused: BTreeSet::new(),
            again: Vec::new(),
        };
        for root in 0..tree.roots.len() {
            tree.pager.count_usage(tree.roots[root].0 >> slot_bits, 1);
        }
        tree.pager.end_frame();
        Ok(tree)
    }

    /// The file that the tree shows.
    #[must_use]
    pub fn file(&self) -> &Arc<MetaNodeFile> {
        &self.pager.file
    }

    /// Sets how much memory place holders may take, between two frames. If it is less than before, pages go at once,
    /// those first that are of least use.
    ///
    /// # Errors
    /// [`FileError::Memory`](crate::FileError::Memory), and nothing has changed.
    pub fn set_page_memory(&mut self, bytes: u64) -> Result<(), MetaNodeError> {
        self.pager.set_page_memory(bytes)
    }

    /// Asks for every page for which there is room. Once these have [come](Hierarchy::settle), a tree with memory
    /// for everything misses nothing.
    pub fn load_all(&mut self) {
        self.pager.load_all();
    }

    /// Whether a node's page is in memory.
    #[must_use]
    pub fn is_resident(&self, node: NodeId) -> bool {
        self.pager.find(self.place(node).0).is_some()
    }

    /// The page of a node, and its slot there.
    #[inline(always)]
    fn place(&self, node: NodeId) -> (u32, u32) {
        (node.0 >> self.slot_bits, node.0 & ((1 << self.slot_bits) - 1))
    }

    /// Looks at a node wherever it is. Nodes that the engine asks for have just been changed, and their pages are in
    /// memory; for any other, such as by a debugger or a checker, the page is read and dropped again. `None` if that
    /// fails.
    #[inline(always)]
    fn look<R>(&self, node: NodeId, f: impl FnOnce(Page, Node) -> R) -> Option<R> {
        let (page, slot) = self.place(node);
        match self.pager.find(page) {
            Some(holder) => {
                let page = self.pager.page(holder);
                (slot < page.layout.nodes).then(|| f(page, page.node(slot)))
            }
            None => self.look_in_file(page, slot, f),
        }
    }

    #[cold]
    fn look_in_file<R>(&self, page: u32, slot: u32, f: impl FnOnce(Page, Node) -> R) -> Option<R> {
        let file = &self.pager.file;
        let mut words = vec![0; file.page_words(page)];
        let layout = file.read_page(page, &mut words).ok().filter(|layout| slot < layout.nodes)?;
        let page = Page { words: &words, layout: &layout };
        Some(f(page, page.node(slot)))
    }

    /// The place holder of a node's page. If it is missing, it is asked for.
    #[inline(always)]
    fn find(&mut self, node: NodeId, switch: Switch) -> Option<u32> {
        let (page, _) = self.place(node);
        let found = self.pager.find(page);
        if found.is_none() {
            self.pager.urge(page, switch);
            if self.rules.is_none() && !self.pager.is_printed() && self.pager.is_under_way(page) {
                self.refused.insert(node);
            } else {
                self.again.push(node);
            }
        }
        found
    }

    /// In the paper a switch down to a page takes that page. Whether those of a node's children are there; if not, they are
    /// asked for.
    fn has_pages_below(&mut self, node: NodeId, holder: u32) -> bool {
        let (_, slot) = self.place(node);
        let mut has_all = true;
        for child in self.pager.page(holder).node(slot).children() {
            if let Child::Link(link) = child {
                let below = self.pager.page(holder).link(link).node.0 >> self.slot_bits;
                if self.pager.find(below).is_none() {
                    has_all = false;
                    self.pager.urge(below, Switch::Down);
                }
            }
        }
        if !has_all {
            self.again.push(node);
        }
        has_all
    }

    /// The numbers that nodes of a page have.
    fn nodes_of(&self, page: u32) -> Range<NodeId> {
        NodeId(page << self.slot_bits)..NodeId((page + 1) << self.slot_bits)
    }

    fn damaged(&self, page: u32, reason: &'static str) -> TreeError {
        let file = &self.pager.file;
        TreeError::Damaged { file: file.name().to_owned(), offset: file.page_offset(page), reason }
    }

    /// Whether a change of a node of a page did not fit what is displayed.
    fn check_fit(&mut self, page: u32) -> Result<(), TreeError> {
        match self.mesh.as_mut().and_then(StarMesh::take_misfit) {
            None => Ok(()),
            Some(_) => Err(self.damaged(page, "the leaves of a node are not where they should be")),
        }
    }

    /// The front moves from a node to its children, or back: counts who is where.
    #[inline(always)]
    fn count(&mut self, node: NodeId, children: [Child; 2], holder: u32, by: i32) {
        let (own, _) = self.place(node);
        let mut here = -by;
        for child in children {
            match child {
                Child::Leaf | Child::Slot(_) => here += by,
                Child::Link(link) => {
                    let below = self.pager.page(holder).link(link).node.0 >> self.slot_bits;
                    self.pager.count_usage(below, by);
                }
            }
        }
        if here != 0 {
            self.pager.count_usage(own, here);
        }
    }
}

impl Hierarchy for MetaNodeTree {
    const IS_TREE: bool = true;
    const PREPARATION: usize = 4;

    fn node_limit(&self) -> u32 {
        self.pager.file.header.pages << self.slot_bits
    }

    fn displayed(&self) -> u64 {
        self.displayed
    }

    fn origin(&self) -> [f64; 3] {
        self.file().georeference().origin
    }

    fn roots(&self) -> &[NodeId] {
        &self.roots
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        if let Ok(at) = self.roots.binary_search(&node) {
            return self.pager.file.roots[at].bounds;
        }
        // A sphere without end, where the page can not be read: such a node counts as inside of every view.
        let unknown = Bounds { center: [0.0; 3], radius: f32::MAX, eps: f32::MAX };
        self.look(node, |_, node| node.bounds()).unwrap_or(unknown)
    }

    #[inline]
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let base = node.0 >> self.slot_bits << self.slot_bits;
        let children = self.look(node, |page, of| {
            of.children().map(|child| match child {
                Child::Leaf => None,
                Child::Slot(slot) => Some(NodeId(base | slot)),
                Child::Link(link) => Some(page.link(link).node),
            })
        });
        children.into_iter().flatten().flatten()
    }

    #[inline]
    fn children_and_bounds(&self, node: NodeId) -> impl Iterator<Item = (NodeId, Bounds)> {
        let base = node.0 >> self.slot_bits << self.slot_bits;
        let children = self.look(node, |page, of| {
            of.children().map(|child| match child {
                Child::Leaf => None,
                Child::Slot(slot) => Some((NodeId(base | slot), page.node(slot).bounds())),
                Child::Link(link) => {
                    let link = page.link(link);
                    Some((link.node, link.bounds))
                }
            })
        });
        children.into_iter().flatten().flatten()
    }

    #[inline]
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let base = node.0 >> self.slot_bits << self.slot_bits;
        if let Some(above) = self.rules.as_ref().and_then(|rules| rules.above(node)) {
            return Some(above).filter(|above| above.0 != vertex_tree::NONE).into_iter();
        }
        let parent = self.look(node, |page, of| match of.parent() {
            Ok(slot) => base | slot,
            Err(block) => page.above(block).0,
        });
        parent.filter(|&p| p != vertex_tree::NONE).map(NodeId).into_iter()
    }

    fn log_number(&self, node: NodeId) -> u32 {
        self.look(node, |_, node| node.log_number()).unwrap_or(vertex_tree::NONE)
    }

    #[inline(always)]
    fn prepare(&self, node: NodeId, step: usize) {
        let (page, slot) = self.place(node);
        if step == 0 {
            self.pager.prefetch_table(page);
            return;
        }
        let Some(holder) = self.pager.find(page) else { return };
        match step {
            1 => self.pager.prefetch_holder(holder),
            2 => self.pager.page(holder).prefetch(slot),
            _ => {
                let page = self.pager.page(holder);
                page.prefetch_children(slot);
                if self.mesh.is_some() {
                    page.prefetch_brought(slot);
                }
            }
        }
    }

    fn look_ahead(&self) -> u32 {
        self.pager.frames_ahead()
    }

    fn will_need(&mut self, node: NodeId, frames: u32) {
        // Unfolding and folding both take the node's own page and no other.
        self.pager.foresee(self.place(node).0, frames);
    }

    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        let is_here = self.is_resident(node);
        if is_here {
            children.extend(self.children_and_bounds(node));
        }
        is_here
    }

    fn pass(&mut self, time: Duration) -> Result<(), TreeError> {
        self.pager.pass(time);
        Ok(())
    }

    fn take_fault(&mut self) -> Option<TreeError> {
        self.pager.take_fault()
    }

    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        if let Some(rules) = &mut self.rules {
            rules.begin_frame();
        }
        arrived.append(&mut self.again);
        self.pager.begin_frame();
        let mut news = std::mem::take(&mut self.pager.news);
        for page in news.drain(..).filter(|&page| !self.pager.is_under_way(page)) {
            let nodes = self.nodes_of(page);
            while let Some(&node) = self.refused.range(nodes.clone()).next() {
                self.refused.remove(&node);
                arrived.push(node);
            }
        }
        self.pager.news = news;
        Ok(())
    }

    fn give_up(&mut self, node: NodeId) {
        self.again.retain(|&other| other != node);
        let (page, _) = self.place(node);
        if self.refused.remove(&node) && self.refused.range(self.nodes_of(page)).next().is_none() {
            self.pager.demote(page);
        }
    }

    fn settle(&mut self) -> Result<Duration, TreeError> {
        Ok(self.pager.settle())
    }

    #[track_caller]
    fn assert_well_formed(&self) {
        if let Some(stars) = &self.mesh {
            stars.assert_well_formed();
            assert_eq!(stars.displayed() as u64, self.displayed, "triangles displayed");
        }
        self.pager.assert_well_formed();
    }

    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        // It is not known by then which node it was.
        self.check_fit(0)?;
        Ok(self.pager.end_frame())
    }
}

impl VertexTree for MetaNodeTree {
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        let file = self.pager.file.clone();
        self.displayed = file.base_triangles.len() as u64;
        if !M::KEEPS_MESH && self.rules.is_none() {
            return Ok(());
        }
        let mut stars = StarMesh::new(file.header.leaves as usize);
        // Base vertices are those of the roots, in their order, and then those that no collapse touches.
        let mut roots = file.roots.iter();
        for &(leaf, position) in &file.base_vertices {
            let vertex = stars.add_vertex(leaf, position, mesh);
            let half = roots.next().map(|root| (root.node, root.log_number));
            if let Some(rules) = &mut self.rules {
                rules.show(vertex, leaf, half, None);
                rules.enter(half, leaf, None);
            }
        }
        for &leaves in &file.base_triangles {
            stars.add_triangle(LeafTriangle::new(leaves, 0, 0), mesh);
        }
        self.mesh = Some(stars);
        Ok(())
    }

    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        if let (Some(rules), Some(stars)) = (&mut self.rules, &self.mesh)
            && let Some(step) = rules.may_split(node, stars)
        {
            return Ok(step);
        }
        let Some(holder) = self.find(node, Switch::Down) else { return Ok(Step::NotResident) };
        let (own, slot) = self.place(node);
        let page = self.pager.page(holder);
        if slot >= page.layout.nodes {
            return Err(self.damaged(own, "a link leads to a node that it does not have"));
        }
        if self.pager.is_printed() && !self.has_pages_below(node, holder) {
            return Ok(Step::NotResident);
        }
        let page = self.pager.page(holder);
        let of = page.node(slot);
        let (children, leaves) = (of.children(), of.leaves());
        let (start, end) = page.brought_range(slot);
        if let Some(stars) = &mut self.mesh {
            let brought = page.brought(slot).map(|leaves| LeafTriangle::new(leaves, 0, 0));
            stars.split(leaves, of.position(), brought, mesh);
            // Rules look at the mesh as it is.
            if self.rules.is_some() {
                stars.update(mesh);
                self.check_fit(own)?;
            }
        }
        self.displayed += u64::from(end - start);
        let page = self.pager.page(holder);
        let of = page.node(slot);
        if let (Some(rules), Some(stars)) = (&mut self.rules, &self.mesh) {
            rules.split(node, leaves[1]);
            for (leaf, half) in leaves.into_iter().zip(halves(node.0 - slot, page, of)) {
                rules.show(stars.vertex(leaf), leaf, half, Some(of.log_number()));
                rules.enter(half, leaf, Some(node));
            }
        }
        self.pager.touch(holder);
        self.count(node, children, holder, 1);
        self.pager.look_ahead(holder, slot);
        Ok(Step::Done)
    }

    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        if let (Some(rules), Some(stars)) = (&mut self.rules, &self.mesh)
            && let Some(step) = rules.may_merge(node, stars)
        {
            return Ok(step);
        }
        let Some(holder) = self.find(node, Switch::Up) else { return Ok(Step::NotResident) };
        let (own, slot) = self.place(node);
        let page = self.pager.page(holder);
        if slot >= page.layout.nodes {
            return Err(self.damaged(own, "a link leads to a node that it does not have"));
        }
        let of = page.node(slot);
        let (children, leaves @ [kept, _], collapse) = (of.children(), of.leaves(), of.log_number());
        let (start, end) = page.brought_range(slot);
        if let Some(stars) = &mut self.mesh {
            stars.merge(leaves, mesh);
            if self.rules.is_some() {
                stars.update(mesh);
                self.check_fit(own)?;
            }
        }
        let page = self.pager.page(holder);
        let of = page.node(slot);
        if let (Some(rules), Some(stars)) = (&mut self.rules, &self.mesh) {
            halves(node.0 - slot, page, of).into_iter().for_each(|half| rules.leave(half));
            let parent = match of.parent() {
                Ok(slot) => Some(page.node(slot).log_number()),
                Err(block) => Some(page.above(block).1).filter(|&above| above != vertex_tree::NONE),
            };
            rules.show(stars.vertex(kept), kept, Some((node, collapse)), parent);
        }
        self.displayed -= u64::from(end - start);
        self.pager.touch(holder);
        self.count(node, children, holder, -1);
        Ok(Step::Done)
    }

    fn update_mesh<M: MeshSink>(&mut self, mesh: &mut M) {
        if let Some(stars) = &mut self.mesh {
            stars.update(mesh);
        }
    }
}

/// The children of a node that are nodes, with their numbers in the log; `base` is the number of the page's first slot.
fn halves(base: u32, page: Page, of: Node) -> [Half; 2] {
    of.children().map(|child| match child {
        Child::Leaf => None,
        Child::Slot(slot) => Some((NodeId(base | slot), page.node(slot).log_number())),
        Child::Link(link) => {
            let link = page.link(link);
            Some((link.node, link.log_number))
        }
    })
}
