//! Colours of detections, for `tracker link --video`.

use anyhow::bail;
use calib::video::FrameSource;
use image::RgbImage;
use shell::console::Console;

use mot::link::{Detections, colours};

/// Sets the colours of detections from the video in which they were found, and returns its rate, frames a second.
pub(super) fn look_at_video(
    video: &str,
    detections: &mut Detections,
    console: &Console,
) -> anyhow::Result<Option<f64>> {
    let mut source = FrameSource::open(video)?;
    let (rate, (width, height)) = (source.rate(), source.size());
    let frames = detections.frames();
    let mut progress = console.progress("looking", frames.last().map(|(frame, _)| u64::from(*frame)));
    let (mut image, mut at) = (RgbImage::default(), 0);
    for (frame, nodes) in frames {
        while at + 1 < frame && source.skip() {
            at += 1;
            progress.advance();
        }
        at += 1;
        if !source.read(&mut image)? {
            bail!(
                "{video}: ends before frame {frame}, which has detections; give the video they were found in"
            );
        }
        progress.advance();
        if let Err(outside) = colours::look(detections, nodes, &image) {
            bail!(
                "{video}: frame {}: a box lies outside the {width} × {height} pixels; give the video it was found in",
                outside.frame
            );
        }
    }
    Ok(rate)
}
