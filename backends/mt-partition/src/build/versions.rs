//! The triangles of the multi-triangulation: every triangle that the simplification went through.
//!
//! A half-edge collapse takes away the triangles around the removed vertex and puts those that do not vanish back with a
//! corner at the kept one. So each *version* of an input triangle is made by one collapse (or is the input's own) and
//! taken away by one later collapse (or is the base mesh's own). Seen from the base mesh, De Floriani, Magillo & Puppo
//! (1997): it lies on exactly one arc, from the node of the collapse that takes it away to the node of the collapse that
//! makes it, and is displayed while the first is unfolded and the second is not.
//!
//! To find the versions takes no mesh. A corner stays at a vertex until the collapse that removes this vertex, and then
//! is at the one that takes its place. So the collapses that change a triangle are those that remove one of its corners,
//! in order, until two corners are the same: each triangle is followed by itself.
//!
//! At boundaries that is not all. When an ear vanishes, its tip is merged away, and its other corners may be left without
//! a new triangle to show for it. Were such a corner removed while the ear is back, the ear would stay behind. The
//! collapse that removes the corner depends on the one that took the ear: an arc without triangles. To find these takes
//! the star of each collapse, that is, the versions that it takes away.

use std::io;

use collapse_log::external::{Array, Sorter, Spool, too_few};
use vertex_tree::NONE;

use super::arcs::{Arcs, Collecting};
use super::history::{Fate, History};
use super::work::{Failure, Work};

/// Follows the triangles. `take` gets the number of the triangle, the corners of each of its versions, the fate of the corner
/// that is removed ([`Fate::STAYS`] in the base mesh) and the place of the node below.
pub(super) fn follow(
    work: Work<'_>,
    mut fate: impl FnMut(u32) -> io::Result<Fate>,
    mut take: impl FnMut(u32, [u32; 3], Fate, u32) -> io::Result<()>,
) -> io::Result<()> {
    for (t, corners) in (0..).zip(work.log.triangles()) {
        work.check()?;
        let mut corners = corners?;
        if is_doubled(corners) {
            // Never shown.
            continue;
        }
        let mut fates = [Fate::STAYS; 3];
        for i in 0..3 {
            fates[i] = fate(corners[i])?;
        }
        let mut below = NONE;
        while !is_doubled(corners) {
            let [a, b, c] = fates.map(|fate| fate.collapse);
            let first = if a <= b.min(c) { 0 } else { 1 + usize::from(c < b) };
            let next = fates[first];
            take(t, corners, next, below)?;
            if next.collapse == NONE {
                break;
            }
            below = next.place;
            corners[first] = next.kept;
            if !is_doubled(corners) {
                fates[first] = fate(next.kept)?;
            }
        }
    }
    Ok(())
}

fn is_doubled([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// The arcs of the graph. Notes in the states of the nodes how many triangles they hold.
pub(super) fn arcs(work: Work<'_>, history: &mut History) -> Result<Arcs, Failure> {
    let History { fates, states, others, ends } = history;
    let mut sorted = Sorter::<5>::new(work.scratch, work.memory / 4);
    follow(
        work,
        |v| fates.get(v as usize),
        |_, [a, b, c], above, below| sorted.push([above.place, below, a, b, c]),
    )?;
    let mut counted = work.scratch.spool::<3>()?;
    let mut count = |arc @ [above, below, triangles]: [u32; 3]| {
        if triangles == 0 {
            return Ok(());
        }
        for (node, side) in [(above, 0), (below, 1)] {
            if node != NONE {
                states.get_mut(node as usize)?.sizes[side] += triangles;
            }
        }
        counted.push(arc)
    };
    let mut events = Sorter::<4>::new(work.scratch, work.memory / 16);
    let (mut ends, mut place) = (ends.read()?, 0);
    let (mut star, mut arc) = (Vec::new(), [NONE, NONE, 0]);
    // The stars of the nodes before a place, of which only the first has triangles.
    let mut finish = |star: &mut Vec<[u32; 3]>, before: u32| {
        while place < before {
            let end = ends.next().ok_or_else(too_few)??;
            push_events(place, end, star, &mut events)?;
            star.clear();
            place += 1;
        }
        io::Result::Ok(())
    };
    let nodes = work.log.counts().collapses as u32;
    sorted.finish(|[above, below, a, b, c]| {
        work.check()?;
        finish(&mut star, above.min(nodes))?;
        if above != NONE {
            star.push([a, b, c]);
        }
        if arc[..2] != [above, below] {
            count(std::mem::replace(&mut arc, [above, below, 0]))?;
        }
        arc[2] += 1;
        Ok(())
    })?;
    finish(&mut star, nodes)?;
    count(arc)?;
    with_bare(work, others, &mut counted, bare(work, events)?)
}

/// The vertex is removed.
const REMOVED: u32 = 0;
/// Another is merged into it, and there are new triangles, or none.
const KEPT: u32 = 1;
const KEPT_BARE: u32 = 2;
/// It loses a triangle and gets none.
const BEREAVED: u32 = 3;

/// What a collapse does to vertices: vertex, collapse, one of the above, place.
fn push_events(
    place: u32,
    [collapse, removed, kept]: [u32; 3],
    star: &[[u32; 3]],
    events: &mut Sorter<4>,
) -> io::Result<()> {
    let remaining = || star.iter().filter(|t| !t.contains(&kept));
    let is_bare = remaining().next().is_none();
    events.push([removed, collapse, REMOVED, place])?;
    events.push([kept, collapse, if is_bare { KEPT_BARE } else { KEPT }, place])?;
    let vanishing = star.iter().filter(|t| t.contains(&kept));
    let mut bereaved: Vec<u32> = vanishing
        .flatten()
        .copied()
        .filter(|v| ![removed, kept].contains(v) && !remaining().any(|t| t.contains(v)))
        .collect();
    bereaved.sort_unstable();
    bereaved.dedup();
    bereaved.into_iter().try_for_each(|v| events.push([v, collapse, BEREAVED, place]))
}

/// The dependencies that no triangle stands for, as (above, below).
fn bare(work: Work<'_>, events: Sorter<4>) -> io::Result<Sorter<2>> {
    let mut bare = Sorter::new(work.scratch, work.memory / 16);
    // Of the vertex in question: the node that last took a triangle from it and gave it none, and the one that last
    // merged another into it, if that made no triangle at all.
    let (mut vertex, mut trace, mut barren) = (NONE, NONE, NONE);
    events.finish(|[v, _, what, place]| {
        work.check()?;
        if v != vertex {
            (vertex, trace, barren) = (v, NONE, NONE);
        }
        let below = match what {
            REMOVED => [trace, barren],
            BEREAVED => [std::mem::replace(&mut trace, place), NONE],
            _ => [std::mem::replace(&mut barren, if what == KEPT_BARE { place } else { NONE }), NONE],
        };
        below.into_iter().filter(|&below| below != NONE).try_for_each(|below| bare.push([place, below]))
    })?;
    Ok(bare)
}

/// Puts arcs without triangles among the others.
fn with_bare(
    work: Work<'_>,
    others: &mut Array<u32>,
    counted: &mut Spool<3>,
    bare: Sorter<2>,
) -> Result<Arcs, Failure> {
    let mut arcs = Collecting::new(work, others)?;
    let mut counted = counted.read()?;
    let mut next = counted.next().transpose()?;
    bare.finish(|[above, below]| {
        while let Some(arc) = next.filter(|arc| [arc[0], arc[1]] <= [above, below]) {
            arcs.push(arc)?;
            next = counted.next().transpose()?;
        }
        arcs.push([above, below, 0])
    })?;
    if let Some(arc) = next {
        arcs.push(arc)?;
    }
    counted.try_for_each(|arc| arcs.push(arc?))?;
    Ok(arcs.finish()?)
}
