//! A finished picture, and the PNG file.

use std::io;
use std::path::{Path, PathBuf};

use container::output;

/// A picture of 8-bit sRGB pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Red, green and blue of each pixel, row by row from the top left.
    pub rgb: Vec<u8>,
}

/// A picture could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The pixels do not fit the size, which must be at least 1 x 1.
    #[error("{width} x {height} pixels can not be made of {bytes} bytes: {source}")]
    Encode {
        /// As found.
        width: u32,
        /// As found.
        height: u32,
        /// As found.
        bytes: usize,
        /// What the encoder says.
        source: png::EncodingError,
    },
    /// The operating system said no.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl Image {
    /// The picture as the bytes of a PNG file.
    ///
    /// # Errors
    /// [`ImageError::Encode`].
    pub fn png_bytes(&self) -> Result<Vec<u8>, ImageError> {
        let encode = || {
            let mut bytes = Vec::new();
            let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            let mut writer = encoder.write_header()?;
            writer.write_image_data(&self.rgb)?;
            writer.finish()?;
            Ok(bytes)
        };
        encode().map_err(|source| ImageError::Encode {
            width: self.width,
            height: self.height,
            bytes: self.rgb.len(),
            source,
        })
    }

    /// Writes a PNG file, whole or not at all.
    ///
    /// # Errors
    /// [`ImageError`].
    pub fn write_png(&self, path: &Path) -> Result<(), ImageError> {
        let bytes = self.png_bytes()?;
        output::write(path, &bytes).map_err(|source| ImageError::Io { file: path.to_owned(), source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_comes_back_from_its_file() {
        let image = Image { width: 2, height: 2, rgb: (0..12).map(|i| 20 * i).collect() };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        image.write_png(&path).unwrap();
        let decoder = png::Decoder::new(io::BufReader::new(std::fs::File::open(&path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut rgb).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (2, 2, png::ColorType::Rgb));
        assert_eq!(rgb, image.rgb);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing temporary is left");
    }

    #[test]
    fn pixels_that_do_not_fit_are_an_error() {
        let image = Image { width: 2, height: 2, rgb: vec![0; 11] };
        assert!(matches!(image.png_bytes(), Err(ImageError::Encode { bytes: 11, .. })));
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error_with_its_name() {
        let image = Image { width: 1, height: 1, rgb: vec![0; 3] };
        let error = image.write_png(Path::new("/no such folder/picture.png")).unwrap_err();
        assert!(error.to_string().contains("no such folder"));
    }
}
