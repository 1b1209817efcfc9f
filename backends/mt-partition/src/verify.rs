//! `verify`: every record, every reference, and what the engine relies on.

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

impl MtFile {
    /// Reads everything and checks that it fits together: every record is whole, both ends of an arc know of each other,
    /// layers grow along arcs (so there is no cycle), bounds are nested along them, roots are roots, counts are right.
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
        let mut totals = (0, 0);
        self.verify_arcs(NONE, &self.base, &mut seen, &mut totals)?;
        for node in 0..nodes {
            self.verify_arcs(node, &self.read_node(node)?, &mut seen, &mut totals)?;
        }
        for (node, seen) in (0..).zip(&seen) {
            if seen.above != seen.below {
                return Err(range(self.offset(node), "ingoing arcs of node", node.into()));
            }
            if seen.brought != u64::from(seen.coarse) {
                return Err(range(self.offset(node), "triangles above a node", seen.coarse.into()));
            }
        }
        let counts =
            [("arcs", self.header.arcs, totals.0), ("triangles on arcs", self.header.stored, totals.1)];
        match counts.into_iter().find(|(_, stored, counted)| stored != counted) {
            Some((what, stored, _)) => Err(range(0, what, stored)),
            None => Ok(()),
        }
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
