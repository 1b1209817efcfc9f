//! `path generate`, `path info` and `path import`.

use std::fmt::Write;

use anyhow::{Context, Result};

use super::arguments::{PathCommand, PathSubcommand};
use super::destination::{Content, check_file};
use super::input::Input;
use super::progress::stage;
use super::say::{print, warn};
use crate::experiment::path::{self, Path, import};
use crate::experiment::scene::{Scene, SceneKind};

pub(super) fn path(command: &PathCommand) -> Result<()> {
    match &command.command {
        PathSubcommand::Generate { scenes, output } => generate(scenes, output),
        PathSubcommand::Info { files } => {
            let mut text = String::new();
            for file in files {
                describe(&mut text, &Path::read(file)?);
            }
            print(&text)
        }
        PathSubcommand::Import { trajectory, fit, output, mode, rate, no_fit } => {
            let fit = Input::one(fit)?;
            let mut inputs = fit.files();
            inputs.push(trajectory.clone());
            check_file(output, Content::Path, &inputs)?;
            let mesh = fit.mesh()?;
            let options = import::Options {
                mode: (*mode).into(),
                rate: *rate,
                fit: !no_fit,
                ..import::Options::default()
            };
            let mut warnings = Vec::new();
            let path = import::import_warning(trajectory, &mesh, &options, &mut |w| warnings.push(w))?;
            path.write(output)?;
            for warning in warnings {
                warn(&warning.to_string());
            }
            let mut text = String::new();
            describe(&mut text, &path);
            print(&text)
        }
    }
}

fn generate(scenes: &[String], output: &std::path::Path) -> Result<()> {
    let kinds: Vec<SceneKind> = if scenes.is_empty() {
        SceneKind::ALL.to_vec()
    } else {
        scenes.iter().map(|s| Ok(Scene::parse(s)?.kind())).collect::<Result<_>>()?
    };
    std::fs::create_dir_all(output).with_context(|| output.display().to_string())?;
    for kind in kinds {
        for path in stage(&format!("{}: walking", kind.name()), |p| anyhow::Ok(path::generate(kind, p)))? {
            path.write(&output.join(format!("{}.path", path.name)))?;
        }
    }
    Ok(())
}

fn describe(text: &mut String, path: &Path) {
    let summary = path.summary();
    let [median, p99, largest] = summary.motion;
    let units = &path.units;
    let _ = writeln!(
        text,
        "{}: {} frames, {:.1} s, {:.1} {units}; {} stops, {} teleports",
        path.name, summary.frames, summary.seconds, summary.length, summary.stops, summary.teleports,
    );
    for (name, motion) in [("median", median), ("99 %", p99), ("largest", largest)] {
        let _ =
            writeln!(text, "  {name:8} {:12.6} {units} and {:10.6} rad a frame", motion.rho, motion.omega);
    }
}
