//! Writes a stretch of a film as a moving picture (APNG) for the README: pixels that hardly change stay as they are, so that it is small.
//!
//! `cargo run --release -p tests --example moving_picture -- FILM FIRST LAST WIDTH FILE.png`: frames from 1, each second one.
#![forbid(unsafe_code)]

use std::fs::File;
use std::io::BufWriter;

use calib::video::FrameSource;
use image::imageops::{FilterType, resize};
use image::{Rgba, RgbaImage};
use tests::chain::StepResult;

/// Frames of the film a frame of the picture.
const EVERY: usize = 2;
/// Largest change of a channel that is not shown: noise of the camera and of the film's compression.
const UNSEEN: u8 = 14;
/// Duration of a frame of the picture, seconds, as a fraction.
const DELAY: (u16, u16) = (1, 7);

fn main() -> StepResult<()> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [film, first, last, width, out] = given.as_slice() else {
        return Err("FILM FIRST LAST WIDTH FILE.png".into());
    };
    let number = |text: &String| text.parse::<usize>().map_err(|e| format!("{text}: {e}"));
    let (first, last, width) = (number(first)?, number(last)?, number(width)? as u32);
    let mut source = FrameSource::open(film).map_err(|e| e.to_string())?;
    let mut frame = image::RgbImage::default();
    let (mut frames, mut shown): (Vec<RgbaImage>, Option<RgbaImage>) = (Vec::new(), None);
    for number in 1..=last {
        if !source.read(&mut frame).map_err(|e| e.to_string())? {
            return Err(format!("{film} has {} frames", number - 1));
        }
        if number < first || (number - first) % EVERY != 0 {
            continue;
        }
        let height = width * frame.height() / frame.width();
        let small = image::DynamicImage::from(resize(&frame, width, height, FilterType::Triangle)).to_rgba8();
        let shown = shown.get_or_insert_with(|| RgbaImage::new(width, height));
        frames.push(changed(shown, &small));
    }
    write(out, &frames)
}

/// The pixels of `next` that differ visibly from those shown, the others transparent; they are shown from now on.
fn changed(shown: &mut RgbaImage, next: &RgbaImage) -> RgbaImage {
    let mut drawn = RgbaImage::new(next.width(), next.height());
    for ((shown, next), drawn) in shown.pixels_mut().zip(next.pixels()).zip(drawn.pixels_mut()) {
        if (0..4).any(|k| shown[k].abs_diff(next[k]) > UNSEEN) {
            let Rgba([r, g, b, _]) = *next;
            // Four levels in one: the eye does not see them, the compression does.
            *drawn = Rgba([r & !3, g & !3, b & !3, 255]);
            *shown = *next;
        }
    }
    drawn
}

fn write(path: &str, frames: &[RgbaImage]) -> StepResult<()> {
    let told = |e: &dyn std::fmt::Display| format!("{path}: {e}");
    let first = frames.first().ok_or_else(|| format!("{path}: no frames"))?;
    let file = BufWriter::new(File::create(path).map_err(|e| told(&e))?);
    let mut encoder = png::Encoder::new(file, first.width(), first.height());
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_compression(png::Compression::High);
    encoder.set_animated(frames.len() as u32, 0).map_err(|e| told(&e))?;
    encoder.set_frame_delay(DELAY.0, DELAY.1).map_err(|e| told(&e))?;
    encoder.set_blend_op(png::BlendOp::Over).map_err(|e| told(&e))?;
    let mut writer = encoder.write_header().map_err(|e| told(&e))?;
    for frame in frames {
        writer.write_image_data(frame.as_raw()).map_err(|e| told(&e))?;
    }
    writer.finish().map_err(|e| told(&e))
}
