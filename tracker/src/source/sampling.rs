//! Frames sampled over a whole recording, for learning its empty scene.

use calib::video::FrameSource;
use image::RgbImage;

use crate::Result;

/// Largest number of frames; an odd number has a true median.
const FRAMES: usize = 41;
/// Most memory for the frames of one recording, bytes.
const MEMORY: usize = 400 << 20;
/// Number of delivered frames that are searched; later changes are left to the adaptive background.
const LOOK_THROUGH_FRAMES: usize = 20_000;

/// Opens a recording again and samples up to 41 frames, evenly spread over it, scaled to this width and height.
///
/// # Errors
/// As [`FrameSource::advance`].
pub fn spread(spec: &str, (width, height): (u32, u32)) -> Result<Vec<RgbImage>> {
    let mut source = FrameSource::open(spec)?;
    source.only_references();
    let most = most((width, height));
    // A video is assumed to deliver half of its frames.
    let known = source.frame_count().unwrap_or(0).min(LOOK_THROUGH_FRAMES);
    let delivered = if source.first_image().is_some() { known } else { known / 2 };
    let mut stride = stride(delivered, (width, height));
    let mut frames: Vec<RgbImage> = Vec::with_capacity(2 * most);
    for frame in 0..LOOK_THROUGH_FRAMES {
        if frame.is_multiple_of(stride) {
            let mut picture = RgbImage::new(width, height);
            match source.advance().and_then(|more| more.then(|| source.picture(&mut picture)).transpose()) {
                Ok(Some(())) => {}
                Err(error) if frames.is_empty() => return Err(error.into()),
                // The end, or an error that the run will report after the frames before it.
                Ok(None) | Err(_) => break,
            }
            frames.push(picture);
            // There are more frames than expected: keep every other one.
            if frames.len() > most + most / 2 {
                let mut index = 0;
                frames.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                stride *= 2;
            }
        } else if !source.skip() {
            break;
        }
    }
    Ok(frames)
}

/// Number of frames from one sampled frame to the next.
fn stride(frames: usize, size: (u32, u32)) -> usize {
    (frames / most(size)).max(1)
}

/// Number of frames of this size that fit into the memory.
fn most((width, height): (u32, u32)) -> usize {
    (MEMORY / (3 * width as usize * height as usize).max(1)).clamp(5, FRAMES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn frames_are_spread_evenly_over_the_whole_recording() {
        for count in [1, 3, 41, 100, 230] {
            let folder = tempfile::tempdir().unwrap();
            for i in 0..count {
                let picture = RgbImage::from_pixel(8, 6, Rgb([i as u8; 3]));
                picture.save(folder.path().join(format!("{i:03}.png"))).unwrap();
            }
            let frames = spread(folder.path().to_str().unwrap(), (8, 6)).unwrap();
            let taken: Vec<usize> = frames.iter().map(|f| f.get_pixel(0, 0)[0] as usize).collect();
            let step = taken.get(1).map_or(1, |second| second - taken[0]);
            assert!(taken.len() <= 62 && taken.len() >= count.min(31), "{count}: {taken:?}");
            assert!(taken[0] == 0 && taken.windows(2).all(|w| w[1] - w[0] == step), "{count}: {taken:?}");
            assert!(count - 1 - taken[taken.len() - 1] < step, "{count}: {taken:?}");
        }
    }
}
