//! Hours in front of a camera that nobody touches, as [`tracker::doctor::pose_watch`] sees them, and its turn in the end.
//!
//! A furnished room whose light drifts like a day's, flickers, and is switched, now for the whole picture and now for a half
//! of it; people with their shadows walk through it and stay for a while; a board as large as a chair is put elsewhere.

use std::ops::Range;

use image::RgbImage;
use nalgebra::{Point2, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use synthetic::{
    RenderOptions, RoomOptions, Screen, Sequence, SequenceOptions, SyntheticRoom, Walker, WalkerOptions,
};
use tracker::doctor::pose_watch::{PoseFinding, PoseWatch};

use crate::chain::StepResult;

/// Looks a second, as many as the watch takes.
const RATE_HZ: f64 = 2.0;
/// Time after the turn within which it should be told, seconds; the watch goes on for twice as long.
const TOLD_WITHIN_S: f64 = 3.0;
/// Turns in the end, degrees.
const TURNED_DEG: Range<f64> = 0.5..4.0;
/// Mean time between two people, and their longest stay at a place, seconds.
const INTERVAL_S: f64 = 40.0;
const LONGEST_STAY_S: f64 = 60.0;
/// Mean time between two switches of a light, seconds, and the factors by which one changes the brightness.
const SWITCHED_S: f64 = 240.0;
const SWITCHED: Range<f64> = 0.55..1.0;
/// Least and largest brightness of the day.
const DAYLIGHT: Range<f64> = 0.6..1.3;
/// Column between the halves of a picture.
const MIDDLE: u32 = 160;
/// Share by which lamps flicker.
const FLICKER: f32 = 0.03;

/// Findings of a watch over a camera.
#[derive(Debug, Clone, Default)]
pub struct Watched {
    /// Number of looks before the turn, had there been no false alarm.
    pub looks: usize,
    /// Time at which the camera was set aside although nobody had touched it, seconds; the watch ends there.
    pub false_alarm_s: Option<f64>,
    /// Times of looks that found it doubtful.
    pub doubts_s: Vec<f64>,
    /// Turn in the end, degrees.
    pub turned_deg: f64,
    /// Time from the turn until it was told, seconds; `None` where it was not.
    pub told_after_s: Option<f64>,
}

impl Watched {
    /// Whether the turn was told in time.
    pub fn is_told(&self) -> bool {
        self.told_after_s.is_some_and(|after_s| after_s <= TOLD_WITHIN_S)
    }
}

/// Watches a camera of a room for some seconds, then turns it.
///
/// # Errors
/// A room that cannot be built, an error of OpenCV.
pub fn watch(seed: u64, seconds: f64) -> StepResult<Watched> {
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0x0da7);
    let looks = (seconds * RATE_HZ) as u32;
    let [before, after] = furnished(seed, &mut random)?;
    let turned_deg = random.random_range(TURNED_DEG);
    let axis = Vector3::from_fn(|_, _| random.random_range(-1.0..1.0)).normalize();
    let mut turned = after.build().map_err(|e| e.to_string())?;
    let camera = &mut turned.room.cameras[0].camera;
    camera.camera_from_world.append_rotation_mut(&UnitQuaternion::new(axis * turned_deg.to_radians()));
    let [before, after] = [before.build(), after.build()].map(|room| room.map_err(|e| e.to_string()));
    let [before, after] = [before?, after?];
    // Nobody minds the board that is put elsewhere.
    let people = before.walkers(&WalkerOptions {
        seed,
        people: (seconds / INTERVAL_S).ceil() as usize,
        interval_s: INTERVAL_S,
        longest_stay_s: LONGEST_STAY_S,
        ..WalkerOptions::default()
    });
    let [first, second, last] = [&before, &after, &turned].map(|room| film(room, &people, seed, looks));
    let chair_moved = random.random_range(looks / 4..=3 * looks / 4);
    let light = Light::new(seconds, &mut random);

    let mut watch = PoseWatch::new(before.room.cameras[0].camera.intrinsics.clone());
    let mut look = |film: &Sequence<'_>, number: u32| -> StepResult<(f64, PoseFinding)> {
        let time_s = f64::from(number) / RATE_HZ;
        let picture = film.frame(number).cameras.swap_remove(0).image.ok_or("a camera without a picture")?;
        let found = watch.look(&light.on(picture, time_s), time_s).map_err(|e| e.to_string())?;
        Ok((time_s, found))
    };
    let mut watched = Watched { looks: looks as usize, turned_deg, ..Watched::default() };
    for number in 1..=looks {
        let (time_s, found) = look(if number < chair_moved { &first } else { &second }, number)?;
        match found {
            PoseFinding::Unmoved => {}
            PoseFinding::Doubtful => watched.doubts_s.push(time_s),
            PoseFinding::Moved | PoseFinding::AtRest => {
                // A `PoseWatch` that has found a turn never finds the camera unmoved again.
                watched.false_alarm_s = Some(time_s);
                return Ok(watched);
            }
        }
    }
    let turned_s = f64::from(looks + 1) / RATE_HZ;
    for number in looks + 1..=looks + (2.0 * TOLD_WITHIN_S * RATE_HZ) as u32 {
        let (time_s, found) = look(&last, number)?;
        if matches!(found, PoseFinding::Moved | PoseFinding::AtRest) {
            watched.told_after_s = Some(time_s - turned_s);
            break;
        }
    }
    Ok(watched)
}

/// A room with one camera, before and after a board as large as a chair is put elsewhere.
fn furnished(seed: u64, random: &mut Pcg64Mcg) -> StepResult<[RoomOptions; 2]> {
    let bare = RoomOptions { seed, cameras: 1, ..RoomOptions::default() };
    let empty = bare.build().map_err(|e| e.to_string())?;
    let mut place = || -> StepResult<RoomOptions> {
        let mut anywhere =
            || Point2::from([0, 1].map(|axis| random.random_range(0.2..0.8) * empty.size_m[axis]));
        // Far more than are needed: about half of a room's middle is free.
        let free = (0..1000).map(|_| anywhere()).find(|place| empty.is_free(place));
        let middle = free.ok_or("a room without a free place")?;
        let screen = Screen { middle, yaw_deg: random.random_range(0.0..180.0), width_m: 0.5, height_m: 0.9 };
        Ok(RoomOptions { screens: vec![screen], ..bare.clone() })
    };
    Ok([place()?, place()?])
}

/// Film of a room through which people walk for as many looks.
fn film<'a>(room: &'a SyntheticRoom, people: &[Walker], seed: u64, looks: u32) -> Sequence<'a> {
    let render = RenderOptions { samples: 1, flicker: FLICKER, ..RenderOptions::default() };
    let options = SequenceOptions { seed, rate_hz: RATE_HZ, frames: looks, images: true, render };
    room.sequence(people.to_vec(), options)
}

/// Brightness of the picture over time.
struct Light {
    /// Phase and turns of the daylight's two waves.
    waves: [(f64, f64); 2],
    switched: Vec<SwitchedLamp>,
}

/// A lamp that is switched off for a while.
struct SwitchedLamp {
    /// Time for which it is off, seconds.
    off_s: Range<f64>,
    /// Columns of the picture that it lights.
    columns: Range<u32>,
    /// Share of the brightness that is left there without it.
    left: f64,
}

impl Light {
    fn new(seconds: f64, random: &mut Pcg64Mcg) -> Self {
        let mut waves = || (random.random_range(0.0..std::f64::consts::TAU), random.random_range(0.5..4.0));
        let waves = [waves(), waves()];
        let count = (seconds / SWITCHED_S) as usize;
        let mut switched = || {
            let from_s = random.random_range(0.0..seconds);
            let columns = [0..u32::MAX, 0..MIDDLE, MIDDLE..u32::MAX][random.random_range(0..3)].clone();
            let off_s = from_s..from_s + random.random_range(1.0..SWITCHED_S);
            SwitchedLamp { off_s, columns, left: random.random_range(SWITCHED) }
        };
        Self { waves, switched: (0..count).map(|_| switched()).collect() }
    }

    /// A picture in the light of a time.
    fn on(&self, mut picture: RgbImage, time_s: f64) -> RgbImage {
        let wave =
            |(phase, turns): (f64, f64)| (phase + std::f64::consts::TAU * turns * time_s / 3600.0).sin();
        let part = 0.5 + 0.25 * self.waves.map(wave).iter().sum::<f64>();
        let day = DAYLIGHT.start + (DAYLIGHT.end - DAYLIGHT.start) * part;
        let lit = |column: u32| {
            let off = |lamp: &&SwitchedLamp| lamp.off_s.contains(&time_s) && lamp.columns.contains(&column);
            day * self.switched.iter().filter(off).map(|lamp| lamp.left).product::<f64>()
        };
        let by_column: Vec<f64> = (0..picture.width()).map(lit).collect();
        for (column, _, pixel) in picture.enumerate_pixels_mut() {
            let light = by_column[column as usize];
            pixel.0 = pixel.0.map(|level| (f64::from(level) * light).round().min(255.0) as u8);
        }
        picture
    }
}
