//! Tests of the pipeline with methods that only record: their input must not depend on the number of threads.

mod endings;

use std::path::Path;

use calib::video::FrameSource;
use calib::{Camera, Intrinsics};
use image::{GrayImage, Luma, Rgb, RgbImage};
use scenes::room::{Room, RoomCamera};

use super::*;
use crate::PersonEstimate;
use crate::film::FilmOptions;
use crate::foreground::backdrop::Backdrop;
use crate::foreground::{Foreground, ForegroundOptions, InitialBackground};
use crate::gathering::{ClockAlignment, GatheringOptions};
use crate::method::Needs;
use crate::prepared_room::{PreparationOptions, PreparedRoom};
use crate::source::{self, CaptureTimes, NamedSource, NamedSources, Times, VideoSource};
use crate::station::{self, Masks, Observer, Permits, PictureDemand, RecordedStation, Station, Work};

const SIZE: (u32, u32) = (64, 48);

const EVERYTHING: Needs = Needs { masks: true, pictures: true, empty_scene: false };
const MASKS: Needs = Needs { masks: true, pictures: false, empty_scene: false };

/// Method that records the checksums of its input.
#[derive(Default)]
struct ChecksumMethod(Vec<(u32, f64, Vec<u64>)>);

impl Method for ChecksumMethod {
    fn step(&mut self, moment: &Moment<'_>) -> Result<Vec<PersonEstimate>> {
        let sum = |bytes: &[u8]| bytes.iter().enumerate().map(|(i, b)| (i as u64 + 1) * *b as u64).sum();
        let seen = moment.cameras.iter().flat_map(|c| {
            let mask = c.mask.as_ref().map_or(7, |m| sum(m.to_image().as_raw()));
            [mask, c.image.as_ref().map_or(9, |i| sum(i.as_raw()))]
        });
        self.0.push((moment.frame, moment.time_s, seen.collect()));
        Ok(Vec::new())
    }

    fn needs(&self) -> Needs {
        EVERYTHING
    }
}

/// Method that counts the foreground of one camera without pictures.
struct ForegroundCount(Vec<Option<usize>>);
impl Method for ForegroundCount {
    fn step(&mut self, moment: &Moment<'_>) -> Result<Vec<PersonEstimate>> {
        let camera = &moment.cameras[0];
        assert!(camera.image.is_none());
        self.0.push(camera.mask.as_ref().map(|mask| mask.count() as usize));
        Ok(Vec::new())
    }

    fn needs(&self) -> Needs {
        MASKS
    }
}

/// Method that knows the people 0.25 s later: one person, with the frame's number as id.
struct Late(f64);
impl Method for Late {
    fn step(&mut self, _: &Moment<'_>) -> Result<Vec<PersonEstimate>> {
        Ok(Vec::new())
    }

    fn needs(&self) -> Needs {
        MASKS
    }

    fn lag_s(&self) -> f64 {
        self.0
    }

    fn smoothed(&mut self, frame: u32) -> Option<Vec<PersonEstimate>> {
        Some(vec![PersonEstimate {
            id: crate::TrackId(frame),
            x_m: 0.0,
            y_m: 0.0,
            z_m: 0.0,
            radius_m: 0.25,
            height_m: 1.7,
            vx: 0.0,
            vy: 0.0,
            sigma_m: [0.1; 2],
            confidence: 1.0,
            visible: Vec::new(),
        }])
    }
}

/// Frame, time, ids of the people, and checksum of the pictures.
type EmittedMoment = (u32, f64, Vec<u32>, u64);

/// Output that records its input.
struct Notes<'a>(&'a std::cell::RefCell<Vec<EmittedMoment>>);
impl Output for Notes<'_> {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let people = followed.people.iter().map(|p| p.id.0).collect();
        let sum = (0..followed.moment.cameras.len())
            .filter_map(|c| followed.filmed(c))
            .map(|picture| picture.as_raw().iter().map(|v| u64::from(*v)).sum::<u64>())
            .sum();
        let Moment { frame, time_s, .. } = followed.moment;
        self.0.borrow_mut().push((frame, time_s, people, sum));
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

fn go_on(_: RunProgress) -> RunDirective {
    RunDirective::GoOn
}

fn ended_by(report: &RunReport) -> &str {
    let RunEnd::Source(name) = &report.ended else { panic!("{:?}", report.ended) };
    name
}

fn floor(u: u32, v: u32) -> Rgb<u8> {
    Rgb([100 + (u % 40) as u8, 110 + (v % 30) as u8, 90])
}

/// Videos of `frames` pictures in which a block walks to the right, one folder a camera, and their room.
fn recorded(cameras: &[(&str, u32)]) -> (tempfile::TempDir, Room) {
    let folder = tempfile::tempdir().unwrap();
    let mut room = Room::default();
    for (index, (name, frames)) in cameras.iter().enumerate() {
        let mut intrinsics = Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 60.0);
        // Every other camera has a distorted lens.
        intrinsics.distortion = [-0.1 * (index % 2) as f64, 0.0, 0.0, 0.0, 0.0].into();
        let camera = Camera { intrinsics, camera_from_world: nalgebra::Isometry3::identity() };
        room.cameras.push(RoomCamera { name: (*name).to_owned(), camera, reference: None });
        std::fs::create_dir(folder.path().join(name)).unwrap();
        for frame in 0..*frames {
            let left = frame * 3 % 61;
            let block = |u: u32, v: u32| (10..40).contains(&v) && (left..left + 12).contains(&u);
            let picture =
                RgbImage::from_fn(
                    SIZE.0,
                    SIZE.1,
                    |u, v| {
                        if block(u, v) { Rgb([20, 20, 200]) } else { floor(u, v) }
                    },
                );
            picture.save(folder.path().join(name).join(format!("{frame:03}.png"))).unwrap();
        }
    }
    (folder, room)
}

fn followed(
    folder: &Path,
    room: &Room,
    threads: usize,
    times: &Times,
) -> Result<(ChecksumMethod, RunReport)> {
    let clocks = vec![(times.clone(), 0.0); room.cameras.len()];
    clocked(folder, room, threads, &clocks)
}

/// The same with times and an offset, in seconds, of each camera.
fn clocked(
    folder: &Path,
    room: &Room,
    threads: usize,
    clocks: &[(Times, f64)],
) -> Result<(ChecksumMethod, RunReport)> {
    let mut witness = ChecksumMethod::default();
    let gathering = gathered(folder, room, threads, clocks, EVERYTHING)?;
    let report = run(gathering, &mut witness, Vec::new(), None, threads, go_on)?;
    Ok((witness, report.unless_failed()?))
}

/// Running stations of the cameras' folders, and their gathering.
fn gathered(
    folder: &Path,
    room: &Room,
    threads: usize,
    clocks: &[(Times, f64)],
    needs: Needs,
) -> Result<Gathering> {
    let prepared = PreparedRoom::prepare(room, folder, &PreparationOptions::default())?;
    let empty = Backdrop::learn(&[RgbImage::from_fn(SIZE.0, SIZE.1, floor)])?;
    let named =
        |name: &str| NamedSource { name: name.to_owned(), spec: folder.join(name).display().to_string() };
    let videos: Vec<NamedSource> = room.cameras.iter().map(|c| named(&c.name)).collect();
    let (permits, (inbox, events)) = (Permits::new(threads), std::sync::mpsc::channel());
    let mut ports = Vec::new();
    for (camera, (source, (times, _))) in
        source::open(room, NamedSources { videos: &videos, ..NamedSources::default() })?
            .into_iter()
            .zip(clocks)
            .enumerate()
    {
        let start = InitialBackground::from(empty.clone());
        let foreground = Foreground::new(SIZE.0, SIZE.1, start, ForegroundOptions::default())?;
        let masks = Masks::Subtracted(Box::new(foreground));
        let Some(VideoSource::Recorded(video)) = source.video else { panic!("a folder is a recording") };
        let station = recorded_station(&prepared, &source.name, Some(video), None, masks, (times, needs))?;
        ports.push(station::start(station, camera, inbox.clone(), &permits));
    }
    let alignment =
        |(_, offset_s): &(Times, f64)| ClockAlignment { offset_s: *offset_s, ..ClockAlignment::default() };
    let options = GatheringOptions { alignments: clocks.iter().map(alignment).collect(), latency_s: 0.3 };
    Gathering::new(ports, events, &options)
}

fn recorded_station(
    prepared: &PreparedRoom,
    name: &str,
    video: Option<FrameSource>,
    masks: Option<FrameSource>,
    made: Masks,
    (times, needs): (&Times, Needs),
) -> Result<Station> {
    let panel = FilmOptions::default().panel_px(&prepared.cameras[0]);
    let work = RecordedStation {
        video,
        masks,
        detections: None,
        times: CaptureTimes::given(name, times.clone()),
        observer: Observer::new(prepared, name, made, needs)?,
        drawn: (panel, PictureDemand::Always),
        pace: station::Pace::Free,
    };
    Ok(Station {
        name: name.to_owned(),
        rate_hz: Some(times.mean_rate()),
        work: Work::Recorded(Box::new(work)),
    })
}

#[test]
fn any_number_of_threads_shows_the_same() {
    let (folder, room) = recorded(&[("a", 9), ("b", 9), ("c", 9)]);
    let times = Times::steady(10.0).unwrap();
    let (one, report) = followed(folder.path(), &room, 1, &times).unwrap();
    assert_eq!((one.0.len(), report.frames), (9, 9));
    assert!(one.0.windows(2).all(|w| w[0].2 != w[1].2), "the block walks");
    for threads in [2, 3, 8] {
        let (other, _) = followed(folder.path(), &room, threads, &times).unwrap();
        assert_eq!(one.0, other.0, "{threads} threads");
    }
    let stages: Vec<&str> = report.timings.stages.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(stages, ["decode", "foreground", "inference", "output"]);
    assert!(report.timings.stages.iter().all(|(_, times)| times.count == 9));
}

#[test]
fn the_shortest_source_ends_the_run_at_any_number_of_threads() {
    let (folder, room) = recorded(&[("a", 9), ("b", 4), ("c", 7)]);
    for threads in [1, 2, 3] {
        let (witness, report) =
            followed(folder.path(), &room, threads, &Times::steady(10.0).unwrap()).unwrap();
        assert_eq!((witness.0.len(), report.frames, ended_by(&report)), (4, 4, "b"));
    }
}

#[test]
fn times_must_last_as_long_as_the_shortest_source() {
    let (folder, room) = recorded(&[("a", 9), ("b", 4)]);
    let file = folder.path().join("times.txt");
    std::fs::write(&file, "0.0\n0.1\n0.4\n0.5\n").unwrap();
    for threads in [1, 2] {
        let (witness, _) = followed(folder.path(), &room, threads, &Times::read(&file).unwrap()).unwrap();
        assert!((witness.0[3].1 - 0.5).abs() < 1e-12 && witness.0.len() == 4);
    }
    std::fs::write(&file, "0.0\n0.1\n0.4\n").unwrap();
    for threads in [1, 2] {
        let said = followed(folder.path(), &room, threads, &Times::read(&file).unwrap()).err().unwrap();
        assert!(said.to_string().contains("line 4"), "{said}");
    }
}

#[test]
fn a_torn_picture_is_named_after_the_frames_before_it() {
    let (folder, room) = recorded(&[("a", 5), ("b", 5)]);
    let torn = folder.path().join("b/003.png");
    let whole = std::fs::read(&torn).unwrap();
    std::fs::write(&torn, &whole[..whole.len() / 2]).unwrap();
    for threads in [1, 2] {
        let times = Times::steady(10.0).unwrap();
        let said = followed(folder.path(), &room, threads, &times).err().unwrap().to_string();
        assert!(said.contains("003.png") && said.contains("decoded"), "{said}");
    }
}

#[test]
fn people_are_told_later_beside_the_pictures_of_their_moment() {
    let (folder, room) = recorded(&[("a", 40), ("b", 40)]);
    let noted = |lag_s: f64, threads: usize, rate: f64| {
        let notes = std::cell::RefCell::new(Vec::new());
        let clocks = vec![(Times::steady(rate).unwrap(), 0.0); 2];
        let gathering = gathered(folder.path(), &room, threads, &clocks, MASKS).unwrap();
        let outputs: Vec<Box<dyn Output>> = vec![Box::new(Notes(&notes))];
        let report = run(gathering, &mut Late(lag_s), outputs, None, threads, go_on);
        (notes.into_inner(), report.unwrap())
    };
    let (at_once, _) = noted(0.0, 1, 10.0);
    assert!(at_once.windows(2).any(|w| w[0].3 != w[1].3), "the block walks");
    // One rate so high that many moments wait, and one lag so long that all wait until the end.
    for (lag_s, threads, rate) in [(0.25, 1, 10.0), (0.25, 2, 10.0), (1.0, 2, 100.0), (100.0, 1, 10.0)] {
        let (later, report) = noted(lag_s, threads, rate);
        assert_eq!(later.len(), 40);
        for (i, (now, then)) in at_once.iter().zip(&later).enumerate() {
            assert_eq!((then.0, &then.2, then.3), (i as u32 + 1, &vec![i as u32 + 1], now.3));
            assert!((then.1 - i as f64 / rate).abs() < 1e-9);
        }
        assert!(report.timings.stages.iter().all(|(_, times)| times.count == 40));
    }
    // Moments before an unreadable picture are emitted, too.
    std::fs::write(folder.path().join("b/007.png"), "torn").unwrap();
    let (emitted, report) = noted(0.25, 2, 10.0);
    assert_eq!(emitted.iter().map(|(frame, ..)| *frame).collect::<Vec<_>>(), (1..=7).collect::<Vec<_>>());
    assert_eq!(report.frames, 7);
    assert!(report.unless_failed().unwrap_err().to_string().contains("007.png"));
}

#[test]
fn masks_alone_are_enough_and_a_full_one_is_set_aside() {
    let (folder, room) = recorded(&[("a", 1)]);
    let masks = folder.path().join("masks");
    std::fs::create_dir(&masks).unwrap();
    for frame in 0..3_u32 {
        let mask = GrayImage::from_fn(SIZE.0, SIZE.1, |u, _| Luma([u8::from(frame == 1 || u < 10)]));
        mask.save(masks.join(format!("{frame}.png"))).unwrap();
    }
    let prepared = PreparedRoom::prepare(&room, folder.path(), &PreparationOptions::default()).unwrap();
    let named: NamedSource = format!("a={}", masks.display()).parse().unwrap();
    let source =
        source::open(&room, NamedSources { masks: &[named], ..NamedSources::default() }).unwrap().remove(0);
    let times = Times::steady(4.0).unwrap();
    let made = Masks::ready(&masks.display().to_string());
    let station = recorded_station(&prepared, "a", None, source.masks, made, (&times, MASKS)).unwrap();
    let (inbox, events) = std::sync::mpsc::channel();
    let port = station::start(station, 0, inbox, &Permits::new(2));
    let options = GatheringOptions { alignments: vec![ClockAlignment::default()], latency_s: 0.3 };
    let gathering = Gathering::new(vec![port], events, &options).unwrap();
    let mut count = ForegroundCount(Vec::new());
    let report = run(gathering, &mut count, Vec::new(), None, 2, go_on).unwrap();
    assert_eq!(count.0, [Some(480), None, Some(480)]);
    assert_eq!(report.set_aside["a"], (1, Verdict::AllForeground));
}

#[test]
fn each_camera_shows_the_frame_of_the_moment_at_any_number_of_threads() {
    // Fifteen, six and thirty frames a second; the last begins 0.4 s before the others.
    let (folder, room) = recorded(&[("a", 20), ("b", 6), ("c", 60)]);
    let clocks = [(15.0, 0.0), (6.0, 0.0), (30.0, -0.4)].map(|(hz, s)| (Times::steady(hz).unwrap(), s));
    let (one, report) = clocked(folder.path(), &room, 1, &clocks).unwrap();
    for threads in [2, 3, 8] {
        let (other, _) = clocked(folder.path(), &room, threads, &clocks).unwrap();
        assert_eq!(one.0, other.0, "{threads} threads");
    }
    // Each camera by itself gives the expected checksums, frame by frame.
    let alone = |camera: usize| -> Vec<u64> {
        let (mut room, name) = (room.clone(), room.cameras[camera].name.clone());
        room.cameras.retain(|c| c.name == name);
        let (witness, _) = followed(folder.path(), &room, 1, &Times::steady(10.0).unwrap()).unwrap();
        witness.0.iter().map(|(_, _, seen)| seen[1]).collect()
    };
    let pictures = [0, 1, 2].map(alone);
    assert_eq!((one.0[0].0, one.0.len() as u32), (13, report.frames));
    assert!(one.0[0].1.abs() < 1e-9, "all have begun at 0 s");
    for (moment, time_s, seen) in &one.0 {
        assert_eq!(seen[5], pictures[2][*moment as usize - 1]);
        // Half way between two frames, either is the nearest.
        for (camera, rate) in [(0, 15.0), (1, 6.0)] {
            let frame = time_s * rate;
            let candidates = [frame - 1e-6, frame + 1e-6].map(|f| f.round() as usize);
            let near = (frame.round() - frame).abs() / rate < 0.04;
            let shown = seen[2 * camera + 1];
            assert!(if near { candidates.iter().any(|c| shown == pictures[camera][*c]) } else { shown == 9 });
        }
    }
    assert!(one.0.iter().any(|(_, _, seen)| seen[3] == 9), "`b` has no frame at some moments");
    assert!(report.set_aside.is_empty(), "having no frame is no failure: {:?}", report.set_aside);
    // `b` ends first: after its sixth frame it has no near frame.
    assert_eq!(ended_by(&report), "b");
}
