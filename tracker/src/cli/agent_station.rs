//! `tracker station --method agents`: one station that tracks together with those of the other cameras.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use scenes::room::Room;
use shell::console::Progress;
use shell::ranges::TIME_S;

use super::publish::{PublishArguments, Published};
use super::sampler::SamplerArguments;
use crate::foreground::Verdict;
use crate::gathering::LeftOut;
use crate::method::agents::{SoloStation, StationId};
use crate::observation::{Feedback, Observation};
use crate::plan::TrajectoryPlan;
use crate::prepared_room::PreparedRoom;
use crate::station::{Event, ObservedFrame, Pace, Permits, Pictures, Station, Work};
use crate::tracks::{Stopwatch, TrackFiles};
use crate::wire::mesh::{Membership, OwnClock};
use crate::wire::{Endpoints, Fingerprint, Mesh};
use crate::{CameraFrame, PersonEstimate};

/// Time without a picture after which a live station reports to others that it is blind.
const BLIND: Duration = Duration::from_secs(1);

#[derive(Debug, Args)]
#[command(next_help_heading = "Agents (--method agents)")]
pub(super) struct AgentStationArguments {
    /// Folder to write this station's tracks to
    #[arg(long, value_name = "DIR", requires = "method")]
    out: Option<PathBuf>,
    /// Wall-clock time at which the recording begins, seconds since 1970: the same for all stations of recordings. Late
    /// frames are passed over, so a station may start, or restart, in the middle [default: now]
    #[arg(long, value_name = "SECONDS", requires = "method", value_parser = TIME_S.number())]
    start: Option<f64>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Largest number of people tracked at once, up to 31 [default: 24]
    #[arg(long, value_name = "N", requires = "method")]
    most_people: Option<usize>,
    /// Error of this machine's clock, seconds: for tests
    #[arg(long, value_name = "SECONDS", hide = true, allow_negative_numbers = true, default_value_t = 0.0,
        value_parser = TIME_S.number())]
    clock_shift: f64,
    #[command(flatten)]
    publish: PublishArguments,
    #[command(flatten)]
    sampler: SamplerArguments,
}

/// Room of a station, prepared with all of its cameras.
pub(super) struct StationRoom<'a> {
    pub(super) room: &'a Room,
    pub(super) room_dir: &'a Path,
    /// The room with all cameras.
    pub(super) prepared: PreparedRoom,
}

/// Outputs of one station.
struct Outputs {
    files: TrackFiles,
    plan: TrajectoryPlan,
    stopwatch: Stopwatch,
    frames: usize,
    out: PathBuf,
    published: Published,
}

/// A running station.
struct Follower {
    tracker: SoloStation,
    mesh: Mesh,
    clock: OwnClock,
    outputs: Outputs,
    frame: u32,
    /// Latest capture time, seconds.
    time_s: f64,
    has_warned: bool,
}

impl AgentStationArguments {
    /// Folder of the station's tracks, if it has one.
    pub(super) fn out(&self) -> Option<&Path> {
        self.out.as_deref()
    }

    /// Refuses what a station that does not track cannot do.
    pub(super) fn check_unused(&self) -> anyhow::Result<()> {
        match self.publish.given() {
            Some(option) => bail!(
                "{option}: a station without --method agents knows of no people; give it to the `tracker run` that gathers"
            ),
            None => Ok(()),
        }
    }

    /// Tracks with the station's camera, together with the other stations, until its source ends or it is interrupted.
    pub(super) fn follow(
        &self,
        StationRoom { room, room_dir, prepared }: StationRoom<'_>,
        station: Station,
        endpoints: &Endpoints,
        (interrupted, progress): (&Arc<AtomicBool>, Progress),
    ) -> anyhow::Result<()> {
        let Some(out) = self.out.clone() else { bail!("--method agents: give --out DIR for its tracks") };
        let _lock = shell::files::lock(&out)?;
        let camera = prepared.camera_index(&station.name).context("the room has no such camera")?;
        let id = StationId(u8::try_from(camera).context("the room has more than 255 cameras")?);
        self.publish.check()?;
        let options = super::agent_options::options(
            &self.sampler,
            self.seed,
            self.most_people,
            station.has_boxes_alone(),
        )?;
        let cameras: Vec<String> = prepared.cameras.iter().map(|camera| camera.name.clone()).collect();
        let own = PreparedRoom { cameras: vec![prepared.cameras[camera].clone()], ..prepared.clone() };
        let tracker = SoloStation::new(prepared, id, &options)?;
        let clock = OwnClock { shift_s: self.clock_shift };
        let hears = tracker.hears().to_vec();
        let names: Vec<&str> = hears.iter().map(|other| cameras[usize::from(other.0)].as_str()).collect();
        tracing::info!("camera `{}` sees the same places as {}", station.name, listed(&names));
        let published = self.publish.start(room, room_dir, &own, None)?;
        let membership =
            Membership { room: Some(Fingerprint::of(room)), cameras, station: Some(id), hears, clock };
        let mesh = Mesh::open(&membership, endpoints)?;
        let outputs = Outputs {
            files: TrackFiles::new(&out, &own),
            plan: TrajectoryPlan::new(&out, room, room_dir),
            stopwatch: Stopwatch::default(),
            frames: 0,
            out,
            published,
        };
        let follower = Follower {
            tracker,
            mesh,
            clock,
            outputs,
            frame: 0,
            time_s: f64::NEG_INFINITY,
            has_warned: false,
        };
        follower.run(station, interrupted, self.start, progress)
    }
}

impl Follower {
    fn run(
        mut self,
        mut station: Station,
        interrupted: &Arc<AtomicBool>,
        start_s: Option<f64>,
        mut progress: Progress,
    ) -> anyhow::Result<()> {
        let has_recording = matches!(station.work, Work::Recorded(_));
        if let Work::Recorded(recorded) = &mut station.work {
            recorded.pace = Pace::From(start_s.unwrap_or_else(|| OwnClock::default().now_s()));
        }
        let (give_feedback, feedback) = channel();
        // The channel holds no frame, so the station passes frames over until the last one has been processed.
        let (give, events) = sync_channel(0);
        let is_wanted = Arc::clone(interrupted);
        // The thread ends with the receiver, or by itself: a stream that does not answer may block it for seconds.
        thread::spawn(move || {
            let send = |event| give.send(event).is_ok() && !is_wanted.load(Ordering::Relaxed);
            station.run(&feedback, &Permits::new(1), send);
        });
        let followed = self.follow(&events, &give_feedback, has_recording, interrupted, &mut progress);
        drop(progress);
        let counts = self.mesh.counts();
        tracing::info!("{} packets sent ({} bytes), {} heard", counts.sent, counts.sent_bytes, counts.heard);
        for (refusal, count) in &counts.refused {
            tracing::warn!("{count} packets or stations were left out: {refusal}");
        }
        if counts.dropped > 0 {
            tracing::warn!("{} packets came faster than frames, and were dropped", counts.dropped);
        }
        self.outputs.finish()?;
        followed
    }

    fn follow(
        &mut self,
        events: &Receiver<Event>,
        feedback: &Sender<Feedback>,
        has_recording: bool,
        interrupted: &AtomicBool,
        progress: &mut Progress,
    ) -> anyhow::Result<()> {
        while !interrupted.load(Ordering::Relaxed) {
            match events.recv_timeout(BLIND) {
                Ok(Event::Seen(seen)) => {
                    let sequence = seen.observation.sequence;
                    self.step(*seen)?;
                    progress.advance();
                    // Feedback for a station that has ended is dropped.
                    let _ = feedback.send(Feedback { sequence, people: self.tracker.bodies() });
                }
                Ok(Event::Failed(error)) => return Err(error.into()),
                Err(RecvTimeoutError::Timeout) if !has_recording => self.step(self.nothing())?,
                Err(RecvTimeoutError::Timeout) => {}
                Ok(Event::Ended) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        Ok(())
    }

    /// Frame of a camera that sends no pictures.
    fn nothing(&self) -> ObservedFrame {
        let time_s = self.clock.now_s() - self.clock.shift_s;
        ObservedFrame {
            observation: Observation::unusable(0, time_s, Verdict::Silent),
            pictures: Pictures::default(),
            decode: Duration::ZERO,
            foreground: Duration::ZERO,
        }
    }

    fn step(&mut self, seen: ObservedFrame) -> anyhow::Result<()> {
        let ObservedFrame { observation, decode, foreground, .. } = seen;
        let time_s = observation.time_s + self.clock.shift_s;
        if time_s <= self.time_s {
            return Ok(());
        }
        self.time_s = time_s;
        self.frame =
            u32::try_from(observation.sequence).unwrap_or(u32::MAX).max(self.frame.saturating_add(1));
        let Observation { mask, colours, boxes, health, .. } = observation;
        let camera = CameraFrame { mask, colours, boxes, image: None };
        let heard = self.mesh.heard();
        let (tracker, outputs, frame) = (&mut self.tracker, &mut self.outputs, self.frame);
        outputs.stopwatch.record("decode", decode);
        outputs.stopwatch.record("foreground", foreground);
        let packet = outputs.stopwatch.time("inference", || tracker.step(frame, time_s, &camera, &heard))?;
        if let Err(error) = self.mesh.publish(&packet)
            && !std::mem::replace(&mut self.has_warned, true)
        {
            tracing::warn!("{error}: a packet is not sent");
        }
        let people = self.tracker.people();
        Ok(self.outputs.write(frame, time_s, &people, health)?)
    }
}

impl Outputs {
    /// Adds a frame to all outputs. `health` is that of the station's camera.
    fn write(
        &mut self,
        frame: u32,
        time_s: f64,
        people: &[PersonEstimate],
        health: Verdict,
    ) -> crate::Result<()> {
        let set_aside = health.is_set_aside().then_some((0, health));
        let Self { files, plan, stopwatch, frames, published, .. } = self;
        *frames += 1;
        plan.extend(time_s, people);
        stopwatch.time("output", || {
            if let Some(metrics) = &mut published.metrics {
                metrics.observe(people.len(), Some(time_s), &[health], LeftOut::default());
            }
            if let Some(mqtt) = &mut published.mqtt {
                mqtt.publish(frame, time_s, people, set_aside.as_slice())?;
            }
            files.write(frame, time_s, people, set_aside.as_slice())
        })
    }

    fn finish(self) -> anyhow::Result<()> {
        self.stopwatch.timings(1, self.frames).write(&self.out.join("timings.json"))?;
        self.files.finish()?;
        self.plan.finish()?;
        match self.published.mqtt {
            Some(mqtt) => Ok(mqtt.finish()?),
            None => Ok(()),
        }
    }
}

fn listed(cameras: &[&str]) -> String {
    match cameras {
        [] => "no other".to_owned(),
        cameras => cameras.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
    }
}
