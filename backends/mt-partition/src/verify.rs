//! `verify`: every record, every reference, and what the engine relies on.

use rustc_hash::FxHashMap;
use vertex_tree::NONE;

use crate::bounds::holds;
use crate::error::MtError;
use crate::file::MtFile;
use crate::record::Record;

/// What is remembered of each node while the others are read.
struct Seen {
    bounds: vertex_tree::Bounds,
    layer: u32,
    coarse: u32,
    /// Triangles that outgoing arcs of others have brought.
    brought: u64,
    /// A sum over the ingoing arcs of a mixed value of each, which outgoing arcs must come up with too.
    above: u64,
    below: u64,
}

/// A value that differs for different arcs (the finaliser of splitmix64, Steele et al. 2014).
fn mix(above: u32, position: u32) -> u64 {
    let mut z = (u64::from(above) << 32 | u64::from(position)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Where each vertex is, as the first record has it that has it.
#[derive(Default)]
struct Places(FxHashMap<u32, [u32; 3]>);

impl Places {
    /// Whether a record has its vertices where those before it have them; otherwise the first that it has elsewhere.
    fn agree(&mut self, record: &Record) -> Result<(), u32> {
        for (number, place) in (0..record.vertices()).map(|vertex| record.vertex(vertex)) {
            let place = place.map(f32::to_bits);
            if *self.0.entry(number).or_insert(place) != place {
                return Err(number);
            }
        }
        Ok(())
    }
}

impl MtFile {
    /// Reads everything and checks that it fits together: every record is whole, both ends of an arc know of each other,
    /// layers grow along arcs (so there is no cycle), bounds are nested along them, roots are roots, vertices have one place each, counts
    /// are right. Takes some 30 bytes a vertex of memory, and 60 a node.
    ///
    /// # Errors
    /// The first thing that does not fit.
    pub fn verify(&self) -> Result<(), MtError> {
        self.verify_unknown()?;
        let nodes = self.nodes();
        let range =
            |offset, what, value| MtError::Range { file: self.name().to_owned(), offset, what, value };
        let mut seen: Vec<Seen> = Vec::with_capacity(nodes as usize);
        let mut buffer = Vec::new();
        for nodes in (0..self.layout.partitions()).map(|partition| self.layout.nodes_of(partition)) {
            for (node, record) in nodes.clone().zip(self.read(nodes, &mut buffer)?) {
                let record = record?;
                let is_root = record.above().all(|(above, _)| above == NONE);
                if is_root != self.root_bounds(vertex_tree::NodeId(node)).is_some()
                    || is_root && self.root_bounds(vertex_tree::NodeId(node)) != Some(record.bounds())
                {
                    return Err(range(self.offset(node), "root", node.into()));
                }
                seen.push(Seen {
                    bounds: record.bounds(),
                    layer: record.layer(),
                    coarse: record.coarse(),
                    brought: 0,
                    above: record.above().map(|(n, position)| mix(n, position)).fold(0, u64::wrapping_add),
                    below: 0,
                });
            }
        }
        let (mut totals, mut largest, mut places) = ((0, 0), (0, 0), Places::default());
        self.verify_arcs(NONE, &self.base, &mut seen, &mut totals)?;
        // The first record: it contradicts none.
        let _ = places.agree(&self.base);
        for node in 0..nodes {
            let record = self.read_node(node)?;
            self.verify_arcs(node, &record, &mut seen, &mut totals)?;
            if let Err(vertex) = places.agree(&record) {
                return Err(range(self.offset(node), "another place of vertex", vertex.into()));
            }
            let (bytes, nodes) = self.change(node, &record);
            largest = (largest.0.max(bytes), largest.1.max(nodes));
        }
        for (node, seen) in (0..).zip(&seen) {
            if seen.above != seen.below {
                return Err(range(self.offset(node), "ingoing arcs of node", node.into()));
            }
            if seen.brought != u64::from(seen.coarse) {
                return Err(range(self.offset(node), "triangles above a node", seen.coarse.into()));
            }
        }
        let header = &self.header;
        let counts = [
            (64, "triangles on arcs", header.stored, totals.1),
            (72, "arcs", header.arcs, totals.0),
            (104, "bytes of the largest change", header.change_bytes, largest.0),
            (112, "nodes of the largest change", header.change_nodes, largest.1),
        ];
        match counts.into_iter().find(|(.., stored, counted)| stored != counted) {
            Some((offset, what, stored, _)) => Err(range(offset, what, stored)),
            None => Ok(()),
        }
    }

    /// What a change of a node needs in memory: the node, and all below it or all above it.
    fn change(&self, node: u32, record: &Record) -> (u64, u64) {
        let sum = |others: &mut dyn Iterator<Item = u32>| {
            let there = others.filter(|&other| other < self.nodes());
            there.fold((0, 0), |(bytes, nodes), other| (bytes + self.length(other), nodes + 1))
        };
        let below = sum(&mut record.arcs().map(|arc| arc.below));
        let above = sum(&mut record.above().map(|(above, _)| above));
        (self.length(node) + below.0.max(above.0), 1 + below.1.max(above.1))
    }

    fn verify_arcs(
        &self,
        node: u32,
        record: &Record,
        seen: &mut [Seen],
        totals: &mut (u64, u64),
    ) -> Result<(), MtError> {
        for (position, arc) in (0..).zip(record.arcs()) {
            totals.0 += 1;
            totals.1 += u64::from(arc.triangles);
            let Some(below) = seen.get_mut(arc.below as usize) else { continue };
            below.brought += u64::from(arc.triangles);
            below.below = below.below.wrapping_add(mix(node, position));
            if node == NONE {
                continue;
            }
            let contradiction = |what| MtError::Contradiction {
                file: self.name().to_owned(),
                offset: self.offset(node),
                node,
                what,
                other: arc.below,
            };
            let (layer, inner) = (below.layer, below.bounds);
            if record.layer() >= layer {
                return Err(contradiction("its layer is not above that of"));
            }
            if !holds(&record.bounds(), &inner) {
                return Err(contradiction("its bounds do not hold those of"));
            }
        }
        Ok(())
    }
}
