//! What can be done, command by command.

use std::process::Stdio;

use foldfront::construction::mesh_io;
use foldfront::experiment::path::Path;
use serde_json::Value;

use crate::workplace::{Workplace, grid, repository};

/// The number after a label at the start of a line.
fn figure(text: &str, label: &str) -> f64 {
    let line = text.lines().find(|line| line.starts_with(label));
    let line = line.unwrap_or_else(|| panic!("no {label:?} in {text}"));
    line[label.len()..].split_whitespace().next().unwrap().parse().unwrap()
}

#[test]
fn a_hierarchy_is_built_described_and_verified() {
    let place = Workplace::new();
    let built = place.succeed("build grid.ply -o grid.log");
    assert_eq!(place.names("."), ["descent.path", "grid.log", "grid.ply"]);
    let log = collapse_log::read_log(&place.file("grid.log")).unwrap();
    assert_eq!(log.mesh, grid());
    let collapses = log.collapses.len();
    assert!(collapses > 100, "only {collapses} collapses of 144 vertices");
    assert_eq!(figure(&built, "triangles"), 242.0);
    assert_eq!(figure(&built, "collapses"), collapses as f64);

    let info = place.succeed("info grid.log");
    let bytes = place.read("grid.log").len();
    // Header, table of three sections, and these.
    assert_eq!(bytes, 48 + 8 + 3 * 32 + 12 * 144 + 12 * 242 + 28 * collapses);
    for (label, value) in [("bytes", bytes), ("vertices", 144), ("triangles", 242), ("collapses", collapses)]
    {
        assert_eq!(figure(&info, label), value as f64, "{label}");
    }

    let json: Value = serde_json::from_str(&place.succeed("info grid.log --json")).unwrap();
    let roots = 144 - collapses as u64 - lone_vertices(&log);
    for (key, value) in [
        ("bytes", bytes as u64),
        ("version", 2),
        ("vertices", 144),
        ("triangles", 242),
        ("collapses", collapses as u64),
        ("roots", roots),
        ("depth", u64::from(log.forest().unwrap().depth())),
    ] {
        assert_eq!(json[key].as_u64(), Some(value), "{key}");
    }
    assert_eq!(json["bounding_box"][0], Value::from(vec![-1.0, -1.0, 0.0]));
    assert!(json["base_triangles"].as_u64().unwrap() < 20);
    assert!(json["largest_error"].as_f64().unwrap() > 0.0);

    let verified = place.succeed("verify grid.log");
    assert_eq!(verified, format!("grid.log: {collapses} collapses, all in order\n"));
}

/// A mesh that is somewhere in the world stays there in every format, and `info` says where.
#[test]
fn info_says_where_a_mesh_lies_in_the_world() {
    let place = Workplace::new();
    place.succeed("build grid.ply -o grid.log");
    assert!(!place.succeed("info grid.log").contains("origin"));
    let mut log = collapse_log::read_log(&place.file("grid.log")).unwrap();
    log.mesh.georeference = container::Georeference {
        origin: [691_000.5, 5_334_000.0, 0.0],
        coordinate_system: "EPSG:25832".to_owned(),
        rounding: container::Rounding { largest_move: 0.0125, median_edge: 2.5 },
        ..Default::default()
    };
    collapse_log::write_log(&place.file("there.log"), &log).unwrap();
    let lines = [
        "origin 691000.5 5334000 0",
        "coordinate system EPSG:25832",
        "largest move 0.0125",
        "of the median edge 5.0e-3",
        "median edge 2.5",
    ];
    for (backend, version) in [
        ("in-memory", "collapse log, version 2"),
        ("meta-node", "meta-nodes, version 2"),
        ("detail-block", "XFM version 2"),
        ("mt-partition", "multi-triangulation, version 2"),
    ] {
        place.succeed(&format!("build there.log --backend {backend} -o there"));
        let info = place.succeed("info there");
        let words: Vec<String> =
            info.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
        for line in lines {
            assert!(words.iter().any(|words| words == line), "{backend}: {line}: {info}");
        }
        assert!(info.contains(version), "{info}");
        let json: Value = serde_json::from_str(&place.succeed("info there --json")).unwrap();
        assert_eq!(json["coordinate_system"], "EPSG:25832", "{backend}");
        for key in ["origin", "largest_move", "median_edge"] {
            assert!(!json[key].is_null(), "{backend}: {key}");
        }
    }
    let json: Value = serde_json::from_str(&place.succeed("info there.log --json")).unwrap();
    assert_eq!(json["origin"], Value::from(vec![691_000.5, 5_334_000.0, 0.0]));
    assert_eq!(json["bounding_box"][0], Value::from(vec![690_999.5, 5_333_999.0, 0.0]));
    assert_eq!([&json["largest_move"], &json["median_edge"]], [0.0125, 2.5]);
    assert!(place.succeed("info there.log").contains("[690999.5, 5333999.0, 0.0]"));
}

/// Vertices that no collapse touches.
fn lone_vertices(log: &foldfront::CollapseLog) -> u64 {
    let forest = log.forest().unwrap();
    forest.root_of_vertex.iter().filter(|&&root| root == vertex_tree::NONE).count() as u64
}

#[test]
fn the_same_mesh_gives_the_same_bytes() {
    let place = Workplace::new();
    place.succeed("build grid.ply -o one.log");
    place.succeed("build grid.ply -o other.log");
    assert_eq!(place.read("one.log"), place.read("other.log"));
}

#[test]
#[cfg(unix)]
fn outputs_can_be_read_by_whoever_can_read_other_files() {
    use std::os::unix::fs::PermissionsExt;
    let place = Workplace::new();
    place.succeed("build grid.ply -o out.log");
    place.succeed("export grid.ply --path descent.path --frame 0 -o out.ply");
    place.succeed("render grid.ply --path descent.path --frame 0 -o out.png");
    let mode = |name: &str| std::fs::metadata(place.file(name)).unwrap().permissions().mode() & 0o777;
    for name in ["out.log", "out.ply", "out.png"] {
        assert_eq!(mode(name), mode("descent.path"), "{name}");
    }
}

#[test]
fn a_frame_is_exported_drawn_and_measured() {
    let place = Workplace::new();
    place.succeed("build grid.ply -o grid.log");
    let mut counts = Vec::new();
    for pixels in ["100000", "20", "0.0001"] {
        let name = format!("{pixels}.ply");
        let said = place
            .succeed(&format!("export grid.log --path descent.path --frame 1 --pixels {pixels} -o {name}"));
        let mesh = mesh_io::read(&[place.file(&name)], &mut |_, _| ()).unwrap();
        assert_eq!(said, format!("{name}: {} triangles\n", mesh.triangles.len()));
        assert!(mesh.positions.iter().all(|p| grid().positions.contains(p)), "a vertex that was not there");
        counts.push(mesh.triangles.len());
    }
    assert!(counts[0] < counts[1] && counts[1] < counts[2], "{counts:?}");
    assert_eq!(counts[2], grid().triangles.len(), "nothing is out of view");

    for (style, name) in [("", "plain.png"), ("--wire", "wire.png"), ("--outside", "outside.png")] {
        place
            .succeed(&format!("render grid.ply --path descent.path --frame 2 --width 300 {style} -o {name}"));
        let bytes = place.read(name);
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((frame.width, frame.height), (300, 200), "aspect 1.5");
        let (first, rest) = pixels.split_at(3);
        assert!(rest.chunks_exact(3).filter(|&p| p != first).count() > 1000, "{name} shows next to nothing");
    }
    assert_ne!(place.read("plain.png"), place.read("wire.png"));
    assert_ne!(place.read("plain.png"), place.read("outside.png"));

    let measure = |pixels: &str, rest: &str| {
        place.succeed(&format!(
            "deviation grid.log --path descent.path --frames 2,0 --pixels {pixels} --json {rest}"
        ))
    };
    let exact: Value = serde_json::from_str(&measure("0.0001", "--against grid.ply")).unwrap();
    let coarse: Value = serde_json::from_str(&measure("20", "")).unwrap();
    for (at, frame) in [(0, 2), (1, 0)] {
        assert_eq!(exact[at]["frame"], frame);
        assert_eq!(exact[at]["triangles"], 242);
        assert_eq!(exact[at]["flipped_triangles"], 0);
        for direction in ["forward", "reverse"] {
            let figures = &exact[at][direction]["inner"];
            assert!(figures["count"].as_u64().unwrap() > 100);
            assert!(figures["max_pixels"].as_f64().unwrap() < 1e-3, "{figures}");
            let figures = &coarse[at][direction]["inner"];
            let figure = |name: &str| figures[name].as_f64().unwrap();
            assert!(figure("median_pixels") <= figure("p99_pixels"));
            assert!(figure("p99_pixels") <= figure("max_pixels"));
            assert!(figure("max_pixels") > 0.1, "{figures}");
        }
    }
    let text = place.succeed("deviation grid.log --path descent.path --frames 0");
    assert!(text.starts_with("frame 0\n") && text.contains("original to displayed"), "{text}");
}

#[test]
fn a_built_in_scene_goes_through_every_command() {
    let place = Workplace::new();
    let path = repository("paths/laserscan-calm.path");
    let path = path.to_str().unwrap();
    let built = place.succeed("build scene:laserscan -o scan.log");
    assert_eq!(figure(&built, "triangles"), 720_000.0);
    let info: Value = serde_json::from_str(&place.succeed("info scan.log --json")).unwrap();
    assert_eq!(info["triangles"], 720_000);
    assert!(info["bytes_per_triangle"].as_f64().unwrap() < 40.0);
    let verified = place.succeed("verify scan.log");
    assert_eq!(verified, format!("scan.log: {} collapses, all in order\n", info["collapses"]));
    let exported = place.succeed(&format!("export scan.log --path {path} --frame 0 -o scan.ply"));
    let triangles = figure(&exported, "scan.ply:");
    assert!(triangles > 10_000.0 && triangles < 720_000.0, "{exported}");
    place.succeed(&format!("render scan.log --path {path} --frame 0 -o scan.png"));
    let measured = place.succeed(&format!("deviation scan.log --path {path} --frames 0 --json"));
    let measured: Value = serde_json::from_str(&measured).unwrap();
    assert_eq!(measured[0]["triangles"].as_f64(), Some(triangles));
    let inner = &measured[0]["forward"]["inner"];
    assert!(inner["p99_pixels"].as_f64().unwrap() < 2.0, "the tolerance is one pixel: {inner}");
}

#[test]
fn recorded_paths_are_made_again_and_described() {
    let place = Workplace::new();
    place.succeed("path generate scene:laserscan -o new/paths");
    assert_eq!(place.names("new/paths"), ["laserscan-calm.path", "laserscan-wild.path"]);
    for name in ["laserscan-calm", "laserscan-wild"] {
        let recorded = std::fs::read_to_string(repository(&format!("paths/{name}.path"))).unwrap();
        assert!(place.text(&format!("new/paths/{name}.path")) == recorded, "{name} has changed");
    }
    let text = place.succeed("path info descent.path new/paths/laserscan-wild.path");
    assert!(text.starts_with("descent: 3 frames, 0.2 s, 2.0 m; "), "{text}");
    let wild = Path::read(&place.file("new/paths/laserscan-wild.path")).unwrap();
    assert!(text.contains(&format!("\nlaserscan-wild: {} frames", wild.frames.len())), "{text}");
}

#[test]
fn help_is_no_failure() {
    let place = Workplace::new();
    assert!(place.succeed("--help").contains("compare"));
    assert!(place.succeed("compare --help").contains("--strategy"));
    assert_eq!(place.succeed("--version"), format!("foldfront {}\n", env!("CARGO_PKG_VERSION")));
    let output = place.run("");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("Usage:"));
}

#[test]
fn a_reader_that_has_gone_is_no_failure() {
    let place = Workplace::new();
    place.succeed("build grid.ply -o grid.log");
    for arguments in [
        "build grid.ply -o again.log",
        "info grid.log",
        "info grid.log --json",
        "verify grid.log",
        "compare grid.log --frames 0..2 --out results",
        "path info descent.path",
        "export grid.log --path descent.path --frame 0 -o out.ply",
        "deviation grid.log --path descent.path --frames 0",
        "--help",
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let child = place.command(arguments).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments}");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{arguments}");
    }
    assert!(place.file("again.log").exists() && place.file("results/report.html").exists());
}

#[test]
fn nobody_to_complain_to_is_no_panic() {
    let place = Workplace::new();
    for (arguments, code) in [("info missing.log", 1), ("info", 2), ("build grid.ply -o grid.log", 0)] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let status = place.command(arguments).stdout(Stdio::null()).stderr(writer).status().unwrap();
        assert_eq!(status.code(), Some(code), "{arguments}");
    }
}

#[test]
fn a_trajectory_is_kept_where_it_was_recorded() {
    let place = Workplace::new();
    place.write("near.csv", "time[ms],x,y,z\n0,0.5,0,2\n100,0.6,0,2\n200,0.7,0,2\n");
    let said = place.succeed("path import near.csv --fit grid.ply --no-fit -o near.path --rate 10");
    assert!(said.starts_with("near: 3 frames, 0.2 s, 0.2 units; "), "{said}");
    let positions = Path::read(&place.file("near.path")).unwrap().frames;
    assert_eq!(positions[1].position.to_array(), [0.6, 0.0, 2.0]);

    place.write("far.csv", "t,x,y,z\n0,500,0,2\n1,501,0,2\n");
    let output = place.run("path import far.csv --fit grid.ply --no-fit -o far.path");
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && place.file("far.path").exists(), "{complaint}");
    let said = "foldfront: warning: far.csv: no camera is near the mesh: the path is in [500, 0, 2] to [501, 0, 2], the mesh in [-1, -1, ";
    assert!(complaint.starts_with(said) && complaint.lines().count() == 1, "{complaint}");

    place.write("degrees.csv", "t,lat,lon,alt\n0,47,13,500\n1,47.1,13,500\n");
    place.fail(
        "path import degrees.csv --fit grid.ply --no-fit -o d.path",
        1,
        &["degrees.csv: ", "no map of them"],
    );
    place.fail("path import near.csv --no-fit -o d.path", 2, &["--fit"]);
    place.fail(
        "path import near.csv --fit grid.ply --no-fit --mode walk -o d.path",
        2,
        &["--no-fit", "--mode"],
    );
}

/// File names are whatever the system has, and are shown with replacements where they are no text.
#[cfg(target_os = "linux")]
#[test]
fn names_that_are_not_utf8_work() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let place = Workplace::new();
    std::fs::copy(place.file("descent.path"), place.file("").join(OsStr::from_bytes(b"p\xff.path"))).unwrap();
    let run = |words: &[&[u8]]| {
        let output =
            place.command("").args(words.iter().map(|word| OsStr::from_bytes(word))).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{words:?}: {said}");
        assert_eq!(said, "", "{words:?}");
    };
    run(&[b"build", b"grid.ply", b"-o", b"g\xff.fold"]);
    run(&[b"build", b"g\xff.fold", b"--backend", b"meta-node", b"-o", b"g\xff.meta"]);
    for file in [&b"g\xff.fold"[..], b"g\xff.meta"] {
        run(&[b"info", file]);
        run(&[b"verify", file]);
        run(&[b"export", file, b"--path", b"p\xff.path", b"--frame", b"0", b"-o", b"x\xff.ply"]);
        run(&[b"deviation", file, b"--path", b"p\xff.path", b"--frames", b"0", b"--against", b"x\xff.ply"]);
        run(&[b"compare", file, b"--path", b"p\xff.path", b"--out", b"c\xff"]);
    }
    run(&[b"path", b"info", b"p\xff.path"]);
    let report =
        std::fs::read_to_string(place.file("").join(OsStr::from_bytes(b"c\xff/report.html"))).unwrap();
    assert!(report.contains("--path p\u{fffd}.path --out c\u{fffd}"), "the command is shown");
}
