//! `recon relocate` on pictures of bumped cameras: errors against the truth, and what is refused.
//!
//! `cargo bench -p tests --bench relocate [-- SET=ROOM …]`; a room that was built before saves its minutes.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};

use calib::Intrinsics;
use recon::relocation;
use scenes::room::Room;
use tests::chain::{StepResult, build_room};
use tests::data;
use tests::relocation::{BumpedView, bumped_views, rendered_views};

/// Views a data set, and the seed they are drawn with.
const VIEWS: usize = 40;
const SEED: u64 = 1000;

/// Views of one camera of a data set.
type Views = fn(&Path, &str, &Intrinsics, usize, u64) -> Result<Vec<BumpedView>, String>;

fn main() -> StepResult<()> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    // The headset's frames were taken while it turned, by a rolling shutter: a fixed camera's pictures are not.
    let sets: [(&str, Option<PathBuf>, Views); 2] = [
        ("office", Some(data::office()), bumped_views),
        ("hololens", data::shared("hololens"), rendered_views),
    ];
    for (name, folder, views) in sets {
        let Some(folder) = folder else { continue };
        let given =
            std::env::args().find_map(|a| Some(PathBuf::from(a.strip_prefix(name)?.strip_prefix('=')?)));
        let room = if let Some(room) = given {
            room
        } else {
            let built = scratch.path().join(name);
            build_room(&folder, &built)?;
            built
        };
        measure(name, &folder, &room, views, scratch.path())?;
    }
    Ok(())
}

fn measure(name: &str, data: &Path, room_dir: &Path, views: Views, scratch: &Path) -> StepResult<()> {
    let room = Room::read(room_dir).map_err(|e| e.to_string())?;
    let (mut good, mut refused, mut worst) = (0, 0, (0.0_f64, 0.0_f64));
    let (mut squared_m, mut squared_deg) = (0.0, 0.0);
    for camera in &room.cameras {
        let views = views(data, &camera.name, &camera.camera.intrinsics, VIEWS / room.cameras.len(), SEED)?;
        for view in views {
            let file = scratch.join("now.png");
            view.picture.save(&file).map_err(|e| e.to_string())?;
            match relocation::relocate(room_dir, &room, &camera.name, &file.to_string_lossy()) {
                Ok(now) => {
                    let pose = now.found.camera_from_world * camera.camera.camera_from_world.inverse();
                    let error = view.now_from_installed * pose.inverse();
                    let moved = (view.now_from_installed.inverse().translation.vector
                        - pose.inverse().translation.vector)
                        .norm();
                    let turned = error.rotation.angle().to_degrees();
                    if std::env::args().any(|a| a == "each") {
                        println!(
                            "  {} true {:.1} cm {:.1}°: off {:.2} cm ± {:.2}, {:.3}° ± {:.3}, {} of {} {:.2} px",
                            camera.name,
                            100.0 * view.now_from_installed.inverse().translation.vector.norm(),
                            view.now_from_installed.rotation.angle().to_degrees(),
                            100.0 * moved,
                            100.0 * now.found.sigma_m,
                            turned,
                            now.found.sigma_deg,
                            now.found.agreeing,
                            now.found.matches,
                            now.found.rms_px
                        );
                    }
                    good += usize::from(moved <= 0.03 && turned <= 0.3);
                    worst = (worst.0.max(moved), worst.1.max(turned));
                    squared_m += (moved / now.found.sigma_m).powi(2);
                    squared_deg += (turned / now.found.sigma_deg).powi(2);
                }
                Err(why) => {
                    refused += 1;
                    println!("  {}: refused: {why}", camera.name);
                }
            }
        }
    }
    let told = (VIEWS - refused).max(1) as f64;
    println!(
        "{name}: {good} of {VIEWS} within 3 cm and 0.3° (>= 38), {refused} refused; worst {:.1} cm, {:.2}°; errors over their \
         standard deviations {:.2} and {:.2} rms (1 where honest)",
        100.0 * worst.0,
        worst.1,
        (squared_m / told).sqrt(),
        (squared_deg / told).sqrt()
    );
    Ok(())
}
