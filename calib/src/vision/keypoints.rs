//! Scale-invariant keypoints (D. G. Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 2004) and
//! their matches between pictures taken from any two places.

use std::collections::HashMap;

use image::GrayImage;
use nalgebra::Point2;
use opencv::core::{KeyPoint, Mat, Vector};
use opencv::features2d::SIFT;
use opencv::prelude::*;

use super::adapter;
use crate::{Error, Result};

/// Length of a keypoint's descriptor.
const DESCRIPTOR: usize = 128;
/// Settings of Lowe's paper.
const LAYERS: i32 = 3;
const EDGE: f64 = 10.0;
const SIGMA_PX: f64 = 1.6;

/// Keypoints of one or more pictures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Keypoints {
    /// Pixel of each keypoint in its picture.
    pub pixels: Vec<Point2<f64>>,
    /// Descriptors of length 1: the square roots of SIFT's (R. Arandjelović, A. Zisserman, CVPR 2012).
    descriptors: Vec<[f32; DESCRIPTOR]>,
}

impl Keypoints {
    /// Finds the strongest keypoints of a picture; those of less `contrast` (0.04 is Lowe's) are left out.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn find(image: &GrayImage, at_most: usize, contrast: f64) -> Result<Self> {
        let refused = adapter::refused("finding keypoints");
        let mut sift = SIFT::create(at_most as i32, LAYERS, contrast, EDGE, SIGMA_PX).map_err(&refused)?;
        let (mut points, mut rows) = (Vector::<KeyPoint>::new(), Mat::default());
        sift.detect_and_compute(&adapter::gray(image)?, &Mat::default(), &mut points, &mut rows, false)
            .map_err(&refused)?;
        let mut found = Self::default();
        for (index, point) in points.iter().enumerate() {
            let place = point.pt();
            let row = rows.at_row::<f32>(index as i32).map_err(&refused)?;
            let row: &[f32; DESCRIPTOR] = row.try_into().map_err(|_| {
                Error::Invalid(format!("a keypoint's descriptor has {} numbers, not {DESCRIPTOR}", row.len()))
            })?;
            let total: f32 = row.iter().sum::<f32>().max(f32::MIN_POSITIVE);
            found.pixels.push(Point2::new(f64::from(place.x), f64::from(place.y)));
            found.descriptors.push(row.map(|v| (v.max(0.0) / total).sqrt()));
        }
        Ok(found)
    }

    /// The keypoints at the given indices, in their order.
    #[must_use]
    pub fn chosen(&self, indices: &[usize]) -> Self {
        Self {
            pixels: indices.iter().map(|i| self.pixels[*i]).collect(),
            descriptors: indices.iter().map(|i| self.descriptors[*i]).collect(),
        }
    }

    /// Appends the keypoints of another picture.
    pub fn append(&mut self, mut other: Self) {
        self.pixels.append(&mut other.pixels);
        self.descriptors.append(&mut other.descriptors);
    }

    /// Pairs (index here, index in `other`) that are each other's nearest, and nearer than `ratio` times the second
    /// nearest of either.
    pub fn matches(&self, other: &Self, ratio: f32) -> Vec<(usize, usize)> {
        let there = nearest(&self.descriptors, &other.descriptors);
        let back = nearest(&other.descriptors, &self.descriptors);
        let clear = |near: &Near| near.first < ratio * near.second;
        let pair = |(here, near): (usize, &Option<Near>)| {
            let near = near.as_ref()?;
            let again = back.get(near.index)?.as_ref()?;
            (again.index == here && clear(near) && clear(again)).then_some((here, near.index))
        };
        there.iter().enumerate().filter_map(pair).collect()
    }

    /// Pairs (index here, index in `other`) of which each is nearest to the other among those in reach: a keypoint of
    /// `other` is in reach of one here within `radius_px` of the pixel that is `predicted` for it, and must be nearer than
    /// `ratio` times the second nearest in reach.
    pub fn matches_near(
        &self,
        other: &Self,
        predicted: &[Option<Point2<f64>>],
        radius_px: f64,
        ratio: f32,
    ) -> Vec<(usize, usize)> {
        let cell = |at: f64| (at / radius_px).floor() as i64;
        let mut cells: HashMap<(i64, i64), Vec<usize>> = HashMap::new();
        for (there, pixel) in other.pixels.iter().enumerate() {
            cells.entry((cell(pixel.x), cell(pixel.y))).or_default().push(there);
        }
        // The keypoint here that each keypoint there is nearest to, and its likeness.
        let mut claims: Vec<Option<(usize, f32)>> = vec![None; other.pixels.len()];
        for (here, place) in predicted.iter().enumerate().take(self.pixels.len()) {
            let Some(place) = place else { continue };
            let (column, row) = (cell(place.x), cell(place.y));
            let around = (row - 1..=row + 1).flat_map(|r| (column - 1..=column + 1).map(move |c| (c, r)));
            let in_reach = around
                .filter_map(|key| cells.get(&key))
                .flatten()
                .copied()
                .filter(|there| (other.pixels[*there] - place).norm() <= radius_px);
            let (mut best, mut first, mut second) = (None, f32::NEG_INFINITY, f32::NEG_INFINITY);
            for there in in_reach {
                let likeness = likeness(&self.descriptors[here], &other.descriptors[there]);
                if likeness > first {
                    (best, first, second) = (Some(there), likeness, first);
                } else {
                    second = second.max(likeness);
                }
            }
            let Some(there) = best else { continue };
            let is_clear = distance(first) < ratio * distance(second.max(LEAST_LIKENESS));
            if is_clear && claims[there].is_none_or(|(_, other)| first > other) {
                claims[there] = Some((here, first));
            }
        }
        let pair = |(there, claim): (usize, &Option<(usize, f32)>)| claim.map(|(here, _)| (here, there));
        let mut pairs: Vec<(usize, usize)> = claims.iter().enumerate().filter_map(pair).collect();
        pairs.sort_unstable();
        pairs
    }
}

/// Likeness of a second nearest keypoint that is always assumed to be in reach: two keypoints that are less alike show
/// different things.
const LEAST_LIKENESS: f32 = 0.75;

/// Distance of two descriptors of length 1 with this scalar product.
fn distance(likeness: f32) -> f32 {
    (2.0 - 2.0 * likeness).max(0.0).sqrt()
}

/// The nearest descriptor, its distance and that of the second nearest.
struct Near {
    index: usize,
    first: f32,
    second: f32,
}

/// Nearest descriptor of `among` for each of `from`.
fn nearest(from: &[[f32; DESCRIPTOR]], among: &[[f32; DESCRIPTOR]]) -> Vec<Option<Near>> {
    let of = |descriptor: &[f32; DESCRIPTOR]| {
        let (mut best, mut second) = (None, f32::NEG_INFINITY);
        let mut first = f32::NEG_INFINITY;
        for (index, other) in among.iter().enumerate() {
            let likeness = likeness(descriptor, other);
            if likeness > first {
                (best, first, second) = (Some(index), likeness, first);
            } else {
                second = second.max(likeness);
            }
        }
        // A single descriptor cannot be mistaken for another one.
        let second = if second.is_finite() { distance(second) } else { f32::INFINITY };
        best.map(|index| Near { index, first: distance(first), second })
    };
    from.iter().map(of).collect()
}

/// Scalar product, summed in lanes that a processor computes at once.
fn likeness(a: &[f32; DESCRIPTOR], b: &[f32; DESCRIPTOR]) -> f32 {
    const LANES: usize = 16;
    let mut sums = [0.0_f32; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    const CONTRAST: f64 = 0.02;

    /// Blobs of many sizes, none like another.
    fn picture(turned: bool) -> GrayImage {
        GrayImage::from_fn(240, 240, |u, v| {
            let (u, v) = if turned { (v, 239 - u) } else { (u, v) };
            let value: f64 = (0..40)
                .map(|k| {
                    let s = f64::from(k);
                    let (x, y) = (120.0 + 95.0 * (2.3 * s).sin(), 120.0 + 95.0 * (3.7 * s + 1.0).cos());
                    let size = 3.0 + 5.0 * (1.1 * s).sin().powi(2);
                    let squared = (f64::from(u) - x).powi(2) + 1.5 * (f64::from(v) - y).powi(2);
                    70.0 * (5.1 * s).sin() * (-0.5 * squared / (size * size)).exp()
                })
                .sum();
            Luma([(128.0 + value).clamp(0.0, 255.0) as u8])
        })
    }

    #[test]
    fn a_picture_on_its_side_is_matched_to_itself() {
        let (here, there) = (picture(false), picture(true));
        let find = |image| Keypoints::find(image, 500, CONTRAST).unwrap();
        let (a, b) = (find(&here), find(&there));
        let matches = a.matches(&b, 0.8);
        assert!(
            matches.len() >= 20,
            "{} matches of {} and {}",
            matches.len(),
            a.pixels.len(),
            b.pixels.len()
        );
        let right = matches
            .iter()
            .filter(|(i, j)| {
                let (p, q) = (a.pixels[*i], b.pixels[*j]);
                // there(u, v) = here(v, 239 − u)
                (Point2::new(q.y, 239.0 - q.x) - p).norm() < 1.0
            })
            .count();
        assert!(10 * right >= 9 * matches.len(), "{right} of {}", matches.len());
    }

    #[test]
    fn a_thing_that_is_there_twice_is_not_matched() {
        let one = Keypoints::find(&picture(false), 100, CONTRAST).unwrap();
        let mut two = one.clone();
        assert!(one.matches(&two, 0.8).len() > 20);
        two.append(one.clone());
        assert!(one.matches(&two, 0.8).is_empty() && two.matches(&one, 0.8).is_empty());
        assert_eq!(two.chosen(&[one.pixels.len()]), one.chosen(&[0]));
    }

    #[test]
    fn a_blank_wall_has_no_keypoints_and_no_matches() {
        let blank = Keypoints::find(&GrayImage::from_pixel(64, 64, Luma([80])), 100, CONTRAST).unwrap();
        assert!(blank.pixels.is_empty());
        let some = Keypoints::find(&picture(false), 100, CONTRAST).unwrap();
        assert!(blank.matches(&some, 0.8).is_empty() && some.matches(&blank, 0.8).is_empty());
    }
}
