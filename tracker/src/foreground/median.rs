//! Medians over time of levels and pictures.

use image::RgbImage;

/// Median of some levels, at least one; they are reordered.
pub(super) fn of_levels(levels: &mut [u8]) -> u8 {
    let middle = levels.len() / 2;
    *levels.select_nth_unstable(middle).1
}

/// Median picture of a few frames.
pub(super) fn of_pictures(frames: &[&RgbImage]) -> RgbImage {
    let mut picture = frames[0].clone();
    let mut levels = vec![0; frames.len()];
    for (at, into) in picture.iter_mut().enumerate() {
        for (level, frame) in levels.iter_mut().zip(frames) {
            *level = frame.as_raw()[at];
        }
        *into = of_levels(&mut levels);
    }
    picture
}
