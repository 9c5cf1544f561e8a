//! Pictures in files: photographs upright, drawings replaced in one step.
//!
//! A telephone writes its sensor's rows as they come, and how it was held into EXIF's `Orientation` (JEITA CP-3451,
//! section 4.6.4); a reader of the file has to turn the picture. All measurements in a picture (pixels, width and
//! height, intrinsics) refer to the turned one.

use std::io::Cursor;
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, RgbImage};

use crate::files::write_atomic;
use crate::{Error, Result};

/// Reads a picture upright.
///
/// # Errors
/// [`Error::Io`] when the file cannot be opened, [`Error::Content`] when it cannot be decoded.
pub fn read(path: &Path) -> Result<DynamicImage> {
    let mut decoder = decoder(path)?;
    let orientation = decoder.orientation().map_err(|e| undecodable(path, &e))?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(|e| undecodable(path, &e))?;
    picture.apply_orientation(orientation);
    Ok(picture)
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
/// [`Error::Content`] for a name that states no format.
pub fn encode(path: &Path, picture: &RgbImage) -> Result<Vec<u8>> {
    let refused = |e: &ImageError| Error::Content {
        path: path.to_owned(),
        place: "output".into(),
        problem: format!("cannot be written as a picture ({e}); name it .png or .jpg"),
    };
    let format = ImageFormat::from_path(path).map_err(|e| refused(&e))?;
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).map_err(|e| refused(&e))?;
    Ok(bytes.into_inner())
}

/// Writes a picture in the format that its file's name states, as [`write_atomic`] does.
///
/// # Errors
/// As [`encode`]; [`Error::Io`] when the file cannot be written.
pub fn write(path: &Path, picture: &RgbImage) -> Result<()> {
    write_atomic(path, &encode(path, picture)?)
}

fn decoder(path: &Path) -> Result<impl ImageDecoder> {
    let reader = ImageReader::open(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    reader.into_decoder().map_err(|e| undecodable(path, &e))
}

fn undecodable(path: &Path, error: &ImageError) -> Error {
    Error::Content {
        path: path.to_owned(),
        place: "image".into(),
        problem: format!("cannot be decoded ({error}); is the file whole?"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photograph::tests::{block, photograph_of};
    use exif::{Tag, Value};
    use image::Rgb;

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
        assert!(matches!(read(&path), Err(Error::Io { .. })) && matches!(size(&path), Err(Error::Io { .. })));
        std::fs::write(&path, "a poem").unwrap();
        for said in [read(&path).unwrap_err().to_string(), size(&path).unwrap_err().to_string()] {
            assert!(said.contains("a.png: image: cannot be decoded"), "{said}");
        }
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
