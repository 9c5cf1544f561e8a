//! `tracker run`: from videos to tracks.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Context, bail};
use calib::console::Console;
use clap::{Args, ValueEnum};
use scenes::room::Room;
use tracker::film::{Film, FilmOptions};
use tracker::foreground::Verdict;
use tracker::gathering::{Gathering, GatheringOptions};
use tracker::method::Method;
use tracker::method::condensation::Condensation;
use tracker::method::mcmc::Mcmc;
use tracker::plan::TrajectoryPlan;
use tracker::run::{self, ClockOffsets, Ended, Output, Progress, RunReport};
use tracker::source::NamedSource;
use tracker::stage::{Stage, StageOptions, WORKING_WIDTH_PX};
use tracker::station::PictureDemand;
use tracker::tracks::TrackFiles;
use tracker::view::{Drawer, Screens, Server};
use tracker::wire::Endpoint;

use super::background::BackgroundArguments;
use super::clocks::ClockArguments;
use super::endpoints::EndpointArguments;
use super::heads::HeadArguments;
use super::input::{Given, Started};
use super::interrupt;
use super::sampler::SamplerArguments;
use super::stations::{Drawing, StationBuilder};
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
  tracker run myroom --video a=rtsp://camera/stream --background a=empty.mp4 --out out
  tracker run myroom --stations hall.local:7447,shop.local:7447 --out out")]
pub(crate) struct RunArgs {
    /// The room directory, as `recon build` makes it.
    pub(super) room: PathBuf,
    /// A camera's video: a file, a folder of images, a printf pattern, a stream's URL or a device number. A stream
    /// that breaks off is set aside, and taken back when it can be opened again.
    #[arg(long, value_name = "NAME=PATH")]
    pub(super) video: Vec<NamedSource>,
    /// Gather from stations on other machines (`tracker station`), at these addresses: host:port, or tls/host:port
    #[arg(long, value_name = "ENDPOINT[,…]", value_delimiter = ',')]
    pub(super) stations: Option<Vec<Endpoint>>,
    /// A camera's ready-made masks (folder of 8-bit images, 0 = background, or a video): no background subtraction.
    #[arg(long, value_name = "NAME=PATH")]
    pub(super) masks: Vec<NamedSource>,
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
    pub(super) clocks: ClockArguments,
    #[command(flatten)]
    pub(super) endpoints: EndpointArguments,
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
    /// Width of the films, both panels together, pixels
    #[arg(long, value_name = "PX", default_value_t = 960, value_parser = clap::value_parser!(u32).range(64..=7680))]
    film_width: u32,
    /// Width at which masks are made and compared, pixels: pictures that are wider are scaled while they are decoded
    #[arg(long, value_name = "PX", default_value_t = WORKING_WIDTH_PX)]
    mask_width: u32,
    /// How long live cameras wait for one that is late, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.3)]
    latency: f64,
    #[command(flatten)]
    view: ViewArguments,
    #[command(flatten)]
    pub(super) background: BackgroundArguments,
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

impl RunArgs {
    /// The masks that the method uses.
    pub(super) fn used_masks(&self) -> &[NamedSource] {
        match self.method {
            MethodName::Mcmc => &self.masks,
            // It looks at pictures alone.
            MethodName::Condensation => &[],
        }
    }

    fn method(&self, stage: &Stage, is_live: bool) -> anyhow::Result<Box<dyn Method>> {
        Ok(match self.method {
            MethodName::Mcmc => {
                let mut options = self.sampler.options(self.seed)?;
                options.max_people = self.most_people.unwrap_or(options.max_people);
                if self.sampler.lag.is_none() && is_live {
                    options.lag_s = 0.0;
                }
                Box::new(Mcmc::new(stage.clone(), options)?)
            }
            MethodName::Condensation => {
                let mut options = self.heads.options(self.seed, self.sampler.published)?;
                options.life.max_people = self.most_people.unwrap_or(options.life.max_people);
                Box::new(Condensation::new(stage.clone(), options)?)
            }
        })
    }
}

fn follow(args: &RunArgs, threads: usize, console: &Console) -> anyhow::Result<String> {
    let started = Instant::now();
    // What is wrong with the options is told before anything is read.
    args.sampler.options(args.seed)?;
    args.heads.options(args.seed, args.sampler.published)?;
    // The port before what takes its time to read.
    let listener = args.view.listener()?;
    let room = Room::read(&args.room)?;
    let given = Given::open(args, &room)?;
    let options = StageOptions {
        cameras: given.cameras(),
        occlusion: !args.no_occlusion,
        working_width_px: args.mask_width,
    };
    let stage = Stage::prepare(&room, &args.room, &options)?;
    let interrupted = interrupt::watch().context("the signals that end a run")?;
    let mut input = given.connect(args, &room, &stage, &interrupted)?;
    let is_live = input.is_live;
    let mut method = args.method(&stage, is_live)?;
    let looks = FilmOptions { width_px: args.film_width, is_live, ..FilmOptions::default() };
    let mut page = listener.map(|listener| view::serve(listener, &args.room, &stage)).transpose()?;
    let screens = page.as_ref().map(Server::screens);
    let demand = match screens {
        _ if !args.no_film => PictureDemand::Always,
        Some(screens) => {
            let screens = screens.clone();
            PictureDemand::While(Arc::new(move || screens.is_watched()))
        }
        None => PictureDemand::Never,
    };
    let builder = StationBuilder {
        stage: &stage,
        background: &args.background,
        needs: method.needs(),
        drawing: Drawing { looks: &looks, demand },
        is_live,
    };
    let Started { ports, events, downlink } = input.start(args, &builder, method.as_mut(), threads)?;
    let prepared = started.elapsed().as_secs_f64();
    tracing::debug!("room and backgrounds ready after {prepared:.2} s");
    // Everything that was given has been looked at: now something may be written.
    let mut outputs: Vec<Box<dyn Output>> = vec![Box::new(TrackFiles::new(&args.out, &stage))];
    outputs.push(Box::new(TrajectoryPlan::new(&args.out, &room, &args.room)));
    if !args.no_film {
        let audience = screens.map(Screens::audience);
        outputs.push(Box::new(Film::start(&args.out, &stage, input.rate_hz, &looks, audience.as_ref())?));
    } else if let Some(screens) = screens {
        outputs.push(Box::new(Drawer::start(&stage, &looks, screens, input.has_pictures)));
    }
    let mut progress = console.progress("tracking", input.promised.map(|n| n as u64));
    let alignments = input.alignments;
    let clocks = match stage.cameras.len() {
        0 | 1 => None,
        _ => {
            let applies = args.clocks.is_auto() && is_live;
            Some(ClockOffsets::new(&stage, alignments.clone(), is_live, applies)?)
        }
    };
    let options = GatheringOptions { alignments, latency_s: args.latency };
    let gathering = Gathering::new(ports, events, &options)?;
    let report = run::run(gathering, method.as_mut(), outputs, clocks, threads, |step| {
        if step == Progress::Moment {
            progress.advance();
        }
        if interrupted.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    drop((progress, downlink));
    if let Some(page) = &mut page {
        page.tell_the_end();
    }
    report.timings.write(&args.out.join("timings.json"))?;
    let report = report.unless_failed()?;
    if args.smooth {
        let mended = tracker::link::mend_run(&args.out, input.rate_hz)?;
        tracing::info!("{} tracks after linking over the whole recording", mended.tracks);
    }
    tell(&report, prepared, started.elapsed().as_secs_f64());
    Ok(String::new())
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
    let left_out = report.left_out;
    if left_out.late + left_out.skipped > 0 {
        tracing::info!(
            "{} frames came after their moment (--latency), {} moments were skipped to keep up",
            left_out.late,
            left_out.skipped
        );
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
