//! A folder with small inputs, and the program run in it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use foldfront::Mesh;

/// A folder of its own, removed at the end.
pub struct Workplace {
    folder: tempfile::TempDir,
}

/// A path of three frames, the eye above the middle of the [`grid`] and going down.
///
/// Line 6 is the first frame.
pub const PATH: &str = "\
# foldfront path
# name descent
# units m
# fov 60
# aspect 1.5
0 0 0 4 0 0 0 1
0.1 0 0 3 0 0 0 1
0.2 0 0 2 0 0 0 1
";

/// A wavy square of 12 * 12 vertices, from -1 to 1 in x and y.
pub fn grid() -> Mesh {
    let at = |i: u32| i as f32 / 5.5 - 1.0;
    let height = |x: u32, y: u32| 0.02 * ((x * x + 3 * y * y + x * y) % 7) as f32;
    let positions = (0..144).map(|v| (v % 12, v / 12)).map(|(x, y)| [at(x), at(y), height(x, y)]).collect();
    let squares = (0..121).map(|s| s / 11 * 12 + s % 11);
    let triangles = squares.flat_map(|v| [[v, v + 1, v + 13], [v, v + 13, v + 12]]).collect();
    Mesh { positions, triangles, ..Mesh::default() }
}

/// A text PLY of four vertices and the given faces.
pub fn square(last_vertex: &str, faces: &[&str]) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n{last_vertex}\n{}\n",
        faces.len(),
        faces.join("\n")
    )
}

impl Workplace {
    /// With `grid.ply` and `descent.path` in it.
    pub fn new() -> Self {
        let place = Self { folder: tempfile::tempdir().unwrap() };
        foldfront::construction::mesh_io::write_ply(&place.file("grid.ply"), &grid(), None).unwrap();
        place.write("descent.path", PATH);
        place
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.file(name), content).unwrap();
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.file(name)).unwrap()
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    /// The program with arguments that are separated by spaces.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_foldfront"));
        command.current_dir(self.folder.path()).args(arguments.split_whitespace()).stdin(Stdio::null());
        command
    }

    pub fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs a command that must succeed without a word on standard error; what it says on standard output.
    pub fn succeed(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        let complaints = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments}: {}: {complaints}", output.status);
        assert_eq!(complaints, "", "{arguments}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs a command that must fail with this exit code, and say so in one line on standard error alone, in which all
    /// of `said` occurs. Nothing in the folder may change: no output, no half of one, nothing temporary.
    #[track_caller]
    pub fn fail(&self, arguments: &str, code: i32, said: &[&str]) {
        self.fail_as(&mut self.command(arguments), arguments, code, said);
    }

    #[track_caller]
    pub fn fail_as(&self, command: &mut Command, name: &str, code: i32, said: &[&str]) {
        let before = self.everything();
        let output = command.output().unwrap();
        let line = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{name}: {line}");
        assert!(
            line.ends_with('\n') && line.lines().count() == 1 && line.starts_with("foldfront: "),
            "{name}: not one line: {line:?}"
        );
        for said in said {
            assert!(line.contains(said), "{name}: no {said:?} in {line:?}");
        }
        assert_eq!(output.stdout, b"", "{name}");
        assert_eq!(self.everything(), before, "{name}: the folder has changed");
    }

    /// A column of a table that `compare` has written, row by row.
    pub fn column(&self, table: &str, name: &str) -> Vec<String> {
        let mut rows = csv::Reader::from_path(self.file(table)).unwrap();
        let at = rows.headers().unwrap().iter().position(|column| column == name).unwrap();
        rows.records().map(|row| row.unwrap()[at].to_owned()).collect()
    }

    /// All files and folders, with the contents of the files.
    pub fn everything(&self) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let mut found = BTreeMap::new();
        let mut folders = vec![self.folder.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let content = path.is_file().then(|| std::fs::read(&path).unwrap());
                if path.is_dir() {
                    folders.push(path.clone());
                }
                found.insert(path, content);
            }
        }
        found
    }

    /// The names of what is in a folder, in order.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.file(folder)).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// A file of the repository.
pub fn repository(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(file)
}
