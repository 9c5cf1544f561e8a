//! Files of a killed run: whether every one of them can be read.

use std::path::Path;

use calib::video::FrameSource;
use image::RgbImage;
use mot::jsonl;
use mot::rows::RowFile;

use crate::chain::StepResult;
use crate::folder_files::files;
use crate::live::office::RATE_HZ;

/// Files of a run that cannot be read, and the most seconds by which a film in the making is behind the rows.
pub(crate) fn unreadable(out: &Path) -> (Vec<String>, f64) {
    let (mut faults, mut lost_s) = (Vec::new(), 0.0_f64);
    for (name, content) in files(out) {
        let path = out.join(&name);
        let text = String::from_utf8_lossy(&content);
        let is_json = |line: &str| serde_json::from_str::<serde_json::Value>(line).is_ok();
        let has_whole_lines = content.is_empty() || text.ends_with('\n');
        let shown = name.to_string_lossy().into_owned();
        // A file of an earlier run, or one that is being written under another name.
        let is_hidden = name.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if is_hidden || shown.contains(".writing") {
            continue;
        }
        let problem = match name.extension().and_then(|end| end.to_str()) {
            Some("jsonl" | "txt" | "csv") if !has_whole_lines => Some("ends in a line".to_owned()),
            Some("jsonl") if name.ends_with("tracks.jsonl") => {
                jsonl::read(&path).err().map(|error| error.to_string())
            }
            Some("jsonl") => text.lines().find(|line| !is_json(line)).map(str::to_owned),
            Some("txt") if content.is_empty() => None,
            Some("txt") => RowFile::read(&path).err().map(|error| error.to_string()),
            Some("json") => (!is_json(&text)).then(|| "is no JSON".to_owned()),
            Some("png") => image::open(&path).err().map(|error| error.to_string()),
            Some("mp4") if shown.contains(".remuxed.") => None,
            Some("mp4") => match (frames_of(&path), shown.contains(".partial.")) {
                (frames, true) => {
                    let run = name.parent().and_then(Path::parent).unwrap_or(Path::new(""));
                    let rows = out.join(run).join("tracks.jsonl");
                    if !is_older(&rows, &path) {
                        let rows = std::fs::read_to_string(rows).unwrap_or_default();
                        let behind = rows.lines().count() as f64 - frames.unwrap_or(0) as f64;
                        lost_s = lost_s.max(behind / RATE_HZ);
                    }
                    None
                }
                (Err(error), false) => Some(error),
                (Ok(_), false) => None,
            },
            _ => None,
        };
        faults.extend(problem.map(|problem| format!("{shown}: {problem}")));
    }
    (faults, lost_s)
}

/// Tells whether rows are of an earlier run than a film: last written before the film was begun. A run begins its films first.
fn is_older(rows: &Path, film: &Path) -> bool {
    let written = rows.metadata().and_then(|rows| rows.modified());
    let begun = film.metadata().and_then(|film| film.created());
    matches!((written, begun), (Ok(written), Ok(begun)) if written < begun)
}

/// Number of frames that can be read of a film.
fn frames_of(film: &Path) -> StepResult<usize> {
    let mut source =
        FrameSource::open(film.to_str().ok_or("a path without UTF-8")?).map_err(|e| e.to_string())?;
    let mut picture = RgbImage::default();
    while source.read(&mut picture).is_ok_and(|is_there| is_there) {}
    Ok(source.delivered())
}
