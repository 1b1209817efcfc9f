//! The mesh on disk: blocks of vertices with consecutive numbers, and the triangles whose lowest corner is in them.
//!
//! A block is written anew when something in it has changed, behind everything else in the file of the current pass;
//! the file of the pass before is given up when nothing refers to it any more. As vertices grow fewer, two neighbours
//! become one block. A segment is one piece of a block as it was written, in words of 32 bits:
//!
//! ```text
//! vertices   22 words: number, input number, position 3, quadric 11, key, target, flags, top, trace, leaf radius
//! triangles   6 words: number, corners 3, creator, number of sample points
//! nodes       9 words: number, centre 3, radius, error, dependency depth, height, key
//! points      5 words: number, whether special, position 3; those of the first triangle first
//! ```
//!
//! `top`, `trace` and `creator` count the nodes of the segment. Only this process reads them.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::sync::Arc;

use super::super::order::SPAN;

pub(super) const VERTEX_WORDS: usize = 22;
pub(super) const TRIANGLE_WORDS: usize = 6;
pub(super) const NODE_WORDS: usize = 9;
pub(super) const POINT_WORDS: usize = 5;

/// How near a block is to those whose vertices come up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Ring {
    /// Not in the window.
    #[default]
    Outside,
    /// Shares triangles with those that are near: the stars of their vertices are complete.
    Far,
    /// Shares triangles with those whose vertices come up.
    Near,
    /// Its vertices come up.
    Inner,
}

/// How many there are of everything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub vertices: u32,
    pub triangles: u32,
    pub nodes: u32,
    pub points: u32,
}

impl Counts {
    pub fn words(self) -> usize {
        self.vertices as usize * VERTEX_WORDS
            + self.triangles as usize * TRIANGLE_WORDS
            + self.nodes as usize * NODE_WORDS
            + self.points as usize * POINT_WORDS
    }

    /// Bytes of memory that a window takes for it, with what the work on it needs.
    fn memory(self) -> u64 {
        168 * u64::from(self.vertices)
            + 48 * u64::from(self.triangles)
            + 92 * u64::from(self.nodes)
            + 22 * u64::from(self.points)
    }
}

#[derive(Clone, Debug)]
struct Segment {
    file: Arc<File>,
    offset: u64,
    counts: Counts,
}

#[derive(Clone, Debug, Default)]
struct Block {
    segments: Vec<Segment>,
    /// Ascending: the blocks with which a triangle is shared.
    neighbours: Vec<u32>,
}

/// All blocks.
#[derive(Debug)]
pub(super) struct Blocks {
    list: Vec<Block>,
    /// Numbers of vertices in a block.
    span: u32,
    /// The file that is being written, and its length.
    file: Arc<File>,
    length: u64,
}

/// The words of a segment, kind by kind.
#[derive(Debug, Default)]
pub(super) struct Words {
    pub vertices: Vec<u32>,
    pub triangles: Vec<u32>,
    pub nodes: Vec<u32>,
    pub points: Vec<u32>,
}

impl Words {
    pub fn clear(&mut self) {
        for words in [&mut self.vertices, &mut self.triangles, &mut self.nodes, &mut self.points] {
            words.clear();
        }
    }

    fn counts(&self) -> Counts {
        Counts {
            vertices: (self.vertices.len() / VERTEX_WORDS) as u32,
            triangles: (self.triangles.len() / TRIANGLE_WORDS) as u32,
            nodes: (self.nodes.len() / NODE_WORDS) as u32,
            points: (self.points.len() / POINT_WORDS) as u32,
        }
    }
}

impl Blocks {
    /// No blocks yet, of vertices with numbers below `vertices`.
    pub fn new(vertices: u64, file: File) -> Blocks {
        let count = vertices.div_ceil(u64::from(SPAN)) as usize;
        Blocks { list: vec![Block::default(); count], span: SPAN, file: Arc::new(file), length: 0 }
    }

    pub fn len(&self) -> usize {
        self.list.len()
    }

    pub fn span(&self) -> u32 {
        self.span
    }

    /// The block of a vertex.
    pub fn of(&self, vertex: u32) -> u32 {
        vertex / self.span
    }

    pub fn neighbours(&self, block: u32) -> &[u32] {
        &self.list[block as usize].neighbours
    }

    /// Says with which blocks a block shares triangles. The list is put in order.
    pub fn set_neighbours(&mut self, block: u32, neighbours: &mut Vec<u32>) {
        neighbours.sort_unstable();
        neighbours.dedup();
        let list = &mut self.list[block as usize].neighbours;
        list.clear();
        list.extend_from_slice(neighbours);
    }

    /// Says that two blocks share a triangle. To be followed by [`finish_joining`](Self::finish_joining).
    pub fn join(&mut self, a: u32, b: u32) {
        for (a, b) in [(a, b), (b, a)] {
            let list = &mut self.list[a as usize].neighbours;
            if list.last() != Some(&b) && !list.contains(&b) {
                list.push(b);
            }
        }
    }

    pub fn finish_joining(&mut self) {
        for block in &mut self.list {
            block.neighbours.sort_unstable();
            block.neighbours.shrink_to_fit();
        }
    }

    /// From now on blocks are written to another file.
    pub fn begin_pass(&mut self, file: File) {
        self.file = Arc::new(file);
        self.length = 0;
    }

    /// Bytes of memory that a window takes for a block.
    pub fn memory(&self, block: u32) -> u64 {
        let segments = &self.list[block as usize].segments;
        // A window has a table of all numbers that the block's vertices can have.
        segments.iter().map(|s| s.counts.memory()).sum::<u64>() + 4 * u64::from(self.span)
    }

    /// The counts of a block, all segments together.
    pub fn counts(&self, block: u32) -> Counts {
        self.list[block as usize].segments.iter().fold(Counts::default(), |sum, s| Counts {
            vertices: sum.vertices + s.counts.vertices,
            triangles: sum.triangles + s.counts.triangles,
            nodes: sum.nodes + s.counts.nodes,
            points: sum.points + s.counts.points,
        })
    }

    /// Writes a block that takes the place of what has been written for it.
    pub fn write(&mut self, block: u32, words: &Words) -> io::Result<()> {
        let counts = words.counts();
        let mut file = &*self.file;
        file.seek(SeekFrom::Start(self.length))?;
        for part in [&words.vertices, &words.triangles, &words.nodes, &words.points] {
            file.write_all(bytemuck::cast_slice(part))?;
        }
        let segment = Segment { file: self.file.clone(), offset: self.length, counts };
        self.length += 4 * counts.words() as u64;
        let segments = &mut self.list[block as usize].segments;
        // A vector that grows would have room for four.
        *segments = if counts == Counts::default() { Vec::new() } else { vec![segment] };
        Ok(())
    }

    /// Reads the words of a block, and says how many of everything each segment has.
    pub fn read(&self, block: u32, words: &mut Vec<u32>) -> io::Result<Vec<Counts>> {
        let segments = &self.list[block as usize].segments;
        words.resize(segments.iter().map(|s| s.counts.words()).sum(), 0);
        let mut rest = words.as_mut_slice();
        for segment in segments {
            let (words, behind) = rest.split_at_mut(segment.counts.words());
            let mut file = &*segment.file;
            file.seek(SeekFrom::Start(segment.offset))?;
            file.read_exact(bytemuck::cast_slice_mut(words))?;
            rest = behind;
        }
        Ok(segments.iter().map(|s| s.counts).collect())
    }

    /// Makes one block of two until blocks have `span` numbers.
    pub fn widen(&mut self, span: u32) {
        while self.span < span {
            self.span *= 2;
            let mut list = Vec::with_capacity(self.list.len().div_ceil(2));
            let mut old = std::mem::take(&mut self.list).into_iter();
            while let Some(mut block) = old.next() {
                if let Some(second) = old.next() {
                    block.segments.extend(second.segments);
                    block.neighbours.extend(second.neighbours);
                }
                let this = list.len() as u32;
                block.neighbours.iter_mut().for_each(|n| *n /= 2);
                block.neighbours.retain(|&n| n != this);
                block.neighbours.sort_unstable();
                block.neighbours.dedup();
                list.push(block);
            }
            self.list = list;
        }
    }
}
