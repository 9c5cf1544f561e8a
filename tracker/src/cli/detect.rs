//! `tracker detect`: detection of people in a camera's pictures, and training of a camera's own detector.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use calib::video::FrameSource;
use clap::{Args, Subcommand};
use image::RgbImage;
use mot::rows::RowFile;
use shell::console::Console;
use shell::files::{paths_of, refuse_inputs};
use shell::ranges::{SOME_FRAMES, THREADS};

use crate::detect::train::{self, Labelled, TrainOptions};
use crate::detect::{self, DetectOptions, Detector};

/// Detect people in a video, for `tracker link`.
///
/// Histograms of oriented gradients and a linear classifier: OpenCV's general one, or the camera's own from `tracker
/// detect train`. Writes MOTChallenge rows frame,-1,left,top,width,height,score; the score is the distance from the
/// classifier's boundary.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:
  tracker detect view1.avi --out detections.txt --min-height 60
  tracker detect train view1.avi --boxes labels.txt --out view1.json
  tracker detect view1.avi --model view1.json --out detections.txt
  tracker link detections.txt --out tracks.txt"
)]
pub(crate) struct DetectArgs {
    #[command(subcommand)]
    command: Option<DetectCommand>,
    /// Video: a file, a folder of images, a printf pattern, a stream's URL or a device number.
    #[arg(required = true)]
    video: Option<String>,
    /// File of detections to write.
    #[arg(long, value_name = "FILE", required = true)]
    out: Option<PathBuf>,
    /// The camera's own detector.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    #[command(flatten)]
    look: LookArguments,
}

#[derive(Debug, Subcommand)]
enum DetectCommand {
    Train(TrainArgs),
}

/// Options of the detector.
#[derive(Debug, Args)]
struct LookArguments {
    /// Height of the smallest person to detect, pixels. Half the height takes four times as long.
    #[arg(long, value_name = "PX", default_value_t = DetectOptions::default().min_height_px)]
    min_height: f64,
    /// Height of the tallest person to keep, pixels.
    #[arg(long, value_name = "PX")]
    max_height: Option<f64>,
    /// Least score to keep.
    #[arg(long, value_name = "SCORE", allow_negative_numbers = true, default_value_t = 0.0)]
    min_score: f64,
    /// Ratio of consecutive scales of the search: values nearer to 1 find more and take longer.
    #[arg(long, value_name = "RATIO", default_value_t = DetectOptions::default().scale_step)]
    scale_step: f64,
    /// Overlap (IoU) of two boxes above which only the one with the higher score is kept.
    #[arg(long, value_name = "IOU", default_value_t = DetectOptions::default().max_overlap)]
    max_overlap: f64,
    /// Number of worker threads (default: one a core). The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = THREADS.whole::<usize>())]
    threads: Option<usize>,
}

/// Train a camera's own detector from labelled boxes.
///
/// The labelled pictures provide people (as they are and mirrored), background around them, the gaps between people who
/// are close, and the general detector's false positives. Training starts from the general detector, so a few dozen
/// boxes are enough to refine it.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  tracker detect train view1.avi --boxes labels.txt --background empty.avi --out view1.json")]
struct TrainArgs {
    /// Video.
    video: String,
    /// Labels of all people in some of its frames: MOTChallenge rows; rows whose 7th column is 0 are neither person nor
    /// background.
    #[arg(long, value_name = "FILE")]
    boxes: PathBuf,
    /// File of the detector to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// A video of the same camera without people.
    #[arg(long, value_name = "VIDEO")]
    background: Option<String>,
    /// Largest number of frames to learn from, spread evenly.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = SOME_FRAMES.whole::<usize>())]
    frames: usize,
    /// Seed of the background's places and the order of learning: the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    look: LookArguments,
}

impl LookArguments {
    fn options(&self) -> anyhow::Result<DetectOptions> {
        let threads = match self.threads {
            Some(threads) => threads,
            None => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        };
        // The scales of one picture are searched in parallel; OpenCV's own loops stay on their threads.
        calib::vision::set_threads(1)?;
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().context("--threads")?;
        let options = DetectOptions {
            min_height_px: self.min_height,
            max_height_px: self.max_height,
            min_score: self.min_score,
            scale_step: self.scale_step,
            max_overlap: self.max_overlap,
        };
        options.check()?;
        Ok(options)
    }
}

/// Runs the subcommand.
pub(crate) fn detect(args: &DetectArgs, console: &Console) -> anyhow::Result<String> {
    if let Some(DetectCommand::Train(args)) = &args.command {
        return train(args, console);
    }
    let options = args.look.options()?;
    let (Some(video), Some(out)) = (&args.video, &args.out) else { bail!("give a video and --out FILE") };
    let inputs = paths_of(video).into_iter().chain(args.model.clone());
    refuse_inputs(out, inputs)?;
    let detector = match &args.model {
        Some(path) => Detector::read(path, options)?,
        None => Detector::general(options)?,
    };
    let mut source = FrameSource::open(video)?;
    let mut progress = console.progress("detecting", source.frame_count().map(|n| n as u64));
    let (mut text, mut image, mut frame, mut count) = (String::new(), RgbImage::default(), 0u32, 0);
    while source.read(&mut image)? {
        frame += 1;
        let found = detector.look(&image)?;
        count += found.len();
        text += &detect::rows(frame, &found);
        progress.advance();
    }
    drop(progress);
    calib::files::write_atomic(out, text.as_bytes())?;
    tracing::info!("{count} detections in {frame} frames");
    Ok(String::new())
}

fn train(args: &TrainArgs, console: &Console) -> anyhow::Result<String> {
    let detect = args.look.options()?;
    let videos = std::iter::once(&args.video).chain(&args.background).flat_map(|spec| paths_of(spec));
    refuse_inputs(&args.out, videos.chain([args.boxes.clone()]))?;
    let labelled = labelled(args)?;
    let mut empty = Vec::new();
    if let Some(video) = &args.background {
        empty = some_frames(video, args.frames).with_context(|| format!("--background {video}"))?;
    }
    let mut options = TrainOptions { detect, seed: args.seed, ..TrainOptions::default() };
    options.svm.seed = args.seed;
    let steps = (1 + options.rounds) * (labelled.len() + empty.len());
    let mut progress = console.progress("learning", Some(steps as u64));
    let (weights, report) = train::train(&labelled, &empty, &options, || progress.advance())
        .with_context(|| format!("{}", args.boxes.display()))?;
    drop(progress);
    train::write(&args.out, &weights)?;
    tracing::info!(
        "learnt from {} frames: {} examples of people, {} of background, {} gaps, {} mistakes",
        labelled.len() + empty.len(),
        report.people,
        report.background,
        report.gaps,
        report.mistakes
    );
    Ok(String::new())
}

/// Frames with boxes, at most as many as requested, with their people.
fn labelled(args: &TrainArgs) -> anyhow::Result<Vec<Labelled>> {
    let file = RowFile::read(&args.boxes)?;
    if !file.has_boxes() {
        bail!("{}: holds floor positions; a detector learns from boxes in the image", args.boxes.display());
    }
    let mut frames: Vec<u32> = file.rows.iter().map(|r| r.frame).collect();
    frames.sort_unstable();
    frames.dedup();
    let step = frames.len().div_ceil(args.frames).max(1);
    let chosen: Vec<u32> = frames.into_iter().step_by(step).collect();
    let mut source = FrameSource::open(&args.video)?;
    let (mut image, mut labelled) = (RgbImage::default(), Vec::new());
    let mut frame = 0;
    for wanted in chosen {
        while frame + 1 < wanted && source.skip() {
            frame += 1;
        }
        frame += 1;
        if !source.read(&mut image)? {
            bail!("{}: labels frame {wanted}, but {} ends before", args.boxes.display(), args.video);
        }
        let boxes = |counts: bool| {
            let rows = file.rows.iter().filter(move |r| r.frame == wanted && (r.confidence != 0.0) == counts);
            rows.filter_map(|r| r.pixel_box).collect()
        };
        labelled.push(Labelled { image: image.clone(), people: boxes(true), ignored: boxes(false) });
    }
    Ok(labelled)
}

/// Frames spread over a video, or its first ones if their number is unknown.
fn some_frames(video: &str, at_most: usize) -> anyhow::Result<Vec<RgbImage>> {
    let mut source = FrameSource::open(video)?;
    let step = source.frame_count().map_or(1, |n| n.div_ceil(at_most)).max(1);
    let mut frames = Vec::new();
    let mut image = RgbImage::default();
    while frames.len() < at_most && source.read(&mut image)? {
        frames.push(image.clone());
        for _ in 1..step {
            source.skip();
        }
    }
    if frames.is_empty() {
        bail!("{}: has no frame", Path::new(video).display());
    }
    Ok(frames)
}
