//! The empty scene as one camera sees it, learnt from frames of a recording in which people come and go: each channel's
//! median over time, and how far the frames scatter around it.

use std::borrow::Borrow;

use image::{GrayImage, Luma, RgbImage};
use rayon::prelude::*;

use super::exposure::Exposure;
use crate::{Error, Result};

/// Pixels' bytes handled together, so that the counting runs in vector registers.
const LANES: usize = 64;
/// The quantile of the deviations that tells the noise: low enough that a pixel covered by people for half of the time
/// still shows its own noise.
const NOISE_QUANTILE: f64 = 0.35;
/// That quantile of |N(0, 1)|.
const NOISE_QUANTILE_OF_NORMAL: f64 = 0.453_8;
/// Radius of the square over which the noise is averaged: deviations are whole levels.
const NOISE_RADIUS_PX: i64 = 2;

/// An empty scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Backdrop {
    /// What the camera sees when nobody is there.
    pub picture: RgbImage,
    /// One standard deviation of each pixel over time, in sixteenths of a level.
    pub noise: GrayImage,
}

/// [`Backdrop::noise`]'s unit, in levels.
pub const NOISE_UNIT: f32 = 1.0 / 16.0;

impl Backdrop {
    /// Learns the empty scene from frames spread over a recording (or from one picture of it).
    ///
    /// Frames are brought to the first median's exposure and the median is taken again, so that a lamp's flicker
    /// widens nothing. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// Without frames, with frames of different sizes, or with more than 255 of them.
    pub fn learn(frames: &[impl Borrow<RgbImage>]) -> Result<Self> {
        let frames: Vec<&RgbImage> = frames.iter().map(Borrow::borrow).collect();
        let Some(first) = frames.first() else {
            return Err(Error::option("--background", "there is no frame to learn the empty scene from"));
        };
        let (width, height) = first.dimensions();
        if frames.len() > 255 || frames.iter().any(|f| f.dimensions() != (width, height)) {
            return Err(Error::option("--background", "needs at most 255 frames, all of the same size"));
        }
        let raw: Vec<&[u8]> = frames.iter().map(|f| f.as_raw().as_slice()).collect();
        let mut picture = RgbImage::new(width, height);
        quantile(&raw, 0.5, None, &mut picture);
        let even: Vec<RgbImage> = frames.par_iter().map(|frame| compensated(&picture, frame)).collect();
        let raw: Vec<&[u8]> = even.iter().map(|f| f.as_raw().as_slice()).collect();
        quantile(&raw, 0.5, None, &mut picture);
        let mut deviation = RgbImage::new(width, height);
        quantile(&raw, NOISE_QUANTILE, Some(&picture), &mut deviation);
        Ok(Self { noise: noise(&deviation), picture })
    }
}

/// A frame in the exposure of `reference`.
fn compensated(reference: &RgbImage, frame: &RgbImage) -> RgbImage {
    let table = Exposure::fit(reference, frame, &Exposure::default()).inverse_table();
    let mut even = frame.clone();
    for pixel in even.pixels_mut() {
        for (value, table) in pixel.0.iter_mut().zip(&table) {
            *value = table[*value as usize];
        }
    }
    even
}

/// The `fraction` quantile over the frames, byte by byte: of the values, or of their distances from `centre`.
///
/// Found bit by bit from the top: the largest value below which no more than `fraction` of the frames lie.
fn quantile(frames: &[&[u8]], fraction: f64, centre: Option<&RgbImage>, into: &mut RgbImage) {
    let rank = ((frames.len() - 1) as f64 * fraction).round() as u8;
    let centre = centre.map(|c| c.as_raw().as_slice());
    into.par_chunks_mut(LANES).enumerate().for_each(|(chunk, into)| {
        let from = chunk * LANES;
        let mut lanes = [0_u8; LANES];
        let mut middle = [0_u8; LANES];
        if let Some(centre) = centre {
            middle[..into.len()].copy_from_slice(&centre[from..from + into.len()]);
        }
        let mut found = [0_u8; LANES];
        for bit in (0..8).rev() {
            let mut below = [0_u8; LANES];
            for frame in frames {
                lanes[..into.len()].copy_from_slice(&frame[from..from + into.len()]);
                for lane in 0..LANES {
                    let value =
                        if centre.is_some() { lanes[lane].abs_diff(middle[lane]) } else { lanes[lane] };
                    below[lane] += u8::from(value < found[lane] | (1 << bit));
                }
            }
            for lane in 0..LANES {
                found[lane] |= if below[lane] <= rank { 1 << bit } else { 0 };
            }
        }
        into.copy_from_slice(&found[..into.len()]);
    });
}

/// Deviations of the three channels → one standard deviation a pixel, averaged over its neighbours.
fn noise(deviation: &RgbImage) -> GrayImage {
    let (width, height) = deviation.dimensions();
    let mut sums = vec![0_u32; (width as usize + 1) * (height as usize + 1)];
    let row = width as usize + 1;
    for (x, y, pixel) in deviation.enumerate_pixels() {
        let at = (y as usize + 1) * row + x as usize + 1;
        let sum: u32 = pixel.0.iter().map(|d| *d as u32).sum();
        // Modulo 2³² the differences below stay right even where the sums overflow.
        sums[at] =
            sum.wrapping_add(sums[at - 1]).wrapping_add(sums[at - row]).wrapping_sub(sums[at - row - 1]);
    }
    let span = |centre: u32, end: u32| {
        let low = (centre as i64 - NOISE_RADIUS_PX).max(0) as usize;
        (low, ((centre as i64 + NOISE_RADIUS_PX + 1).min(end as i64)) as usize)
    };
    GrayImage::from_fn(width, height, |x, y| {
        let ((left, right), (top, bottom)) = (span(x, width), span(y, height));
        let sum = sums[bottom * row + right]
            .wrapping_add(sums[top * row + left])
            .wrapping_sub(sums[top * row + right])
            .wrapping_sub(sums[bottom * row + left]);
        let mean = sum as f64 / (3 * (right - left) * (bottom - top)) as f64;
        Luma([(mean / NOISE_QUANTILE_OF_NORMAL / NOISE_UNIT as f64).min(255.0).round() as u8])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn quantiles_agree_with_sorting() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        for count in [1, 2, 5, 40, 255] {
            let frames: Vec<RgbImage> = (0..count)
                .map(|_| RgbImage::from_fn(13, 7, |_, _| Rgb(std::array::from_fn(|_| rng.random()))))
                .collect();
            let raw: Vec<&[u8]> = frames.iter().map(|f| f.as_raw().as_slice()).collect();
            for fraction in [0.0, 0.35, 0.5, 1.0] {
                let mut found = RgbImage::new(13, 7);
                quantile(&raw, fraction, None, &mut found);
                for (i, found) in found.as_raw().iter().enumerate() {
                    let mut values: Vec<u8> = raw.iter().map(|f| f[i]).collect();
                    values.sort_unstable();
                    assert_eq!(
                        *found,
                        values[((count - 1) as f64 * fraction).round() as usize],
                        "{count}, {fraction}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_empty_scene_shows_through_people_and_flicker() {
        let mut rng = Pcg64Mcg::seed_from_u64(8);
        let normal = Normal::new(0.0, 3.0).unwrap();
        let scene = |u: u32, v: u32| [60.0 + (u % 60) as f64, 90.0 + (v % 50) as f64, 120.0];
        let frames: Vec<RgbImage> = (0..41)
            .map(|t| {
                let gain = 1.0 + 0.08 * (t as f64 * 1.7).sin();
                RgbImage::from_fn(120, 80, |u, v| {
                    // A person, 30 px wide, crosses once; at each place for a third of the time.
                    if (20..70).contains(&v) && u.abs_diff(t * 2) < 15 {
                        return Rgb([10, 20, 200]);
                    }
                    Rgb(scene(u, v).map(|s| (gain * s + normal.sample(&mut rng)).round() as u8))
                })
            })
            .collect();
        let backdrop = Backdrop::learn(&frames).unwrap();
        // Which of the flickering exposures it shows is open; it must be one.
        let truth = RgbImage::from_fn(120, 80, |u, v| Rgb(scene(u, v).map(|s| s as u8)));
        let table = Exposure::fit(&truth, &backdrop.picture, &Exposure::default()).table();
        let mut noise_sum = 0.0;
        for (u, v, found) in backdrop.picture.enumerate_pixels() {
            let truth = truth.get_pixel(u, v);
            for c in 0..3 {
                let looks = table[c][truth[c] as usize];
                assert!(found[c].abs_diff(looks) <= 6, "{u}, {v}, channel {c}: {} against {looks}", found[c]);
            }
            noise_sum += backdrop.noise.get_pixel(u, v)[0] as f64 * NOISE_UNIT as f64;
        }
        let mean = noise_sum / (120.0 * 80.0);
        // Where a third of the frames show a person, the quantile falls half as far again from the middle.
        assert!((2.5..4.6).contains(&mean), "the noise is 3 levels, found {mean}");
    }

    #[test]
    fn nothing_to_learn_from_is_an_error() {
        let nothing: [RgbImage; 0] = [];
        assert!(Backdrop::learn(&nothing).is_err());
        assert!(Backdrop::learn(&[RgbImage::new(4, 4), RgbImage::new(5, 4)]).is_err());
        assert!(Backdrop::learn(&[RgbImage::new(4, 4)]).is_ok());
    }
}
