//! Coordinates that 32 bits do not hold.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::sync::atomic::AtomicBool;

use foldfront::collapse_log::read_log;
use foldfront::construction::simplify::{LEAST_MEMORY, Limits, Options, build_within};
use foldfront::container::Georeference;

use super::*;

/// Vertices of a grid of 12 x 12 with a spacing, and its triangles.
fn grid(at: [f64; 3], spacing: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let place = |i: u32| {
        let (column, row) = (f64::from(i % 12), f64::from(i / 12));
        [at[0] + spacing * column, at[1] + spacing * row, at[2] + spacing * (0.4 * column).sin()]
    };
    let cells = (0..11 * 11).map(|i| 12 * (i / 11) + i % 11);
    let triangles = cells.flat_map(|v| [[v, v + 1, v + 13], [v, v + 13, v + 12]]);
    ((0..144).map(place).collect(), triangles.collect())
}

fn files(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Vec<(&'static str, Vec<u8>)> {
    let rows: String = positions.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    let faces: String = triangles.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")).collect();
    let obj: String = positions.iter().map(|[x, y, z]| format!("v {x:e} {y} {z}\n")).collect();
    let obj_faces: String =
        triangles.iter().map(|t| t.map(|v| v + 1)).map(|[a, b, c]| format!("f {a} {b} {c}\n")).collect();
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            positions.len(),
            triangles.len()
        )
    };
    let mut binary = header("binary_little_endian").into_bytes();
    let mut big = header("binary_big_endian").into_bytes();
    for x in positions.as_flattened() {
        binary.extend(x.to_le_bytes());
        big.extend(x.to_be_bytes());
    }
    for t in triangles {
        binary.push(3);
        binary.extend(t.iter().flat_map(|v| v.to_le_bytes()));
        big.push(3);
        big.extend(t.iter().flat_map(|v| v.to_be_bytes()));
    }
    vec![
        ("s.obj", [obj, obj_faces].concat().into()),
        ("s.off", format!("OFF\n{} {} 0\n{rows}{faces}", positions.len(), triangles.len()).into()),
        ("s.ply", [header("ascii"), rows, faces].concat().into()),
        ("s.ply", binary),
        ("s.ply", big),
    ]
}

/// Scans with decimetres in UTM and half decimetres about the centre of the Earth: differences are kept.
#[test]
fn shapes_far_from_the_origin_are_kept() {
    for (at, spacing) in
        [([500_000.05, 5_400_000.05, 300.0], 0.1), ([4_075_540.123, 931_735.31, 4_801_629.6], 0.05)]
    {
        let (positions, triangles) = grid(at, spacing);
        for (name, bytes) in files(&positions, &triangles) {
            let mesh = read_bytes(name, bytes).unwrap();
            let Georeference { origin, rounding, .. } = mesh.georeference.clone();
            for (world, &position) in positions.iter().zip(&mesh.positions) {
                for axis in 0..3 {
                    let there = mesh.georeference.world(position)[axis];
                    assert!((there - world[axis]).abs() < spacing * 1e-5, "{name}: {there} {}", world[axis]);
                    assert!((origin[axis] - world[axis]).abs() < 12.0 * spacing);
                }
            }
            assert!(rounding.largest_move <= 11.0 * spacing / 33_554_432.0, "{name}: {rounding:?}");
            assert!((rounding.median_edge / spacing - 1.0).abs() < 0.1, "{name}: {rounding:?}");
            assert_eq!(mesh.triangles, triangles, "{name}");
        }
        // STL numbers vertices as they come.
        let mut text = String::from("solid\n");
        for t in &triangles {
            text += "facet normal 0 0 0 outer loop\n";
            for [x, y, z] in t.map(|v| positions[v as usize]) {
                text += &format!("vertex {x} {y} {z}\n");
            }
            text += "endloop endfacet\n";
        }
        let mesh = read_bytes("s.stl", text + "endsolid\n").unwrap();
        assert_eq!(counts(&mesh), (144, 242));
        let worlds = facets(&mesh)
            .zip(&triangles)
            .flat_map(|(f, t)| f.into_iter().zip(t.map(|v| positions[v as usize])));
        for (position, world) in worlds {
            let there = mesh.georeference.world(position);
            assert!((0..3).all(|axis| (there[axis] - world[axis]).abs() < spacing * 1e-5));
        }
    }
}

/// Nothing is touched if 32 bits hold all coordinates.
#[test]
fn what_32_bits_hold_stays_as_it_is() {
    let obj = "v -0 0 0.5\nv 16777216 1e-40 3.4028234663852886e38\nv 0.1 0 0\nf 1 2 3\n";
    let held = obj.replace("0.1", "0.125").replace("1e-40", "1.40129846432481707e-45");
    let mesh = read_bytes("s.obj", held).unwrap();
    assert_eq!(mesh.georeference, Georeference::default());
    assert_eq!(mesh.positions[0].map(f32::to_bits), [-0.0, 0.0, 0.5].map(f32::to_bits));
    assert_eq!(mesh.positions[1], [16_777_216.0, f32::from_bits(1), f32::MAX]);

    // A PLY `float` is one, also in text; a `double` is one.
    let ply = |kind: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n0.1 0 0 0 1 0 0.7 0 1\n3 0 1 2\n"
        )
    };
    let mesh = read_bytes("s.ply", ply("float")).unwrap();
    assert_eq!((mesh.positions[0], mesh.georeference.origin), ([0.1, 0.0, 0.0], [0.0; 3]));
    let mesh = read_bytes("s.ply", ply("double")).unwrap();
    assert_eq!(mesh.georeference.origin, [0.35, 0.5, 0.5]);
    assert_eq!(mesh.positions[0], [-0.25, -0.5, -0.5]);
}

/// STL in text joins what is equal in 64 bits, and nothing else.
#[test]
fn stl_corners_are_compared_as_they_are() {
    let facet = |x: f64| format!("facet\nvertex 0 0 0\nvertex {x} 0 0\nvertex 0 1 0\nendfacet\n");
    let text = |second| format!("solid\n{}{}endsolid\n", facet(5_000_000.1), facet(second));
    assert_eq!(counts(&read_bytes("s.stl", text(5_000_000.1)).unwrap()), (3, 2));
    assert_eq!(counts(&read_bytes("s.stl", text(5_000_000.100000001)).unwrap()), (4, 2));
}

#[test]
fn what_is_written_is_in_the_world() {
    let (positions, triangles) = grid([500_000.05, 5_400_000.05, 300.0], 0.1);
    let (name, bytes) = files(&positions, &triangles).remove(0);
    let mesh = read_bytes(name, bytes).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.ply");
    mesh_io::write_ply(&path, &mesh, Some(&[[1, 2, 3]; 144])).unwrap();
    let head = String::from_utf8_lossy(&fs::read(&path).unwrap()[..150]).into_owned();
    assert!(head.contains("property double y"), "{head}");
    let again = read(&[&path]).unwrap();
    assert_eq!(again.triangles, mesh.triangles);
    for (&position, &before) in again.positions.iter().zip(&mesh.positions) {
        let [now, before] = [again.georeference.world(position), mesh.georeference.world(before)];
        assert!((0..3).all(|axis| (now[axis] - before[axis]).abs() < 1e-7), "{now:?} {before:?}");
    }
}

fn collected(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Mesh {
    let mut collector = Collector::default();
    send(positions, triangles, &mut collector).unwrap();
    collector.into_mesh()
}

fn send(
    positions: &[[f64; 3]],
    triangles: &[[u32; 3]],
    to: &mut dyn mesh_io::Receiver,
) -> Result<(), MeshIoError> {
    to.georeference("EPSG:25832", None);
    positions.iter().try_for_each(|&p| to.position(p)).map_err(MeshIoError::Receiver)?;
    for (v, &position) in (0..).zip(positions) {
        assert_eq!(to.position_of(v).unwrap().map(f64::to_bits), position.map(f64::to_bits));
    }
    triangles.iter().try_for_each(|&t| to.triangle(t)).map_err(MeshIoError::Receiver)
}

/// Within little memory everything is as in memory, bit for bit: whether coordinates need 64 bits from the first on, from
/// somewhere on, or not at all, and where they do without being rounded.
#[test]
fn it_is_the_same_within_little_memory() {
    let (mut late, triangles) = grid([4096.0, -512.0, 7.0], 0.5);
    late.iter_mut().for_each(|p| p[2] = p[2].round());
    let held = late.clone();
    late[77][1] += 0.1;
    let unrounded = held.iter().map(|p| [p[0] + 16_777_216.0, p[1], p[2]]).collect();
    for (name, positions, needs_origin) in [
        ("held", held, false),
        ("late", late, true),
        ("from the first on", grid([500_000.05, 5_400_000.05, 300.0], 0.1).0, true),
        ("not rounded", unrounded, true),
    ] {
        let mesh = collected(&positions, &triangles);
        assert_eq!(mesh.georeference.coordinate_system, "EPSG:25832");
        assert_eq!(mesh.georeference.origin != [0.0; 3], needs_origin, "{name}");
        let is_rounded = mesh.georeference.rounding.largest_move > 0.0;
        assert_eq!(is_rounded, needs_origin && name != "not rounded", "{name}");
        assert_eq!(mesh.georeference.rounding.median_edge > 0.0, is_rounded, "{name}");

        let folder = tempfile::tempdir().unwrap();
        let (file, stop) = (folder.path().join("log"), AtomicBool::new(false));
        let temporary = folder.path().to_owned();
        let limits =
            Limits { memory: LEAST_MEMORY, temporary, threads: 1, expected_triangles: 0, stop: &stop };
        let read =
            |to: &mut dyn mesh_io::Receiver, _: &mut dyn FnMut(u64, u64)| send(&positions, &triangles, to);
        let report = build_within(read, &file, &Options::default(), &limits, &mut |_, _| ()).unwrap();
        assert_eq!(report.georeference, mesh.georeference, "{name}");
        let bits = |mesh: &Mesh| mesh.positions.iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&read_log(&file).unwrap().mesh), bits(&mesh), "{name}");
        let (_, in_memory) =
            foldfront::construction::simplify::build(mesh, &Options::default(), &mut |_, _| ()).unwrap();
        assert_eq!(report.georeference, in_memory.georeference, "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// No coordinate moves by more than 2^-25 of the extent, and the largest move and the median edge are what they are called.
    #[test]
    fn no_coordinate_moves_far(
        centre in prop::array::uniform3(-1e7_f64..1e7),
        sizes in prop::array::uniform3(-30_i32..40),
        points in prop::collection::vec(prop::array::uniform3(-1.0_f64..1.0), 3..40),
    ) {
        let place = |p: &[f64; 3]| std::array::from_fn(|axis| centre[axis] + p[axis] * f64::from(sizes[axis]).exp2());
        let positions: Vec<[f64; 3]> = points.iter().map(place).collect();
        let triangles: Vec<_> = (2..positions.len() as u32).map(|v| [v - 2, v - 1, v]).collect();
        let mesh = collected(&positions, &triangles);
        let mut largest = 0.0_f64;
        for axis in 0..3 {
            let along = || positions.iter().map(|p| p[axis]);
            let extent = along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min);
            for (world, position) in positions.iter().zip(&mesh.positions) {
                let moved = mesh.georeference.local(*world)[axis] - f64::from(position[axis]);
                prop_assert!(moved.abs() <= extent / 33_554_432.0, "{moved} of {extent}");
                largest = largest.max(moved.abs());
            }
        }
        let rounding = mesh.georeference.rounding;
        prop_assert_eq!(rounding.largest_move, largest);
        let mut lengths: Vec<f64> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|edge| edge.map(|v| positions[v as usize]))
            .map(|[p, q]| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt())
            .collect();
        lengths.sort_by(f64::total_cmp);
        let [below, above] = [lengths[(lengths.len() - 1) / 2], lengths[lengths.len() / 2]];
        if largest > 0.0 {
            let median = rounding.median_edge;
            prop_assert!(0.99 * below <= median && median <= 1.01 * above, "{below} {median} {above}");
        }
    }
}
