//! Memory for the nodes of loaded blocks.
//!
//! A change touches nodes of many blocks, and how many cache lines and pages of memory that takes follows from how close to
//! each other they lie. So they do not go to the allocator block by block, where they would lie between whatever else is
//! allocated meanwhile: they lie in chunks, each for blocks of one number of nodes.
//!
//! A chunk is given back when its last block goes. Beyond what blocks take, there is at most one chunk for each number of nodes that
//! is being filled, and what blocks that have gone leave free for others of as many nodes.

use crate::block::Node;

/// Nodes of a chunk: 16 KiB.
const CHUNK: usize = 256;

/// Where the nodes of a block are: the first of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Place(u32);

/// What is free in a chunk.
#[derive(Debug, Default)]
struct Room {
    /// Nodes of each of its blocks.
    span: u32,
    /// Where blocks would begin that are not there.
    free: Vec<u8>,
    /// Where the chunk is among those with room for another block, while it is.
    among: usize,
}

#[derive(Debug, Default)]
pub(crate) struct NodeMemory {
    /// None is there of those not in use.
    chunks: Vec<Option<Box<[Node; CHUNK]>>>,
    rooms: Vec<Room>,
    unused: Vec<u32>,
    /// By the number of nodes of a block, the chunks with room for one.
    with_room: Vec<Vec<u32>>,
}

impl NodeMemory {
    /// Takes in the nodes of a block: at least one, and no more than a chunk holds.
    pub fn insert(&mut self, nodes: &[Node]) -> Place {
        let span = nodes.len();
        let number = self.with_room(span);
        let room = &mut self.rooms[number as usize];
        let first = usize::from(room.free.pop().unwrap_or(0));
        if room.free.is_empty() {
            self.fill(number);
        }
        self.chunk_mut(number as usize)[first..first + span].copy_from_slice(nodes);
        Place(number * CHUNK as u32 + first as u32)
    }

    /// Frees the nodes of a block.
    pub fn remove(&mut self, Place(at): Place) {
        let (number, first) = (at / CHUNK as u32, at % CHUNK as u32);
        let room = &mut self.rooms[number as usize];
        let with_room = &mut self.with_room[room.span as usize];
        if room.free.is_empty() {
            room.among = with_room.len();
            with_room.push(number);
        }
        room.free.push(first as u8);
        if room.free.len() == CHUNK / room.span as usize {
            self.fill(number);
            self.chunks[number as usize] = None;
            self.unused.push(number);
        }
    }

    #[inline(always)]
    pub fn node(&self, Place(at): Place, index: usize) -> &Node {
        let at = at as usize + index;
        let Some(chunk) = &self.chunks[at / CHUNK] else { unreachable!("no chunk at {at}") };
        &chunk[at % CHUNK]
    }

    #[inline(always)]
    pub fn node_mut(&mut self, Place(at): Place, index: usize) -> &mut Node {
        let at = at as usize + index;
        &mut self.chunk_mut(at / CHUNK)[at % CHUNK]
    }

    #[inline(always)]
    fn chunk_mut(&mut self, number: usize) -> &mut [Node; CHUNK] {
        let Some(chunk) = &mut self.chunks[number] else { unreachable!("no chunk {number}") };
        chunk
    }

    /// A chunk with room for another block of so many nodes.
    fn with_room(&mut self, span: usize) -> u32 {
        if self.with_room.len() <= span {
            self.with_room.resize_with(span + 1, Vec::new);
        }
        if let Some(&number) = self.with_room[span].last() {
            return number;
        }
        let number = self.unused.pop().unwrap_or_else(|| {
            self.chunks.push(None);
            self.rooms.push(Room::default());
            self.chunks.len() as u32 - 1
        });
        let blocks = CHUNK / span;
        // Not on the stack first.
        self.chunks[number as usize] = vec![Node::BLANK; CHUNK].into_boxed_slice().try_into().ok();
        self.rooms[number as usize] = Room {
            span: span as u32,
            // The first is taken first.
            free: (0..blocks).rev().map(|block| (block * span) as u8).collect(),
            among: 0,
        };
        self.with_room[span].push(number);
        number
    }

    /// A chunk is not one with room any more.
    fn fill(&mut self, number: u32) {
        let Room { span, among, .. } = self.rooms[number as usize];
        let with_room = &mut self.with_room[span as usize];
        with_room.swap_remove(among);
        if let Some(&moved) = with_room.get(among) {
            self.rooms[moved as usize].among = among;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    fn nodes(count: usize, status: u32) -> Vec<Node> {
        vec![Node { status, ..Node::BLANK }; count]
    }

    #[test]
    fn blocks_come_and_go_and_keep_their_nodes() {
        let mut memory = NodeMemory::default();
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let mut there: Vec<(Place, usize, u32)> = Vec::new();
        for step in 0..36_000_u32 {
            // It grows and shrinks by turns, and grows at last.
            let is_growing = step / 4_000 % 2 == 0;
            if there.is_empty() || random.random_bool(if is_growing { 0.7 } else { 0.3 }) {
                let count = random.random_range(1..=31);
                there.push((memory.insert(&nodes(count, step)), count, step));
            } else {
                let (place, count, status) = there.swap_remove(random.random_range(0..there.len()));
                assert!((0..count).all(|index| memory.node(place, index).status == status), "step {step}");
                memory.remove(place);
            }
        }
        assert!(there.len() > 100, "some are left");
        for (place, count, status) in there {
            assert!((0..count).all(|index| memory.node_mut(place, index).status == status));
            memory.remove(place);
        }
        assert!(memory.chunks.iter().all(Option::is_none), "every chunk is given back");
        assert!(memory.with_room.iter().all(Vec::is_empty));
    }

    #[test]
    fn blocks_of_a_kind_lie_together() {
        let mut memory = NodeMemory::default();
        for i in 0..17 {
            assert_eq!(memory.insert(&nodes(15, 0)), Place(15 * i));
        }
        assert_eq!(memory.insert(&nodes(15, 0)), Place(CHUNK as u32), "seventeen fit a chunk");
        assert_eq!(memory.insert(&nodes(1, 0)), Place(2 * CHUNK as u32), "others have another");
        memory.remove(Place(30));
        assert_eq!(memory.insert(&nodes(15, 0)), Place(30), "what is free is taken before what is new");
    }
}
