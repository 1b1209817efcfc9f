//! Walkthroughs: files, the recorded paths, and trajectories brought to meshes.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::path::Path as FilePath;

use foldfront::experiment::path::{Path, PathError, Pose, generate, recorded};
use foldfront::experiment::scene::{Scene, SceneKind};
use glam::{DQuat, DVec3};
use proptest::prelude::*;

const GOOD: &str = "# name walk\n# units m\n# fov 60\n# aspect 1.5\n0 1 2 3 0 0 0 1\n0.5 1 2 4 0 0 0.6 0.8\n";

fn parse(text: &str) -> Result<Path, PathError> {
    Path::parse(FilePath::new("dir/test.path"), text)
}

#[test]
fn a_path_is_read() {
    let path = parse(GOOD).unwrap();
    assert_eq!((path.name.as_str(), path.units.as_str(), path.aspect), ("walk", "m", 1.5));
    assert_eq!(path.fov_y, 60f64.to_radians());
    assert_eq!(path.frames[1].position, DVec3::new(1.0, 2.0, 4.0));
    assert_eq!(parse(&format!("\u{feff}{GOOD}")).unwrap(), path);
    assert_eq!(path.camera(1).unwrap().orientation(), DQuat::from_xyzw(0.0, 0.0, 0.6, 0.8));
    assert_eq!(parse("# fov 1.25 rad\n#aspect 2\n0 0 0 0 0 0 0 2").unwrap().fov_y, 1.25);
    assert_eq!(parse("# fov 60\n#aspect 2\n0 0 0 0 0 0 0 2").unwrap().frames[0].orientation, DQuat::IDENTITY);
    assert_eq!(parse("# fov 60\n#aspect 2\n0 0 0 0 0 0 0 2").unwrap().name, "test");
}

#[test]
fn errors_name_file_line_and_value() {
    let cases = [
        ("", "dir/test.path: there is no header line `# fov ...`"),
        ("# fov 60\n0 1 2 3 0 0 0 1", "dir/test.path: there is no header line `# aspect ...`"),
        ("# fov 60\n# aspect 1\n", "dir/test.path: there are no frames"),
        ("# fov 180", "dir/test.path:1: fov \"180\" is not above 0 and below 180 degrees"),
        ("\n# fov nan", "dir/test.path:2: fov \"nan\" is not above 0 and below 180 degrees"),
        ("# aspect inf", "dir/test.path:1: aspect \"inf\" is not a finite number above 0"),
        ("0 1 2 3 0 0 1", "dir/test.path:1: a frame has 8 columns, t x y z qx qy qz qw, not 7"),
        ("0 1 2 3 0 0 1 0 0", "dir/test.path:1: a frame has 8 columns, t x y z qx qy qz qw, not 9"),
        ("0 1 2 x 0 0 0 1", "dir/test.path:1: \"x\" is not a finite number"),
        ("0 1 NaN 3 0 0 0 1", "dir/test.path:1: \"NaN\" is not a finite number"),
        ("0 1 2 1e999 0 0 0 1", "dir/test.path:1: \"1e999\" is not a finite number"),
        (
            "0 1 2 1e160 0 0 0 1",
            "dir/test.path:1: the eye [1.0, 2.0, 1e160] is not finite, or farther away than 1e150",
        ),
        ("0 1 2 3 0 0 0 0", "dir/test.path:1: the quaternion [0.0, 0.0, 0.0, 0.0] is no rotation"),
        ("0 1 2 3 0 0 0 1e200", "dir/test.path:1: the quaternion [0.0, 0.0, 0.0, 1e200] is no rotation"),
        ("1 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1", "dir/test.path:2: the time 1 is not after 1"),
    ];
    for (text, message) in cases {
        assert_eq!(parse(text).unwrap_err().to_string(), message, "{text:?}");
    }
    let missing = Path::read(FilePath::new("no/such.path")).unwrap_err();
    assert!(matches!(missing, PathError::Read { .. }) && missing.to_string().starts_with("no/such.path: "));
}

proptest! {
    #[test]
    fn what_was_written_is_read_to_the_bit(
        fov_y in 0.01..3.1,
        aspect in 0.1..10.0,
        rows in prop::collection::vec((0.001..1.0, prop::array::uniform3(-1e9..1e9), prop::array::uniform4(-1.0..1.0)), 1..20),
    ) {
        let mut time = 0.0;
        let frames = rows.into_iter().map(|(step, position, rotation)| {
            time += step;
            let orientation = DQuat::from_array(rotation).normalize();
            Pose { time, position: position.into(), orientation }
        });
        let path = Path { name: "a b".into(), units: "km".into(), fov_y, aspect, frames: frames.collect() };
        prop_assert_eq!(parse(&path.to_text()).unwrap(), path);
    }

    #[test]
    fn no_text_panics(text in "[-0-9 .e#fovnaspectr\\n]{0,200}") {
        let _ = parse(&text);
    }
}

#[test]
fn a_path_survives_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("walk.path");
    let path = parse(GOOD).unwrap();
    path.write(&file).unwrap();
    assert_eq!(Path::read(&file).unwrap(), path);
    assert!(matches!(path.write(&folder.path().join("no/walk.path")), Err(PathError::Write { .. })));
}

/// The fields of a path are anybody's: what is wrong with a camera is said where one is made, and nothing wrong is written.
#[test]
fn a_path_made_by_hand_is_checked_where_it_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let good = parse(GOOD).unwrap();
    assert!(good.view(0, 0.01).is_ok());
    let wrong: [fn(&mut Path); 6] = [
        |path| path.fov_y = f64::NAN,
        |path| path.aspect = 0.0,
        |path| path.frames[1].position.y = f64::INFINITY,
        |path| path.frames[1].position.y = 1e151,
        |path| path.frames[1].orientation = DQuat::from_xyzw(0.0, 0.0, 0.0, f64::NAN),
        |path| path.frames[1].orientation = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
    ];
    for spoil in wrong {
        let mut path = good.clone();
        spoil(&mut path);
        assert!(path.camera(1).is_err() && path.view(1, 0.01).is_err(), "{path:?}");
        assert!(path.write(&folder.path().join("walk.path")).is_err(), "{path:?}");
    }
}

#[test]
fn generated_paths_are_the_recorded_ones_byte_for_byte() {
    for kind in SceneKind::ALL {
        for (path, recorded) in generate(kind, &mut |_, _| ()).iter().zip(recorded(kind).unwrap()) {
            assert!(*path == recorded, "{} is not what is recorded", path.name);
            let file = FilePath::new(env!("CARGO_MANIFEST_DIR")).join(format!("paths/{}.path", path.name));
            assert!(std::fs::read_to_string(file).unwrap() == path.to_text(), "{}", path.name);
        }
    }
}

#[test]
fn recorded_paths_move_as_they_should() {
    // The speeds of Zach & Karner (2003), Table 1.
    for (kind, rho) in SceneKind::ALL.into_iter().zip([1.0, 50.0, 1.0]) {
        let [calm, wild] = recorded(kind).unwrap().map(|path| path.summary());
        assert!((600..=900).contains(&calm.frames) && (600..=900).contains(&wild.frames));
        assert!((calm.motion[1].rho / rho - 1.0).abs() < 0.01, "{kind:?}: {calm:?}");
        assert!(calm.motion[2].omega <= 0.02 && calm.teleports == 0, "{kind:?}: {calm:?}");
        assert!(wild.motion[1].rho > 3.0 * rho && wild.motion[1].omega > 0.06, "{kind:?}: {wild:?}");
        assert!(wild.stops >= 3 && wild.teleports == 1, "{kind:?}: {wild:?}");
        let pans =
            recorded(kind).unwrap()[1].steps().filter(|step| (0.9e-5..1.1e-5).contains(&step.omega)).count();
        assert!(pans >= 60, "{kind:?}: only {pans} steps of slow panning");
    }
}

#[test]
fn recorded_cameras_stay_above_the_surface() {
    for kind in SceneKind::ALL {
        let surface = Scene::new(kind).surface(&mut |_, _| ());
        let low = if kind == SceneKind::Alps { 100.0 } else { 1.5 };
        for path in recorded(kind).unwrap() {
            for (frame, Pose { position: p, .. }) in path.frames.iter().enumerate() {
                let ground = surface.highest(p.x, p.y, surface.spacing() / 2.0);
                assert!(p.z > ground + low, "{} frame {frame}: {} above {ground}", path.name, p.z);
            }
        }
    }
}

mod importing {
    use foldfront::Mesh;
    use foldfront::experiment::path::import::{ImportError, Mode, Options, Up, import_text};
    use glam::DVec3;

    use super::*;
    use crate::arriving::comes_to_in_every_mode;
    use crate::common::{meshes, seeded, trajectories};

    const POSES: &str = "0 0 0 1 0 0 0 1\n1 1 0 1 0 0 0 1\n2 1 1 2 0 0 0 1\n3 0 1 1 0 0 0 1\n";

    /// A hilly terrain of 40 x 30 cells.
    fn terrain() -> Mesh {
        let height = |x: u32, y: u32| f32::from(((x * 7 + y * 13) % 11) as u8) * 0.3;
        let mut mesh = Mesh::default();
        for y in 0..=30 {
            mesh.positions.extend((0..=40).map(|x| [x as f32, y as f32, height(x, y)]));
        }
        for y in 0..30 {
            for x in 0..40 {
                let a = y * 41 + x;
                mesh.triangles.extend([[a, a + 1, a + 42], [a, a + 42, a + 41]]);
            }
        }
        mesh
    }

    /// An octahedron of radius 2, y up, away from the origin.
    fn octahedron() -> Mesh {
        let corners = [
            [2.0, 0.0, 0.0],
            [-2.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [0.0, -2.0, 0.0],
            [0.0, 0.0, 2.0],
            [0.0, 0.0, -2.0],
        ];
        let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        Mesh {
            positions: corners.map(|[x, y, z]| [x + 10.0, y + 20.0, z - 5.0]).to_vec(),
            triangles: faces.to_vec(),
            ..Mesh::default()
        }
    }

    fn options(mode: Mode) -> Options {
        Options { mode, ..Options::default() }
    }

    fn fitted(text: &str, mesh: &Mesh, mode: Mode) -> Path {
        let path = import_text(FilePath::new("dir/test.txt"), text, mesh, &options(mode)).unwrap();
        // What was imported can be written and read.
        assert_eq!(parse(&path.to_text()).unwrap(), path);
        path
    }

    fn direction(comment: &str, quaternion: &str) -> (DVec3, DVec3) {
        let text = format!("# {comment}\n0 0 0 0 {quaternion}\n1 1 1 0 {quaternion}\n");
        let camera = fitted(&text, &terrain(), Mode::Fly).camera(0).unwrap();
        (camera.direction(), camera.up())
    }

    fn assert_near(a: DVec3, b: DVec3) {
        assert!(a.distance(b) < 1e-6, "{a} is not {b}");
    }

    #[test]
    fn body_frames_become_cameras() {
        // A body turned by 90 degrees about the vertical of its world: x axis to y.
        let turned = "0 0 0.7071067811865476 0.7071067811865476";
        for (comment, forward, up) in [
            ("rows = x forward, y left, z up; body-to-world", DVec3::Y, DVec3::Z),
            ("body-to-world", DVec3::Y, DVec3::Z),
            ("EuRoC MAV, body (IMU) pose", DVec3::Z, DVec3::Y),
            ("camera frame = optical (x right, y down, z forward)", DVec3::Z, DVec3::X),
            ("nothing of use", DVec3::Z, DVec3::X),
        ] {
            let (seen_forward, seen_up) = direction(comment, turned);
            assert_near(seen_forward, forward);
            assert_near(seen_up, up);
        }
        // The first camera of KITTI looks along z of a world whose y is down: that is north in ours.
        let (forward, up) = direction("KITTI: y is down", "0 0 0 1");
        assert_near(forward, DVec3::Y);
        assert_near(up, DVec3::Z);
        // A path of our own is taken as it is.
        let (forward, up) = direction("fov 50\n# aspect 2", "0 0 0 1");
        assert_near(forward, DVec3::NEG_Z);
        assert_near(up, DVec3::Y);
    }

    #[test]
    fn flights_and_walks_stay_above_the_terrain() {
        let mesh = terrain();
        for mode in [Mode::Fly, Mode::Walk] {
            let path = fitted(POSES, &mesh, mode);
            assert_eq!(path.frames.len(), 181);
            for Pose { position: p, .. } in &path.frames {
                assert!((0.0..=40.0).contains(&p.x) && (0.0..=30.0).contains(&p.y));
                let near = |q: &&[f32; 3]| {
                    (f64::from(q[0]) - p.x).abs() <= 1.0 && (f64::from(q[1]) - p.y).abs() <= 1.0
                };
                let lowest = mesh.positions.iter().filter(near).map(|q| q[2]).fold(f32::MAX, f32::min);
                assert!(p.z > f64::from(lowest));
                if mode == Mode::Walk {
                    assert!(p.z < 3.0 + 0.1, "a walker has feet on the ground");
                }
            }
        }
    }

    #[test]
    fn orbits_keep_the_object_in_view_and_its_up() {
        let middle = DVec3::new(10.0, 20.0, -5.0);
        let path = fitted(POSES, &octahedron(), Mode::Orbit);
        for frame in 0..path.frames.len() {
            let camera = path.camera(frame).unwrap();
            let to_middle = middle - camera.position();
            assert!(to_middle.normalize().dot(camera.direction()) > 9f64.to_radians().cos());
            assert!((1.39..2.41).contains(&(to_middle.length() / 12f64.sqrt())));
            assert!(camera.position().y > middle.y && camera.up().y > 0.5, "y is up in a scanned object");
        }
    }

    #[test]
    fn flights_stay_out_of_an_object() {
        for Pose { position, .. } in fitted(POSES, &octahedron(), Mode::Fly).frames {
            assert!(position.distance(DVec3::new(10.0, 20.0, -5.0)) > 12f64.sqrt());
        }
        let forced = Options { up: Some(Up::Z), ..options(Mode::Fly) };
        let path = import_text(FilePath::new("t"), POSES, &octahedron(), &forced).unwrap();
        assert!(path.frames.iter().all(|frame| frame.position.z > -5.0));
    }

    #[test]
    fn positions_alone_look_where_they_go() {
        let east: String = (0..60).map(|t| format!("{t} {} 0 100\n", 10 * t)).collect();
        let level = |path: &Path| path.camera(900).unwrap().direction().with_z(0.0).normalize();
        let path = fitted(&east, &terrain(), Mode::Walk);
        assert_near(level(&path), DVec3::X);
        let north: String =
            (0..60).map(|t| format!("{t} {} 11.0 500\n", 47.0 + 0.001 * f64::from(t))).collect();
        let path = fitted(&format!("# t lat lon alt\n{north}"), &terrain(), Mode::Walk);
        assert_near(level(&path), DVec3::Y);
    }

    #[test]
    fn errors_are_clean() {
        let error = |text: &str| {
            import_text(FilePath::new("t.txt"), text, &terrain(), &Options::default())
                .unwrap_err()
                .to_string()
        };
        assert_eq!(error(""), "t.txt: 0 frames are no trajectory");
        assert_eq!(error("0 0 0 0 0 0 0 1\n"), "t.txt: 1 frames are no trajectory");
        assert_eq!(error("1 2 3\n"), "t.txt:1: no known format of trajectory has 3 columns");
        assert_eq!(error("1 2 3 4\n\n2 3 4\n"), "t.txt:3: 4 columns were expected, not 3");
        assert_eq!(error("1 2 3 4\n1 2 3 4\n"), "t.txt:2: the time 1 is not after 1");
        assert_eq!(error("1 2 3 z\n"), "t.txt:1: \"z\" is not a finite number");
        assert_eq!(
            error("0 0 0 0\n1e9 1 1 1\n"),
            "t.txt: 1000000000.0 s at 60 frames a second are more than 302000 frames"
        );
        assert_eq!(error("0 -1.7e308 0 0\n1 1.7e308 0 0\n"), "t.txt: coordinates are out of range");
        assert!(error("F 0 0 0 0 0 0 0 0 0 0 0 0 0 1\nF").contains("is no rotation"));
        let rate = Options { rate: f64::NAN, ..Options::default() };
        let import = |mesh: &Mesh, options: &Options| {
            import_text(FilePath::new("t"), POSES, mesh, options).unwrap_err()
        };
        assert!(matches!(import(&terrain(), &rate), ImportError::Rate { .. }));
        assert!(matches!(import(&Mesh::default(), &Options::default()), ImportError::Mesh { .. }));
    }

    proptest! {
        #[test]
        fn no_trajectory_panics(text in "([-0-9.e]{1,5}[ \\n]|F |# (lat lon|kitti|fov 1)\\n){0,60}") {
            for mode in [Mode::Fly, Mode::Walk, Mode::Orbit] {
                let _ = import_text(FilePath::new("t"), &text, &octahedron(), &options(mode));
            }
        }
    }

    /// Trajectories of all kinds, brought to terrain, a town, scanned and closed objects in every mode.
    #[test]
    fn trajectories_come_to_meshes() {
        let made_up = [
            ("drone", trajectories::drone(20)),
            ("car", trajectories::car(40)),
            ("hand-held", trajectories::hand_held(20)),
            ("flight", trajectories::flight(40)),
        ];
        for mesh in [
            meshes::scan(10, &mut seeded(1)),
            meshes::with_handles(5, 8),
            meshes::ground(100, 5, &mut seeded(2)),
            meshes::part_of(SceneKind::City, 0.3),
        ] {
            for (name, text) in &made_up {
                comes_to_in_every_mode(&mesh, 900, |options| {
                    import_text(FilePath::new(name), text, &mesh, options).unwrap()
                });
            }
        }
    }
}
