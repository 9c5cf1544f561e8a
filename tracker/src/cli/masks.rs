//! `tracker masks`: foreground masks as pictures.

use std::path::PathBuf;

use anyhow::{Context, bail};
use calib::picture;
use calib::video::FrameSource;
use clap::Args;
use image::{GrayImage, RgbImage};
use shell::console::Console;
use shell::ranges::RATE_HZ;

use shell::files::{OutputLock, refuse_inputs};

use super::background::BackgroundArguments;
use super::outputs;
use crate::foreground::{Foreground, Verdict};
use crate::source::{CaptureTimes, NamedSource, Times, VideoSource};

/// Write the foreground masks of videos as pictures, to look at or to use with `tracker run --masks`.
///
/// The masks are in the videos' own images, not undistorted: OUT/NAME/000001.png, 255 where there is foreground.
/// Unusable frames (frozen, dark, lights switched) are black and named in the log.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  tracker masks --video cam0=cam0.mp4 --out masks\n  tracker run myroom --masks cam0=masks/cam0 --out out"
)]
pub(crate) struct MasksArgs {
    /// A video, as `tracker run` takes it; may be given several times
    #[arg(long, value_name = "NAME=PATH", required = true)]
    video: Vec<NamedSource>,
    /// Folder to write to
    #[arg(long)]
    out: PathBuf,
    /// Capture times of the frames, seconds, a line a frame
    #[arg(long, value_name = "FILE", conflicts_with = "rate")]
    times: Option<PathBuf>,
    /// Frame rate, frames a second, where the video states none or a wrong one
    #[arg(long, value_parser = RATE_HZ.number())]
    rate: Option<f64>,
    /// Also write the background, as OUT/NAME/background.jpg, and each frame with its mask's outline
    #[arg(long)]
    outlines: bool,
    #[command(flatten)]
    background: BackgroundArguments,
}

/// Runs the subcommand.
pub(crate) fn masks(args: &MasksArgs, console: &Console) -> anyhow::Result<String> {
    args.background.check_names(&args.video, &[])?;
    let inputs = outputs::paths_of_all(&args.video)
        .into_iter()
        .chain(args.times.clone())
        .chain(args.background.paths());
    refuse_inputs(&args.out, inputs)?;
    let mut lock = OutputLock::if_present(&args.out)?;
    for named in &args.video {
        args.one(named, &mut lock, console)?;
    }
    Ok(String::new())
}

impl MasksArgs {
    fn one(&self, named: &NamedSource, lock: &mut OutputLock<'_>, console: &Console) -> anyhow::Result<()> {
        if named.name.contains(['/', '\\']) || named.name == ".." {
            bail!("--video {}: the name becomes a folder; it must not hold a slash", named.name);
        }
        let video = FrameSource::open(&named.spec)?;
        let (width, height) = video.size();
        let (count, rate) = (video.frame_count(), video.rate());
        let mut times = match (&self.times, self.rate, rate) {
            (Some(path), ..) => CaptureTimes::given(&named.spec, Times::read(path)?),
            (None, None, Some(rate)) => CaptureTimes::presentation(&named.spec, rate),
            (None, given, _) => {
                let rate = given.unwrap_or(crate::source::times::DEFAULT_RATE);
                CaptureTimes::given(&named.spec, Times::steady(rate)?)
            }
        };
        let (start, mut video) = {
            let source = VideoSource::Recorded(video);
            let start = self.background.start(&named.name, &source, (width, height), (width, height))?;
            let VideoSource::Recorded(video) = source else { return Ok(()) };
            (start, video)
        };
        let mut foreground = Foreground::new(width, height, start, self.background.options())?;
        let folder = self.out.join(&named.name);
        lock.hold()?;
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        let mut progress = console.progress(&format!("masks of {}", named.name), count.map(|n| n as u64));
        let (mut image, mut mask) = (RgbImage::default(), GrayImage::default());
        let mut frame = 0;
        while video.read(&mut image)? {
            frame += 1;
            let time_s = times.next(video.stamp().presentation_s)?;
            let verdict = foreground.mask(&image, time_s, &mut mask)?;
            if verdict != Verdict::Usable {
                tracing::warn!("{}: frame {frame}: {verdict}", named.name);
                mask.fill(0);
            }
            let path = folder.join(format!("{frame:06}.png"));
            picture::write(&path, &mask)?;
            if self.outlines {
                let path = folder.join(format!("outline_{frame:06}.jpg"));
                picture::write(&path, &outlined(&image, &mask))?;
            }
            progress.advance();
        }
        if self.outlines {
            picture::write(&folder.join("background.jpg"), foreground.background())?;
        }
        Ok(())
    }
}

/// The picture, darkened outside the mask, with the mask's edge in yellow.
fn outlined(image: &RgbImage, mask: &GrayImage) -> RgbImage {
    let (width, height) = image.dimensions();
    RgbImage::from_fn(width, height, |x, y| {
        let inside = |x: u32, y: u32| mask.get_pixel(x.min(width - 1), y.min(height - 1))[0] > 0;
        let here = inside(x, y);
        if here != inside(x + 1, y) || here != inside(x, y + 1) {
            return image::Rgb([255, 230, 0]);
        }
        image::Rgb(image.get_pixel(x, y).0.map(|v| if here { v } else { v / 2 }))
    })
}
