//! People who are told although they have left: rooms that `recon build` makes from synthetic captures, people who come
//! and leave, and a minute of nobody. A row after the first three seconds of that minute is a ghost.
//!
//! Masks are exact, so that a ghost is the tracker's or the room's: floor that nobody sees, behind a wall or a door, on
//! which somebody could stand for ever.
//!
//! `cargo bench -p tests --bench ghosts [-- NUMBER [FIRST-SEED]]`: 20 rooms. Rooms are kept between runs in
//! `target/release/live-films`.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};

use nalgebra::{Point2, Vector2, Vector3};
use scenes::walkable::Grid;
use synthetic::{RoomOptions, SequenceOptions, SyntheticRoom, WalkerOptions};
use tests::chain::{StepResult, run};
use tests::data::program;
use tests::live::films::kept;

const RATE_HZ: f64 = 12.0;
/// Frames of each capture.
const CAPTURE_FRAMES: usize = 30;
/// Duration of the empty room at the end, and of its beginning in which a row is no ghost, seconds.
const EMPTY_S: f64 = 60.0;
const GRACE_S: f64 = 3.0;
/// Error of a built wall's place that is no floor outside of it, metres.
const MARGIN_M: f64 = 0.15;
/// First seed where none is given. Nothing was tuned on these.
const FIRST_SEED: u64 = 5001;

fn main() -> StepResult<()> {
    let mut asked = std::env::args().skip(1).filter_map(|a| a.parse::<u64>().ok());
    let (count, first) = (asked.next().unwrap_or(20), asked.next().unwrap_or(FIRST_SEED));
    println!("room  people told  last row after  rows after {GRACE_S} s  floor  outside the walls  missed");
    let mut rooms_with_ghosts = 0;
    for seed in first..first + count {
        let result = EmptiedRoom::new(seed)?.track()?;
        rooms_with_ghosts += usize::from(result.ghost_rows > 0);
        println!(
            "{seed:>4}  {:>9.1} %  {:>12.1} s  {:>14}  {:>5.1} m²  {:>5.1} m²  {:>5.1} m²",
            100.0 * result.told,
            result.last_row_s,
            result.ghost_rows,
            result.floor_m2,
            result.outside_m2,
            result.missed_m2
        );
    }
    println!("{rooms_with_ghosts} of {count} rooms have ghosts");
    Ok(())
}

/// A built room and the masks of its cameras.
struct EmptiedRoom {
    made: SyntheticRoom,
    folder: PathBuf,
    /// Sum over frames of the people in the room.
    inside: usize,
    /// Last frame in which somebody is in the room.
    last_inside: u32,
    cameras: Vec<String>,
}

/// Figures of a run.
struct Outcome {
    /// Rows while somebody was in the room, as a share of those that the truth has.
    told: f64,
    last_row_s: f64,
    ghost_rows: usize,
    floor_m2: f64,
    outside_m2: f64,
    missed_m2: f64,
}

impl EmptiedRoom {
    fn new(seed: u64) -> StepResult<Self> {
        let options = RoomOptions { seed, cameras: 2, image_px: [480, 360], ..RoomOptions::default() };
        let made = options.build().map_err(|e| e.to_string())?;
        let folder = kept(&format!("ghosts_{seed}"))?;
        let (project, room) = (folder.join("project"), folder.join("room"));
        if !room.join("scene.toml").is_file() {
            tests::project::write(&project, &made, CAPTURE_FRAMES)?;
            let mut build = program("recon");
            build.arg("build").arg(project.join("room.toml")).args(["--quality", "draft", "--out"]);
            run(build.arg(&room).arg("--zones").arg(project.join("zones.toml")))?;
        }
        let cameras = made.room.cameras.iter().map(|camera| camera.name.clone()).collect();
        let mut emptied = Self { made, folder, inside: 0, last_inside: 0, cameras };
        emptied.film(seed)?;
        Ok(emptied)
    }

    /// Writes the masks.
    fn film(&mut self, seed: u64) -> StepResult<()> {
        let walkers = self.made.walkers(&WalkerOptions { seed, stops: 2, ..WalkerOptions::default() });
        let end_s = walkers.iter().map(|walker| walker.span_s().1).fold(0.0, f64::max);
        let frames = ((end_s + EMPTY_S) * RATE_HZ) as u32;
        let options =
            SequenceOptions { seed, rate_hz: RATE_HZ, frames, images: false, ..SequenceOptions::default() };
        let sequence = self.made.sequence(walkers, options);
        for camera in &self.cameras {
            std::fs::create_dir_all(self.masks(camera)).map_err(|e| e.to_string())?;
        }
        for frame in sequence.frames() {
            let inside = frame.people.iter().filter(|person| person.inside).count();
            self.inside += inside;
            if inside > 0 {
                self.last_inside = frame.frame;
            }
            for (name, seen) in self.cameras.iter().zip(&frame.cameras) {
                let path = self.masks(name).join(format!("{:05}.png", frame.frame));
                seen.mask.save(&path).map_err(|e| format!("{}: {e}", path.display()))?;
            }
        }
        Ok(())
    }

    fn masks(&self, camera: &str) -> PathBuf {
        self.folder.join("masks").join(camera)
    }

    fn track(&self) -> StepResult<Outcome> {
        let (room, out) = (self.folder.join("room"), self.folder.join("out"));
        let mut tracker = program("tracker");
        tracker.arg("run").arg(&room).arg("--no-film").arg("--out").arg(&out);
        tracker.args(["--rate", &RATE_HZ.to_string()]);
        for camera in &self.cameras {
            tracker.arg("--masks").arg(format!("{camera}={}", self.masks(camera).display()));
        }
        run(&mut tracker)?;
        let frames = rows(&out.join("tracks.txt"))?;
        let after_s = |frame: &u32| f64::from(frame.saturating_sub(self.last_inside)) / RATE_HZ;
        let scene = scenes::room::Room::read(&room).map_err(|e| e.to_string())?;
        let floor = scenes::walkable::WalkableMap::of_room(&scene).map_err(|e| e.to_string())?;
        let floor = floor.grid().ok_or("the built room has no floor")?;
        let (outside_m2, missed_m2) = self.floor_errors_m2(floor);
        Ok(Outcome {
            told: frames.iter().filter(|frame| **frame <= self.last_inside).count() as f64
                / self.inside as f64,
            last_row_s: frames.iter().map(after_s).fold(0.0, f64::max),
            ghost_rows: frames.iter().filter(|frame| after_s(frame) > GRACE_S).count(),
            floor_m2: floor.area_m2(),
            outside_m2,
            missed_m2,
        })
    }

    /// Area of the derived floor that is neither in the room, with [`MARGIN_M`] around, nor in a corridor behind a door,
    /// and the area of the room's free floor, [`MARGIN_M`] off walls and furniture, that the derived floor misses.
    fn floor_errors_m2(&self, floor: &Grid) -> (f64, f64) {
        // The built room's origin is below its first camera, its x axis along that camera's view.
        let camera = &self.made.room.cameras[0].camera;
        let x = (camera.camera_from_world.rotation.inverse() * Vector3::z()).xy().normalize();
        let y = Vector2::new(-x.y, x.x);
        let below: Point2<f64> = camera.center().xy();
        let around =
            [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)].map(|(x, y)| Vector2::new(x, y) * MARGIN_M);
        let (mut outside, mut missed) = (0, 0);
        for cell in 0..floor.bits.len() {
            let built = floor.center(cell);
            let place = below + x * built.x + y * built.y;
            let is_near_room = around.iter().any(|aside| self.made.is_inside(&(place + aside)));
            let is_free = around.iter().all(|aside| self.made.is_free(&(place + aside)));
            outside += usize::from(floor.bits[cell] && !is_near_room && !self.made.is_in_corridor(&place));
            missed += usize::from(!floor.bits[cell] && is_free);
        }
        let area_m2 = |cells: usize| cells as f64 * floor.cell_m * floor.cell_m;
        (area_m2(outside), area_m2(missed))
    }
}

/// Frame of each row of a `MOTChallenge` file.
fn rows(path: &Path) -> StepResult<Vec<u32>> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let frame = |line: &str| line.split(',').next().and_then(|field| field.parse().ok());
    text.lines().map(|line| frame(line).ok_or_else(|| format!("{}: `{line}`", path.display()))).collect()
}
