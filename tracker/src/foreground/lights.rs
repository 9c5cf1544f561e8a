//! Empty scenes of a recording in several lights: a switched lamp changes all of the picture or a part of it, and each light
//! has its own empty scene.
//!
//! The light has changed between two sampled frames if the pictures before and after differ in many pixels, and by a factor
//! that varies slowly over the image ([`relight`]); people change fewer pixels, and not by a factor. A change of the camera's
//! exposure ([`Exposure`]) is no other light, unless the sensor clips levels, which cannot be computed back. During the run the
//! empty scene that explains most of the frame is the background.

use std::borrow::Borrow;
use std::ops::Range;

use image::RgbImage;

use super::backdrop::Backdrop;
use super::exposure::{Exposure, samples};
use super::median;
use super::pixels::{PixelModel, PixelOptions};
use super::relight;
use crate::Result;

/// Fewest sampled frames of which an empty scene can be learnt.
pub const LEAST_FRAMES: usize = 5;
/// Number of frames before and after a change that are compared: their median shows few people.
const SIDE: usize = 3;
/// Difference of levels, of any channel, from which on a pixel has changed.
const CHANGED_LEVELS: u8 = 20;
/// Least share of pixels that a change of the light changes.
const CHANGED_SHARE: f64 = 0.12;
/// Least share of the changed pixels that the change of the light explains.
const EXPLAINED_SHARE: f64 = 0.7;
/// Most lights of a recording; one with more has a light that never rests.
const MOST_LIGHTS: usize = 6;
/// Share of pixels by which another light must explain more than the present one.
const BETTER_SHARE: f64 = 0.08;

/// Empty scene of a recording in each of its lights, in the order in which they come, from frames spread over it.
///
/// # Errors
/// As [`Backdrop::learn`].
pub fn learn(frames: &[impl Borrow<RgbImage>]) -> Result<Vec<Backdrop>> {
    let frames: Vec<&RgbImage> = frames.iter().map(Borrow::borrow).collect();
    let same_size = frames.windows(2).all(|pair| pair[0].dimensions() == pair[1].dimensions());
    if !same_size || frames.len() < 2 * LEAST_FRAMES {
        return Ok(vec![Backdrop::learn(&frames)?]);
    }
    let lights = of_one_light(&frames);
    if lights.len() > MOST_LIGHTS {
        return Ok(vec![Backdrop::learn(&frames)?]);
    }
    let of = |numbers: &Vec<usize>| numbers.iter().map(|number| frames[*number]).collect::<Vec<_>>();
    lights.iter().map(|numbers| Backdrop::learn(&of(numbers))).collect()
}

/// Numbers of the frames of each light; lights are in the order of their first frames.
fn of_one_light(frames: &[&RgbImage]) -> Vec<Vec<usize>> {
    let grids: Vec<Vec<[u8; 3]>> = frames.iter().map(|frame| samples(frame)).collect();
    let mut lights: Vec<(Vec<[u8; 3]>, Vec<usize>)> = Vec::new();
    for stretch in stretches(frames, &grids) {
        let look = median_grid(&grids[stretch.clone()]);
        // A lamp that is switched off again leaves the light in which the recording began.
        let known = lights.iter_mut().find(|(other, _)| difference(other, &look) < CHANGED_SHARE);
        match known {
            Some((_, numbers)) => numbers.extend(stretch),
            None => lights.push((look, stretch.collect())),
        }
    }
    lights.into_iter().map(|(_, numbers)| numbers).collect()
}

/// Stretches of frames between changes of the light.
fn stretches(frames: &[&RgbImage], grids: &[Vec<[u8; 3]>]) -> Vec<Range<usize>> {
    let count = frames.len();
    let sides = |at: usize| (at.saturating_sub(SIDE)..at, at..(at + SIDE).min(count));
    let mut changes: Vec<(f64, usize)> = (LEAST_FRAMES..=count - LEAST_FRAMES)
        .map(|at| {
            let (before, after) = sides(at);
            (difference(&median_grid(&grids[before]), &median_grid(&grids[after])), at)
        })
        .filter(|(share, _)| *share >= CHANGED_SHARE)
        .collect();
    // The largest first; of equal ones the first in time.
    changes.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut ends: Vec<usize> = Vec::new();
    for (_, at) in changes {
        let (before, after) = sides(at);
        if ends.iter().all(|end| end.abs_diff(at) >= LEAST_FRAMES)
            && is_other_light(&median::of_pictures(&frames[before]), &median::of_pictures(&frames[after]))
        {
            ends.push(at);
        }
    }
    ends.sort_unstable();
    ends.push(count);
    let mut start = 0;
    ends.into_iter().map(|end| std::mem::replace(&mut start, end)..end).collect()
}

/// Whether nearly all that differs in two pictures is the light.
fn is_other_light(before: &RgbImage, after: &RgbImage) -> bool {
    let changed = before.pixels().zip(after.pixels()).map(|(a, b)| is_changed(a.0, b.0));
    relight::relit(before, after).is_some_and(|relit| relit.explained_share(changed) >= EXPLAINED_SHARE)
}

fn is_changed(a: [u8; 3], b: [u8; 3]) -> bool {
    (0..3).any(|c| a[c].abs_diff(b[c]) > CHANGED_LEVELS)
}

/// Share of pixels that differ in two pictures, whichever of them is brought to the exposure of the other.
fn difference(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
    unexplained_share(a, b).max(unexplained_share(b, a))
}

/// Share of a frame's pixels that a scene in the frame's exposure does not explain.
fn unexplained_share(scene: &[[u8; 3]], frame: &[[u8; 3]]) -> f64 {
    let table = Exposure::fit_samples(scene, frame, &Exposure::default()).table();
    let expected = scene.iter().map(|color| std::array::from_fn(|c| table[c][color[c] as usize]));
    let changed = expected.zip(frame).filter(|(expected, seen)| is_changed(*expected, **seen)).count();
    changed as f64 / scene.len().max(1) as f64
}

/// Median of each channel of some pixels over several pictures, at least one.
fn median_grid(grids: &[Vec<[u8; 3]>]) -> Vec<[u8; 3]> {
    let mut levels = vec![0; grids.len()];
    (0..grids[0].len())
        .map(|pixel| {
            std::array::from_fn(|channel| {
                for (level, grid) in levels.iter_mut().zip(grids) {
                    *level = grid[pixel][channel];
                }
                median::of_levels(&mut levels)
            })
        })
        .collect()
}

/// Models of a camera's empty scene in each of its known lights, of which the present one is in use.
#[derive(Debug, Clone)]
pub(super) struct Lights {
    models: Vec<PixelModel>,
    /// Some pixels of the empty scene in each light.
    looks: Vec<Vec<[u8; 3]>>,
    present: usize,
}

impl Lights {
    /// Models of these empty scenes, at least one, of which the first is in use.
    pub(super) fn new(scenes: &[Backdrop], options: &PixelOptions) -> Self {
        Self {
            models: scenes.iter().map(|scene| PixelModel::new(scene, options)).collect(),
            looks: scenes.iter().map(|scene| samples(&scene.picture)).collect(),
            present: 0,
        }
    }

    /// Model of the present light.
    pub(super) fn present(&self) -> &PixelModel {
        &self.models[self.present]
    }

    /// Model of the present light.
    pub(super) fn present_mut(&mut self) -> &mut PixelModel {
        &mut self.models[self.present]
    }

    /// Takes the light in which a frame was taken. Returns whether it is another one than before.
    pub(super) fn follow(&mut self, frame: &RgbImage) -> bool {
        if self.looks.len() < 2 {
            return false;
        }
        let seen = samples(frame);
        let explained = |light: &Vec<[u8; 3]>| 1.0 - unexplained_share(light, &seen);
        let shares: Vec<f64> = self.looks.iter().map(explained).collect();
        let least = shares[self.present] + BETTER_SHARE;
        let best = (0..shares.len()).max_by(|a, b| shares[*a].total_cmp(&shares[*b]).then(b.cmp(a)));
        let better = best.filter(|light| shares[*light] >= least);
        self.present = better.unwrap_or(self.present);
        better.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn room(u: u32, v: u32) -> [f64; 3] {
        let tile = if (u / 9 + v / 7).is_multiple_of(2) { 0.0 } else { 40.0 };
        [70.0 + tile, 60.0 + tile + f64::from(v) / 4.0, 50.0 + f64::from(u) / 3.0]
    }

    /// Frames in a light of their own each, with a person who walks through.
    fn frames(light: impl Fn(usize, u32) -> f64) -> Vec<RgbImage> {
        let mut rng = Pcg64Mcg::seed_from_u64(4);
        (0..40)
            .map(|t| {
                RgbImage::from_fn(160, 120, |u, v| {
                    if (30..100).contains(&v) && u.abs_diff(4 * t as u32) < 5 {
                        return Rgb([20, 30, 140]);
                    }
                    let noise: f64 = rng.random_range(-3.0..3.0);
                    Rgb(room(u, v).map(|level| (level * light(t, u) + noise).clamp(0.0, 255.0) as u8))
                })
            })
            .collect()
    }

    #[test]
    fn an_empty_scene_is_learnt_in_each_light() {
        let half = |t: usize, u: u32| if t >= 15 && u < 80 { 1.7 } else { 1.0 };
        let twice = |t: usize, u: u32| if (10..25).contains(&t) && u > 90 { 0.5 } else { 1.0 };
        for (case, light) in [&half as &dyn Fn(usize, u32) -> f64, &twice].into_iter().enumerate() {
            let scenes = learn(&frames(light)).unwrap();
            assert_eq!(scenes.len(), 2, "{case}");
            // The light of a frame in the middle of the second stretch.
            for (scene, t) in scenes.iter().zip([2, if case == 1 { 18 } else { 30 }]) {
                let wrong = scene.picture.enumerate_pixels().filter(|(u, v, found)| {
                    let lit = room(*u, *v).map(|level| (level * light(t, *u)).min(255.0));
                    (0..3).any(|c| (f64::from(found[c]) - lit[c]).abs() > 8.0)
                });
                assert!(wrong.count() < 160 * 120 / 50, "{case}, frame {t}");
            }
        }
    }

    #[test]
    fn people_and_small_changes_are_no_lights() {
        assert_eq!(learn(&frames(|_, _| 1.0)).unwrap().len(), 1);
        // Exposure is compensated frame by frame.
        assert_eq!(learn(&frames(|t, _| if t >= 20 { 1.3 } else { 0.7 })).unwrap().len(), 1);
        // A lamp on a tenth of the picture; somebody who stands before the camera for half the time.
        assert_eq!(learn(&frames(|t, u| if t >= 20 && u < 16 { 1.7 } else { 1.0 })).unwrap().len(), 1);
        let mut covered = frames(|_, _| 1.0);
        for frame in &mut covered[20..] {
            for (u, v, pixel) in frame.enumerate_pixels_mut() {
                if u < 70 {
                    pixel.0 = [(u * 13 + v * 29 % 97) as u8, 90, 200];
                }
            }
        }
        assert_eq!(learn(&covered).unwrap().len(), 1);
    }

    #[test]
    fn the_light_of_each_frame_is_chosen() {
        let frames = frames(|t, u| if (10..25).contains(&t) && u < 80 { 1.7 } else { 1.0 });
        let mut lights = Lights::new(&learn(&frames).unwrap(), &PixelOptions::default());
        let changes: Vec<(usize, usize)> = frames
            .iter()
            .enumerate()
            .filter_map(|(t, frame)| lights.follow(frame).then_some((t, lights.present)))
            .collect();
        assert_eq!(changes, [(10, 1), (25, 0)]);
    }
}
