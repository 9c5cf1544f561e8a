//! Options of `tracker run`.

use std::path::PathBuf;

use anyhow::bail;
use clap::{Args, ValueEnum};
use scenes::room;
use shell::ranges::THREADS;

use super::background::BackgroundArguments;
use super::clocks::ClockArguments;
use super::endpoints::EndpointArguments;
use super::event_arguments::EventArguments;
use super::heads::HeadArguments;
use super::outputs;
use super::publish::PublishArguments;
use super::sampler::SamplerArguments;
use super::view::ViewArguments;
use crate::method::Method;
use crate::method::agents::Agents;
use crate::method::condensation::Condensation;
use crate::method::mcmc::Mcmc;
use crate::prepared_room::{PreparedRoom, WORKING_WIDTH_PX};
use crate::source::{NamedSource, NamedSources};
use crate::wire::Endpoint;

/// Tracking methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum MethodName {
    /// Trans-dimensional MCMC with occlusion predicted from the room.
    Mcmc,
    /// Heads by their edges, a particle filter for each person; needs no room geometry, but two cameras that see the
    /// head.
    Condensation,
    /// Distributed vision agents: a tracker for each camera, which exchange their observations; no camera depends on
    /// another.
    Agents,
}

/// Track everybody in a room from the videos of its cameras.
///
/// Writes OUT/tracks.txt (floor positions, MOTChallenge rows), OUT/tracks.jsonl (a line a frame, as it is made),
/// OUT/boxes/NAME.txt, OUT/timings.json and, unless --no-film is given, the films OUT/overlay/NAME.mp4; in a room with
/// zones, regions or lines also OUT/events.jsonl (who came, went, entered, left and crossed, as it happens), OUT/counts.csv,
/// OUT/heat.png and OUT/groups.csv; with --method agents also OUT/agents: the packets that the stations exchange, and figures of them. A moment is a frame of the
/// fastest camera with the nearest frames in time of the others. The shortest recording ends the run, or Ctrl-C: films,
/// plan and times are then those of the frames so far (a second Ctrl-C ends it at once). Cameras without a source are
/// left out.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  tracker run myroom --video cam0=cam0.mp4 --video cam1=cam1.mp4 --out out
  tracker run myroom --video a='frames/%04d.jpg' --times times.txt --out out --no-film
  tracker run myroom --video a=a.mp4 --video b=b.mp4 --offset b=2.4 --out out
  tracker run myroom --video a=a.mp4 --video b=b.mp4 --out out --view
  tracker run myroom --masks a=masks/a --masks b=masks/b --rate 4 --out out
  tracker run myroom --detections a=a.txt --detections b=b.txt --times times.txt --out out
  tracker run myroom --video a=rtsp://camera/stream --background a=empty.mp4 --out out
  tracker run myroom --video a=a.mp4 --out out --start 2026-11-26T09:00:00+01:00 --counts-every 300
  tracker run myroom --stations hall.local:7447,shop.local:7447 --out out
  tracker run myroom --video a=rtsp://camera/stream --out out --mqtt mqtt://broker:1883/shop --mqtt-discovery
  tracker run myroom --video a=rtsp://camera/stream --out out --metrics 127.0.0.1:9464")]
pub(crate) struct RunArgs {
    /// Room directory, as made by `recon build`.
    pub(super) room: PathBuf,
    /// Video of a camera: a file, a folder of images, a printf pattern, a stream's URL or a device number. A stream
    /// that breaks off is set aside, and used again when it can be reopened.
    #[arg(long, value_name = "NAME=PATH")]
    pub(super) video: Vec<NamedSource>,
    /// Gather from stations on other machines (`tracker station`), at these addresses: host:port, or tls/host:port
    #[arg(long, value_name = "ENDPOINT[,…]", value_delimiter = ',')]
    pub(super) stations: Option<Vec<Endpoint>>,
    /// Ready-made masks of a camera (folder of 8-bit images, 0 = background, or a video), instead of background
    /// subtraction.
    #[arg(long, value_name = "NAME=PATH")]
    pub(super) masks: Vec<NamedSource>,
    /// A detector's boxes of people in a camera (MOTChallenge rows frame,id,left,top,width,height,…; ids are ignored), beside
    /// video or masks or in place of them. A pipe, or - for standard input, is live: frames are taken as they come, as rows or
    /// as JSON lines {"time":…,"boxes":[{"left":…,"top":…,"width":…,"height":…},…]}; with --rate or --times it is read as a file
    #[arg(long, value_name = "NAME=FILE")]
    pub(super) detections: Vec<NamedSource>,
    /// Folder to write to.
    #[arg(long)]
    pub(super) out: PathBuf,
    /// Tracking method.
    #[arg(long, value_enum, default_value = "mcmc")]
    pub(super) method: MethodName,
    /// Seed of all random numbers: the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Number of worker threads (default: one a core). The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = THREADS.whole::<usize>())]
    pub(super) threads: Option<usize>,
    #[command(flatten)]
    pub(super) clocks: ClockArguments,
    #[command(flatten)]
    pub(super) endpoints: EndpointArguments,
    /// Largest number of people tracked at once; the sampler takes up to 31, of boxes alone up to 255 [default: 24, of boxes
    /// alone 255]
    #[arg(long, value_name = "N")]
    pub(super) most_people: Option<usize>,
    /// Ignore the room's geometry: only the floor hides people. For comparison.
    #[arg(long)]
    pub(super) no_occlusion: bool,
    /// At the end, link the tracks over the whole recording: a person who was lost for up to 2.5 seconds and found
    /// again keeps their id, and the gap is filled, in tracks.txt, tracks.jsonl and boxes. The films and the floor plan
    /// are drawn during the run, with the ids of that moment.
    #[arg(long)]
    pub(super) smooth: bool,
    /// Write no films.
    #[arg(long)]
    pub(super) no_film: bool,
    /// Width of the films, both panels together, pixels
    #[arg(long, value_name = "PX", default_value_t = 960, value_parser = clap::value_parser!(u32).range(64..=7680))]
    pub(super) film_width: u32,
    /// Width at which masks are made and compared, pixels: wider pictures are scaled while they are decoded
    #[arg(long, value_name = "PX", default_value_t = WORKING_WIDTH_PX)]
    pub(super) mask_width: u32,
    /// Longest wait of a moment of live cameras for a late camera, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.3)]
    pub(super) latency: f64,
    #[command(flatten)]
    pub(super) events: EventArguments,
    #[command(flatten)]
    pub(super) view: ViewArguments,
    #[command(flatten)]
    pub(super) publish: PublishArguments,
    #[command(flatten)]
    pub(super) background: BackgroundArguments,
    #[command(flatten)]
    pub(super) sampler: SamplerArguments,
    #[command(flatten)]
    pub(super) heads: HeadArguments,
}

impl RunArgs {
    /// Checks the options that can be checked before anything is read.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        self.sampler.options(self.seed)?;
        self.check_detections()?;
        self.events.options().validate()?;
        self.heads.options(self.seed, self.sampler.published)?;
        self.publish.check()
    }

    /// The sources of this machine.
    pub(super) fn sources(&self) -> NamedSources<'_> {
        NamedSources {
            videos: &self.video,
            masks: &self.masks,
            detections: &self.detections,
            are_timed: self.clocks.are_given(),
        }
    }

    /// Files and folders that the run reads.
    pub(super) fn inputs(&self) -> Vec<PathBuf> {
        let mut paths = outputs::paths_of_all(self.video.iter().chain(&self.masks).chain(&self.detections));
        paths.extend(self.clocks.paths());
        paths.extend(self.background.paths());
        paths.extend(room::files_of(&self.room));
        paths
    }

    /// Whether stations on other machines are to be gathered.
    pub(super) fn gathers(&self) -> bool {
        self.stations.is_some() || self.endpoints.gathers()
    }

    /// Refuses boxes for methods that do not look at them.
    pub(super) fn check_detections(&self) -> anyhow::Result<()> {
        if let (Some(given), MethodName::Condensation) = (self.detections.first(), self.method) {
            bail!("--detections {}={}: only --method mcmc and agents take boxes", given.name, given.spec);
        }
        Ok(())
    }

    /// Masks that the method uses.
    pub(super) fn used_masks(&self) -> &[NamedSource] {
        match self.method {
            MethodName::Mcmc | MethodName::Agents => &self.masks,
            // The method uses pictures alone.
            MethodName::Condensation => &[],
        }
    }

    /// The method, prepared for the room. `has_boxes_alone`: whether a detector's boxes are all that there is.
    pub(super) fn method(
        &self,
        prepared: &PreparedRoom,
        is_live: bool,
        has_boxes_alone: bool,
    ) -> anyhow::Result<Box<dyn Method>> {
        Ok(match self.method {
            MethodName::Mcmc => {
                let mut options = if has_boxes_alone {
                    self.sampler.of_boxes(self.seed)?
                } else {
                    self.sampler.options(self.seed)?
                };
                options.max_people = self.most_people.unwrap_or(options.max_people);
                if self.sampler.lag.is_none() && is_live {
                    options.lag_s = 0.0;
                }
                Box::new(Mcmc::new(prepared.clone(), options)?)
            }
            MethodName::Agents => {
                let options = super::agent_options::options(
                    &self.sampler,
                    self.seed,
                    self.most_people,
                    has_boxes_alone,
                )?;
                Box::new(Agents::new(prepared.clone(), &options)?)
            }
            MethodName::Condensation => {
                let mut options = self.heads.options(self.seed, self.sampler.published)?;
                options.life.max_people = self.most_people.unwrap_or(options.life.max_people);
                Box::new(Condensation::new(prepared.clone(), options)?)
            }
        })
    }
}
