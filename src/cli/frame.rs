//! `export`, `render` and `deviation`: one frame of anything.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use collapse_log::Mesh;

use super::arguments::{Deviation, Export, LINES, Refinement, Render};
use super::destination::{Content, check_file};
use super::input::{Input, Replayable};
use super::progress::stage;
use super::say::print;
use crate::experiment::compare::Options;
use crate::experiment::deviation::Reference;
use crate::experiment::path::Path;
use crate::experiment::render::{self, Style};
use crate::experiment::store::BuildOptions;
use selection::view::Camera;

fn options(refinement: &Refinement) -> Options {
    Options {
        criterion: refinement.criterion.into(),
        normal_cone: refinement.normal_cone,
        theta: refinement.theta(),
        ..Options::default()
    }
}

fn check_frame(path: &Path, frame: usize) -> Result<()> {
    if frame >= path.frames.len() {
        bail!("path {} has frames 0 to {}, not {frame}", path.name, path.frames.len() - 1);
    }
    Ok(())
}

/// The one thing that the arguments name.
fn subject(arguments: &[PathBuf]) -> Result<Replayable> {
    let input = Input::one(arguments)?;
    let mut all = input.replayable(&input.name(), &[], &BuildOptions::default(), false)?;
    all.pop().context("one backend is one subject")
}

/// Whether the picture or mesh of a frame may be written there.
fn check_output(output: &std::path::Path, content: Content, frame: &super::arguments::FrameOf) -> Result<()> {
    let mut inputs = Input::one(&frame.file)?.files();
    inputs.push(frame.path.clone());
    check_file(output, content, &inputs)
}

/// The refined mesh of a frame, and its camera.
fn frame_mesh(frame: &super::arguments::FrameOf) -> Result<(Mesh, Camera)> {
    let path = Path::read(&frame.path)?;
    check_frame(&path, frame.frame)?;
    frame.refinement.check(path.fov_y)?;
    let subject = subject(&frame.file)?.subject;
    let mesh = subject.frame(&path, frame.frame, &options(&frame.refinement))?;
    Ok((mesh, path.camera(frame.frame)?))
}

pub(super) fn export(command: &Export) -> Result<()> {
    check_output(&command.output, Content::Mesh, &command.frame)?;
    let (mesh, _) = frame_mesh(&command.frame)?;
    construction::mesh_io::write_ply(&command.output, &mesh, None)?;
    print(&format!("{}: {} triangles\n", command.output.display(), mesh.triangles.len()))
}

pub(super) fn render(command: &Render) -> Result<()> {
    check_output(&command.output, Content::Picture, &command.frame)?;
    let (mesh, camera) = frame_mesh(&command.frame)?;
    let style = Style { width: command.width, wires: command.wire, ..Style::default() };
    let image = if command.outside {
        render::render_outside(&mesh, &camera, &style)
    } else {
        render::render(&mesh, &camera, &style)
    };
    image.write_png(&command.output)?;
    print(&format!("{}: {} triangles\n", command.output.display(), mesh.triangles.len()))
}

pub(super) fn deviation(command: &Deviation) -> Result<()> {
    let path = Path::read(&command.path)?;
    for &frame in &command.frames {
        check_frame(&path, frame)?;
    }
    command.refinement.check(path.fov_y)?;
    let Replayable { subject, log, .. } = subject(&command.file)?;
    let own;
    let original = match (command.against.as_slice(), &log) {
        ([], Some(log)) => &log.mesh,
        ([], None) => {
            own = subject.finest()?;
            &own
        }
        (arguments, _) => {
            own = Input::one(arguments)?.mesh()?;
            &own
        }
    };
    let reference = Reference::new(original);
    let options = options(&command.refinement);
    let mut text = String::new();
    let mut values = Vec::new();
    for &frame in &command.frames {
        let measured = stage(&format!("measuring frame {frame}"), |_| {
            let mesh = subject.frame(&path, frame, &options)?;
            anyhow::Ok(reference.deviation(&mesh, &path.camera(frame)?, LINES))
        })?;
        let mut value = measured.to_json();
        value["frame"] = frame.into();
        values.push(value);
        let _ = writeln!(text, "frame {frame}\n{measured}");
    }
    if command.json { print(&format!("{:#}\n", serde_json::Value::from(values))) } else { print(&text) }
}
