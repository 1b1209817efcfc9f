//! How far the input lies from the simplified surface: removed vertices as sample points.
//!
//! Every removed vertex stays behind as a sample point of the triangle that it lies nearest to, in a linked list
//! through the vertices. A collapse replaces the star of a vertex; the points of the star, and the vertex itself,
//! are measured against the triangles that take its place and handed to the nearest. The largest distance estimates
//! the one-sided Hausdorff distance from the input below to the surface shown (Ciampalini, Cignoni, Montani &
//! Scopigno 1997, "Multiresolution decimation based on global error", keep points for each triangle in this way).
//!
//! Vertices alone are blind to an edge that passes far from the edges it crosses, where neither has a vertex: the
//! other diagonal of a bent quadrilateral. So the middles of the edges that a collapse makes are measured against the
//! star that was there before. Without this, cuts of scans and terrain close to full detail measured up to 15 times
//! their nominal error from the surface shown to the input, with it less than twice.
//!
//! A vertex that was removed from a boundary, or from another edge that does not join exactly two triangles, must
//! stay close to such an edge, and not to just any triangle: a filled bay is an error although nothing is far from the
//! surface. Such points are measured against the edges when one of them changes.
//!
//! All this is done about the removed vertex, in units of its star: so single precision is enough wherever the mesh lies
//! and however small or large the star is.

use glam::Vec3;
use vertex_tree::NONE;

use super::faces::{Faces, segment_distance_squared};

/// Sample points that a triangle keeps at most. With more, half of the places go to those with the largest distances,
/// the others to an even selection of the rest.
const MOST_POINTS: usize = 12;

/// Of more special edges than this, so many on either side of a point's own triangle are looked at.
const MANY: usize = 128;
const BESIDE: usize = 16;

/// A sample point, the face that it is nearest to, and the squared distance.
#[derive(Clone, Copy, Debug)]
struct Placed {
    face: u32,
    distance_squared: f32,
    point: u32,
}

/// An edge that must be kept to, and the face that gets the points near it.
#[derive(Clone, Copy, Debug)]
struct SpecialEdge {
    face: u32,
    ends: [Vec3; 2],
}

/// The sample points of all triangles, and the collapse that is being measured.
#[derive(Debug)]
pub(super) struct Samples {
    /// The next point of the same triangle, or `NONE`.
    pub next: Vec<u32>,
    /// For each point, its number in the whole construction, where only some are here, in any order.
    pub ids: Option<Vec<u32>>,
    /// The removed vertex, and the length that is taken for one: a power of two.
    center: Vec3,
    length: f32,
    /// The reciprocal of that.
    per_length: f32,
    /// What is there before and after the collapse.
    old: Faces,
    new: Faces,
    /// Number of the triangle for each one in `new`.
    triangles: Vec<u32>,
    edges: Vec<SpecialEdge>,
    placed: Vec<Placed>,
    worst: f32,
    /// For each new triangle, the number of its points, later the first of them.
    lists: Vec<u32>,
}

impl Samples {
    pub fn new(count: usize) -> Samples {
        Samples {
            next: vec![NONE; count],
            ids: None,
            center: Vec3::ZERO,
            length: 1.0,
            per_length: 1.0,
            old: Faces::default(),
            new: Faces::default(),
            triangles: Vec::new(),
            edges: Vec::new(),
            placed: Vec::new(),
            worst: 0.0,
            lists: Vec::new(),
        }
    }

    /// Starts measuring a collapse that removes the vertex at `center`, from which no corner of its star is farther than
    /// `reach` along any axis.
    pub fn begin(&mut self, center: Vec3, reach: f32) {
        self.center = center;
        // Only the exponent; its reciprocal must be a single-precision number too.
        let exponent = (reach.to_bits() >> 23).clamp(8, 246);
        self.length = f32::from_bits(exponent << 23);
        self.per_length = 1.0 / self.length;
        self.old.clear();
        self.new.clear();
        self.triangles.clear();
        self.edges.clear();
        self.placed.clear();
        self.worst = 0.0;
    }

    /// A point of object space about the removed vertex, in units of its star.
    pub fn local(&self, p: Vec3) -> Vec3 {
        self.shortened(p - self.center)
    }

    /// A vector of object space, in units of the star.
    pub fn shortened(&self, way: Vec3) -> Vec3 {
        way * self.per_length
    }

    /// Adds a triangle that the collapse changes, by its corners about the removed vertex.
    pub fn add_old(&mut self, corners: [Vec3; 3]) {
        self.old.push(corners);
    }

    /// Adds a triangle that there is after the collapse, by its corners about the removed vertex.
    pub fn add_new(&mut self, triangle: u32, corners: [Vec3; 3]) {
        self.triangles.push(triangle);
        self.new.push(corners);
    }

    /// Whether there is no triangle after the collapse.
    pub fn nothing_new(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Adds a special edge that there is after the collapse; it belongs to the new triangle of the given number.
    pub fn add_special_edge(&mut self, face: u32, ends: [Vec3; 2]) {
        self.edges.push(SpecialEdge { face, ends: ends.map(|p| self.local(p)) });
    }

    /// To be called between the adding and the placing.
    pub fn prepare(&mut self) {
        self.old.prepare();
        self.new.prepare();
    }

    /// Places a list of sample points. `special` says for each vertex whether it is held to the special edges, `beside` beside
    /// which of the new triangles their own was.
    pub fn place_list(
        &mut self,
        mut point: u32,
        positions: &[Vec3],
        special: &[bool],
        kept: Vec3,
        beside: usize,
    ) {
        while point != NONE {
            self.place(point, positions, special, kept, Some(beside));
            point = self.next[point as usize];
        }
    }

    /// Places one point. What remains where there is no triangle is the point `kept`.
    pub fn place(
        &mut self,
        point: u32,
        positions: &[Vec3],
        special: &[bool],
        kept: Vec3,
        beside: Option<usize>,
    ) {
        let p = self.local(positions[point as usize]);
        let (face, distance_squared) = if self.nothing_new() {
            (NONE, p.distance_squared(self.local(kept)))
        } else if !self.edges.is_empty() && special[point as usize] {
            self.edges_beside(beside).iter().fold((NONE, f32::INFINITY), |nearest, edge| {
                let distance_squared = segment_distance_squared(p, edge.ends[0], edge.ends[1]);
                if distance_squared < nearest.1 { (edge.face, distance_squared) } else { nearest }
            })
        } else {
            self.new.nearest(p, beside)
        };
        self.worst = self.worst.max(distance_squared);
        self.placed.push(Placed { face, distance_squared, point });
    }

    /// The special edges; of many, those of the new triangles near the one with number `beside`, if that is given.
    fn edges_beside(&self, beside: Option<usize>) -> &[SpecialEdge] {
        match beside {
            Some(beside) if self.edges.len() > MANY => {
                let middle = self.edges.partition_point(|edge| (edge.face as usize) < beside);
                let end = (middle + BESIDE).min(self.edges.len());
                &self.edges[middle.saturating_sub(BESIDE).min(end - BESIDE)..end]
            }
            _ => &self.edges,
        }
    }

    /// Measures a vertex that is left without triangles.
    pub fn measure_lost(&mut self, p: Vec3, kept: Vec3) {
        let [p, kept] = [p, kept].map(|p| self.local(p));
        let distance_squared =
            if self.nothing_new() { p.distance_squared(kept) } else { self.new.nearest(p, None).1 };
        self.worst = self.worst.max(distance_squared);
    }

    /// Measures the middle of some corners of the new triangles, about the removed vertex, against the old ones, the first of
    /// them those near the one with number `beside`.
    pub fn measure_reverse(&mut self, corners: &[Vec3], beside: usize) {
        let sum: Vec3 = corners.iter().sum();
        let p = sum * (1.0 / corners.len() as f32);
        self.worst = self.worst.max(self.old.distance_squared(p, self.worst, beside));
    }

    /// The largest distance so far, in object units.
    pub fn error(&self) -> f64 {
        f64::from(self.worst).sqrt() * f64::from(self.length)
    }

    /// Hands the points to their triangles. `set_list` is called once for every new triangle.
    pub fn finish(&mut self, mut set_list: impl FnMut(u32, u32)) {
        self.lists.clear();
        self.lists.resize(self.triangles.len(), 0);
        for p in &self.placed {
            if let Some(count) = self.lists.get_mut(p.face as usize) {
                *count += 1;
            }
        }
        if self.lists.iter().any(|&count| count as usize > MOST_POINTS) {
            self.thin_out();
        }
        self.lists.fill(NONE);
        for p in &self.placed {
            if let Some(first) = self.lists.get_mut(p.face as usize) {
                self.next[p.point as usize] = *first;
                *first = p.point;
            }
        }
        for (&triangle, &first) in self.triangles.iter().zip(&self.lists) {
            set_list(triangle, first);
        }
    }

    /// Cuts every list to [`MOST_POINTS`].
    fn thin_out(&mut self) {
        let ids = self.ids.as_ref();
        let id = |point: u32| ids.map_or(point, |ids| ids[point as usize]);
        self.placed.sort_unstable_by(|a, b| {
            a.face
                .cmp(&b.face)
                .then(b.distance_squared.total_cmp(&a.distance_squared))
                .then_with(|| id(a.point).cmp(&id(b.point)))
        });
        let (mut kept, mut start) = (0, 0);
        while start < self.placed.len() {
            let face = self.placed[start].face;
            let count = self.placed[start..].iter().take_while(|p| p.face == face).count();
            let far = count.min(MOST_POINTS / 2);
            let spread = count.min(MOST_POINTS) - far;
            for i in 0..far + spread {
                let from = if i < far { i } else { far + (i - far) * (count - far) / spread };
                self.placed[kept] = self.placed[start + from];
                kept += 1;
            }
            start += count;
        }
        self.placed.truncate(kept);
    }
}
