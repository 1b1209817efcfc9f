//! Bounds of merged nodes, nested over the whole graph.
//!
//! A merged node gets a sphere around those of its collapses, and the largest of their errors. Its children may have
//! grown by merging too, so nodes are gone through from the drain upwards, and each is enlarged until it holds every
//! child. Where the largest of all these spheres holds the others already, as it does for a node that is a single
//! collapse, it is taken as it is, bit for bit.

use vertex_tree::Bounds;

/// Whether `outer` wants to be unfolded wherever `inner` does, with room for rounding.
pub(crate) fn holds(outer: &Bounds, inner: &Bounds) -> bool {
    let room = f64::from(outer.radius) - f64::from(inner.radius) - distance(center(outer), center(inner));
    outer == inner || (room >= f64::from(outer.radius) * ROOM && outer.eps >= inner.eps)
}

/// Room between nested spheres, as a share of the larger radius: what the engine asks for is half of it.
const ROOM: f64 = 1.0 / (1 << 20) as f64;
/// What is left here.
const SLACK: f64 = 2.0 * ROOM;

/// Bounds that hold all of `parts`, of which there is at least one.
pub(crate) fn around(parts: &[Bounds]) -> Bounds {
    let eps = parts.iter().map(|b| b.eps).fold(0.0, f32::max);
    let mut largest = parts[0];
    for part in parts {
        if part.radius > largest.radius {
            largest = *part;
        }
    }
    let largest = Bounds { eps, ..largest };
    if parts.iter().all(|part| holds(&largest, part)) {
        return largest;
    }
    // The hull of the largest and whatever reaches out farthest, again and again.
    let (mut middle, mut radius) = (center(&largest), f64::from(largest.radius));
    for _ in 0..STEPS {
        let reach = |b: &Bounds| distance(middle, center(b)) + f64::from(b.radius);
        let farthest = parts.iter().max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap_or(&parts[0]);
        let excess = reach(farthest) - radius;
        if excess <= 0.0 {
            break;
        }
        let (away, apart) = (center(farthest), distance(middle, center(farthest)));
        radius += 0.5 * excess;
        middle = std::array::from_fn(|i| middle[i] + (away[i] - middle[i]) * (0.5 * excess / apart));
    }
    let middle = middle.map(|x| x as f32);
    let reach = |b: &Bounds| distance(middle.map(f64::from), center(b)) + f64::from(b.radius);
    let radius = parts.iter().map(reach).fold(0.0, f64::max) * (1.0 + SLACK);
    Bounds { center: middle, radius: round_up(radius), eps }
}

const STEPS: u32 = 16;

fn center(b: &Bounds) -> [f64; 3] {
    b.center.map(f64::from)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt()
}

fn round_up(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}
