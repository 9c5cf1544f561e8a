//! The lens stated by a photograph's EXIF block (JEITA CP-3451, "Exchangeable image file format").

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use exif::{Exif, In, Reader, Tag, Value};

use crate::{Error, Result};

/// Diagonal of a 36 × 24 mm frame: the reference of a focal length "in 35 mm film".
const FILM_DIAGONAL_MM: f64 = 43.266_615;
/// Plausible horizontal angles of view; lenses beyond them are mistakes, or fisheyes.
const FIELD_OF_VIEW_DEG: std::ops::RangeInclusive<f64> = 5.0..=130.0;

/// Focal length in pixels of a photograph of `width_px` × `height_px`; `None` where EXIF states none.
///
/// `FocalLengthIn35mmFilm` is used, or `FocalLength` with the sensor's resolution in the focal plane.
///
/// # Errors
/// [`Error::File`] for an EXIF block that cannot be read, and for a focal length that no camera for rooms has.
pub fn focal_px(photograph: &Path, [width_px, height_px]: [u32; 2]) -> Result<Option<f64>> {
    let told = |problem: String| Error::content(photograph, "EXIF", problem);
    let file = File::open(photograph).map_err(Error::io(photograph))?;
    let exif = match Reader::new().read_from_container(&mut BufReader::new(file)) {
        Ok(exif) => exif,
        Err(exif::Error::NotFound(_)) => return Ok(None),
        Err(error) => return Err(told(format!("cannot be read ({error})"))),
    };
    let [width, height] = [width_px, height_px].map(f64::from);
    let from_film = film_focal_mm(&exif).map(|mm| mm / FILM_DIAGONAL_MM * width.hypot(height));
    let Some(focal) = from_film.or_else(|| on_sensor(&exif, width.max(height))) else { return Ok(None) };
    let field_of_view_deg = 2.0 * (0.5 * width / focal).atan().to_degrees();
    if focal > 0.0 && FIELD_OF_VIEW_DEG.contains(&field_of_view_deg) {
        return Ok(Some(focal));
    }
    Err(told(format!("its focal length would be {focal:.1} pixels, which no camera for rooms has")))
}

/// Focal length on 35 mm film, mm; EXIF's 0 stands for unknown and gives `None`.
fn film_focal_mm(exif: &Exif) -> Option<f64> {
    let told = exif.get_field(Tag::FocalLengthIn35mmFilm, In::PRIMARY)?.value.get_uint(0)?;
    (told > 0).then(|| f64::from(told))
}

/// Focal length, pixels, from the lens's own focal length and the sensor's pixels; the photograph may have been made
/// smaller since.
fn on_sensor(exif: &Exif, longer_side_px: f64) -> Option<f64> {
    let millimetres = positive(exif, Tag::FocalLength)?;
    let in_a_unit = positive(exif, Tag::FocalPlaneXResolution)?;
    let unit = exif.get_field(Tag::FocalPlaneResolutionUnit, In::PRIMARY);
    let unit_mm = match unit.and_then(|field| field.value.get_uint(0)) {
        None | Some(2) => 25.4,
        Some(3) => 10.0,
        Some(4) => 1.0,
        Some(5) => 1e-3,
        Some(_) => return None,
    };
    let side = |tag| exif.get_field(tag, In::PRIMARY)?.value.get_uint(0).filter(|px| *px > 0).map(f64::from);
    let filmed_px = side(Tag::PixelXDimension).into_iter().chain(side(Tag::PixelYDimension)).reduce(f64::max);
    let smaller = filmed_px.map_or(1.0, |filmed_px| longer_side_px / filmed_px);
    Some(millimetres * in_a_unit / unit_mm * smaller)
}

fn positive(exif: &Exif, tag: Tag) -> Option<f64> {
    let Value::Rational(values) = &exif.get_field(tag, In::PRIMARY)?.value else { return None };
    values.first().map(exif::Rational::to_f64).filter(|v| v.is_finite() && *v > 0.0)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use exif::experimental::Writer;
    use exif::{Field, Rational};
    use image::RgbImage;
    use shell::files::FileError;

    fn photograph(folder: &Path, block: &[u8]) -> std::path::PathBuf {
        photograph_of(folder, &RgbImage::new(64, 48), block)
    }

    /// A photograph with these pixels and this EXIF block.
    pub(crate) fn photograph_of(folder: &Path, shown: &RgbImage, block: &[u8]) -> std::path::PathBuf {
        let mut jpeg = Vec::new();
        let encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
        shown.write_with_encoder(encoder).unwrap();
        let mut content = jpeg[..2].to_vec();
        if !block.is_empty() {
            content.extend([0xff, 0xe1]);
            content.extend((block.len() as u16 + 8).to_be_bytes());
            content.extend(b"Exif\0\0");
            content.extend(block);
        }
        content.extend(&jpeg[2..]);
        let path = folder.join("photograph.jpg");
        std::fs::write(&path, content).unwrap();
        path
    }

    pub(crate) fn block(values: &[(Tag, Value)]) -> Vec<u8> {
        let fields: Vec<Field> = values
            .iter()
            .map(|(tag, value)| Field { tag: *tag, ifd_num: In::PRIMARY, value: value.clone() })
            .collect();
        let mut writer = Writer::new();
        for field in &fields {
            writer.push_field(field);
        }
        let mut bytes = std::io::Cursor::new(Vec::new());
        writer.write(&mut bytes, false).unwrap();
        bytes.into_inner()
    }

    fn rational(num: u32, denom: u32) -> Value {
        Value::Rational(vec![Rational { num, denom }])
    }

    fn told(values: &[(Tag, Value)]) -> Result<Option<f64>> {
        let folder = tempfile::tempdir().unwrap();
        focal_px(&photograph(folder.path(), &block(values)), [640, 480])
    }

    #[test]
    fn film_and_sensor_tell_the_same_lens() {
        // A 4 mm lens before a sensor of 6.4 × 4.8 mm, 8 mm across, is one of 4 / 8 × 43.27 = 21.6 mm on film.
        let film = told(&[(Tag::FocalLengthIn35mmFilm, Value::Short(vec![22]))]).unwrap().unwrap();
        let sensor = |unit, resolution| {
            [
                (Tag::FocalLength, rational(40, 10)),
                (Tag::FocalPlaneXResolution, resolution),
                (Tag::FocalPlaneResolutionUnit, Value::Short(vec![unit])),
                (Tag::PixelXDimension, Value::Long(vec![6400])),
                (Tag::PixelYDimension, Value::Long(vec![4800])),
            ]
        };
        assert!((film - 406.8).abs() < 0.1, "{film}");
        for (unit, resolution) in [(2, rational(25400, 1)), (3, rational(10000, 1)), (4, rational(1000, 1))] {
            let focal = told(&sensor(unit, resolution)).unwrap().unwrap();
            assert!((focal - 400.0).abs() < 1e-6, "unit {unit}: {focal}");
        }
        let mut both = sensor(3, rational(10000, 1)).to_vec();
        both.push((Tag::FocalLengthIn35mmFilm, Value::Short(vec![0])));
        assert!((told(&both).unwrap().unwrap() - 400.0).abs() < 1e-6, "0 on film is unknown");
    }

    #[test]
    fn exif_without_a_focal_length_gives_none() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(focal_px(&photograph(folder.path(), &[]), [640, 480]).unwrap(), None);
        let png = folder.path().join("plain.png");
        RgbImage::new(8, 6).save(&png).unwrap();
        assert_eq!(focal_px(&png, [8, 6]).unwrap(), None);
        let nothing: [&[(Tag, Value)]; 5] = [
            &[(Tag::FocalLengthIn35mmFilm, Value::Short(vec![0]))],
            &[(Tag::FocalLengthIn35mmFilm, Value::Ascii(vec![b"wide".to_vec()]))],
            &[(Tag::FocalLength, rational(40, 10))],
            &[(Tag::FocalLength, rational(4, 0)), (Tag::FocalPlaneXResolution, rational(1000, 1))],
            &[(Tag::FocalLength, rational(0, 1)), (Tag::FocalPlaneXResolution, rational(1000, 1))],
        ];
        for values in nothing {
            assert_eq!(told(values).unwrap(), None, "{values:?}");
        }
    }

    #[test]
    fn impossible_exif_is_refused_with_its_place() {
        for absurd in [1, 900, 65535] {
            let error = told(&[(Tag::FocalLengthIn35mmFilm, Value::Short(vec![absurd]))]).unwrap_err();
            assert!(error.to_string().contains("photograph.jpg: EXIF"), "{absurd}: {error}");
        }
        let folder = tempfile::tempdir().unwrap();
        let whole = block(&[(Tag::FocalLengthIn35mmFilm, Value::Short(vec![26]))]);
        for broken in [&b"II*\0\xff\xff\xff\xff"[..], b"no TIFF at all", &whole[..9]] {
            let error = focal_px(&photograph(folder.path(), broken), [640, 480]).unwrap_err();
            assert!(error.to_string().contains("EXIF"), "{error}");
        }
        assert!(matches!(
            focal_px(&folder.path().join("gone.jpg"), [640, 480]),
            Err(Error::File(FileError::Io { .. }))
        ));
    }
}
