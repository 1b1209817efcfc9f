//! The triangles of the multi-triangulation: every triangle that the simplification went through.
//!
//! A half-edge collapse takes away the triangles around the removed vertex and puts those that do not vanish back with
//! a corner at the kept one. So each *version* of an input triangle is made by one collapse (or is the input's own) and
//! taken away by one later collapse (or is the base mesh's own). Seen from the base mesh, De Floriani, Magillo & Puppo
//! (1997): it lies on exactly one arc, from the node of the collapse that takes it away to the node of the collapse that
//! makes it, and is displayed while the first is unfolded and the second is not.
//!
//! At boundaries that is not all. When an ear vanishes, its tip is merged away, and its other corners may be left
//! without a new triangle to show for it. Were such a corner removed while the ear is back, the ear would stay behind.
//! The collapse that removes the corner depends on the one that took the ear: an arc without triangles.

use vertex_tree::{CollapseLog, NONE};

/// A triangle while a certain set of collapses is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Version {
    /// Input vertices, counter-clockwise.
    pub corners: [u32; 3],
    /// The collapse that takes it away; [`NONE`] for a triangle of the base mesh.
    pub above: u32,
    /// The collapse that makes it; [`NONE`] for a triangle of the input.
    pub below: u32,
}

/// All versions, and the dependencies that no version stands for, as (above, below).
#[derive(Debug, Default)]
pub(crate) struct Versions {
    pub triangles: Vec<Version>,
    pub bare: Vec<(u32, u32)>,
}

/// The mesh in the course of the replay.
struct Replay {
    corners: Vec<[u32; 3]>,
    maker: Vec<u32>,
    /// For each vertex the first corner of its list, and for each corner the next; corner `i` of triangle `t` is
    /// `3 t + i`. Corners of triangles that have vanished stay in the lists of other vertices.
    first: Vec<u32>,
    next: Vec<u32>,
    /// For each vertex, the collapse that last took a triangle from it and gave it none.
    trace: Vec<u32>,
    /// For each vertex, the collapse that last merged another into it, if that made no triangle at all.
    barren: Vec<u32>,
}

/// Replays a log that [`CollapseLog::forest`] accepts.
pub(crate) fn versions(log: &CollapseLog) -> Versions {
    let mesh = &log.mesh;
    let mut replay = Replay {
        corners: mesh.triangles.clone(),
        maker: vec![NONE; mesh.triangles.len()],
        first: vec![NONE; mesh.positions.len()],
        next: vec![NONE; 3 * mesh.triangles.len()],
        trace: vec![NONE; mesh.positions.len()],
        barren: vec![NONE; mesh.positions.len()],
    };
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.triangles[t];
        if a == b || b == c || c == a {
            // Never shown.
            replay.corners[t] = [NONE; 3];
            continue;
        }
        for i in 0..3 {
            replay.link(t, i);
        }
    }
    let mut versions = Versions::default();
    versions.triangles.reserve(3 * mesh.triangles.len());
    let mut star = Vec::new();
    for (n, c) in log.collapses.iter().enumerate() {
        replay.collapse(n as u32, [c.removed, c.kept], &mut star, &mut versions);
    }
    for (corners, &below) in replay.corners.iter().zip(&replay.maker) {
        if corners[0] != NONE {
            versions.triangles.push(Version { corners: *corners, above: NONE, below });
        }
    }
    versions
}

impl Replay {
    fn link(&mut self, triangle: usize, index: usize) {
        let (corner, vertex) = (3 * triangle + index, self.corners[triangle][index] as usize);
        self.next[corner] = self.first[vertex];
        self.first[vertex] = corner as u32;
    }

    fn collapse(&mut self, n: u32, [removed, kept]: [u32; 2], star: &mut Vec<u32>, versions: &mut Versions) {
        star.clear();
        let mut corner = std::mem::replace(&mut self.first[removed as usize], NONE);
        while corner != NONE {
            if self.corners[corner as usize / 3][0] != NONE {
                star.push(corner);
            }
            corner = self.next[corner as usize];
        }
        // In the order of the input, whatever the lists have been through.
        star.sort_unstable();
        let vanishes = |corners: &[u32; 3]| corners.contains(&kept);
        let remains = |vertex: u32| {
            star.iter().any(|&c| {
                let corners = &self.corners[c as usize / 3];
                corners.contains(&vertex) && !vanishes(corners)
            })
        };
        let mut bereaved: Vec<u32> = star
            .iter()
            .flat_map(|&c| self.corners[c as usize / 3])
            .filter(|&v| v != removed && v != kept && !remains(v))
            .filter(|_| star.iter().any(|&c| vanishes(&self.corners[c as usize / 3])))
            .collect();
        bereaved.sort_unstable();
        bereaved.dedup();
        let traces = bereaved.iter().chain([&removed]).map(|&v| self.trace[v as usize]);
        let barren = [removed, kept].map(|v| self.barren[v as usize]);
        versions.bare.extend(traces.chain(barren).filter(|&m| m != NONE).map(|m| (n, m)));
        for vertex in bereaved {
            self.trace[vertex as usize] = n;
        }
        let makes_none = star.iter().all(|&c| vanishes(&self.corners[c as usize / 3]));
        self.barren[kept as usize] = if makes_none { n } else { NONE };
        for &c in &*star {
            let (t, i) = (c as usize / 3, c as usize % 3);
            versions.triangles.push(Version { corners: self.corners[t], above: n, below: self.maker[t] });
            if vanishes(&self.corners[t]) {
                self.corners[t] = [NONE; 3];
            } else {
                self.maker[t] = n;
                self.corners[t][i] = kept;
                self.link(t, i);
            }
        }
    }
}
