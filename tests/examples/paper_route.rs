//! The accuracy experiment of the room tracker's paper (seed 001, section 4.3, figure 10) on the office: somebody alone on
//! a known route, past large occluders; distances from the true way, which the paper did not know by time, and its
//! figure drawn.
//!
//! `cargo build --release --bins && cargo run --release -p tests --example paper_route -- FIGURES-DIR`

use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Instant;

use nalgebra::Point2;
use scenes::canvas::Color;
use scenes::plan::{FloorPlan, PlanOptions};
use scenes::room::Room;
use tests::accuracy;
use tests::chain::{Said, track};
use tests::data::office;

/// Person 1 is alone: in from the door, and along a rectangle.
const FRAMES: RangeInclusive<u32> = 45..=170;
/// The frames of the true way that count as the route: what is estimated early or late still lies beside it.
const ROUTE_FRAMES: RangeInclusive<u32> = 35..=173;
/// Frames of the videos.
const RECORDED: f64 = 300.0;

fn main() -> Said<()> {
    let figures = std::env::args().nth(1).ok_or("FIGURES-DIR")?;
    let (office, figures) = (office(), Path::new(&figures));
    std::fs::create_dir_all(figures).map_err(|e| format!("{}: {e}", figures.display()))?;
    println!("{:<34} {:>7} {:>9} {:>9} {:>9}", "", "places", "mean cm", "max. cm", "frames/s");
    println!("{:<34} {:>7} {:>9.2} {:>9.2} {:>9}", "paper (its own room)", "", 4.86, 29.43, 5);
    let way = places(&office.join("truth.txt"), &ROUTE_FRAMES)?;
    let line = |what: &str, places: &[Point2<f64>], rate: &str| -> Said<()> {
        let found = accuracy::route(places, &way).ok_or(format!("{what}: nobody in these frames"))?;
        let (mean, maximum) = (100.0 * found.mean_m, 100.0 * found.maximum_m);
        println!("{what:<34} {:>7} {mean:>9.2} {maximum:>9.2} {rate:>9}", found.places);
        Ok(())
    };
    let room_dir = office.join("room");
    let room = Room::read(&room_dir).map_err(|e| e.to_string())?;
    for (name, options) in
        [("default", &[][..]), ("published", &["--published"]), ("blind", &["--no-occlusion"])]
    {
        let out = figures.join(name);
        let started = Instant::now();
        track(&office, &room_dir, &out, options)?;
        let rate = format!("{:.1}", RECORDED / started.elapsed().as_secs_f64());
        let found = places(&out.join("tracks.txt"), &FRAMES)?;
        line(&format!("office: {name}"), &found, &rate)?;
        let plan_options = PlanOptions {
            title: Some(format!("Route (black) and estimated track ({name}), frames 45 to 170")),
            ..PlanOptions::default()
        };
        let mut plan = FloorPlan::new(&room, &plan_options).map_err(|e| e.to_string())?;
        plan.trajectory(&way, Color::INK, "");
        plan.trajectory(&found, Color::of_id(1), "1");
        let figure = figures.join(format!("route_{name}.png"));
        plan.into_image().save(&figure).map_err(|e| format!("{}: {e}", figure.display()))?;
    }
    Ok(())
}

/// Where anybody is in some frames.
fn places(rows: &Path, frames: &RangeInclusive<u32>) -> Said<Vec<Point2<f64>>> {
    let rows = tracker::tracks::rows::RowFile::read(rows).map_err(|e| e.to_string())?;
    Ok(rows.rows.iter().filter(|r| frames.contains(&r.frame)).filter_map(|r| r.position).collect())
}
