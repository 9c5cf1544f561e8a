//! Prints the errors of a built room: relative camera poses, floor, depth, metres.
//!
//! `cargo run --release -p tests --example room_error -- ROOM-DIR TRUTH-DIR`
//!
//! The truth is a room with `depth_NAME.png` beside its `scene.toml`, as in `tests/office/room`, or a folder with those
//! and `truth.json`. A room's frame is arbitrary: relative poses, heights and depths are compared, never coordinates.

use std::path::Path;

use tests::chain::{StepResult, compare_rooms};

fn main() -> StepResult<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [built, truth] = arguments.as_slice() else { return Err("ROOM-DIR TRUTH-DIR".into()) };
    let errors = compare_rooms(Path::new(built), Path::new(truth), 50)?;
    let relative = errors.relative;
    println!(
        "second camera seen from the first: {:.2} cm, {:.3}°",
        relative.position_cm, relative.rotation_deg
    );
    let each = errors.cameras.iter().zip(&errors.depth).zip(&errors.lengths);
    for (((name, camera), (_, depth)), (_, lengths)) in each {
        println!(
            "{name}: tilt {:.3}°, height {:+.2} cm off; depth within 5 cm {:.1} %, covered {:.1} %; {} lengths {:+.2} % \
             off in the median, nine in ten within {:.2} %",
            camera.tilt_deg,
            camera.height_cm,
            100.0 * depth.within,
            100.0 * depth.covered,
            lengths.count,
            100.0 * (lengths.median - 1.0),
            100.0 * lengths.ninety_off
        );
    }
    Ok(())
}
