//! The collapse log: a simplification, step by step.

use vertex_tree::{Bounds, NONE};

use crate::mesh::Mesh;

/// One half-edge collapse: vertex `removed` merges into vertex `kept`, which stays where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Collapse {
    /// The input vertex that disappears.
    pub removed: u32,
    /// The input vertex that takes its place.
    pub kept: u32,
    /// Sphere and error of the node that the collapse makes.
    pub bounds: Bounds,
}

impl Collapse {
    /// Whether this, the collapse with a number, can be one, whatever the mesh. Whether its vertices are there depends on the
    /// collapses before it.
    ///
    /// # Errors
    /// [`LogError::IntoItself`], [`LogError::BadBounds`].
    pub fn check(&self, number: usize) -> Result<(), LogError> {
        if self.removed == self.kept {
            return Err(LogError::IntoItself { collapse: number, vertex: self.kept });
        }
        if !self.bounds.is_sane() {
            return Err(LogError::BadBounds { collapse: number, bounds: self.bounds });
        }
        Ok(())
    }
}

/// A mesh and the collapses that simplify it, in order. Collapse number `i` makes inner node `i` of the forest.
///
/// It can be replayed and stopped anywhere: after the first `m` collapses, a corner at input vertex `v` is shown at
/// the vertex into which `v` was merged by them, and a triangle is shown if its corners are at three different
/// vertices. Every backend is built from it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CollapseLog {
    /// The input, unchanged.
    pub mesh: Mesh,
    /// The collapses in the order in which they were made. Each names two vertices that are still there.
    pub collapses: Vec<Collapse>,
}

/// A log whose collapses do not fit its mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// A collapse names a vertex that the mesh does not have or that an earlier collapse removed.
    #[error("collapse {collapse}: vertex {vertex} is not there")]
    NoSuchVertex {
        /// Number of the collapse.
        collapse: usize,
        /// The vertex it names.
        vertex: u32,
    },
    /// A collapse merges a vertex into itself.
    #[error("collapse {collapse}: vertex {vertex} merges into itself")]
    IntoItself {
        /// Number of the collapse.
        collapse: usize,
        /// The vertex it names.
        vertex: u32,
    },
    /// A triangle names a vertex that the mesh does not have.
    #[error("triangle {triangle}: vertex {vertex} of {vertices}")]
    CornerOutOfRange {
        /// Number of the triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// A radius or an error is negative or not finite, or a coordinate is not finite.
    #[error("collapse {collapse}: bounds {bounds:?}")]
    BadBounds {
        /// Number of the collapse.
        collapse: usize,
        /// As found.
        bounds: Bounds,
    },
    /// More triangles than the backend can number.
    #[error("{triangles} triangles, of which this backend takes {most}")]
    TooManyTriangles {
        /// How many there are.
        triangles: usize,
        /// How many there may be.
        most: usize,
    },
    /// A vertex position is not finite.
    #[error("vertex {vertex}: position {position:?}")]
    BadPosition {
        /// Number of the vertex.
        vertex: usize,
        /// As found.
        position: [f32; 3],
    },
}

/// The binary forest that a log describes, as flat arrays over its collapses. Child references are to inner nodes;
/// [`NONE`] where the child is a leaf.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Forest {
    /// For each node, the inner node whose vertex was kept, if it is not a leaf.
    pub kept_child: Vec<u32>,
    /// For each node, the inner node whose vertex was removed, if it is not a leaf.
    pub removed_child: Vec<u32>,
    /// For each node, its parent, or [`NONE`] for a root.
    pub parent: Vec<u32>,
    /// For each input vertex, the topmost node above it, or [`NONE`] if no collapse ever touched it.
    pub root_of_vertex: Vec<u32>,
}

impl Forest {
    /// The roots in ascending order.
    pub fn roots(&self) -> impl Iterator<Item = u32> + '_ {
        (0..).zip(&self.parent).filter(|&(_, &p)| p == NONE).map(|(n, _)| n)
    }

    /// The number of edges on the longest way from a root down to a leaf.
    #[must_use]
    pub fn depth(&self) -> u32 {
        // Parents come after their children in the log, so one pass from the end meets them first.
        let mut depth = vec![0; self.parent.len()];
        for n in (0..depth.len()).rev() {
            depth[n] = match self.parent[n] {
                NONE => 1,
                p => depth[p as usize] + 1,
            };
        }
        depth.into_iter().max().unwrap_or(0)
    }
}

impl CollapseLog {
    /// Checks every reference and number in the log and derives the forest.
    ///
    /// # Errors
    /// The first thing that does not fit. A log that passes is safe to build any backend from.
    pub fn forest(&self) -> Result<Forest, LogError> {
        let vertices = self.mesh.positions.len();
        for (vertex, &position) in self.mesh.positions.iter().enumerate() {
            if !position.iter().all(|x| x.is_finite()) {
                return Err(LogError::BadPosition { vertex, position });
            }
        }
        for (triangle, corners) in self.mesh.triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(LogError::CornerOutOfRange { triangle, vertex, vertices });
            }
        }
        let count = self.collapses.len();
        let mut forest = Forest {
            kept_child: vec![NONE; count],
            removed_child: vec![NONE; count],
            parent: vec![NONE; count],
            root_of_vertex: Vec::new(),
        };
        // The node at which a vertex now stands; a removed vertex points at the vertex that took its place.
        let mut top = vec![NONE; vertices];
        let mut into = vec![NONE; vertices];
        for (n, c) in self.collapses.iter().enumerate() {
            for vertex in [c.removed, c.kept] {
                if vertex as usize >= vertices || into[vertex as usize] != NONE {
                    return Err(LogError::NoSuchVertex { collapse: n, vertex });
                }
            }
            c.check(n)?;
            let (kept, removed) = (top[c.kept as usize], top[c.removed as usize]);
            forest.kept_child[n] = kept;
            forest.removed_child[n] = removed;
            for child in [kept, removed] {
                if child != NONE {
                    forest.parent[child as usize] = n as u32;
                }
            }
            top[c.kept as usize] = n as u32;
            into[c.removed as usize] = c.kept;
        }
        for c in self.collapses.iter().rev() {
            top[c.removed as usize] = top[c.kept as usize];
        }
        forest.root_of_vertex = top;
        Ok(forest)
    }
}
