//! `cameras.bin`, `images.bin` and `points3D.bin` of a COLMAP model: little endian, without a magic number.

use super::model::{Defect, MODELS, ModelCamera, ModelImage, ModelPoint};

type Parsed<T> = Result<T, Defect>;

/// The unread rest of a file.
struct Bytes<'a> {
    left: &'a [u8],
    place: String,
}

impl<'a> Bytes<'a> {
    fn cut_off(&self) -> Defect {
        (self.place.clone(), "the file ends here; copy it again".into())
    }

    fn take<const N: usize>(&mut self) -> Parsed<[u8; N]> {
        let (head, left) = self.left.split_first_chunk().ok_or_else(|| self.cut_off())?;
        self.left = left;
        Ok(*head)
    }

    fn skip(&mut self, count: u64, size: usize) -> Parsed<()> {
        let length = usize::try_from(count).ok().and_then(|count| count.checked_mul(size));
        let left = length.and_then(|length| self.left.get(length..));
        self.left = left.ok_or_else(|| self.cut_off())?;
        Ok(())
    }

    fn until_zero(&mut self) -> Parsed<&'a [u8]> {
        let end = self.left.iter().position(|b| *b == 0).ok_or_else(|| self.cut_off())?;
        let (text, left) = self.left.split_at(end);
        self.left = &left[1..];
        Ok(text)
    }

    fn u32(&mut self) -> Parsed<u32> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn u64(&mut self) -> Parsed<u64> {
        Ok(u64::from_le_bytes(self.take()?))
    }

    fn f64(&mut self) -> Parsed<f64> {
        Ok(f64::from_le_bytes(self.take()?))
    }
}

pub(super) fn cameras(bytes: &[u8]) -> Parsed<Vec<ModelCamera>> {
    let mut bytes = Bytes { left: bytes, place: "number of cameras".into() };
    let count = bytes.u64()?;
    let mut cameras = Vec::new();
    for i in 1..=count {
        bytes.place = format!("camera {i} of {count}");
        let id = bytes.u32()?;
        let number = i32::from_le_bytes(bytes.take()?);
        let Some(model) = MODELS.iter().find(|m| m.id == number) else {
            let problem = format!(
                "camera model {number} is none of COLMAP's (0 to {}); is the file whole?",
                MODELS.len() - 1
            );
            return Err((bytes.place, problem));
        };
        let (width, height) = (bytes.u64()?, bytes.u64()?);
        let parameters = (0..model.parameters).map(|_| bytes.f64()).collect::<Parsed<_>>()?;
        cameras.push(ModelCamera { id, model, width, height, parameters });
    }
    Ok(cameras)
}

pub(super) fn pictures(bytes: &[u8]) -> Parsed<Vec<ModelImage>> {
    /// A sighting: two pixels and the number of its point.
    const SIGHTING_BYTES: usize = 24;
    let mut bytes = Bytes { left: bytes, place: "number of images".into() };
    let count = bytes.u64()?;
    let mut pictures = Vec::new();
    for i in 1..=count {
        bytes.place = format!("image {i} of {count}");
        bytes.u32()?;
        let rotation = [bytes.f64()?, bytes.f64()?, bytes.f64()?, bytes.f64()?];
        let translation = [bytes.f64()?, bytes.f64()?, bytes.f64()?];
        let camera = bytes.u32()?;
        let name = String::from_utf8_lossy(bytes.until_zero()?).into_owned();
        let sightings = bytes.u64()?;
        bytes.skip(sightings, SIGHTING_BYTES)?;
        pictures.push(ModelImage { name, camera, rotation, translation });
    }
    Ok(pictures)
}

pub(super) fn points(bytes: &[u8]) -> Parsed<Vec<ModelPoint>> {
    /// A sighting: the numbers of its picture and of its pixel there.
    const SIGHTING_BYTES: usize = 8;
    let mut bytes = Bytes { left: bytes, place: "number of points".into() };
    let count = bytes.u64()?;
    let mut points = Vec::new();
    for i in 1..=count {
        bytes.place = format!("point {i} of {count}");
        bytes.u64()?;
        let place = [bytes.f64()?, bytes.f64()?, bytes.f64()?];
        let color = bytes.take()?;
        let _error_px = bytes.f64()?;
        let sightings = bytes.u64()?;
        bytes.skip(sightings, SIGHTING_BYTES)?;
        points.push(ModelPoint { place, color });
    }
    Ok(points)
}
