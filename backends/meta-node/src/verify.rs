//! Everything that a file says, checked against everything else that it says.

use vertex_tree::{Bounds, NONE, NodeId};

use crate::check::check_nesting;
use crate::error::MetaNodeError;
use crate::file::MetaNodeFile;
use crate::page::{Child, Page};

/// What a page says of a node of a page below it.
#[derive(Clone, Copy)]
struct Expected {
    node: NodeId,
    above: (u32, u32),
    bounds: Bounds,
    log_number: u32,
    /// Of the leaves below it; where they end is known for all but roots.
    first: u32,
    end: Option<u32>,
}

/// A checker at work.
struct Verifier<'a> {
    file: &'a MetaNodeFile,
    words: Vec<u32>,
    /// Nodes met so far, by number in the log.
    met: Vec<bool>,
    triangles: u64,
}

impl MetaNodeFile {
    /// Reads every page, follows every reference and checks that spheres, errors and leaves are nested. Takes a bit a
    /// node of memory, and a page's links for every level of pages.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn verify(&self) -> Result<(), MetaNodeError> {
        self.verify_unknown()?;
        let header = &self.header;
        let mut verifier = Verifier {
            file: self,
            words: vec![0; header.largest_words as usize],
            met: vec![false; header.collapses as usize],
            triangles: self.base_triangles.len() as u64,
        };
        let firsts = self.base_vertices.iter().map(|&(leaf, _)| leaf);
        let mut ends = firsts.clone().skip(1).chain([header.leaves]);
        let roots = self.roots.iter().zip(firsts).map(|(root, first)| Expected {
            node: root.node,
            above: (NONE, NONE),
            bounds: root.bounds,
            log_number: root.log_number,
            first,
            end: ends.next(),
        });
        // Pages whose topmost nodes are known, and those nodes in the order of their slots.
        let by_page = |mut all: Vec<Expected>| {
            all.sort_by_key(|expected| expected.node);
            let mut pages: Vec<(u32, Vec<Expected>)> = Vec::new();
            for expected in all {
                let page = expected.node.0 >> header.slot_bits;
                match pages.last_mut() {
                    Some((last, of)) if *last == page => of.push(expected),
                    _ => pages.push((page, vec![expected])),
                }
            }
            pages
        };
        let mut stack = by_page(roots.collect());
        let mut pages = 0_u64;
        while let Some((page, tops)) = stack.pop() {
            pages += 1;
            stack.extend(by_page(verifier.page(page, &tops)?));
        }
        let wrong = |offset, what, value| {
            Err(MetaNodeError::Value { file: self.name().to_owned(), offset, what, value })
        };
        if pages != u64::from(header.pages) {
            return wrong(
                44,
                "the number of pages, of which not all hang below a root,",
                header.pages.into(),
            );
        }
        if let Some(missing) = verifier.met.iter().position(|&met| !met) {
            return wrong(20, "a collapse that no page has", missing as u64);
        }
        if verifier.triangles != u64::from(header.triangles - header.doubled) {
            return wrong(24, "the number of triangles, unlike that on the pages,", header.triangles.into());
        }
        Ok(())
    }
}

impl Verifier<'_> {
    /// Checks a page against what the page above says of it. Returns what it says of those below.
    fn page(&mut self, number: u32, tops: &[Expected]) -> Result<Vec<Expected>, MetaNodeError> {
        let file = self.file;
        let layout = file.read_page(number, &mut self.words)?;
        let damaged = |reason| file.damaged(number, reason);
        let page = Page { words: &self.words[..file.page_words(number)], layout: &layout };
        let (bits, slot_of) =
            (file.header.slot_bits, |node: NodeId| node.0 & ((1 << file.header.slot_bits) - 1));
        let mut tops = tops.iter();
        let mut ends = vec![NONE; layout.nodes as usize];
        for slot in 0..layout.nodes {
            let node = page.node(slot);
            if let Err(block) = node.parent() {
                let Some(top) = tops.next() else { return Err(damaged("a block that nothing leads to")) };
                if slot_of(top.node) != slot
                    || page.above(block) != top.above
                    || node.bounds() != top.bounds
                    || node.log_number() != top.log_number
                    || node.leaves()[0] != top.first
                {
                    return Err(damaged("the topmost node of a block is not what the page above says"));
                }
                ends[slot as usize] = top.end.unwrap_or(NONE);
            }
            match self.met.get_mut(node.log_number() as usize) {
                Some(met) if !*met => *met = true,
                _ => return Err(damaged("two nodes have the same number in the log")),
            }
            self.triangles += page.brought(slot).len() as u64;
        }
        let below_links = check_nesting(page, |slot| ends[slot as usize]).map_err(damaged)?;
        let mut below = Vec::new();
        for slot in 0..layout.nodes {
            for child in page.node(slot).children() {
                let Child::Link(link) = child else { continue };
                let (at, leaves) = (page.link(link), &below_links[link as usize]);
                below.push(Expected {
                    node: at.node,
                    above: (number << bits | slot, page.node(slot).log_number()),
                    bounds: at.bounds,
                    log_number: at.log_number,
                    first: leaves.start,
                    end: Some(leaves.end),
                });
            }
        }
        if tops.next().is_some() {
            return Err(damaged("a node that the page above names is not there"));
        }
        Ok(below)
    }
}
