//! The order in which the blocks of a round come up.
//!
//! A block of a round is a run of vertex numbers. The blocks are dealt out to a few parts, each a run of blocks, and a
//! block is on a border if it is near a block of an earlier part. First come those that are not, part by part, then those
//! on borders; both in ascending order. So the parts have nothing to do with each other until their borders come up:
//! they can be worked on at the same time, and the result is that of this order all the same.
//!
//! Nearness is counted in steps from one piece of a block, of [`SPAN`] numbers at the start, to another that shares a
//! triangle with it. A vertex that comes up looks at what is up to two steps away, and mostly changes what is one step away;
//! but where its star vanishes as a whole, the triangles around the vertex that is kept stand in for it, and their other
//! corners are two steps away. So four steps apart two vertices may still meet and five steps apart they do not.

/// Numbers of vertices in a piece of a block at the start.
pub(super) const SPAN: u32 = 256;
/// Pieces of a block.
pub(super) const PIECES: u32 = 8;
/// Parts of the mesh. As many threads find work.
pub(super) const PARTS: u32 = 4;
/// Steps within which vertices that come up may meet.
const STEPS: usize = 4;
/// Pieces of more numbers would make blocks of more than 2^32.
const MOST_DOUBLINGS: u32 = 21;

/// Numbers of vertices in a piece when of `all` vertices `live` are left: a power of two. Of the first [`SPAN`] between a
/// half and all are there: pieces widen as vertices grow fewer.
pub(super) fn span(all: usize, live: usize) -> u32 {
    SPAN << (all / live.max(1)).max(1).ilog2().min(MOST_DOUBLINGS)
}

/// The part of each block, of a mesh of so many pieces.
pub(super) fn part(block: u32, pieces: u32) -> u32 {
    (u64::from(block) * u64::from(PARTS) / u64::from(pieces.div_ceil(PIECES).max(1))) as u32
}

/// Which blocks are on borders. `pairs` calls its argument with pieces that share triangles, each pair one way at least.
pub(super) fn borders(pieces: u32, pairs: impl Fn(&mut dyn FnMut(u32, u32))) -> Vec<bool> {
    let own: Vec<u8> = (0..pieces).map(|piece| part(piece / PIECES, pieces) as u8).collect();
    // The earliest part that is so many steps away from each piece.
    let mut earliest = own.clone();
    for _ in 0..STEPS {
        let before = earliest.clone();
        pairs(&mut |a, b| {
            for (a, b) in [(a as usize, b as usize), (b as usize, a as usize)] {
                earliest[a] = earliest[a].min(before[b]);
            }
        });
    }
    let near: Vec<bool> = earliest.iter().zip(&own).map(|(earliest, own)| earliest < own).collect();
    near.chunks(PIECES as usize).map(|pieces| pieces.contains(&true)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_double_as_vertices_grow_fewer() {
        let spans = [(0, 0), (100, 100), (100, 51), (100, 50), (100, 26), (100, 25), (usize::MAX, 1)];
        let spans = spans.map(|(all, live)| span(all, live) / SPAN);
        assert_eq!(spans, [1, 1, 1, 2, 2, 4, 1 << MOST_DOUBLINGS]);
    }

    /// A strip of pieces, each beside the next: four of them after the end of a part are near it.
    #[test]
    fn borders_are_where_parts_meet() {
        let pieces = 16 * PIECES + 3;
        let strip = |pair: &mut dyn FnMut(u32, u32)| (1..pieces).for_each(|piece| pair(piece, piece - 1));
        let borders = borders(pieces, strip);
        assert_eq!(borders.len(), 17);
        let parts: Vec<u32> = (0..17).map(|block| part(block, pieces)).collect();
        assert_eq!(parts.first(), Some(&0));
        assert_eq!(parts.last(), Some(&(PARTS - 1)));
        for block in 1..17 {
            assert_eq!(borders[block], parts[block] > parts[block - 1], "{block} {borders:?} {parts:?}");
        }
        let far = |pair: &mut dyn FnMut(u32, u32)| {
            for (a, b) in [(0, 100), (100, 90), (90, 80), (80, 130)] {
                pair(a, b);
            }
        };
        let borders = super::borders(pieces, far);
        let on: Vec<usize> = (0..17).filter(|&block| borders[block]).collect();
        assert_eq!(on, [80 / 8, 90 / 8, 100 / 8, 130 / 8]);
    }
}
