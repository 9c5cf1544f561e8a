//! A camera's own detector (section 3): people cut out of its pictures, against its own background, the gaps between
//! people who are close together, and whatever the detector so far takes for a person and is none.

use calib::vision::PeopleClassifier;
use calib::vision::people::DetectionWindow;
use image::RgbImage;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::svm::{self, Sample, SvmOptions};
use super::{DetectOptions, Detector, window_of};
use crate::tracks::rows::PixelBox;
use crate::{Error, Result};

pub use super::model::write;

/// A window overlapping a person more than this is no example of what is none.
const CLEAR_OVERLAP: f64 = 0.3;
/// Two people are close where their centres are nearer than this, in widths.
const CLOSE_WIDTHS: f64 = 3.0;
/// Windows tried for each example of background.
const TRIES: usize = 20;
/// Mistakes of the detector that are taken from one picture at most.
const MISTAKES: usize = 30;

/// A picture with its people.
#[derive(Debug, Clone)]
pub struct Labelled {
    /// The picture.
    pub image: RgbImage,
    /// Everybody in it; those who are hidden or cut off may be listed in `ignored` instead.
    pub people: Vec<PixelBox>,
    /// People who are no good examples, but no background either.
    pub ignored: Vec<PixelBox>,
}

/// How training goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainOptions {
    /// Background windows from each picture.
    pub background_per_image: usize,
    /// How often the detector so far looks for its own mistakes.
    pub rounds: usize,
    /// How it looks.
    pub detect: DetectOptions,
    /// The classifier's training.
    pub svm: SvmOptions,
    /// Of the background windows' places.
    pub seed: u64,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self {
            background_per_image: 10,
            rounds: 2,
            detect: DetectOptions::default(),
            svm: SvmOptions::default(),
            seed: 1,
        }
    }
}

/// What training saw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TrainReport {
    /// Examples of people, mirrored ones included.
    pub people: usize,
    /// Examples of background.
    pub background: usize,
    /// Gaps between people.
    pub gaps: usize,
    /// Mistakes that were learnt from.
    pub mistakes: usize,
}

/// Trains weights from labelled pictures and pictures without people; `step` is called after each picture of each round.
///
/// # Errors
/// No person to learn from; options that mean nothing; when OpenCV refuses.
pub fn train(
    labelled: &[Labelled],
    empty: &[RgbImage],
    options: &TrainOptions,
    mut step: impl FnMut(),
) -> Result<(Vec<f32>, TrainReport)> {
    options.detect.check()?;
    let prior = PeopleClassifier::inria_weights()?;
    let classifier = PeopleClassifier::new(&prior)?;
    let mut random = Pcg64Mcg::seed_from_u64(options.seed);
    let mut report = TrainReport::default();
    let mut samples: Vec<Sample> = Vec::new();
    let nobody = empty.iter().map(|image| (image, &[] as &[PixelBox], &[] as &[PixelBox]));
    let images: Vec<(&RgbImage, &[PixelBox], &[PixelBox])> =
        labelled.iter().map(|l| (&l.image, &l.people[..], &l.ignored[..])).chain(nobody).collect();
    for (image, people, ignored) in &images {
        let mirrored = image::imageops::flip_horizontal(*image);
        for person in *people {
            let window = window_of(person);
            let left = f64::from(image.width()) - window.left - window.width;
            for (image, window) in [(*image, window), (&mirrored, DetectionWindow { left, ..window })] {
                samples.push(Sample { features: classifier.features(image, &window)?, is_person: true });
                report.people += 1;
            }
        }
        let is_clear = |b: &PixelBox| people.iter().chain(*ignored).all(|p| p.iou(b) < CLEAR_OVERLAP);
        for gap in gaps(people).into_iter().filter(is_clear) {
            samples
                .push(Sample { features: classifier.features(image, &window_of(&gap))?, is_person: false });
            report.gaps += 1;
        }
        for _ in 0..options.background_per_image {
            let size = (image.width(), image.height());
            let tries = (0..TRIES).map(|_| somewhere(&mut random, size, labelled, &options.detect));
            let Some(place) = tries.into_iter().find(is_clear) else { continue };
            samples
                .push(Sample { features: classifier.features(image, &window_of(&place))?, is_person: false });
            report.background += 1;
        }
        step();
    }
    if report.people == 0 {
        return Err(Error::option("--boxes", "labels no person in the pictures; nothing can be learnt"));
    }
    let mut weights = svm::train(&samples, &prior, &options.svm);
    for _ in 0..options.rounds {
        let detector = Detector::new(&weights, options.detect)?;
        for (image, people, ignored) in &images {
            let is_mistake = |b: &PixelBox| people.iter().chain(*ignored).all(|p| p.iou(b) < CLEAR_OVERLAP);
            let found = detector.look(image)?;
            for mistake in found.iter().map(|f| f.pixel_box).filter(is_mistake).take(MISTAKES) {
                let features = classifier.features(image, &window_of(&mistake))?;
                samples.push(Sample { features, is_person: false });
                report.mistakes += 1;
            }
            step();
        }
        weights = svm::train(&samples, &prior, &options.svm);
    }
    Ok((weights, report))
}

/// Between two people who are close together, their gradients make a third.
fn gaps(people: &[PixelBox]) -> Vec<PixelBox> {
    let mut gaps = Vec::new();
    for (i, a) in people.iter().enumerate() {
        for b in &people[i + 1..] {
            let middle = |b: &PixelBox| b.left + 0.5 * b.width;
            let is_level = (a.top - b.top).abs() < 0.5 * a.height.min(b.height);
            if is_level && (middle(a) - middle(b)).abs() < CLOSE_WIDTHS * 0.5 * (a.width + b.width) {
                let mean = |a: f64, b: f64| 0.5 * (a + b);
                let (width, height) = (mean(a.width, b.width), mean(a.height, b.height));
                let left = mean(middle(a), middle(b)) - 0.5 * width;
                gaps.push(PixelBox { left, top: mean(a.top, b.top), width, height });
            }
        }
    }
    gaps
}

/// A place of a size that people have here.
fn somewhere(
    random: &mut Pcg64Mcg,
    size: (u32, u32),
    labelled: &[Labelled],
    detect: &DetectOptions,
) -> PixelBox {
    let people = || labelled.iter().flat_map(|l| &l.people);
    let count = people().count().max(1);
    let like = people().nth(random.random_range(0..count));
    let height = like.map_or(detect.min_height_px, |b| b.height) * random.random_range(0.8..1.25);
    let width = super::ASPECT * height;
    let room = |side: u32, length: f64| (f64::from(side) - length).max(1.0);
    PixelBox {
        left: random.random_range(0.0..room(size.0, width)),
        top: random.random_range(0.0..room(size.1, height)),
        width,
        height,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_lie_between_neighbours_on_one_level() {
        let person = |left: f64, top: f64| PixelBox { left, top, width: 30.0, height: 80.0 };
        let found =
            gaps(&[person(100.0, 50.0), person(160.0, 54.0), person(400.0, 50.0), person(130.0, 300.0)]);
        assert_eq!(found, [PixelBox { left: 130.0, top: 52.0, width: 30.0, height: 80.0 }]);
    }
}
