//! Foreground masks from one camera's pictures.
//!
//! 1. [`health`]: detects frozen and dark pictures.
//! 2. [`exposure`]: estimates this frame's exposure relative to the background.
//! 3. [`pixels`] (for an empty scene known beforehand, [`backdrop`]) or [`adaptive`] (learnt during the run): scores
//!    the difference of each pixel from the background.
//! 4. [`shadow`]: removes pixels that show the background's surface darker or brighter.
//! 5. [`regions`] and OpenCV's morphology: one clean silhouette for each person.
//! 6. [`Foreground::expect`]: keeps the background under believed people from absorbing them.
//! 7. A frame that is nearly all foreground is a switched light: it is unusable, and if it stays the background is
//!    learnt again ([`relight`]: also behind people).
//!
//! All steps work in the real image; [`calib::undistort::UndistortMap`] maps the mask to the pinhole image afterwards.

pub mod adaptive;
pub mod backdrop;
pub mod exposure;
pub mod health;
mod initial;
mod lanes;
pub mod lights;
mod median;
mod options;
pub mod pixels;
mod recurrence;
pub mod regions;
pub mod relight;
pub mod shadow;
mod verdict;

use calib::vision::{AdaptiveKind, Morphology};
use image::{GrayImage, RgbImage};

use adaptive::AdaptiveModel;
use backdrop::Backdrop;
use exposure::Exposure;
use health::Health;
pub use initial::InitialBackground;
use lights::Lights;
pub use options::ForegroundOptions;
use pixels::{ScoredFrame, THRESHOLD};
use regions::Regions;
use shadow::{SHADOW, Shadows};
pub use verdict::Verdict;

use crate::{Error, Result};

/// Foreground of one camera, frame by frame.
pub struct Foreground {
    options: ForegroundOptions,
    model: BackgroundModel,
    health: Health,
    exposure: Exposure,
    morphology: Morphology,
    regions: Regions,
    shadows: Shadows,
    /// Pixels where believed people are expected (not 0), with a margin.
    people: GrayImage,
    /// The same, extended by all regions that belong mostly to them.
    seen_people: GrayImage,
    /// Whether any person is expected.
    expects_people: bool,
    /// Background in the model's exposure, for fitting the frame's.
    background: RgbImage,
    /// Background in the frame's exposure.
    expected: RgbImage,
    score: GrayImage,
    smooth: GrayImage,
    /// The least tolerance at every pixel, for a model that has none of its own; otherwise empty.
    flat_tolerance: Vec<u8>,
    /// One number a column, for the shadows.
    columns: Vec<u32>,
    latest_s: Option<f64>,
    /// Fraction of foreground in the latest usable mask.
    latest_fraction: f64,
    /// Fraction of pixels that had changed in the latest usable frame, shadows included.
    latest_changed: f64,
    /// Time since which nearly everything has been foreground, seconds.
    switched_s: Option<f64>,
    frames: u32,
}

enum BackgroundModel {
    Pixels(Lights),
    Adaptive(AdaptiveModel),
}

/// Number of frames between two updates of the background picture for the exposure fit: it changes slowly.
const REFRESH_EVERY: u32 = 16;
/// Score above which a pixel is foreground if most of its neighbours are…
const WEAK: u8 = THRESHOLD / 8 * 5;
/// …in regions in which some pixels have at least this score.
const STRONG: u8 = 160;
/// Longest run of shadow inside a body that is restored, as a divisor of the image's height.
const LONGEST_STRIPE: u32 = 16;
/// Margin around believed people, as a fraction of the image's height: silhouettes are ellipsoids, and of an earlier
/// moment.
const PEOPLE_MARGIN: f64 = 0.01;
/// Share of a region that must lie where people are expected for the whole region to be theirs: with one camera the
/// estimated position of a person may be off by half a metre.
const PEOPLE_SHARE: f64 = 0.5;
/// Longest gap between two frames for learning, seconds.
const LONGEST_GAP_S: f64 = 1.0;

impl Foreground {
    /// Foreground of a camera whose images have this size.
    ///
    /// # Errors
    /// A backdrop of another size, or an error of OpenCV.
    pub fn new(
        width: u32,
        height: u32,
        start: InitialBackground,
        options: ForegroundOptions,
    ) -> Result<Self> {
        let mut background = RgbImage::new(width, height);
        let model = match start {
            InitialBackground::Backdrops(scenes) => {
                let Some(first) = scenes.first() else {
                    return Err(Error::option("background", "there is no empty scene"));
                };
                for scene in &scenes {
                    check_size(&scene.picture, (width, height))?;
                }
                background.copy_from_slice(&first.picture);
                BackgroundModel::Pixels(Lights::new(&scenes, &options.pixels))
            }
            InitialBackground::Nothing(kind) => {
                BackgroundModel::Adaptive(AdaptiveModel::new(kind, width, height, options.pixels.absorb_s)?)
            }
            InitialBackground::Reference { camera, picture } => {
                check_size(&picture, (width, height))?;
                let kind = AdaptiveKind::default();
                let model = AdaptiveModel::new(kind, width, height, options.pixels.absorb_s)?;
                BackgroundModel::Adaptive(model.begun_from(camera, picture))
            }
        };
        let flat =
            if matches!(model, BackgroundModel::Adaptive(_)) { width as usize * height as usize } else { 0 };
        Ok(Self {
            flat_tolerance: vec![options.pixels.least_levels as u8; flat],
            options,
            model,
            health: Health::default(),
            exposure: Exposure::default(),
            morphology: Morphology::default(),
            regions: Regions::default(),
            shadows: Shadows::default(),
            people: GrayImage::new(width, height),
            seen_people: GrayImage::new(width, height),
            expects_people: false,
            background,
            expected: RgbImage::new(width, height),
            score: GrayImage::new(width, height),
            smooth: GrayImage::new(width, height),
            columns: Vec::new(),
            latest_s: None,
            latest_fraction: 0.0,
            latest_changed: 0.0,
            switched_s: None,
            frames: 0,
        })
    }

    /// Foreground of the same camera after it has turned: with the empty scene that it sees now, or with a background that
    /// is learnt anew.
    ///
    /// # Errors
    /// An error of OpenCV.
    pub fn begun_anew(&self, scene: Option<Backdrop>) -> Result<Self> {
        let (width, height) = self.people.dimensions();
        let unknown = || InitialBackground::Nothing(AdaptiveKind::default());
        let start = scene.map_or_else(unknown, InitialBackground::from);
        Self::new(width, height, start, self.options.clone())
    }

    /// Computes the mask of the next frame (255 foreground, 0 background). Returns whether it can be used.
    ///
    /// # Errors
    /// An error of OpenCV.
    pub fn mask(&mut self, frame: &RgbImage, time_s: f64, into: &mut GrayImage) -> Result<Verdict> {
        if into.dimensions() != frame.dimensions() {
            *into = GrayImage::new(frame.width(), frame.height());
        }
        let elapsed_s =
            self.latest_s.map_or(0.0, |latest| (time_s - latest).clamp(0.0, LONGEST_GAP_S)) as f32;
        self.latest_s = Some(time_s);
        if self.health.is_frozen(frame, time_s) {
            return Ok(Verdict::Frozen);
        }
        if health::is_dark(frame) {
            return Ok(Verdict::Dark);
        }
        self.frames += 1;
        self.follow_light(frame);
        if self.options.exposure && !self.is_first_look() {
            self.exposure = Exposure::fit(&self.background, frame, &self.exposure);
        }
        let changed = self.judge(frame, into)?;
        let fraction = self.clean(into)?;
        tracing::trace!(time_s, fraction, gain = ?self.exposure.gain, bias = ?self.exposure.bias, "mask");
        if let BackgroundModel::Adaptive(model) = &self.model
            && !model.is_warm()
        {
            self.learn(frame, into, elapsed_s)?;
            return Ok(Verdict::Learning);
        }
        if self.is_switched(frame, changed, fraction) {
            self.relearn(frame, time_s, elapsed_s)?;
            return Ok(Verdict::AllForeground);
        }
        self.switched_s = None;
        self.latest_fraction = fraction;
        self.latest_changed = changed;
        self.learn(frame, into, elapsed_s)?;
        Ok(Verdict::Usable)
    }

    /// Sets where believed people are seen in the real image (255; 0 elsewhere): their silhouettes, including the reach
    /// of limbs, at the latest known moment. The background does not absorb foreground there. Holds until it is
    /// replaced; an image of zeros expects nobody.
    ///
    /// # Errors
    /// An image whose size is not the camera's, or an error of OpenCV.
    pub fn expect(&mut self, people: &GrayImage) -> Result<()> {
        let (found, size) = (people.dimensions(), self.people.dimensions());
        if found != size {
            return Err(Error::option(
                "people",
                format!("{} × {} pixels, the camera's images are {} × {}", found.0, found.1, size.0, size.1),
            ));
        }
        self.people.copy_from_slice(people);
        self.expects_people = people.iter().any(|p| *p > 0);
        let margin = (f64::from(size.1) * PEOPLE_MARGIN).ceil() as u32;
        Ok(self.morphology.dilate(&mut self.people, margin)?)
    }

    /// The model's present background, in its own exposure.
    pub fn background(&mut self) -> &RgbImage {
        match &self.model {
            BackgroundModel::Pixels(lights) => lights.present().picture(&mut self.background),
            BackgroundModel::Adaptive(model) => self.background.copy_from_slice(model.picture()),
        }
        &self.background
    }

    /// Takes the background of the light in which the frame was taken.
    fn follow_light(&mut self, frame: &RgbImage) {
        if let BackgroundModel::Pixels(lights) = &mut self.model
            && lights.follow(frame)
        {
            self.begin_background();
        }
    }

    /// Forgets what is known of the frames before another background.
    fn begin_background(&mut self) {
        self.exposure = Exposure::default();
        self.switched_s = None;
        self.latest_fraction = 0.0;
        self.latest_changed = 0.0;
        self.background();
    }

    fn is_first_look(&self) -> bool {
        matches!(self.model, BackgroundModel::Adaptive(_)) && self.frames == 1
    }

    /// Scores the pixels and removes shadows. Returns the fraction of pixels that have changed, shadows included.
    fn judge(&mut self, frame: &RgbImage, mask: &mut GrayImage) -> Result<f64> {
        match &mut self.model {
            BackgroundModel::Pixels(lights) => {
                lights.present().score(frame, &self.exposure, &mut self.expected, &mut self.score);
            }
            BackgroundModel::Adaptive(model) => {
                model.score(frame, &self.exposure, &mut self.score)?;
                let table = self.exposure.table();
                for (e, b) in self.expected.chunks_exact_mut(3).zip(model.picture().chunks_exact(3)) {
                    for c in 0..3 {
                        e[c] = table[c][b[c] as usize];
                    }
                }
            }
        }
        let changed =
            self.score.iter().filter(|s| **s >= WEAK).count() as f64 / (self.score.len() as f64).max(1.0);
        if let Some(shadows) = &self.options.shadows {
            let tolerance = match &self.model {
                BackgroundModel::Pixels(lights) => lights.present().tolerance(),
                BackgroundModel::Adaptive(_) => &self.flat_tolerance,
            };
            self.shadows.mark((frame, &self.expected), tolerance, WEAK, shadows, &mut self.score);
            let longest = frame.height() / LONGEST_STRIPE;
            shadow::restore_enclosed(&mut self.score, THRESHOLD, longest, &mut self.columns);
        }
        // Majority of each 3 × 3 pixels: removes single pixels and moves no straight edge.
        for (mask, score) in mask.iter_mut().zip(self.score.iter()) {
            *mask = if *score >= WEAK { 255 } else { 0 };
        }
        self.morphology.box_blur(mask, 1, &mut self.smooth)?;
        for (mask, smooth) in mask.iter_mut().zip(self.smooth.iter()) {
            *mask = if *smooth >= 128 { 255 } else { 0 };
        }
        Ok(changed)
    }

    /// Closes gaps in silhouettes and removes specks. Returns the remaining fraction of foreground.
    fn clean(&mut self, mask: &mut GrayImage) -> Result<f64> {
        let pixels = mask.len() as f64;
        // Gaps grow with the image; 2 pixels at 480 rows.
        let radius = (mask.height() as f64 / 240.0).round().clamp(1.0, 8.0) as u32;
        self.morphology.close(mask, radius)?;
        let least_area = (self.options.least_area * pixels).ceil() as u32;
        let left = self.regions.remove_weak(mask, &self.score, STRONG, least_area, least_area / 4);
        if left > 0 {
            self.regions.fill_holes(mask, (self.options.largest_hole * pixels) as u32);
        }
        Ok(left as f64 / pixels.max(1.0))
    }

    /// Whether the light was switched, or the camera moved.
    fn is_switched(&mut self, frame: &RgbImage, changed: f64, fraction: f64) -> bool {
        let sudden = self.options.sudden_foreground;
        if self.switched_s.is_some() {
            return fraction > sudden || changed > sudden;
        }
        let jumped = self.frames > 1 && fraction > self.latest_fraction + sudden;
        if jumped || fraction > self.options.most_foreground {
            return true;
        }
        // Light on a surface may pass for shadows and reflections in places: the rest of a switched lamp is then a
        // patchwork. A person stepping before the camera does not change the light on the room.
        self.frames > 1 && changed > self.latest_changed + sudden && self.is_other_light(frame)
    }

    /// Whether most of the changed pixels show the background in another light.
    fn is_other_light(&mut self, frame: &RgbImage) -> bool {
        let Some(relit) = relight::relit(self.background(), frame) else { return false };
        let changed = self.score.iter().map(|score| *score >= WEAK || *score == SHADOW);
        relit.explained_share(changed) > 0.5
    }

    fn relearn(&mut self, frame: &RgbImage, time_s: f64, elapsed_s: f32) -> Result<()> {
        let begins = self.switched_s.is_none();
        let since = *self.switched_s.get_or_insert(time_s);
        if let BackgroundModel::Pixels(lights) = &mut self.model {
            let model = lights.present_mut();
            if begins {
                model.begin_watch();
            }
            model.watch(frame, elapsed_s);
        }
        if time_s - since >= self.options.relearn_s {
            match &mut self.model {
                BackgroundModel::Pixels(lights) => lights.present_mut().adopt(frame),
                BackgroundModel::Adaptive(model) => model.restart(frame)?,
            }
            self.begin_background();
        }
        Ok(())
    }

    fn learn(&mut self, frame: &RgbImage, mask: &GrayImage, elapsed_s: f32) -> Result<()> {
        self.seen_people.copy_from_slice(&self.people);
        if self.expects_people {
            self.regions.spread(mask, &mut self.seen_people, PEOPLE_SHARE);
        }
        match &mut self.model {
            BackgroundModel::Pixels(lights) => {
                let judged = ScoredFrame { score: &self.score, mask, people: &self.seen_people };
                lights.present_mut().learn(frame, &self.exposure, judged, elapsed_s);
            }
            BackgroundModel::Adaptive(model) => model.learn(mask, &self.seen_people, elapsed_s)?,
        }
        if self.frames.is_multiple_of(REFRESH_EVERY) || self.frames == 1 {
            self.background();
        }
        Ok(())
    }
}

fn check_size(empty: &RgbImage, (width, height): (u32, u32)) -> Result<()> {
    let found = empty.dimensions();
    if found == (width, height) {
        return Ok(());
    }
    let problem = format!(
        "the empty scene is {} × {} pixels, the camera's images are {width} × {height}",
        found.0, found.1
    );
    Err(Error::option("background", problem))
}

#[cfg(test)]
mod rendered_tests;
#[cfg(test)]
mod tests;
