//! The part of the corpora that the program makes itself: logs and hierarchies over a few small meshes, in all ways of writing them.

use std::fs;

use foldfront::collapse_log::{CollapseLog, write_log};
use foldfront::construction::simplify;
use foldfront::vertex_tree::DegreeMap;
use foldfront::{Mesh, detail_block, meta_node, mt_partition};

use crate::inputs::corpora;

/// Writes them.
pub fn write() -> Result<bool, String> {
    let made = [("sheet", log(sheet(6))?), ("ball", log(ball(4))?), ("two", log(two())?)];
    for folder in ["fold", "meta", "xfm", "mt"] {
        fs::create_dir_all(corpora().join(folder)).map_err(said)?;
    }
    for (name, log) in &made {
        let at = |format: &str, kind: &str| corpora().join(format).join(format!("{name}{kind}.{format}"));
        write_log(&at("fold", ""), log).map_err(said)?;
        for (kind, levels, page_bytes) in [("-small-pages", 1, 200), ("", 2, 600), ("-one-page", 4, 4096)] {
            let options = meta_node::BuildOptions { levels: Some(levels), page_bytes };
            meta_node::write(&at("meta", kind), log, &options).map_err(said)?;
        }
        for (kind, levels, quantize) in [("-1", 1, false), ("-2", 2, false), ("-3-quantised", 3, true)] {
            let options = detail_block::BuildOptions { levels, quantize, ..Default::default() };
            detail_block::write(&at("xfm", kind), log, &options).map_err(said)?;
        }
        for (kind, patch, partition) in [("-unreduced", 0.0, 3), ("", 3.0, 4), ("-strips", 12.0, 20)] {
            let options = mt_partition::BuildOptions { patch, partition, ..Default::default() };
            mt_partition::write(&at("mt", kind), log, &options).map_err(said)?;
        }
    }
    Ok(true)
}

fn said(error: impl std::error::Error) -> String {
    error.to_string()
}

fn log(mesh: Mesh) -> Result<CollapseLog, String> {
    let (log, _) = simplify::build(mesh, &simplify::Options::default(), &mut |_, _| ()).map_err(said)?;
    Ok(log)
}

/// A bumpy square, somewhere in the world.
fn sheet(side: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..side * side {
        let [x, y] = [i % side, i / side].map(|i| 2.0 * i as f32 / (side - 1) as f32 - 1.0);
        mesh.positions.push([x, y, 0.1 * (7.0 * x).fract() * (5.0 * y + 0.3).fract()]);
    }
    for i in (0..side * (side - 1)).filter(|i| i % side != side - 1) {
        mesh.triangles.push([i, i + 1, i + side + 1]);
        mesh.triangles.push([i, i + side + 1, i + side]);
    }
    mesh.georeference.origin = [500_000.0, 5_200_000.0, 400.0];
    "EPSG:32632".clone_into(&mut mesh.georeference.coordinate_system);
    mesh.georeference.degrees =
        Some(DegreeMap { longitude: 9.0, latitude: 47.0, metres_per_degree: [76_000.0, 111_000.0] });
    mesh
}

/// A closed surface: a cube's, each face a grid, drawn towards a ball.
fn ball(side: i32) -> Mesh {
    let mut mesh = Mesh::default();
    let mut known = std::collections::BTreeMap::new();
    let last = side - 1;
    for face in 0..6 {
        let (axis, end) = (face % 3, if face < 3 { 0 } else { last });
        let mut at = |i: i32, j: i32| {
            let mut cell = [0; 3];
            cell[axis] = end;
            cell[(axis + 1) % 3] = i;
            cell[(axis + 2) % 3] = j;
            *known.entry(cell).or_insert_with(|| {
                let [x, y, z] = cell.map(|c| 2.0 * c as f32 / last as f32 - 1.0);
                let length = (x * x + y * y + z * z).sqrt();
                mesh.positions.push([x / length, y / length, z / length]);
                mesh.positions.len() as u32 - 1
            })
        };
        let mut triangles = Vec::new();
        for (i, j) in (0..last).flat_map(|i| (0..last).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        if end == 0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        mesh.triangles.extend(triangles);
    }
    mesh
}

/// Two sheets that touch in a vertex, and a fin on an edge: no manifold, and more roots than one.
fn two() -> Mesh {
    let mut mesh = sheet(4);
    mesh.georeference = Default::default();
    let first = mesh.positions.len() as u32;
    let other = sheet(3);
    mesh.positions.extend(other.positions.iter().map(|p| [p[0] + 2.0, p[1] + 2.0, p[2] + 0.5]));
    mesh.triangles
        .extend(other.triangles.iter().map(|t| t.map(|v| if v == 0 { first - 1 } else { v + first })));
    mesh.positions.push([0.0, 0.0, 1.0]);
    let tip = mesh.positions.len() as u32 - 1;
    mesh.triangles.push([5, 6, tip]);
    mesh
}
