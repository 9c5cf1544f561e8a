//! Check that a run was made in a room: the run's boxes must be its people projected by the room's cameras.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use mot::jsonl::FrameLine;
use mot::rows::{PixelBox, RowFile};
use scenes::room::Room;

use crate::silhouette::{Body, contour};
use crate::{Error, Result};

/// Largest difference of a box's edges, pixels: boxes are written from more decimals than the people's positions.
const TOLERANCE_PX: f64 = 2.0;
/// Largest number of compared boxes for each camera.
const LOOKED_AT: usize = 200;

/// Largest number of frames whose boxes are read, for each camera.
const READ_FRAMES: usize = 5000;

/// Checks that the cameras of a room are those of a run: those that any of its frames names, by the boxes of some frames.
///
/// # Errors
/// Names the room, the camera that is missing or has another pose, and a frame that shows it.
pub(super) fn check(
    run: &Path,
    (named, frames): (&BTreeSet<String>, &[FrameLine]),
    room: &Room,
    room_dir: &Path,
) -> Result<()> {
    let give = format!("give the room that {} was made in", run.display());
    let frames: Vec<&FrameLine> = frames.iter().step_by(frames.len().div_ceil(READ_FRAMES).max(1)).collect();
    let numbers: HashSet<u32> = frames.iter().map(|frame| frame.frame).collect();
    for name in named {
        let place = format!("camera `{name}`");
        let Ok(camera) = room.camera(name) else {
            return Err(Error::content(
                room_dir,
                place,
                format!("took part in the run but is not here; {give}"),
            ));
        };
        let file = run.join("boxes").join(format!("{name}.txt"));
        if !file.exists() {
            continue;
        }
        let written: HashMap<(u32, u32), PixelBox> = rows_of(&file, &numbers)?
            .rows
            .iter()
            .filter_map(|row| Some(((row.frame, row.id?), row.pixel_box?)))
            .collect();
        let people = frames.iter().flat_map(|f| f.people.iter().map(move |p| (f.frame, p)));
        let pairs: Vec<_> = people
            .filter_map(|(frame, p)| {
                let body = Body { x_m: p.x, y_m: p.y, radius_m: p.radius, height_m: p.height };
                let here = contour::bounding_box(&body, &camera.camera);
                let there = written.get(&(frame, p.id.0));
                (here.is_some() || there.is_some()).then_some((frame, p.id, here, there))
            })
            .collect();
        let looked_at: Vec<_> = pairs.iter().step_by(pairs.len().div_ceil(LOOKED_AT).max(1)).collect();
        let differs = looked_at.iter().filter(|(.., here, there)| match (here, there) {
            (Some(here), Some(there)) => !is_same(here, there),
            _ => true,
        });
        let differing: Vec<_> = differs.collect();
        // A person at the image's border may be inside here and outside there.
        if let Some((frame, id, ..)) = differing.first()
            && 10 * differing.len() > looked_at.len()
        {
            let problem = format!(
                "stands elsewhere than in the run: in frame {frame} person {id} is not where boxes/{name}.txt has \
                 them; {give}"
            );
            return Err(Error::content(room_dir, place, problem));
        }
    }
    Ok(())
}

/// Rows of these frames of a file, which need not fit into memory.
fn rows_of(path: &Path, frames: &HashSet<u32>) -> Result<RowFile> {
    let reader = BufReader::new(File::open(path).map_err(Error::io(path))?);
    let mut text = String::new();
    for line in reader.lines() {
        let line = line.map_err(Error::io(path))?;
        let frame = line.split(',').next().and_then(|frame| frame.trim().parse::<u32>().ok());
        if frame.is_none_or(|frame| frames.contains(&frame)) {
            text.push_str(&line);
        }
        // A line that is left out stays as an empty one, so that messages count as the file does.
        text.push('\n');
    }
    Ok(RowFile::parse(path, &text)?)
}

fn is_same(a: &PixelBox, b: &PixelBox) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= TOLERANCE_PX;
    near(a.left, b.left) && near(a.top, b.top) && near(a.width, b.width) && near(a.height, b.height)
}
