//! The accuracy experiment of T. Osawa et al., "MCMC based Multiple People Tracking using 3D Environmental Information"
//! (paper LI-007), section 4.3, figure 10, on the office: a single person on a known route, past large occluders;
//! distances from the true way, whose times the paper did not know, and its figure drawn.
//!
//! `cargo build --release --bins && cargo run --release -p tests --example paper_route -- FIGURES-DIR`

use std::path::Path;
use std::time::Instant;

use scenes::plan::{FloorPlan, PlanOptions};
use scenes::room::Room;
use shell::canvas::Color;
use tests::accuracy::{ALONE, ROUTE, office_route, places};
use tests::chain::{StepResult, track};
use tests::data::{folder_to_write, office};

/// Frames of the videos.
const RECORDED: f64 = 300.0;

fn main() -> StepResult<()> {
    let figures = folder_to_write(std::env::args().nth(1))?;
    let (office, figures) = (office(), Path::new(&figures));
    std::fs::create_dir_all(figures).map_err(|e| format!("{}: {e}", figures.display()))?;
    println!("{:<34} {:>7} {:>9} {:>9} {:>9}", "", "places", "mean cm", "max. cm", "frames/s");
    println!("{:<34} {:>7} {:>9.2} {:>9.2} {:>9}", "paper (its own room)", "", 4.86, 29.43, 5);
    let way = places(&office.join("truth.txt"), &ROUTE)?;
    let room_dir = office.join("room");
    let room = Room::read(&room_dir).map_err(|e| e.to_string())?;
    for (name, options) in [
        ("default", &[][..]),
        ("published", &["--published", "--overlap-power", "100"]),
        ("blind", &["--no-occlusion"]),
    ] {
        let out = figures.join(name);
        let started = Instant::now();
        track(&office, &room_dir, &out, options)?;
        let rate = RECORDED / started.elapsed().as_secs_f64();
        let tracks = out.join("tracks.txt");
        let found = office_route(&office, &tracks)?;
        let (mean, maximum) = (100.0 * found.mean_m, 100.0 * found.maximum_m);
        println!(
            "{:<34} {:>7} {mean:>9.2} {maximum:>9.2} {rate:>9.1}",
            format!("office: {name}"),
            found.places
        );
        let plan_options = PlanOptions {
            title: Some(format!("Route (black) and estimated track ({name}), frames 45 to 170")),
            ..PlanOptions::default()
        };
        let mut plan = FloorPlan::new(&room, &plan_options).map_err(|e| e.to_string())?;
        plan.trajectory(&way, Color::INK, "");
        plan.trajectory(&places(&tracks, &ALONE)?, Color::of_id(1), "1");
        let figure = figures.join(format!("route_{name}.png"));
        plan.into_image().save(&figure).map_err(|e| format!("{}: {e}", figure.display()))?;
    }
    Ok(())
}
