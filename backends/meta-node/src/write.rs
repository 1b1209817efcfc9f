//! From a collapse log to a file.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use collapse_log::external::{Workspace, WorkspaceError};
use collapse_log::{CollapseLog, LogSource};
use container::{BY_PAGE, FileError, Georeference, Kind, SectionWriter, output};
use vertex_tree::NONE;

use crate::arrange::{Arrangement, Node};
use crate::arranging::arrange;
use crate::blocking::{self, Blocking};
use crate::error::MetaNodeError;
use crate::format::{HEADER_BYTES, Header};
use crate::page::{self, Child};
use crate::subtree::Span;

/// How a file is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildOptions {
    /// Levels of the binary tree in a block, 1 to 12; `None` takes the most with which every block fits a page.
    pub levels: Option<u32>,
    /// What a page should hold at most, in bytes. A block that is larger gets a page that is as large.
    pub page_bytes: u32,
}

impl Default for BuildOptions {
    /// Pages of 4096 bytes, as disks have them.
    fn default() -> Self {
        Self { levels: None, page_bytes: 4096 }
    }
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Levels of a block.
    pub levels: u32,
    /// Blocks of the tree.
    pub blocks: u64,
    /// Pages.
    pub pages: u64,
    /// Bytes of the largest page.
    pub largest_page: u64,
    /// Bytes of the whole file.
    pub bytes: u64,
}

/// Writes the hierarchy of a log that is in memory: whole, or not at all. Temporary files are made beside `path`, and as
/// much memory is taken as serves.
///
/// # Errors
/// As for [`write_within`].
pub fn write(path: &Path, log: &CollapseLog, options: &BuildOptions) -> Result<WriteReport, MetaNodeError> {
    write_within(path, log, options, &Workspace::beside(path, &AtomicBool::new(false)))
}

/// Writes the hierarchy of a log that may be larger than memory: whole, or not at all. The file is the same whatever the
/// memory. Beside it, 5 bytes a vertex and 40 a page are needed.
///
/// # Errors
/// [`MetaNodeError::Log`], [`MetaNodeError::Levels`], [`MetaNodeError::TooLarge`], [`FileError::Write`],
/// [`MetaNodeError::Workspace`].
pub fn write_within(
    path: &Path,
    log: &dyn LogSource,
    options: &BuildOptions,
    workspace: &Workspace<'_>,
) -> Result<WriteReport, MetaNodeError> {
    if let Some(levels) = options.levels.filter(|levels| !(1..=page::MOST_LEVELS).contains(levels)) {
        return Err(MetaNodeError::Levels { levels, most: page::MOST_LEVELS });
    }
    let arrangement = arrange(log, workspace)?;
    let levels = options.levels.unwrap_or_else(|| blocking::levels_for(&arrangement, options.page_bytes));
    let blocking = Blocking::new(&arrangement, levels, options.page_bytes);
    let (pages, slots) = (blocking.pages.len() as u64, 1 << blocking.slot_bits);
    if pages * slots > u64::from(u32::MAX) {
        return Err(MetaNodeError::TooLarge { pages, slots });
    }
    let (mut written, mut bytes) = (Header::default(), 0);
    output::write_with(path, |file| {
        let writer = Writer { arrangement: &arrangement, blocking: &blocking };
        (written, bytes) = writer.write(file, log.georeference())?;
        arrangement.check()
    })
    .map_err(|source| -> MetaNodeError {
        match source {
            _ if workspace.stop.load(Ordering::Relaxed) => WorkspaceError::Interrupted.into(),
            source => FileError::write(path, source).into(),
        }
    })?;
    Ok(WriteReport {
        levels,
        blocks: blocking.blocks.len() as u64,
        pages,
        largest_page: 4 * u64::from(written.largest_words),
        bytes,
    })
}

struct Writer<'a> {
    arrangement: &'a Arrangement<'a>,
    blocking: &'a Blocking,
}

impl Writer<'_> {
    /// Writes the file; says what its header is and how long it is.
    fn write(&self, file: &mut File, georeference: &Georeference) -> io::Result<(Header, u64)> {
        let Self { arrangement, blocking } = self;
        let mut header = Header {
            leaves: arrangement.leaves,
            collapses: arrangement.nodes,
            triangles: arrangement.triangles,
            doubled: arrangement.doubled,
            roots: arrangement.roots.len() as u32,
            base_vertices: arrangement.base_leaves.len() as u32,
            base_triangles: arrangement.base_triangles.len() as u32,
            pages: blocking.pages.len() as u32,
            root_pages: blocking.root_pages,
            levels: blocking.levels,
            slot_bits: blocking.slot_bits,
            ..Header::default()
        };
        let kinds = [
            (Kind::ROOTS, 0),
            (Kind::BASE_VERTICES, 0),
            (Kind::BASE_TRIANGLES, 0),
            (Kind::PAGES, BY_PAGE),
            (Kind::PAGE_TABLE, 0),
        ];
        let mut out = SectionWriter::new(file, HEADER_BYTES, georeference, &[], &kinds)?;
        out.begin(Kind::ROOTS)?;
        for &root in &arrangement.roots {
            let node = arrangement.node(root);
            put(&mut out, &[blocking.number[root as usize].0, node.log_number])?;
            put(&mut out, &page::bounds_words(&node.bounds))?;
        }
        out.begin(Kind::BASE_VERTICES)?;
        for &leaf in &arrangement.base_leaves {
            put(&mut out, &[leaf])?;
            put(&mut out, &arrangement.position(leaf).map(f32::to_bits))?;
        }
        out.begin(Kind::BASE_TRIANGLES)?;
        put(&mut out, arrangement.base_triangles.as_flattened())?;
        out.begin(Kind::PAGES)?;
        let (mut words, mut lengths) = (Vec::new(), Vec::with_capacity(blocking.pages.len()));
        for page in 0..header.pages {
            words.clear();
            self.page(page, &mut words);
            lengths.push(words.len() as u32);
            header.largest_words = header.largest_words.max(words.len() as u32);
            header.page_bytes += 4 * words.len() as u64;
            put(&mut out, &words)?;
        }
        out.begin(Kind::PAGE_TABLE)?;
        put(&mut out, &lengths)?;
        let bytes = out.finish(&header.encode())?;
        Ok((header, bytes))
    }

    /// The words of a page.
    fn page(&self, page: u32, words: &mut Vec<u32>) {
        let Self { arrangement, blocking } = self;
        let nodes_of = &blocking.pages[page as usize];
        let tops = &blocking.blocks[nodes_of.blocks.clone()];
        let slot = |n: u32| blocking.number[n as usize].0 & ((1 << blocking.slot_bits) - 1);
        let mut nodes = Vec::new();
        for &top in tops {
            blocking.walk(arrangement, top, |n| nodes.push(n));
        }
        words.extend([0; page::HEADER_WORDS]);
        let (mut links, mut triangles) = (Vec::new(), 0);
        let is_here = |n: u32| blocking.number[n as usize].0 >> blocking.slot_bits == page;
        let mut block = 0;
        for &n in &nodes {
            let node = arrangement.node(n);
            words.extend(page::bounds_words(&node.bounds));
            words.extend(arrangement.position(node.span.pivot).map(f32::to_bits));
            words.extend([node.span.first, node.span.pivot, node.log_number]);
            let [kept, removed] = node.span.children(n).map(|child| match child {
                NONE => Child::Leaf.encode(),
                // Blocks that share a page hang below another page: a child here is in the same block, or in one joined to it.
                child if is_here(child) => Child::Slot(slot(child)).encode(),
                child => {
                    links.push(child);
                    Child::Link(links.len() as u32 - 1).encode()
                }
            });
            words.push(kept | removed << 16);
            if tops.get(block) == Some(&n) {
                words.push(0x8000 | block as u32);
                block += 1;
            } else {
                words.push(slot(node.parent));
            }
            triangles += node.brought.len() as u32;
            words.push(triangles);
        }
        for &top in tops {
            match arrangement.node(top).parent {
                NONE => words.extend([NONE, NONE]),
                above => {
                    words.extend([blocking.number[above as usize].0, arrangement.node(above).log_number]);
                }
            }
        }
        for &link in &links {
            let node = arrangement.node(link);
            words.extend([blocking.number[link as usize].0, node.log_number]);
            words.extend(page::bounds_words(&node.bounds));
        }
        for &n in &nodes {
            let Node { span: Span { first, end, .. }, brought, .. } = arrangement.node(n);
            for t in brought {
                let mut corners = arrangement.triangle(t);
                // Two corners are below the node, one on each side; the other comes first.
                let far = corners.iter().position(|leaf| !(first..end).contains(leaf)).unwrap_or(0);
                corners.rotate_left(far);
                words.extend(corners);
            }
        }
        words[1..page::HEADER_WORDS].copy_from_slice(&[
            page,
            nodes_of.parent,
            nodes.len() as u32,
            tops.len() as u32,
            links.len() as u32,
            triangles,
            nodes_of.children.start,
            nodes_of.children.len() as u32,
        ]);
        words[0] = page::checksum(words);
    }
}

fn put(out: &mut impl Write, words: &[u32]) -> io::Result<()> {
    words.iter().try_for_each(|word| out.write_all(&word.to_le_bytes()))
}
