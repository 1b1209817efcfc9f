//! A file of meta-nodes, open for reading.

use std::sync::Arc;

use container::{FileError, Georeference, Sections, read_at};
use page_store::source::PageSource;
use vertex_tree::{Bounds, NodeId};

use crate::check::check;
use crate::error::MetaNodeError;
use crate::format::{Header, ROOT_WORDS, Root, TRIANGLE_WORDS, VERTEX_WORDS};
use crate::page::{HEADER_WORDS, Layout, NODE_WORDS};
use crate::tables::Tables;

/// An open file: header, base mesh and the index of the pages are in memory, the pages are not. Shared, unchanging:
/// several trees can show it at once, each with place holders of its own.
pub struct MetaNodeFile {
    source: Arc<dyn PageSource>,
    pub(crate) header: Header,
    pub(crate) roots: Vec<Root>,
    pub(crate) base_vertices: Vec<(u32, [f32; 3])>,
    pub(crate) base_triangles: Vec<[u32; 3]>,
    /// Words of each page.
    lengths: Vec<u32>,
    /// Where every 64th page starts, in words from the first page: 1/16 of the memory of an offset a page.
    starts: Vec<u64>,
    /// Where the first page starts, in bytes.
    pages_at: u64,
    georeference: Georeference,
    sections: Sections,
}

/// The least number of place holders of the largest size: one in use and three that are not.
pub(crate) const LEAST_HOLDERS: u32 = 4;

/// Pages between two entries of [`MetaNodeFile::starts`].
const STRIDE: usize = 64;

impl std::fmt::Debug for MetaNodeFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("MetaNodeFile").field("name", &self.name()).field("header", &self.header).finish()
    }
}

impl MetaNodeFile {
    /// Reads header and tables, and checks them.
    ///
    /// # Errors
    /// Whatever is wrong with them.
    pub fn open(source: Arc<dyn PageSource>) -> Result<Self, MetaNodeError> {
        let header = Header::read(&*source)?;
        let Tables { at, words, pages_at, georeference, sections } = Tables::read(&*source, &header)?;
        let [roots, vertices, triangles, lengths] = words;
        let f = f32::from_bits;
        let roots: Vec<Root> = roots
            .chunks_exact(ROOT_WORDS)
            .map(|w| Root {
                node: NodeId(w[0]),
                log_number: w[1],
                bounds: Bounds { center: [f(w[2]), f(w[3]), f(w[4])], radius: f(w[5]), eps: f(w[6]) },
            })
            .collect();
        let base_vertices: Vec<(u32, [f32; 3])> =
            vertices.chunks_exact(VERTEX_WORDS).map(|w| (w[0], [f(w[1]), f(w[2]), f(w[3])])).collect();
        let base_triangles: Vec<[u32; 3]> =
            triangles.chunks_exact(TRIANGLE_WORDS).map(|w| [w[0], w[1], w[2]]).collect();
        let mut starts = Vec::with_capacity(lengths.len() / STRIDE + 1);
        let mut total = 0_u64;
        for (page, &length) in lengths.iter().enumerate() {
            if page % STRIDE == 0 {
                starts.push(total);
            }
            total += u64::from(length);
        }
        let opened = Self {
            source,
            header,
            roots,
            base_vertices,
            base_triangles,
            lengths,
            starts,
            pages_at,
            georeference,
            sections,
        };
        opened.check_tables(at, total)?;
        Ok(opened)
    }

    fn check_tables(&self, tables_at: [u64; 4], total_words: u64) -> Result<(), MetaNodeError> {
        let header = &self.header;
        let error = |offset: u64, what: &'static str, value: u64| {
            Err(MetaNodeError::Value { file: self.name().to_owned(), offset, what, value })
        };
        let [mut at, vertices_at, triangles_at, lengths_at] = tables_at;
        let (mut before, mut root_pages) = (None, 0);
        for root in &self.roots {
            let (page, number) = (root.node.0 >> header.slot_bits, root.node.0);
            if page >= header.root_pages || before.is_some_and(|before| before >= number) {
                return error(at, "the number of a root", number.into());
            }
            if root.log_number >= header.collapses || !root.bounds.is_sane() {
                return error(at + 4, "the number in the log of a root", root.log_number.into());
            }
            root_pages += u32::from(before.is_none_or(|before| before >> header.slot_bits < page));
            before = Some(number);
            at += 4 * ROOT_WORDS as u64;
        }
        if root_pages != header.root_pages {
            return error(
                48,
                "the number of root pages, unlike that in the list of roots,",
                header.root_pages.into(),
            );
        }
        at = vertices_at;
        let mut least = 0;
        for &(leaf, position) in &self.base_vertices {
            if leaf < least || leaf >= header.leaves || !position.iter().all(|x| x.is_finite()) {
                return error(at, "the leaf of a base vertex", leaf.into());
            }
            least = leaf + 1;
            at += 4 * VERTEX_WORDS as u64;
        }
        at = triangles_at;
        for corners in &self.base_triangles {
            if let Some(&leaf) = corners.iter().find(|&&leaf| leaf >= header.leaves) {
                return error(at, "the leaf of a base triangle", leaf.into());
            }
            // A base vertex has the leaves from its own up to that of the next.
            let [a, b, c] =
                corners.map(|leaf| self.base_vertices.partition_point(|&(first, _)| first <= leaf));
            if a == b || b == c || c == a {
                return error(
                    at,
                    "the leaf of a base triangle, of which two are at one vertex,",
                    corners[0].into(),
                );
            }
            at += 4 * TRIANGLE_WORDS as u64;
        }
        if self.base_vertices.first().is_some_and(|&(leaf, _)| leaf != 0) {
            return error(vertices_at, "the first leaf of the base mesh", self.base_vertices[0].0.into());
        }
        at = lengths_at;
        for &length in &self.lengths {
            if length > header.largest_words {
                return error(at, "the length of a page", length.into());
            }
            at += 4;
        }
        // Whoever opens a tree has memory for several of this size.
        let largest = self.lengths.iter().copied().max().unwrap_or(0);
        if largest != header.largest_words {
            return error(60, "the size of the largest page", header.largest_words.into());
        }
        if total_words.checked_mul(4) != Some(header.page_bytes) {
            return error(64, "the length of all pages", header.page_bytes);
        }
        // Which page has how many nodes is found with the pages; here, that there is room for all of them.
        let least =
            u64::from(header.pages) * HEADER_WORDS as u64 + u64::from(header.collapses) * NODE_WORDS as u64;
        if least > total_words {
            return error(20, "the number of collapses", header.collapses.into());
        }
        Ok(())
    }

    pub(crate) fn name(&self) -> &str {
        self.source.name()
    }

    /// Where the mesh lies in the world.
    #[must_use]
    pub fn georeference(&self) -> &Georeference {
        &self.georeference
    }

    /// Compares the checksums of what this version does not know.
    pub(crate) fn verify_unknown(&self) -> Result<(), MetaNodeError> {
        let error = |error| FileError::of_sections(self.name(), error);
        Ok(self.sections.verify_unknown(&*self.source).map_err(error)?)
    }

    /// Bytes of a page, as it is stored and as its place holder is large.
    #[must_use]
    pub fn page_bytes(&self, page: u32) -> Option<u64> {
        self.lengths.get(page as usize).map(|&words| 4 * u64::from(words))
    }

    /// Words of a page.
    pub(crate) fn page_words(&self, page: u32) -> usize {
        self.lengths[page as usize] as usize
    }

    /// Where a page starts, in bytes.
    pub(crate) fn page_offset(&self, page: u32) -> u64 {
        let page = page as usize;
        let from = page / STRIDE * STRIDE;
        let words: u64 = self.lengths[from..page].iter().map(|&length| u64::from(length)).sum();
        self.pages_at + 4 * (self.starts[page / STRIDE] + words)
    }

    /// Bytes of page memory that a tree needs at least.
    #[must_use]
    pub fn least_memory(&self) -> u64 {
        self.holder_bytes() * u64::from(LEAST_HOLDERS)
    }

    /// Bytes of the largest place holder.
    pub(crate) fn holder_bytes(&self) -> u64 {
        4 * u64::from(self.header.largest_words).max(1)
    }

    /// Reads a page and checks it. `words` has room for the largest.
    pub(crate) fn read_page(&self, page: u32, words: &mut [u32]) -> Result<Layout, MetaNodeError> {
        let offset = self.page_offset(page);
        let words = &mut words[..self.page_words(page)];
        read_words(&*self.source, offset, words)?;
        check(words, page, &self.header.limits()).map_err(|reason| self.damaged(page, reason))
    }

    /// Something is wrong with a page.
    pub(crate) fn damaged(&self, page: u32, reason: &'static str) -> MetaNodeError {
        MetaNodeError::Page { file: self.name().to_owned(), page, offset: self.page_offset(page), reason }
    }

    /// The roots on a page, each with the leaf of its vertex. Base vertices are those of the roots, in their order, and then others.
    pub(crate) fn roots_of(&self, page: u32) -> impl ExactSizeIterator<Item = (&Root, u32)> {
        let place =
            |page: u32| self.roots.partition_point(|root| root.node.0 >> self.header.slot_bits < page);
        let range = place(page)..place(page + 1);
        let leaves = self.base_vertices.get(range.clone()).unwrap_or_default();
        self.roots[range].iter().zip(leaves).map(|(root, &(leaf, _))| (root, leaf))
    }

    /// What the file holds, in words and numbers.
    #[must_use]
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        let h = &self.header;
        let bytes = self.source.len();
        let mean = |sum: u64, count: u32| sum as f64 / f64::from(count.max(1));
        let mut facts = vec![
            ("format", format!("meta-nodes, version {} (backend meta-node)", h.version)),
            ("vertices", h.leaves.to_string()),
            ("triangles", h.triangles.to_string()),
            ("nodes", h.collapses.to_string()),
            ("roots", h.roots.to_string()),
            ("base triangles", h.base_triangles.to_string()),
            ("levels of a block", h.levels.to_string()),
            ("pages", h.pages.to_string()),
            ("root pages", h.root_pages.to_string()),
            ("largest page, bytes", self.holder_bytes().to_string()),
            ("mean page, bytes", format!("{:.0}", mean(h.page_bytes, h.pages))),
            ("nodes a page", format!("{:.1}", mean(h.collapses.into(), h.pages))),
            ("bytes", bytes.to_string()),
            ("bytes a triangle", format!("{:.1}", mean(bytes, h.triangles))),
            ("least page memory, bytes", self.least_memory().to_string()),
        ];
        facts.extend(self.georeference.facts());
        facts
    }
}

fn read_words(source: &dyn PageSource, offset: u64, words: &mut [u32]) -> Result<(), MetaNodeError> {
    read_at(source, offset, bytemuck::cast_slice_mut(words))?;
    words.iter_mut().for_each(|word| *word = u32::from_le(*word));
    Ok(())
}
