//! A node as it is stored: its bounds, its ingoing arcs, and its outgoing arcs with their patches.
//!
//! ```text
//! offset  bytes  field
//!      0      4  CRC-32 of the rest of the record
//!      4      4  number of the node; 2^32 - 1 for the source
//!      8     20  centre 3 f32, radius f32, eps f32; zeros for the source
//!     28      4  layer: arcs on the longest path from the source
//!     32      4  P, ingoing arcs
//!     36      4  A, outgoing arcs
//!     40      4  V, vertices of the patches
//!     44      4  triangles on the ingoing arcs
//!     48      4  triangles on the outgoing arcs
//!     52    8 P  ingoing arcs: node above u32 (2^32 - 1 for the source), position among its outgoing arcs u32
//!          12 A  outgoing arcs: node below u32 (2^32 - 1 for the drain), triangles u32, and where in the patches
//!                theirs starts u32, of which the highest bit says that it is made of strips
//!          16 V  vertices: number in the input u32, x y z f32
//!                patches, one after the other
//! ```
//!
//! Corners are places in the table of vertices: a byte each where there are at most 2^8 vertices, two where at most 2^16,
//! otherwise four. A patch is a list of corners, three a triangle, or strips, each its number of corners in a byte and
//! then those: whichever is smaller. An arc without triangles is a dependency and nothing else.

use std::io;

use vertex_tree::{Bounds, NONE};

use crate::bounds::holds;
use crate::strips;

const HEAD: usize = 52;
const ARC_IN: usize = 8;
const ARC_OUT: usize = 12;
const VERTEX: usize = 16;
const STRIPS: u32 = 1 << 31;

/// What numbers in a record must be below.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    pub nodes: u32,
    pub vertices: u32,
}

/// An outgoing arc to be stored.
#[derive(Debug)]
pub(crate) struct Patch<'a> {
    pub below: u32,
    /// Corners are input vertices.
    pub triangles: &'a [[u32; 3]],
}

/// A node to be stored.
#[derive(Debug)]
pub(crate) struct Draft<'a> {
    pub number: u32,
    pub bounds: Bounds,
    pub layer: u32,
    pub coarse: u32,
    /// Nodes above, and positions among their outgoing arcs.
    pub above: &'a [(u32, u32)],
    pub arcs: &'a [Patch<'a>],
}

impl Draft<'_> {
    /// Appends the record to `out`; `position` gives that of an input vertex.
    pub fn encode(
        &self,
        mut position: impl FnMut(u32) -> io::Result<[f32; 3]>,
        out: &mut Vec<u8>,
    ) -> io::Result<()> {
        let start = out.len();
        let mut vertices: Vec<u32> =
            self.arcs.iter().flat_map(|arc| arc.triangles).flatten().copied().collect();
        let fine = vertices.len() as u32 / 3;
        vertices.sort_unstable();
        vertices.dedup();
        let Bounds { center: [x, y, z], radius, eps } = self.bounds;
        let mut word = |value: u32| out.extend_from_slice(&value.to_le_bytes());
        word(0);
        word(self.number);
        [x, y, z, radius, eps].into_iter().for_each(|value| word(value.to_bits()));
        let counts = [self.layer, self.above.len() as u32, self.arcs.len() as u32, vertices.len() as u32];
        counts.into_iter().chain([self.coarse, fine]).for_each(&mut word);
        for &(node, position) in self.above {
            word(node);
            word(position);
        }
        let mut patches = Vec::new();
        let width = width(vertices.len());
        for arc in self.arcs {
            let place = |v: u32| vertices.partition_point(|&w| w < v) as u32;
            let triangles: Vec<[u32; 3]> = arc.triangles.iter().map(|t| t.map(place)).collect();
            let at = patches.len() as u32;
            let flag = encode_patch(&triangles, width, &mut patches);
            [arc.below, triangles.len() as u32, at | flag].into_iter().for_each(&mut word);
        }
        for &v in &vertices {
            word(v);
            position(v)?.into_iter().for_each(|x| word(x.to_bits()));
        }
        out.extend_from_slice(&patches);
        let checksum = crc32fast::hash(&out[start + 4..]);
        out[start..start + 4].copy_from_slice(&checksum.to_le_bytes());
        Ok(())
    }
}

/// A number that comes twice.
fn doubled(numbers: impl Iterator<Item = u32>) -> Option<u32> {
    let mut numbers: Vec<u32> = numbers.collect();
    numbers.sort_unstable();
    numbers.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0])
}

/// Bytes of a corner.
fn width(vertices: usize) -> usize {
    match vertices {
        0..=0x100 => 1,
        0x101..=0x1_0000 => 2,
        _ => 4,
    }
}

fn encode_patch(triangles: &[[u32; 3]], width: usize, out: &mut Vec<u8>) -> u32 {
    let strips = strips::strips(triangles);
    let in_strips: usize = strips.iter().map(|s| 1 + s.len() * width).sum();
    let corner = |c: u32, out: &mut Vec<u8>| out.extend_from_slice(&c.to_le_bytes()[..width]);
    if in_strips < triangles.len() * 3 * width {
        for strip in strips {
            out.push(strip.len() as u8);
            strip.into_iter().for_each(|c| corner(c, out));
        }
        STRIPS
    } else {
        triangles.iter().flatten().for_each(|&c| corner(c, out));
        0
    }
}

/// A record that has been looked through: every number in it is in range.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    bytes: Box<[u8]>,
    above: usize,
    arcs: usize,
    vertices: usize,
}

/// An outgoing arc.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OutArc {
    /// [`NONE`] for the drain.
    pub below: u32,
    pub triangles: u32,
    start: u32,
}

impl Record {
    /// Looks through the bytes of a record.
    ///
    /// # Errors
    /// What is wrong with it, and the value that is.
    pub fn new(bytes: &[u8], limits: Limits) -> Result<Self, (&'static str, u64)> {
        let too_short = ("length of a node", bytes.len() as u64);
        if bytes.len() < HEAD {
            return Err(too_short);
        }
        if word(bytes, 0) != crc32fast::hash(&bytes[4..]) {
            return Err(("checksum", u64::from(word(bytes, 0))));
        }
        let [above, arcs, vertices] = [32, 36, 40].map(|at| u64::from(word(bytes, at)));
        // At most 2^32 * 16 each: the sum does not overflow.
        let patches = HEAD as u64 + ARC_IN as u64 * above + ARC_OUT as u64 * arcs + VERTEX as u64 * vertices;
        if patches > bytes.len() as u64 {
            return Err(too_short);
        }
        let record = Self {
            bytes: bytes.into(),
            above: above as usize,
            arcs: arcs as usize,
            vertices: vertices as usize,
        };
        record.check(limits)?;
        Ok(record)
    }

    fn check(&self, limits: Limits) -> Result<(), (&'static str, u64)> {
        let is_node = |n: u32| n == NONE || n < limits.nodes;
        if !is_node(self.number()) {
            return Err(("node", self.number().into()));
        }
        let Bounds { center: [x, y, z], radius, eps } = self.bounds();
        for value in [x, y, z, radius, eps] {
            if !value.is_finite() {
                return Err(("bounds", value.to_bits().into()));
            }
        }
        if let Some(value) = [radius, eps].into_iter().find(|&value| value < 0.0) {
            return Err(("radius or error", value.to_bits().into()));
        }
        if let Some((node, _)) = self.above().find(|&(n, _)| !is_node(n)) {
            return Err(("node above", node.into()));
        }
        if let Some(node) = doubled(self.above().map(|(n, _)| n)) {
            return Err(("node twice above", node.into()));
        }
        if let Some(node) = doubled(self.arcs().map(|arc| arc.below)) {
            return Err(("node twice below", node.into()));
        }
        for i in 0..self.vertices {
            let (number, position) = self.vertex(i);
            if number >= limits.vertices {
                return Err(("vertex", number.into()));
            }
            if let Some(x) = position.into_iter().find(|x| !x.is_finite()) {
                return Err(("coordinate", x.to_bits().into()));
            }
        }
        let mut fine = 0;
        for (i, arc) in self.arcs().enumerate() {
            if !is_node(arc.below) {
                return Err(("node below", arc.below.into()));
            }
            let mut triangles = 0_u64;
            let mut bad = None;
            let whole = self.read_patch(i, |corners| {
                triangles += 1;
                bad = bad.or(corners.into_iter().find(|&c| c as usize >= self.vertices));
                let [a, b, c] = corners;
                if a == b || b == c || c == a {
                    bad = bad.or(Some(a));
                }
            });
            if let Some(corner) = bad {
                return Err(("corner", corner.into()));
            }
            if !whole || triangles != u64::from(arc.triangles) {
                return Err(("triangles of a patch", arc.triangles.into()));
            }
            fine += triangles;
        }
        if fine != u64::from(self.fine()) {
            return Err(("triangles below a node", self.fine().into()));
        }
        Ok(())
    }

    /// Whether a record above this one and this one agree about the arc at a position among those that leave it: it is here that it
    /// leads to, and layers and bounds are nested along it.
    pub fn hangs_below(&self, above: &Self, position: u32) -> bool {
        let arc = above.arcs().nth(position as usize);
        arc.is_some_and(|arc| arc.below == self.number())
            && self.above().any(|arc| arc == (above.number(), position))
            && above.layer() < self.layer()
            && holds(&above.bounds(), &self.bounds())
    }

    /// Starts to read bounds, layer and arcs into the cache: all of it that is not geometry, as far as it mostly goes.
    #[inline]
    pub fn prefetch(&self) {
        for line in 0..3 {
            vertex_tree::prefetch(&self.bytes, 64 * line);
        }
    }

    /// Bytes as stored.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    pub fn number(&self) -> u32 {
        word(&self.bytes, 4)
    }

    pub fn bounds(&self) -> Bounds {
        let [x, y, z, radius, eps] = [8, 12, 16, 20, 24].map(|at| f32::from_bits(word(&self.bytes, at)));
        Bounds { center: [x, y, z], radius, eps }
    }

    pub fn layer(&self) -> u32 {
        word(&self.bytes, 28)
    }

    /// Triangles on the ingoing arcs.
    pub fn coarse(&self) -> u32 {
        word(&self.bytes, 44)
    }

    /// Triangles on the outgoing arcs.
    pub fn fine(&self) -> u32 {
        word(&self.bytes, 48)
    }

    /// Nodes above ([`NONE`] for the source), and positions among their outgoing arcs.
    #[inline]
    pub fn above(&self) -> impl Iterator<Item = (u32, u32)> + Clone + '_ {
        let arcs = self.bytes[HEAD..HEAD + ARC_IN * self.above].chunks_exact(ARC_IN);
        arcs.map(|arc| (word(arc, 0), word(arc, 4)))
    }

    fn arcs_start(&self) -> usize {
        HEAD + ARC_IN * self.above
    }

    /// Outgoing arcs in the order of the file.
    #[inline]
    pub fn arcs(&self) -> impl ExactSizeIterator<Item = OutArc> + Clone + '_ {
        let start = self.arcs_start();
        let arcs = self.bytes[start..start + ARC_OUT * self.arcs].chunks_exact(ARC_OUT);
        arcs.map(|arc| OutArc { below: word(arc, 0), triangles: word(arc, 4), start: word(arc, 8) })
    }

    /// Nodes below, without the drain.
    #[inline]
    pub fn below(&self) -> impl Iterator<Item = u32> + Clone + '_ {
        self.arcs().map(|arc| arc.below).filter(|&below| below != NONE)
    }

    /// Number and position of a vertex.
    pub fn vertex(&self, place: usize) -> (u32, [f32; 3]) {
        let at = self.arcs_start() + ARC_OUT * self.arcs + VERTEX * place;
        let position = [4, 8, 12].map(|offset| f32::from_bits(word(&self.bytes, at + offset)));
        (word(&self.bytes, at), position)
    }

    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// Calls `f` with the corners of each triangle on an outgoing arc, as places in the table of vertices. Says whether
    /// the patch was whole.
    #[inline]
    pub fn read_patch(&self, arc: usize, mut f: impl FnMut([u32; 3])) -> bool {
        let patches = &self.bytes[self.arcs_start() + ARC_OUT * self.arcs + VERTEX * self.vertices..];
        let start_of = |arc: usize| word(&self.bytes, self.arcs_start() + ARC_OUT * arc + 8);
        let start = start_of(arc);
        let end = if arc + 1 < self.arcs { (start_of(arc + 1) & !STRIPS) as usize } else { patches.len() };
        let Some(mut patch) = patches.get((start & !STRIPS) as usize..end) else { return false };
        match (width(self.vertices), start & STRIPS != 0) {
            (width, false) => {
                let triangles = patch.chunks_exact(3 * width);
                let whole = triangles.remainder().is_empty();
                for t in triangles {
                    f([0, 1, 2].map(|i| corner(&t[i * width..], width)));
                }
                whole
            }
            (width, true) => {
                while let Some((&count, rest)) = patch.split_first() {
                    let count = usize::from(count);
                    if count < 3 || rest.len() < count * width {
                        return false;
                    }
                    let [mut a, mut b] = [0, width].map(|at| corner(&rest[at..], width));
                    for j in 2..count {
                        let c = corner(&rest[j * width..], width);
                        f(if j % 2 == 0 { [a, b, c] } else { [b, a, c] });
                        (a, b) = (b, c);
                    }
                    patch = &rest[count * width..];
                }
                true
            }
        }
    }
}

#[inline(always)]
fn word(bytes: &[u8], at: usize) -> u32 {
    let mut word = [0; 4];
    word.copy_from_slice(&bytes[at..at + 4]);
    u32::from_le_bytes(word)
}

#[inline(always)]
fn corner(bytes: &[u8], width: usize) -> u32 {
    let mut word = [0; 4];
    word[..width].copy_from_slice(&bytes[..width]);
    u32::from_le_bytes(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { nodes: 10, vertices: 70_000 };

    fn encoded(vertices: u32) -> Vec<u8> {
        let positions: Vec<[f32; 3]> = (0..70_000).map(|v| [v as f32, 0.5, -1.0]).collect();
        let row: Vec<[u32; 3]> = (0..vertices - 2)
            .map(|v| if v % 2 == 0 { [v, v + 1, v + 2] } else { [v + 1, v, v + 2] })
            .collect();
        let arcs = [
            Patch { below: 3, triangles: &[[7, 5, 6]] },
            Patch { below: 4, triangles: &[] },
            Patch { below: NONE, triangles: &row },
        ];
        let bounds = Bounds { center: [1.0, 2.0, 3.0], radius: 4.0, eps: 0.5 };
        let draft =
            Draft { number: 2, bounds, layer: 5, coarse: 8, above: &[(1, 0), (NONE, 9)], arcs: &arcs };
        let mut bytes = Vec::new();
        draft.encode(|v| Ok(positions[v as usize]), &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn what_was_written_is_read() {
        for vertices in [12, 256, 257, 65_536, 65_537] {
            let bytes = encoded(vertices);
            let record = Record::new(&bytes, LIMITS).unwrap();
            assert_eq!(
                (record.number(), record.layer(), record.coarse(), record.len()),
                (2, 5, 8, bytes.len())
            );
            assert_eq!(record.fine(), vertices - 1);
            assert_eq!(record.bounds(), Bounds { center: [1.0, 2.0, 3.0], radius: 4.0, eps: 0.5 });
            assert_eq!(record.above().collect::<Vec<_>>(), [(1, 0), (NONE, 9)]);
            assert_eq!(record.below().collect::<Vec<_>>(), [3, 4]);
            assert_eq!(record.vertex(7), (7, [7.0, 0.5, -1.0]));
            let mut patches = vec![Vec::new(); 3];
            for (i, patch) in patches.iter_mut().enumerate() {
                assert!(record.read_patch(i, |t| patch.push(t)));
            }
            assert_eq!(patches[0], [[7, 5, 6]]);
            assert_eq!(patches[1], [[0; 3]; 0]);
            assert_eq!(patches[2].len(), vertices as usize - 2);
            let mut starts: Vec<u32> = patches[2]
                .iter()
                .map(|&t| {
                    let v = t[0].min(t[1]).min(t[2]);
                    let as_written = if v % 2 == 0 { [v, v + 1, v + 2] } else { [v + 1, v, v + 2] };
                    let [a, b, c] = as_written;
                    assert!([[a, b, c], [b, c, a], [c, a, b]].contains(&t), "{t:?}");
                    v
                })
                .collect();
            starts.sort_unstable();
            assert!(starts.iter().copied().eq(0..vertices - 2));
            // A row of triangles is worth a strip: a corner a triangle and a little, not three.
            let width = width(vertices as usize);
            let tables = HEAD + 2 * ARC_IN + 3 * ARC_OUT + vertices as usize * VERTEX;
            let patches = bytes.len() - tables;
            assert!(patches < (vertices as usize + 20) * width * 21 / 20, "{vertices}: {patches}");
        }
    }

    /// With the checksum made right again: what is out of range is still found, and nothing panics.
    #[test]
    fn any_changed_byte_is_found_or_harmless() {
        let bytes = encoded(12);
        let mut refused = 0;
        for at in 4..bytes.len() {
            for bit in 0..8 {
                let mut changed = bytes.clone();
                changed[at] ^= 1 << bit;
                assert_eq!(Record::new(&changed, LIMITS).unwrap_err().0, "checksum");
                let checksum = crc32fast::hash(&changed[4..]);
                changed[..4].copy_from_slice(&checksum.to_le_bytes());
                refused += usize::from(Record::new(&changed, LIMITS).is_err());
            }
        }
        assert!(refused > bytes.len(), "{refused} of {}", 8 * bytes.len());
        for end in 0..bytes.len() {
            assert!(Record::new(&bytes[..end], LIMITS).is_err());
        }
    }
}
