//! `tracker run`: from videos to tracks.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Context, bail};
use calib::console::Console;
use clap::{Args, ValueEnum};
use image::RgbImage;
use rayon::prelude::*;
use scenes::room::Room;
use tracker::film::{Film, FilmOptions};
use tracker::foreground::{Foreground, Start, Verdict};
use tracker::method::Method;
use tracker::method::condensation::Condensation;
use tracker::method::mcmc::Mcmc;
use tracker::plan::TrajectoryPlan;
use tracker::run::{self, CameraFeed, Ended, Output, RunOptions, RunReport};
use tracker::source::{self, CameraSource, NamedSource};
use tracker::stage::{Stage, StageOptions};
use tracker::tracks::TrackFiles;
use tracker::view::{Drawer, Screens, Server};

use super::background::{BackgroundArguments, KEEP_BYTES};
use super::clocks::ClockArguments;
use super::heads::HeadArguments;
use super::interrupt;
use super::sampler::SamplerArguments;
use super::view::{self, ViewArguments};

/// The published trackers.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum MethodName {
    /// Trans-dimensional MCMC with occlusion predicted from the room.
    Mcmc,
    /// Heads by their edges, a particle filter a person; needs no room geometry, but two cameras that see the head.
    Condensation,
}

/// Follow everybody in a room from the videos of its cameras.
///
/// Writes OUT/tracks.txt (floor positions, MOTChallenge rows), OUT/tracks.jsonl (a line a frame, as it is made),
/// OUT/boxes/NAME.txt, OUT/timings.json and, unless told otherwise, the films OUT/overlay/NAME.mp4. The cameras are
/// synchronised frame by frame where they have the same rate and start, by time otherwise; the shortest source ends the
/// run, or Ctrl-C: films, plan and times are then those of the frames so far (Ctrl-C again ends it at once). Cameras
/// without a source are left out.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  tracker run myroom --video cam0=cam0.mp4 --video cam1=cam1.mp4 --out out
  tracker run myroom --video a='frames/%04d.jpg' --times times.txt --out out --no-film
  tracker run myroom --video a=a.mp4 --video b=b.mp4 --offset b=2.4 --out out
  tracker run myroom --video a=a.mp4 --video b=b.mp4 --out out --view
  tracker run myroom --masks a=masks/a --masks b=masks/b --rate 4 --out out
  tracker run myroom --video a=rtsp://camera/stream --background a=empty.mp4 --out out")]
pub(crate) struct RunArgs {
    /// The room directory, as `recon build` makes it.
    room: PathBuf,
    /// A camera's video: a file, a folder of images, a printf pattern, a stream's URL or a device number. A stream
    /// that breaks off is set aside, and taken back when it can be opened again.
    #[arg(long, value_name = "NAME=PATH")]
    video: Vec<NamedSource>,
    /// A camera's ready-made masks (folder of 8-bit images, 0 = background, or a video): no background subtraction.
    #[arg(long, value_name = "NAME=PATH")]
    masks: Vec<NamedSource>,
    /// The folder to write to.
    #[arg(long)]
    out: PathBuf,
    /// The tracker.
    #[arg(long, value_enum, default_value = "mcmc")]
    method: MethodName,
    /// Seed of all random numbers: the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Worker threads (default: one a core). The result does not depend on it.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    #[command(flatten)]
    clocks: ClockArguments,
    /// The most people who are followed at once; the sampler takes up to 31 [default: 24]
    #[arg(long, value_name = "N")]
    most_people: Option<usize>,
    /// Ignore the room's geometry: nothing but the floor hides anybody. For comparison.
    #[arg(long)]
    no_occlusion: bool,
    /// At the end, link the tracks over the whole recording: somebody who was lost for up to 2.5 seconds and found again keeps
    /// their id, and the gap is filled, in tracks.txt, tracks.jsonl and boxes. The films and the floor plan are drawn as the
    /// run goes on: in them everybody keeps the ids of that moment.
    #[arg(long)]
    smooth: bool,
    /// Write no films.
    #[arg(long)]
    no_film: bool,
    #[command(flatten)]
    view: ViewArguments,
    #[command(flatten)]
    background: BackgroundArguments,
    #[command(flatten)]
    sampler: SamplerArguments,
    #[command(flatten)]
    heads: HeadArguments,
}

/// Runs the subcommand.
pub(crate) fn run(args: &RunArgs, console: &Console) -> anyhow::Result<String> {
    let threads = match args.threads {
        Some(0) => bail!("--threads 0: give at least 1"),
        Some(threads) => threads,
        None => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
    };
    // The cameras share the threads; OpenCV's own loops stay on theirs.
    calib::vision::set_threads(1)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("--threads")?;
    pool.install(|| follow(args, threads, console))
}

fn follow(args: &RunArgs, threads: usize, console: &Console) -> anyhow::Result<String> {
    let started = Instant::now();
    let mut sampler = args.sampler.options(args.seed)?;
    let mut heads = args.heads.options(args.seed, args.sampler.published)?;
    if let Some(most) = args.most_people {
        (sampler.max_people, heads.life.max_people) = (most, most);
    }
    // The port before what takes its time to read.
    let listener = args.view.listener()?;
    let room = Room::read(&args.room)?;
    let sources = source::open(&room, &args.video, &args.masks)?;
    let masks = match args.method {
        MethodName::Mcmc => args.masks.as_slice(),
        // It looks at pictures alone.
        MethodName::Condensation => &[],
    };
    args.background.check_names(&args.video, masks)?;
    for camera in room.cameras.iter().filter(|c| !sources.iter().any(|s| s.name == c.name)) {
        tracing::warn!("camera `{}` has no source and is left out", camera.name);
    }
    let schedule = args.clocks.schedule(&sources)?;
    let frames: Vec<Option<usize>> = sources.iter().map(CameraSource::frame_count).collect();
    let promised = schedule.moments(&frames);
    let stage = Stage::prepare(
        &room,
        &args.room,
        &StageOptions {
            cameras: sources.iter().map(|s| s.name.clone()).collect(),
            occlusion: !args.no_occlusion,
        },
    )?;
    let rate = schedule.mean_rate();
    let (mut method, feeds): (Box<dyn Method>, _) = match args.method {
        MethodName::Mcmc => {
            if args.sampler.lag.is_none() && sources.iter().any(CameraSource::is_live) {
                sampler.lag_s = 0.0;
            }
            let method = Mcmc::new(stage.clone(), sampler)?;
            (Box::new(method), feeds(args, sources, &stage)?)
        }
        MethodName::Condensation => {
            let needs_empty = heads.edges.moving_only;
            let mut method = Condensation::new(stage.clone(), heads)?;
            let mut feeds = Vec::new();
            for (camera, (feed, empty)) in
                pictures(args, sources, &stage, needs_empty)?.into_iter().enumerate()
            {
                if let Some(empty) = empty {
                    method.set_empty_scene(camera, &stage.cameras[camera].undistort.image(&empty));
                }
                feeds.push(feed);
            }
            (Box::new(method), feeds)
        }
    };
    let prepared = started.elapsed().as_secs_f64();
    tracing::debug!("room and backgrounds ready after {prepared:.2} s");
    // Everything that was given has been looked at: now something may be written.
    let mut outputs: Vec<Box<dyn Output>> = vec![Box::new(TrackFiles::new(&args.out, &stage))];
    outputs.push(Box::new(TrajectoryPlan::new(&args.out, &room, &args.room)));
    let looks = FilmOptions::default();
    let mut page = listener.map(|listener| view::serve(listener, &args.room, &stage)).transpose()?;
    let screens = page.as_ref().map(Server::screens);
    if !args.no_film {
        let audience = screens.map(Screens::audience);
        outputs.push(Box::new(Film::start(&args.out, &stage, rate, &looks, audience.as_ref())?));
    } else if let Some(screens) = screens {
        outputs.push(Box::new(Drawer::start(&stage, &looks, screens)));
    }
    let interrupted = interrupt::watch().context("the signals that end a run")?;
    let mut progress = console.progress("tracking", promised.map(|n| n as u64));
    let options = RunOptions { schedule, threads };
    let report = run::run(feeds, method.as_mut(), outputs, &options, || {
        progress.advance();
        if interrupted.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    drop(progress);
    if let Some(page) = &mut page {
        page.tell_the_end();
    }
    report.timings.write(&args.out.join("timings.json"))?;
    let report = report.unless_failed()?;
    if args.smooth {
        let mended = tracker::link::mend_run(&args.out, rate)?;
        tracing::info!("{} tracks after linking over the whole recording", mended.tracks);
    }
    tell(&report, prepared, started.elapsed().as_secs_f64());
    Ok(String::new())
}

/// Learns the backgrounds, cameras in parallel, and makes the feeds in the cameras' order.
fn feeds(args: &RunArgs, sources: Vec<CameraSource>, stage: &Stage) -> anyhow::Result<Vec<CameraFeed>> {
    let memory_bytes = KEEP_BYTES / sources.len().max(1);
    let feed = |mut source: CameraSource| {
        let foreground = match &mut source.video {
            Some(video) if source.masks.is_none() => {
                let (width, height) = video.source().size();
                let start = args.background.start(&source.name, video, memory_bytes)?;
                Some(Foreground::new(width, height, start, args.background.options())?)
            }
            _ => None,
        };
        Ok(CameraFeed::new(source, foreground, stage)?)
    };
    // All are made before the first failure is told, so that it is the first camera's.
    let feeds: Vec<anyhow::Result<CameraFeed>> = sources.into_par_iter().map(feed).collect();
    feeds.into_iter().collect()
}

/// The feeds of pictures alone in the cameras' order, each with the empty scene where it is asked for and known.
fn pictures(
    args: &RunArgs,
    sources: Vec<CameraSource>,
    stage: &Stage,
    needs_empty: bool,
) -> anyhow::Result<Vec<(CameraFeed, Option<RgbImage>)>> {
    let memory_bytes = KEEP_BYTES / sources.len().max(1);
    let feed = |mut source: CameraSource| {
        let start = match &mut source.video {
            Some(video) if needs_empty => Some(args.background.start(&source.name, video, memory_bytes)?),
            _ => None,
        };
        let empty = match start {
            Some(Start::Backdrop(backdrop)) => Some(backdrop.picture),
            _ => None,
        };
        Ok((CameraFeed::pictures(source, stage)?, empty))
    };
    let feeds: Vec<anyhow::Result<_>> = sources.into_par_iter().map(feed).collect();
    feeds.into_iter().collect()
}

fn tell(report: &RunReport, prepared_s: f64, all_s: f64) {
    for (name, (frames, why)) in &report.set_aside {
        let why = if *why == Verdict::Learning {
            "while it learnt its background".to_owned()
        } else {
            format!("first: {why}")
        };
        tracing::info!("camera `{name}` was set aside in {frames} of {} frames ({why})", report.frames);
    }
    match &report.ended {
        Ended::Source(name) => tracing::info!("the run ended where `{name}` ended"),
        Ended::Asked => tracing::info!("the run ended where it was interrupted"),
        // What it failed of is the one line of error.
        Ended::Failed(_) => {}
    }
    tracing::info!(
        "{} frames in {all_s:.2} s, {:.1} frames/s ({prepared_s:.2} s of it to read the room and learn the backgrounds)",
        report.frames,
        report.frames as f64 / all_s.max(1e-9),
    );
}
