//! Readers of files and packets that come from outside, with something good for each to read: what the test of damaged files and the
//! fuzzer start from.
//!
//! Left out are films (FFmpeg's), sites of `serve` and lists of frames.

mod samples;

use std::path::{Path, PathBuf};

use mot::{jsonl, rows::RowFile};
use recon::pipeline::BuildOptions;
use recon::project::Project;
use scenes::exchange::{self, ModelOptions, alignment, colmap};
use scenes::geometry::scan::Placing;
use shell::plain_text;
use tracker::events::stats::DayStats;
use tracker::source::{DetectorBoxes, FrameAssembler, Times, next_line};
use tracker::tracks::Timings;
use tracker::wire::encoding::{Limits, Message};
use tracker::wire::packet;

/// A reader of one kind of file or packet.
pub struct Reader {
    /// Name of the file, in a folder of its own where others belong to it.
    pub name: &'static str,
    /// Good content.
    pub content: Vec<u8>,
    /// Files that are read with it, by name.
    beside: Vec<(&'static str, Vec<u8>)>,
    read: fn(&Path) -> Result<(), String>,
}

impl Reader {
    /// Writes the files that are read with this one below a folder.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn prepare(&self, folder: &Path) -> std::io::Result<PathBuf> {
        let path = folder.join(self.name);
        let own = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(own)?;
        self.beside.iter().try_for_each(|(name, content)| std::fs::write(own.join(name), content))?;
        Ok(path)
    }

    /// Reads a file at the path that [`Self::prepare`] gave.
    ///
    /// # Errors
    /// The reader's error, as programs print it.
    ///
    /// # Panics
    /// If the reader does, or if its error has several lines or cannot be printed.
    pub fn read(&self, path: &Path) -> Result<(), String> {
        (self.read)(path).map_err(|error| {
            assert!(!error.trim_end().contains('\n'), "{}: {error:?}", self.name);
            let line = plain_text::one_line(&error);
            let is_plain = !line.is_empty() && !line.chars().any(char::is_control);
            assert!(is_plain && line.chars().count() <= plain_text::LONGEST_LINE, "{}: {line:?}", self.name);
            line
        })
    }
}

/// The readers.
///
/// # Errors
/// The reason why a good file could not be written.
pub fn readers() -> Result<Vec<Reader>, String> {
    let text = |text: &str| text.as_bytes().to_vec();
    let reader = |name, content, read| Reader { name, content, beside: Vec::new(), read };
    let reader_beside = |name, content, beside, read| Reader { name, content, beside, read };
    let colmap_text = || {
        vec![
            ("cameras.txt", text(samples::COLMAP_CAMERAS)),
            ("images.txt", text(samples::COLMAP_IMAGES)),
            ("points3D.txt", text(samples::COLMAP_POINTS)),
            ("rigs.txt", text(samples::COLMAP_RIGS)),
            ("frames.txt", text(samples::COLMAP_FRAMES)),
        ]
    };
    let colmap_binary = || {
        vec![
            ("cameras.bin", samples::colmap_cameras()),
            ("images.bin", samples::colmap_images()),
            ("points3D.bin", samples::colmap_points()),
            ("rigs.bin", samples::colmap_rigs()),
            ("frames.bin", samples::colmap_frames()),
        ]
    };
    let run = || {
        vec![
            ("events.jsonl", text(samples::EVENTS)),
            ("counts.csv", text(samples::COUNTS)),
            ("groups.csv", text(samples::GROUPS)),
        ]
    };
    let project = vec![("film.mp4", Vec::new()), ("lens.toml", text(samples::LENS))];
    Ok(vec![
        reader("rows.txt", text(samples::ROWS), |p| outcome(RowFile::read(p))),
        reader("boxes.txt", text("1,-1,20,10,8,20,1\n6,-1,21,10,8,20,1\n"), |p| {
            outcome(DetectorBoxes::read(p))
        }),
        reader("times.txt", text("0\n0.04\n0.08\n0.5\n"), |p| outcome(Times::read(p))),
        reader("tracks.jsonl", text(samples::TRACKS), |p| outcome(jsonl::read(p))),
        reader("room/scene.toml", text(samples::ROOM), |p| outcome(scenes::room::Room::read(folder(p)))),
        reader("zones.toml", text(samples::ROOM), |p| outcome(scenes::room::read_markings(p))),
        reader("text.ply", text(samples::PLY), |p| outcome(scenes::geometry::ply::read(p))),
        reader("binary.ply", samples::binary_ply(), |p| outcome(scenes::geometry::ply::read(p))),
        reader("room.obj", text(samples::OBJ), geometry),
        reader("room.glb", samples::glb()?, geometry),
        reader("room.las", samples::las()?, geometry),
        reader("transforms.json", text(samples::NERFSTUDIO), |p| {
            outcome(exchange::model(p, &ModelOptions::default()))
        }),
        reader_beside("colmap_a/cameras.txt", text(samples::COLMAP_CAMERAS), colmap_text(), colmap_model),
        reader_beside("colmap_b/images.txt", text(samples::COLMAP_IMAGES), colmap_text(), colmap_model),
        reader_beside("colmap_c/points3D.txt", text(samples::COLMAP_POINTS), colmap_text(), colmap_model),
        reader_beside("colmap_d/cameras.bin", samples::colmap_cameras(), colmap_binary(), colmap_model),
        reader_beside("colmap_e/images.bin", samples::colmap_images(), colmap_binary(), colmap_model),
        reader_beside("colmap_f/points3D.bin", samples::colmap_points(), colmap_binary(), colmap_model),
        reader_beside("colmap_g/rigs.txt", text(samples::COLMAP_RIGS), colmap_text(), colmap_model),
        reader_beside("colmap_h/frames.txt", text(samples::COLMAP_FRAMES), colmap_text(), colmap_model),
        reader_beside("colmap_i/rigs.bin", samples::colmap_rigs(), colmap_binary(), colmap_model),
        reader_beside("colmap_j/frames.bin", samples::colmap_frames(), colmap_binary(), colmap_model),
        reader("lens.toml", text(samples::LENS), |p| outcome(calib::files::read_intrinsics(p))),
        reader("options.toml", text(samples::OPTIONS), |p| outcome(BuildOptions::read(p))),
        reader_beside("project/room.toml", text(samples::PROJECT), project, |p| outcome(Project::read(p))),
        reader("points.csv", text(samples::KNOWN_POINTS), |p| outcome(alignment::read_points(p))),
        reader("picture.png", samples::picture()?, |p| outcome(calib::picture::read(p))),
        reader("depth.png", samples::depth()?, |p| outcome(scenes::depth::png::read(p))),
        reader_beside("run_a/events.jsonl", text(samples::EVENTS), run(), statistics),
        reader_beside("run_b/counts.csv", text(samples::COUNTS), run(), statistics),
        reader_beside("run_c/groups.csv", text(samples::GROUPS), run(), statistics),
        reader("timings.json", text(samples::TIMINGS), |p| outcome(Timings::read(p))),
        reader("boxes.jsonl", text(samples::LIVE_BOXES), live_boxes),
        reader("packet", samples::station_packet()?, |p| outcome(packet::decode(&bytes(p)?))),
        reader("message", samples::station_message()?, message),
        reader("observation", samples::station_observation()?, message),
    ])
}

fn outcome<T, E: std::fmt::Display>(read: Result<T, E>) -> Result<(), String> {
    read.map(drop).map_err(|e| e.to_string())
}

fn folder(file: &Path) -> &Path {
    file.parent().unwrap_or(file)
}

fn bytes(file: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(file).map_err(|e| e.to_string())
}

fn geometry(file: &Path) -> Result<(), String> {
    outcome(scenes::geometry::files::read(file, &Placing::default()))
}

fn colmap_model(file: &Path) -> Result<(), String> {
    outcome(exchange::model(folder(file), &ModelOptions::default()))?;
    outcome(colmap::geometry(folder(file), &Placing::default()))
}

fn message(file: &Path) -> Result<(), String> {
    outcome(Message::decode(&bytes(file)?, Limits { width: 64, height: 48 }))
}

/// Statistics of a run's events, and what is told of them.
fn statistics(file: &Path) -> Result<(), String> {
    let stats = DayStats::read(folder(file)).map_err(|e| e.to_string())?;
    let told = stats.text() + &stats.csv();
    // At least the beginning and the end, and the columns' names.
    assert!(told.lines().count() > 2, "{told}");
    Ok(())
}

/// Rows of a live detector.
fn live_boxes(file: &Path) -> Result<(), String> {
    let content = bytes(file)?;
    let mut left = content.as_slice();
    let mut frames = FrameAssembler::default();
    while let Some(line) = next_line(&mut left).map_err(|e| e.to_string())? {
        frames.take(&line, 0.0)?;
    }
    Ok(())
}
