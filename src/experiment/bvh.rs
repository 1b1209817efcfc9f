//! The nearest point on a triangle soup, by a flat bounding-volume hierarchy.
//!
//! By hand: the bits of every answer depend on the order of its operations, and a library may change that.
//!
//! The hierarchy is split by the surface area heuristic over bins of the widest axis (Wald 2007, "On fast
//! Construction of SAH-based Bounding Volume Hierarchies"). Boxes are exact, since coordinates are `f32`; distances
//! are computed in `f64`. The tree and every answer are the same whatever the number of threads.

use collapse_log::Mesh;
use glam::DVec3;
use rayon::prelude::*;

/// Triangles in a leaf, at most.
const LEAF: usize = 4;
/// Bins of the surface area heuristic.
const BINS: usize = 16;
/// Below this depth ranges are split at the median, so that what is left of the tree is balanced.
const DEEPEST_BINNED: u32 = 32;
/// Depth of the tree, at most: [`DEEPEST_BINNED`] levels, and halvings of fewer than 2^32 triangles.
const STACK: usize = 64;
/// The top of the tree is built by one thread, until the ranges are this fraction of the whole.
const PIECES: usize = 32;

/// A bounding-volume hierarchy over the triangles of a mesh, of which it keeps a copy.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    /// The root first; the two children of an inner node are neighbours. Empty if there are no triangles.
    nodes: Vec<Node>,
    /// Corners of the triangles in the order of the leaves.
    corners: Vec<[[f32; 3]; 3]>,
    /// Number in the mesh of each triangle of `corners`.
    triangles: Vec<u32>,
}

/// The point of the soup that is nearest to some other point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// How far away it is, in object units.
    pub distance: f64,
    /// A triangle of the mesh on which it lies.
    pub triangle: u32,
    /// Where it is, in object space.
    pub point: DVec3,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    lo: [f32; 3],
    /// The first triangle of a leaf, the first child of an inner node.
    first: u32,
    hi: [f32; 3],
    /// The number of triangles of a leaf, 0 for an inner node.
    count: u32,
}

impl Node {
    fn distance_squared(&self, point: DVec3) -> f64 {
        let lo = DVec3::from(self.lo.map(f64::from));
        let hi = DVec3::from(self.hi.map(f64::from));
        (point - point.clamp(lo, hi)).length_squared()
    }
}

impl Bvh {
    /// Builds the hierarchy in time O(n log n). Every index of the mesh must be in range.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let corners_of =
            |triangle: u32| mesh.triangles[triangle as usize].map(|v| mesh.positions[v as usize]);
        let mut items: Vec<Item> =
            (0u32..).take(mesh.triangles.len()).map(|t| Item::new(t, corners_of(t))).collect();
        if items.is_empty() {
            return Self::default();
        }
        let nodes = build(&mut items);
        let triangles: Vec<u32> = items.iter().map(|item| item.triangle).collect();
        let corners = triangles.iter().map(|&t| corners_of(t)).collect();
        Self { nodes, corners, triangles }
    }

    /// The point of the soup nearest to `point`, if it is at most `within` away; nothing further away is looked at.
    #[must_use]
    pub fn nearest(&self, point: DVec3, within: f64) -> Option<Nearest> {
        let mut best_squared = within * within;
        let mut best = None;
        let mut stack = [(0.0, 0u32); STACK];
        let mut height = 0;
        let mut next = (!self.nodes.is_empty()).then_some(0u32);
        while let Some(number) = next {
            let node = &self.nodes[number as usize];
            if node.count > 0 {
                let first = node.first as usize;
                for slot in first..first + node.count as usize {
                    let corners = self.corners[slot].map(|p| DVec3::from(p.map(f64::from)));
                    let on_triangle = nearest_on_triangle(point, corners);
                    let distance_squared = point.distance_squared(on_triangle);
                    if distance_squared < best_squared || best.is_none() && distance_squared == best_squared {
                        best_squared = distance_squared;
                        best = Some((slot, on_triangle));
                    }
                }
            } else {
                let children = [node.first, node.first + 1]
                    .map(|child| (self.nodes[child as usize].distance_squared(point), child));
                let [near, far] =
                    if children[1].0 < children[0].0 { [children[1], children[0]] } else { children };
                for child in [far, near] {
                    if child.0 <= best_squared {
                        stack[height] = child;
                        height += 1;
                    }
                }
            }
            next = loop {
                if height == 0 {
                    break None;
                }
                height -= 1;
                let (distance_squared, number) = stack[height];
                // At equal distances the answer that there already is will do.
                if distance_squared < best_squared || best.is_none() {
                    break Some(number);
                }
            };
        }
        best.map(|(slot, point)| Nearest {
            distance: best_squared.sqrt(),
            triangle: self.triangles[slot],
            point,
        })
    }
}

/// The point of a triangle that is nearest to `p`. After Ericson, Real-Time Collision Detection (2005), 5.1.5.
#[must_use]
pub fn nearest_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    // A needle this thin is as good as its edges, and the quotients below could be 0/0.
    const THINNEST_SINE: f64 = 1e-12;
    let area_squared = ab.cross(ac).length_squared();
    if area_squared <= THINNEST_SINE * THINNEST_SINE * ab.length_squared() * ac.length_squared() {
        let on_edges = [(a, b), (b, c), (c, a)].map(|(from, to)| nearest_on_segment(p, from, to));
        return on_edges
            .into_iter()
            .fold(a, |best, q| if q.distance_squared(p) < best.distance_squared(p) { q } else { best });
    }
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + (ab * vb + ac * vc) / (va + vb + vc)
}

fn nearest_on_segment(p: DVec3, from: DVec3, to: DVec3) -> DVec3 {
    let along = to - from;
    let length_squared = along.length_squared();
    if length_squared > 0.0 {
        from + along * ((p - from).dot(along) / length_squared).clamp(0.0, 1.0)
    } else {
        from
    }
}

/// A triangle while the hierarchy is being built.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    triangle: u32,
}

impl Item {
    fn new(triangle: u32, corners: [[f32; 3]; 3]) -> Self {
        Self { bounds: corners.into_iter().fold(Aabb::EMPTY, Aabb::with), triangle }
    }

    /// Centre of the box, which may lie outside it by rounding. Halves are added, as the sum may overflow.
    fn center(&self) -> [f32; 3] {
        std::array::from_fn(|axis| 0.5 * self.bounds.lo[axis] + 0.5 * self.bounds.hi[axis])
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy)]
struct Aabb {
    lo: [f32; 3],
    hi: [f32; 3],
}

impl Aabb {
    const EMPTY: Self = Self { lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };

    fn with(self, p: [f32; 3]) -> Self {
        self.union(Self { lo: p, hi: p })
    }

    fn union(self, other: Self) -> Self {
        // Plain comparisons compile to one instruction each, where `f32::min` has to mind NaN.
        let lo = |axis: usize| if other.lo[axis] < self.lo[axis] { other.lo[axis] } else { self.lo[axis] };
        let hi = |axis: usize| if other.hi[axis] > self.hi[axis] { other.hi[axis] } else { self.hi[axis] };
        Self { lo: [lo(0), lo(1), lo(2)], hi: [hi(0), hi(1), hi(2)] }
    }

    /// Half the surface, in `f64` as its square may overflow; 0 for an empty box.
    fn half_area(self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| (f64::from(self.hi[axis]) - f64::from(self.lo[axis])).max(0.0));
        x * y + y * z + z * x
    }
}

/// A node whose triangles are not split any further for now.
struct Pending {
    node: usize,
    depth: u32,
}

/// Orders the items, and builds the nodes over them: the top first, then its pieces in parallel.
fn build(items: &mut [Item]) -> Vec<Node> {
    let (mut nodes, mut pending) = grow(items, 0, 0, (items.len() / PIECES).max(LEAF));
    pending.sort_unstable_by_key(|p| nodes[p.node].first);
    let mut pieces = Vec::new();
    let mut rest = items;
    let mut rest_at = 0;
    for Pending { node, depth } in pending {
        let (first, count) = (nodes[node].first as usize, nodes[node].count as usize);
        let (piece, after) = rest.split_at_mut(first - rest_at).1.split_at_mut(count);
        pieces.push((node, first, depth, piece));
        (rest, rest_at) = (after, first + count);
    }
    let subtree = |(node, first, depth, piece)| (node, grow(piece, first, depth, LEAF).0);
    let subtrees: Vec<_> = pieces.into_par_iter().map(subtree).collect();
    for (node, subtree) in subtrees {
        // The root of the subtree takes the place of `node`, the others follow the nodes that there are.
        let offset = nodes.len() as u32 - 1;
        let moved = |n: Node| if n.count == 0 { Node { first: n.first + offset, ..n } } else { n };
        nodes[node] = moved(subtree[0]);
        nodes.extend(subtree[1..].iter().map(|&n| moved(n)));
    }
    nodes
}

/// Orders `items`, which start at number `first` and whose node is at `depth`, and builds nodes over them down to
/// ranges of at most `stop` items. Those that are too many for a leaf are also returned.
fn grow(items: &mut [Item], first: usize, depth: u32, stop: usize) -> (Vec<Node>, Vec<Pending>) {
    let node_over = |items: &[Item], start: usize| {
        let Aabb { lo, hi } = items.iter().fold(Aabb::EMPTY, |b, item| b.union(item.bounds));
        Node { lo, first: (first + start) as u32, hi, count: items.len() as u32 }
    };
    let mut nodes = vec![node_over(items, 0)];
    let mut pending = Vec::new();
    let mut stack = vec![(0, 0..items.len(), depth)];
    while let Some((node, range, depth)) = stack.pop() {
        if range.len() <= stop {
            if range.len() > LEAF {
                pending.push(Pending { node, depth });
            }
            continue;
        }
        let middle = range.start + split(&mut items[range.clone()], depth < DEEPEST_BINNED);
        let child = nodes.len();
        nodes[node].first = child as u32;
        nodes[node].count = 0;
        for (child, half) in [(child, range.start..middle), (child + 1, middle..range.end)] {
            nodes.push(node_over(&items[half.clone()], half.start));
            stack.push((child, half, depth + 1));
        }
    }
    (nodes, pending)
}

/// Orders at least two items so that those before the returned number make one good node and the rest another.
fn split(items: &mut [Item], binned: bool) -> usize {
    let centers = items.iter().fold(Aabb::EMPTY, |b, item| b.with(item.center()));
    let extent: [f32; 3] = std::array::from_fn(|axis| centers.hi[axis] - centers.lo[axis]);
    let axis = (1..3).fold(0, |widest, axis| if extent[axis] > extent[widest] { axis } else { widest });
    let scale = BINS as f32 / extent[axis];
    if binned && extent[axis] > 0.0 && scale.is_finite() {
        // Rounding can only push a centre past the last bin, never out of order.
        let bin_of =
            |item: &Item| (((item.center()[axis] - centers.lo[axis]) * scale) as usize).min(BINS - 1);
        let cut = cheapest_cut(items, bin_of);
        let middle = partition(items, |item| bin_of(item) < cut);
        if (1..items.len()).contains(&middle) {
            return middle;
        }
    }
    let middle = items.len() / 2;
    let key = |item: &Item| (item.center()[axis], item.triangle);
    items.select_nth_unstable_by(middle, |a, b| {
        let ((a, t), (b, u)) = (key(a), key(b));
        a.total_cmp(&b).then(t.cmp(&u))
    });
    middle
}

/// The number of bins before the cut at which the expected cost, the sum over both halves of surface times count,
/// is least.
fn cheapest_cut(items: &[Item], bin_of: impl Fn(&Item) -> usize) -> usize {
    let mut bins = [(Aabb::EMPTY, 0usize); BINS];
    for item in items {
        let (bounds, count) = &mut bins[bin_of(item)];
        *bounds = bounds.union(item.bounds);
        *count += 1;
    }
    // Cost of the bins from each one on, then, in a sweep from the front, of those before it.
    let mut after = [0.0; BINS];
    let (mut bounds, mut count) = (Aabb::EMPTY, 0);
    for (cost, bin) in after.iter_mut().zip(&bins).rev() {
        (bounds, count) = (bounds.union(bin.0), count + bin.1);
        *cost = bounds.half_area() * count as f64;
    }
    let (mut bounds, mut count) = (Aabb::EMPTY, 0);
    let mut cheapest = (f64::INFINITY, BINS / 2);
    for cut in 1..BINS {
        (bounds, count) = (bounds.union(bins[cut - 1].0), count + bins[cut - 1].1);
        let cost = bounds.half_area() * count as f64 + after[cut];
        // A cut with nothing on one side is none.
        if count > 0 && count < items.len() && cost < cheapest.0 {
            cheapest = (cost, cut);
        }
    }
    cheapest.1
}

/// Moves the items that pass to the front, and says how many they are.
fn partition(items: &mut [Item], passes: impl Fn(&Item) -> bool) -> usize {
    let mut front = 0;
    for i in 0..items.len() {
        if passes(&items[i]) {
            items.swap(front, i);
            front += 1;
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;
    use proptest::prelude::*;

    /// By another road than the code: the foot of the perpendicular where it falls inside, else the nearest edge.
    fn distance_by_projection(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
        let normal = (b - a).cross(c - a);
        let edges = [(a, b), (b, c), (c, a)];
        let inside = edges.iter().all(|&(from, to)| (to - from).cross(p - from).dot(normal) >= 0.0);
        if inside && normal.length() > 0.0 {
            return ((p - a).dot(normal) / normal.length()).abs();
        }
        edges
            .iter()
            .map(|&(from, to)| nearest_on_segment(p, from, to).distance(p))
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn face_edge_and_corner_are_told_apart() {
        let triangle = [dvec3(0.0, 0.0, 0.0), dvec3(2.0, 0.0, 0.0), dvec3(0.0, 2.0, 0.0)];
        for (p, expected) in [
            (dvec3(0.5, 0.5, 3.0), dvec3(0.5, 0.5, 0.0)),
            (dvec3(-1.0, -1.0, 1.0), dvec3(0.0, 0.0, 0.0)),
            (dvec3(4.0, -1.0, 0.0), dvec3(2.0, 0.0, 0.0)),
            (dvec3(-1.0, 4.0, 0.0), dvec3(0.0, 2.0, 0.0)),
            (dvec3(1.0, -2.0, 1.0), dvec3(1.0, 0.0, 0.0)),
            (dvec3(-2.0, 1.0, 1.0), dvec3(0.0, 1.0, 0.0)),
            (dvec3(2.0, 2.0, 5.0), dvec3(1.0, 1.0, 0.0)),
        ] {
            assert_eq!(nearest_on_triangle(p, triangle), expected, "from {p}");
        }
    }

    #[test]
    fn triangles_without_area_are_segments_and_points() {
        let (a, b, c) = (dvec3(0.0, 0.0, 0.0), dvec3(2.0, 0.0, 0.0), dvec3(1.0, 0.0, 0.0));
        let p = dvec3(1.5, 1.0, 0.0);
        for corners in [[a, b, c], [c, a, b], [a, a, b], [a, b, a], [b, a, a]] {
            assert_eq!(nearest_on_triangle(p, corners), dvec3(1.5, 0.0, 0.0), "{corners:?}");
        }
        assert_eq!(nearest_on_triangle(p, [c, c, c]), c);
    }

    #[test]
    fn an_empty_soup_has_no_nearest_point() {
        let bvh = Bvh::new(&Mesh::default());
        assert_eq!(bvh.nearest(DVec3::ZERO, f64::INFINITY), None);
    }

    #[test]
    fn nothing_further_than_the_limit_is_found() {
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let bvh = Bvh::new(&Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() });
        let above = dvec3(0.25, 0.25, 2.0);
        assert_eq!(bvh.nearest(above, 1.9), None);
        assert_eq!(bvh.nearest(above, 2.0).unwrap().distance, 2.0);
    }

    /// Ever smaller triangles towards the origin, where each split takes few away: the tree must not get deeper
    /// than the stack of a query.
    #[test]
    #[expect(clippy::disallowed_methods, reason = "powers of two are exact")]
    fn a_soup_that_shrinks_geometrically_is_searched_through() {
        let mut mesh = Mesh::default();
        for level in 0..2000 {
            let size = 2f32.powf(-(level % 140) as f32);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([[size, 0.0, 0.0], [size, size, 0.0], [size, 0.0, size]]);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        let bvh = Bvh::new(&mesh);
        let nearest = bvh.nearest(dvec3(-1.0, 0.0, 0.0), f64::INFINITY).unwrap();
        assert!((nearest.distance - 1.0).abs() < 1e-12);
    }

    fn soup(coordinate: impl Strategy<Value = f32> + Clone) -> impl Strategy<Value = Mesh> {
        let point = [coordinate.clone(), coordinate.clone(), coordinate];
        prop::collection::vec(prop::array::uniform3(point), 1..200).prop_map(|triangles| Mesh {
            triangles: (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            positions: triangles.into_iter().flatten().collect(),
            ..Mesh::default()
        })
    }

    fn check(mesh: &Mesh, queries: &[[f32; 3]]) -> Result<(), TestCaseError> {
        let bvh = Bvh::new(mesh);
        let corners =
            |t: usize| mesh.triangles[t].map(|v| DVec3::from(mesh.positions[v as usize].map(f64::from)));
        for query in queries {
            let p = DVec3::from(query.map(f64::from));
            let brute = (0..mesh.triangles.len())
                .map(|t| distance_by_projection(p, corners(t)))
                .fold(f64::INFINITY, f64::min);
            let found = bvh.nearest(p, f64::INFINITY).unwrap();
            prop_assert!((found.distance - brute).abs() <= 1e-9, "{} but {brute}", found.distance);
            let own = distance_by_projection(found.point, corners(found.triangle as usize));
            prop_assert!(own <= 1e-9, "the point is {own} off its triangle");
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn agrees_with_every_triangle_tried(
            mesh in soup(-1.0f32..1.0),
            queries in prop::collection::vec(prop::array::uniform3(-2.0f32..2.0), 20),
        ) {
            check(&mesh, &queries)?;
        }

        /// On a coarse lattice triangles without area, doubled ones and equal distances abound.
        #[test]
        fn agrees_on_degenerate_soups(
            mesh in soup((-2i8..3).prop_map(f32::from)),
            queries in prop::collection::vec(prop::array::uniform3((-4i8..5).prop_map(f32::from)), 20),
        ) {
            check(&mesh, &queries)?;
        }
    }
}
