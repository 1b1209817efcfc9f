//! The tree that the engine unfolds and folds.

use std::sync::Arc;

use container::FileError;
use vertex_tree::{
    Bounds, Hierarchy, MeshSink, NONE, NodeId, PageStats, Prefetch, Step, TreeError, VertexId, VertexTree,
};

use crate::cache::CacheMode;
use crate::display::Display;
use crate::error::MtError;
use crate::file::MtFile;
use crate::memory::Memory;
use crate::paging::{Change, Paging};
use crate::reader::Reader;
use crate::record::Record;

/// How a tree pages.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// What is read at once, and what is kept.
    pub cache: CacheMode,
    /// The budget, which other trees may hold clones of.
    pub memory: Memory,
    /// The thread that reads, or a store on virtual time, which other trees may use too; without, the tree gets a thread
    /// of its own.
    pub reader: Option<Reader>,
    /// What fetches nodes before a change needs them. The paper's scheme is to load on first demand, in the units of the
    /// cache mode, so [`Prefetch::Paper`] and [`Prefetch::None`] are one.
    pub prefetch: Prefetch,
}

/// A file and the state of one front through it.
///
/// The structure is a graph: a node may have several parents, all of them structural. Bounds are nested along every arc,
/// so nothing is needed beyond structure.
#[derive(Debug)]
pub struct MtTree {
    file: Arc<MtFile>,
    memory: Memory,
    paging: Paging,
    /// Kept only for a sink that wants the mesh.
    display: Option<Display>,
    displayed: u64,
    above: Vec<u32>,
    below: Vec<u32>,
}

impl MtTree {
    /// A tree with every node folded.
    ///
    /// # Errors
    /// [`FileError::Memory`] if the budget is below [`MtFile::least_memory`], [`MtError::Thread`] if a thread can not be had.
    pub fn new(file: Arc<MtFile>, settings: Settings) -> Result<Self, MtError> {
        let Settings { cache, memory, reader, prefetch } = settings;
        FileError::check_memory(file.name(), memory.limit(), file.least_memory())?;
        let reader = reader.map_or_else(Reader::new, Ok)?;
        Ok(Self {
            paging: Paging::new(file.clone(), cache, prefetch, memory.clone(), &reader),
            memory,
            display: None,
            displayed: u64::from(file.base.fine()),
            above: Vec::new(),
            below: Vec::new(),
            file,
        })
    }

    /// The file that the tree shows.
    #[must_use]
    pub fn file(&self) -> &Arc<MtFile> {
        &self.file
    }

    /// The budget: its limit may be changed between frames.
    #[must_use]
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Bytes of the nodes in memory.
    #[must_use]
    pub fn node_bytes(&self) -> u64 {
        self.paging.nodes.residents.bytes()
    }

    /// Asks for all nodes, as far as there is room for them, and lets go of nothing from now on unless room is needed,
    /// whatever the cache mode: for a viewer with memory for everything. See [`settle`](Hierarchy::settle).
    pub fn load_all(&mut self) {
        self.paging.load_all();
    }

    /// The input vertex that is shown in a slot; `None` in a hole, and for a sink that does not keep the mesh.
    #[must_use]
    pub fn input_vertex(&self, vertex: VertexId) -> Option<u32> {
        self.display.as_ref()?.input_vertex(vertex)
    }

    /// A change of the front that has been made: the cut and the count of triangles follow. Returns the arcs above and
    /// below.
    fn change(&mut self, node: u32, change: Change) {
        let Some(record) = self.paging.nodes.residents.get(node) else { return };
        let (coarse, fine) = (u64::from(record.coarse()), u64::from(record.fine()));
        self.above.clear();
        self.above.extend(record.above().map(|(n, _)| n));
        let arcs_above = self.above.len();
        self.above.retain(|&n| n != NONE);
        self.below.clear();
        self.below.extend(record.below());
        if change == Change::Unfold {
            // The engine looks at each of them.
            self.paging.prepare_all(&self.below);
        }
        let arcs = match change {
            Change::Unfold => {
                self.displayed = (self.displayed + fine).saturating_sub(coarse);
                record.arcs().len()
            }
            Change::Fold => {
                self.displayed = (self.displayed + coarse).saturating_sub(fine);
                arcs_above
            }
        };
        self.paging.changed(node, change, &self.above, &self.below, arcs as u32);
    }
}

impl Hierarchy for MtTree {
    const PREPARATION: usize = 3;

    fn node_limit(&self) -> u32 {
        self.file.nodes()
    }

    fn displayed(&self) -> u64 {
        self.displayed
    }

    fn origin(&self) -> [f64; 3] {
        self.file.georeference().origin
    }

    fn roots(&self) -> &[NodeId] {
        &self.file.roots
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        let record = || self.paging.nodes.residents.get(node.0).map(Record::bounds);
        // Asked of nothing but roots and what is in memory.
        record().or_else(|| self.file.root_bounds(node)).unwrap_or(Bounds {
            center: [0.0; 3],
            radius: 0.0,
            eps: 0.0,
        })
    }

    #[inline]
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.paging.nodes.residents.get(node.0).into_iter().flat_map(|record| record.below().map(NodeId))
    }

    #[inline]
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let record = self.paging.nodes.residents.get(node.0);
        record
            .into_iter()
            .flat_map(|record| record.above().map(|(n, _)| n).filter(|&n| n != NONE).map(NodeId))
    }

    #[inline]
    fn children_and_parents(
        &self,
        node: NodeId,
    ) -> impl Iterator<Item = (NodeId, Bounds, impl Iterator<Item = NodeId>)> {
        let residents = &self.paging.nodes.residents;
        residents.get(node.0).into_iter().flat_map(Record::below).filter_map(|below| {
            let child = residents.get(below)?;
            let parents = child.above().map(|(n, _)| n).filter(|&n| n != NONE).map(NodeId);
            Some((NodeId(below), child.bounds(), parents))
        })
    }

    fn log_number(&self, node: NodeId) -> u32 {
        self.file.log_numbers[node.index()]
    }

    #[inline]
    fn prepare(&self, node: NodeId, step: usize) {
        self.paging.prepare(node.0, step);
    }

    fn look_ahead(&self) -> u32 {
        self.paging.look_ahead()
    }

    fn will_need(&mut self, node: NodeId, frames: u32) {
        self.paging.will_need(node.0, frames);
    }

    /// A child is shown below the first of its parents that is folded: once, however many parents it has. Of the
    /// children, those that are in memory are shown.
    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        let Some(record) = self.paging.nodes.residents.get(node.0) else { return false };
        for below in record.below() {
            let Some(child) = self.paging.nodes.residents.get(below) else { continue };
            let mut folded =
                child.above().map(|(n, _)| n).filter(|&n| n != NONE && !self.paging.nodes.is_active(n));
            if folded.next() == Some(node.0) {
                children.push((NodeId(below), child.bounds()));
            }
        }
        true
    }

    fn pass(&mut self, time: std::time::Duration) -> Result<(), TreeError> {
        self.paging.pass(time);
        Ok(())
    }

    fn take_fault(&mut self) -> Option<TreeError> {
        self.paging.fault.take()
    }

    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        self.paging.begin_frame(arrived);
        Ok(())
    }

    fn give_up(&mut self, node: NodeId) {
        self.paging.give_up(node.0);
    }

    fn settle(&mut self) -> Result<std::time::Duration, TreeError> {
        Ok(self.paging.settle())
    }

    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        Ok(self.paging.end_frame())
    }
}

impl VertexTree for MtTree {
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        if M::KEEPS_MESH {
            let mut display = Display::new();
            display.show(&self.file.base, |_, _| true, mesh);
            self.display = Some(display);
        }
        Ok(())
    }

    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        if !self.paging.has(node.0, Change::Unfold) {
            return Ok(Step::NotResident);
        }
        self.change(node.0, Change::Unfold);
        if let (true, Some(display), Some(record)) =
            (M::KEEPS_MESH, &mut self.display, self.paging.nodes.residents.get(node.0))
        {
            // What appears first shares vertices with what disappears then.
            display.show(record, |_, _| true, mesh);
            for (above, _) in record.above() {
                display.hide(above, node.0, mesh);
            }
        }
        Ok(Step::Done)
    }

    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        if !self.paging.has(node.0, Change::Fold) {
            return Ok(Step::NotResident);
        }
        self.change(node.0, Change::Fold);
        if let (true, Some(display), Some(record)) =
            (M::KEEPS_MESH, &mut self.display, self.paging.nodes.residents.get(node.0))
        {
            for (above, position) in record.above() {
                let parent = if above == NONE {
                    Some(&self.file.base)
                } else {
                    self.paging.nodes.residents.get(above)
                };
                if let Some(parent) = parent {
                    display.show(parent, |at, below| at == position as usize && below == node.0, mesh);
                }
            }
            for arc in record.arcs() {
                display.hide(node.0, arc.below, mesh);
            }
        }
        Ok(Step::Done)
    }
}
