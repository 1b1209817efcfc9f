//! The objects of a `.scene` file, opened: each a hierarchy of whatever backend, built by `build` or, where the file is a mesh,
//! in memory as the scene is opened.
//!
//! Objects that name the same file share what is in memory of its tables, not its pages: each has a cut of its own.
//!
//! # What objects share
//!
//! One limit of memory holds for all of them. Every object that pages has an equal share of it. Those of `mt-partition` have
//! theirs together, as one budget, so that an object far away leaves its part to a near one; a tree of meta-nodes or of
//! detail blocks has its own. Objects in memory do not count. Objects of `mt-partition` also have one reader, and one store
//! where time is virtual; of the others each has a thread, or a store, by itself.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use detail_block::XfmTree;
use in_memory::InMemoryTree;
use meta_node::MetaNodeTree;
use mt_partition::{Memory, MtTree, Reader};
use rustc_hash::FxHashMap;
use vertex_tree::{NullSink, Refine};

use super::any::{AnyObject, StoredObjects};
use super::scene_file::read_lines;
use super::stored_error::{ObjectLine, StoredSceneError};
use crate::experiment::store::{Backend, Store, StoreError};
use construction::mesh_io;
use construction::simplify;
use selection::engine::{FrameReport, Settings};
use selection::objects::Object;
use selection::objects::Placement;
use selection::settled::Settled;
use selection::view::View;
use testing::brute_force::BruteForce;

/// An object of a scene.
#[derive(Clone, Debug)]
pub struct StoredObject {
    /// Where it comes from.
    pub at: ObjectLine,
    /// The number of its file.
    pub file: usize,
    /// Where it is placed.
    pub placement: Placement,
}

/// The files of a scene, and where its objects are.
#[derive(Clone)]
pub struct StoredScene {
    files: Vec<Store>,
    objects: Vec<StoredObject>,
}

/// How trees page, in the terms of each backend. Memory and quotas are those of the whole scene.
#[derive(Clone, Debug, Default)]
pub struct ScenePaging {
    /// Of meta-nodes.
    pub meta_node: meta_node::Settings,
    /// Of detail blocks.
    pub detail_block: detail_block::Settings,
    /// Of multi-triangulations, all of which share the reader; with none they get one thread.
    pub mt_partition: mt_partition::Settings,
    /// Whether changes wait for their pages, see [`Settled`].
    pub waits: bool,
}

/// Rounds of waiting for the pages of a frame. A frame that has not all of them by then goes on without.
const ROUNDS: usize = 1000;

/// What several backends together are called.
const SEVERAL: &str = "several";

impl StoredScene {
    /// Reads a scene file and opens the files that it names, each once. Meshes among them are simplified.
    ///
    /// # Errors
    /// What can not be read, with the line that names it.
    pub fn open(path: &Path) -> Result<Self, StoredSceneError> {
        Self::open_with(path, &simplify::Options::default())
    }

    /// The same, with options for what is simplified.
    ///
    /// # Errors
    /// As for [`open`](Self::open).
    pub fn open_with(path: &Path, options: &simplify::Options) -> Result<Self, StoredSceneError> {
        let mut scene = Self { files: Vec::new(), objects: Vec::new() };
        let mut known: FxHashMap<PathBuf, usize> = FxHashMap::default();
        for (line, file, placement) in read_lines(path)? {
            let at = ObjectLine { scene: path.to_owned(), line, file: file.clone() };
            let number = match known.get(&file) {
                Some(&number) => number,
                None => {
                    scene.files.push(open(&at, options)?);
                    known.insert(file, scene.files.len() - 1);
                    scene.files.len() - 1
                }
            };
            scene.objects.push(StoredObject { at, file: number, placement });
        }
        Ok(scene)
    }

    /// The files, each once.
    #[must_use]
    pub fn files(&self) -> &[Store] {
        &self.files
    }

    /// The objects, in the order of the scene file.
    #[must_use]
    pub fn objects(&self) -> &[StoredObject] {
        &self.objects
    }

    /// The name of the backend, `several` if there is more than one.
    #[must_use]
    pub fn backend(&self) -> &'static str {
        match self.files.split_first() {
            Some((first, rest)) if rest.iter().all(|file| file.backend() == first.backend()) => {
                first.backend().name()
            }
            _ => SEVERAL,
        }
    }

    /// How many objects a backend has.
    fn objects_of(&self, backend: Backend) -> u64 {
        self.objects.iter().filter(|object| self.files[object.file].backend() == backend).count() as u64
    }

    /// Objects that page.
    fn paging_objects(&self) -> u64 {
        self.objects.len() as u64 - self.objects_of(Backend::InMemory)
    }

    /// Bytes of memory that the objects need at least, as they share it.
    #[must_use]
    pub fn least_memory(&self) -> u64 {
        let objects = self.paging_objects();
        let together = self.objects_of(Backend::MtPartition).max(1);
        let least = |file: &Store| match file {
            Store::InMemory(..) => 0,
            Store::DetailBlock(file) => file.least_memory().saturating_mul(objects),
            Store::MetaNode(file) => file.least_memory().saturating_mul(objects),
            Store::MtPartition(file) => file.least_memory().saturating_mul(objects).div_ceil(together),
        };
        self.files.iter().map(least).max().unwrap_or(0)
    }

    /// Trees for all objects.
    ///
    /// # Errors
    /// [`StoredSceneError::File`] if there is too little memory, and what the trees report.
    pub fn trees(&self, settings: Settings, paging: &ScenePaging) -> Result<StoredObjects, StoredSceneError> {
        let paging = self.shared(paging)?;
        let objects = self.objects.iter().map(|object| self.tree(object, settings, &paging));
        let objects = objects.collect::<Result<_, _>>()?;
        let lines = self.objects.iter().map(|object| object.at.clone()).collect();
        Ok(StoredObjects::new(objects, lines))
    }

    /// How each object pages where all of them share what there is.
    fn shared(&self, paging: &ScenePaging) -> Result<ScenePaging, StoredSceneError> {
        let (objects, mut paging) = (self.paging_objects().max(1), paging.clone());
        let together = self.objects_of(Backend::MtPartition);
        let share = |bytes: u64| if bytes == u64::MAX { bytes } else { bytes / objects };
        paging.meta_node.page_memory = share(paging.meta_node.page_memory);
        paging.detail_block.hard_quota = share(paging.detail_block.hard_quota);
        paging.detail_block.soft_quota = share(paging.detail_block.soft_quota);
        let limit = paging.mt_partition.memory.limit();
        if together < objects && limit != u64::MAX {
            let part = u128::from(limit) * u128::from(together) / u128::from(objects);
            paging.mt_partition.memory = Memory::new(part as u64);
        }
        if together > 0 && paging.mt_partition.reader.is_none() {
            paging.mt_partition.reader = Some(Reader::new()?);
        }
        Ok(paging)
    }

    fn tree(
        &self,
        object: &StoredObject,
        settings: Settings,
        paging: &ScenePaging,
    ) -> Result<Box<dyn AnyObject>, StoredSceneError> {
        let at = &object.at;
        let wrap = |source| StoredSceneError::File { at: Box::new(at.clone()), source };
        let store = &self.files[object.file];
        let depends = store.backend().has_dependencies(paging.meta_node.dependencies);
        match store {
            Store::InMemory(hierarchy, _) => {
                place(InMemoryTree::new(hierarchy.clone()), object, settings, paging.waits, depends)
            }
            Store::MetaNode(file) => {
                let tree = MetaNodeTree::new(file.clone(), paging.meta_node).map_err(|e| wrap(e.into()))?;
                place(tree, object, settings, paging.waits, depends)
            }
            Store::DetailBlock(file) => {
                let tree = XfmTree::new(file.clone(), paging.detail_block).map_err(|e| wrap(e.into()))?;
                place(tree, object, settings, paging.waits, depends)
            }
            Store::MtPartition(file) => {
                let tree = MtTree::new(file.clone(), paging.mt_partition.clone());
                place(tree.map_err(|e| wrap(e.into()))?, object, settings, paging.waits, depends)
            }
        }
    }

    /// Of each object, what its cut is by brute force: all of its file is read.
    ///
    /// # Errors
    /// What the trees report.
    pub fn brute_force(&self) -> Result<Vec<BruteForce>, StoredSceneError> {
        let mut of_files: Vec<Option<BruteForce>> = vec![None; self.files.len()];
        let paging = self.shared(&ScenePaging::default())?;
        let all = self.objects.iter().map(|object| {
            let known = match &of_files[object.file] {
                Some(known) => known.clone(),
                None => self.tree(object, Settings::default(), &paging)?.brute_force(&object.at)?,
            };
            of_files[object.file] = Some(known.clone());
            Ok(known)
        });
        all.collect()
    }

    /// Replays views of the scene, and calls `after` with each frame's report, until that breaks off. Without a time for a frame, each waits for its
    /// pages, and what all of its advances did is reported as one; otherwise so much virtual time passes before each.
    ///
    /// # Errors
    /// See [`trees`](Self::trees); [`StoredSceneError::Tree`] and [`StoredSceneError::View`] with the line of the object.
    pub fn replay(
        &self,
        views: &[View],
        settings: Settings,
        paging: &ScenePaging,
        frame_time: Option<Duration>,
        mut after: impl FnMut(usize, &mut StoredObjects, FrameReport) -> ControlFlow<()>,
    ) -> Result<(), StoredSceneError> {
        let mut objects = self.trees(settings, paging)?;
        for (frame, view) in views.iter().enumerate() {
            let views = std::slice::from_ref(view);
            // A viewer shows nothing before it has what its first frame needs.
            let is_settled = frame == 0 || frame_time.is_none() || paging.waits;
            if let Some(time) = frame_time.filter(|_| frame > 0) {
                objects.pass(time)?;
            }
            let mut all = objects.advance(views)?;
            for _ in 0..ROUNDS {
                if !is_settled || all.misses == 0 {
                    break;
                }
                let waited = objects.settle()?;
                let report = objects.advance(views)?;
                all = all.followed_by(&report);
                // In real time only those wait that are said to.
                if frame_time.is_none() || paging.waits {
                    all.pages.stalled += waited;
                }
            }
            if after(frame, &mut objects, all).is_break() {
                break;
            }
        }
        Ok(())
    }
}

/// An engine over a tree, at its place in the scene.
fn place<T: Refine<NullSink> + 'static>(
    tree: T,
    object: &StoredObject,
    settings: Settings,
    waits: bool,
    depends: bool,
) -> Result<Box<dyn AnyObject>, StoredSceneError> {
    let StoredObject { at, placement, .. } = object;
    let placed = Object::new(Settled::waiting(tree, waits), NullSink, *placement, settings);
    let placed = placed.map_err(|source| StoredSceneError::Tree { at: Box::new(at.clone()), source })?;
    Ok(Box::new((placed, depends)))
}

/// Opens the file of an object.
fn open(at: &ObjectLine, options: &simplify::Options) -> Result<Store, StoredSceneError> {
    let wrong = |source| StoredSceneError::File { at: Box::new(at.clone()), source };
    match Store::open(&at.file) {
        Err(StoreError::Foreign { .. }) => {}
        opened => return opened.map_err(wrong),
    }
    let mesh = mesh_io::read(&[&at.file], &mut |_, _| ());
    let mesh = mesh.map_err(|source| StoredSceneError::Mesh { at: Box::new(at.clone()), source })?;
    let built = simplify::build(mesh, options, &mut |_, _| ());
    let (log, _) = built.map_err(|source| StoredSceneError::Build { at: Box::new(at.clone()), source })?;
    Store::in_memory(Arc::new(log)).map_err(wrong)
}
