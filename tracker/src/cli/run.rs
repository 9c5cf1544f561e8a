//! `tracker run`: from videos to tracks.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Context, bail};
use scenes::room::Room;
use shell::console::Console;

use shell::files::{OutputLock, refuse_inputs};

use super::input::{RunSources, Started};
use super::interrupt;
use super::room_service::{RoomService, room_outputs};
use super::run_arguments::{MethodName, RunArgs};
use super::stations::{Drawing, StationBuilder};
use super::view;
use crate::events::{self, Clock, EventFiles};
use crate::film::{Film, FilmOptions};
use crate::foreground::Verdict;
use crate::gathering::{ClockAlignment, Gathering, GatheringOptions};
use crate::method::RaisedIds;
use crate::plan::TrajectoryPlan;
use crate::prepared_room::{PreparationOptions, PreparedRoom};
use crate::run::{
    self, AgencyLog, ClockOffsets, EventLog, NoEvents, Output, RunDirective, RunEnd, RunProgress, RunReport,
};
use crate::serve::StartFilm;
use crate::station::{Pace, PictureDemand};
use crate::tracks::TrackFiles;
use crate::view::{LiveDrawer, Screens, Server};
use crate::wire::Downlink;

/// Runs the subcommand, or the run of a room of a service.
pub(super) fn run_as(
    args: &RunArgs,
    console: &Console,
    service: Option<RoomService>,
) -> anyhow::Result<String> {
    // Invalid options are reported before anything is read.
    args.check()?;
    refuse_inputs(&args.out, args.inputs())?;
    // A service's room locks its folder by itself.
    let lock = if service.is_none() { Some(OutputLock::if_present(&args.out)?) } else { None };
    let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = args.threads.unwrap_or_else(cores);
    // The cameras share the threads; OpenCV's own loops stay on theirs.
    calib::vision::set_threads(1)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("--threads")?;
    pool.install(move || follow(args, threads, console, service.as_ref(), lock))
}

/// Runs the subcommand.
pub(crate) fn run(args: &RunArgs, console: &Console) -> anyhow::Result<String> {
    run_as(args, console, None)
}

fn follow(
    args: &RunArgs,
    threads: usize,
    console: &Console,
    service: Option<&RoomService>,
    mut lock: Option<OutputLock<'_>>,
) -> anyhow::Result<String> {
    let started = Instant::now();
    // The port is bound before the slow reading of the room.
    let listener = args.view.listener()?;
    let room = Room::read(&args.room)?;
    let given = RunSources::open(args, &room)?;
    let options = PreparationOptions {
        cameras: given.cameras(),
        occlusion: !args.no_occlusion,
        working_width_px: args.mask_width,
    };
    let prepared = given.prepare(&room, &args.room, &options)?;
    let interrupted = match service {
        Some(service) => Arc::clone(&service.is_ended),
        None => interrupt::watch().context("the signals that end a run")?,
    };
    let downlinked = matches!(given, RunSources::Stations(_));
    let mut input = given.connect(args, &room, &prepared, &interrupted)?;
    // A service plays recordings at their own speed, as if they were cameras.
    input.is_live |= service.is_some();
    let is_live = input.is_live;
    let mut method = args.method(&prepared, is_live, input.has_boxes_alone)?;
    let journal = service.map(|_| RoomService::journal(&args.out)).transpose()?;
    if let Some(journal) = &journal {
        method = Box::new(RaisedIds::new(method, journal.next_id()));
    }
    if downlinked && method.needs().pictures {
        bail!("--method: looks at pictures, which do not leave stations; give --video, or --method mcmc");
    }
    let looks = FilmOptions { width_px: args.film_width, is_live, ..FilmOptions::default() };
    let mut page =
        listener.map(|listener| view::serve(listener, &room, &args.room, &prepared)).transpose()?;
    let screens = page.as_ref().map(Server::screens);
    let clock = match &journal {
        Some(journal) => Some(journal.clock()),
        None => args.events.clock(&args.video)?,
    };
    // The server of the metrics ends with the run.
    let (published, _server) = args.publish.start(&room, &args.room, &prepared, clock)?.into_outputs();
    let demand = picture_demand(args, screens);
    let builder = StationBuilder {
        room: &prepared,
        background: &args.background,
        needs: method.needs(),
        drawing: Drawing { looks: &looks, demand },
        pace: if is_live { Pace::Live } else { Pace::Free },
        out: Some(&args.out),
    };
    let Started { ports, events: station_events, downlink } =
        input.start(args, &room, &builder, method.as_mut(), threads)?;
    let prepared_s = started.elapsed().as_secs_f64();
    tracing::debug!("room and backgrounds ready after {prepared_s:.2} s");
    // All inputs have been checked, so outputs may be created now.
    if let Some(lock) = &mut lock {
        lock.hold()?;
    }
    let audience = screens.map(Screens::audience);
    let film = |out: &Path| Film::start(out, &prepared, input.rate_hz, &looks, audience.as_ref());
    let mut shown: Vec<Box<dyn Output>> = published;
    if let Some(screens) = screens.filter(|_| args.no_film) {
        shown.push(Box::new(LiveDrawer::start(&prepared, &looks, screens, input.has_pictures)));
    }
    if let Some(feed) = page.as_ref().and_then(|page| page.feed(&room, clock)) {
        shown.push(Box::new(feed));
    }
    let outputs = if let (Some(journal), Some(service)) = (journal, service) {
        service.watch(&args.room, &room, &options);
        let film = (!args.no_film).then(|| Box::new(film) as StartFilm<'_>);
        vec![room_outputs(args, &room, &prepared, journal, film, shown)]
    } else {
        let mut outputs = outputs(args, &room, &prepared, clock)?;
        if !args.no_film {
            outputs.push(Box::new(film(&args.out)?));
        }
        outputs.extend(shown);
        outputs
    };
    let mut progress = console.progress("tracking", input.promised.map(|n| n as u64));
    let alignments = input.alignments;
    let clocks = clock_offsets(args, &prepared, &alignments, is_live)?;
    let gathering_options = GatheringOptions { alignments, latency_s: args.latency };
    let gathering = Gathering::new(ports, station_events, &gathering_options)?;
    let report = run::run(gathering, method.as_mut(), outputs, clocks, threads, |step| {
        if step == RunProgress::Moment {
            progress.advance();
        }
        match service.and_then(RoomService::changed_room) {
            _ if interrupted.load(Ordering::Relaxed) => RunDirective::Stop,
            Some(changed) => RunDirective::Replace(changed),
            None => RunDirective::GoOn,
        }
    })?;
    drop(progress);
    warn_of_garbage(downlink.as_ref());
    drop(downlink);
    if let Some(page) = &mut page {
        page.announce_end();
    }
    report.timings.write(&args.out.join("timings.json"))?;
    let report = report.unless_failed()?;
    if args.smooth {
        smooth(args, &room, input.rate_hz)?;
    }
    log_report(&report, prepared_s, started.elapsed().as_secs_f64());
    Ok(String::new())
}

/// Estimation of the cameras' clocks, where there are several cameras.
fn clock_offsets(
    args: &RunArgs,
    prepared: &PreparedRoom,
    alignments: &[ClockAlignment],
    is_live: bool,
) -> anyhow::Result<Option<ClockOffsets>> {
    if prepared.cameras.len() < 2 {
        return Ok(None);
    }
    let applies = args.clocks.is_auto() && is_live;
    Ok(Some(ClockOffsets::new(prepared, alignments.to_vec(), is_live, applies)?))
}

/// Warns of messages that the stations' connection refused.
fn warn_of_garbage(downlink: Option<&Downlink>) {
    if let Some(garbage) = downlink.map(Downlink::garbage).filter(|count| *count > 0) {
        tracing::warn!(
            "--stations: {garbage} messages were refused: malformed, out of order, or from unknown senders"
        );
    }
}

/// Pictures that films and the page need.
fn picture_demand(args: &RunArgs, screens: Option<&Screens>) -> PictureDemand {
    match screens {
        _ if !args.no_film => PictureDemand::Always,
        Some(screens) => {
            let screens = screens.clone();
            PictureDemand::While(Arc::new(move || screens.is_watched()))
        }
        None => PictureDemand::Never,
    }
}

/// The outputs that do not show pictures.
fn outputs(
    args: &RunArgs,
    room: &Room,
    prepared: &PreparedRoom,
    clock: Option<Clock>,
) -> anyhow::Result<Vec<Box<dyn Output>>> {
    let mut outputs: Vec<Box<dyn Output>> =
        vec![Box::new(TrackFiles::new(&args.out, prepared).with_clock(clock))];
    if args.events.are_on(room) {
        let files = EventFiles::new(&args.out, room, &args.room, &args.events.options())?;
        outputs.push(Box::new(EventLog::new(files, prepared, clock)));
    } else {
        outputs.push(Box::new(NoEvents::new(args.out.clone())));
    }
    outputs.push(Box::new(TrajectoryPlan::new(&args.out, room, &args.room)));
    if args.method == MethodName::Agents {
        outputs.push(Box::new(AgencyLog::new(&args.out, prepared)));
    }
    Ok(outputs)
}

/// Links the tracks of the finished run. Its events are written again: those of the run have the ids before linking.
fn smooth(args: &RunArgs, room: &Room, rate_hz: f64) -> anyhow::Result<()> {
    let mended = mot::link::mend_run(&args.out, rate_hz)?;
    tracing::info!("{} tracks after linking over the whole recording", mended.tracks);
    if args.events.are_on(room) {
        events::of_run(&args.out, &args.room, &args.events.options())?;
    }
    Ok(())
}

fn log_report(report: &RunReport, prepared_s: f64, all_s: f64) {
    for (name, (frames, why)) in &report.set_aside {
        let why = if *why == Verdict::Learning {
            "while it learnt its background".to_owned()
        } else {
            format!("first: {why}")
        };
        tracing::info!("camera `{name}` was set aside in {frames} of {} frames ({why})", report.frames);
    }
    let left_out = report.left_out;
    if left_out.late + left_out.skipped + left_out.passed_over > 0 {
        tracing::info!(
            "to keep up {} frames were passed over and {} moments skipped; {} frames came after their moment (--latency)",
            left_out.passed_over,
            left_out.skipped,
            left_out.late
        );
    }
    match &report.ended {
        RunEnd::Source(name) => tracing::info!("the run ended where `{name}` ended"),
        RunEnd::Stopped => tracing::info!("the run ended where it was interrupted"),
        // The error is reported as the program's one line of error.
        RunEnd::Failed(_) => {}
    }
    tracing::info!(
        "{} frames in {all_s:.2} s, {:.1} frames/s ({prepared_s:.2} s of it to read the room and learn the backgrounds)",
        report.frames,
        report.frames as f64 / all_s.max(1e-9),
    );
}
