//! A log arranged in memory, and the log that the file stands for.

use std::cell::RefCell;
use std::cmp::Reverse;
use std::io::{self, Cursor, Write};
use std::path::Path;

use collapse_log::{Collapse, CollapseLog, Mesh};
use vertex_tree::NormalCone;

use crate::arrange::Arranged;
use crate::error::{Failure, XfmError};
use crate::half_edges::triangle_of;
use crate::nesting::Node;
use crate::numbering::{Owner, owner};
use crate::options::{BuildOptions, WriteReport};
use crate::storage::Memory;
use crate::surface::Surface;

/// A log arranged in memory for an XFM file.
pub struct Arrangement {
    arranged: RefCell<Arranged<Memory>>,
    /// The fully refined mesh in the vertices of the manifold one.
    mesh: Mesh,
    /// For each vertex of the construction, its number in that mesh.
    vertices: Vec<u32>,
}

impl Arrangement {
    /// Arranges a log.
    ///
    /// # Errors
    /// As for [`write()`](crate::write()), except for writing.
    pub fn new(log: &CollapseLog, options: &BuildOptions) -> Result<Self, XfmError> {
        let (mut mesh, mut vertices) = (log.mesh.clone(), Vec::new());
        let arranged = Arranged::new(log, options, &Memory, |surface| {
            if options.quantize {
                // Those without triangles too.
                let scale = &surface.scale;
                mesh.positions.iter_mut().for_each(|p| *p = scale.point(scale.position(*p)));
            }
            vertices = vertices_of(&mut mesh, surface);
            Ok(())
        });
        match arranged {
            Ok(arranged) => Ok(Self { arranged: RefCell::new(arranged), mesh, vertices }),
            Err(failure) => Err(failure.into_error(Path::new(""), Path::new(""))),
        }
    }

    /// Writes the file: to a temporary name, synced, then renamed.
    ///
    /// # Errors
    /// [`FileError::Write`](container::FileError::Write); nothing is left behind then.
    pub fn write(&self, path: &Path) -> Result<WriteReport, XfmError> {
        self.arranged.borrow_mut().write(path, &Memory).map_err(|f| f.into_error(Path::new(""), path))
    }

    /// Writes what the file holds, from front to back.
    ///
    /// # Errors
    /// What `out` says.
    pub fn write_to(&self, out: &mut impl Write) -> io::Result<()> {
        let mut bytes = Cursor::new(Vec::new());
        match self.arranged.borrow_mut().write_to(&mut bytes, &Memory) {
            Err(Failure::Temporary(error) | Failure::Source(error) | Failure::Output(error)) => Err(error),
            Err(Failure::Other(error)) => Err(io::Error::other(error)),
            Ok(()) => out.write_all(&bytes.into_inner()),
        }
    }

    /// What the file will hold.
    #[must_use]
    pub fn report(&self) -> WriteReport {
        self.arranged.borrow().report()
    }

    /// The collapses in descending order of node numbers.
    fn order(&self) -> Vec<u32> {
        let arranged = self.arranged.borrow();
        let mut order: Vec<u32> = (0..arranged.merges.len() as u32).collect();
        order.sort_unstable_by_key(|&n| Reverse(arranged.layout.nodes[n as usize].number));
        order
    }

    /// The log that the file stands for: the manifold mesh, and the collapses that were made on it with their bounds as
    /// stored, in descending order of node numbers. [`log_number`](vertex_tree::Hierarchy::log_number) of the tree counts
    /// in it. Positions are those stored. An oracle made from it knows what the tree's cut should be, as long as bounds are
    /// nested over needs.
    #[must_use]
    pub fn effective_log(&self) -> CollapseLog {
        let arranged = self.arranged.borrow();
        let collapse = |n: u32| {
            let merge = arranged.merges[n as usize];
            let [removed, kept] = [merge.removed, merge.kept].map(|v| self.vertices[v as usize]);
            Collapse { removed, kept, bounds: arranged.nodes[n as usize].bounds() }
        };
        CollapseLog { mesh: self.mesh.clone(), collapses: self.order().into_iter().map(collapse).collect() }
    }

    /// For each collapse of [`effective_log`](Self::effective_log), the cone of normals that the file knows: roots have
    /// none.
    #[must_use]
    pub fn cones(&self) -> Vec<NormalCone> {
        let arranged = self.arranged.borrow();
        let mut cones: Vec<_> = arranged.nodes.iter().map(Node::cone).collect();
        for &root in &arranged.layout.roots {
            cones[root as usize] = NormalCone::NONE;
        }
        self.order().into_iter().map(|n| cones[n as usize]).collect()
    }

    /// For each collapse of [`effective_log`](Self::effective_log), those that its split needs beyond the tree:
    /// the dependencies to close a cut over where bounds are not nested over them.
    #[must_use]
    pub fn needs(&self) -> Vec<Vec<u32>> {
        let arranged = self.arranged.borrow();
        let order = self.order();
        let number = |n: u32| arranged.layout.nodes[n as usize].number;
        let needs = |&n: &u32| {
            let half_edges = arranged.merges[n as usize].adjacent.into_iter();
            let triangles = half_edges.filter_map(|h| arranged.triangles.get(triangle_of(h).0));
            let owners = triangles.filter_map(|&first| match owner(first) {
                Owner::Node(node, ..) => Some(node.0),
                _ => None,
            });
            owners.map(|node| order.partition_point(|&m| number(m) > node) as u32).collect()
        };
        order.iter().map(needs).collect()
    }
}

/// The numbers of a surface's vertices in its mesh, which gets the vertices that were added.
fn vertices_of(mesh: &mut Mesh, surface: &Surface<Memory>) -> Vec<u32> {
    let mut added: Vec<usize> =
        (0..surface.leaves.len()).filter(|&v| surface.leaves[v].order[0] != 0).collect();
    added.sort_unstable_by_key(|&v| surface.leaves[v].order);
    let mut numbers: Vec<u32> = surface.leaves.iter().map(|leaf| leaf.order[1]).collect();
    for v in added {
        numbers[v] = mesh.positions.len() as u32;
        mesh.positions.push(surface.leaves[v].position);
    }
    for (face, &t) in surface.faces.0.iter().zip(&surface.input) {
        mesh.triangles[t as usize] = face.start.map(|v| numbers[v as usize]);
    }
    numbers
}
