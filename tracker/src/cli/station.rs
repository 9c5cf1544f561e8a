//! `tracker station`: one camera's work in a process of its own.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::Context;
use clap::{Args, ValueEnum};
use scenes::room::{self, Room};
use shell::console::Console;

use shell::files::{paths_of, refuse_inputs};

use super::agent_station::{AgentStationArguments, StationRoom};
use super::background::BackgroundArguments;
use super::clocks::ClockArguments;
use super::endpoints::EndpointArguments;
use super::interrupt;
use super::stations::{Drawing, StationBuilder};
use crate::film::FilmOptions;
use crate::method::Needs;
use crate::prepared_room::{PreparationOptions, PreparedRoom, WORKING_WIDTH_PX};
use crate::source::{self, NamedSource, NamedSources};
use crate::station::{Event, Pace, Permits, PictureDemand};
use crate::wire::{Endpoint, Fingerprint, Hello, Uplink};

/// Longest wait of a recording's station for its gatherer.
const GATHERER_WITHIN: Duration = Duration::from_mins(10);

/// Tracking method that works in the stations themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum StationMethod {
    /// Distributed vision agents: each station tracks, and they exchange their observations.
    Agents,
}

/// Observe one camera on this machine, for a `tracker run --stations` on another; or track with other stations, without
/// one.
///
/// Masks, boxes and the colours of the foreground are sent to the gatherer; pictures are not, unless --pictures is given. A
/// live station goes on with and without a gatherer; that of a recording waits for it and keeps to its pace.
///
/// With --method agents there is no gatherer: each station tracks, sends about 40 bytes a person and frame to the
/// stations that see the same places, and writes its own OUT/tracks.txt, tracks.jsonl, boxes/NAME.txt, plan.png and
/// timings.json, with all people whom it or another station sees. Of each two stations one listens and the other
/// connects, or both --discover each other. A recording is played at its own speed; frames that a station cannot keep
/// up with are passed over. `tracker watch` shows which stations track whom.
///
/// All machines need the same room directory.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  tracker station myroom --camera cam0 --video rtsp://camera/stream --listen 0.0.0.0:7447
  tracker run myroom --stations camerahost0:7447,camerahost1:7447 --out out
  tracker station myroom --camera cam0 --video 0 --connect gatherer:7447
  tracker run myroom --listen 0.0.0.0:7447 --out out
  detector --camera 0 | tracker station myroom --camera cam0 --detections - --connect gatherer:7447
  tracker station myroom --camera cam0 --video rtsp://camera/stream --listen tls/0.0.0.0:7447 \\
      --tls-certificate cam0.pem --tls-key cam0.key --tls-authority ca.pem --allow gatherer
  tracker station myroom --camera cam0 --video 0 --method agents --out out0 --listen 0.0.0.0:7447
  tracker station myroom --camera cam1 --video 0 --method agents --out out1 --connect camerahost0:7447
  tracker station myroom --camera cam0 --video 0 --method agents --out out0 --listen 0.0.0.0:7447 \\
      --mqtt mqtt://broker:1883")]
pub(crate) struct StationArgs {
    /// Room directory, as made by `recon build`.
    room: PathBuf,
    /// Name of the camera in the room.
    #[arg(long, value_name = "NAME")]
    camera: String,
    /// Video of the camera: a file, a folder of images, a printf pattern, a stream's URL or a device number.
    #[arg(long, value_name = "PATH|URL", required_unless_present_any = ["masks", "detections"])]
    video: Option<String>,
    /// Ready-made masks (folder of 8-bit images, 0 = background, or a video), instead of background subtraction.
    #[arg(long, value_name = "PATH")]
    masks: Option<String>,
    /// A detector's boxes of people (MOTChallenge rows), beside video or masks or in place of them. A pipe, or - for standard
    /// input, is live: frames are taken as they come, as rows or as JSON lines; with --rate or --times it is read as a file
    #[arg(long, value_name = "FILE")]
    detections: Option<String>,
    /// Track on this machine, together with the stations of the other cameras
    #[arg(long, value_enum, conflicts_with = "pictures")]
    method: Option<StationMethod>,
    /// Connect to the gatherer, to another station, or to a Zenoh router, at this address; may be repeated
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',')]
    connect: Vec<Endpoint>,
    /// Width at which masks are made, pixels; the same as the gatherer's
    #[arg(long, value_name = "PX", default_value_t = WORKING_WIDTH_PX)]
    mask_width: u32,
    /// Send the pictures as well, at the size of films, for films and the page
    #[arg(long)]
    pictures: bool,
    #[command(flatten)]
    endpoints: EndpointArguments,
    #[command(flatten)]
    clocks: ClockArguments,
    #[command(flatten)]
    background: BackgroundArguments,
    #[command(flatten)]
    agents: AgentStationArguments,
}

/// Runs the subcommand.
pub(crate) fn station(args: &StationArgs, console: &Console) -> anyhow::Result<String> {
    calib::vision::set_threads(1)?;
    let endpoints = args.endpoints.endpoints(&args.connect)?;
    if args.method.is_none() {
        args.agents.check_unused()?;
    }
    if let Some(out) = args.agents.out() {
        let given = args.video.iter().chain(&args.masks).chain(&args.detections);
        let sources = given.flat_map(|spec| paths_of(spec));
        let inputs = sources.chain(args.clocks.paths()).chain(args.background.paths());
        refuse_inputs(out, inputs.chain(room::files_of(&args.room)))?;
    }
    let room = Room::read(&args.room)?;
    let named = |spec: &Option<String>| -> Vec<NamedSource> {
        let one = spec.iter().map(|spec| NamedSource { name: args.camera.clone(), spec: spec.clone() });
        one.collect()
    };
    let [videos, masks, detections] = [&args.video, &args.masks, &args.detections].map(named);
    let are_timed = args.clocks.are_given();
    let named = NamedSources { videos: &videos, masks: &masks, detections: &detections, are_timed };
    let sources = source::open(&room, named)?;
    args.background.check_names(&videos, &masks)?;
    args.clocks.refuse_offsets()?;
    let clocks = args.clocks.clocks(&sources)?;
    let is_live = sources.iter().any(source::CameraSource::is_live);
    let promised = clocks.moments(&sources);
    // All of the room's cameras, as in the gatherer: sampling depends on the floor that they see together.
    let options = PreparationOptions { working_width_px: args.mask_width, ..PreparationOptions::default() };
    let mut prepared = PreparedRoom::prepare(&room, &args.room, &options)?;
    prepared.leave_out_borders(&sources);
    let demand = if args.pictures { PictureDemand::Always } else { PictureDemand::Never };
    let builder = StationBuilder {
        room: &prepared,
        background: &args.background,
        needs: Needs { masks: true, pictures: false, empty_scene: false },
        drawing: Drawing { looks: &FilmOptions::default(), demand },
        pace: if is_live || args.method.is_some() { Pace::Live } else { Pace::Free },
        out: None,
    };
    let (times, _) = clocks.into_parts();
    let station = builder.build(sources, times)?.remove(0).station;
    let interrupted = interrupt::watch().context("the signals that end a station")?;
    if args.method.is_some() {
        let progress = console.progress("tracking", promised.map(|n| n as u64));
        let place = StationRoom { room: &room, room_dir: &args.room, prepared: prepared.clone() };
        args.agents.follow(place, station, &endpoints, (&interrupted, progress))?;
        return Ok(String::new());
    }
    let of_stage = prepared.camera_index(&args.camera).map(|i| &prepared.cameras[i]);
    let of_stage =
        of_stage.with_context(|| format!("--camera {}: the room has no such camera", args.camera))?;
    let hello = Hello {
        room: Fingerprint::of(&room),
        camera: args.camera.clone(),
        width: of_stage.width(),
        height: of_stage.height(),
        is_live: station.is_live(),
        rate_hz: station.rate_hz,
        has_boxes_alone: station.has_boxes_alone(),
    };
    let (mut uplink, feedback) = Uplink::open(hello, &endpoints)?;
    if !is_live {
        tracing::info!("waiting for the gatherer");
        uplink.wait_for_start(Some(GATHERER_WITHIN), &interrupted)?;
    }
    let mut progress = console.progress("observing", promised.map(|n| n as u64));
    let mut failure = None;
    station.run(&feedback, &Permits::new(1), |event| {
        if matches!(event, Event::Seen(_)) {
            progress.advance();
        }
        if let Err(error) = uplink.send(event) {
            failure = Some(error);
            return false;
        }
        !interrupted.load(Ordering::Relaxed)
    });
    drop(progress);
    failure.map_or(Ok(String::new()), |error| Err(error.into()))
}
