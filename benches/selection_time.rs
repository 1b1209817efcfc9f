//! Selection time along the walkthroughs of the built-in scenes: Zach & Karner (2003), Figures 9 to 11.
//!
//! `cargo bench --bench selection_time` draws one SVG a scene and setting into `target/selection_time`, and prints a
//! table. Two settings: the paper's (sphere size; omega 0.02 rad; rho 1 for city and laserscan, 50 for alps) and this
//! crate's (screen error of 1 pixel at 1080 lines, speeds at the path's 99th percentile). The paper does not say its
//! threshold; a projected radius of 2 % of half the image is used.

use std::path::PathBuf;

use foldfront::compare::{Options, Pace, Subject};
use foldfront::criterion::Criterion;
use foldfront::output;
use foldfront::path;
use foldfront::report::{Report, Section};
use foldfront::scene::{Scene, SceneKind};
use foldfront::simplify;
use foldfront::store::Backend;

const COMMAND: &str = "cargo bench --bench selection_time";

fn main() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("../selection_time");
    std::fs::create_dir_all(&folder).expect("target is writable");
    let quiet = &mut |_, _| {};
    for kind in SceneKind::ALL {
        let scene = Scene::new(kind);
        let mut build = simplify::Options::default();
        build.merge_components = scene.is_many_objects();
        let (log, _) = simplify::build(scene.mesh(quiet), &build, quiet).expect("scenes are meshes");
        let rho = if kind == SceneKind::Alps { 50.0 } else { 1.0 };
        let ours = Options::default();
        let papers = Options {
            criterion: Criterion::SphereSize,
            theta: 0.02,
            rho: Some(rho),
            omega: Some(0.02),
            ..ours.clone()
        };
        for (setting, options) in [("paper", papers), ("default", ours)] {
            let name = format!("{} ({setting})", kind.name());
            let mut subject = Subject::new(&name, &log).expect("the log was just built");
            let mut runs = Vec::new();
            for walk in path::recorded(kind).expect("recorded paths are valid") {
                let frames = 0..walk.frames.len();
                runs.extend(
                    subject.replay(&walk, frames, &options, quiet).expect("nothing can fail in memory"),
                );
            }
            let section = Section::new(&name, Backend::InMemory, runs);
            let file = folder.join(format!("{}-{setting}.svg", kind.name()));
            output::write(&file, section.curves(COMMAND).expect("curves can be drawn").as_bytes())
                .expect("target is writable");
            let report = Report { command: COMMAND.to_owned(), pace: Pace::Settled, sections: vec![section] };
            println!("{}\n{}", report.to_text(), file.display());
        }
    }
}
