//! `build`, `info` and `verify`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use collapse_log::{CollapseLog, LogFile, Mesh, log_file_version, read_log};
use container::temporary::Temporary;
use container::{DegreeMap, Georeference, output};
use serde_json::json;

use super::arguments::{Build, Info, Verify};
use super::destination::{Content, check_file};
use super::input::Input;
use super::interrupt;
use super::progress::stage;
use super::say::{print, warn};
use crate::experiment::store::{self, Backend, BuildOptions, Store, WriteLimits};
use construction::mesh_io::{self, ReadOptions, Receiver};
use construction::progress::Progress;
use construction::simplify;

pub(super) fn build(command: &Build) -> Result<()> {
    let input = Input::one(&command.input)?;
    check_file(&command.output, Content::Hierarchy(command.backend), &input.files())?;
    if let Some(memory) = command.memory {
        return match &input {
            Input::Meshes(files) => tell(&build_within(&input.name(), files, memory, command)?),
            Input::Log(file) => {
                let log = LogFile::open(file)?;
                let limits = write_limits(memory, command);
                write_within(&input.name(), &log, command, &limits)
            }
            Input::Scene(scene) => anyhow::bail!("--memory builds from files, and {scene} is made in memory"),
            Input::Stored(_) | Input::Objects(_) => input.log(false).map(|_| ()),
        };
    }
    let (log, report) = input.log(command.merge_components)?;
    let options = BuildOptions::from(&command.storage);
    stage(&format!("{}: writing", input.name()), |_| {
        store::write(command.backend, &command.output, &log, &options)
    })?;
    if let Some(report) = report {
        tell(&report)?;
    }
    Ok(())
}

/// What `--memory` allows. From now on an interrupt is an error like any other.
fn write_limits(memory: u64, command: &Build) -> WriteLimits<'static> {
    let temporary = command.temp.as_deref().unwrap_or_else(|| output::folder_of(&command.output));
    WriteLimits { memory, temporary: temporary.to_owned(), stop: interrupt::end_well() }
}

/// Writes the hierarchy of a log that may be larger than memory.
fn write_within(name: &str, log: &LogFile, command: &Build, limits: &WriteLimits<'_>) -> Result<()> {
    let options = BuildOptions::from(&command.storage);
    stage(&format!("{name}: writing"), |_| {
        store::write_within(command.backend, &command.output, log, &options, limits)
    })?;
    Ok(())
}

/// Builds the hierarchy of a mesh that may be larger than memory.
fn build_within(name: &str, files: &[PathBuf], memory: u64, command: &Build) -> Result<simplify::Report> {
    let limits = write_limits(memory, command);
    let expected_triangles = mesh_io::expected_triangles(files);
    let folder = &limits.temporary;
    let mut options = simplify::Options::default();
    options.merge_components = command.merge_components;
    let cores = || std::thread::available_parallelism().map_or(1, usize::from).min(simplify::MOST_THREADS);
    let threads = command.threads.map_or_else(cores, usize::from);
    let own = simplify::Limits {
        memory,
        temporary: folder.clone(),
        threads,
        expected_triangles,
        stop: limits.stop,
    };
    let build = |output: &Path| {
        stage(&format!("{name}: building the hierarchy"), |p| {
            let read = |receiver: &mut dyn Receiver, progress: Progress<'_>| {
                mesh_io::send(files, &ReadOptions::default(), folder, receiver, progress)
            };
            simplify::build_within(read, output, &options, &own, p)
        })
    };
    if command.backend == Backend::InMemory {
        return Ok(build(&command.output)?);
    }
    // The backend's file is written from the log, which nobody has asked for.
    let own_folder = Temporary::new_in(folder);
    let own_folder = own_folder.with_context(|| format!("temporary files in {}", folder.display()))?;
    let log = own_folder.file("log");
    let report = build(&log)?;
    write_within(name, &LogFile::open(&log)?, command, &limits)?;
    Ok(report)
}

/// What a simplification did, and what the user should know of it.
fn tell(report: &simplify::Report) -> Result<()> {
    let mut text = describe(report);
    if HUNDREDTH * report.base_triangles > report.triangles {
        let _ = writeln!(text, "{}", why_left(report));
    }
    print(&text)?;
    warn_of_rounding(&report.georeference);
    Ok(())
}

/// A share of which there are so many.
const HUNDREDTH: usize = 100;

/// Says that positions are too coarse for the mesh, where they are.
fn warn_of_rounding(georeference: &Georeference) {
    let rounding = georeference.rounding;
    if let Some(share) = rounding.share().filter(|share| share * HUNDREDTH as f64 > 1.0) {
        warn(&format!(
            "32 bits about the middle do not hold the coordinates: they move by up to {}, which is {share:.2} of the median edge",
            rounding.largest_move
        ));
    }
}

/// Why so much of a mesh is left.
fn why_left(report: &simplify::Report) -> String {
    let remains = report.remains;
    let mut why = Vec::new();
    if remains.components > 1 {
        let joined = "(--merge-components joins them)";
        why.push(format!("{} components keep at least one each {joined}", remains.components));
    }
    if remains.held_by_topology > 0 {
        let count = remains.held_by_topology;
        why.push(format!("{count} vertices can not go without a change of topology"));
    }
    if remains.held_by_orientation > 0 {
        let count = remains.held_by_orientation;
        why.push(format!("{count} can not go without turning a triangle over"));
    }
    let share = 100.0 * report.base_triangles as f64 / report.triangles as f64;
    format!("{share:.1} % of the triangles remain in the base mesh: {}", why.join(", "))
}

/// What a simplification did, in lines.
fn describe(report: &simplify::Report) -> String {
    let time = report.preparation + report.simplification + report.conclusion;
    let rounding = report.georeference.rounding;
    let moved = rounding.share().map_or_else(String::new, |share| {
        format!("largest move         {} ({share:.1e} of the median edge)\n", rounding.largest_move)
    });
    let text = format!(
        "triangles            {}\ncollapses            {}\nrounds               {}\nroots                {}\n\
         depth                {}\ndependency depth     {}\nbase triangles       {}\nlargest error        {}\n\
         order inversions     {}\nmicroseconds a triangle  {:.2}\n",
        report.triangles,
        report.collapses,
        report.rounds.len(),
        report.roots,
        report.tree_depth,
        report.dependency_depth,
        report.base_triangles,
        report.largest_eps,
        report.inversions,
        time.as_secs_f64() * 1e6 / report.triangles.max(1) as f64,
    );
    text + &moved
}

pub(super) fn info(command: &Info) -> Result<()> {
    if let Input::Stored(file) = Input::one(std::slice::from_ref(&command.file))? {
        let store = Store::open(&file)?;
        warn_of_rounding(&store.georeference());
        let facts = store.facts();
        if command.json {
            let value: serde_json::Map<_, _> =
                facts.into_iter().map(|(name, value)| (name.replace(' ', "_"), value.into())).collect();
            return print(&format!("{:#}\n", serde_json::Value::from(value)));
        }
        let lines = facts.iter().map(|(name, value)| format!("{name:20} {value}\n"));
        return print(&lines.collect::<String>());
    }
    let (log, version) = (read_log(&command.file)?, log_file_version(&command.file)?);
    let bytes = std::fs::metadata(&command.file).with_context(|| command.file.display().to_string())?.len();
    let forest = log.forest()?;
    let roots = forest.roots().count();
    let largest = log.collapses.iter().map(|c| c.bounds.eps).fold(0.0, f32::max);
    let georeference = &log.mesh.georeference;
    warn_of_rounding(georeference);
    let per_triangle = bytes as f64 / log.mesh.triangles.len().max(1) as f64;
    if command.json {
        let mut value = json!({
            "format": "collapse log",
            "version": version,
            "bytes": bytes,
            "bytes_per_triangle": per_triangle,
            "vertices": log.mesh.positions.len(),
            "triangles": log.mesh.triangles.len(),
            "collapses": log.collapses.len(),
            "roots": roots,
            "depth": forest.depth(),
            "base_triangles": base_triangles(&log),
            "largest_error": largest,
            "bounding_box": world_box(&log.mesh),
        });
        if *georeference != Georeference::default() {
            value["origin"] = json!(georeference.origin);
            value["coordinate_system"] = json!(georeference.coordinate_system);
            value["largest_move"] = json!(georeference.rounding.largest_move);
            value["median_edge"] = json!(georeference.rounding.median_edge);
        }
        if let Some(DegreeMap { longitude, latitude, metres_per_degree }) = georeference.degrees {
            value["degrees"] = json!({
                "longitude": longitude,
                "latitude": latitude,
                "metres_per_degree": metres_per_degree,
            });
        }
        return print(&format!("{value:#}\n"));
    }
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:20} {value}");
    };
    line("format", format!("collapse log, version {version} (backend in-memory)"));
    line("bytes", format!("{bytes} ({per_triangle:.1} a triangle)"));
    line("vertices", log.mesh.positions.len().to_string());
    line("triangles", log.mesh.triangles.len().to_string());
    line("collapses", log.collapses.len().to_string());
    line("roots", roots.to_string());
    line("depth", forest.depth().to_string());
    line("base triangles", base_triangles(&log).to_string());
    line("largest error", largest.to_string());
    let [lo, hi] = world_box(&log.mesh);
    line("bounding box", format!("{lo:?} {hi:?}"));
    for (name, value) in georeference.facts() {
        line(name, value);
    }
    print(&text)
}

/// The corners of the bounding box in world coordinates. Those of an f32 alone are shown with no more digits than it has.
fn world_box(mesh: &Mesh) -> [[f64; 3]; 2] {
    let (lo, hi) = mesh.bounding_box().unwrap_or_default();
    let world = |corner: [f32; 3]| {
        let placed = mesh.georeference.world(corner);
        std::array::from_fn(|axis| {
            let own = corner[axis].to_string().parse();
            if mesh.georeference.origin[axis] == 0.0 { own.unwrap_or(placed[axis]) } else { placed[axis] }
        })
    };
    [world(lo), world(hi)]
}

fn base_triangles(log: &CollapseLog) -> usize {
    testing::cut::Displayed::new(log, &vec![false; log.collapses.len()]).triangles.len()
}

/// Everything that reading checks, and that bounds are nested: what the criterion relies on.
pub(super) fn verify(command: &Verify) -> Result<()> {
    if let Input::Stored(file) = Input::one(std::slice::from_ref(&command.file))? {
        let store = Store::open(&file)?;
        stage(&format!("{}: verifying", file.display()), |_| store.verify())?;
        return print(&format!("{}: every page of {} is in order\n", file.display(), store.backend().name()));
    }
    let log = read_log(&command.file)?;
    let forest = log.forest()?;
    for (n, (collapse, &parent)) in log.collapses.iter().zip(&forest.parent).enumerate() {
        if let Some(above) = log.collapses.get(parent as usize) {
            let (inner, outer) = (&collapse.bounds, &above.bounds);
            anyhow::ensure!(
                selection::criterion::is_nested(inner, outer),
                "{}: node {n} is not within its parent {parent}: {inner:?}, {outer:?}",
                command.file.display()
            );
        }
    }
    print(&format!("{}: {} collapses, all in order\n", command.file.display(), log.collapses.len()))
}
