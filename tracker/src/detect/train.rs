//! Training of a camera's own detector (section 3): positives are people in its pictures; negatives are its background,
//! the gaps between people who are close together, and false positives of the previous detector.

use calib::vision::PeopleClassifier;
use calib::vision::people::DetectionWindow;
use image::RgbImage;
use mot::rows::PixelBox;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::svm::{self, SvmOptions, TrainingSample};
use super::{DetectOptions, Detector, window_of};
use crate::{Error, Result};

pub use super::model::write;

/// Overlap with a person above which a window is no negative example.
const CLEAR_OVERLAP: f64 = 0.3;
/// Distance of the centres of two close people, in widths.
const CLOSE_WIDTHS: f64 = 3.0;
/// Number of windows tried for each background example.
const TRIES: usize = 20;
/// Largest number of false positives that are taken from one picture.
const MISTAKES: usize = 30;

/// A picture with its labelled people.
#[derive(Debug, Clone)]
pub struct Labelled {
    /// The picture.
    pub image: RgbImage,
    /// All people in the picture, except those listed in `ignored`.
    pub people: Vec<PixelBox>,
    /// People who are hidden or cut off: neither positive nor negative examples.
    pub ignored: Vec<PixelBox>,
}

/// Options of the training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainOptions {
    /// Number of background windows from each picture. Default 10.
    pub background_per_image: usize,
    /// Number of rounds in which false positives of the previous detector are added. Default 2.
    pub rounds: usize,
    /// Options of the detector.
    pub detect: DetectOptions,
    /// Options of the classifier's training.
    pub svm: SvmOptions,
    /// Seed of the background windows' places.
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

/// Counts of a training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TrainReport {
    /// Number of examples of people, mirrored ones included.
    pub people: usize,
    /// Number of background examples.
    pub background: usize,
    /// Number of gaps between people.
    pub gaps: usize,
    /// Number of false positives that were added.
    pub mistakes: usize,
}

/// Trains weights from labelled pictures and pictures without people; `step` is called after each picture of each
/// round.
///
/// # Errors
/// No labelled person, invalid options, or an error of OpenCV.
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
    let mut samples: Vec<TrainingSample> = Vec::new();
    let nobody = empty.iter().map(|image| (image, &[] as &[PixelBox], &[] as &[PixelBox]));
    let images: Vec<(&RgbImage, &[PixelBox], &[PixelBox])> =
        labelled.iter().map(|l| (&l.image, &l.people[..], &l.ignored[..])).chain(nobody).collect();
    for (image, people, ignored) in &images {
        let mirrored = image::imageops::flip_horizontal(*image);
        for person in *people {
            let window = window_of(person);
            let left = f64::from(image.width()) - window.left - window.width;
            for (image, window) in [(*image, window), (&mirrored, DetectionWindow { left, ..window })] {
                samples
                    .push(TrainingSample { features: classifier.features(image, &window)?, is_person: true });
                report.people += 1;
            }
        }
        let is_clear = |b: &PixelBox| people.iter().chain(*ignored).all(|p| p.iou(b) < CLEAR_OVERLAP);
        for gap in gaps(people).into_iter().filter(is_clear) {
            samples.push(TrainingSample {
                features: classifier.features(image, &window_of(&gap))?,
                is_person: false,
            });
            report.gaps += 1;
        }
        for _ in 0..options.background_per_image {
            let size = (image.width(), image.height());
            let tries = (0..TRIES).map(|_| somewhere(&mut random, size, labelled, &options.detect));
            let Some(place) = tries.into_iter().find(is_clear) else { continue };
            samples.push(TrainingSample {
                features: classifier.features(image, &window_of(&place))?,
                is_person: false,
            });
            report.background += 1;
        }
        step();
    }
    if report.people == 0 {
        return Err(Error::option("labelled", "labels no person in the pictures; nothing can be learnt"));
    }
    let mut weights = svm::train(&samples, &prior, &options.svm);
    for _ in 0..options.rounds {
        let detector = Detector::new(&weights, options.detect)?;
        for (image, people, ignored) in &images {
            let is_mistake = |b: &PixelBox| people.iter().chain(*ignored).all(|p| p.iou(b) < CLEAR_OVERLAP);
            let found = detector.look(image)?;
            for mistake in found.iter().map(|f| f.pixel_box).filter(is_mistake).take(MISTAKES) {
                let features = classifier.features(image, &window_of(&mistake))?;
                samples.push(TrainingSample { features, is_person: false });
                report.mistakes += 1;
            }
            step();
        }
        weights = svm::train(&samples, &prior, &options.svm);
    }
    Ok((weights, report))
}

/// Boxes between two people who are close together, whose gradients look like a third person.
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

/// A random box of a size that people have in these pictures.
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
