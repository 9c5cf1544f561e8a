//! OpenCV's adaptive background models: MOG2 (Zivkovic 2004, a mixture of Gaussians a pixel) and KNN (Zivkovic & van
//! der Heijden 2006, a bag of samples a pixel), both with the shadow test of Prati et al. 2003.

use image::{GrayImage, RgbImage};
use opencv::core::{Mat, Ptr};
use opencv::prelude::*;
use opencv::video;

use super::adapter;
use crate::Result;

/// Kind of adaptive background model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AdaptiveKind {
    /// A mixture of Gaussians for each pixel.
    #[default]
    Mog2,
    /// The nearest of a bag of past samples for each pixel: about twice the time of MOG2.
    Knn,
}

/// An adaptive background model of one camera.
pub struct AdaptiveBackground {
    model: AdaptiveModel,
    /// Buffer for the background image that OpenCV returns.
    picture: Mat,
}

enum AdaptiveModel {
    Mog2(Ptr<video::BackgroundSubtractorMOG2>),
    Knn(Ptr<video::BackgroundSubtractorKNN>),
}

/// Label that [`AdaptiveBackground::label`] writes for shadow.
pub const SHADOW: u8 = 127;

impl AdaptiveBackground {
    /// A model that remembers about `history` learnt frames.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn new(kind: AdaptiveKind, history: u32) -> Result<Self> {
        let making = adapter::refused("making a background model");
        let history = history.clamp(1, 100_000) as i32;
        // The squared distances at which a pixel leaves the background are OpenCV's own defaults.
        let model = match kind {
            AdaptiveKind::Mog2 => AdaptiveModel::Mog2(
                video::create_background_subtractor_mog2(history, 16.0, true).map_err(&making)?,
            ),
            AdaptiveKind::Knn => AdaptiveModel::Knn(
                video::create_background_subtractor_knn(history, 400.0, true).map_err(&making)?,
            ),
        };
        Ok(Self { model, picture: Mat::default() })
    }

    /// Labels every pixel: 0 background, [`SHADOW`] shadow, 255 foreground, and learns from the frame at `rate` (0: not
    /// at all, 1: forget everything before it). The first frame must be learnt.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses, for example for a frame of another size than the first.
    pub fn label(&mut self, image: &RgbImage, rate: f64, into: &mut GrayImage) -> Result<()> {
        let labelling = adapter::refused("updating a background model");
        if into.dimensions() != image.dimensions() {
            *into = GrayImage::new(image.width(), image.height());
        }
        let frame = adapter::rgb(image)?;
        let mut labels = adapter::gray_mut(into)?;
        match &mut self.model {
            AdaptiveModel::Mog2(m) => BackgroundSubtractorMOG2Trait::apply(m, &frame, &mut labels, rate),
            AdaptiveModel::Knn(m) => BackgroundSubtractorTrait::apply(m, &frame, &mut labels, rate),
        }
        .map_err(labelling)
    }

    /// Background image in the model's present state.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when nothing has been learnt yet.
    pub fn picture(&mut self, into: &mut RgbImage) -> Result<()> {
        let looking = adapter::refused("looking at a learnt background");
        match &self.model {
            AdaptiveModel::Mog2(m) => m.get_background_image(&mut self.picture),
            AdaptiveModel::Knn(m) => m.get_background_image(&mut self.picture),
        }
        .map_err(&looking)?;
        let size = (self.picture.cols() as u32, self.picture.rows() as u32);
        if into.dimensions() != size {
            *into = RgbImage::new(size.0, size.1);
        }
        // The model was trained with red first, so no channels are exchanged here.
        self.picture.copy_to(&mut adapter::rgb_mut(into)?).map_err(&looking)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// A room with a bright square in it, and a little noise that repeats every seven frames.
    fn frame(index: u32, square: Option<u32>) -> RgbImage {
        RgbImage::from_fn(96, 64, |u, v| {
            let noise = ((u * 7 + v * 13 + index * 29) % 7) as u8;
            let inside = square.is_some_and(|left| (left..left + 16).contains(&u) && (20..50).contains(&v));
            if inside { Rgb([200 + noise, 40, 40]) } else { Rgb([90 + noise, 110 + noise, 100]) }
        })
    }

    #[test]
    fn both_models_find_what_was_not_there_before_and_remember_what_was() {
        for kind in [AdaptiveKind::Mog2, AdaptiveKind::Knn] {
            let mut model = AdaptiveBackground::new(kind, 50).unwrap();
            let mut labels = GrayImage::default();
            for index in 0..60 {
                model.label(&frame(index, None), if index == 0 { 1.0 } else { 0.05 }, &mut labels).unwrap();
            }
            model.label(&frame(60, Some(40)), 0.0, &mut labels).unwrap();
            assert_eq!(labels.dimensions(), (96, 64));
            for (u, v, label) in labels.enumerate_pixels() {
                let inside = (40..56).contains(&u) && (20..50).contains(&v);
                assert_eq!(label[0] == 255, inside, "{kind:?} at {u}, {v}: {}", label[0]);
            }
            let mut picture = RgbImage::default();
            model.picture(&mut picture).unwrap();
            let [r, g, b] = picture.get_pixel(48, 30).0;
            assert!(
                r.abs_diff(93) <= 4 && g.abs_diff(113) <= 4 && b.abs_diff(100) <= 1,
                "{kind:?}: {r} {g} {b}"
            );
        }
    }
}
