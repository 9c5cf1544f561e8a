//! Presence: whether people stay tracked by masks alone, in crowded halls, while they sit for ten minutes, and after
//! three seconds without any mask. Masks are exact silhouettes of synthetic people.
//!
//! `cargo build --release --bins && cargo bench -p tests --bench presence [-- halls|sitting|lost] [FIRST_SEED]`. Seeds from
//! 1001 are never used for tuning.
#![forbid(unsafe_code)]

use nalgebra::{Point2, Vector2};
use synthetic::{RoomKind, RoomOptions, Screen, SequenceOptions, Walker, WalkerOptions};
use tests::chain::StepResult;
use tests::mask_recording::{MaskRecording, Row};

/// First seed where none is asked for.
const FIRST_SEED: u64 = 1001;
/// Number of halls of each size, and of rooms of each other scenario.
const HALLS: u64 = 3;
const ROOMS: u64 = 20;
/// Frames per second while people walk, and while everybody sits.
const RATE_HZ: f64 = 12.0;
const SITTING_RATE_HZ: f64 = 2.0;
/// Distance at which a track is that of a person, metres.
const GATE_M: f64 = 0.5;

fn main() -> StepResult<()> {
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let first = asked.iter().find_map(|a| a.parse().ok()).unwrap_or(FIRST_SEED);
    let scenarios: Vec<&str> =
        asked.iter().map(String::as_str).filter(|a| a.parse::<u64>().is_err()).collect();
    let is_asked = |name: &str| scenarios.is_empty() || scenarios.contains(&name);
    if is_asked("halls") {
        println!("halls             seed  MOTA %  IDF1 %  switches  mean cm  ms/moment");
        for (people, cameras) in [(12, 4), (24, 6)] {
            for seed in first..first + HALLS {
                hall(seed, people, cameras)?;
            }
        }
    }
    if is_asked("sitting") {
        for (name, options) in [("as usual", &[][..]), ("with --postures", &["--postures"][..])] {
            let [kept, rooms] = count(first, |seed| sitting(seed, options).map(Some))?;
            println!(
                "sitting for ten minutes, half hidden, {name}: {kept} of {rooms} kept with their id (asked: 19)"
            );
        }
    }
    if is_asked("lost") {
        let [kept, rooms] = count(first, lost)?;
        println!("three seconds without masks: {kept} of {rooms} found within 1 s with their id (asked: 18)");
    }
    Ok(())
}

/// Number of rooms in which a scenario ends well, and number of those in which it takes place.
fn count(first: u64, scenario: impl Fn(u64) -> StepResult<Option<bool>>) -> StepResult<[usize; 2]> {
    let outcomes: Vec<Option<bool>> = (first..first + ROOMS).map(scenario).collect::<StepResult<_>>()?;
    let taken: Vec<bool> = outcomes.into_iter().flatten().collect();
    Ok([taken.iter().filter(|is_kept| **is_kept).count(), taken.len()])
}

fn options(rate_hz: f64, frames: u32) -> SequenceOptions {
    SequenceOptions { rate_hz, frames, images: false, ..SequenceOptions::default() }
}

/// A minute of a hall with many people.
fn hall(seed: u64, people: usize, cameras: usize) -> StepResult<()> {
    let options_of_room = RoomOptions {
        seed,
        kind: RoomKind::Hall,
        cameras,
        doors: 3,
        image_px: [640, 480],
        ..RoomOptions::default()
    };
    let room = options_of_room.build().map_err(|e| e.to_string())?;
    let walkers =
        WalkerOptions { seed, people, first_s: 1.0, interval_s: 1.0, stops: 6, ..WalkerOptions::default() };
    let sequence = room.sequence(room.walkers(&walkers), options(RATE_HZ, 720));
    let recording = MaskRecording::write(&room, sequence.frames(), |_| false)?;
    recording.follow(&[])?;
    let figures = recording.evaluate()?;
    let of = |name: &str| figures[name].as_f64().unwrap_or(f64::NAN);
    println!(
        "{people:>2} by {cameras} cameras   {seed:>4}  {:>6.1}  {:>6.1}  {:>8}  {:>7.1}  {:>9.1}",
        of("MOTA"),
        of("IDF1"),
        of("id_switches"),
        100.0 * of("mean_error_m"),
        recording.inference_ms()?
    );
    Ok(())
}

/// A person who sits down for ten minutes where only one camera sees the upper half: `true` if the track goes on, with
/// one id, from before until the person has risen and left.
fn sitting(seed: u64, options_of_run: &[&str]) -> StepResult<bool> {
    /// Time at which the person comes in, and that of the stay, seconds.
    const COMES_S: f64 = 2.0;
    const STAYS_S: f64 = 600.0;
    /// Distance of the table and of the screen from the seat, metres, with their heights and widths.
    const TABLE: [f64; 3] = [0.75, 0.72, 1.4];
    const SCREEN: [f64; 3] = [0.8, 2.3, 1.6];
    let bare = RoomOptions { seed, furniture: 0, doors: 1, ..RoomOptions::default() };
    let room = bare.build().map_err(|e| e.to_string())?;
    let [wide_m, deep_m, _] = room.size_m;
    let turn = seed as f64;
    let seat = Point2::new(wide_m * (0.5 + 0.12 * turn.sin()), deep_m * (0.5 + 0.12 * turn.cos()));
    let board = |camera: usize, [away_m, height_m, width_m]: [f64; 3]| {
        let towards = (room.room.cameras[camera].camera.center().xy() - seat).normalize();
        let across = Vector2::new(-towards.y, towards.x);
        let yaw_deg = across.y.atan2(across.x).to_degrees();
        Screen { middle: seat + towards * away_m, yaw_deg, width_m, height_m }
    };
    let room = RoomOptions { screens: vec![board(0, TABLE), board(1, SCREEN)], ..bare };
    let room = room.build().map_err(|e| e.to_string())?;
    let door = room.room.zones[0].polygon.center();
    let person = Walker::with_seat(1, seed, COMES_S, 1.1, [&[door, seat], &[seat, door]], STAYS_S);
    let (_, left_s) = person.span_s();
    let walks = |time_s: f64| time_s < COMES_S + 15.0 || time_s > left_s - 15.0;
    let every = (RATE_HZ / SITTING_RATE_HZ) as u32;
    let frames = ((left_s + 1.0) * RATE_HZ) as u32;
    let sequence = room.sequence(vec![person], options(RATE_HZ, frames));
    let taken = (1..=frames).filter(|frame| frame % every == 1 || walks(f64::from(*frame) / RATE_HZ));
    let recording = MaskRecording::write(&room, taken.map(|frame| sequence.frame(frame)), |_| false)?;
    recording.follow(options_of_run)?;
    let (tracks, truth) = (recording.tracks()?, recording.truth()?);
    let outcome = Kept::of(&tracks, &truth, 1);
    println!("  seat {seed}: {outcome:?}");
    Ok(outcome.ids.len() == 1 && outcome.missed < 0.02)
}

/// Result of following one person.
#[derive(Debug)]
struct Kept {
    /// Ids that the person had.
    ids: Vec<u32>,
    /// Fraction of the frames without a track of the person.
    missed: f64,
    /// Largest distance of the track, metres.
    farthest_m: f64,
    /// Fraction of the frames with another track.
    others: f64,
}

impl Kept {
    fn of(tracks: &[Row], truth: &[Row], person: u32) -> Self {
        let mut kept = Self { ids: Vec::new(), missed: 0.0, farthest_m: 0.0, others: 0.0 };
        let person: Vec<&Row> = truth.iter().filter(|row| row.id == person).collect();
        for row in &person {
            let now = tracks.iter().filter(|track| track.frame == row.frame);
            let distance_m = |track: &&Row| track.distance_m(row.place);
            let nearest = now.clone().min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
            kept.others += now.count().saturating_sub(1) as f64 / person.len() as f64;
            match nearest.filter(|track| distance_m(track) < GATE_M) {
                Some(track) => {
                    kept.farthest_m = kept.farthest_m.max(distance_m(&track));
                    if !kept.ids.contains(&track.id) {
                        kept.ids.push(track.id);
                    }
                }
                None => kept.missed += 1.0 / person.len() as f64,
            }
        }
        kept
    }
}

/// A person walks, and all masks are black for three seconds: `true` if the person is tracked with the id of before a
/// second later, `None` in a room that they have left by then.
fn lost(seed: u64) -> StepResult<Option<bool>> {
    const BLANK_S: [f64; 2] = [10.0, 13.0];
    let options_of_room = RoomOptions { seed, cameras: 3, furniture: 5, ..RoomOptions::default() };
    let room = options_of_room.build().map_err(|e| e.to_string())?;
    let walkers = WalkerOptions {
        seed,
        people: 1,
        first_s: 4.0,
        stops: 8,
        longest_stay_s: 0.2,
        ..WalkerOptions::default()
    };
    let sequence = room.sequence(room.walkers(&walkers), options(RATE_HZ, (18.0 * RATE_HZ) as u32));
    let is_blank = |time_s: f64| (BLANK_S[0]..BLANK_S[1]).contains(&time_s);
    let recording = MaskRecording::write(&room, sequence.frames(), is_blank)?;
    recording.follow(&[])?;
    let (tracks, truth) = (recording.tracks()?, recording.truth()?);
    let frame_at = |time_s: f64| (time_s * RATE_HZ) as u32;
    let [before, after] = [frame_at(BLANK_S[0]) - 2, frame_at(BLANK_S[1] + 1.0) + 1];
    let place_at = |frame: u32| truth.iter().find(|row| row.frame == frame).map(|row| row.place);
    let id_at = |frame: u32| {
        let at = place_at(frame)?;
        let near = tracks.iter().filter(|track| track.frame == frame && track.distance_m(at) < GATE_M);
        near.min_by(|a, b| a.distance_m(at).total_cmp(&b.distance_m(at))).map(|track| track.id)
    };
    if !(before..=after).all(|frame| place_at(frame).is_some()) {
        println!("  lost {seed}: left by then");
        return Ok(None);
    }
    let ids = [id_at(before), id_at(after)];
    println!("  lost {seed}: ids before and after {ids:?}");
    Ok(Some(ids[0].is_some() && ids[0] == ids[1]))
}
