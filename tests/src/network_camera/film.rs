//! Film of a camera: its pictures, encoded before it starts.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use calib::video::FrameSource;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{FilterType, resize};

use super::stamp;
use crate::chain::StepResult;

/// Quality of the JPEGs, 1 to 100, as cameras choose it.
const QUALITY: u8 = 85;

/// A film as JPEGs in the order in which they are played.
#[derive(Debug, Clone)]
pub struct Film {
    /// JPEGs at the pictures' own size.
    jpegs: Jpegs,
    /// JPEGs at the other sizes that the camera can switch to.
    resized: BTreeMap<(u32, u32), Jpegs>,
}

/// JPEG for each place of the film, and the black one.
#[derive(Debug, Clone)]
struct Jpegs {
    places: Vec<Arc<[u8]>>,
    black: Arc<[u8]>,
}

impl Film {
    /// Encodes pictures of one size, played in the order of `order` (indices into `pictures`, which may be repeated).
    /// Stamped films have each place's number painted into its picture (see [`stamp`]).
    ///
    /// # Errors
    /// No pictures, an index beyond them, or too many places to number.
    pub fn encode(pictures: &[RgbImage], order: &[usize], is_stamped: bool) -> StepResult<Self> {
        if order.is_empty() || order.iter().any(|place| *place >= pictures.len()) {
            return Err("a film needs places, and a picture for each".into());
        }
        if is_stamped && order.len() > stamp::MAX_NUMBER as usize + 1 {
            return Err(format!("{} places are too many to be numbered", order.len()));
        }
        Ok(Self { jpegs: Jpegs::encode(pictures, order, is_stamped)?, resized: BTreeMap::new() })
    }

    /// Encodes the film at further sizes, too, for cameras whose pictures change their size: width and height in
    /// pixels.
    ///
    /// # Errors
    /// As [`Self::encode`], with the same arguments.
    pub fn encode_with_sizes(
        pictures: &[RgbImage],
        order: &[usize],
        is_stamped: bool,
        sizes: &[(u32, u32)],
    ) -> StepResult<Self> {
        let mut film = Self::encode(pictures, order, is_stamped)?;
        for (width, height) in sizes {
            let scaled = pictures.iter().map(|p| resize(p, *width, *height, FilterType::Triangle));
            let jpegs = Jpegs::encode(&scaled.collect::<Vec<_>>(), order, is_stamped)?;
            film.resized.insert((*width, *height), jpegs);
        }
        Ok(film)
    }

    /// Decodes every frame of a video.
    ///
    /// # Errors
    /// As [`FrameSource`].
    pub fn frames(video: &Path) -> StepResult<Vec<RgbImage>> {
        let spec = video.to_str().ok_or("the video's path is not UTF-8")?;
        let mut source = FrameSource::open(spec).map_err(|e| e.to_string())?;
        source.read_all().map_err(|e| e.to_string())
    }

    /// Whether the film has pictures of that size beside its own.
    pub(super) fn has_size(&self, size: (u32, u32)) -> bool {
        self.resized.contains_key(&size)
    }

    /// Number of places.
    #[allow(clippy::len_without_is_empty)] // There is at least one.
    pub fn len(&self) -> usize {
        self.jpegs.places.len()
    }

    /// The picture at a place, or the black one, at the film's size or at another that was prepared.
    pub(super) fn picture(&self, place: Option<usize>, size: Option<(u32, u32)>) -> Option<&[u8]> {
        let jpegs = match size {
            None => &self.jpegs,
            Some(size) => self.resized.get(&size)?,
        };
        match place {
            None => Some(&jpegs.black),
            Some(place) => jpegs.places.get(place).map(|jpeg| &**jpeg),
        }
    }
}

impl Jpegs {
    fn encode(pictures: &[RgbImage], order: &[usize], is_stamped: bool) -> StepResult<Self> {
        let places = if is_stamped {
            let mut places = Vec::with_capacity(order.len());
            for (number, picture) in order.iter().enumerate() {
                let mut picture = pictures[*picture].clone();
                stamp::paint(&mut picture, number as u32);
                places.push(jpeg(&picture)?);
            }
            places
        } else {
            let encoded = pictures.iter().map(jpeg).collect::<StepResult<Vec<_>>>()?;
            order.iter().map(|picture| Arc::clone(&encoded[*picture])).collect()
        };
        let (width, height) = pictures[order[0]].dimensions();
        Ok(Self { places, black: jpeg(&RgbImage::new(width, height))? })
    }
}

fn jpeg(picture: &RgbImage) -> StepResult<Arc<[u8]>> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(picture).map_err(|e| e.to_string())?;
    Ok(bytes.into())
}
