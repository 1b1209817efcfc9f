//! What is measured: hierarchies and paths, kept between runs.

use std::path::PathBuf;
use std::sync::Arc;

use foldfront::CollapseLog;
use foldfront::collapse_log::{read_log, write_log};
use foldfront::construction::mesh_io;
use foldfront::construction::simplify;
use foldfront::experiment::path::Path;
use foldfront::experiment::path::import::{Mode, Options, import};
use foldfront::page_store::source::FileSource;
use foldfront::selection::view::{View, theta_of_pixels};
use meta_node::{BuildOptions, MetaNodeFile};

/// A file or folder among the shared data; `None` where there is no such data.
pub fn shared(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(name);
    path.exists().then_some(path)
}

/// Whether a name is among some words, or none of `all` is.
pub fn is_chosen(name: &str, words: &[String], all: impl IntoIterator<Item = &'static str>) -> bool {
    let is_named = |name: &str| words.iter().any(|word| word == name);
    is_named(name) || !all.into_iter().any(is_named)
}

/// A file that is kept between runs.
pub fn kept(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("strategies");
    std::fs::create_dir_all(&folder).expect("target is writable");
    folder.join(name)
}

/// Processor time of this process so far, in seconds: what else the machine does is not in it.
pub fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let fields: Vec<&str> = after_name.split_whitespace().collect();
    // utime and stime, in ticks of 10 ms on every Linux that is about.
    fields
        .get(11..13)
        .map_or(0.0, |ticks| ticks.iter().filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0)
}

/// The files of a mesh: one, or the tiles of a mosaic.
pub fn inputs(name: &str) -> Option<Vec<PathBuf>> {
    match name {
        "sierra" => ["N36W118", "N36W119", "N37W118", "N37W119"]
            .iter()
            .map(|tile| shared(&format!("terrain/{tile}.hgt")))
            .collect(),
        "denhaag" => Some(vec![shared("city/denhaag01_lod2_terrain.obj")?]),
        "boston" => Some(vec![shared("city/boston_blocks.obj")?]),
        name => Some(vec![shared(&format!("meshes/{name}.ply"))?]),
    }
}

fn is_city(name: &str) -> bool {
    ["denhaag", "boston"].contains(&name)
}

/// The log of a mesh, and the processor time that making it took, if it has been made now.
pub fn log(name: &str) -> Option<(CollapseLog, Option<f64>)> {
    let inputs = inputs(name)?;
    let file = kept(&if is_city(name) { format!("{name}-merged.log") } else { format!("{name}.log") });
    if let Ok(log) = read_log(&file) {
        return Some((log, None));
    }
    let mesh = mesh_io::read(&inputs, &mut |_, _| {}).expect("the data are readable");
    let start = processor_time();
    // Cities are many objects: without joining them, nothing is ever simpler than one triangle or two a building.
    let mut options = simplify::Options::default();
    options.merge_components = is_city(name);
    let (log, _) = simplify::build(mesh, &options, &mut |_, _| {}).expect("valid");
    let took = processor_time() - start;
    write_log(&file, &log).expect("target is writable");
    Some((log, Some(took)))
}

/// The meta-nodes of a log, in a file.
pub fn meta_nodes(name: &str, log: &CollapseLog, options: &BuildOptions) -> PathBuf {
    let file = kept(&format!("{name}.meta"));
    meta_node::write(&file, log, options).expect("target is writable");
    file
}

pub fn open(file: &std::path::Path) -> Arc<MetaNodeFile> {
    let source = FileSource::open(file).expect("just written");
    Arc::new(MetaNodeFile::open(Arc::new(source)).expect("just written"))
}

/// A recorded trajectory, brought to a mesh.
pub fn imported(trajectory: &str, log: &CollapseLog, mode: Mode, rate: f64) -> Option<Path> {
    let file = shared(&format!("paths/{trajectory}"))?;
    Some(import(&file, &log.mesh, &Options { mode, rate, ..Options::default() }).expect("a valid trajectory"))
}

pub fn views(path: &Path, pixels: f64) -> Vec<View> {
    let theta = theta_of_pixels(pixels, 1080);
    (0..path.frames.len()).map(|frame| path.view(frame, theta).expect("a view")).collect()
}

/// Mean, median and 99th percentile.
pub fn spread(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((values.len() as f64 * share).ceil() as usize).max(1) - 1];
    [values.iter().sum::<f64>() / values.len() as f64, at(0.5), at(0.99)]
}

/// A fact of a file that is a number.
pub fn fact(file: &MetaNodeFile, name: &str) -> u64 {
    let facts = file.facts();
    facts.iter().find(|(fact, _)| *fact == name).expect("a known fact").1.parse().expect("a number")
}
