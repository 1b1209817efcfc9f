//! How far the input lies from the simplified surface: removed vertices as sample points.
//!
//! Every removed vertex stays behind as a sample point of the triangle that it lies nearest to, in a linked list
//! through the vertices. A collapse replaces the star of a vertex; the points of the star, and the vertex itself,
//! are measured against the triangles that take its place and handed to the nearest. The largest distance is the
//! error of the collapse: the one-sided Hausdorff distance from the input vertices below to the surface shown
//! (compare Cohen, Varshney et al., "Simplification envelopes" 1996, and Ciampalini et al., "Multiresolution
//! decimation based on global error" 1997, who keep points for each triangle in the same way).
//!
//! A vertex that was removed from a boundary, or another edge that does not join exactly two triangles, must stay
//! close to such an edge, and not to just any triangle: a filled bay is an error although nothing is far from the
//! surface. Such points are measured against the edges when one of them changes.

use glam::Vec3;
use vertex_tree::NONE;

use super::closest::{Face, segment_distance_squared};

/// Sample points that a triangle keeps at most. With more, every second goes to those with the largest distances,
/// the rest are an even selection.
const MOST_POINTS: usize = 12;

/// A sample point, the face that it is nearest to, and the squared distance.
#[derive(Clone, Copy, Debug)]
struct Placed {
    face: u32,
    distance_squared: f32,
    point: u32,
}

/// The sample points of all triangles, and room for measuring one collapse.
#[derive(Debug)]
pub(super) struct Samples {
    /// The next point of the same triangle, or `NONE`.
    next: Vec<u32>,
    faces: Vec<(u32, Face)>,
    /// Edges that the points of special edges must stay close to, and the face that gets them.
    edges: Vec<(u32, Vec3, Vec3)>,
    placed: Vec<Placed>,
    old_faces: Vec<Face>,
    /// Largest squared distance so far.
    worst: f32,
    counts: Vec<u32>,
}

impl Samples {
    pub fn new(count: usize) -> Samples {
        Samples {
            next: vec![NONE; count],
            faces: Vec::new(),
            edges: Vec::new(),
            placed: Vec::new(),
            old_faces: Vec::new(),
            worst: 0.0,
            counts: Vec::new(),
        }
    }

    /// Starts measuring a collapse.
    pub fn begin(&mut self) {
        self.faces.clear();
        self.edges.clear();
        self.placed.clear();
    }

    /// Adds a triangle that remains after the collapse.
    pub fn add_face(&mut self, triangle: u32, a: Vec3, b: Vec3, c: Vec3) {
        self.faces.push((triangle, Face::new(a, b, c)));
    }

    /// Whether any triangle has been added.
    pub fn has_faces(&self) -> bool {
        !self.faces.is_empty()
    }

    /// Adds a special edge that remains after the collapse; it belongs to the face of the given number.
    pub fn add_edge(&mut self, face: u32, a: Vec3, b: Vec3) {
        self.edges.push((face, a, b));
    }

    /// Places a list of points; `kept` is what remains where there is no triangle at all. Points that are `special`
    /// are held to the edges, if there are any.
    pub fn place_list(&mut self, mut point: u32, positions: &[Vec3], special: &[bool], kept: Vec3) {
        while point != NONE {
            self.place(point, positions, special, kept);
            point = self.next[point as usize];
        }
    }

    /// Places one point.
    pub fn place(&mut self, point: u32, positions: &[Vec3], special: &[bool], kept: Vec3) {
        let p = positions[point as usize];
        let mut placed = Placed { face: NONE, distance_squared: f32::INFINITY, point };
        if !self.edges.is_empty() && special[point as usize] {
            for &(face, a, b) in &self.edges {
                let distance_squared = segment_distance_squared(p, a, b);
                if distance_squared < placed.distance_squared {
                    placed = Placed { face, distance_squared, point };
                }
            }
        } else {
            for (face, (_, shape)) in (0..).zip(&self.faces) {
                let distance_squared = shape.distance_squared(p);
                if distance_squared < placed.distance_squared {
                    placed = Placed { face, distance_squared, point };
                }
            }
        }
        if self.faces.is_empty() {
            placed.distance_squared = placed.distance_squared.min(p.distance_squared(kept));
        }
        self.placed.push(placed);
    }

    /// Starts to measure what is new against what was there.
    pub fn begin_reverse(&mut self) {
        self.old_faces.clear();
        self.worst = self.placed.iter().fold(0.0, |worst, p| p.distance_squared.max(worst));
    }

    /// Adds a triangle that was there before the collapse.
    pub fn add_old_face(&mut self, a: Vec3, b: Vec3, c: Vec3) {
        self.old_faces.push(Face::new(a, b, c));
    }

    /// Measures a point of what is there after the collapse.
    pub fn place_reverse(&mut self, p: Vec3) {
        let mut nearest = f32::INFINITY;
        for face in &self.old_faces {
            nearest = nearest.min(face.distance_squared(p));
            if nearest <= self.worst {
                return;
            }
        }
        self.worst = nearest;
    }

    /// The largest distance of a point that was placed.
    pub fn error(&self) -> f32 {
        self.worst.sqrt()
    }

    /// Hands the points to their triangles. `set_list` is called once for every triangle that was added.
    pub fn finish(&mut self, mut set_list: impl FnMut(u32, u32)) {
        self.counts.clear();
        self.counts.resize(self.faces.len(), 0);
        for p in &self.placed {
            if let Some(count) = self.counts.get_mut(p.face as usize) {
                *count += 1;
            }
        }
        if self.counts.iter().any(|&count| count as usize > MOST_POINTS) {
            self.thin_out();
        }
        // From here on `counts` holds the heads of the lists.
        self.counts.fill(NONE);
        for p in &self.placed {
            if let Some(head) = self.counts.get_mut(p.face as usize) {
                self.next[p.point as usize] = *head;
                *head = p.point;
            }
        }
        for (&(triangle, _), &head) in self.faces.iter().zip(&self.counts) {
            set_list(triangle, head);
        }
    }

    /// Cuts every list to [`MOST_POINTS`].
    fn thin_out(&mut self) {
        self.placed.sort_unstable_by(|a, b| {
            a.face
                .cmp(&b.face)
                .then(b.distance_squared.total_cmp(&a.distance_squared))
                .then(a.point.cmp(&b.point))
        });
        let (mut kept, mut start) = (0, 0);
        while start < self.placed.len() {
            let face = self.placed[start].face;
            let count = self.placed[start..].iter().take_while(|p| p.face == face).count();
            let keep = count.min(MOST_POINTS);
            // The first half of the places goes to the largest distances, the others are spread over the rest.
            let far = keep.min(MOST_POINTS / 2);
            for i in 0..keep {
                let from =
                    if i < far || count == keep { i } else { far + (i - far) * (count - far) / (keep - far) };
                self.placed[kept] = self.placed[start + from];
                kept += 1;
            }
            start += count;
        }
        self.placed.truncate(kept);
    }
}
