//! The crossing experiment of T. Osawa, X. Wu, K. Sudo, K. Wakabayashi, T. Yasuno, "MCMC based Multiple People Tracking
//! using 3D Environmental Information" (in Japanese), paper LI-007, section 4.2, figure 9: two people walk past each
//! other so that in both images, at once, one is wholly behind the other. Rendered people, ten pairs; figures drawn.
//!
//! `cargo run --release -p tests --example crossing -- FIGURES-DIR`

use std::collections::BTreeMap;
use std::path::Path;

use calib::{Camera, Intrinsics};
use nalgebra::{Point2, Point3};
use scenes::plan::{FloorPlan, PlanOptions};
use scenes::room::{Room, RoomCamera};
use scenes::view::look_at;
use shell::canvas::Color;
use synthetic::{RoomOptions, SequenceOptions, SyntheticRoom, Walker};
use tests::chain::StepResult;
use tests::data::folder_to_write;
use tracker::likelihood::LikelihoodRule;
use tracker::method::Method;
use tracker::method::mcmc::{Mcmc, McmcOptions};
use tracker::observation::{Colours, Mask};
use tracker::prepared_room::{PreparationOptions, PreparedRoom};
use tracker::{CameraFrame, Moment};

const PAIRS: u64 = 10;
const RATE_HZ: f64 = 12.0;
const FRAMES: u32 = 72;
/// Half the distance at which the two pass each other.
const ASIDE_M: f64 = 0.35;
/// Distance beyond which an estimate does not belong to a person.
const GATE_M: f64 = 0.5;

/// Result of one pair.
#[derive(Debug, Default)]
struct PairOutcome {
    /// Number of estimates of each person under each id.
    names: BTreeMap<u32, BTreeMap<u32, u32>>,
    errors_m: Vec<f64>,
    /// Errors while one is hidden in either image.
    hidden_errors_m: Vec<f64>,
    missed: usize,
    /// Least share of the person behind that is visible in both images at once.
    least_visible: f64,
    ways: BTreeMap<u32, Vec<Point2<f64>>>,
    truth: BTreeMap<u32, Vec<Point2<f64>>>,
}

impl PairOutcome {
    /// Tells whether each person kept one id from the first to the last frame, different from the others'.
    fn kept_names(&self) -> bool {
        let names: Vec<&u32> =
            self.names.values().filter(|n| n.len() == 1).flat_map(BTreeMap::keys).collect();
        names.len() == 2 && names[0] != names[1]
    }
}

fn main() -> StepResult<()> {
    let figures = folder_to_write(std::env::args().nth(1))?;
    std::fs::create_dir_all(&figures).map_err(|e| format!("{figures}: {e}"))?;
    let published =
        McmcOptions { likelihood: LikelihoodRule::Overlap { exponent: 100.0 }, ..McmcOptions::published() };
    println!(
        "{:<22} {:>9} {:>9} {:>9} {:>14} {:>7}",
        "", "names", "mean cm", "max. cm", "hidden mean cm", "missed"
    );
    for (name, options) in [("default", McmcOptions::default()), ("published, power 100", published)] {
        let outcomes: Vec<PairOutcome> =
            (1..=PAIRS).map(|pair| cross(pair, &options)).collect::<StepResult<Vec<PairOutcome>>>()?;
        let errors: Vec<f64> = outcomes.iter().flat_map(|o| &o.errors_m).copied().collect();
        let hidden: Vec<f64> = outcomes.iter().flat_map(|o| &o.hidden_errors_m).copied().collect();
        println!(
            "{name:<22} {:>3} of {PAIRS} {:>9.2} {:>9.2} {:>14.2} {:>7}",
            outcomes.iter().filter(|o| o.kept_names()).count(),
            100.0 * mean(&errors),
            100.0 * errors.iter().copied().fold(0.0, f64::max),
            100.0 * mean(&hidden),
            outcomes.iter().map(|o| o.missed).sum::<usize>(),
        );
        let least = outcomes.iter().map(|o| o.least_visible).fold(0.0, f64::max);
        println!(
            "{:<22} at the crossing each image shows at most {:.0} % of the one behind",
            "",
            100.0 * least
        );
        let figure =
            Path::new(&figures).join(format!("crossing_{}.png", name.replace(", ", "_").replace(' ', "_")));
        draw(&outcomes[0], &figure)?;
    }
    Ok(())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// An empty room with two cameras that look at each other.
fn room(seed: u64) -> StepResult<SyntheticRoom> {
    let options = RoomOptions { seed, furniture: 0, ..RoomOptions::default() };
    let mut made = options.build().map_err(|e| e.to_string())?;
    let [width, depth, _] = made.size_m;
    let middle = Point3::new(0.5 * width, 0.5 * depth, 1.0);
    made.room.cameras = [0.15, width - 0.15]
        .into_iter()
        .enumerate()
        .map(|(i, x)| RoomCamera {
            name: format!("cam{i}"),
            camera: Camera {
                intrinsics: Intrinsics::from_horizontal_fov(320, 240, 74.0),
                camera_from_world: look_at(&Point3::new(x, 0.5 * depth, 1.7), &middle),
            },
            reference: None,
        })
        .collect();
    Ok(made)
}

fn cross(pair: u64, options: &McmcOptions) -> StepResult<PairOutcome> {
    let made = room(pair)?;
    let [width, depth, _] = made.size_m;
    let (near, far) = (0.5, depth - 0.5);
    let way = |x: f64, from: f64, to: f64| [Point2::new(x, from), Point2::new(x, to)];
    let speed = (far - near) / (f64::from(FRAMES) / RATE_HZ);
    let mut walkers = vec![
        Walker::along(1, 2 * pair, 0.0, speed, &way(0.5 * width - ASIDE_M, near, far)),
        Walker::along(2, 2 * pair + 1, 0.0, speed, &way(0.5 * width + ASIDE_M, far, near)),
    ];
    // With equal heights, the person in front hides the other wholly.
    walkers[1].body.height_m = walkers[0].body.height_m;
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    made.room.write(folder.path()).map_err(|e| e.to_string())?;
    let room = Room::read(folder.path()).map_err(|e| e.to_string())?;
    let prepared = PreparedRoom::prepare(&room, folder.path(), &PreparationOptions::default())
        .map_err(|e| e.to_string())?;
    let mut tracker =
        Mcmc::new(prepared, McmcOptions { seed: pair, ..options.clone() }).map_err(|e| e.to_string())?;
    let sequence = made.sequence(
        walkers,
        SequenceOptions { seed: pair, rate_hz: RATE_HZ, frames: FRAMES, ..SequenceOptions::default() },
    );
    let mut outcome = PairOutcome { least_visible: 1.0, ..PairOutcome::default() };
    for frame in sequence.frames() {
        let seen = |c: &synthetic::CameraFrame| {
            let mask = Mask::from(&c.mask);
            let colours = c.image.as_ref().map(|image| Colours::of_picture(&mask, 1, image));
            CameraFrame { mask: Some(mask), colours, ..CameraFrame::default() }
        };
        let cameras: Vec<CameraFrame> = frame.cameras.iter().map(seen).collect();
        let moment = Moment { frame: frame.frame, time_s: frame.time_s, cameras: &cameras };
        let people = tracker.step(&moment).map_err(|e| e.to_string())?;
        // People who were inside from the beginning are found once they have moved.
        if frame.time_s < 1.5 {
            continue;
        }
        let shown = frame.people.iter().map(|p| p.visible.iter().copied().fold(1.0, f64::min));
        let less = shown.fold(0.0, f64::max);
        outcome.least_visible = outcome.least_visible.min(less);
        for truth in &frame.people {
            outcome.truth.entry(truth.id).or_default().push(truth.place);
            let off = |x_m: f64, y_m: f64| (Point2::new(x_m, y_m) - truth.place).norm();
            let nearest = people.iter().min_by(|a, b| off(a.x_m, a.y_m).total_cmp(&off(b.x_m, b.y_m)));
            let Some(found) = nearest.filter(|p| off(p.x_m, p.y_m) <= GATE_M) else {
                outcome.missed += 1;
                continue;
            };
            *outcome.names.entry(truth.id).or_default().entry(found.id.0).or_default() += 1;
            outcome.ways.entry(truth.id).or_default().push(Point2::new(found.x_m, found.y_m));
            let error = off(found.x_m, found.y_m);
            outcome.errors_m.push(error);
            if truth.visible.iter().any(|part| *part < 0.5) {
                outcome.hidden_errors_m.push(error);
            }
        }
    }
    Ok(outcome)
}

/// Draws the true ways (black) and the estimated ones.
fn draw(outcome: &PairOutcome, figure: &Path) -> StepResult<()> {
    let made = room(1)?;
    let options = PlanOptions {
        title: Some("Two people pass each other: their ways (black) and the estimated ones".into()),
        ..PlanOptions::default()
    };
    let mut plan = FloorPlan::new(&made.room, &options).map_err(|e| e.to_string())?;
    for way in outcome.truth.values() {
        plan.trajectory(way, Color::INK, "");
    }
    for (id, way) in &outcome.ways {
        plan.trajectory(way, Color::of_id(*id), &id.to_string());
    }
    plan.into_image().save(figure).map_err(|e| format!("{}: {e}", figure.display()))
}
