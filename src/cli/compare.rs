//! `compare`: the main job.

use std::ops::Range;
use std::path::Path as FilePath;

use anyhow::{Context, Result, bail};
use collapse_log::Mesh;

use super::arguments::Compare;
use super::destination::check_folder;
use super::input::{Input, Replayable};
use super::interrupt;
use super::progress::stage;
use super::say::{Misunderstood, print};
use crate::experiment::compare::{Options, Paging, Run, Subject, csv, replay_scene};
use crate::experiment::path::{self, Path};
use crate::experiment::render::{self, Image, Style};
use crate::experiment::report::{Picture, Report, Section};
use crate::experiment::scene::{Scene, SceneKind};
use crate::experiment::store::{Backend, BuildOptions};
use crate::experiment::stored_scene::StoredScene;
use construction::simplify;
use container::output;
use selection::budget::Budget;
use selection::refine::Strategy;

pub(super) fn compare(command: &Compare) -> Result<()> {
    let inputs = if command.input.is_empty() {
        SceneKind::ALL.map(|kind| Input::Scene(Scene::new(kind))).to_vec()
    } else {
        Input::all(&command.input)?
    };
    check_printed(command, &inputs)?;
    let paths: Vec<Path> = command.path.iter().map(|file| Path::read(file)).collect::<Result<_, _>>()?;
    // What is recorded for a scene has the lens of a flight around.
    let lenses: Vec<f64> = paths.iter().map(|path| path.fov_y).collect();
    for &fov_y in if lenses.is_empty() { &[path::FOV_Y][..] } else { &lenses } {
        command.refinement.check(fov_y)?;
    }
    let options = options(command);
    // Before the work, not after it.
    let mut files: Vec<_> = inputs.iter().flat_map(Input::files).collect();
    files.extend_from_slice(&command.path);
    let is_written = |name: &str| {
        ["frames.csv", "summary.csv", "report.html"].contains(&name)
            || name.starts_with("selection-") && name.ends_with(".svg")
    };
    check_folder(&command.out, is_written, &files)?;

    // A name that is no text is shown with replacements.
    let arguments: Vec<String> =
        std::env::args_os().skip(1).map(|argument| argument.to_string_lossy().into_owned()).collect();
    let made_by = format!("foldfront {}", arguments.join(" "));
    let mut report = Report { command: made_by, pace: options.pace, sections: Vec::new() };
    for (input, name) in inputs.iter().zip(unique_names(&inputs)) {
        // What has been finished is to be written: then an interrupt waits for what goes on.
        if interrupt::is_raised() {
            break;
        }
        if report.sections.is_empty() {
            interrupt::end_at_once();
        }
        if let Input::Objects(file) = input {
            report.sections.push(objects(command, file, &name, &paths, &options)?);
            continue;
        }
        let storage = BuildOptions::from(&command.storage);
        let subjects = input.replayable(&name, &command.backend, &storage, command.merge_components)?;
        let walks = walks(input, &subjects, &paths, options.paging)?;
        interrupt::end_well();
        let is_alone = subjects.len() == 1;
        for subject in subjects {
            let name = match subject.subject.backend() {
                _ if is_alone => name.clone(),
                backend => format!("{name}-{}", backend.name()),
            };
            report.sections.push(section(command, name, subject, &walks, &options)?);
        }
    }
    report.sections.retain(|section| !section.runs.is_empty());
    if report.sections.is_empty() {
        bail!("interrupted before a replay was finished");
    }
    let file = command.out.join("report.html");
    let runs: Vec<&Run> = report.sections.iter().flat_map(|section| &section.runs).collect();
    let at = |name: &str| command.out.join(name);
    let mut files = vec![
        (at("frames.csv"), csv::frames(&runs)),
        (at("summary.csv"), csv::summary(&runs)),
        (file.clone(), report.to_html()?.into_bytes()),
    ];
    for section in &report.sections {
        let curves = section.curves(&report.command)?;
        files.push((at(&format!("selection-{}.svg", section.name)), curves.into_bytes()));
    }
    // Only now, so that a failure leaves what is there as it is.
    let is_missing = |folder: &&FilePath| !folder.as_os_str().is_empty() && !folder.exists();
    let made: Vec<&FilePath> = command.out.ancestors().take_while(is_missing).collect();
    std::fs::create_dir_all(&command.out).with_context(|| command.out.display().to_string())?;
    let written = output::write_all(files.iter().map(|(file, bytes)| (&**file, &**bytes)));
    if let Err((file, error)) = written {
        // They are empty.
        made.iter().for_each(|folder| drop(std::fs::remove_dir(folder)));
        return Err(anyhow::Error::new(error).context(file.display().to_string()));
    }
    print(&format!("{}\nThe report is in {}\n", report.to_text(), file.display()))?;
    if interrupt::is_raised() {
        bail!("interrupted: {} has what had been replayed to the end", command.out.display());
    }
    match faults(runs) {
        None => Ok(()),
        Some(faults) => bail!("{faults}"),
    }
}

/// How many faults there were in some runs, if any, and the first.
fn faults<'a>(runs: impl IntoIterator<Item = &'a Run>) -> Option<String> {
    let (mut count, mut first) = (0, None);
    for run in runs {
        count += run.rows.iter().map(|row| row.report.pages.faults).sum::<u64>();
        first = first.or(run.fault.as_ref());
    }
    let more = count.saturating_sub(1);
    first.map(|first| format!("{first}; {more} more such faults, and what they keep back was not displayed"))
}

/// Before any work: whether all backends have the ways to load that are asked for.
fn check_printed(command: &Compare, inputs: &[Input]) -> Result<()> {
    let Some(prefetch) = command.prefetch.iter().find(|p| Backend::ALL.iter().any(|&b| !p.is_for(b))) else {
        return Ok(());
    };
    for input in inputs {
        let backends = if command.backend.is_empty() { input.backends()? } else { command.backend.clone() };
        if let Some(backend) = backends.into_iter().find(|&backend| !prefetch.is_for(backend)) {
            let (name, how) = (input.name(), prefetch.name());
            let (its, backend) = (Backend::MetaNode.name(), backend.name());
            let wrong = format!(
                "--prefetch {how} is for {its}, not for {backend}, which {name} is to be replayed in"
            );
            return Err(Misunderstood(wrong).into());
        }
    }
    Ok(())
}

/// The walkthroughs to replay: those that were asked for, those that were recorded for a scene, or one around the mesh.
fn walks(input: &Input, subjects: &[Replayable], paths: &[Path], paging: Paging) -> Result<Vec<Path>> {
    Ok(match (paths, input, subjects) {
        ([], Input::Scene(scene), _) => path::recorded(scene.kind())?.to_vec(),
        // What is stored may not fit into memory.
        ([], _, [Replayable { log: None, subject, .. }, ..]) => {
            vec![path::around(&subject.outline(paging)?)?]
        }
        ([], _, [Replayable { log: Some(log), .. }, ..]) => vec![path::around(&log.mesh)?],
        (paths, ..) => paths.to_vec(),
    })
}

/// Everything about one input in one backend.
fn section(
    command: &Compare,
    name: String,
    replayable: Replayable,
    walks: &[Path],
    options: &Options,
) -> Result<Section> {
    let Replayable { mut subject, built, facts: stored, log, file_bytes, writing, folder: _folder } =
        replayable;
    let mut runs = Vec::new();
    let mut pictures = Vec::new();
    for walk in walks {
        let frames = frames_of(command, walk)?;
        let label = format!("{name}: {}, {} frames", walk.name, frames.len());
        let replayed = stage(&label, |p| subject.replay(walk, frames, options, p))?;
        if replayed.is_empty() {
            break;
        }
        // One backend shows what the others do.
        if subject.backend() == command.backend.first().copied().unwrap_or(subject.backend()) {
            let frame = most_complex(&replayed[0]);
            match stage(&format!("{name}: pictures"), |_| draw(&subject, walk, frame, options)) {
                Ok(drawn) => pictures.extend(drawn),
                // The frames are there, and say so; a picture of what is damaged could not.
                Err(_) if faults(&replayed).is_some() => {}
                Err(error) => return Err(error),
            }
        }
        runs.extend(replayed);
    }
    let mut facts = facts(log.as_ref().map(|log| &log.mesh), built.as_ref());
    facts.extend(stored);
    facts.extend(faults(&runs).map(|faults| ("faults", faults)));
    Ok(Section {
        name,
        scene: subject.name().to_owned(),
        backend: subject.backend().name(),
        triangles: subject.triangles(),
        file_bytes,
        simplification: built.map(|b| b.preparation + b.simplification + b.conclusion),
        writing,
        facts,
        runs,
        pictures,
    })
}

/// Everything about a scene of several objects.
fn objects(
    command: &Compare,
    file: &FilePath,
    name: &str,
    walks: &[Path],
    options: &Options,
) -> Result<Section> {
    if command.wall_clock {
        bail!("{}: scenes of several objects are not replayed by the wall clock", file.display());
    }
    if walks.is_empty() {
        bail!("{}: a scene of several objects needs a --path", file.display());
    }
    let mut options_of_meshes = simplify::Options::default();
    options_of_meshes.merge_components = command.merge_components;
    let scene = stage(&format!("{name}: opening"), |_| StoredScene::open_with(file, &options_of_meshes))?;
    interrupt::end_well();
    for object in scene.objects() {
        let own = scene.files()[object.file].backend();
        if let Some(other) = command.backend.iter().find(|&&backend| backend != own) {
            bail!(
                "{}: {}: is for {}, not for {}",
                object.at,
                object.at.file.display(),
                own.name(),
                other.name()
            );
        }
    }
    let mut section = Section::new(name, scene.backend(), Vec::new());
    for walk in walks {
        let frames = frames_of(command, walk)?;
        let label = format!("{name}: {}, {} frames", walk.name, frames.len());
        section.runs.extend(stage(&label, |p| replay_scene(name, &scene, walk, frames, options, p))?);
    }
    section.facts.extend(faults(&section.runs).map(|faults| ("faults", faults)));
    section.facts.extend([
        ("objects", scene.objects().len().to_string()),
        ("files", scene.files().len().to_string()),
        ("least memory", format!("{} bytes", scene.least_memory())),
    ]);
    Ok(section)
}

/// The frames of a path that were asked for.
fn frames_of(command: &Compare, walk: &Path) -> Result<Range<usize>> {
    let frames = command.frames.clone().unwrap_or(0..usize::MAX);
    let frames = frames.start..frames.end.min(walk.frames.len());
    if frames.is_empty() {
        bail!("path {} has frames 0 to {} only", walk.name, walk.frames.len() - 1);
    }
    Ok(frames)
}

/// The frame with the most active nodes: the one that shows most.
fn most_complex(run: &Run) -> usize {
    run.rows.iter().max_by_key(|row| row.report.active_nodes).map_or(0, |row| row.frame)
}

/// A frame from the camera and from outside.
fn draw(subject: &Subject, walk: &Path, frame: usize, options: &Options) -> Result<[Picture; 2]> {
    let mesh = subject.frame(walk, frame, options)?;
    let camera = walk.camera(frame)?;
    let style = Style { width: 960, ..Style::default() };
    let picture = |what: &str, image: Image| -> Result<Picture> {
        let caption =
            format!("{}, frame {frame}, {what}: {} triangles displayed.", walk.name, mesh.triangles.len());
        Ok(Picture { caption, png: image.png_bytes()? })
    };
    Ok([
        picture("as the camera sees it", render::render(&mesh, &camera, &style))?,
        picture("from outside, with the frustum", render::render_outside(&mesh, &camera, &style))?,
    ])
}

fn facts(mesh: Option<&Mesh>, built: Option<&simplify::Report>) -> Vec<(&'static str, String)> {
    let mut facts = Vec::new();
    if let Some(mesh) = mesh {
        facts.push(("triangles", mesh.triangles.len().to_string()));
        facts.push(("vertices", mesh.positions.len().to_string()));
        facts.push(("extent", format!("{:.4}", mesh.extent())));
    }
    if let Some(built) = built {
        facts.push(("collapses", built.collapses.to_string()));
        let time = (built.preparation + built.simplification + built.conclusion).as_secs_f64();
        let per_triangle = time * 1e6 / built.triangles.max(1) as f64;
        facts.push(("roots", built.roots.to_string()));
        facts.push(("depth", built.tree_depth.to_string()));
        facts.push(("construction", format!("{time:.2} s, {per_triangle:.2} µs a triangle")));
    }
    facts
}

/// A name for each input that no other has, fit for a file name.
fn unique_names(inputs: &[Input]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for input in inputs {
        let plain = |c: char| if c.is_alphanumeric() || "-_.+@".contains(c) { c } else { '-' };
        let name: String = input.name().chars().map(plain).collect();
        let mut unique = name.clone();
        let mut number = 2;
        while names.contains(&unique) {
            unique = format!("{name}-{number}");
            number += 1;
        }
        names.push(unique);
    }
    names
}

fn options(command: &Compare) -> Options {
    let budget = match (command.triangles, command.frame_time) {
        (Some(most), _) => Budget::Displayed(most),
        (None, Some(most)) => Budget::FrameTime(most),
        (None, None) => Budget::None,
    };
    let strategies =
        if command.strategy.is_empty() { Strategy::COMPARED.to_vec() } else { command.strategy.clone() };
    Options {
        strategies,
        criterion: command.refinement.criterion.into(),
        normal_cone: command.refinement.normal_cone,
        theta: command.refinement.theta(),
        budget,
        work_cap: command.work_cap.unwrap_or_default(),
        rho: command.rho,
        omega: command.omega,
        check: command.check,
        paging: Paging {
            page_memory: command.page_memory.unwrap_or(u64::MAX),
            soft_quota: command.soft_quota.unwrap_or(u64::MAX),
            cache: command.cache,
            dependencies: command.dependencies.into(),
        },
        prefetch: command.prefetch.clone(),
        pace: command.pace(),
        stop: Some(interrupt::flag()),
    }
}
