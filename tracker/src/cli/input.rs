//! Input of a run: stations in this process, one for each source, or stations on other machines.

use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use anyhow::bail;
use scenes::room::Room;
use tracker::gathering::Alignment;
use tracker::method::Method;
use tracker::run::search_offsets;
use tracker::source::{self, CameraSource, CaptureTimes};
use tracker::stage::Stage;
use tracker::station::{self, Event, Permits, Port, Station};
use tracker::wire::{Downlink, Endpoints, Expected, ExpectedCamera, Fingerprint};

use super::clocks::Clocks;
use super::run_arguments::RunArgs;
use super::stations::StationBuilder;

/// Stations on other machines are waited for so long.
const STATIONS_WITHIN: Duration = Duration::from_mins(1);
/// Frames a second of stations that do not say.
const USUAL_RATE_HZ: f64 = 25.0;

/// The sources as they were given.
pub(super) enum Given {
    /// In this process.
    Local { sources: Vec<CameraSource>, clocks: Clocks },
    /// On other machines.
    Stations(Endpoints),
}

/// Sources that have been found.
pub(super) struct Input {
    /// Whether it shows what happens now.
    pub(super) is_live: bool,
    /// Whether cameras have pictures, which are there when they are asked for.
    pub(super) has_pictures: bool,
    /// Frames a second of the fastest camera.
    pub(super) rate_hz: f64,
    /// About how many moments there will be, where one can know.
    pub(super) promised: Option<usize>,
    /// Given alignments of the cameras' clocks, one a camera.
    pub(super) alignments: Vec<Alignment>,
    origin: Origin,
}

enum Origin {
    Local { sources: Vec<CameraSource>, times: Vec<CaptureTimes> },
    Stations { ports: Vec<Port>, events: Receiver<(usize, Event)>, downlink: Downlink },
}

/// Stations that work.
pub(super) struct Started {
    pub(super) ports: Vec<Port>,
    pub(super) events: Receiver<(usize, Event)>,
    /// Keeps stations on other machines connected.
    pub(super) downlink: Option<Downlink>,
}

impl Given {
    /// Looks at what was given: opens sources, checks addresses.
    pub(super) fn open(args: &RunArgs, room: &Room) -> anyhow::Result<Self> {
        if args.stations.is_none() && !args.endpoints.gathers() {
            args.endpoints.check_unused()?;
            let sources = source::open(room, args.sources())?;
            args.background.check_names(&args.video, args.used_masks())?;
            for camera in room.cameras.iter().filter(|c| !sources.iter().any(|s| s.name == c.name)) {
                tracing::warn!("camera `{}` has no source and is left out", camera.name);
            }
            let clocks = args.clocks.clocks(&sources)?;
            return Ok(Self::Local { sources, clocks });
        }
        if let Some(source) = args.video.iter().chain(&args.masks).chain(&args.detections).next() {
            bail!(
                "--stations: takes the place of --video, --masks and --detections; start `tracker station` for camera `{}` as well",
                source.name
            );
        }
        Ok(Self::Stations(args.endpoints.endpoints(args.stations.as_deref().unwrap_or_default())?))
    }

    /// The cameras that take part, in the order of the stage; empty for all of the room's.
    pub(super) fn cameras(&self) -> Vec<String> {
        match self {
            Self::Local { sources, .. } => sources.iter().map(|s| s.name.clone()).collect(),
            Self::Stations(_) => Vec::new(),
        }
    }

    /// Finds the stations on other machines.
    pub(super) fn connect(
        self,
        args: &RunArgs,
        room: &Room,
        stage: &Stage,
        interrupted: &AtomicBool,
    ) -> anyhow::Result<Input> {
        let endpoints = match self {
            Self::Local { sources, clocks } => {
                let (rate_hz, promised) = (clocks.lead_rate(), clocks.moments(&sources));
                let (times, alignments) = clocks.into_parts();
                return Ok(Input {
                    is_live: sources.iter().any(CameraSource::is_live),
                    has_pictures: sources.iter().any(|s| s.video.is_some()),
                    rate_hz,
                    promised,
                    alignments,
                    origin: Origin::Local { sources, times },
                });
            }
            Self::Stations(endpoints) => endpoints,
        };
        let camera = |c: &tracker::stage::StageCamera| ExpectedCamera {
            name: c.name.clone(),
            width: c.width(),
            height: c.height(),
        };
        let expected =
            Expected { room: Fingerprint::of(room), cameras: stage.cameras.iter().map(camera).collect() };
        let (inbox, events) = channel();
        tracing::info!("waiting for the stations");
        let (ports, downlink) = Downlink::open(expected, &endpoints, STATIONS_WITHIN, interrupted, inbox)?;
        let names: Vec<&str> = stage.cameras.iter().map(|c| c.name.as_str()).collect();
        let alignments = args.clocks.alignments(&names)?;
        let rates = ports.iter().filter_map(|port| port.rate_hz);
        let rate_hz = rates.fold(0.0, f64::max);
        let is_live = ports.iter().any(|port| port.is_live);
        if args.clocks.is_auto() && !is_live {
            bail!(
                "--offset auto: is for recordings of this machine and for live cameras; give --offset NAME=SECONDS"
            );
        }
        Ok(Input {
            is_live,
            has_pictures: false,
            rate_hz: if rate_hz > 0.0 { rate_hz } else { USUAL_RATE_HZ },
            promised: None,
            alignments,
            origin: Origin::Stations { ports, events, downlink },
        })
    }
}

impl Input {
    /// Starts the stations; the method is told of the empty scenes that it asks for. Offsets between recordings that are to be
    /// found are found before.
    pub(super) fn start(
        &mut self,
        args: &RunArgs,
        builder: &StationBuilder<'_>,
        method: &mut dyn Method,
        threads: usize,
    ) -> anyhow::Result<Started> {
        let none = Origin::Local { sources: Vec::new(), times: Vec::new() };
        let (sources, times) = match std::mem::replace(&mut self.origin, none) {
            Origin::Local { sources, times } => (sources, times),
            Origin::Stations { ports, events, downlink } => {
                return Ok(Started { ports, events, downlink: Some(downlink) });
            }
        };
        let is_searched = args.clocks.is_auto() && !self.is_live && sources.len() > 1;
        let mut stations = Vec::new();
        for (camera, built) in builder.build(sources, times.clone())?.into_iter().enumerate() {
            if let Some(picture) = built.empty_scene {
                method.set_empty_scene(camera, &picture);
            }
            stations.push(built.station);
        }
        if is_searched {
            tracing::info!("looking for the offsets between the recordings");
            let (ports, events) = start(stations, threads);
            let found = search_offsets(builder.stage, ports, &events, &self.alignments)?;
            self.alignments = found;
            let room = Room::read(&args.room)?;
            let again = source::open(&room, args.sources())?;
            stations = builder.build(again, times)?.into_iter().map(|built| built.station).collect();
        }
        let (ports, events) = start(stations, threads);
        Ok(Started { ports, events, downlink: None })
    }
}

/// Starts the stations on threads of this process.
fn start(stations: Vec<Station>, threads: usize) -> (Vec<Port>, Receiver<(usize, Event)>) {
    let (inbox, events) = channel();
    let permits = Permits::new(threads);
    let start = |(camera, station)| station::start(station, camera, inbox.clone(), &permits);
    (stations.into_iter().enumerate().map(start).collect(), events)
}
