//! Background model learnt during the run, for streams that cannot be sampled beforehand: OpenCV's MOG2 or KNN, kept
//! from absorbing people.
//!
//! OpenCV's models learn from every picture that they get. They therefore only get foreground that has stayed for
//! [`PixelOptions::absorb_s`](super::pixels::PixelOptions); earlier, and under believed people, they get their own
//! background instead.

use calib::vision::{AdaptiveBackground, AdaptiveKind};
use image::{GrayImage, RgbImage};

use super::exposure::Exposure;
use super::relight;
use crate::Result;

/// Number of learnt frames in the history of OpenCV's models.
const HISTORY_FRAMES: u32 = 300;
/// Time after which the labels are reliable, seconds.
const WARM_UP_S: f32 = 1.0;
/// Time during which everything is learnt, seconds: the first pictures may hold people.
const LEARN_ALL_S: f32 = 5.0;
/// Number of frames from one learnt frame to the next, after that time.
const LEARN_EVERY: u32 = 4;

/// Online background model of one camera.
pub struct AdaptiveModel {
    model: AdaptiveBackground,
    /// Background in the model's own exposure.
    picture: RgbImage,
    /// Frame in the model's exposure.
    even: RgbImage,
    scratch: GrayImage,
    /// Name of the camera and reference picture of the room, taken at another time, until the first frame comes.
    reference: Option<(String, RgbImage)>,
    /// Time for which each pixel has been foreground, seconds.
    age_s: Vec<f32>,
    absorb_s: f32,
    seen: u32,
    learning_s: f32,
    unlearnt_s: f32,
}

impl AdaptiveModel {
    /// A model without any history.
    pub fn new(kind: AdaptiveKind, width: u32, height: u32, absorb_s: f32) -> Result<Self> {
        Ok(Self {
            model: AdaptiveBackground::new(kind, HISTORY_FRAMES)?,
            picture: RgbImage::new(width, height),
            even: RgbImage::new(width, height),
            scratch: GrayImage::new(width, height),
            reference: None,
            age_s: vec![0.0; width as usize * height as usize],
            absorb_s,
            seen: 0,
            learning_s: 0.0,
            unlearnt_s: 0.0,
        })
    }

    /// Starts the model from a reference picture of the room, taken at another time and in other light. Differences of
    /// the first frame from it are foreground.
    #[must_use]
    pub fn begun_from(self, camera: String, reference: RgbImage) -> Self {
        Self { reference: Some((camera, reference)), ..self }
    }

    /// Whether the model has seen enough for reliable labels.
    pub fn is_warm(&self) -> bool {
        self.learning_s >= WARM_UP_S
    }

    /// Background in the model's own exposure; black before the first frame.
    pub fn picture(&self) -> &RgbImage {
        &self.picture
    }

    /// Scores every pixel: 0 for the background, 255 for the rest, shadows included.
    pub fn score(&mut self, frame: &RgbImage, exposure: &Exposure, score: &mut GrayImage) -> Result<()> {
        if let Some((camera, reference)) = self.reference.take() {
            self.begin(&camera, &reference, frame)?;
        }
        self.make_even(frame, exposure);
        let rate = if self.seen == 0 { 1.0 } else { 0.0 };
        self.model.label(&self.even, rate, score)?;
        for s in score.iter_mut() {
            *s = if *s == 0 { 0 } else { 255 };
        }
        if self.seen == 0 {
            self.model.picture(&mut self.picture)?;
        }
        self.seen += 1;
        Ok(())
    }

    /// Learns from the frame that was scored last. `people` is not 0 where a believed person is seen; foreground there
    /// is not learnt.
    pub fn learn(&mut self, mask: &GrayImage, people: &GrayImage, elapsed_s: f32) -> Result<()> {
        self.learning_s += elapsed_s;
        self.unlearnt_s += elapsed_s;
        let everything = self.learning_s < LEARN_ALL_S;
        if !everything && !self.seen.is_multiple_of(LEARN_EVERY) {
            return Ok(());
        }
        let absorb_s = self.absorb_s;
        let pixels = self.even.chunks_exact_mut(3).zip(self.picture.chunks_exact(3));
        let known = mask.iter().zip(people.iter()).zip(&mut self.age_s);
        for ((even, background), ((mask, person), age_s)) in pixels.zip(known) {
            let is_person = *mask > 0 && *person > 0;
            *age_s = match (*mask > 0, is_person) {
                (false, _) => 0.0,
                (true, false) => *age_s + self.unlearnt_s,
                (true, true) => (*age_s - self.unlearnt_s).max(0.0),
            };
            let is_young = !everything && *age_s > 0.0 && *age_s < absorb_s;
            if is_person || is_young {
                even.copy_from_slice(background);
            }
        }
        let rate = if everything {
            1.0 / self.seen.clamp(1, 50) as f64
        } else {
            LEARN_EVERY as f64 / HISTORY_FRAMES as f64
        };
        self.unlearnt_s = 0.0;
        self.model.label(&self.even, rate, &mut self.scratch)?;
        self.model.picture(&mut self.picture)?;
        Ok(())
    }

    /// Restarts the model from this frame, with a new warm-up, after the light was switched. Behind people in the frame
    /// the background is predicted for the new light.
    pub fn restart(&mut self, frame: &RgbImage) -> Result<()> {
        self.even.copy_from_slice(frame);
        if let Some(relit) = relight::relit(&self.picture, frame) {
            self.replace_unexplained(&relit);
        }
        self.show_first()?;
        self.learning_s = 0.0;
        Ok(())
    }

    /// Starts the model with the reference picture, converted to the first frame's light. Where light does not explain
    /// the difference, the camera was moved: everything is learnt.
    fn begin(&mut self, camera: &str, reference: &RgbImage, frame: &RgbImage) -> Result<()> {
        let Some(relit) = relight::relit(reference, frame) else {
            tracing::warn!(
                "camera `{camera}` sees another scene than its reference picture in the room shows: has it been moved? Its \
                 background is learnt anew"
            );
            return Ok(());
        };
        self.even.copy_from_slice(frame);
        self.replace_unexplained(&relit);
        self.show_first()?;
        self.learning_s = LEARN_ALL_S;
        Ok(())
    }

    fn replace_unexplained(&mut self, relit: &relight::Relit) {
        let pixels = self.even.chunks_exact_mut(3).zip(relit.expected.chunks_exact(3));
        for ((even, expected), explained) in pixels.zip(&relit.explained) {
            if !explained {
                even.copy_from_slice(expected);
            }
        }
    }

    /// Makes `even` the model's first picture.
    fn show_first(&mut self) -> Result<()> {
        self.model.label(&self.even, 1.0, &mut self.scratch)?;
        self.age_s.fill(0.0);
        self.seen = 1;
        Ok(self.model.picture(&mut self.picture)?)
    }

    fn make_even(&mut self, frame: &RgbImage, exposure: &Exposure) {
        let table = exposure.inverse_table();
        for (even, x) in self.even.chunks_exact_mut(3).zip(frame.as_raw().chunks_exact(3)) {
            for c in 0..3 {
                even[c] = table[c][x[c] as usize];
            }
        }
    }
}
