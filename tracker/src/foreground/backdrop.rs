//! The empty scene of one camera, learnt from frames of a recording in which people come and go: the median of each
//! channel over time, and the deviation of the frames from it. Where a person stands still for most of the time, the
//! colour behind that person is taken instead ([`recurrence`]).

use std::borrow::Borrow;

use image::{GrayImage, Luma, RgbImage};
use rayon::prelude::*;

use super::exposure::{self, Exposure};
use super::recurrence::{self, OtherColor};
use crate::{Error, Result};

/// Number of bytes handled together, so that the counting is vectorised: whole pixels.
const LANES: usize = 48;
/// Least number of groups of bytes for each thread.
const LEAST_GROUPS: usize = 64;
/// Quantile of the deviations that estimates the noise: low enough that a pixel covered by people half of the time
/// still shows its own noise.
const NOISE_QUANTILE: f64 = 0.35;
/// The same quantile of |N(0, 1)|.
const NOISE_QUANTILE_OF_NORMAL: f64 = 0.453_8;
/// Radius of the square over which the noise is averaged, because deviations are whole levels.
const NOISE_RADIUS_PX: i64 = 2;

/// Empty scene of one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Backdrop {
    /// Picture of the scene without people.
    pub picture: RgbImage,
    /// Standard deviation of each pixel over time, sixteenths of a level.
    pub noise: GrayImage,
}

/// Unit of [`Backdrop::noise`], levels.
pub const NOISE_UNIT: f32 = 1.0 / 16.0;

impl Backdrop {
    /// Learns the empty scene from frames spread over a recording, in the order of time (or from a single picture of it).
    ///
    /// Frames are converted to the first median's exposure and the median is taken again, so that a flickering lamp
    /// does not widen the noise. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// No frames, frames of different sizes, or more than 255 of them.
    pub fn learn(frames: &[impl Borrow<RgbImage>]) -> Result<Self> {
        let frames: Vec<&RgbImage> = frames.iter().map(Borrow::borrow).collect();
        let Some(first) = frames.first() else {
            return Err(Error::option("background", "there is no frame to learn the empty scene from"));
        };
        let (width, height) = first.dimensions();
        if frames.len() > 255 || frames.iter().any(|f| f.dimensions() != (width, height)) {
            return Err(Error::option("background", "needs at most 255 frames, all of the same size"));
        }
        // The exposures are fitted to a few pixels, so the first median is taken over those alone.
        let samples: Vec<Vec<[u8; 3]>> = frames.par_iter().map(|frame| exposure::samples(frame)).collect();
        let mut median = vec![[0; 3]; samples[0].len()];
        let mut lanes = Vec::new();
        for (group, into) in median.as_flattened_mut().chunks_mut(LANES).enumerate() {
            lanes.clear();
            lanes.extend(samples.iter().map(|samples| lane(samples.as_flattened(), group)));
            into.copy_from_slice(&quantile(&lanes, 0.5)[..into.len()]);
        }
        let even = |samples: &Vec<[u8; 3]>| {
            Exposure::fit_samples(&median, samples, &Exposure::default()).inverse_table()
        };
        let tables: Vec<[[u8; 256]; 3]> = samples.par_iter().map(even).collect();
        let (mut picture, mut deviation) = (RgbImage::new(width, height), RgbImage::new(width, height));
        let mut others: Vec<Option<OtherColor>> = vec![None; width as usize * height as usize];
        let groups = picture.par_chunks_mut(LANES).zip(deviation.par_chunks_mut(LANES));
        let groups = groups.zip(others.par_chunks_mut(LANES / 3)).enumerate();
        groups.with_min_len(LEAST_GROUPS).for_each_init(
            Vec::new,
            |lanes, (group, ((middle, spread), others))| {
                lanes.resize(frames.len(), [0; LANES]);
                for ((even, frame), table) in lanes.iter_mut().zip(&frames).zip(&tables) {
                    let lane = lane(frame.as_raw(), group);
                    for (even, pixel) in even.as_chunks_mut::<3>().0.iter_mut().zip(lane.as_chunks::<3>().0) {
                        *even = std::array::from_fn(|c| table[c][pixel[c] as usize]);
                    }
                }
                let found = quantile(lanes, 0.5);
                middle.copy_from_slice(&found[..middle.len()]);
                for (pixel, other) in others.iter_mut().enumerate() {
                    let at = |lane: &[u8; LANES]| lane.as_chunks::<3>().0[pixel];
                    *other = recurrence::other_color(lanes.iter().map(at), at(&found));
                }
                for lane in lanes.iter_mut() {
                    lane.iter_mut().zip(&found).for_each(|(value, middle)| *value = value.abs_diff(*middle));
                }
                spread.copy_from_slice(&quantile(lanes, NOISE_QUANTILE)[..spread.len()]);
            },
        );
        recurrence::restore(&mut picture, &others);
        Ok(Self { noise: noise(&deviation), picture })
    }
}

/// One group of a picture's bytes; zeros beyond its end.
fn lane(bytes: &[u8], group: usize) -> [u8; LANES] {
    let rest = &bytes[group * LANES..];
    rest.first_chunk().copied().unwrap_or_else(|| {
        let mut lane = [0; LANES];
        lane[..rest.len()].copy_from_slice(rest);
        lane
    })
}

/// Quantile `fraction` over the frames' lanes, byte by byte.
///
/// Computed bit by bit from the top: the largest value below which at most `fraction` of the frames lie.
fn quantile(lanes: &[[u8; LANES]], fraction: f64) -> [u8; LANES] {
    let rank = ((lanes.len() - 1) as f64 * fraction).round() as u8;
    let mut found = [0_u8; LANES];
    for bit in (0..8).rev() {
        let tried = found.map(|value| value | (1 << bit));
        let mut below = [0_u8; LANES];
        for lane in lanes {
            for ((below, value), tried) in below.iter_mut().zip(lane).zip(&tried) {
                *below += u8::from(value < tried);
            }
        }
        for ((found, below), tried) in found.iter_mut().zip(below).zip(tried) {
            *found = if below <= rank { tried } else { *found };
        }
    }
    found
}

/// Standard deviation of each pixel, averaged over its neighbours, from the deviations of the three channels.
fn noise(deviation: &RgbImage) -> GrayImage {
    let (width, height) = deviation.dimensions();
    let mut sums = vec![0_u32; (width as usize + 1) * (height as usize + 1)];
    let row = width as usize + 1;
    for (x, y, pixel) in deviation.enumerate_pixels() {
        let at = (y as usize + 1) * row + x as usize + 1;
        let sum: u32 = pixel.0.iter().map(|d| *d as u32).sum();
        // Modulo 2³² the differences below stay correct even where the sums overflow.
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
            for fraction in [0.0, 0.35, 0.5, 1.0] {
                for group in 0..(13 * 7 * 3_usize).div_ceil(LANES) {
                    let lanes: Vec<[u8; LANES]> = frames.iter().map(|f| lane(f.as_raw(), group)).collect();
                    for (i, found) in quantile(&lanes, fraction).iter().enumerate() {
                        let at = |frame: &RgbImage| frame.as_raw().get(group * LANES + i).copied();
                        let mut values: Vec<u8> = frames.iter().map(|f| at(f).unwrap_or(0)).collect();
                        values.sort_unstable();
                        let expected = values[((count - 1) as f64 * fraction).round() as usize];
                        assert_eq!(*found, expected, "{count}, {fraction}");
                    }
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
                    // A person, 30 px wide, crosses once, and covers each place for a third of the time.
                    if (20..70).contains(&v) && u.abs_diff(t * 2) < 15 {
                        return Rgb([10, 20, 200]);
                    }
                    Rgb(scene(u, v).map(|s| (gain * s + normal.sample(&mut rng)).round() as u8))
                })
            })
            .collect();
        let backdrop = Backdrop::learn(&frames).unwrap();
        // The picture may have any of the flickering exposures, but must have one of them.
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
        // A pixel that shows a person in a third of the frames has its quantile half as far again from the median.
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
