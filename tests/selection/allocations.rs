//! A frame in the steady state allocates nothing.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use crate::common::foreseen::Foreseen;
use crate::common::{bumpy_grid, random_log, random_view, seeded};
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::budget::WorkCap;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::walk::turned;
use in_memory::{InMemoryHierarchy, InMemoryTree};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed on unchanged to the system's allocator.
#[expect(unsafe_code, reason = "an allocator can not be had without")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_path_that_has_been_walked_before_allocates_nothing() {
    let strategies = [Strategy::TopDown, Strategy::Front, Strategy::Event];
    // With and without looking ahead, and with changes carried from frame to frame.
    let ways = [(0, WorkCap::None), (4, WorkCap::None), (0, WorkCap::Changes(2))];
    for (strategy, (look_ahead, work_cap)) in
        strategies.into_iter().flat_map(|strategy| ways.map(|way| (strategy, way)))
    {
        let mut random = seeded(22);
        let log = random_log(bumpy_grid(40, &mut random), &mut random);
        let tree = InMemoryTree::new(Arc::new(InMemoryHierarchy::new(&log).unwrap()));
        let tree = Foreseen::new(tree, look_ahead);
        let mesh = ActiveMesh::new();
        let settings = Settings { strategy, work_cap, rho: 0.01, omega: 0.01, ..Settings::default() };
        let mut engine = Engine::new(tree, mesh, settings).unwrap();
        // There and back again, so that the end of one round is the start of the next.
        let mut view = random_view(&mut random);
        let mut views: Vec<View> = Vec::new();
        for _ in 0..150 {
            view = view.with_eye(view.eye() - view.eye() * 0.002).unwrap();
            view = turned(view, 0.004, &mut random);
            views.push(view);
        }
        views.extend_from_within(1..149);
        views[150..].reverse();
        let mut walk = |rounds: usize| {
            let before = ALLOCATIONS.get();
            let (mut changes, mut foreseen, mut carried) = (0, 0, 0);
            for view in std::iter::repeat_n(&views, rounds).flatten() {
                let report = engine.advance(std::slice::from_ref(view)).unwrap();
                engine.sink_mut().clear_changes();
                changes += report.unfolds + report.folds;
                foreseen += report.foreseen;
                carried += report.carried;
            }
            (ALLOCATIONS.get() - before, changes, foreseen, carried)
        };
        // Buffers grow to what the path asks for.
        let (first, ..) = walk(200);
        let (later, changes, foreseen, carried) = walk(20);
        assert_eq!(carried > 300, work_cap != WorkCap::None, "{strategy:?}, {work_cap:?}: {carried} carried");
        assert_eq!(foreseen > changes / 2, look_ahead > 0, "{strategy:?}: {foreseen} foreseen of {changes}");
        assert!(first > 0 && changes > 1000, "{strategy:?}: {first} allocations, {changes} changes");
        assert_eq!(later, 0, "{strategy:?}, {look_ahead} frames ahead, {work_cap:?}");
    }
}
