//! Height maps, which may be much larger than their files: they are taken piece by piece, and no further than to a limit.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};

use foldfront::construction::mesh_io::{self, MeshIoError, ReadOptions, Receiver};
use foldfront::container::DegreeMap;

use super::{Desk, check_error};

/// Pieces that are taken.
const MOST_PIECES: u64 = 20_000;

/// Holds a reader to what `Receiver` promises, up to a limit.
#[derive(Default)]
struct Strict {
    vertices: u32,
    pieces: u64,
    georeferences: u32,
}

impl Strict {
    fn count(&mut self) -> io::Result<()> {
        self.pieces += 1;
        if self.pieces > MOST_PIECES { Err(io::Error::other("enough")) } else { Ok(()) }
    }
}

impl Receiver for Strict {
    fn position(&mut self, position: [f64; 3]) -> io::Result<()> {
        for x in position {
            assert!(x.abs() <= f64::from(f32::MAX), "a coordinate {x}");
        }
        self.vertices += 1;
        self.count()
    }

    fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()> {
        let [a, b, c] = corners;
        assert!(a != b && b != c && c != a, "a triangle {corners:?}");
        assert!(
            corners.iter().all(|&v| v < self.vertices),
            "a triangle {corners:?} of {} vertices",
            self.vertices
        );
        self.count()
    }

    fn position_of(&mut self, vertex: u32) -> io::Result<[f64; 3]> {
        panic!("a height map asks for vertex {vertex}")
    }

    fn georeference(&mut self, coordinate_system: &str, degrees: Option<DegreeMap>) {
        self.georeferences += 1;
        assert_eq!(self.georeferences, 1, "where it lies is said twice");
        assert!(coordinate_system.len() <= 4096, "a name of {} bytes", coordinate_system.len());
        if let Some(DegreeMap { longitude, latitude, metres_per_degree: [a, b] }) = degrees {
            assert!([longitude, latitude, a, b].iter().all(|x| x.is_finite()), "degrees {degrees:?}");
        }
    }
}

fn send(file: &std::path::Path, desk: &Desk) -> bool {
    let mut strict = Strict::default();
    match mesh_io::send(&[file], &ReadOptions::default(), &desk.folder, &mut strict, &mut |_, _| ()) {
        Ok(()) => true,
        // It was larger than the limit.
        Err(MeshIoError::Receiver(_)) if strict.pieces > MOST_PIECES => true,
        Err(error) => {
            check_error(&error);
            false
        }
    }
}

/// A picture of heights.
pub fn map(bytes: &[u8], name: &str, desk: &Desk) -> bool {
    send(&desk.lay(name, bytes), desk)
}

/// An archive of height tiles.
pub fn archive(bytes: &[u8], desk: &Desk) -> bool {
    send(&desk.lay("input.zip", bytes), desk)
}

/// A height tile, whose file may only have one of two lengths, and whose name counts. The input's first line is the name and the length;
/// what follows are places and the samples there, five bytes each. All else is zeros.
pub fn tile(bytes: &[u8], desk: &Desk) -> bool {
    let end = bytes.iter().position(|&byte| byte == b'\n').unwrap_or(bytes.len());
    let line = String::from_utf8_lossy(&bytes[..end]);
    let mut words = line.split(' ');
    let name = words.next().unwrap_or("");
    let length: u64 = words.next().and_then(|word| word.parse().ok()).unwrap_or(0);
    // Names that a file may have and an error may show, and lengths that make no full disk.
    if name.is_empty()
        || name.len() > 100
        || name.contains(|c: char| c == '/' || c.is_control())
        || length > 1 << 26
    {
        return false;
    }
    let path = desk.folder.join(format!("{name}.hgt"));
    let write = || -> io::Result<()> {
        let mut file = File::create(&path)?;
        for edit in bytes[end..].get(1..).unwrap_or_default().chunks_exact(5) {
            let at = u64::from(u32::from_le_bytes([edit[0], edit[1], edit[2], 0]));
            file.seek(SeekFrom::Start(at))?;
            file.write_all(&edit[3..])?;
        }
        file.set_len(length)
    };
    write().expect("a folder to write to");
    let taken = send(&path, desk);
    std::fs::remove_file(&path).expect("a folder to write to");
    taken
}
