//! What can not be done: one clear line, the right exit code, and nothing left behind.

use crate::workplace::{PATH, Workplace, square};

/// Every command that reads a mesh, with `INPUT` for it.
const READERS: [&str; 6] = [
    "build INPUT -o out.log",
    "compare INPUT --path descent.path --out results",
    "export INPUT --path descent.path --frame 0 -o out.ply",
    "render INPUT --path descent.path --frame 0 -o out.png",
    "deviation INPUT --path descent.path --frames 0,1",
    "path import descent.path --fit INPUT -o out.path",
];

/// Outputs that are already there when a command fails, and have to stay as they are.
fn with_earlier_outputs() -> Workplace {
    let place = Workplace::new();
    for name in ["out.log", "out.ply", "out.png", "out.path"] {
        place.write(name, "written earlier");
    }
    std::fs::create_dir(place.file("results")).unwrap();
    for name in ["frames.csv", "summary.csv", "report.html", "selection-grid.svg"] {
        place.write(&format!("results/{name}"), "written earlier");
    }
    place
}

#[test]
fn a_bad_mesh_is_named_with_the_place_in_it() {
    let place = with_earlier_outputs();
    std::fs::create_dir(place.file("folder.ply")).unwrap();
    let whole = place.read("grid.ply");
    place.write("truncated.ply", &whole[..whole.len() - 100]);
    place.write("headless.ply", &whole[..40]);
    place.write("empty.ply", "");
    place.write("faceless.ply", square("0 1 0", &[]));
    place.write("range.ply", square("0 1 0", &["3 0 1 2", "3 0 2 4"]));
    place.write("negative.ply", square("0 1 0", &["3 0 1 2", "3 0 -2 1"]));
    place.write("nan.ply", square("0 nan 0", &["3 0 1 2"]));
    place.write("huge.ply", square("0 1e39 0", &["3 0 1 2"]));
    place.write("grid.xyz", &whole);
    place.write("noextension", &whole);
    place.write("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n");
    place.write("words.obj", "v 0 0 0\nv 1 zero 0\n");
    let cases: [(&str, &[&str]); 14] = [
        ("missing.ply", &["missing.ply: No such file"]),
        ("folder.ply", &["folder.ply: is a folder"]),
        ("truncated.ply", &["truncated.ply: face 2", "ends too early"]),
        ("headless.ply", &["headless.ply: "]),
        ("empty.ply", &["empty.ply: "]),
        ("faceless.ply", &["faceless.ply: a point cloud: 4 points and no faces"]),
        ("range.ply", &["range.ply: face 1: no vertex 4, there are 4"]),
        ("negative.ply", &["negative.ply: face 1", "-2"]),
        ("nan.ply", &["nan.ply: vertex 3", "NaN"]),
        ("huge.ply", &["huge.ply: vertex 3"]),
        ("grid.xyz", &["grid.xyz: unknown extension \"xyz\""]),
        ("noextension", &["noextension: unknown extension"]),
        ("range.obj", &["range.obj: line 5: no vertex 4, there are 3"]),
        ("words.obj", &["words.obj: line 2", "zero"]),
    ];
    for (input, said) in cases {
        for reader in READERS {
            place.fail(&reader.replace("INPUT", input), 1, said);
        }
    }
    place.fail("build grid.ply range.obj -o out.log", 1, &["one input is expected", "grid.ply range.obj"]);
    place.fail("compare grid.ply nan.ply --frames 0..2 --out results", 1, &["nan.ply: vertex 3"]);
    place.fail("compare grid.ply nan.ply --frames 0..2 --out new", 1, &["nan.ply: vertex 3"]);
    place.fail(
        "deviation grid.ply --against nan.ply --path descent.path --frames 0",
        1,
        &["nan.ply: vertex 3"],
    );
}

#[test]
fn a_bad_path_is_named_with_the_line_in_it() {
    let place = with_earlier_outputs();
    std::fs::create_dir(place.file("folder.path")).unwrap();
    let header: String = PATH.lines().take(5).map(|line| format!("{line}\n")).collect();
    place.write("none.path", &header);
    place.write("short.path", format!("{header}0 0 0 4 0 0 0 1\n0.1 0 0 3\n"));
    place.write("word.path", PATH.replace("0.2 0 0 2", "0.2 0 x 2"));
    place.write("infinite.path", PATH.replace("0.2 0 0 2", "0.2 0 inf 2"));
    place.write("far.path", PATH.replace("0.2 0 0 2", "0.2 0 -1e200 2"));
    place.write("back.path", PATH.replace("0.2 ", "0.1 "));
    place.write("rotation.path", PATH.replace("0.1 0 0 3 0 0 0 1", "0.1 0 0 3 0 0 0 0"));
    place.write("fov.path", PATH.replace("fov 60", "fov 180"));
    place.write("nofov.path", PATH.replace("fov", "lens"));
    place.write("bytes.path", b"\xff\xfe\x00");
    let cases: [(&str, &[&str]); 12] = [
        ("missing.path", &["missing.path: No such file"]),
        ("folder.path", &["folder.path: "]),
        ("none.path", &["none.path: there are no frames"]),
        ("short.path", &["short.path:7: ", "8 columns", "not 4"]),
        ("word.path", &["word.path:8: \"x\""]),
        ("infinite.path", &["infinite.path:8: \"inf\""]),
        ("far.path", &["far.path:8: the eye [0.0, -1e200, 2.0] is not finite, or farther away than 1e150"]),
        ("back.path", &["back.path:8: ", "0.1"]),
        ("rotation.path", &["rotation.path:7: "]),
        ("fov.path", &["fov.path:4: fov \"180\""]),
        ("nofov.path", &["nofov.path: ", "fov"]),
        ("bytes.path", &["bytes.path: ", "UTF-8"]),
    ];
    for (path, said) in cases {
        for reader in READERS.iter().filter(|reader| !reader.starts_with("path") && reader.contains(".path"))
        {
            place.fail(&reader.replace("descent.path", path).replace("INPUT", "grid.ply"), 1, said);
        }
        place.fail(&format!("path info descent.path {path}"), 1, said);
    }
}

#[test]
fn a_bad_trajectory_is_named_with_the_line_in_it() {
    let place = with_earlier_outputs();
    place.write("one.txt", "0 1 2 3 0 0 0 1\n");
    place.write("narrow.txt", "0 1\n1 2\n");
    place.write("ragged.txt", "0 1 2 3 0 0 0 1\n1 1 2 4 0 0 0 1\n2 1 2\n");
    place.write("word.txt", "0 1 2 3 0 0 0 1\n1 one 2 4 0 0 0 1\n");
    for (trajectory, said) in [
        ("missing.txt", "missing.txt: No such file"),
        ("one.txt", "one.txt: 1 frames"),
        ("narrow.txt", "narrow.txt:1: "),
        ("ragged.txt", "ragged.txt:3: 8 columns"),
        ("word.txt", "word.txt:2: \"one\""),
    ] {
        place.fail(&format!("path import {trajectory} --fit grid.ply -o out.path"), 1, &[said]);
    }
    place.fail("path import descent.path --fit grid.ply -o out.path --rate 0", 2, &["'0'", "--rate"]);
    place.fail("path import descent.path --fit grid.ply -o out.path --rate 1e9", 1, &["1000000000.0 frames"]);
    place.fail("path import descent.path --fit grid.ply -o out.path --rate 1e300", 1, &["1e300 frames"]);
}

#[test]
fn a_frame_that_is_not_there_is_named() {
    let place = with_earlier_outputs();
    let said: &[&str] = &["path descent has frames 0 to 2, not 3"];
    place.fail("export grid.ply --path descent.path --frame 3 -o out.ply", 1, said);
    place.fail("render grid.ply --path descent.path --frame 3 -o out.png", 1, said);
    place.fail("deviation grid.ply --path descent.path --frames 0,3", 1, said);
    let said: &[&str] = &["path descent has frames 0 to 2"];
    place.fail("compare grid.ply --path descent.path --frames 3..9 --out results", 1, said);
}

#[test]
fn a_command_that_is_not_understood_has_exit_code_2() {
    let place = with_earlier_outputs();
    let cases: [(&str, &[&str]); 16] = [
        ("bild grid.ply", &["'bild'"]),
        ("build grid.ply", &["--output"]),
        ("build -o out.log", &["<INPUT>"]),
        ("build grid.ply -o out.log --backend cloud", &["'cloud'", "in-memory"]),
        ("build grid.ply -o out.log --fast", &["'--fast'"]),
        (
            "compare grid.ply --strategy best --out results",
            &["'best'", "top-down, front, event, event-published, event-queue"],
        ),
        ("compare grid.ply --strategy event,best --out results", &["'best'"]),
        ("compare grid.ply --frames 7..3 --out results", &["'7..3'", "A..B"]),
        ("compare grid.ply --frames 3 --out results", &["'3'", "A..B"]),
        ("compare grid.ply --pixels 0 --out results", &["'0'", "--pixels"]),
        ("compare grid.ply --pixels NaN --out results", &["'NaN'", "--pixels"]),
        ("compare grid.ply --pixels 1 --theta 1 --out results", &["--pixels", "--theta"]),
        ("compare grid.ply --frame-time 5 --out results", &["'5'", "5ms"]),
        ("compare grid.ply --triangles many --out results", &["'many'", "--triangles"]),
        ("render grid.ply --path descent.path --frame 0 -o out.png --width 9", &["9", "--width"]),
        ("export grid.ply --path descent.path --frame first -o out.ply", &["'first'", "--frame"]),
    ];
    for (arguments, said) in cases {
        place.fail(arguments, 2, said);
    }
}

/// What a tolerance means depends on the lens: too small a one has no finite `k`.
#[test]
fn a_tolerance_that_is_none_for_the_lens_has_exit_code_2() {
    let place = with_earlier_outputs();
    let takers = [
        "compare grid.ply TOLERANCE --path descent.path --out results",
        "compare grid.ply TOLERANCE --out results",
        "compare scene:laserscan TOLERANCE --out results",
        "export grid.ply TOLERANCE --path descent.path --frame 0 -o out.ply",
        "render grid.ply TOLERANCE --path descent.path --frame 0 -o out.png",
        "deviation grid.ply TOLERANCE --path descent.path --frames 0,1",
    ];
    for taker in takers {
        for (tolerance, said) in [
            (
                "--theta 1e-320",
                &["--theta 1e-320: the tolerance", "too small for a field of view of 1.047"][..],
            ),
            ("--pixels 1e-306", &["--pixels 1e-306: the tolerance", "too small"]),
            // Less than the smallest number: 0.
            ("--pixels 5e-324", &["--pixels 5e-324: the tolerance 0 is not a finite number above 0"]),
            ("--pixels 1e308", &["--pixels 1e308: the tolerance inf is not a finite number above 0"]),
        ] {
            place.fail(&taker.replace("TOLERANCE", tolerance), 2, said);
        }
    }
    place.succeed("export grid.ply --path descent.path --frame 0 -o new.ply --pixels 1e-6");
    place.succeed("compare grid.ply --path descent.path --pixels 1e-6 --check --out new");
    place.succeed("compare grid.ply --path descent.path --theta 1e-307 --check --out new");
}

#[test]
fn a_scene_that_does_not_exist_is_named_with_those_that_do() {
    let place = with_earlier_outputs();
    for reader in READERS {
        let moon = reader.replace("INPUT", "scene:moon");
        place.fail(&moon, 1, &["\"scene:moon\"", "scene:city", "scene:alps", "scene:laserscan"]);
        place.fail(&reader.replace("INPUT", "scene:alps@0"), 1, &["\"scene:alps@0\"", "scale \"0\"", "1 to"]);
    }
    place.fail("path generate scene:moon -o new", 1, &["\"scene:moon\""]);
}

#[test]
fn an_output_that_can_not_be_written_is_named() {
    let place = with_earlier_outputs();
    std::fs::create_dir(place.file("folder")).unwrap();
    // The first output of a command that is one file can be each of these.
    for command in READERS.iter().filter(|reader| reader.contains("-o ")) {
        let command = command.replace("INPUT", "grid.ply");
        let (command, _) = command.rsplit_once(' ').unwrap();
        place.fail(&format!("{command} nowhere/out"), 1, &["nowhere/out: No such file"]);
        place.fail(&format!("{command} folder"), 1, &["folder: is a folder"]);
        place.fail(&format!("{command} grid.ply/out"), 1, &["grid.ply/out: "]);
        #[cfg(unix)]
        place.fail(&format!("{command} /dev/null"), 1, &["/dev/null: is not a file"]);
    }
    place.fail("compare grid.ply --out grid.ply", 1, &["grid.ply: is not a folder"]);
    place.fail("compare grid.ply --out grid.ply/results", 1, &["grid.ply: is not a folder"]);
    place.fail("path generate scene:laserscan -o grid.ply", 1, &["grid.ply: "]);
}

/// Every command that reads a hierarchy, with `INPUT` for it.
const HIERARCHY_READERS: [&str; 4] = ["info INPUT", "info INPUT --json", "verify INPUT", READERS[1]];

#[test]
fn a_damaged_hierarchy_is_named_with_the_offset() {
    let place = with_earlier_outputs();
    place.succeed("build grid.ply -o grid.log");
    let whole = place.read("grid.log");
    let (vertices, triangles) = (144, 242);
    let table_at: usize = 48;
    let positions_at = table_at + 8 + 3 * 32;
    let triangles_at = positions_at + 12 * vertices;
    let collapses_at = (triangles_at + 12 * triangles).next_multiple_of(8);
    let flipped = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    place.write("magic.log", flipped(3));
    place.write("version.log", flipped(8));
    place.write("counts.log", flipped(17));
    place.write("table.log", flipped(table_at + 20));
    place.write("positions.log", flipped(positions_at + 30));
    place.write("triangles.log", flipped(triangles_at + 30));
    place.write("collapses.log", flipped(collapses_at + 30));
    place.write("end.log", flipped(whole.len() - 1));
    place.write("truncated.log", &whole[..whole.len() - 1]);
    place.write("header.log", &whole[..20]);
    place.write("longer.log", [&whole[..], b"x"].concat());
    let offset = |at: usize| format!("offset {at}:");
    let cases = [
        ("version.log", offset(8)),
        ("counts.log", offset(0)),
        ("table.log", offset(table_at)),
        ("positions.log", offset(positions_at)),
        ("triangles.log", offset(triangles_at)),
        ("collapses.log", offset(collapses_at)),
        ("end.log", offset(collapses_at)),
        ("truncated.log", format!("{} bytes", whole.len() - 1)),
        ("header.log", "20 bytes".to_owned()),
        ("longer.log", format!("{} bytes", whole.len() + 1)),
    ];
    for (file, said) in &cases {
        for reader in HIERARCHY_READERS.iter().chain(&READERS) {
            place.fail(&reader.replace("INPUT", file), 1, &[file, said]);
        }
    }
    for reader in &HIERARCHY_READERS[..3] {
        for file in ["magic.log", "grid.ply", "descent.path"] {
            place.fail(&reader.replace("INPUT", file), 1, &[file, "not a collapse log"]);
        }
        place.fail(&reader.replace("INPUT", "missing.log"), 1, &["missing.log: No such file"]);
    }
}

#[test]
fn verify_finds_bounds_that_are_not_nested() {
    let place = Workplace::new();
    place.succeed("build grid.ply -o grid.log");
    let mut log = collapse_log::read_log(&place.file("grid.log")).unwrap();
    let parent = log.forest().unwrap().parent[0];
    log.collapses[0].bounds.radius *= 100.0;
    collapse_log::write_log(&place.file("wide.log"), &log).unwrap();
    let said = format!("node 0 is not within its parent {parent}");
    place.fail("verify wide.log", 1, &["wide.log", &said]);
    log.collapses[0].bounds.radius /= 100.0;
    log.collapses[0].bounds.eps = 1e9;
    collapse_log::write_log(&place.file("rough.log"), &log).unwrap();
    place.fail("verify rough.log", 1, &["rough.log", &said]);
}

/// A disk that is full after half a kilobyte, by way of the shell's limit on the length of files.
#[test]
#[cfg(target_os = "linux")]
fn what_does_not_fit_on_the_disk_leaves_nothing_behind() {
    let place = with_earlier_outputs();
    place.succeed("build grid.ply -o grid.log");
    for (reader, file) in READERS.iter().zip(["out.log", "", "out.ply", "out.png", "", "out.path"]) {
        let command = reader.replace("INPUT", "grid.log").replace("out.path", "out.path --rate 1000");
        let mut limited = std::process::Command::new("sh");
        limited
            .args(["-c", &format!("trap '' XFSZ; ulimit -f 1; exec \"$0\" {command}")])
            .arg(env!("CARGO_BIN_EXE_foldfront"))
            .current_dir(place.file("."));
        if command.starts_with("deviation") {
            continue;
        }
        place.fail_as(&mut limited, &command, 1, &[file, "File too large"]);
    }
}
