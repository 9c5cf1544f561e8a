//! `tracker check`: do these films fit this room, and each other?

use std::fmt::Write;
use std::path::PathBuf;

use calib::video::FrameSource;
use clap::Args;
use rayon::prelude::*;
use scenes::room::Room;

use super::Printed;
use super::background::BackgroundArguments;
use super::clocks::ClockArguments;
use super::input;
use super::stations::{Drawing, StationBuilder};
use crate::doctor::Finding;
use crate::doctor::film_times::{self, FilmTimes};
use crate::doctor::shift;
use crate::doctor::views::{self, EmptyScene, ViewReport};
use crate::film::FilmOptions;
use crate::foreground::backdrop::Backdrop;
use crate::method::Needs;
use crate::prepared_room::{PreparationOptions, PreparedRoom, WORKING_WIDTH_PX};
use crate::run::offsets_of_recordings;
use crate::source::{self, NamedSource, NamedSources, sampling};
use crate::station::{Pace, PictureDemand};

/// Check whether films fit a room, and each other, before a run.
///
/// Each film's empty scene is compared with the room's reference picture of its camera (films that were swapped, a camera
/// that has turned, a covered lens, another room), its size with the camera's, its frames' times with its header, its start with the other
/// films'; and where several films show people, the times at which they show them. Exits with 1 and a line for each
/// finding; each names the film, what was found, and what to do.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  tracker check myroom --video cam0=cam0.mp4 --video cam1=cam1.mp4")]
pub(super) struct CheckArgs {
    /// Room directory, as made by `recon build`
    room: PathBuf,
    /// Film of a camera, as `tracker run` takes it; may be given several times
    #[arg(long, value_name = "NAME=PATH", required = true)]
    video: Vec<NamedSource>,
    #[command(flatten)]
    clocks: ClockArguments,
    #[command(flatten)]
    background: BackgroundArguments,
}

/// Runs the subcommand.
pub(super) fn check(args: &CheckArgs) -> anyhow::Result<Printed> {
    calib::vision::set_threads(1)?;
    let room = Room::read(&args.room)?;
    let (fitting, mut findings) = sizes(&room, &args.video)?;
    let times: Vec<FilmTimes> = fitting
        .par_iter()
        .map(|film| FilmTimes::read(&film.name, &film.spec))
        .collect::<crate::Result<_>>()?;
    if args.clocks.is_default() {
        findings.extend(times.iter().flat_map(FilmTimes::findings));
        findings.extend(film_times::starts(&times));
    }
    let scenes: Vec<EmptyScene> =
        fitting.par_iter().map(|film| empty_scene(&room, film)).collect::<anyhow::Result<_>>()?;
    let (views, of_views) = views::compare(&room, &args.room, &scenes)?;
    // Films of another view have no people in common.
    let is_worth_a_look = of_views.is_empty() && fitting.len() > 1;
    findings.extend(of_views);
    if is_worth_a_look {
        findings.extend(shifts(args, &room, &fitting)?);
    }
    Ok(printed(&times, &views, &findings))
}

/// The films of their cameras' sizes, and findings about the others.
fn sizes(room: &Room, films: &[NamedSource]) -> anyhow::Result<(Vec<NamedSource>, Vec<Finding>)> {
    let (mut fitting, mut findings) = (Vec::new(), Vec::new());
    for film in films {
        let opened = FrameSource::open(&film.spec)?;
        match room.cameras.iter().find(|camera| camera.name == film.name) {
            Some(camera) if opened.is_recording() => {
                let k = &camera.camera.intrinsics;
                let (width, height) = opened.size();
                if (width, height) == (k.width, k.height) {
                    fitting.push(film.clone());
                    continue;
                }
                let text = format!(
                    "is {width} × {height} pixels, camera `{}` has {} × {}: give the recording that the room was calibrated for",
                    film.name, k.width, k.height
                );
                findings.push(Finding { camera: film.name.clone(), film: film.spec.clone(), text });
            }
            // A stream is live: its frames are not a film. Names that the room lacks are refused as in a run.
            _ => drop(source::open(
                room,
                NamedSources { videos: std::slice::from_ref(film), ..NamedSources::default() },
            )?),
        }
    }
    Ok((fitting, findings))
}

fn empty_scene(room: &Room, film: &NamedSource) -> anyhow::Result<EmptyScene> {
    let camera = room.camera(&film.name)?;
    let frames = sampling::spread(&film.spec, views::compared_size(&camera.camera.intrinsics))?;
    let picture = Backdrop::learn(&frames)?.picture;
    Ok(EmptyScene { camera: film.name.clone(), film: film.spec.clone(), picture })
}

/// Films whose people are seen at other times than in the first film.
fn shifts(args: &CheckArgs, room: &Room, films: &[NamedSource]) -> anyhow::Result<Vec<Finding>> {
    let sources = source::open(room, NamedSources { videos: films, ..NamedSources::default() })?;
    let clocks = args.clocks.clocks(&sources)?;
    let options = PreparationOptions {
        cameras: sources.iter().map(|source| source.name.clone()).collect(),
        occlusion: true,
        working_width_px: WORKING_WIDTH_PX,
    };
    let prepared = PreparedRoom::prepare(room, &args.room, &options)?;
    let looks = FilmOptions::default();
    let builder = StationBuilder {
        room: &prepared,
        background: &args.background,
        needs: Needs { masks: true, pictures: false, empty_scene: false },
        drawing: Drawing { looks: &looks, demand: PictureDemand::Never },
        pace: Pace::Free,
        out: None,
    };
    let (times, alignments) = clocks.into_parts();
    let stations = builder.build(sources, times)?.into_iter().map(|built| built.station).collect();
    let (ports, events) = input::start(stations, rayon::current_num_threads());
    let found = offsets_of_recordings(&prepared, ports, &events, &alignments)?;
    let mut findings = Vec::new();
    for (camera, offset) in found.cameras.iter().enumerate().filter(|(camera, o)| o.reference != *camera) {
        let (name, reference) = (&prepared.cameras[camera].name, &prepared.cameras[offset.reference].name);
        let Some(text) = shift::finding(name, reference, alignments[camera].offset_s, offset) else {
            continue;
        };
        let film =
            films.iter().find(|film| film.name == *name).map_or(String::new(), |film| film.spec.clone());
        findings.push(Finding { camera: name.clone(), film, text });
    }
    Ok(findings)
}

/// A line a film, and a line a finding.
fn printed(times: &[FilmTimes], views: &[ViewReport], findings: &[Finding]) -> Printed {
    let mut text = String::new();
    for film in times {
        let _ = write!(text, "film     {}={}: {} frames", film.camera, film.film, film.frames);
        if let Some((start_s, lasts_s)) = film.start_s().zip(film.lasts_s()) {
            let _ = write!(text, ", from {start_s:.3} s for {lasts_s:.2} s");
        }
        let view = views.iter().find(|view| view.camera == film.camera);
        let _ = match view.and_then(|view| view.agreeing) {
            Some(points) => writeln!(text, "; {points} points agree with the reference picture"),
            None => writeln!(text, "; the room has no reference picture of this camera"),
        };
    }
    for finding in findings {
        let _ = writeln!(text, "finding  {finding}");
    }
    if findings.is_empty() {
        text.push_str("clean\n");
    }
    Printed { text, status: u8::from(!findings.is_empty()) }
}
