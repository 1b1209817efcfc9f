//! Queue operations, at the sizes of a large front.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use foldfront::Bounds;
use foldfront::selection::in_play::{Kind, Slot};
use foldfront::selection::queue::{DUE, Event, EventQueue};

const EVENTS: u32 = 100_000;
const BOUNDS: Bounds = Bounds { center: [0.0; 3], radius: 1.0, eps: 0.0 };

/// Deadlines as they occur: a few soon, most far.
fn frames_ahead(node: u32) -> f64 {
    let spread = f64::from(node.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
    1.0 / (spread + 1e-3)
}

fn filled() -> EventQueue {
    let mut queue = EventQueue::new(1);
    for node in 0..EVENTS {
        let event = queue.event(Slot(node), Kind::Unfold, BOUNDS);
        queue.schedule(0, frames_ahead(node), event);
    }
    queue
}

fn operations(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("queue");
    group.throughput(Throughput::Elements(u64::from(EVENTS)));
    group.bench_function("schedule", |b| b.iter(filled));
    group.bench_function("cancel", |b| {
        b.iter_batched_ref(
            filled,
            |queue| (0..EVENTS).for_each(|node| queue.cancel(Slot(node))),
            BatchSize::LargeInput,
        );
    });
    group.bench_function("advance and reschedule, 50 frames", |b| {
        let mut due = [Event::BLANK; DUE];
        b.iter_batched_ref(
            filled,
            |queue| {
                for frame in 1..=50 {
                    let now = f64::from(frame);
                    queue.advance(0, now);
                    loop {
                        let count = queue.next_due(&mut due);
                        if count == 0 {
                            break;
                        }
                        for event in &due[..count] {
                            queue.schedule(0, frames_ahead(event.slot.0), *event);
                        }
                    }
                }
            },
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

criterion_group!(benches, operations);
criterion_main!(benches);
