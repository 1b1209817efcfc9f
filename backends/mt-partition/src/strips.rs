//! Triangle strips for small patches.
//!
//! A strip of `k` triangles is a list of `k + 2` corners; triangle `j` has corners `j`, `j + 1` and `j + 2`, of which the
//! first two change places where `j` is odd. Strips are grown greedily: from the unused triangle with the fewest unused
//! neighbours, whose longest strip of the three that can start there is taken.

use vertex_tree::NONE;

/// Longest strip: its number of corners is stored in a byte. An even number of triangles, so that the next strip can go on
/// where a long one ends: its first triangle has to have the sense of an even one.
const LONGEST: usize = 254;

/// Divides triangles into strips, each a list of corners.
pub(crate) fn strips(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let neighbours = Neighbours::new(triangles);
    let mut used = vec![false; triangles.len()];
    let mut strips = Vec::new();
    let mut trial = Vec::new();
    // Triangles by how many unused neighbours they have; those whose number has fallen since come again.
    let mut queue: [Vec<u32>; 4] = Default::default();
    let unused = |t: u32, used: &[bool]| {
        neighbours.of[t as usize].iter().filter(|&&n| n != NONE && !used[n as usize]).count()
    };
    for t in (0..triangles.len() as u32).rev() {
        queue[unused(t, &used)].push(t);
    }
    while let Some(start) = queue.iter_mut().find_map(Vec::pop) {
        if used[start as usize] {
            continue;
        }
        let mut best: (Vec<u32>, Vec<u32>) = Default::default();
        for first in 0..3 {
            trial.clear();
            let corners = grow(triangles, &neighbours, &used, start, first, &mut trial);
            if trial.len() > best.1.len() {
                best = (corners, trial.clone());
            }
        }
        for &t in &best.1 {
            used[t as usize] = true;
        }
        for n in best.1.iter().flat_map(|&t| neighbours.of[t as usize]).filter(|&n| n != NONE) {
            if !used[n as usize] {
                queue[unused(n, &used)].push(n);
            }
        }
        strips.push(best.0);
    }
    strips
}

/// The longest strip that starts with corner `first` of a triangle; its triangles are appended to `members`.
fn grow(
    triangles: &[[u32; 3]],
    neighbours: &Neighbours,
    used: &[bool],
    start: u32,
    first: usize,
    members: &mut Vec<u32>,
) -> Vec<u32> {
    let [a, b, c] = [0, 1, 2].map(|i| triangles[start as usize][(first + i) % 3]);
    let mut corners = vec![a, b, c];
    members.push(start);
    let mut at = start;
    while corners.len() < LONGEST {
        // The next triangle lies across the edge of the last two corners, on the other side of it.
        let count = corners.len();
        let (p, q) = (corners[count - 2], corners[count - 1]);
        let edge = |t: u32| {
            (0..3).find(|&i| {
                let t = triangles[t as usize];
                [t[i], t[(i + 1) % 3]] == [p, q] || [t[i], t[(i + 1) % 3]] == [q, p]
            })
        };
        let next = edge(at).map_or(NONE, |i| neighbours.of[at as usize][i]);
        if next == NONE || used[next as usize] || members.contains(&next) {
            break;
        }
        let Some(i) = edge(next) else { break };
        let corner = triangles[next as usize][(i + 2) % 3];
        corners.push(corner);
        // Where two neighbours have opposite orientations, the strip would turn one of them over.
        if !is_same(triangle(&corners, count - 2), triangles[next as usize]) {
            corners.pop();
            break;
        }
        members.push(next);
        at = next;
    }
    corners
}

/// Triangle `j` of a strip.
pub(crate) fn triangle(corners: &[u32], j: usize) -> [u32; 3] {
    if j.is_multiple_of(2) {
        [corners[j], corners[j + 1], corners[j + 2]]
    } else {
        [corners[j + 1], corners[j], corners[j + 2]]
    }
}

fn is_same([a, b, c]: [u32; 3], other: [u32; 3]) -> bool {
    [[a, b, c], [b, c, a], [c, a, b]].contains(&other)
}

/// For each triangle, the one across each edge; edge `i` leads from corner `i` to the next.
struct Neighbours {
    of: Vec<[u32; 3]>,
}

impl Neighbours {
    fn new(triangles: &[[u32; 3]]) -> Self {
        let mut edges: Vec<([u32; 2], u32, u8)> = (0..)
            .zip(triangles)
            .flat_map(|(t, c)| {
                (0..3).map(move |i| {
                    let (a, b) = (c[i], c[(i + 1) % 3]);
                    ([a.min(b), a.max(b)], t, i as u8)
                })
            })
            .collect();
        edges.sort_unstable();
        let mut of = vec![[NONE; 3]; triangles.len()];
        for same in edges.chunk_by(|a, b| a.0 == b.0) {
            // Where more than two meet, only the first two are neighbours.
            if let [(_, t, i), (_, u, j), ..] = *same {
                of[t as usize][i as usize] = u;
                of[u as usize][j as usize] = t;
            }
        }
        Self { of }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn canonical(t: [u32; 3]) -> [u32; 3] {
        let least = (0..3).min_by_key(|&i| t[i]).unwrap();
        [0, 1, 2].map(|i| t[(least + i) % 3])
    }

    fn sorted(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<[u32; 3]> {
        let mut all: Vec<_> = triangles.map(canonical).collect();
        all.sort_unstable();
        all
    }

    fn unrolled(strips: &[Vec<u32>]) -> Vec<[u32; 3]> {
        sorted(strips.iter().flat_map(|s| (0..s.len() - 2).map(|j| triangle(s, j))))
    }

    /// A row of squares, which is one strip.
    ///
    /// ```text
    ///   1 --- 3 --- 5 --- 7
    ///   |   / |   / |   / |
    ///   | /   | /   | /   |
    ///   0 --- 2 --- 4 --- 6
    /// ```
    #[test]
    fn a_row_of_squares_is_one_strip() {
        let triangles: Vec<[u32; 3]> =
            [0, 2, 4].into_iter().flat_map(|i| [[i, i + 3, i + 1], [i, i + 2, i + 3]]).collect();
        let strips = strips(&triangles);
        assert_eq!(strips.len(), 1, "{strips:?}");
        assert_eq!(unrolled(&strips), sorted(triangles.into_iter()));
    }

    #[test]
    fn every_triangle_keeps_its_orientation_and_is_there_once() {
        // A wheel, the same triangle twice, one turned over beside it, and three around one edge.
        let mut triangles: Vec<[u32; 3]> = (1..9).map(|i| [0, i, i % 8 + 1]).collect();
        triangles.extend([[20, 21, 22], [20, 21, 22], [20, 21, 23], [1, 2, 30], [2, 1, 31], [5, 6, 6]]);
        assert_eq!(unrolled(&strips(&triangles)), sorted(triangles.into_iter()));
    }
}
