//! Meshes far from the origin: what goes in at a place comes out at that place.

use foldfront::construction::mesh_io;

use crate::workplace::{Workplace, grid};

/// Where the grid is moved to: a place in UTM, in metres.
const PLACE: [f64; 3] = [500_000.05, 5_400_000.05, 300.0];

/// The grid as an OBJ, moved, with decimals that single precision does not hold there.
fn moved(place: [f64; 3]) -> String {
    let mesh = grid();
    let vertex = |p: &[f32; 3]| {
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(p[axis]) + place[axis]);
        format!("v {x:.6} {y:.6} {z:.6}\n")
    };
    let face = |t: &[u32; 3]| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    mesh.positions.iter().map(vertex).chain(mesh.triangles.iter().map(face)).collect()
}

/// The path above the grid, moved with it.
fn descent(place: [f64; 3]) -> String {
    let header = "# foldfront path\n# name descent\n# units m\n# fov 60\n# aspect 1.5\n";
    let frames = [4.0, 3.0, 2.0].map(|height| {
        let [x, y, z] = place;
        format!("{} {x} {y} {} 0 0 0 1\n", 1.0 - 0.1 * height, z + height)
    });
    frames.iter().fold(header.to_owned(), |text, frame| text + frame)
}

#[test]
fn a_mesh_at_its_place_is_the_same_mesh() {
    let place = Workplace::new();
    place.write("here.obj", moved([0.0; 3]));
    place.write("there.obj", moved(PLACE));
    place.write("here.path", descent([0.0; 3]));
    place.write("there.path", descent(PLACE));
    for backend in ["in-memory", "meta-node", "detail-block", "mt-partition"] {
        let mut triangles = Vec::new();
        for at in ["here", "there"] {
            let said = place.succeed(&format!("build {at}.obj --backend {backend} -o {at}.fold"));
            assert!(said.contains("largest move"), "{said}");
            place.succeed(&format!("export {at}.fold --path {at}.path --frame 2 -o {at}.ply"));
            let mesh = mesh_io::read(&[place.file(&format!("{at}.ply"))], &mut |_, _| ()).unwrap();
            triangles.push(mesh.triangles.len());
            // In the middle of the grid, at its place.
            let origin = mesh.georeference.origin;
            let expected = if at == "here" { [0.0; 3] } else { PLACE };
            for axis in 0..3 {
                assert!((origin[axis] - expected[axis]).abs() < 0.2, "{backend}: {origin:?}");
            }
            let inside = |p: &[f32; 3]| p[0].abs() < 1.001 && p[1].abs() < 1.001;
            assert!(mesh.positions.iter().all(inside));
            place.succeed(&format!("compare {at}.fold --path {at}.path --check --out results"));
            let said = place
                .succeed(&format!("deviation {at}.fold --against {at}.obj --path {at}.path --frames 0,2"));
            assert!(said.contains("242 triangles displayed"), "{said}");
            place.succeed(&format!("render {at}.fold --path {at}.path --frame 2 -o {at}.png"));
        }
        assert!(triangles[0].abs_diff(triangles[1]) <= 2, "{backend}: {triangles:?}");
        let [here, there] = ["here.png", "there.png"].map(|name| place.read(name));
        assert!(here.len().abs_diff(there.len()) < here.len() / 4, "{backend}");
        // Piece by piece the file is the same, and so is its place.
        place.succeed(&format!("build there.obj --backend {backend} --memory 1M -o pieces.fold"));
        assert_eq!(place.read("pieces.fold"), place.read("there.fold"), "{backend}");
    }
    let said = place.succeed("info there.fold");
    assert!(said.contains("origin") && said.contains("500000.0"), "{said}");
}

/// 32 bits about the middle hold what fits a few kilometres, but not millimetres over the Earth.
#[test]
fn rounding_that_matters_is_said() {
    let place = Workplace::new();
    let mut text = moved(PLACE);
    let far = "v -6000000.123 0.5 0.25\nv -6000000.223 0.5 0.25\nv -6000000.123 0.6 0.25\nf 145 146 147\n";
    text.push_str(far);
    place.write("wide.obj", text);
    for command in ["build wide.obj -o wide.fold", "info wide.fold"] {
        let output = place.run(command);
        assert!(output.status.success());
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(said.starts_with("foldfront: warning: 32 bits") && said.lines().count() == 1, "{said}");
    }
}

#[test]
fn what_is_left_is_explained() {
    let place = Workplace::new();
    // A hundred triangles that have nothing in common.
    let mut text = String::new();
    for i in 0..100 {
        let x = 10 * i;
        text += &format!("v {x} 0 0\nv {} 0 0\nv {x} 1 0\nf -3 -2 -1\n", x + 1);
    }
    place.write("apart.obj", text);
    let said = place.succeed("build apart.obj -o apart.fold");
    assert!(said.contains("100.0 % of the triangles remain in the base mesh: 100 components"), "{said}");
    assert!(said.contains("--merge-components"), "{said}");
    let said = place.succeed("build apart.obj --merge-components -o apart.fold");
    assert!(!said.contains("remain in the base mesh: 100"), "{said}");
    for (options, collapses) in [("", "collapses 0"), ("--merge-components ", "collapses 2")] {
        place.succeed(&format!("compare apart.obj {options}--path descent.path --out results"));
        // The facts of the report, without markup.
        let report = place.text("results/report.html").replace('<', " <").replace('>', "> ");
        let words: Vec<&str> = report.split_whitespace().filter(|word| !word.starts_with('<')).collect();
        assert!(words.join(" ").contains(collapses), "{options}");
    }
}
