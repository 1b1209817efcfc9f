//! Mosaics of height tiles as the Shuttle Radar Topography Mission published them (`.hgt`).
//!
//! A tile spans one degree and is named after its south-west corner. It has 1201 or 3601 rows, north first, of as
//! many big-endian 16-bit heights in metres; -32768 is a void. Its edges are also the edges of the tiles beside it,
//! where those may differ by a metre. There the northern tile counts before the southern, and among these the
//! western before the eastern: the next one is asked only where that is missing or void. So neighbours share their
//! vertices. A tile that is missing inside the mosaic leaves a hole.
//!
//! Positions are metres in the local equirectangular projection about the middle of the mosaic: x to the east, y to
//! the north, z up from sea level. With latitude f and longitude l in radians, (f0, l0) the middle and R the Earth's
//! mean radius, x = R cos(f0) (l - l0) and y = R (f - f0). Away from f0 true east-west lengths differ by
//! cos(f) / cos(f0); a mosaic must not span more than 20 degrees, be it across 180 degrees of longitude.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use container::DegreeMap;
use zip::ZipArchive;
use zip::result::ZipError;

use super::error::{MeshIoError, Place};
use super::extension::extension;
use super::input::{self, Input};
use super::limits::MAX_SPAN;
use super::raster::centred;
use super::receiver::{Contents, Receiver};
use super::terrain::{self, HeightGrid};
use crate::progress::Progress;

/// Metres on the ground in a degree of latitude, from the mean radius of the Earth (IUGG).
pub(super) const METRES_PER_DEGREE: f64 = 6_371_008.8 * std::f64::consts::PI / 180.0;
const VOID: i16 = i16::MIN;
/// What longitudes and latitudes are in: WGS 84.
const COORDINATE_SYSTEM: &str = "EPSG:4326";

/// A tile that has been found but not read.
struct Found {
    /// Its name; behind that of its archive if it is in one.
    path: PathBuf,
    /// The archive and its number in there.
    archived: Option<(PathBuf, usize)>,
    /// Latitude and longitude of the south-west corner, in degrees.
    south: i32,
    west: i32,
    side: usize,
}

/// The tiles of a mosaic from north to south, and from west to east in each band of one latitude.
fn find(inputs: &[&Path], progress: Progress<'_>) -> Result<Vec<Found>, MeshIoError> {
    let mut found = Vec::new();
    for &input in inputs {
        if extension(input) == "zip" {
            find_in_archive(input, &mut found)?;
        } else {
            let bytes = Input::open(input, &mut *progress)?.length;
            found.push(Found::new(input.to_owned(), bytes)?);
        }
    }
    join_across_180(&mut found);
    found.sort_by_key(|tile| (-tile.south, tile.west));
    check_mosaic(&found)?;
    Ok(found)
}

/// Hands `.hgt` files and `.zip` archives of them on as one mosaic: from memory, or row by row if there is a folder into which
/// archived tiles can be unpacked.
pub(super) fn send(
    inputs: &[&Path],
    folder: Option<&Path>,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<Contents, MeshIoError> {
    let found = find(inputs, progress)?;
    let mosaic = open_mosaic(&found, folder, &mut *progress)?;
    receiver.georeference(COORDINATE_SYSTEM, Some(mosaic.degrees));
    terrain::send(&mosaic, &found[0].path, receiver, progress)?;
    Ok(Contents { faces: true })
}

/// Where tiles lie on both sides of 180 degrees, counts longitudes on beyond it: they begin behind the widest gap.
fn join_across_180(found: &mut [Found]) {
    for tile in &mut *found {
        // E180 is W180.
        tile.west = (tile.west + 180).rem_euclid(360) - 180;
    }
    let mut wests: Vec<i32> = found.iter().map(|tile| tile.west).collect();
    wests.sort_unstable();
    let (Some(&first), Some(&last)) = (wests.first(), wests.last()) else { return };
    let around = first + 360 - last;
    let widest = wests.windows(2).map(|pair| (pair[1] - pair[0], pair[1])).max_by_key(|&(gap, _)| gap);
    if let Some((_, start)) = widest.filter(|&(gap, _)| gap > around) {
        found.iter_mut().filter(|tile| tile.west < start).for_each(|tile| tile.west += 360);
    }
}

/// Reads all tiles, or unpacks them into a folder where one is given.
fn open_mosaic(
    found: &[Found],
    folder: Option<&Path>,
    progress: Progress<'_>,
) -> Result<Mosaic, MeshIoError> {
    let mut tiles = Vec::with_capacity(found.len());
    let mut archive = None;
    for tile in found {
        let unpack = |reader: &mut dyn Read| match folder {
            None => Ok(Samples::Here(read_samples(reader, tile)?)),
            Some(folder) => Samples::unpack(reader, tile, folder),
        };
        let samples = match &tile.archived {
            None if folder.is_some() => Samples::open(tile)?,
            None => unpack(&mut Input::open(&tile.path, &mut *progress)?)?,
            Some((path, number)) => {
                // Usually all tiles are in one archive.
                let (_, opened) = match archive.take() {
                    Some((open, opened)) if open == path => archive.insert((open, opened)),
                    _ => archive.insert((path, open_archive(path)?)),
                };
                let mut entry = opened.by_index(*number).map_err(|e| archive_error(&tile.path, e))?;
                unpack(&mut entry)?
            }
        };
        tiles.push(Tile { south: tile.south, west: tile.west, samples });
    }
    Ok(Mosaic::new(tiles, found[0].side))
}

fn find_in_archive(path: &Path, found: &mut Vec<Found>) -> Result<(), MeshIoError> {
    let before = found.len();
    let mut archive = open_archive(path)?;
    for number in 0..archive.len() {
        let entry = archive.by_index(number).map_err(|e| archive_error(path, e))?;
        let name = entry.name().map_err(|e| archive_error(path, e))?;
        let name = name.rsplit('/').next().unwrap_or("");
        // Archives made on a Mac have a hidden companion `._NAME` for each file.
        if extension(Path::new(name)) == "hgt" && !name.starts_with('.') {
            let mut tile = Found::new(path.join(input::shown(name)), entry.size())?;
            tile.archived = Some((path.to_owned(), number));
            found.push(tile);
        }
    }
    if found.len() == before { Err(MeshIoError::NoTiles { file: path.to_owned() }) } else { Ok(()) }
}

fn open_archive(path: &Path) -> Result<ZipArchive<BufReader<File>>, MeshIoError> {
    let file = input::open_file(path)?;
    ZipArchive::new(BufReader::new(file)).map_err(|e| archive_error(path, e))
}

fn archive_error(path: &Path, error: ZipError) -> MeshIoError {
    MeshIoError::Decode {
        file: path.to_owned(),
        place: Place::Byte(0),
        source: input::readable(error.into()),
    }
}

fn read_samples(reader: &mut dyn Read, tile: &Found) -> Result<Vec<i16>, MeshIoError> {
    let expected = 2 * tile.side * tile.side;
    let mut bytes = Vec::with_capacity(expected + 1);
    // Reading past the end is what makes an archive compare its checksum.
    let outcome = reader.take(expected as u64 + 1).read_to_end(&mut bytes);
    outcome.map_err(|e| input::read_error(&tile.path, Place::Byte(bytes.len() as u64), e))?;
    if bytes.len() != expected {
        return Err(MeshIoError::TileSize { file: tile.path.clone(), bytes: bytes.len() as u64 });
    }
    Ok(bytes.chunks_exact(2).map(|b| i16::from_be_bytes([b[0], b[1]])).collect())
}

/// Checks that sorted tiles are one mosaic.
fn check_mosaic(found: &[Found]) -> Result<(), MeshIoError> {
    for pair in found.windows(2) {
        let (file, other) = (pair[1].path.clone(), pair[0].path.clone());
        if (pair[1].south, pair[1].west) == (pair[0].south, pair[0].west) {
            return Err(MeshIoError::DuplicateTile { file, other });
        }
        if pair[1].side != pair[0].side {
            let (side, other_side) = (pair[1].side, pair[0].side);
            return Err(MeshIoError::TileResolution { file, side, other, other_side });
        }
    }
    for along in [|tile: &Found| tile.south, |tile: &Found| tile.west] {
        if let (Some(low), Some(high)) =
            (found.iter().min_by_key(|t| along(t)), found.iter().max_by_key(|t| along(t)))
            && along(high) - along(low) >= MAX_SPAN
        {
            return Err(MeshIoError::TilesTooFarApart { file: high.path.clone(), other: low.path.clone() });
        }
    }
    Ok(())
}

impl Found {
    fn new(path: PathBuf, bytes: u64) -> Result<Self, MeshIoError> {
        let Some((south, west)) = path.file_name().and_then(OsStr::to_str).and_then(south_west) else {
            return Err(MeshIoError::TileName { file: path });
        };
        let Some(side) = [1201, 3601].into_iter().find(|&side| bytes == 2 * (side * side) as u64) else {
            return Err(MeshIoError::TileSize { file: path, bytes });
        };
        Ok(Self { path, archived: None, south, west, side })
    }
}

/// The corner in a name such as `N36W118.hgt` or `s07e110.SRTMGL1.hgt`, as latitude and longitude in degrees.
fn south_west(name: &str) -> Option<(i32, i32)> {
    let corner = name.split('.').next()?.to_ascii_uppercase();
    if corner.len() != 7 || !corner.is_ascii() {
        return None;
    }
    let degrees = |word: &str, [plus, minus]: [char; 2], limit: i32| {
        let digits = word[1..].bytes().all(|b| b.is_ascii_digit()).then_some(&word[1..])?;
        let degrees: i32 = digits.parse().ok().filter(|&d| d <= limit)?;
        match word.chars().next()? {
            c if c == plus => Some(degrees),
            c if c == minus => Some(-degrees),
            _ => None,
        }
    };
    Some((degrees(&corner[..3], ['N', 'S'], 90)?, degrees(&corner[3..], ['E', 'W'], 180)?))
}

struct Tile {
    south: i32,
    west: i32,
    samples: Samples,
}

/// The samples of a tile, in rows from north to south.
enum Samples {
    /// In memory.
    Here(Vec<i16>),
    /// In a file, as many as there should be when it was opened.
    File { path: PathBuf, file: File },
}

impl Samples {
    fn open(tile: &Found) -> Result<Self, MeshIoError> {
        let file = input::open_file(&tile.path)?;
        Ok(Self::File { path: tile.path.clone(), file })
    }

    /// Unpacks into a temporary file.
    fn unpack(reader: &mut dyn Read, tile: &Found, folder: &Path) -> Result<Self, MeshIoError> {
        let mut file = tempfile::tempfile_in(folder).map_err(MeshIoError::Receiver)?;
        let bytes: Vec<u8> = read_samples(reader, tile)?.iter().flat_map(|s| s.to_be_bytes()).collect();
        file.write_all(&bytes).map_err(MeshIoError::Receiver)?;
        Ok(Self::File { path: tile.path.clone(), file })
    }

    /// Calls `take` with the samples of a row of `side`.
    fn read_row(&self, row: usize, side: usize, mut take: impl FnMut(usize, i16)) -> Result<(), MeshIoError> {
        match self {
            Self::Here(samples) => {
                samples[row * side..][..side].iter().enumerate().for_each(|(i, &s)| take(i, s));
            }
            Self::File { path, file } => {
                let mut bytes = vec![0; 2 * side];
                let start = 2 * (row * side) as u64;
                let mut file = file;
                let outcome = file.seek(SeekFrom::Start(start)).and_then(|_| file.read_exact(&mut bytes));
                outcome.map_err(|e| input::read_error(path, Place::Byte(start), e))?;
                let samples = bytes.chunks_exact(2).map(|b| i16::from_be_bytes([b[0], b[1]]));
                samples.enumerate().for_each(|(i, s)| take(i, s));
            }
        }
        Ok(())
    }
}

/// Tiles of one resolution, seen as one grid.
struct Mosaic {
    /// From north to south, and from west to east in each band of one latitude.
    tiles: Vec<Tile>,
    /// Cells along the side of a tile.
    cells: usize,
    /// Latitude of the southern edge of the northernmost band.
    top: i32,
    west: i32,
    bands: usize,
    columns: usize,
    /// Metres between samples.
    spacing: [f64; 2],
    degrees: DegreeMap,
}

impl Mosaic {
    /// `tiles` are sorted and at least one.
    #[expect(clippy::disallowed_methods, reason = "input, before there is anything to select")]
    fn new(tiles: Vec<Tile>, side: usize) -> Self {
        let (top, bottom) = (tiles[0].south, tiles[tiles.len() - 1].south);
        let west = tiles.iter().map(|t| t.west).min().unwrap_or(0);
        let east = tiles.iter().map(|t| t.west + 1).max().unwrap_or(0);
        let cells = side - 1;
        let middle = f64::midpoint(f64::from(top + 1), f64::from(bottom));
        let step = METRES_PER_DEGREE / cells as f64;
        let narrowing = middle.to_radians().cos();
        let longitude = f64::midpoint(f64::from(west), f64::from(east));
        Self {
            tiles,
            cells,
            top,
            west,
            bands: (top - bottom + 1) as usize,
            columns: (east - west) as usize * cells + 1,
            spacing: [step * narrowing, step],
            degrees: DegreeMap {
                longitude: if longitude > 180.0 { longitude - 360.0 } else { longitude },
                latitude: middle,
                metres_per_degree: [METRES_PER_DEGREE * narrowing, METRES_PER_DEGREE],
            },
        }
    }

    fn tiles_in_band(&self, band: usize) -> &[Tile] {
        let latitude = self.top - band as i32;
        let start = self.tiles.partition_point(|t| t.south > latitude);
        let end = self.tiles.partition_point(|t| t.south >= latitude);
        &self.tiles[start..end]
    }

    fn first_column(&self, tile: &Tile) -> usize {
        (tile.west - self.west) as usize * self.cells
    }
}

impl HeightGrid for Mosaic {
    fn rows(&self) -> usize {
        self.bands * self.cells + 1
    }

    fn columns(&self) -> usize {
        self.columns
    }

    fn read_row(&self, row: usize, heights: &mut [f32]) -> Result<(), MeshIoError> {
        heights.fill(f32::NAN);
        let side = self.cells + 1;
        let (band, within) = (row / self.cells, row % self.cells);
        // The first row of a band is also the last of the band to the north, which counts before it.
        let north = (within == 0 && band > 0).then(|| (band - 1, self.cells));
        for (band, row) in north.into_iter().chain([(band, within)]) {
            for tile in self.tiles_in_band(band) {
                let heights = &mut heights[self.first_column(tile)..];
                tile.samples.read_row(row, side, |column, sample| {
                    if heights[column].is_nan() && sample != VOID {
                        heights[column] = f32::from(sample);
                    }
                })?;
            }
        }
        Ok(())
    }

    fn cells(&self, row: usize) -> impl Iterator<Item = Range<usize>> {
        self.tiles_in_band(row / self.cells).iter().map(|tile| {
            let first = self.first_column(tile);
            first..first + self.cells
        })
    }

    fn position(&self, row: usize, column: usize, height: f32) -> [f32; 3] {
        let [x, y] = centred(self, row, column, self.spacing);
        [x, y, height]
    }
}

#[cfg(test)]
mod tests {
    use super::super::collector::Collector;
    use super::*;

    #[test]
    fn names() {
        assert_eq!(south_west("N36W118.hgt"), Some((36, -118)));
        assert_eq!(south_west("s07e110.SRTMGL1.hgt"), Some((-7, 110)));
        for name in [
            "N36W18.hgt",
            "N3+W118.hgt",
            "X36W118.hgt",
            "N36W1188.hgt",
            "N99W118.hgt",
            "N36W181.hgt",
            "é6W118.hgt",
            "",
        ] {
            assert_eq!(south_west(name), None, "{name}");
        }
    }

    /// 2 x 2 cells a tile, the south-eastern tile missing. Each sample tells its tile (hundreds), row and column.
    ///
    /// ```text
    ///   1 1 1 2 2
    ///   1 1 1 2 2     where tiles meet, 1 counts before 2 and both before 3;
    ///   1 1 1 2 2     the void of tile 1 on its edge is filled from tile 3
    ///   3 3 3
    ///   3 3 3
    /// ```
    #[test]
    #[expect(clippy::disallowed_methods, reason = "to compare with")]
    fn seams_have_one_owner_and_missing_tiles_are_holes() {
        let samples = |tile: i16| (0..9).map(move |i| 100 * tile + 10 * (i / 3) + i % 3).collect::<Vec<_>>();
        let mut with_void = samples(1);
        with_void[7] = VOID;
        let tiles = vec![
            Tile { south: 1, west: 0, samples: Samples::Here(with_void) },
            Tile { south: 1, west: 1, samples: Samples::Here(samples(2)) },
            Tile { south: 0, west: 0, samples: Samples::Here(samples(3)) },
        ];
        let mosaic = Mosaic::new(tiles, 3);
        let mut heights = [0.0; 5];
        let mut rows = Vec::new();
        for row in 0..mosaic.rows() {
            mosaic.read_row(row, &mut heights).unwrap();
            rows.push(heights.map(|h| if h.is_nan() { -1 } else { h as i32 }));
        }
        assert_eq!(
            rows,
            [
                [100, 101, 102, 201, 202],
                [110, 111, 112, 211, 212],
                [120, 301, 122, 221, 222],
                [310, 311, 312, -1, -1],
                [320, 321, 322, -1, -1],
            ]
        );
        let mut collector = Collector::default();
        terrain::send(&mosaic, Path::new(""), &mut collector, &mut |_, _| ()).unwrap();
        let mesh = collector.into_mesh();
        // No triangle spans the corner of the hole, though three samples around it are there.
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (21, 24));
        // Centred, and a degree is a degree.
        let (low, high) = mesh.bounding_box().unwrap();
        let degree = METRES_PER_DEGREE as f32;
        assert_eq!((low[1], high[1]), (-degree, degree));
        assert!((high[0] - degree * 1_f32.to_radians().cos()).abs() < 1.0 && low[0] == -high[0]);
    }
}
