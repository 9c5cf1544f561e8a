//! Writes the hall of the head tracker's experiments (Y. Matsumoto, T. Kato, T. Wada, section 5; see the benchmark
//! `condensation`) as files: a room, a folder of pictures a camera, a picture of each camera without people, and the
//! truth. For `tracker run`, its films, and `tracker weightmap`.
//!
//! `cargo run --release -p tests --example hall -- DIR [round|through] [PEOPLE] [CAMERAS]`: people who go round, or who
//! enter and leave.
#![forbid(unsafe_code)]

use std::fmt::Write as _;
use std::path::Path;

use synthetic::{RenderOptions, SequenceOptions};
use tests::chain::StepResult;
use tests::data::folder_to_write;
use tests::hall::{going_round, hall, passing_through, recording};

const RATE_HZ: f64 = 12.0;

fn main() -> StepResult<()> {
    let mut given = std::env::args().skip(1);
    let folder = folder_to_write(given.next())?;
    let way = given.next().unwrap_or_else(|| "round".into());
    let mut count = |what: &str, default: usize| match given.next() {
        None => Ok(default),
        Some(text) => text.parse().map_err(|e| format!("{what} {text}: {e}")),
    };
    let (people, cameras) = (count("PEOPLE", 6)?, count("CAMERAS", 6)?);
    let (walkers, seconds) = match way.as_str() {
        "round" => (going_round(people, 2.0), 16.0),
        "through" => (passing_through(people), 60.0),
        _ => return Err(format!("{way}: `round` or `through`")),
    };
    let folder = Path::new(&folder);
    let room = hall(walkers.seed, cameras, false)?;
    room.room.write(&folder.join("room")).map_err(|e| e.to_string())?;
    let make = |path: &Path| std::fs::create_dir_all(path).map_err(|e| format!("{}: {e}", path.display()));
    let save = |image: &image::RgbImage, path: &Path| {
        image.save(path).map_err(|e| format!("{}: {e}", path.display()))
    };
    let options = SequenceOptions {
        frames: 1,
        render: RenderOptions { samples: 1, ..RenderOptions::default() },
        ..SequenceOptions::default()
    };
    let empty = room.sequence(Vec::new(), options).frame(1);
    for (camera, seen) in room.room.cameras.iter().zip(&empty.cameras) {
        make(&folder.join("video").join(&camera.name))?;
        make(&folder.join("empty").join(&camera.name))?;
        if let Some(image) = &seen.image {
            save(image, &folder.join("empty").join(&camera.name).join("0001.png"))?;
        }
    }
    let mut truth = String::new();
    for frame in recording(&room, &walkers, RATE_HZ, seconds).frames() {
        for (camera, seen) in room.room.cameras.iter().zip(&frame.cameras) {
            if let Some(image) = &seen.image {
                let name = format!("{:04}.png", frame.frame);
                save(image, &folder.join("video").join(&camera.name).join(name))?;
            }
        }
        for person in frame.people.iter().filter(|p| p.inside) {
            let head = &person.head;
            let _ = writeln!(
                truth,
                "{},{},-1,-1,-1,-1,1,{:.4},{:.4},{:.4}",
                frame.frame, person.id, head.x, head.y, head.z
            );
        }
    }
    let path = folder.join("truth.txt");
    std::fs::write(&path, truth).map_err(|e| format!("{}: {e}", path.display()))
}
