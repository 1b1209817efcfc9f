//! Height maps as TIFF: one channel of 8 or 16 bits unsigned, 16 bits signed, or floating point, with the tags of GeoTIFF
//! and GDAL.
//!
//! Samples are heights as they are stored, whether zero is black or white. Voids are samples of the value that GDAL's tag
//! names, what an internal mask masks, tiles and strips that a sparse file leaves out, and what can not be a height.

use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError, TiffResult};

use super::error::{MeshIoError, Place};
use super::geotiff::{self, GeoTags};
use super::input::Input;
use super::raster::{HeightScale, MAX_COMPRESSION, Raster};
use super::tiff_tags::Blackened;

/// Marks a void in signed 16-bit heights, tagged as such or not.
const VOID: f64 = -32768.0;
/// No floating point height is as large; writers of voids take the lowest or largest number that there is.
const NO_HEIGHT: f64 = 1e30;
const GDAL_METADATA: u16 = 42112;

type File<'f, 'a> = Decoder<Blackened<&'f mut Input<'a>>>;

/// Reads the first image of a TIFF.
pub(super) fn read(mut input: Input<'_>, scale: Option<HeightScale>) -> Result<Raster, MeshIoError> {
    let most = input.length.saturating_mul(MAX_COMPRESSION);
    let decoded = decode(&mut input, most as usize).map_err(|error| match error {
        TiffError::IoError(error) => input.io(Place::Byte(input.position), error),
        error => input.decode(error),
    })?;
    let Image { columns, rows, samples, range, tags } =
        decoded.map_err(|feature| input.unsupported(feature))?;
    let location = geotiff::locate(&tags, [columns, rows]).map_err(|feature| input.unsupported(feature))?;
    Ok(Raster::new((columns, rows), samples, scale, location, range))
}

/// What is read from a TIFF.
struct Image {
    columns: u32,
    rows: u32,
    /// NaN for voids.
    samples: Vec<f32>,
    /// The greatest value of the type, if it is unsigned.
    range: Option<f64>,
    tags: GeoTags,
}

/// The image, or what it has that is not read.
fn decode(input: &mut Input<'_>, most: usize) -> TiffResult<Result<Image, String>> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = most;
    limits.intermediate_buffer_size = most;
    let (file, mask) = Blackened::new(input)?;
    let mut file = Decoder::new(file)?.with_limits(limits);
    let (columns, rows) = file.dimensions()?;
    let colour = file.colortype()?;
    let ColorType::Gray(bits @ 8..) = colour else {
        return Ok(Err(format!("{colour:?} samples: a height map has to be grey")));
    };
    let size = columns as usize * rows as usize;
    if size.checked_mul(usize::from(bits / 8)).is_none_or(|bytes| bytes > most) {
        return Err(TiffError::LimitsExceeded);
    }
    let tags = geo_tags(&mut file)?;
    let void = file.find_tag(Tag::GdalNodata)?.map(Value::into_string).transpose()?;
    let void = void.and_then(|text| Void::new(&text));
    let mut samples = vec![f32::NAN; size];
    let mut range = None;
    let mut is_read = true;
    for_each_chunk(&mut file, |chunk, at| {
        let mut put = |i, height: f64, is_void: bool| {
            if !is_void {
                samples[at(i)] = height as f32;
            }
        };
        let is_tagged = |h: f64, is_float| void.as_ref().is_some_and(|void| void.is(h, is_float));
        let is_no_height = |h: f64| is_tagged(h, true) || h.is_finite() && h.abs() >= NO_HEIGHT;
        match chunk {
            DecodingResult::U8(chunk) => {
                range = Some(u8::MAX.into());
                let heights = chunk.iter().map(|&h| f64::from(h));
                heights.enumerate().for_each(|(i, h)| put(i, h, is_tagged(h, false)));
            }
            DecodingResult::U16(chunk) => {
                range = Some(u16::MAX.into());
                let heights = chunk.iter().map(|&h| f64::from(h));
                heights.enumerate().for_each(|(i, h)| put(i, h, is_tagged(h, false)));
            }
            DecodingResult::I16(chunk) => {
                let heights = chunk.iter().map(|&h| f64::from(h));
                heights.enumerate().for_each(|(i, h)| put(i, h, h == VOID || is_tagged(h, false)));
            }
            DecodingResult::F32(chunk) => {
                let heights = chunk.iter().map(|&h| f64::from(h));
                heights.enumerate().for_each(|(i, h)| put(i, h, is_no_height(h)));
            }
            DecodingResult::F64(chunk) => {
                chunk.iter().enumerate().for_each(|(i, &h)| put(i, h, is_no_height(h)));
            }
            _ => is_read = false,
        }
    })?;
    if !is_read {
        return Ok(Err(format!("{colour:?} samples: heights are u8, u16, i16, f32 or f64")));
    }
    if let Some(number) = mask {
        file.seek_to_image(number)?;
        if let Err(feature) = apply_mask(&mut file, (columns, rows), &mut samples)? {
            return Ok(Err(feature));
        }
    }
    Ok(Ok(Image { columns, rows, samples, range, tags }))
}

/// Makes voids of the samples that are 0 in an image of the same size, which has 1 or 8 bits a sample.
fn apply_mask(
    file: &mut File<'_, '_>,
    size: (u32, u32),
    samples: &mut [f32],
) -> TiffResult<Result<(), String>> {
    let mask_size = file.dimensions()?;
    let colour = file.colortype()?;
    let (ColorType::Gray(bits @ (1 | 8)), true) = (colour, mask_size == size) else {
        let (columns, rows) = mask_size;
        return Ok(Err(format!(
            "{colour:?} samples in a mask of {columns} x {rows}: a mask has 1 or 8 bits, and its image's size"
        )));
    };
    let mut is_shown = vec![false; samples.len()];
    for_each_chunk(file, |chunk, at| {
        let DecodingResult::U8(chunk) = chunk else { return };
        if bits == 8 {
            chunk.iter().enumerate().for_each(|(i, &value)| is_shown[at(i)] = value != 0);
        } else {
            // Eight to a byte, from the highest bit on; rows begin with a byte.
            chunk.iter().enumerate().for_each(|(i, &byte)| {
                (0..8).for_each(|bit| {
                    if let Some(shown) = is_shown.get_mut(at(8 * i + bit)) {
                        *shown = byte << bit & 0x80 != 0;
                    }
                });
            });
        }
    })?;
    for (sample, _) in samples.iter_mut().zip(is_shown).filter(|(_, shown)| !shown) {
        *sample = f32::NAN;
    }
    Ok(Ok(()))
}

/// Calls `take` with the samples of each tile or strip that is in the file, and with where each of them is in the image, row by row.
/// Of samples of less than a byte there may be more than have a place, which is beyond the end then.
fn for_each_chunk(
    file: &mut File<'_, '_>,
    mut take: impl FnMut(&DecodingResult, &dyn Fn(usize) -> usize),
) -> TiffResult<()> {
    let (columns, rows) = file.dimensions()?;
    let (width, height) = file.chunk_dimensions();
    let across = columns.div_ceil(width);
    let [offsets, lengths] = match file.get_chunk_type() {
        tiff::decoder::ChunkType::Strip => [Tag::StripOffsets, Tag::StripByteCounts],
        tiff::decoder::ChunkType::Tile => [Tag::TileOffsets, Tag::TileByteCounts],
    };
    let offsets = file.get_tag_u64_vec(offsets)?;
    let lengths = file.get_tag_u64_vec(lengths)?;
    let is_packed = matches!(file.colortype()?, ColorType::Gray(1));
    for number in 0..across * rows.div_ceil(height) {
        let at = |list: &[u64]| list.get(number as usize).copied().unwrap_or(0);
        if at(&offsets) == 0 || at(&lengths) == 0 {
            continue;
        }
        let chunk = file.read_chunk(number)?;
        let (wide, _) = file.chunk_data_dimensions(number);
        let first = (number / across) as usize * height as usize * columns as usize
            + (number % across) as usize * width as usize;
        let wide = wide as usize;
        let stride = if is_packed { wide.next_multiple_of(8) } else { wide };
        take(&chunk, &|i| {
            if i % stride < wide { first + i / stride * columns as usize + i % stride } else { usize::MAX }
        });
    }
    Ok(())
}

fn geo_tags(file: &mut File<'_, '_>) -> TiffResult<GeoTags> {
    let mut numbers = |tag| file.find_tag(tag)?.map(Value::into_f64_vec).transpose();
    let pixel_scale = numbers(Tag::ModelPixelScaleTag)?.unwrap_or_default();
    let tie_points = numbers(Tag::ModelTiepointTag)?.unwrap_or_default();
    let transformation = numbers(Tag::ModelTransformationTag)?.unwrap_or_default();
    let doubles = numbers(Tag::GeoDoubleParamsTag)?.unwrap_or_default();
    let keys = file.find_tag(Tag::GeoKeyDirectoryTag)?.map(Value::into_u16_vec).transpose()?;
    // What is no text says nothing.
    let mut text = |tag| Ok::<_, TiffError>(file.find_tag(tag)?.and_then(|value| value.into_string().ok()));
    let ascii = text(Tag::GeoAsciiParamsTag)?.unwrap_or_default();
    let metadata = text(Tag::Unknown(GDAL_METADATA))?.unwrap_or_default();
    let keys = keys.unwrap_or_default();
    Ok(GeoTags { pixel_scale, tie_points, transformation, keys, doubles, ascii, metadata })
}

/// The value that marks voids, as text says it.
struct Void {
    value: f64,
    /// Half a unit of the last digit, if there are so many that others may have been left away.
    slack: f64,
}

/// As many digits as `%g` writes.
const SHORTENED_DIGITS: usize = 6;

impl Void {
    #[expect(clippy::disallowed_methods, reason = "input, before there is anything to select")]
    fn new(text: &str) -> Option<Self> {
        let text = text.trim_matches(|c: char| c == '\0' || c.is_ascii_whitespace());
        let value: f64 = text.parse().ok()?;
        let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
        let digits = mantissa.bytes().filter(u8::is_ascii_digit).count();
        let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        let is_shortened = digits >= SHORTENED_DIGITS && (decimals > 0 || text.len() > mantissa.len());
        let last_digit = exponent.parse::<i32>().unwrap_or(0).saturating_sub(decimals as i32);
        // Halves come out a bit wider than they are.
        let slack = if is_shortened { 0.500_001 * 10_f64.powi(last_digit) } else { 0.0 };
        Some(Self { value, slack })
    }

    fn is(&self, height: f64, is_float: bool) -> bool {
        height as f32 == self.value as f32 || is_float && (height - self.value).abs() <= self.slack
    }
}
