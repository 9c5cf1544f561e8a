//! Pictures in files: photographs upright, drawings replaced in one step.
//!
//! A telephone writes its sensor's rows as they come, and how it was held into EXIF's `Orientation` (JEITA CP-3451,
//! section 4.6.4); a reader of the file has to turn the picture. All measurements in a picture (pixels, width and
//! height, intrinsics) refer to the turned one.

use std::io::{BufRead, Cursor, Seek};
use std::ops::Deref;
use std::path::Path;

use image::metadata::Orientation;
use image::{
    DynamicImage, EncodableLayout, ImageBuffer, ImageDecoder, ImageError, ImageFormat, ImageReader,
    PixelWithColorType,
};

use crate::files::write_atomic;
use crate::{Error, Result};

/// Largest number of pixels of a picture: what a file claims is not believed beyond it, since a claim costs a few bytes
/// and its pixels all memory.
pub const MOST_PIXELS: u64 = 200_000_000;

/// Problem of a picture of this size, if it is too large to be decoded.
pub fn size_defect(width: u32, height: u32) -> Option<String> {
    (u64::from(width) * u64::from(height) > MOST_PIXELS).then(|| {
        format!(
            "claims {width} × {height} pixels; {} megapixels are the most; make it smaller",
            MOST_PIXELS / 1_000_000
        )
    })
}

/// Reads a picture upright.
///
/// # Errors
/// [`Error::File`] when the file cannot be opened, [`Error::File`] when it cannot be decoded.
pub fn read(path: &Path) -> Result<DynamicImage> {
    let mut decoder = decoder(path)?;
    let orientation = decoder.orientation().map_err(|e| undecodable(path, &e))?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(|e| undecodable(path, &e))?;
    picture.apply_orientation(orientation);
    Ok(picture)
}

/// Decodes a picture in memory as it is stored; `path` is for messages.
///
/// # Errors
/// [`Error::File`] when it cannot be decoded.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<DynamicImage> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    // Reading from memory does not fail.
    let reader = reader.map_err(Error::io(path))?;
    DynamicImage::from_decoder(checked(path, reader)?).map_err(|e| undecodable(path, &e))
}

/// Width and height of an upright picture, pixels, without decoding it.
///
/// # Errors
/// As [`read`].
pub fn size(path: &Path) -> Result<(u32, u32)> {
    let mut decoder = decoder(path)?;
    let (width, height) = decoder.dimensions();
    let orientation = decoder.orientation().map_err(|e| undecodable(path, &e))?;
    Ok(match orientation {
        Orientation::Rotate90
        | Orientation::Rotate270
        | Orientation::Rotate90FlipH
        | Orientation::Rotate270FlipH => (height, width),
        Orientation::NoTransforms
        | Orientation::Rotate180
        | Orientation::FlipHorizontal
        | Orientation::FlipVertical => (width, height),
    })
}

/// Tells whether a file holds its picture upright, so that its pixels need not be turned.
///
/// # Errors
/// As [`read`].
pub fn is_upright(path: &Path) -> Result<bool> {
    let orientation = decoder(path)?.orientation().map_err(|e| undecodable(path, &e))?;
    Ok(orientation == Orientation::NoTransforms)
}

/// Encodes a picture in the format that its file's name states.
///
/// # Errors
/// [`Error::File`] for a name that states no format.
pub fn encode<P, C>(path: &Path, picture: &ImageBuffer<P, C>) -> Result<Vec<u8>>
where
    P: PixelWithColorType,
    [P::Subpixel]: EncodableLayout,
    C: Deref<Target = [P::Subpixel]>,
{
    let refused = |e: &ImageError| {
        Error::content(path, "output", format!("cannot be written as a picture ({e}); name it .png or .jpg"))
    };
    let format = ImageFormat::from_path(path).map_err(|e| refused(&e))?;
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).map_err(|e| refused(&e))?;
    Ok(bytes.into_inner())
}

/// Writes a picture in the format that its file's name states, as [`write_atomic`] does.
///
/// # Errors
/// As [`encode`]; [`Error::File`] when the file cannot be written.
pub fn write<P, C>(path: &Path, picture: &ImageBuffer<P, C>) -> Result<()>
where
    P: PixelWithColorType,
    [P::Subpixel]: EncodableLayout,
    C: Deref<Target = [P::Subpixel]>,
{
    write_atomic(path, &encode(path, picture)?)
}

fn decoder(path: &Path) -> Result<impl ImageDecoder> {
    let reader = ImageReader::open(path).map_err(Error::io(path))?;
    checked(path, reader)
}

/// Decoder of a picture whose claimed size can be believed: the one door of all pictures in files.
fn checked<'a>(path: &Path, reader: ImageReader<impl BufRead + Seek + 'a>) -> Result<impl ImageDecoder + 'a> {
    let decoder = reader.into_decoder().map_err(|e| undecodable(path, &e))?;
    let (width, height) = decoder.dimensions();
    match size_defect(width, height) {
        None => Ok(decoder),
        Some(problem) => Err(Error::content(path, "image", problem)),
    }
}

fn undecodable(path: &Path, error: &ImageError) -> Error {
    Error::content(path, "image", format!("cannot be decoded ({error}); is the file whole?"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photograph::tests::{block, photograph_of};
    use exif::{Tag, Value};
    use image::{Rgb, RgbImage};
    use shell::files::FileError;

    /// Dark but for its upper left corner, wider than high.
    fn marked() -> RgbImage {
        RgbImage::from_fn(64, 32, |x, y| Rgb([if x < 16 && y < 16 { 250 } else { 10 }; 3]))
    }

    #[test]
    fn a_photograph_stands_as_it_was_taken() {
        let folder = tempfile::tempdir().unwrap();
        // EXIF's table of orientations: where the stored upper left corner belongs, and the upright size.
        for (orientation, corner, expected) in [
            (1, (8, 8), (64, 32)),
            (2, (56, 8), (64, 32)),
            (3, (56, 24), (64, 32)),
            (4, (8, 24), (64, 32)),
            (5, (8, 8), (32, 64)),
            (6, (24, 8), (32, 64)),
            (7, (24, 56), (32, 64)),
            (8, (8, 56), (32, 64)),
        ] {
            let told = block(&[(Tag::Orientation, Value::Short(vec![orientation]))]);
            let path = photograph_of(folder.path(), &marked(), &told);
            let picture = read(&path).unwrap().into_luma8();
            assert_eq!((picture.dimensions(), size(&path).unwrap()), (expected, expected), "{orientation}");
            for (x, y) in [(8, 8), (expected.0 - 8, 8), (8, expected.1 - 8), (expected.0 - 8, expected.1 - 8)]
            {
                assert_eq!(picture[(x, y)][0] > 128, (x, y) == corner, "{orientation}: {x} {y}");
            }
        }
    }

    #[test]
    fn files_that_are_no_pictures_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        assert!(
            matches!(read(&path), Err(Error::File(FileError::Io { .. })))
                && matches!(size(&path), Err(Error::File(FileError::Io { .. })))
        );
        std::fs::write(&path, "a poem").unwrap();
        for said in [read(&path).unwrap_err().to_string(), size(&path).unwrap_err().to_string()] {
            assert!(said.contains("a.png: image: cannot be decoded"), "{said}");
        }
    }

    /// A PNG file of a few bytes whose header claims a size.
    fn claiming(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        RgbImage::new(1, 1).write_to(&mut bytes, ImageFormat::Png).unwrap();
        let mut bytes = bytes.into_inner();
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        // CRC-32 of the chunk's name and content (ISO 3309), bit by bit.
        let crc = bytes[12..29].iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 * (crc & 1)))
        });
        bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
        bytes
    }

    #[test]
    fn a_picture_that_claims_too_many_pixels_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bomb.png");
        for (width, height, is_refused) in
            [(65_500, 65_500, true), (30_000, 30_000, true), (200_001, 1000, true), (3, 2, false)]
        {
            let bytes = claiming(width, height);
            std::fs::write(&path, &bytes).unwrap();
            let errors = [size(&path).map(drop), read(&path).map(drop), decode(&path, &bytes).map(drop)];
            for error in errors.into_iter().filter_map(std::result::Result::err) {
                let line = error.to_string();
                assert_eq!(line.contains("200 megapixels are the most"), is_refused, "{line}");
                assert!(line.contains("bomb.png: image"), "{line}");
            }
            assert_eq!(size(&path).is_err(), is_refused, "{width} × {height}");
        }
        // The largest picture itself is judged by its size alone.
        assert_eq!((size_defect(20_000, 10_000), size_defect(20_000, 10_001).is_some()), (None, true));
    }

    #[test]
    fn a_drawing_is_in_the_format_of_its_name() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "deep/b.jpg"] {
            let path = folder.path().join(name);
            write(&path, &marked()).unwrap();
            assert_eq!(read(&path).unwrap().into_rgb8().dimensions(), (64, 32), "{name}");
        }
        let nameless = folder.path().join("drawing");
        let said = write(&nameless, &marked()).unwrap_err().to_string();
        assert!(said.contains("drawing") && said.contains(".png"), "{said}");
        assert!(!nameless.exists());
    }
}
