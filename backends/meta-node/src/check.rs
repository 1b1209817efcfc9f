//! What must hold of a page: by itself, which is looked at as it is read and never again, and between two pages, which is looked
//! at when the second of them comes.

use std::ops::Range;

use vertex_tree::{Bounds, NONE, NodeId};

use crate::format::Root;
use crate::page::{Child, HEADER_WORDS, Layout, Limits, Link, Page, TRIANGLE_WORDS, checksum, layout};

/// Checks a page that has been read: after this, nothing on it leads out of it or of the file, and what hangs together on it
/// does so as it should.
///
/// # Errors
/// What is wrong, in words.
pub(crate) fn check(words: &[u32], number: u32, limits: &Limits) -> Result<Layout, &'static str> {
    if words.len() < HEADER_WORDS {
        return Err("shorter than the head of a page");
    }
    if checksum(words) != words[0] {
        return Err("its checksum does not match");
    }
    if words[1] != number {
        return Err("it has another page's number");
    }
    let layout = layout(words).ok_or("its parts do not add up to its length")?;
    let page = Page { words, layout: &layout };
    check_around(page, number, limits)?;
    check_nodes(page, limits)?;
    check_nesting(page, |_| NONE)?;
    Ok(layout)
}

/// Whether pages above and below are where they can be, and blocks and links lead there.
fn check_around(page: Page, number: u32, limits: &Limits) -> Result<(), &'static str> {
    let Layout { parent, first_child, children, .. } = *page.layout;
    if (number < limits.root_pages) != (parent == NONE) || (parent != NONE && parent >= number) {
        return Err("the page above is none that can be");
    }
    if children > 0 && (first_child <= number || limits.pages.checked_sub(children) < Some(first_child)) {
        return Err("the pages below are none that can be");
    }
    for block in 0..page.blocks() {
        let (above, log_number) = page.above(block);
        let fits = if parent == NONE {
            above == NONE && log_number == NONE
        } else {
            above >> limits.slot_bits == parent && log_number < limits.collapses
        };
        if !fits {
            return Err("a block does not hang below the page above");
        }
    }
    if children > page.links() {
        return Err("nothing leads to a page below");
    }
    let mut is_led_to = vec![false; children as usize];
    for link in 0..page.links() {
        let Link { node, log_number, bounds } = page.link(link);
        let below = (node.0 >> limits.slot_bits).checked_sub(first_child);
        let Some(is_led_to) = below.and_then(|below| is_led_to.get_mut(below as usize)) else {
            return Err("a link leads elsewhere than to a page below");
        };
        *is_led_to = true;
        if log_number >= limits.collapses || !bounds.is_sane() {
            return Err("a link leads to a node that can not be");
        }
    }
    // Pages below are asked for with this one, and all of them have to be its own.
    if is_led_to.contains(&false) {
        return Err("nothing leads to a page below");
    }
    Ok(())
}

/// Whether nodes, each by itself and beside its children, are possible, and triangles are theirs.
fn check_nodes(page: Page, limits: &Limits) -> Result<(), &'static str> {
    let nodes = page.layout.nodes;
    if nodes == 0 || nodes > 1 << limits.slot_bits {
        return Err("it holds no node, or too many");
    }
    let mut is_used = vec![false; page.links() as usize];
    let mut is_headed = vec![false; page.blocks() as usize];
    let mut end = 0;
    for slot in 0..nodes {
        let node = page.node(slot);
        for child in node.children() {
            let fits = match child {
                Child::Leaf => true,
                Child::Slot(child) => slot < child && child < nodes && page.node(child).parent() == Ok(slot),
                Child::Link(link) => {
                    is_used.get_mut(link as usize).is_some_and(|used| !std::mem::replace(used, true))
                }
            };
            if !fits {
                return Err("a node has an impossible child");
            }
        }
        let parent_fits = match node.parent() {
            Ok(parent) => parent < slot && page.node(parent).children().contains(&Child::Slot(slot)),
            Err(block) => {
                is_headed.get_mut(block as usize).is_some_and(|headed| !std::mem::replace(headed, true))
            }
        };
        let [kept, removed] = node.leaves();
        if !parent_fits
            || kept >= removed
            || removed >= limits.leaves
            || node.log_number() >= limits.collapses
        {
            return Err("a node has an impossible parent, leaf or number");
        }
        if !node.bounds().is_sane() || !node.position().iter().all(|x| x.is_finite()) {
            return Err("a sphere, an error or a place is not a number");
        }
        if node.triangles_end() < end {
            return Err("the triangles of a node end before they start");
        }
        end = node.triangles_end();
    }
    if is_used.contains(&false) {
        return Err("a link that no node uses");
    }
    if is_headed.contains(&false) {
        return Err("a block without a topmost node");
    }
    let triangles = &page.words[page.layout.triangles_at as usize..];
    if end as usize * TRIANGLE_WORDS != triangles.len() || triangles.iter().any(|&leaf| leaf >= limits.leaves)
    {
        return Err("a triangle belongs to no node or has an impossible leaf");
    }
    Ok(())
}

/// Whether leaves, ages, spheres and errors are nested on a page, and triangles are brought by the nodes that have them. `end` says
/// of a slot with the topmost node of a block where the leaves below it end, [`NONE`] if that is not known.
///
/// Returns the leaves below each link; they end with [`NONE`] where that is not known.
///
/// # Errors
/// What is wrong, in words.
pub(crate) fn check_nesting(page: Page, end: impl Fn(u32) -> u32) -> Result<Vec<Range<u32>>, &'static str> {
    let mut ends = vec![NONE; page.layout.nodes as usize];
    let mut below_links = vec![NONE..NONE; page.links() as usize];
    for slot in 0..page.layout.nodes {
        let node = page.node(slot);
        let [first, pivot] = node.leaves();
        if node.parent().is_err() {
            ends[slot as usize] = end(slot);
        }
        let end = ends[slot as usize];
        if pivot >= end {
            return Err("the leaves of a node are not nested");
        }
        for (child, leaves) in node.children().into_iter().zip([first..pivot, pivot..end]) {
            let (bounds, log_number) = match child {
                Child::Leaf if leaves.len() == 1 || leaves.end == NONE => continue,
                Child::Leaf => return Err("a leaf of the forest stands for several"),
                Child::Slot(child) => {
                    ends[child as usize] = leaves.end;
                    let child = page.node(child);
                    if child.leaves()[0] != leaves.start {
                        return Err("the leaves of a child are not those of its side");
                    }
                    (child.bounds(), child.log_number())
                }
                Child::Link(link) => {
                    below_links[link as usize] = leaves;
                    let link = page.link(link);
                    (link.bounds, link.log_number)
                }
            };
            if log_number >= node.log_number() {
                return Err("a child is younger than its parent");
            }
            if !is_nested(&bounds, &node.bounds()) {
                return Err("a sphere or an error is not nested");
            }
        }
        for corners in page.brought(slot) {
            let sides = corners.map(|leaf| match leaf {
                leaf if (first..pivot).contains(&leaf) => 0,
                leaf if (pivot..end).contains(&leaf) => 1,
                _ => 2,
            });
            // Where it is not known where the leaves end, the third may be behind them.
            let fits = match end {
                NONE => sides.contains(&0) && sides.contains(&1),
                _ => matches!(sides, [2, 0, 1] | [2, 1, 0]),
            };
            if !fits {
                return Err("a triangle is not brought by its node");
            }
        }
    }
    Ok(below_links)
}

/// Whether a sphere is within another, up to the rounding of f32, and its error no larger.
fn is_nested(inner: &Bounds, outer: &Bounds) -> bool {
    let apart = |axis: usize| f64::from(inner.center[axis]) - f64::from(outer.center[axis]);
    let distance = (0..3).map(apart).map(|x| x * x).sum::<f64>().sqrt();
    let slack = f64::from(outer.radius) * 1e-5;
    distance + f64::from(inner.radius) <= f64::from(outer.radius) + slack && inner.eps <= outer.eps
}

/// The topmost nodes of the blocks of a page: the slot of each, and its block.
fn tops<'a>(page: Page<'a>) -> impl Iterator<Item = (u32, u32)> + 'a {
    (0..page.layout.nodes).filter_map(move |slot| page.node(slot).parent().err().map(|block| (slot, block)))
}

/// Whether a page and one below it, which have passed [`check`], say the same of each other.
///
/// # Errors
/// What is wrong, in words.
pub(crate) fn check_between(
    above: (u32, Page),
    below: (u32, Page),
    slot_bits: u32,
) -> Result<(), &'static str> {
    let ((above_number, above), (below_number, below)) = (above, below);
    let Layout { first_child, children, .. } = *above.layout;
    let is_child = below_number.checked_sub(first_child).is_some_and(|at| at < children);
    if is_child != (below.layout.parent == above_number) {
        return Err("a page and the one above it do not know each other");
    }
    if !is_child {
        return Ok(());
    }
    let leads_here = |link: &u32| above.link(*link).node.0 >> slot_bits == below_number;
    let mut links = (0..above.links()).filter(leads_here).count();
    for (slot, block) in tops(below) {
        let (node, (parent, parent_number)) = (below.node(slot), below.above(block));
        let parent_slot = parent & ((1 << slot_bits) - 1);
        if parent_slot >= above.layout.nodes || above.node(parent_slot).log_number() != parent_number {
            return Err("a block hangs below a node that there is not");
        }
        let parent = above.node(parent_slot);
        let id = NodeId(below_number << slot_bits | slot);
        let is_its = |side: usize| match parent.children()[side] {
            Child::Link(link) => {
                above.link(link) == Link { node: id, log_number: node.log_number(), bounds: node.bounds() }
            }
            _ => false,
        };
        let Some(side) = [0, 1].into_iter().find(|&side| is_its(side)) else {
            return Err("the topmost node of a block is not what the page above says");
        };
        if node.leaves()[0] != parent.leaves()[side] {
            return Err("the leaves of a child are not those of its side");
        }
        links = links.wrapping_sub(1);
    }
    if links != 0 {
        return Err("a node that the page above names is not there");
    }
    Ok(())
}

/// Whether a root page, which has passed [`check`], has the roots of the file that should be there, and no others. `roots` are
/// those, each with the leaf of its vertex.
///
/// # Errors
/// What is wrong, in words.
pub(crate) fn check_roots<'a>(
    number: u32,
    page: Page,
    roots: impl ExactSizeIterator<Item = (&'a Root, u32)>,
    slot_bits: u32,
) -> Result<(), &'static str> {
    if tops(page).count() != roots.len() {
        return Err("a root page has other roots than the file");
    }
    for ((slot, _), (root, leaf)) in tops(page).zip(roots) {
        let node = page.node(slot);
        if root.node.0 != number << slot_bits | slot
            || root.log_number != node.log_number()
            || root.bounds != node.bounds()
            || leaf != node.leaves()[0]
        {
            return Err("a root is not what the file says");
        }
    }
    Ok(())
}
