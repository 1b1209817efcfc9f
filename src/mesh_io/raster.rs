//! Height maps: grey PNG, and TIFF with the tags of GeoTIFF and GDAL.

use std::ops::Range;

use png::{BitDepth, ColorType, DecodingError, OutputInfo, Transformations};
use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{TiffError, TiffResult};

use super::hgt::METRES_PER_DEGREE;
use super::input::Input;
use super::terrain::HeightGrid;
use super::{HeightScale, MeshIoError, Place};

/// No compression that is read packs more than this many bytes into one: deflate reaches 1032, LZW about 1400.
const MAX_COMPRESSION: u64 = 1500;
/// What a height map without scale is given: the range of its sample type, as part of its longer side.
const DEFAULT_RELIEF: f64 = 1.0 / 16.0;
/// Marks a void in signed 16-bit heights, tagged as such or not.
const VOID: f32 = -32768.0;
/// GeoTIFF's key for the kind of coordinate system, and its value for latitude and longitude in degrees.
const MODEL_TYPE_KEY: u16 = 1024;
const MODEL_TYPE_GEOGRAPHIC: u16 = 2;

/// A height map in memory. Its middle is the origin, its first row the north.
pub(super) struct Raster {
    columns: usize,
    /// As in the file, NaN for voids.
    samples: Vec<f32>,
    /// Of columns and rows.
    spacing: [f64; 2],
    vertical: f64,
    offset: f64,
}

impl Raster {
    /// `scale` is the caller's, `own` the spacing that the file gives and `range` the greatest value of its sample
    /// type, if there is one.
    fn new(
        (columns, rows): (u32, u32),
        samples: Vec<f32>,
        scale: Option<HeightScale>,
        own: Option<[f64; 2]>,
        range: Option<f64>,
    ) -> Self {
        let (spacing, vertical, offset) = match (scale, own, range) {
            (Some(scale), _, _) => ([scale.spacing; 2], scale.vertical, scale.offset),
            (None, Some(own), _) => (own, 1.0, 0.0),
            (None, None, Some(range)) => {
                let side = f64::from(columns.max(rows).saturating_sub(1));
                ([1.0; 2], side * DEFAULT_RELIEF / range, 0.0)
            }
            (None, None, None) => ([1.0; 2], 1.0, 0.0),
        };
        Self { columns: columns as usize, samples, spacing, vertical, offset }
    }
}

/// Horizontal position of a sample about the middle of a grid.
pub(super) fn centred(grid: &impl HeightGrid, row: usize, column: usize, spacing: [f64; 2]) -> [f32; 2] {
    let from_middle = |at: usize, count: usize| at as f64 - (count - 1) as f64 / 2.0;
    let x = from_middle(column, grid.columns()) * spacing[0];
    let y = -from_middle(row, grid.rows()) * spacing[1];
    [x as f32, y as f32]
}

impl HeightGrid for Raster {
    fn rows(&self) -> usize {
        self.samples.len() / self.columns
    }

    fn columns(&self) -> usize {
        self.columns
    }

    fn read_row(&self, row: usize, heights: &mut [f32]) -> Result<(), MeshIoError> {
        for (height, &sample) in heights.iter_mut().zip(&self.samples[row * self.columns..]) {
            *height = (f64::from(sample) * self.vertical + self.offset) as f32;
        }
        Ok(())
    }

    fn cells(&self, _row: usize) -> impl Iterator<Item = Range<usize>> {
        std::iter::once(0..self.columns - 1)
    }

    fn position(&self, row: usize, column: usize, height: f32) -> [f32; 3] {
        let [x, y] = centred(self, row, column, self.spacing);
        [x, y, height]
    }
}

/// Reads a PNG of grey samples; smaller ones than 8 bits are scaled up to these.
pub(super) fn read_png(mut input: Input<'_>, scale: Option<HeightScale>) -> Result<Raster, MeshIoError> {
    let most = input.length.saturating_mul(MAX_COMPRESSION);
    let (image, bytes) = decode_png(&mut input, most).map_err(|error| match error {
        DecodingError::IoError(error) => input.io(Place::Byte(input.position), error),
        error => input.decode(error),
    })?;
    let (samples, range) = match (image.color_type, image.bit_depth) {
        (ColorType::Grayscale, BitDepth::Eight) => {
            (bytes.into_iter().map(f32::from).collect(), u8::MAX.into())
        }
        (ColorType::Grayscale, BitDepth::Sixteen) => {
            let samples = bytes.chunks_exact(2).map(|b| f32::from(u16::from_be_bytes([b[0], b[1]])));
            (samples.collect(), u16::MAX.into())
        }
        (colour, _) => {
            return Err(input.unsupported(format!("{colour:?} samples: a height map has to be grey")));
        }
    };
    Ok(Raster::new((image.width, image.height), samples, scale, None, Some(range)))
}

fn decode_png(input: &mut Input<'_>, most: u64) -> Result<(OutputInfo, Vec<u8>), DecodingError> {
    let mut decoder = png::Decoder::new(input);
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info()?;
    let bytes = reader.output_buffer_size().filter(|&bytes| bytes as u64 <= most);
    let mut buffer = vec![0; bytes.ok_or(DecodingError::LimitsExceeded)?];
    let image = reader.next_frame(&mut buffer)?;
    Ok((image, buffer))
}

/// What is read from a TIFF.
struct Tiff {
    columns: u32,
    rows: u32,
    colour: tiff::ColorType,
    samples: DecodingResult,
    /// In metres, or whatever unit the map has.
    spacing: Option<[f64; 2]>,
    void: Option<f32>,
}

/// Reads the first image of a TIFF: one channel of 8 or 16 bits unsigned, 16 bits signed, or floating point.
pub(super) fn read_tiff(mut input: Input<'_>, scale: Option<HeightScale>) -> Result<Raster, MeshIoError> {
    let most = input.length.saturating_mul(MAX_COMPRESSION);
    let Tiff { columns, rows, colour, samples, spacing, void } = decode_tiff(&mut input, most as usize)
        .map_err(|error| match error {
            TiffError::IoError(error) => input.io(Place::Byte(input.position), error),
            error => input.decode(error),
        })?;
    let (samples, range) = match samples {
        DecodingResult::U8(samples) => (without_voids(samples, &[void]), Some(u8::MAX.into())),
        DecodingResult::U16(samples) => (without_voids(samples, &[void]), Some(u16::MAX.into())),
        DecodingResult::I16(samples) => (without_voids(samples, &[void, Some(VOID)]), None),
        DecodingResult::F32(samples) => (without_voids(samples, &[void]), None),
        DecodingResult::F64(samples) => (without_voids(samples, &[void]), None),
        _ => {
            return Err(
                input.unsupported(format!("{colour:?} samples: heights are u8, u16, i16, f32 or f64"))
            );
        }
    };
    if !matches!(colour, tiff::ColorType::Gray(_))
        || samples.len() as u64 != u64::from(columns) * u64::from(rows)
    {
        return Err(input.unsupported(format!("{colour:?} samples: a height map has to be grey")));
    }
    Ok(Raster::new((columns, rows), samples, scale, spacing, range))
}

fn decode_tiff(input: &mut Input<'_>, most: usize) -> TiffResult<Tiff> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = most;
    limits.intermediate_buffer_size = most;
    let mut decoder = Decoder::new(input)?.with_limits(limits);
    let (columns, rows) = decoder.dimensions()?;
    let mut numbers = |tag| decoder.find_tag(tag)?.map(Value::into_f64_vec).transpose();
    let pixel_scale = numbers(Tag::ModelPixelScaleTag)?;
    let tie_point = numbers(Tag::ModelTiepointTag)?;
    let keys = decoder.find_tag(Tag::GeoKeyDirectoryTag)?.map(Value::into_u16_vec).transpose()?;
    let void = decoder.find_tag(Tag::GdalNodata)?.map(Value::into_string).transpose()?;
    let geographic = keys.is_some_and(|keys| {
        keys.chunks_exact(4).any(|key| (key[0], key[3]) == (MODEL_TYPE_KEY, MODEL_TYPE_GEOGRAPHIC))
    });
    let spacing = match pixel_scale.as_deref() {
        Some(&[x, y, ..]) if geographic => {
            // The tie point is column, row, 0, longitude, latitude, height.
            let latitude = match tie_point.as_deref() {
                Some(&[_, row, _, _, latitude, ..]) => latitude - (f64::from(rows) / 2.0 - row) * y,
                _ => 0.0,
            };
            Some([x * METRES_PER_DEGREE * latitude.to_radians().cos(), y * METRES_PER_DEGREE])
        }
        Some(&[x, y, ..]) => Some([x, y]),
        _ => None,
    };
    Ok(Tiff {
        columns,
        rows,
        colour: decoder.colortype()?,
        samples: decoder.read_image()?,
        spacing: spacing.filter(|spacing| spacing.iter().all(|&s| s.is_finite() && s > 0.0)),
        void: void.and_then(|text| text.trim_matches([' ', '\0']).parse::<f64>().ok()).map(|v| v as f32),
    })
}

fn without_voids<T: Into<f64>>(samples: Vec<T>, voids: &[Option<f32>]) -> Vec<f32> {
    let height = |sample: T| sample.into() as f32;
    samples.into_iter().map(height).map(|h| if voids.contains(&Some(h)) { f32::NAN } else { h }).collect()
}
