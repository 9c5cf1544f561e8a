//! `cameras.bin`, `images.bin` and `points3D.bin` of a COLMAP model: little endian, without a magic number.

use super::model::{Defect, MODELS, ModelCamera, ModelImage, ModelPoint, ModelPose};
use super::rigs::{Frame, FrameImage, Rig, Sensor};

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

    fn pose(&mut self) -> Parsed<ModelPose> {
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = self.f64()?;
        }
        Ok(ModelPose::of_numbers(numbers))
    }

    /// A sensor: whether it is a camera, and its number.
    fn sensor(&mut self) -> Parsed<(bool, u32)> {
        /// Number of the sensor type "camera"; others are no source of pictures.
        const CAMERA: u32 = 0;
        Ok((self.u32()? == CAMERA, self.u32()?))
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
        let id = u64::from(bytes.u32()?);
        let pose = bytes.pose()?;
        let camera = bytes.u32()?;
        let name = String::from_utf8_lossy(bytes.until_zero()?).into_owned();
        let sightings = bytes.u64()?;
        bytes.skip(sightings, SIGHTING_BYTES)?;
        pictures.push(ModelImage { id, name, camera, pose });
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

pub(super) fn rigs(bytes: &[u8]) -> Parsed<Vec<Rig>> {
    let mut bytes = Bytes { left: bytes, place: "number of rigs".into() };
    let count = bytes.u64()?;
    let mut rigs = Vec::new();
    for i in 1..=count {
        bytes.place = format!("rig {i} of {count}");
        let (id, sensors) = (bytes.u32()?, bytes.u32()?);
        let mut rig = Rig { id, cameras: Vec::new() };
        for number in 0..sensors {
            let (is_camera, camera) = bytes.sensor()?;
            // The first one is the rig's own frame.
            let pose = if number == 0 {
                Some(ModelPose::IDENTITY)
            } else if bytes.take::<1>()? == [0] {
                None
            } else {
                Some(bytes.pose()?)
            };
            if is_camera {
                rig.cameras.push(Sensor { camera, pose });
            }
        }
        rigs.push(rig);
    }
    Ok(rigs)
}

pub(super) fn frames(bytes: &[u8]) -> Parsed<Vec<Frame>> {
    let mut bytes = Bytes { left: bytes, place: "number of frames".into() };
    let count = bytes.u64()?;
    let mut frames = Vec::new();
    for i in 1..=count {
        bytes.place = format!("frame {i} of {count}");
        let (id, rig) = (bytes.u32()?, bytes.u32()?);
        let mut frame = Frame { id, rig, pose: bytes.pose()?, images: Vec::new() };
        for _ in 0..bytes.u32()? {
            let (is_camera, camera) = bytes.sensor()?;
            let image = bytes.u64()?;
            if is_camera {
                frame.images.push(FrameImage { camera, image });
            }
        }
        frames.push(frame);
    }
    Ok(frames)
}
