//! Experiment 1 of A. Nakazawa, S. Hiura, H. Kato, S. Inokuchi, "Tracking Multiple Persons Using Distributed Vision
//! Systems" (in Japanese), IPSJ Journal 2001, section 4.1, in synthetic halls: three stations, two people who meet so
//! closely that stations may confuse them. A crossing is right when both keep their own ids 8 s after they met; in these
//! 8 s they do not meet again. The paper has 8 of 10.
//!
//! `cargo bench -p tests --bench crossings [-- NUMBER [FIRST-SEED]]`: 50 crossings.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::{Point2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use scenes::room::Room;
use synthetic::{PersonTruth, RoomKind, RoomOptions, Sequence, SequenceOptions, SyntheticRoom, Walker};
use tests::chain::StepResult;
use tracker::method::Method;
use tracker::method::agents::modern::ModernOptions;
use tracker::method::agents::published::PublishedOptions;
use tracker::method::agents::{Agents, AgentsOptions, RuleOptions};
use tracker::method::mcmc::McmcOptions;
use tracker::observation::{Colours, Mask};
use tracker::prepared_room::{PreparationOptions, PreparedRoom};
use tracker::{CameraFrame, Moment, PersonEstimate, TrackId};

const RATE_HZ: f64 = 12.0;
const SIZE_M: [f64; 3] = [8.0, 6.0, 2.9];
const SPEED_M_S: f64 = 1.1;
/// Length of the way to the meeting, and of its last straight part at most, metres.
const TO_MEETING_M: f64 = 5.5;
const APPROACH_M: f64 = 2.4;
/// Least distance of people from a wall, metres.
const WALL_M: f64 = 0.7;
/// Time after the meeting, seconds.
const AFTER_S: f64 = 8.0;
/// Beginning and end of the interval before the meeting in which the ids before it are counted, seconds before it.
const BEFORE_S: [f64; 2] = [1.2, 0.2];
/// Distance at which the two pass each other, metres.
const ASIDE_M: f64 = 0.3;
/// Two people who come nearer than this meet, metres; from this time on after the first meeting they do so again, seconds.
const MEETING_M: f64 = 1.2;
const AGAIN_AFTER_S: f64 = 1.5;
/// Draws of ways at most.
const MOST_DRAWN: usize = 1000;
/// Distance beyond which an estimate does not belong to a person, metres.
const GATE_M: f64 = 0.6;
/// First seed where none is given. Nothing was tuned on these.
const FIRST_SEED: u64 = 9101;

fn main() -> StepResult<()> {
    let mut asked = std::env::args().skip(1).filter_map(|a| a.parse::<u64>().ok());
    let (count, first) = (asked.next().unwrap_or(50), asked.next().unwrap_or(FIRST_SEED));
    let rules = [
        ("modern", RuleOptions::Modern(ModernOptions::default())),
        ("published", RuleOptions::Published(PublishedOptions::default())),
    ];
    let seeds: Vec<u64> = (first..first + count).collect();
    let are_right: Vec<[bool; 2]> = seeds
        .par_iter()
        .map(|seed| {
            let made = hall(*seed)?;
            HallCrossing::new(*seed, &made).follow(&made, &rules.clone().map(|(_, rule)| rule))
        })
        .collect::<StepResult<_>>()?;
    let mut right = [0; 2];
    let mut wrong = [Vec::new(), Vec::new()];
    for (seed, is_right) in seeds.iter().zip(&are_right) {
        for (i, is_right) in is_right.iter().enumerate() {
            if *is_right {
                right[i] += 1;
            } else {
                wrong[i].push(*seed);
            }
        }
    }
    println!("crossings right after {AFTER_S} s, three stations, {count} pairs from seed {first}");
    for (i, (name, _)) in rules.iter().enumerate() {
        println!("{name:<10} {:>3} of {count}   wrong: {:?}", right[i], wrong[i]);
    }
    Ok(())
}

fn hall(seed: u64) -> StepResult<SyntheticRoom> {
    let options = RoomOptions {
        seed,
        kind: RoomKind::Hall,
        furniture: 0,
        cameras: 3,
        size_m: Some(SIZE_M),
        image_px: [320, 240],
        field_of_view_deg: 80.0,
        ..RoomOptions::default()
    };
    options.build().map_err(|e| e.to_string())
}

/// Two people who meet once, in the middle of a hall, and go on through it.
struct HallCrossing {
    seed: u64,
    ways: [Vec<Point2<f64>>; 2],
    met_s: f64,
}

impl HallCrossing {
    fn new(seed: u64, made: &SyntheticRoom) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut between = |low: f64, high: f64| rng.random_range(low..high);
        let [width, depth, _] = made.size_m;
        let inside = |p: Point2<f64>| {
            Point2::new(p.x.clamp(WALL_M, width - WALL_M), p.y.clamp(WALL_M, depth - WALL_M))
        };
        let toward = |angle: f64| Vector2::new(angle.cos(), angle.sin());
        let middle = Point2::new(between(3.5, 4.5), between(2.7, 3.3));
        let bearing = between(0.0, TAU);
        let turn = between(1.8, 4.4);
        let mut way = |angle: f64, aside_m: f64| {
            let ahead = toward(angle);
            let passes = middle + toward(angle + 0.25 * TAU) * aside_m;
            let turns = inside(passes - ahead * APPROACH_M);
            // Both have walked equally far when they meet; the start of the way depends on the room in the hall.
            let walk_m = TO_MEETING_M - (passes - turns).norm();
            let starts = |_| turns + toward(between(0.0, TAU)) * walk_m;
            let start = (0..100).map(starts).find(|start| inside(*start) == *start);
            let mut way = vec![start.unwrap_or(turns), turns, passes];
            let mut next = inside(passes + toward(angle + between(-1.2, 1.2)) * 1.5);
            let mut length_m = 0.0;
            while length_m < SPEED_M_S * (AFTER_S + 2.0) {
                length_m += (next - way[way.len() - 1]).norm();
                way.push(next);
                next = Point2::new(between(1.0, width - 1.0), between(1.0, depth - 1.0));
            }
            way
        };
        let mut ways = || [way(bearing, 0.5 * ASIDE_M), way(bearing + turn, -0.5 * ASIDE_M)];
        let mut drawn = ways();
        for _ in 0..MOST_DRAWN {
            if !meet_again(&drawn) {
                break;
            }
            drawn = ways();
        }
        let ways = drawn;
        Self { seed, ways, met_s: TO_MEETING_M / SPEED_M_S }
    }

    fn sequence<'a>(&self, made: &'a SyntheticRoom) -> Sequence<'a> {
        let walker =
            |i: usize| Walker::along(i as u32 + 1, 2 * self.seed + i as u64, 0.0, SPEED_M_S, &self.ways[i]);
        let frames = ((self.met_s + AFTER_S + 0.5) * RATE_HZ) as u32;
        let options =
            SequenceOptions { seed: self.seed, rate_hz: RATE_HZ, frames, ..SequenceOptions::default() };
        made.sequence(vec![walker(0), walker(1)], options)
    }

    /// Tells whether both people keep their own ids to the end, for each set of rules.
    fn follow(&self, made: &SyntheticRoom, rules: &[RuleOptions; 2]) -> StepResult<[bool; 2]> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        made.room.write(folder.path()).map_err(|e| e.to_string())?;
        let room = Room::read(folder.path()).map_err(|e| e.to_string())?;
        let prepared = PreparedRoom::prepare(&room, folder.path(), &PreparationOptions::default())
            .map_err(|e| e.to_string())?;
        let agents = |rule: &RuleOptions| {
            let sampler = McmcOptions { seed: self.seed, ..McmcOptions::default() };
            Agents::new(prepared.clone(), &AgentsOptions { sampler, rule: rule.clone() })
                .map_err(|e| e.to_string())
        };
        let mut systems = [agents(&rules[0])?, agents(&rules[1])?];
        let mut ids = [Ids::default(), Ids::default()];
        for frame in self.sequence(made).frames() {
            let seen = |c: &synthetic::CameraFrame| {
                let mask = Mask::from(&c.mask);
                let colours = c.image.as_ref().map(|image| Colours::of_picture(&mask, 2, image));
                CameraFrame { mask: Some(mask), colours, ..CameraFrame::default() }
            };
            let cameras: Vec<CameraFrame> = frame.cameras.iter().map(seen).collect();
            let moment = Moment { frame: frame.frame, time_s: frame.time_s, cameras: &cameras };
            for (system, ids) in systems.iter_mut().zip(&mut ids) {
                let people = system.step(&moment).map_err(|e| e.to_string())?;
                if (BEFORE_S[1]..BEFORE_S[0]).contains(&(self.met_s - frame.time_s)) {
                    ids.count(0, &frame.people, &people);
                } else if frame.time_s > self.met_s + AFTER_S - 1.0 {
                    ids.count(1, &frame.people, &people);
                }
            }
        }
        Ok(ids.map(|ids| ids.are_kept()))
    }
}

/// Whether two people who walk so meet a second time before the end.
fn meet_again(ways: &[Vec<Point2<f64>>; 2]) -> bool {
    let at = |way: &[Point2<f64>], time_s: f64| {
        let mut left_m = SPEED_M_S * time_s;
        for leg in way.windows(2) {
            let length_m = (leg[1] - leg[0]).norm();
            if left_m <= length_m {
                return leg[0] + (leg[1] - leg[0]) * (left_m / length_m.max(1e-9));
            }
            left_m -= length_m;
        }
        way[way.len() - 1]
    };
    let first_s = TO_MEETING_M / SPEED_M_S + AGAIN_AFTER_S;
    let steps = ((AFTER_S - AGAIN_AFTER_S) * RATE_HZ) as u32;
    (0..=steps)
        .map(|step| first_s + f64::from(step) / RATE_HZ)
        .any(|time_s| (at(&ways[0], time_s) - at(&ways[1], time_s)).norm() < MEETING_M)
}

/// Number of frames in which each of two people had each id, before the meeting and in the last second.
#[derive(Default)]
struct Ids([[BTreeMap<TrackId, u32>; 2]; 2]);

impl Ids {
    fn count(&mut self, when: usize, truth: &[PersonTruth], people: &[PersonEstimate]) {
        for truth in truth {
            let away = |p: &PersonEstimate| (Point2::new(p.x_m, p.y_m) - truth.place).norm();
            let nearest = people.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
            if let Some(found) = nearest.filter(|p| away(p) <= GATE_M) {
                *self.0[truth.id as usize - 1][when].entry(found.id).or_default() += 1;
            }
        }
    }

    fn are_kept(&self) -> bool {
        let usual = |person: usize, when: usize| {
            self.0[person][when].iter().max_by_key(|(_, count)| **count).map(|(id, _)| *id)
        };
        let is_kept = |person: usize| usual(person, 0).is_some() && usual(person, 0) == usual(person, 1);
        is_kept(0) && is_kept(1) && usual(0, 1) != usual(1, 1)
    }
}
