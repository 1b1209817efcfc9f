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

/// Frames a second at which a trajectory is read, one after the other, as long as there are not too many.
const RATES: [f64; 4] = [1e-9, 1e-4, 1.0, 60.0];
const MOST_FRAMES: f64 = 2500.0;

pub fn imported(bytes: &[u8], desk: &Desk) -> bool {
    let ground = desk.ground.get_or_init(ground);
    let file = desk.lay("input.txt", bytes);
    let choice = choice(bytes) >> 8;
    let mode = [Mode::Fly, Mode::Walk, Mode::Orbit][choice as usize % 3];
    let up = [None, Some(Up::Y), Some(Up::Z)][choice as usize / 3 % 3];
    let mut options = Options { mode, rate: 0.0, up, fit: !(choice / 9).is_multiple_of(4) };
    let (mut taken, mut seconds) = (false, 0.0);
    for rate in RATES {
        if seconds * rate > MOST_FRAMES {
            break;
        }
        options.rate = rate;
        let mut warnings = Vec::new();
        let read = import::import_warning(&file, ground, &options, &mut |warning| warnings.push(warning));
        for warning in warnings {
            let text = warning.to_string();
            assert!(!text.is_empty() && !text.contains(char::is_control), "a warning {text:?}");
            assert!(text.len() <= super::LONGEST, "a warning of {} bytes", text.len());
        }
        match read {
            Err(error) => {
                check_error(&error);
                break;
            }
            Ok(path) => {
                taken = true;
                seconds = path.frames.len() as f64 / rate;
                // The first may have as many as there can be.
                if path.frames.len() as f64 <= MOST_FRAMES {
                    check(&path);
                }
            }
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
