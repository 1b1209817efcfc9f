//! A triangle mesh as directed half-edges.
//!
//! Weiler, Edge-based data structures for solid modeling in curved-surface environments, 1985; as XFastMesh uses them.
//! The half-edges of the triangle in slot `t` are `4 t`, `4 t + 1`, `4 t + 2`, counter-clockwise, so that the triangle is
//! found by a shift and the next half-edge without a look. Each has its start vertex and its reverse in the adjacent
//! triangle, or [`BOUNDARY`].
//!
//! ```text
//!          p                    p          A: v -> u   B: u -> p   C: p -> v      w = rev B   x = rev C
//!        x/ \w                  |          D: u -> v   E: v -> q   F: q -> u      y = rev E   z = rev F
//!        /C B\                  |
//!       v --A-> u     ==>     w | x        the half-edge A collapses: v merges into u, rev w = x, rev y = z.
//!       v <-D-- u             y | z        Either triangle may be missing, where A lies on a boundary; then both of
//!        \E F/                  u          its w x (or y z) are `BOUNDARY`. One of them alone may be as well.
//!        y\ /z                  |
//!          q                    q
//! ```

/// Number of a half-edge of a displayed triangle.
pub(crate) type HalfEdge = u32;

/// The reverse of a half-edge on a boundary.
pub(crate) const BOUNDARY: HalfEdge = u32::MAX;

/// The half-edge after `h` around its triangle.
#[inline(always)]
pub(crate) fn next(h: HalfEdge) -> HalfEdge {
    if h & 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` around its triangle.
#[inline(always)]
pub(crate) fn prev(h: HalfEdge) -> HalfEdge {
    if h & 3 == 0 { h + 2 } else { h - 1 }
}

/// The triangle's slot, and which of its half-edges `h` is.
#[inline(always)]
pub(crate) fn triangle_of(h: HalfEdge) -> (usize, usize) {
    ((h >> 2) as usize, (h & 3) as usize)
}

/// A triangle: its corners and the reverses of the half-edges that start there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Triangle {
    pub start: [u32; 3],
    pub rev: [HalfEdge; 3],
}

impl Triangle {
    /// What is in a slot without a triangle.
    pub const NONE: Self = Self { start: [u32::MAX; 3], rev: [BOUNDARY; 3] };
}

/// The half-edges adjacent to the triangles that a collapse removes: w x y z of the paper's Figure 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Adjacent {
    pub w: HalfEdge,
    pub x: HalfEdge,
    pub y: HalfEdge,
    pub z: HalfEdge,
}

impl Adjacent {
    /// Whether the collapse removes a triangle beside w and x, and one beside y and z.
    pub fn sides(self) -> [bool; 2] {
        [self.w != BOUNDARY || self.x != BOUNDARY, self.y != BOUNDARY || self.z != BOUNDARY]
    }
}

/// Triangles in slots. Which slots are in use is known to the owner.
#[derive(Clone, Debug, Default)]
pub(crate) struct HalfEdges {
    pub triangles: Vec<Triangle>,
}

impl HalfEdges {
    #[inline(always)]
    pub fn rev(&self, h: HalfEdge) -> HalfEdge {
        let (t, k) = triangle_of(h);
        self.triangles[t].rev[k]
    }

    #[inline(always)]
    pub fn start(&self, h: HalfEdge) -> u32 {
        let (t, k) = triangle_of(h);
        self.triangles[t].start[k]
    }

    #[inline(always)]
    pub fn end(&self, h: HalfEdge) -> u32 {
        self.start(next(h))
    }

    #[inline(always)]
    pub fn set_start(&mut self, h: HalfEdge, vertex: u32) {
        let (t, k) = triangle_of(h);
        self.triangles[t].start[k] = vertex;
    }

    /// Makes two half-edges each other's reverse, or one of them a boundary if the other is [`BOUNDARY`].
    #[inline(always)]
    pub fn pair(&mut self, h: HalfEdge, g: HalfEdge) {
        for (h, g) in [(h, g), (g, h)] {
            if h != BOUNDARY {
                let (t, k) = triangle_of(h);
                self.triangles[t].rev[k] = g;
            }
        }
    }

    /// See [`adjacent`].
    pub fn adjacent(&self, a: HalfEdge, d: HalfEdge) -> Adjacent {
        let Ok(adjacent) = adjacent(&mut &*self, a, d);
        adjacent
    }

    /// See [`fan`].
    #[inline]
    pub fn fan(&self, adjacent: Adjacent, found: &mut Vec<HalfEdge>) -> bool {
        let Ok(fits) = fan(&mut &*self, adjacent, found);
        fits
    }

    /// See [`orbit`].
    pub fn orbit(&self, first: HalfEdge, found: &mut Vec<HalfEdge>) {
        let Ok(()) = orbit(&mut &*self, first, found);
    }

    /// The kept vertex and the far corners `p` and `q` of a collapse that has been made, seen from what is around it.
    /// `None` if they contradict each other: a damaged file.
    #[inline]
    pub fn around(&self, adjacent: Adjacent) -> Option<(u32, [u32; 2])> {
        let Adjacent { w, x, y, z } = adjacent;
        // Each of the two pairs is an edge now, from the kept vertex (where x and z start) to the far corner.
        let edge = |to: HalfEdge, from: HalfEdge| {
            let fits = (to == BOUNDARY || self.rev(to) == from) && (from == BOUNDARY || self.rev(from) == to);
            let end = if from == BOUNDARY { self.start(to) } else { self.end(from) };
            let start = if from == BOUNDARY { self.end(to) } else { self.start(from) };
            fits.then_some((start, end))
        };
        match adjacent.sides() {
            [true, true] => {
                let ((u, p), (v, q)) = (edge(w, x)?, edge(y, z)?);
                (u == v).then_some((u, [p, q]))
            }
            [true, false] => edge(w, x).map(|(u, p)| (u, [p, u32::MAX])),
            [false, true] => edge(y, z).map(|(u, q)| (u, [u32::MAX, q])),
            [false, false] => None,
        }
    }
}

/// What knows the reverses of half-edges.
pub(crate) trait Reverses {
    /// Why they may not be had.
    type Error;

    fn rev(&mut self, h: HalfEdge) -> Result<HalfEdge, Self::Error>;
}

impl Reverses for &HalfEdges {
    type Error = std::convert::Infallible;

    #[inline(always)]
    fn rev(&mut self, h: HalfEdge) -> Result<HalfEdge, Self::Error> {
        Ok(HalfEdges::rev(self, h))
    }
}

/// w x y z of the collapse of the edge with the half-edges `a` and `d`, one of which may be [`BOUNDARY`].
#[inline]
pub(crate) fn adjacent<R: Reverses>(edges: &mut R, a: HalfEdge, d: HalfEdge) -> Result<Adjacent, R::Error> {
    let mut beside = |h: HalfEdge| match h {
        BOUNDARY => Ok([BOUNDARY; 2]),
        h => Ok([edges.rev(next(h))?, edges.rev(prev(h))?]),
    };
    let ([w, x], [y, z]) = (beside(a)?, beside(d)?);
    Ok(Adjacent { w, x, y, z })
}

/// The half-edges that start at the removed vertex `v`, in triangles that the collapse does not remove: those that
/// change their start, whichever way. They lie between `x` and `y`, in two arms if `v` is on a boundary.
///
/// Returns `false` if `x` and `y` are not at one vertex, which happens in a damaged file alone. It ends all the same:
/// turning about a vertex is a permutation, so it comes back to where it began.
#[inline]
pub(crate) fn fan<R: Reverses>(
    edges: &mut R,
    Adjacent { x, y, .. }: Adjacent,
    fan: &mut Vec<HalfEdge>,
) -> Result<bool, R::Error> {
    fan.clear();
    let mut h = x;
    while h != BOUNDARY {
        fan.push(h);
        let into = prev(h);
        if into == y {
            return Ok(true);
        }
        h = edges.rev(into)?;
        if h == x {
            return Ok(false);
        }
    }
    if y != BOUNDARY {
        let first = next(y);
        let mut h = first;
        loop {
            fan.push(h);
            match edges.rev(h)? {
                BOUNDARY => break,
                back => h = next(back),
            }
            if h == first {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// All half-edges that start where `first` does, in any order.
#[inline]
pub(crate) fn orbit<R: Reverses>(
    edges: &mut R,
    first: HalfEdge,
    orbit: &mut Vec<HalfEdge>,
) -> Result<(), R::Error> {
    orbit.clear();
    let mut h = first;
    loop {
        orbit.push(h);
        h = edges.rev(prev(h))?;
        if h == first {
            return Ok(());
        }
        if h == BOUNDARY {
            break;
        }
    }
    let mut back = edges.rev(first)?;
    while back != BOUNDARY {
        let h = next(back);
        orbit.push(h);
        back = edges.rev(h)?;
    }
    Ok(())
}
