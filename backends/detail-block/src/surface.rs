//! From any triangles to a manifold half-edge mesh: what is not manifold is split apart.
//!
//! An edge is kept where it joins exactly two triangles that run along it in opposite directions and are not two sides
//! of the same three vertices. Any other edge of more than one triangle is cut: its half-edges become boundaries. Then
//! every fan of triangles around a vertex gets a vertex of its own. Triangles that name a vertex twice are never shown and
//! are left out.
//!
//! Vertices and triangles are in the order of their ranks (see [`renumber`](crate::renumber)), but nothing that the
//! file says depends on it: where one of several comes first, as a half-edge at a vertex, a fan of an input vertex, a normal
//! of a sum, it is by the input's order.

use std::io;

use bytemuck::{Pod, Zeroable};
use vertex_tree::NONE;

use crate::cone::{self, Angle};
use crate::half_edges::{BOUNDARY, HalfEdge, next, orbit, prev, triangle_of};
use crate::quantize::{self, Scale};
use crate::renumber::{Face, Faces, Renumbered};
use crate::storage::{Elements, Storage};
use crate::vector::{self, Vector};

/// A vertex of the manifold mesh: a fan of triangles.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Vertex {
    /// A half-edge that starts there, or [`BOUNDARY`] once it has been removed.
    pub out: HalfEdge,
    /// The rank of the input vertex whose fan it is.
    pub origin: u32,
    /// The rank of the input vertex at which it is in the log by now.
    pub stands_at: u32,
    /// The next one that is at the same input vertex, or [`NONE`].
    pub next: u32,
    /// The node at which it stands, or [`NONE`].
    pub top: u32,
    /// The collapse that last took a triangle from it and gave none, or [`NONE`].
    pub trace: u32,
}

/// What a vertex is in the fully refined mesh.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Leaf {
    /// The farthest corner of its triangles.
    pub radius: f64,
    /// By how much their normals deviate from its own; the cosine is 0 where that is no [`Angle`].
    cosine: f64,
    sine: f64,
    /// As stored.
    pub position: [f32; 3],
    pub normal: [f32; 3],
    /// The order of vertices in the file: first those that are the first fans of input vertices, by these; then the
    /// others, by their first half-edges in the input.
    pub order: [u32; 2],
}

impl Leaf {
    pub fn angle(&self) -> Angle {
        (self.cosine > 0.0).then_some((self.cosine, self.sine))
    }

    fn set_angle(&mut self, angle: Angle) {
        (self.cosine, self.sine) = angle.unwrap_or_default();
    }
}

/// Which vertices are at an input vertex, in a list: its fans, and those that came to it.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Origin {
    pub first: u32,
    pub last: u32,
}

/// Room for the fan that is looked at.
#[derive(Default)]
struct Fan {
    half_edges: Vec<HalfEdge>,
    /// In the input and here.
    triangles: Vec<(u32, usize)>,
    normals: Vec<Vector>,
}

/// A manifold mesh.
pub(crate) struct Surface<S: Storage> {
    pub faces: Faces<S::Array<Face>>,
    pub vertices: S::Array<Vertex>,
    pub leaves: S::Array<Leaf>,
    /// By rank.
    pub origins: S::Array<Origin>,
    /// For each triangle, the input triangle.
    pub input: S::Array<u32>,
    /// For each collapse of the log, the rank of the kept vertex.
    pub kept: S::Array<u32>,
    /// For each collapse of the log, its error.
    pub eps: S::Array<f32>,
    pub extent: f64,
    pub scale: Scale,
    pub degenerate: u64,
    /// Edges that were cut.
    pub cut_edges: u64,
    /// Vertices that were added.
    pub added: u64,
}

impl<S: Storage> Surface<S> {
    /// Splits a mesh apart. Positions are as they will be stored: on a lattice, if nodes are quantised.
    pub fn new(renumbered: Renumbered<S>, quantize: bool, storage: &S) -> io::Result<Self> {
        let extent = renumbered.extent();
        let Renumbered { kept, eps, mut places, mut faces, mut input, corners, degenerate } = renumbered;
        let cut_edges = pair_up(&mut faces, storage)?;
        let sorter = find_fans(&mut faces, &mut input, storage)?;
        let scale = Scale::new(corners[0], corners[1]);
        let blank = Origin { first: NONE, last: NONE };
        let vertices = places.len();
        let mut surface = Self {
            faces,
            vertices: storage.growing(vertices, 14),
            leaves: storage.growing(vertices, 14),
            origins: storage.array(vertices, blank, 4),
            input,
            kept,
            eps,
            extent,
            scale,
            degenerate,
            cut_edges,
            added: 0,
        };
        let mut found = Fan::default();
        sorter.finish(|[rank, order, h]| {
            storage.check_stop()?;
            surface.add_fan(rank, order, h, places.get(rank as usize)?, quantize, &mut found.half_edges)
        })?;
        drop(places);
        for v in 0..surface.vertices.len() {
            storage.check_stop()?;
            surface.measure(v, quantize, &mut found)?;
        }
        Ok(surface)
    }

    /// Adds the vertex of a fan. `order` is its first half-edge in the input, `h` the same one here.
    fn add_fan(
        &mut self,
        rank: u32,
        order: u32,
        h: HalfEdge,
        [v, x, y, z]: [u32; 4],
        quantize: bool,
        fan: &mut Vec<HalfEdge>,
    ) -> io::Result<()> {
        let own = self.vertices.len() as u32;
        let fresh = Vertex { out: h, origin: rank, stands_at: rank, next: NONE, top: NONE, trace: NONE };
        self.vertices.push(fresh)?;
        let is_first = self.origins.get(rank as usize)?.first == NONE;
        self.append(rank, own)?;
        self.added += u64::from(!is_first);
        let position = [x, y, z].map(f32::from_bits);
        let stored = if quantize { self.scale.point(self.scale.position(position)) } else { position };
        let order = if is_first { [0, v] } else { [1, order] };
        let leaf = Leaf { radius: 0.0, cosine: 0.0, sine: 0.0, position: stored, normal: [0.0; 3], order };
        self.leaves.push(leaf)?;
        orbit(&mut self.faces, h, fan)?;
        for &h in &*fan {
            let (t, k) = triangle_of(h);
            self.faces.0.get_mut(t)?.start[k] = own;
        }
        Ok(())
    }

    /// Puts a vertex at the end of the list of an input vertex.
    pub fn append(&mut self, rank: u32, v: u32) -> io::Result<()> {
        let origin = self.origins.get_mut(rank as usize)?;
        let last = std::mem::replace(&mut origin.last, v);
        if last == NONE {
            origin.first = v;
        } else {
            self.vertices.get_mut(last as usize)?.next = v;
        }
        Ok(())
    }

    /// Finds normal, radius and angle of a vertex, from its triangles in the input's order.
    fn measure(&mut self, v: usize, quantize: bool, fan: &mut Fan) -> io::Result<()> {
        orbit(&mut self.faces, self.vertices.get(v)?.out, &mut fan.half_edges)?;
        fan.triangles.clear();
        for &h in &fan.half_edges {
            let t = triangle_of(h).0;
            fan.triangles.push((self.input.get(t)?, t));
        }
        fan.triangles.sort_unstable();
        fan.normals.clear();
        let (mut leaf, mut sum) = (self.leaves.get(v)?, [0.0; 3]);
        for &(_, t) in &fan.triangles {
            let corners = self.faces.0.get(t)?.start;
            let mut positions = [leaf.position; 3];
            for (position, &w) in positions.iter_mut().zip(&corners) {
                if w as usize != v {
                    *position = self.leaves.get(w as usize)?.position;
                    leaf.radius = leaf.radius.max(vector::distance(leaf.position, *position));
                }
            }
            let [a, b, c] = positions.map(vector::of);
            let normal = vector::cross(vector::minus(b, a), vector::minus(c, a));
            sum = vector::plus(sum, normal);
            fan.normals.push(normal);
        }
        leaf.normal = vector::unit(sum).map_or([0.0, 0.0, 1.0], |n| n.map(|x| x as f32));
        if quantize {
            leaf.normal = quantize::decode_normal(quantize::normal(leaf.normal));
        }
        let axis = vector::unit(vector::of(leaf.normal));
        let mut angle = cone::ZERO;
        // A triangle without area is not seen from either side.
        for normal in fan.normals.iter().filter_map(|&normal| vector::unit(normal)) {
            angle = cone::larger(angle, axis.and_then(|axis| cone::between(axis, normal)));
        }
        leaf.set_angle(angle);
        *self.leaves.get_mut(v)? = leaf;
        Ok(())
    }

    /// The edges from `v`: the vertex at the other end, and the half-edges to it and from it.
    pub fn edges_of(
        &mut self,
        v: u32,
        around: &mut Vec<HalfEdge>,
        found: &mut Vec<(u32, [HalfEdge; 2])>,
    ) -> io::Result<()> {
        found.clear();
        let first = self.vertices.get(v as usize)?.out;
        if first == BOUNDARY {
            return Ok(());
        }
        orbit(&mut self.faces, first, around)?;
        for &h in &*around {
            let (t, k) = triangle_of(h);
            let face = self.faces.0.get(t)?;
            let (after, before) = ((k + 1) % 3, (k + 2) % 3);
            found.push((face.start[after], [h, face.rev[k]]));
            if face.rev[before] == BOUNDARY {
                found.push((face.start[before], [BOUNDARY, prev(h)]));
            }
        }
        Ok(())
    }
}

/// Joins half-edges where they make a manifold edge, and says how many edges of several triangles are none.
fn pair_up<S: Storage>(faces: &mut Faces<S::Array<Face>>, storage: &S) -> io::Result<u64> {
    let mut sorter = storage.sorter::<3>(34);
    for t in 0..faces.0.len() {
        storage.check_stop()?;
        let start = faces.0.get(t)?.start;
        for k in 0..3 {
            let (a, b) = (start[k], start[(k + 1) % 3]);
            sorter.push([a.min(b), a.max(b), (4 * t + k) as HalfEdge])?;
        }
    }
    let (mut cut, mut edge, mut group) = (0, [NONE; 2], Vec::new());
    let mut close = |group: &mut Vec<HalfEdge>| {
        match group[..] {
            [] | [_] => {}
            [h, g]
                if faces.start(h)? != faces.start(g)?
                    && faces.start(next(next(h)))? != faces.start(next(next(g)))? =>
            {
                faces.pair(h, g)?;
            }
            _ => cut += 1,
        }
        group.clear();
        io::Result::Ok(())
    };
    sorter.finish(|[a, b, h]| {
        storage.check_stop()?;
        if edge != [a, b] {
            close(&mut group)?;
            edge = [a, b];
        }
        group.push(h);
        Ok(())
    })?;
    close(&mut group)?;
    Ok(cut)
}

/// The fans, sorted by the rank of their vertex, then by their first half-edge in the input, which comes with its number here.
fn find_fans<S: Storage>(
    faces: &mut Faces<S::Array<Face>>,
    input: &mut S::Array<u32>,
    storage: &S,
) -> io::Result<collapse_log::external::Sorter<3>> {
    let mut sorter = storage.sorter::<3>(12);
    let mut visited = storage.array(faces.0.len(), 0_u8, 3);
    let mut fan = Vec::new();
    for t in 0..faces.0.len() {
        storage.check_stop()?;
        for k in 0..3 {
            if visited.get(t)? & 1 << k != 0 {
                continue;
            }
            let first = (4 * t + k) as HalfEdge;
            let vertex = faces.start(first)?;
            orbit(faces, first, &mut fan)?;
            let mut least = [u32::MAX; 2];
            for &h in &fan {
                let (t, k) = triangle_of(h);
                *visited.get_mut(t)? |= 1 << k;
                least = least.min([4 * input.get(t)? + k as u32, h]);
            }
            sorter.push([vertex, least[0], least[1]])?;
        }
    }
    Ok(sorter)
}
