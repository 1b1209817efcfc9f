//! Where results may go: never over an input, whatever it is called, and to no name that promises another format.

use crate::workplace::Workplace;

#[test]
fn the_output_is_never_the_input() {
    let place = Workplace::new();
    place.succeed("build grid.ply -o grid.fold");
    place.succeed("build grid.ply --backend meta-node -o grid.meta");
    std::fs::hard_link(place.file("grid.ply"), place.file("hard.bin")).unwrap();
    std::fs::hard_link(place.file("descent.path"), place.file("hard.path")).unwrap();
    std::fs::create_dir(place.file("results")).unwrap();
    std::fs::hard_link(place.file("descent.path"), place.file("results/report.html")).unwrap();
    let mut cases = vec![
        ("build grid.ply -o grid.ply", "grid.ply: "),
        ("build grid.ply -o hard.bin", "hard.bin: is the input too"),
        ("build grid.ply --memory 1M -o hard.bin", "hard.bin: is the input too"),
        ("build grid.fold -o grid.fold", "grid.fold: is the input too"),
        ("build grid.fold --backend meta-node -o ./grid.fold", "grid.fold: is the input too"),
        ("export grid.ply --path descent.path --frame 0 -o grid.ply", "grid.ply: is the input too"),
        ("export grid.fold --path descent.path --frame 0 -o hard.bin", ""),
        ("path import descent.path --fit grid.ply -o descent.path", "descent.path: is the input too"),
        ("path import descent.path --fit grid.ply -o hard.path", "hard.path: is the input too"),
        ("compare grid.ply --path descent.path --out results", "results/report.html: is the input too"),
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("grid.meta", place.file("soft")).unwrap();
        std::os::unix::fs::symlink("descent.path", place.file("soft.png")).unwrap();
        cases.extend([
            ("export grid.meta --path descent.path --frame 0 -o soft", "soft: is the input too"),
            ("render soft --path descent.path --frame 0 -o grid.meta", "grid.meta: "),
            ("render grid.ply --path descent.path --frame 0 -o soft.png", "soft.png: is the input too"),
        ]);
    }
    for (command, said) in cases {
        if said.is_empty() {
            // No input of this command: it may be written.
            place.succeed(command);
        } else {
            place.fail(command, 1, &[said]);
        }
    }
}

#[test]
fn an_extension_is_a_promise() {
    let place = Workplace::new();
    for (command, said) in [
        ("export grid.ply --path descent.path --frame 0 -o x.obj", "x.obj: what is written is a PLY file"),
        ("export grid.ply --path descent.path --frame 0 -o x.STL", ".stl promises another format"),
        ("export grid.ply --path descent.path --frame 0 -o -", "-: results are written to files"),
        ("render grid.ply --path descent.path --frame 0 -o x.jpg", "x.jpg: what is written is a PNG file"),
        ("build grid.ply -o x.ply", "x.ply: what is written is a hierarchy"),
        ("build grid.ply --backend meta-node -o x.xfm", ".xfm promises another format"),
        ("path import descent.path --fit grid.ply -o x.frames", "x.frames: what is written is a path"),
    ] {
        place.fail(command, 1, &[said]);
    }
    place.succeed("build grid.ply --backend meta-node -o x.meta");
    place.succeed("build grid.ply --backend mt-partition -o x.fold");
    place.succeed("export grid.ply --path descent.path --frame 0 -o x.mesh");
}

/// What is read more than once has to be a file: a pipe would be empty the second time, or wait for ever.
#[cfg(unix)]
#[test]
fn a_pipe_is_not_a_file() {
    let place = Workplace::new();
    let made = std::process::Command::new("mkfifo").arg(place.file("pipe.ply")).status().unwrap();
    assert!(made.success());
    for command in
        ["build pipe.ply -o x.fold", "info pipe.ply", "verify pipe.ply", "compare pipe.ply --out x"]
    {
        let output = place.run(command);
        let line = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            (output.status.code(), &*line),
            (Some(1), "foldfront: pipe.ply: is not a file\n"),
            "{command}"
        );
    }
}
