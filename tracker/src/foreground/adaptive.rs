//! Background learnt while running, for streams that cannot be looked through beforehand: OpenCV's MOG2 or KNN, kept
//! from absorbing people.
//!
//! OpenCV's models learn from everything they are shown. So they are only shown foreground that has stayed for
//! [`PixelOptions::absorb_s`](super::pixels::PixelOptions); before that, and under people whom the tracker believes in, they
//! are shown their own background in its place.

use calib::vision::{AdaptiveBackground, AdaptiveKind};
use image::{GrayImage, RgbImage};

use super::exposure::Exposure;
use super::relight;
use crate::Result;

/// How many learnt frames OpenCV's models remember.
const HISTORY_FRAMES: u32 = 300;
/// The labels mean something after this time.
const WARM_UP_S: f32 = 1.0;
/// Everything is learnt for this long: the first pictures may hold people.
const LEARN_ALL_S: f32 = 5.0;
/// After that one frame in this many is learnt.
const LEARN_EVERY: u32 = 4;

/// The online model of one camera.
pub struct AdaptiveModel {
    model: AdaptiveBackground,
    /// The background in the model's own exposure.
    picture: RgbImage,
    /// A frame in the model's exposure.
    even: RgbImage,
    scratch: GrayImage,
    /// Name of the camera and picture of the room of another time, until the first frame comes.
    reference: Option<(String, RgbImage)>,
    /// For how long each pixel has been foreground, in seconds.
    age_s: Vec<f32>,
    absorb_s: f32,
    seen: u32,
    learning_s: f32,
    unlearnt_s: f32,
}

impl AdaptiveModel {
    /// A model that knows nothing yet.
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

    /// The same, which learns on from a picture of the room of another time and light. What the first frame shows instead of it
    /// is foreground.
    #[must_use]
    pub fn begun_from(self, camera: String, reference: RgbImage) -> Self {
        Self { reference: Some((camera, reference)), ..self }
    }

    /// Whether enough has been seen for the labels to mean something.
    pub fn is_warm(&self) -> bool {
        self.learning_s >= WARM_UP_S
    }

    /// The background in the model's own exposure; black before the first frame.
    pub fn picture(&self) -> &RgbImage {
        &self.picture
    }

    /// Scores every pixel: 0 for the background, 255 for all else, shadows included.
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

    /// Learns from the frame that was scored last. `people`: where believed people are seen (not 0); foreground there is not
    /// learnt.
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

    /// Forgets everything but this frame, which becomes the start of a new warm-up: after the light was switched. Of
    /// people in it the background is taken as it should look in the new light.
    pub fn restart(&mut self, frame: &RgbImage) -> Result<()> {
        self.even.copy_from_slice(frame);
        if let Some(relit) = relight::relit(&self.picture, frame) {
            self.replace_unexplained(&relit);
        }
        self.show_first()?;
        self.learning_s = 0.0;
        Ok(())
    }

    /// Begins with the reference in the first frame's light. Where light does not explain the difference, the camera was moved:
    /// everything is learnt.
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
