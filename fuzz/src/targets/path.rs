//! Walkthroughs: path files, which must say the same when written and read again, and trajectories that are imported.

use std::path::Path as FilePath;

use foldfront::Mesh;
use foldfront::experiment::path::Path;
use foldfront::experiment::path::import::{self, Mode, Options, Up};

use super::{Desk, check_error, choice};

pub fn recorded(bytes: &[u8], desk: &Desk) -> bool {
    let file = desk.lay("input.path", bytes);
    match Path::read(&file) {
        Err(error) => {
            check_error(&error);
            false
        }
        Ok(path) => {
            check(&path);
            true
        }
    }
}

/// A path that every frame of can be seen, and that is the same once written.
fn check(path: &Path) {
    for frame in 0..path.frames.len() {
        path.camera(frame).expect("a frame that has been read");
        // A tolerance can be too fine for a narrow lens.
        if let Err(error) = path.view(frame, 0.001) {
            check_error(&error);
        }
    }
    let _ = path.summary();
    let again = Path::parse(FilePath::new("input.path"), &path.to_text()).expect("what has been written");
    // White space in names is written as one blank.
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let [name, units] = [&path.name, &path.units].map(|text| one_line(text));
    assert!(again == Path { name, units, ..path.clone() }, "written and read again, a path is another");
}

/// Frames a second at which a trajectory is first read: then its length is known, and whether it can be read at others.
const SLOW: f64 = 0.001;
const MOST_FRAMES: usize = 20_000;

pub fn imported(bytes: &[u8], desk: &Desk) -> bool {
    let ground = desk.ground.get_or_init(ground);
    let file = desk.lay("input.txt", bytes);
    let choice = choice(bytes) >> 8;
    let mode = [Mode::Fly, Mode::Walk, Mode::Orbit][choice as usize % 3];
    let up = [None, Some(Up::Y), Some(Up::Z)][choice as usize / 3 % 3];
    let mut options = Options { mode, rate: SLOW, up, fit: choice / 9 % 4 != 0 };
    let mut taken = false;
    for rate in [SLOW, 1.0, 60.0] {
        options.rate = rate;
        let mut warnings = Vec::new();
        let read = import::import_warning(&file, ground, &options, &mut |warning| warnings.push(warning));
        for warning in warnings {
            let text = warning.to_string();
            assert!(!text.is_empty() && !text.chars().any(char::is_control), "a warning {text:?}");
            assert!(text.len() <= super::LONGEST, "a warning of {} bytes", text.len());
        }
        let frames = match read {
            Err(error) => {
                check_error(&error);
                break;
            }
            Ok(path) => {
                taken = true;
                if path.frames.len() <= MOST_FRAMES {
                    check(&path);
                }
                path.frames.len()
            }
        };
        // At the next rate there are up to a thousand times as many.
        if frames * 1000 > MOST_FRAMES {
            break;
        }
    }
    taken
}

/// A small hill whose place in the world is known.
fn ground() -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..25_u8 {
        let (x, y) = (f32::from(i % 5), f32::from(i / 5));
        mesh.positions.push([x, y, x * (4.0 - x) * y * (4.0 - y) / 16.0]);
    }
    for i in (0..20_u32).filter(|i| i % 5 != 4) {
        mesh.triangles.push([i, i + 1, i + 6]);
        mesh.triangles.push([i, i + 6, i + 5]);
    }
    mesh.georeference.degrees = Some(foldfront::container::DegreeMap {
        longitude: 8.0,
        latitude: 47.0,
        metres_per_degree: [75_000.0, 111_000.0],
    });
    mesh
}
