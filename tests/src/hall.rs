//! The head tracker's experiments on a synthetic hall: six cameras around 8 × 6 m, people on known ways, true heads.

use image::RgbImage;
use nalgebra::{Point2, Point3, Vector2};
use synthetic::{
    Frame, RenderOptions, RoomKind, RoomOptions, Screen, Sequence, SequenceOptions, SyntheticRoom,
    WalkerOptions,
};
use tracker::method::Method;
use tracker::method::condensation::{Condensation, CondensationOptions};
use tracker::prepared_room::{PreparationOptions, PreparedRoom};
use tracker::{CameraFrame, Moment, PersonEstimate};

use crate::chain::StepResult;

/// The hall's width, depth and height, metres.
const SIZE_M: [f64; 3] = [8.0, 6.0, 2.9];

/// Screen along the hall's long axis.
const SCREEN: Screen = Screen { middle: Point2::new(4.0, 2.55), yaw_deg: 0.0, width_m: 3.0, height_m: 2.1 };

/// The hall with `cameras` cameras. A screen hides people on one side from the cameras on the other.
pub fn hall(seed: u64, cameras: usize, with_screen: bool) -> StepResult<SyntheticRoom> {
    let options = RoomOptions {
        seed,
        kind: RoomKind::Hall,
        furniture: if with_screen { 0 } else { 3 },
        cameras,
        size_m: Some(SIZE_M),
        screens: if with_screen { vec![SCREEN] } else { Vec::new() },
        image_px: [640, 480],
        field_of_view_deg: 80.0,
        ..RoomOptions::default()
    };
    options.build().map_err(|e| e.to_string())
}

/// Number of cameras from which the screen hides a head: those whose rays to it hit the board.
pub fn hidden_from(room: &SyntheticRoom, head: &Point3<f64>) -> usize {
    let hides = |camera: Point3<f64>| {
        let share = (SCREEN.middle.y - camera.y) / (head.y - camera.y);
        let met = camera + (head - camera) * share;
        (0.0..1.0).contains(&share)
            && (met.x - SCREEN.middle.x).abs() < 0.5 * SCREEN.width_m
            && met.z < SCREEN.height_m
    };
    room.room.cameras.iter().filter(|c| hides(c.camera.center())).count()
}

/// A person who walks behind the screen, turns around there, turns again, and walks on.
pub fn behind_the_screen(seed: u64) -> WalkerOptions {
    let way = [1.2, 4.6, 3.4, 6.8].map(|x| Point2::new(x, SCREEN.middle.y + 0.7)).to_vec();
    WalkerOptions { seed, people: 1, first_s: 0.5, ways: vec![way], ..WalkerOptions::default() }
}

/// A way twice around the hall's middle (figure 20 of the paper: 1 → 2 → 3 → 4 → 1), beginning at one of its corners.
fn round_way(first: usize, wide_m: f64) -> Vec<Point2<f64>> {
    let corners = [(-1.0, -0.6), (1.0, -0.6), (1.0, 0.6), (-1.0, 0.6)];
    let middle = Point2::new(0.5 * SIZE_M[0], 0.5 * SIZE_M[1]);
    let corner = |i: usize| middle + Vector2::new(corners[i % 4].0, corners[i % 4].1) * wide_m;
    (0..9).map(|i| corner(first + i)).collect()
}

/// People who enter one after the other and go around the hall.
pub fn going_round(people: usize, interval_s: f64) -> WalkerOptions {
    let ways = (0..people).map(|i| round_way(i, 1.0 + 0.3 * (i % 3) as f64)).collect();
    WalkerOptions { seed: 31, people, first_s: 0.5, interval_s, ways, ..WalkerOptions::default() }
}

/// People who enter one after the other, turn around in the middle of their way, and leave.
pub fn passing_through(people: usize) -> WalkerOptions {
    WalkerOptions {
        seed: 21,
        people,
        first_s: 0.5,
        interval_s: 2.5,
        stops: 1,
        longest_stay_s: 0.0,
        ..WalkerOptions::default()
    }
}

/// A recording of the hall, with the people's ways.
pub fn recording<'a>(
    room: &'a SyntheticRoom,
    walkers: &WalkerOptions,
    rate_hz: f64,
    seconds: f64,
) -> Sequence<'a> {
    let options = SequenceOptions {
        seed: walkers.seed,
        rate_hz,
        frames: (rate_hz * seconds) as u32,
        render: RenderOptions { samples: 1, ..RenderOptions::default() },
        ..SequenceOptions::default()
    };
    room.sequence(room.walkers(walkers), options)
}

/// Pictures of the empty hall by each of its cameras.
pub fn empty_pictures(room: &SyntheticRoom) -> Vec<CameraFrame> {
    pictures(&room.sequence(Vec::new(), SequenceOptions { frames: 1, ..SequenceOptions::default() }).frame(1))
}

/// Tracker in the hall, initialised with [`empty_pictures`] of it.
pub fn tracker(
    room: &SyntheticRoom,
    empty: &[CameraFrame],
    options: CondensationOptions,
) -> StepResult<Condensation> {
    let with_room = options.integration == tracker::method::condensation::integration::Integration::Room;
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let mut scene = room.room.clone();
    if !with_room {
        // The paper's system knows only cameras and gates.
        scene.geometry = None;
    }
    scene.write(scratch.path()).map_err(|e| e.to_string())?;
    let prepared = PreparedRoom::prepare(
        &scene,
        scratch.path(),
        &PreparationOptions { occlusion: with_room, ..PreparationOptions::default() },
    );
    let mut tracker =
        Condensation::new(prepared.map_err(|e| e.to_string())?, options).map_err(|e| e.to_string())?;
    for (i, camera) in empty.iter().enumerate() {
        if let Some(image) = &camera.image {
            tracker.set_empty_scene(i, image);
        }
    }
    Ok(tracker)
}

/// A moment's pictures as a tracker receives them.
pub fn pictures(frame: &Frame) -> Vec<CameraFrame> {
    let seen = |image: &RgbImage| CameraFrame::of_image(image.clone());
    frame.cameras.iter().map(|c| c.image.as_ref().map(seen).unwrap_or_default()).collect()
}

/// One step of a tracker.
pub fn step(
    tracker: &mut Condensation,
    frame: &Frame,
    cameras: &[CameraFrame],
) -> StepResult<Vec<PersonEstimate>> {
    let moment = Moment { frame: frame.frame, time_s: frame.time_s, cameras };
    tracker.step(&moment).map_err(|e| e.to_string())
}

/// Distance between an estimated head and a true one, metres.
pub fn error_m(estimate: &PersonEstimate, head: &Point3<f64>) -> f64 {
    (Point3::new(estimate.x_m, estimate.y_m, estimate.z_m) - head).norm()
}

/// The estimate nearest to a true head, with its distance.
pub fn nearest<'a>(people: &'a [PersonEstimate], head: &Point3<f64>) -> Option<(&'a PersonEstimate, f64)> {
    let distances = people.iter().map(|p| (p, error_m(p, head)));
    distances.min_by(|a, b| a.1.total_cmp(&b.1))
}
