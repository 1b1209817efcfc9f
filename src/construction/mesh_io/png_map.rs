//! Height maps as grey PNG. A transparent value, which is how raster tools write that there is no height, is a void.

use png::{BitDepth, ColorType, DecodingError, OutputInfo, Transformations};

use super::error::{MeshIoError, Place};
use super::input::Input;
use super::raster::{HeightScale, Location, MAX_COMPRESSION, Raster};

/// Reads a PNG of grey samples; smaller ones than 8 bits are scaled up to these.
pub(super) fn read(mut input: Input<'_>, scale: Option<HeightScale>) -> Result<Raster, MeshIoError> {
    let most = input.length.saturating_mul(MAX_COMPRESSION);
    let Image { info, colour, bytes } = decode(&mut input, most).map_err(|error| match error {
        DecodingError::IoError(error) => input.io(Place::Byte(input.position), error),
        error => input.decode(error),
    })?;
    // Of a grey file, only a transparent value makes an alpha channel.
    let channels = match (colour, info.color_type) {
        (ColorType::Grayscale, ColorType::Grayscale) => 1,
        (ColorType::Grayscale, ColorType::GrayscaleAlpha) => 2,
        _ => return Err(input.unsupported(format!("{colour:?} samples: a height map has to be grey"))),
    };
    let (width, range) = match info.bit_depth {
        BitDepth::Sixteen => (2, u16::MAX.into()),
        _ => (1, u8::MAX.into()),
    };
    let sample =
        |b: &[u8]| if width == 2 { f32::from(u16::from_be_bytes([b[0], b[1]])) } else { b[0].into() };
    let pixels = bytes.chunks_exact(width * channels);
    let heights = pixels.map(|b| if channels == 2 && b[width] == 0 { f32::NAN } else { sample(b) });
    let size = (info.width, info.height);
    Ok(Raster::new(size, heights.collect(), scale, Location::default(), Some(range)))
}

struct Image {
    info: OutputInfo,
    /// What the file has.
    colour: ColorType,
    bytes: Vec<u8>,
}

fn decode(input: &mut Input<'_>, most: u64) -> Result<Image, DecodingError> {
    let mut decoder = png::Decoder::new(input);
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info()?;
    let colour = reader.info().color_type;
    let bytes = reader.output_buffer_size().filter(|&bytes| bytes as u64 <= most);
    let mut buffer = vec![0; bytes.ok_or(DecodingError::LimitsExceeded)?];
    let info = reader.next_frame(&mut buffer)?;
    Ok(Image { info, colour, bytes: buffer })
}
