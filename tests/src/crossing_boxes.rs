//! Boxes of people who pass each other in one picture, as a detector finds them, and their truth.

use std::fmt::Write;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Number of crossings.
pub const SCENES: u32 = 100;
/// Frames of a crossing; as long as half of the pause after it.
const FRAMES: u32 = 40;
const PERIOD: u32 = 140;
/// Largest error of an edge, pixels: uniform, so that its standard deviation is one pixel.
const NOISE_PX: f64 = 1.7;

/// MOTChallenge rows.
#[derive(Debug, Clone, Default)]
pub struct Crossings {
    /// True boxes, with ids.
    pub truth: String,
    /// Boxes found, in random order, without ids.
    pub found: String,
}

/// Two people who walk towards each other at 3 to 5 pixels a frame and meet at one place for a moment, a hundred times.
pub fn crossings() -> Crossings {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let Crossings { mut truth, mut found } = Crossings::default();
    for scene in 0..SCENES {
        let speed: [f64; 2] = [random.random_range(3.0..5.0), -random.random_range(3.0..5.0)];
        let start = random.random_range(-20.5..-19.5);
        for f in 1..=FRAMES {
            let mut boxes = Vec::new();
            for (person, speed) in (0..).zip(speed) {
                let x = 380.0 + speed * (f64::from(f) + start);
                let frame = PERIOD * scene + f;
                // Writing to a string cannot fail.
                let _ = writeln!(truth, "{frame},{},{x},250,40,100,1", 2 * scene + person + 1);
                let mut noise = || random.random_range(-NOISE_PX..NOISE_PX);
                let (left, top) = (x + noise(), 250.0 + noise());
                boxes.push(format!("{frame},-1,{left:.2},{top:.2},40,100,0.9\n"));
            }
            if random.random_bool(0.5) {
                boxes.reverse();
            }
            found += &boxes.concat();
        }
    }
    Crossings { truth, found }
}

impl Crossings {
    /// The same with boxes missed and false ones, which have lower scores, as detectors make them.
    #[must_use]
    pub fn cluttered(mut self) -> Self {
        const MISSED: f64 = 0.1;
        const FALSE: f64 = 0.15;
        let mut random = Pcg64Mcg::seed_from_u64(2);
        let mut found = String::new();
        for row in self.found.lines() {
            if !random.random_bool(MISSED) {
                let _ = writeln!(found, "{row}");
            }
            if let Some((frame, _)) = row.split_once(',').filter(|_| random.random_bool(FALSE)) {
                let [left, top, score] = [(150.0, 600.0), (150.0, 350.0), (0.4, 0.95)]
                    .map(|(from, to): (f64, f64)| random.random_range(from..to));
                let _ = writeln!(found, "{frame},-1,{left:.2},{top:.2},40,100,{score:.2}");
            }
        }
        self.found = found;
        self
    }
}
