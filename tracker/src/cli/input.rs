//! Input of a run: stations in this process, one for each source, or stations on other machines.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use anyhow::bail;
use scenes::room::Room;

use super::clocks::Clocks;
use super::run_arguments::RunArgs;
use super::stations::StationBuilder;
use crate::doctor::film_times::{self, FilmTimes};
use crate::doctor::views;
use crate::gathering::ClockAlignment;
use crate::method::Method;
use crate::prepared_room::{PreparationOptions, PreparedRoom};
use crate::run::search_offsets;
use crate::source::{self, CameraSource, CaptureTimes, VideoSource};
use crate::station::{self, Event, Permits, Port, Station};
use crate::wire::{Downlink, Endpoints, ExpectedCamera, ExpectedStations, Fingerprint};

/// Longest wait for stations on other machines.
const STATIONS_WITHIN: Duration = Duration::from_mins(1);
/// Frame rate assumed for stations that state none, frames a second.
const USUAL_RATE_HZ: f64 = 25.0;

/// Sources as given on the command line.
pub(super) enum RunSources {
    /// In this process.
    Local { sources: Vec<CameraSource>, clocks: Clocks },
    /// On other machines.
    Stations(Endpoints),
}

/// Sources of a run, opened or connected.
pub(super) struct RunInput {
    /// Whether the input is live.
    pub(super) is_live: bool,
    /// Whether cameras have pictures that can be demanded.
    pub(super) has_pictures: bool,
    /// Whether a detector's boxes are all that there is.
    pub(super) has_boxes_alone: bool,
    /// Frame rate of the fastest camera, frames a second.
    pub(super) rate_hz: f64,
    /// Approximate number of moments; `None` where it cannot be known.
    pub(super) promised: Option<usize>,
    /// Given alignments of the cameras' clocks, one a camera.
    pub(super) alignments: Vec<ClockAlignment>,
    origin: InputOrigin,
}

enum InputOrigin {
    Local { sources: Vec<CameraSource>, times: Vec<CaptureTimes> },
    Stations { ports: Vec<Port>, events: Receiver<(usize, Event)>, downlink: Downlink },
}

/// Stations that have been started.
pub(super) struct Started {
    pub(super) ports: Vec<Port>,
    pub(super) events: Receiver<(usize, Event)>,
    /// Keeps stations on other machines connected.
    pub(super) downlink: Option<Downlink>,
}

impl RunSources {
    /// Opens the sources, or checks the stations' addresses.
    pub(super) fn open(args: &RunArgs, room: &Room) -> anyhow::Result<Self> {
        if args.stations.is_none() && !args.endpoints.gathers() {
            args.endpoints.check_unused()?;
            let sources = source::open(room, args.sources())?;
            args.background.check_names(&args.video, args.used_masks())?;
            for camera in room.cameras.iter().filter(|c| !sources.iter().any(|s| s.name == c.name)) {
                tracing::warn!("camera `{}` has no source and is left out", camera.name);
            }
            let clocks = args.clocks.clocks(&sources)?;
            if args.clocks.is_default() {
                warn_of_times(&sources);
            }
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

    /// Cameras of the run, in the order of the prepared room; empty for all of the room's.
    pub(super) fn cameras(&self) -> Vec<String> {
        match self {
            Self::Local { sources, .. } => sources.iter().map(|s| s.name.clone()).collect(),
            Self::Stations(_) => Vec::new(),
        }
    }

    /// Prepares the room without the blind borders of the sources' pictures.
    pub(super) fn prepare(
        &self,
        room: &Room,
        room_dir: &Path,
        options: &PreparationOptions,
    ) -> anyhow::Result<PreparedRoom> {
        let mut prepared = PreparedRoom::prepare(room, room_dir, options)?;
        if let Self::Local { sources, .. } = self {
            prepared.leave_out_borders(sources);
        }
        Ok(prepared)
    }

    /// Connects to the stations on other machines.
    pub(super) fn connect(
        self,
        args: &RunArgs,
        room: &Room,
        prepared: &PreparedRoom,
        interrupted: &AtomicBool,
    ) -> anyhow::Result<RunInput> {
        let endpoints = match self {
            Self::Local { sources, clocks } => {
                let (rate_hz, promised) = (clocks.lead_rate(), clocks.moments(&sources));
                let (times, alignments) = clocks.into_parts();
                return Ok(RunInput {
                    is_live: sources.iter().any(CameraSource::is_live),
                    has_pictures: sources.iter().any(|s| s.video.is_some()),
                    has_boxes_alone: sources.iter().all(CameraSource::has_boxes_alone),
                    rate_hz,
                    promised,
                    alignments,
                    origin: InputOrigin::Local { sources, times },
                });
            }
            Self::Stations(endpoints) => endpoints,
        };
        let camera = |c: &crate::prepared_room::PreparedCamera| ExpectedCamera {
            name: c.name.clone(),
            width: c.width(),
            height: c.height(),
        };
        let expected = ExpectedStations {
            room: Fingerprint::of(room),
            cameras: prepared.cameras.iter().map(camera).collect(),
        };
        let (inbox, events) = channel();
        tracing::info!("waiting for the stations");
        let (ports, downlink) = Downlink::open(expected, &endpoints, STATIONS_WITHIN, interrupted, inbox)?;
        let names: Vec<&str> = prepared.cameras.iter().map(|c| c.name.as_str()).collect();
        let alignments = args.clocks.alignments(&names)?;
        let rates = ports.iter().filter_map(|port| port.rate_hz);
        let rate_hz = rates.fold(0.0, f64::max);
        let is_live = ports.iter().any(|port| port.is_live);
        if args.clocks.is_auto() && !is_live {
            bail!(
                "--offset auto: is for recordings of this machine and for live cameras; give --offset NAME=SECONDS"
            );
        }
        Ok(RunInput {
            is_live,
            has_pictures: false,
            has_boxes_alone: ports.iter().all(|port| port.has_boxes_alone),
            rate_hz: if rate_hz > 0.0 { rate_hz } else { USUAL_RATE_HZ },
            promised: None,
            alignments,
            origin: InputOrigin::Stations { ports, events, downlink },
        })
    }
}

/// Warns of recordings with an uneven rate, and of those that begin at another time of their own clock than the others.
fn warn_of_times(sources: &[CameraSource]) {
    for source in sources {
        if let Some(VideoSource::Recorded(video)) = &source.video
            && let Some(problem) = film_times::uneven_rate(video)
        {
            tracing::warn!("{}={}: {problem}", source.name, video.name());
        }
    }
    let recorded = |source: &CameraSource| match &source.video {
        Some(VideoSource::Recorded(video)) if video.is_recording() => {
            // The run itself reports a film that cannot be read.
            FilmTimes::of_first(&source.name, video.name(), 1).ok()
        }
        _ => None,
    };
    let films: Vec<FilmTimes> = sources.iter().filter_map(recorded).collect();
    for finding in film_times::starts(&films) {
        tracing::warn!("{finding}");
    }
}

impl RunInput {
    /// Starts the stations, and gives the method the empty scenes that it needs. Offsets between recordings are
    /// estimated before, if requested.
    pub(super) fn start(
        &mut self,
        args: &RunArgs,
        room: &Room,
        builder: &StationBuilder<'_>,
        method: &mut dyn Method,
        threads: usize,
    ) -> anyhow::Result<Started> {
        let none = InputOrigin::Local { sources: Vec::new(), times: Vec::new() };
        let (sources, times) = match std::mem::replace(&mut self.origin, none) {
            InputOrigin::Local { sources, times } => (sources, times),
            InputOrigin::Stations { ports, events, downlink } => {
                return Ok(Started { ports, events, downlink: Some(downlink) });
            }
        };
        let is_searched = args.clocks.is_auto() && !self.is_live && sources.len() > 1;
        let (mut stations, mut scenes) = (Vec::new(), Vec::new());
        for (camera, built) in builder.build(sources, times.clone())?.into_iter().enumerate() {
            if let Some(picture) = built.empty_scene {
                method.set_empty_scene(camera, &picture);
            }
            stations.push(built.station);
            scenes.extend(built.backdrop);
        }
        if !scenes.is_empty() {
            for finding in views::compare(room, &args.room, &scenes)?.1 {
                tracing::warn!("{finding}");
            }
        }
        if is_searched {
            tracing::info!("looking for the offsets between the recordings");
            let (ports, events) = start(stations, threads);
            let found = search_offsets(builder.room, ports, &events, &self.alignments)?;
            self.alignments = found;
            let again = source::open(room, args.sources())?;
            stations = builder.build(again, times)?.into_iter().map(|built| built.station).collect();
        }
        let (ports, events) = start(stations, threads);
        Ok(Started { ports, events, downlink: None })
    }
}

/// Starts the stations on threads of this process.
pub(super) fn start(stations: Vec<Station>, threads: usize) -> (Vec<Port>, Receiver<(usize, Event)>) {
    let (inbox, events) = channel();
    let permits = Permits::new(threads);
    let start = |(camera, station)| station::start(station, camera, inbox.clone(), &permits);
    (stations.into_iter().enumerate().map(start).collect(), events)
}
