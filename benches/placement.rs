//! What the place and the size of a mesh make of its hierarchy: nothing, or next to nothing.
//!
//! `cargo bench --bench placement [-- WORD...]` builds a city and a scan at their places, moved and scaled, from files in world
//! coordinates, and follows one path, moved and scaled with the mesh, in every backend. It prints collapses, the mean number of
//! triangles displayed in every tenth frame, and the deviation in some frames, each with its ratio to that of the mesh at its
//! place, and marks a row where a ratio is more than 1 % off. A power of two as a scale leaves every bit of a position as it is,
//! and must leave every figure as it is; any other place rounds the last bit of 32, which a mesh moved by a thousandth of its
//! extent shows as well: what differs there is not owed to the distance. Nor is what differs where the vertices come in reverse
//! order, which only decides between collapses that cost the same. Every frame of every exact strategy is checked. It needs
//! `shared/data` beside the repository; words select meshes by name.

#![expect(clippy::disallowed_methods, reason = "shapes to measure with")]

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path as FilePath, PathBuf};

use foldfront::construction::mesh_io;
use foldfront::construction::simplify;
use foldfront::container::Georeference;
use foldfront::experiment::compare::{Options, Subject};
use foldfront::experiment::deviation::Reference;
use foldfront::experiment::path::{Path, Pose, around};
use foldfront::experiment::store::{self, Backend, BuildOptions, Store};
use foldfront::selection::refine::Strategy;
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;

const LINES: u32 = 1080;
/// Triangles are counted once in so many frames.
const COUNT_EVERY: usize = 10;
/// Frames in which deviation is measured.
const MEASURED: usize = 4;
/// More than this off, as a ratio, is marked.
const TOLERATED: f64 = 0.01;

/// From the coordinates of a mesh at its place to those elsewhere.
#[derive(Clone, Copy)]
struct Place {
    name: &'static str,
    scale: f64,
    shift: DVec3,
}

impl Place {
    const HOME: Self = Self { name: "at its place", scale: 1.0, shift: DVec3::ZERO };

    fn of(&self, p: DVec3) -> DVec3 {
        p * self.scale + self.shift
    }
}

/// What is measured of a mesh at one place in one backend.
#[derive(Clone, Copy)]
struct Figures {
    collapses: f64,
    triangles: f64,
    p99: f64,
    largest: f64,
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    let is_chosen = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word.as_str()));
    let town = data.join("city/denhaag01_lod2_terrain.obj");
    if is_chosen("denhaag") && town.exists() {
        let utm = Place { name: "in UTM", shift: DVec3::new(580_000.0, 5_770_000.0, 0.0), ..Place::HOME };
        compare("denhaag", &town, &[utm], write_moved_obj);
    }
    for name in ["bunny", "dragon"] {
        let scan = data.join(format!("meshes/{name}.ply"));
        if is_chosen(name) && scan.exists() {
            let far = DVec3::new(0.6, -0.64, 0.48) * read(&scan).extent();
            let places = [
                Place { name: "times 2^-20", scale: 2.0_f64.powi(-20), ..Place::HOME },
                Place { name: "times 1e-6", scale: 1e-6, ..Place::HOME },
                Place { name: "times 1e6", scale: 1e6, ..Place::HOME },
                Place { name: "moved by 1e-3 extents", shift: far * 1e-3, ..Place::HOME },
                Place { name: "moved by 1e4 extents", shift: far * 1e4, ..Place::HOME },
            ];
            compare(name, &scan, &places, write_placed_ply);
        }
    }
}

fn read(file: &FilePath) -> Mesh {
    mesh_io::read(&[file], &mut |_, _| ()).expect("the data are readable")
}

/// The same surface with its vertices in reverse order.
fn reversed(mut mesh: Mesh) -> Mesh {
    let last = mesh.positions.len() as u32 - 1;
    mesh.positions.reverse();
    mesh.triangles.iter_mut().flatten().for_each(|corner| *corner = last - *corner);
    mesh
}

fn log_of(mesh: Mesh) -> CollapseLog {
    simplify::build(mesh, &simplify::Options::default(), &mut |_, _| ()).expect("the mesh is valid").0
}

/// Prints the table of a mesh: at its place, and at others.
fn compare(
    name: &str,
    file: &FilePath,
    places: &[Place],
    write: fn(&FilePath, &FilePath, &Place) -> io::Result<()>,
) {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let mesh = read(file);
    // About the mesh's own origin first.
    let local = Mesh { georeference: Georeference::default(), ..mesh.clone() };
    let path = placed(
        &around(&local).expect("a place for a camera"),
        &Place { shift: mesh.georeference.origin.into(), ..Place::HOME },
    );
    let log = log_of(mesh);
    let home = all_backends(&log, &path, folder.path());
    println!("| {name} | backend | collapses | triangles | 99 % | largest | |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    print(&Place::HOME, &home, &home);
    drop(log);
    let log = log_of(reversed(read(file)));
    let name = "at its place, vertices in reverse order";
    print(&Place { name, ..Place::HOME }, &all_backends(&log, &path, folder.path()), &home);
    drop(log);
    for place in places {
        let extension = file.extension().unwrap_or_default();
        let moved = folder.path().join("moved").with_extension(extension);
        write(file, &moved, place).expect("there is room for a copy");
        let log = log_of(read(&moved));
        print(place, &all_backends(&log, &placed(&path, place), folder.path()), &home);
    }
    println!();
}

fn print(place: &Place, rows: &[Figures], home: &[Figures]) {
    for ((backend, row), home) in Backend::ALL.iter().zip(rows).zip(home) {
        let of = |f: &Figures| [f.collapses, f.triangles, f.p99, f.largest];
        let (mut line, mut is_off) = (format!("| {} | {} |", place.name, backend.name()), false);
        for ((value, home), digits) in of(row).into_iter().zip(of(home)).zip([0, 0, 3, 3]) {
            let ratio = value / home;
            is_off |= (ratio - 1.0).abs() > TOLERATED;
            let _ = write!(line, " {value:.digits$} ({ratio:.4}) |");
        }
        println!("{line} {} |", if is_off { "more than 1 %" } else { "" });
    }
}

/// Writes the log for every backend, and measures each.
fn all_backends(log: &CollapseLog, path: &Path, folder: &FilePath) -> Vec<Figures> {
    let reference = Reference::new(&log.mesh);
    let measure = |backend: Backend| {
        let file = folder.join(backend.name());
        store::write(backend, &file, log, &BuildOptions::default()).expect("there is room for a hierarchy");
        let store = Store::open(&file).expect("it was just written");
        let mut subject = Subject::of_store(backend.name(), store);
        let strategies = vec![Strategy::TopDown, Strategy::Front, Strategy::Event];
        let options = Options { strategies, check: true, ..Options::default() };
        let runs = subject
            .replay(path, 0..path.frames.len(), &options, &mut |_, _| ())
            .expect("every frame is that of brute force");
        let counted: Vec<f64> =
            runs[0].rows.iter().step_by(COUNT_EVERY).map(|row| row.report.displayed as f64).collect();
        let (mut p99, mut largest) = (0.0_f64, 0.0_f64);
        for n in 0..MEASURED {
            let frame = (2 * n + 1) * path.frames.len() / (2 * MEASURED);
            let shown = subject.frame(path, frame, &options).expect("it was just replayed");
            let deviation = reference.deviation(&shown, &path.camera(frame).expect("a camera"), LINES);
            let (forward, reverse) = (deviation.forward.inner, deviation.reverse.inner);
            p99 = p99.max(forward.p99).max(reverse.p99);
            largest = largest.max(forward.max).max(reverse.max);
        }
        Figures {
            collapses: log.collapses.len() as f64,
            triangles: counted.iter().sum::<f64>() / counted.len() as f64,
            p99,
            largest,
        }
    };
    Backend::ALL.into_iter().map(measure).collect()
}

/// The path as it goes by a mesh elsewhere.
fn placed(path: &Path, place: &Place) -> Path {
    let frames = path.frames.iter().map(|pose| Pose { position: place.of(pose.position), ..*pose }).collect();
    Path { frames, ..path.clone() }
}

/// Moves the vertices of an OBJ file, three decimals each.
fn write_moved_obj(from: &FilePath, to: &FilePath, place: &Place) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(to)?);
    for line in std::fs::read_to_string(from)?.lines() {
        match line.strip_prefix("v ") {
            None => writeln!(out, "{line}")?,
            Some(row) => {
                let mut numbers = row.split_whitespace().map(|x| x.parse().expect("a coordinate"));
                let [x, y, z] = [(); 3].map(|()| numbers.next().expect("three coordinates"));
                let [x, y, z] = place.of(DVec3::new(x, y, z)).to_array();
                writeln!(out, "v {x:.3} {y:.3} {z:.3}")?;
            }
        }
    }
    out.flush()
}

/// Writes a mesh elsewhere, as PLY with `double`.
fn write_placed_ply(from: &FilePath, to: &FilePath, place: &Place) -> io::Result<()> {
    let mesh = read(from);
    let mut out = BufWriter::new(File::create(to)?);
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.positions.len())?;
    writeln!(out, "property double x\nproperty double y\nproperty double z")?;
    writeln!(out, "element face {}", mesh.triangles.len())?;
    writeln!(out, "property list uchar uint vertex_indices\nend_header")?;
    for &position in &mesh.positions {
        let world = place.of(mesh.georeference.world(position).into());
        out.write_all(world.to_array().map(f64::to_le_bytes).as_flattened())?;
    }
    for triangle in &mesh.triangles {
        out.write_all(&[3])?;
        out.write_all(triangle.map(u32::to_le_bytes).as_flattened())?;
    }
    out.flush()
}
