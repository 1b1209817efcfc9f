//! Trajectories as loggers write them: each comes to the same path as a plain one, or to an error that names the reason;
//! and those that keep their place.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::path::{Path as FilePath, PathBuf};

use foldfront::Mesh;
use foldfront::construction::mesh_io;
use foldfront::container::{DegreeMap, Georeference};
use foldfront::experiment::path::import::{
    ImportError, Mode, Options, Warning, import, import_text, import_warning,
};
use foldfront::experiment::path::{Path, PathError, Pose, around};
use glam::{DQuat, DVec3};
use proptest::prelude::*;

fn case(name: &str) -> PathBuf {
    FilePath::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases/trajectories").join(name)
}

/// A hilly terrain of 24 x 24 cells.
fn terrain() -> Mesh {
    let height = |x: u32, y: u32| ((f64::from(x) / 3.0).sin() + (f64::from(y) / 4.0).cos()) as f32;
    let positions =
        (0..25 * 25).map(|v| [(v % 25) as f32, (v / 25) as f32, height(v % 25, v / 25)]).collect();
    let corners = (0..24 * 24).map(|cell| cell / 24 * 25 + cell % 24);
    let triangles = corners.flat_map(|v| [[v, v + 1, v + 26], [v, v + 26, v + 25]]).collect();
    Mesh { positions, triangles, ..Mesh::default() }
}

fn at(origin: [f64; 3]) -> Mesh {
    Mesh { georeference: Georeference { origin, ..Georeference::default() }, ..terrain() }
}

fn fitted(text: &str) -> Path {
    import_text(FilePath::new("t.csv"), text, &terrain(), &Options::default())
        .unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn error(text: &str) -> String {
    import_text(FilePath::new("t.csv"), text, &terrain(), &Options::default()).unwrap_err().to_string()
}

/// The path as it is kept, and the words about it.
fn kept(text: &str, mesh: &Mesh) -> (Result<Path, ImportError>, Vec<Warning>) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("t.csv");
    std::fs::write(&file, text).unwrap();
    let options = Options { fit: false, rate: 10.0, ..Options::default() };
    let mut warnings = Vec::new();
    (import_warning(&file, mesh, &options, &mut |warning| warnings.push(warning)), warnings)
}

/// The mesh is 34 across; paths are rounded to 1e-6.
#[track_caller]
fn assert_same(path: &Path, other: &Path, what: &str) {
    assert_eq!(path.frames.len(), other.frames.len(), "{what}");
    for (a, b) in path.frames.iter().zip(&other.frames) {
        assert_eq!(a.time, b.time, "{what}");
        assert!(a.position.distance(b.position) < 1e-5, "{what}: {a:?} {b:?}");
        assert!((a.orientation - b.orientation).length() < 1e-6, "{what}: {a:?} {b:?}");
    }
}

#[test]
fn every_case_is_the_plain_path() {
    let read = |name: &str, mode| {
        import(&case(name), &terrain(), &Options { mode, ..Options::default() })
            .unwrap_or_else(|error| panic!("{error}"))
    };
    for mode in [Mode::Fly, Mode::Walk, Mode::Orbit] {
        let plain = read("trajectory.txt", mode);
        assert_eq!(plain.frames.len(), 175);
        for name in ["w-first", "milliseconds", "nanoseconds", "commas", "latin1-comment", "bom"] {
            assert_same(&read(&format!("{name}.txt"), mode), &plain, name);
        }
        assert_same(&read("across-180.txt", mode), &read("across-20.txt", mode), "across 180");
    }
}

/// The plain trajectory, its rows written in another way.
fn rewritten(header: &str, row: impl Fn([&str; 8]) -> String) -> String {
    let plain = std::fs::read_to_string(case("trajectory.txt")).unwrap();
    let rows = plain.lines().filter(|line| !line.starts_with('#'));
    let rows = rows.map(|line| row(line.split_whitespace().collect::<Vec<_>>().try_into().unwrap()));
    [header.to_owned()].into_iter().chain(rows).collect::<Vec<_>>().join("\n")
}

#[test]
fn columns_are_found_by_their_names() {
    let plain = fitted(&rewritten("", |row| row.join(" ")));
    type Row = fn([&str; 8]) -> String;
    let w_first: Row = |[t, x, y, z, qx, qy, qz, qw]| format!("{t} {x} {y} {z} {qw} {qx} {qy} {qz}");
    let same: Row = |row| row.join(" ");
    let commas: Row = |row| row.join(",");
    let cases: &[(&str, Row)] = &[
        ("#timestamp tx ty tz qx qy qz qw", same),
        ("# q_x [] and the like\n# columns: t x y z qx qy qz qw", same),
        ("# t (x y z) (qw qx qy qz)", w_first),
        ("# time, pos_x, pos_y, pos_z, quat_w, quat_x, quat_y, quat_z", w_first),
        ("# TIME X Y Z QW QX QY QZ", w_first),
        ("timestamp tx ty tz qw qx qy qz", w_first),
        ("% t x y z q_w [] q_x [] q_y [] q_z []", w_first),
        ("timestamp,tx,ty,tz,qx,qy,qz,qw", commas),
        ("\u{feff}Timestamp [s];X [m];Y [m];Z [m];qX;qY;qZ;qW", |row| row.join(";")),
        ("// t\tx\ty\tz\tqx\tqy\tqz\tqw", |row| row.join("\t")),
        ("t,x,y,z,qx,qy,qz,qw,", |row| row.join(", ") + ",,"),
        ("\"t\",\"x\",\"y\",\"z\",\"qx\",\"qy\",\"qz\",\"qw\"", |row| format!("\"{}\"", row.join("\",\""))),
        ("seq;frame_id;qx;qy;qz;qw;x;y;z;stamp;remark", |[t, x, y, z, qx, qy, qz, qw]| {
            format!("7;world;{qx};{qy};{qz};{qw};{x};{y};{z};{t};")
        }),
        (
            "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],\
             v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],b_a_RS_S_x [m s^-2]",
            |[t, x, y, z, qx, qy, qz, qw]| {
                let t = 1_403_636_579_763_555_584_i64 + (t.parse::<f64>().unwrap() * 1e9).round() as i64;
                format!("{t},{x},{y},{z},{qw},{qx},{qy},{qz},9,9,9,9,nan")
            },
        ),
        (
            "%time,field.header.seq,field.header.frame_id,field.pose.position.x,field.pose.position.y,\
             field.pose.position.z,field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,\
             field.pose.orientation.w",
            |[t, x, y, z, qx, qy, qz, qw]| {
                let t = 1_403_636_579_000_000_i64 + (t.parse::<f64>().unwrap() * 1e6).round() as i64;
                format!("{t},1,map,{x},{y},{z},{qx},{qy},{qz},{qw}")
            },
        ),
        ("time_ms x_mm y_mm z_mm qx qy qz qw", |[t, x, y, z, qx, qy, qz, qw]| {
            let [t, x, y, z] = [t, x, y, z].map(|n| n.parse::<f64>().unwrap() * 1e3);
            format!("{t} {x} {y} {z} {qx} {qy} {qz} {qw}")
        }),
    ];
    for &(header, row) in cases {
        assert_same(&fitted(&rewritten(header, row)), &plain, header);
        assert_same(&fitted(&rewritten(header, row).replace('\n', "\r\n")), &plain, header);
        assert_same(&fitted(&rewritten(header, row).replace('\n', "\r")), &plain, header);
    }
}

#[test]
fn places_on_earth_are_found_by_their_names() {
    let rows = |line: fn(f64, f64, f64, f64) -> String| -> String {
        (0..20)
            .map(f64::from)
            .map(|i| line(i, 47.0 + i * 1e-3, 13.0 + i * i * 1e-4, 500.0 + i) + "\n")
            .collect()
    };
    let plain =
        fitted(&format!("# t lat lon alt\n{}", rows(|t, lat, lon, alt| format!("{t} {lat} {lon} {alt}"))));
    for text in [
        format!(
            "Time,Latitude,Longitude,Altitude\n{}",
            rows(|t, lat, lon, alt| format!("{t},{lat},{lon},{alt}"))
        ),
        format!("t;lng;lat;height [m]\n{}", rows(|t, lat, lon, alt| format!("{t};{lon};{lat};{alt}"))),
        format!(
            "# TIMESTAMP LAT LON ELE SPEED\n{}",
            rows(|t, lat, lon, alt| format!("{t} {lat} {lon} {alt} x"))
        ),
        format!(
            "stamp lat_deg lon_deg alt_gps_m\n{}",
            rows(|t, lat, lon, alt| format!("{t} {lat} {lon} {alt}"))
        ),
        format!(
            "time,lat(rad),lon(rad),alt\n{}",
            rows(|t, lat, lon, alt| { format!("{t},{},{},{alt}", lat.to_radians(), lon.to_radians()) })
        ),
        format!("# t lat lon alt\n{}", rows(|t, lat, lon, alt| format!("{t} {lat} {} {alt}", lon - 360.0))),
    ] {
        assert_same(&fitted(&text), &plain, text.lines().next().unwrap());
    }
    // A local origin in the comments does not make degrees of metres.
    let text = "# local origin lat 47.4 lon 13.1\n# t x y z\n0 500 900 1\n1 501 903 2\n";
    assert_same(&fitted(text), &fitted("0 500 900 1\n1 501 903 2\n"), "local");
}

#[test]
fn what_is_unclear_is_an_error_with_its_line() {
    for (text, said) in [
        ("# t x y z qw qx qy\n0 1 2 3 1 0 0\n", "t.csv:1: no column is named for the qz"),
        ("t,x,y,qw\n0,1,2,3\n", "t.csv:1: no column is named for the z"),
        ("x,y,z\n0,1,2\n", "t.csv:1: no column is named for the time"),
        ("t,lat,lon\n0,1,2\n", "t.csv:1: no column is named for the height"),
        ("t,time,x,y,z\n0,0,1,2,3\n", "t.csv:1: columns 1 and 2, \"t\" and \"time\", could both be the time"),
        (
            "t x y z tx ty tz w\n0 1 2 3 0 0 0 1\n",
            "t.csv:1: columns 2 and 5, \"x\" and \"tx\", could both be the x",
        ),
        ("# t x y z qx qy qz qw\n0 1 2 3 0 0 0 1 9\n", "t.csv:1: 8 columns are named, but frames have 9"),
        ("t,x,y,z\n0,1,2,3,4\n", "t.csv:2: 4 columns were expected, not 5"),
        (
            "# t x y z qx qy qz qw\n# t x y z qw qx qy qz\n0 1 2 3 0 0 0 1\n",
            "t.csv:2: the columns have other names than on line 1",
        ),
        ("# position, quaternion w x y z\n0 1 2 3 1 0 0 0\n", "t.csv:1: that w comes first is said"),
        (
            "# latitudes as lat, east as lon\n0 1 2 3\n",
            "t.csv:1: something of latitude and longitude is said",
        ),
        ("t[furlong] x y z\n0 1 2 3\n", "t.csv:1: \"t[furlong]\": no unit \"furlong\" of a time is known"),
        ("t (min),x,y,z\n0,1,2,3\n", "t.csv:1: \"t(min)\": no unit \"min\" of a time is known"),
        ("t,x,y,z\n0,1,2,3\n1,1,,3\n", "t.csv:3: column 3 is empty"),
        ("0,1,2,3\n1,1,,3\n", "t.csv:2: column 3 is empty"),
        ("0,1,2,3\n1,1,2,\n", "t.csv:2: column 4 is empty"),
        ("0;1;2;3\n1;1;2\n", "t.csv:2: 4 columns were expected, not 3"),
        ("0;1,5;2;3\n", "t.csv:1: \"1,5\" is not a finite number"),
        ("t,x,y,z\n0,1,2,3\nt,x,y,z\n", "t.csv:3: \"t\" is not a finite number"),
        ("# t lat lon alt\n0 47 13 5\n1 91 13 5\n", "t.csv:3: 91.0 is no latitude in degrees"),
        ("# t lon lat alt\n0 47 13 5\n1 473974180 13 5\n", "t.csv:3: 473974180.0 is no longitude in degrees"),
        (
            "0 1 2 3\n33000000 1 2 4\n66000000 1 2 5\n",
            "t.csv:1: the time 0 can not be in seconds, with 33000000 from",
        ),
        (
            "t[s] x y z\n1403636579763 1 2 3\n1403636579863 1 2 4\n",
            "t.csv:2: the time 1403636579763 can not be in the unit of the header",
        ),
        (
            "1403636579763 1 2 3\n1403636579763 1 2 4\n",
            "t.csv:2: the time 1403636579763 is not after 1403636579763",
        ),
    ] {
        let error = error(text);
        assert!(error.starts_with(said), "{text:?}: {error}");
    }
}

#[test]
fn lenses_are_in_range_or_refused() {
    let error = import(&case("wide-lens.frames"), &terrain(), &Options::default()).unwrap_err().to_string();
    assert!(error.contains("wide-lens.frames:1: 1e308 is no tan"), "{error}");
    for lens in ["0", "-0.5", "1e-9", "115", "1e17"] {
        let text = format!("F 0 1 0 0 0 1 0 0 0 1 0 2 3 0.5\nF 0 1 0 0 0 1 0 0 0 1 1 2 3 {lens}\n");
        assert!(self::error(&text).starts_with("t.csv:2: "), "{lens}");
    }
    let (path, warnings) =
        kept("F 0 1 0 0 0 1 0 0 0 1 0 2 3 114\nF 0 1 0 0 0 1 0 0 0 1 1 2 3 0.5\n", &terrain());
    let path = path.unwrap();
    assert!((path.fov_y.to_degrees() - 178.995).abs() < 1e-3);
    assert_eq!(Path::parse(FilePath::new("p"), &path.to_text()).unwrap().fov_y, path.fov_y);
    assert!(matches!(warnings.as_slice(), [Warning::Lens { line: 2, .. }]), "{warnings:?}");
}

#[test]
fn a_mesh_elsewhere_gets_the_same_path_there() {
    let origin = [500_000.05, 5_400_000.3, 300.0];
    for mode in [Mode::Fly, Mode::Walk, Mode::Orbit] {
        let options = Options { mode, ..Options::default() };
        let import = |mesh: &Mesh| import(&case("trajectory.txt"), mesh, &options).unwrap();
        let (here, there) = (import(&terrain()), import(&at(origin)));
        let read = Path::parse(FilePath::new("p"), &there.to_text()).unwrap();
        for (here, there) in here.frames.iter().zip(&read.frames) {
            let relative = there.position - DVec3::from(origin);
            assert!(
                relative.distance(here.position) < 1e-9 * terrain().extent(),
                "{mode:?}: {here:?} {there:?}"
            );
            assert_eq!((here.time, here.orientation), (there.time, there.orientation));
        }
    }
    assert!(around(&at(origin)).unwrap().frames[0].position.y > 5_399_900.0);
}

#[test]
fn kept_trajectories_keep_place_scale_and_time() {
    let mesh = at([500_000.0, 5_400_000.0, 300.0]);
    let text = "# y is down, t x y z qx qy qz qw\n# t x y z qx qy qz qw\n\
                100 500001.25 5400002.5 310 0 0 0 1\n101 500002.25 5400004.5 311 0 0 0 1\n\
                102 500003.25 5400006.5 312 0 0 0 1\n";
    let (path, warnings) = kept(text, &mesh);
    let path = path.unwrap();
    assert_eq!((path.frames.len(), warnings), (21, Vec::new()));
    for (i, frame) in path.frames.iter().enumerate() {
        let seconds = i as f64 / 10.0;
        assert!((frame.time - 100.0 - seconds).abs() < 1e-9);
        let place = DVec3::new(500_001.25, 5_400_002.5, 310.0) + seconds * DVec3::new(1.0, 2.0, 1.0);
        assert!(frame.position.distance(place) < 1e-8, "{frame:?}");
        // An optical camera looks along its z.
        assert!(path.camera(i).unwrap().direction().distance(DVec3::Z) < 1e-6);
    }
    // Where no orientation is recorded the camera looks along the way.
    let (path, warnings) = kept("0 500001 5400002 310\n9 500011 5400002 310\n18 500021 5400002 310\n", &mesh);
    assert!(path.unwrap().camera(90).unwrap().direction().distance(DVec3::X) < 1e-6 && warnings.is_empty());
    // A path of our own comes back as it is.
    let own = "# fov 50\n# aspect 2\n# units km\n7 1 2 3 0 0 0 1\n7.1 2 2 3 0 0 0 1\n7.2 3 2 3 0 0 0 1\n";
    let again = kept(own, &terrain()).0.unwrap();
    let own = Path::parse(FilePath::new("t.path"), own).unwrap();
    assert_same(&again, &own, "own");
    assert_eq!((again.fov_y, again.aspect, again.units), (own.fov_y, own.aspect, own.units));
}

#[test]
fn a_kept_trajectory_far_from_the_mesh_gets_a_word() {
    let mesh = at([500_000.0, 5_400_000.0, 300.0]);
    let (path, warnings) = kept("0 1 2 3\n1 2 3 4\n", &mesh);
    assert!(path.is_ok());
    let [warning @ Warning::Elsewhere { .. }] = warnings.as_slice() else { panic!("{warnings:?}") };
    let said = warning.to_string();
    assert!(said.contains("[1, 2, 3] to [2, 3, 4]") && said.contains("[500000, 5400000, 29"), "{said}");
    // A diagonal from the box is near enough.
    assert_eq!(kept("0 500050 5400010 301\n1 500051 5400010 301\n", &mesh).1, []);
}

/// Tiles of the smallest side there is, 0 to 1 degrees north, on both sides of 180 degrees.
fn mosaic() -> Mesh {
    let folder = tempfile::tempdir().unwrap();
    let files = ["N00E179.hgt", "N00W180.hgt"].map(|name| folder.path().join(name));
    for file in &files {
        std::fs::write(file, 7_i16.to_be_bytes().repeat(1201 * 1201)).unwrap();
    }
    mesh_io::read(&files, &mut |_, _| ()).unwrap()
}

#[test]
fn degrees_are_kept_where_the_tiles_have_them() {
    let mesh = mosaic();
    let DegreeMap { longitude, latitude, metres_per_degree: [x, y] } = mesh.georeference.degrees.unwrap();
    assert_eq!((longitude.abs(), latitude), (180.0, 0.5));
    let text = "# t lat lon alt\n0 0.25 179.75 900\n10 0.5 -180 1000\n20 0.75 -179.75 1100\n";
    let (path, warnings) = kept(text, &mesh);
    let path = path.unwrap();
    assert_eq!((path.frames.len(), path.units.as_str(), warnings), (201, "m", Vec::new()));
    for (frame, [east, north, up]) in
        [(0, [-0.25, -0.25, 900.0]), (100, [0.0, 0.0, 1000.0]), (200, [0.25, 0.25, 1100.0])]
    {
        let place = DVec3::new(east * x, north * y, up);
        assert!(path.frames[frame].position.distance(place) < 1e-6, "{:?}", path.frames[frame]);
    }
    // Local metres beside them are of another origin.
    let both = "# t lat lon alt east north\n0 0.25 179.75 900 5 5\n10 0.5 -180 1000 6 6\n";
    assert!(kept(both, &mesh).0.unwrap().frames[0].position.x < -20_000.0);

    let error = kept(text, &terrain()).0.unwrap_err();
    assert!(error.to_string().contains("this one has no map"), "{error}");
}

#[test]
fn times_and_attitudes_that_are_not_as_they_seem_get_a_word() {
    let warnings = kept("0 1 2 3\n33 1 2 4\n66 1 2 5\n", &terrain()).1;
    assert!(matches!(warnings.as_slice(), [Warning::Seconds { step: 33.0, .. }]), "{warnings:?}");
    let warnings = kept("t,x,y,z,roll,pitch,yaw\n0,1,2,3,0,0,0\n1,1,2,4,0,0,0\n", &terrain()).1;
    assert_eq!(warnings.len(), 1);
    assert!(
        warnings[0]
            .to_string()
            .ends_with("t.csv:1: roll, pitch, yaw are not read: the camera looks where it goes")
    );
}

#[test]
fn text_that_is_utf_16_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("t.txt");
    let units: Vec<u8> = "\u{feff}0 1 2 3\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    std::fs::write(&file, units).unwrap();
    let error = import(&file, &terrain(), &Options::default()).unwrap_err().to_string();
    assert!(error.contains("t.txt: ") && error.contains("UTF-16"), "{error}");
}

/// Ordinary numbers, and those at the ends of what there is.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -10.0..10.0, 1 => any::<f64>(), 1 => prop::sample::select(vec![0.0, -0.0, f64::NAN, f64::INFINITY, 1e308, 5e-324, std::f64::consts::PI, 3.141_592_653_589_792_7])]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn what_is_written_can_be_read(
        name in "[ -~\\n\\r\u{feff}\u{e4}]{0,12}",
        units in "[ -~\\t]{0,5}",
        fov_y in number(),
        aspect in number(),
        frames in prop::collection::vec((number(), prop::array::uniform3(number()), prop::array::uniform4(number())), 0..4),
        sorted in any::<bool>(),
    ) {
        let pose = |(time, position, rotation): (f64, [f64; 3], [f64; 4])| {
            Pose { time, position: position.into(), orientation: DQuat::from_array(rotation) }
        };
        let mut frames: Vec<Pose> = frames.into_iter().map(pose).collect();
        if sorted {
            frames.sort_by(|a, b| a.time.total_cmp(&b.time));
        }
        let path = Path { name, units, fov_y, aspect, frames };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("p.path");
        match path.write(&file) {
            Ok(()) => {
                let read = Path::read(&file).unwrap();
                prop_assert_eq!((read.fov_y, read.aspect), (path.fov_y, path.aspect));
                for (read, path) in read.frames.iter().zip(&path.frames) {
                    prop_assert_eq!((read.time, read.position), (path.time, path.position));
                }
            }
            // What is refused could not have been read.
            Err(refused) => {
                prop_assert!(!file.exists());
                let unreadable = Path::parse(&file, &path.to_text()).unwrap_err();
                prop_assert_eq!(std::mem::discriminant(&refused), std::mem::discriminant::<PathError>(&unreadable));
            }
        }
    }

    #[test]
    fn what_is_imported_can_be_written(
        text in "(#? ?(t|time_ns|x|y|z|qw|qx|qy|qz|lat|lon|alt)([ ,;](x|y|z|qw|qx|qy|qz|lat|lon|alt)){3,8}\\n)?((-?[0-9]{1,3}(e[0-9]{1,2})?[ ,;]){1,8}[0-9]\\n){0,6}",
        fit in any::<bool>(),
        rate in prop_oneof![Just(60.0), Just(1000.0), 1e-9..1.0],
    ) {
        let options = Options { fit, rate, ..Options::default() };
        if let Ok(path) = import_text(FilePath::new("t"), &text, &terrain(), &options) {
            prop_assert_eq!(Path::parse(FilePath::new("t.path"), &path.to_text()).unwrap(), path);
        }
    }

    #[test]
    fn any_rows_of_poses_can_be_kept_and_fitted(
        steps in prop::collection::vec((0.01..2.0, prop::array::uniform3(-1e6..1e6), prop::array::uniform4(0.1..1.0)), 2..6),
        start in prop_oneof![Just(0.0), Just(1.4e9), -1e5..1e5],
        fit in any::<bool>(),
    ) {
        let mut time = start;
        let mut text = String::new();
        for (step, [x, y, z], [a, b, c, d]) in steps {
            time += step;
            text += &format!("{time} {x} {y} {z} {a} {b} {c} {d}\n");
        }
        let options = Options { fit, ..Options::default() };
        let path = import_text(FilePath::new("t"), &text, &at([5e5, 5e6, 0.0]), &options).unwrap();
        prop_assert_eq!(Path::parse(FilePath::new("t.path"), &path.to_text()).unwrap(), path);
    }
}
