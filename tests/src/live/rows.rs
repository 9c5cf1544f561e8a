//! Reader of `tracks.jsonl`, line by line, with the time at which each line was found on disk.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use nalgebra::Point2;

use crate::chain::StepResult;

/// Polling interval of the file, which is the error of the times.
const POLL: Duration = Duration::from_millis(2);

/// One line of `tracks.jsonl`.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveRow {
    /// Number of the frame, from 1.
    pub frame: u32,
    /// Time of the moment, seconds.
    pub time_s: f64,
    /// Ids and positions on the floor, metres.
    pub people: Vec<(u32, Point2<f64>)>,
    /// Time at which the line was found on disk.
    pub found: Instant,
}

impl LiveRow {
    fn parse(line: &str, found: Instant) -> Option<Self> {
        let json: serde_json::Value = serde_json::from_str(line).ok()?;
        let person = |person: &serde_json::Value| {
            let place = Point2::new(person["x"].as_f64()?, person["y"].as_f64()?);
            Some((person["id"].as_u64()? as u32, place))
        };
        Some(Self {
            frame: json["frame"].as_u64()? as u32,
            time_s: json["time"].as_f64()?,
            people: json["people"].as_array()?.iter().map(person).collect::<Option<_>>()?,
            found,
        })
    }
}

/// The rows of a finished run.
///
/// # Errors
/// A file that cannot be read, or a line that is not a row.
pub fn read(path: &Path) -> StepResult<Vec<LiveRow>> {
    let (text, found) = (std::fs::read_to_string(path), Instant::now());
    let text = text.map_err(|e| format!("{}: {e}", path.display()))?;
    let row = |line: &str| LiveRow::parse(line, found).ok_or_else(|| format!("{}: {line}", path.display()));
    text.lines().map(row).collect()
}

/// Watcher that follows the file while it grows, until it is dropped.
#[derive(Debug)]
pub struct RowWatch {
    rows: Arc<Mutex<Vec<LiveRow>>>,
    has_ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl RowWatch {
    /// Starts to follow a file, which need not exist yet.
    pub fn start(path: PathBuf) -> Self {
        let (rows, has_ended) = (Arc::<Mutex<Vec<LiveRow>>>::default(), Arc::<AtomicBool>::default());
        let (found, end) = (Arc::clone(&rows), Arc::clone(&has_ended));
        let thread = thread::spawn(move || {
            let (mut at, mut partial) = (0, String::new());
            while !end.load(Ordering::Relaxed) {
                let new = new_text(&path, &mut at);
                let now = Instant::now();
                partial.push_str(&new);
                while let Some(end) = partial.find('\n') {
                    let line: String = partial.drain(..=end).collect();
                    let row = LiveRow::parse(line.trim_end(), now);
                    found.lock().unwrap_or_else(PoisonError::into_inner).extend(row);
                }
                thread::sleep(POLL);
            }
        });
        Self { rows, has_ended, thread: Some(thread) }
    }

    /// The rows so far.
    pub fn rows(&self) -> Vec<LiveRow> {
        self.rows.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for RowWatch {
    fn drop(&mut self) {
        self.has_ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has printed why.
            let _ = thread.join();
        }
    }
}

/// Text appended since the last call; empty where the file cannot be read yet.
fn new_text(path: &Path, at: &mut u64) -> String {
    let mut read = || -> std::io::Result<String> {
        if std::fs::metadata(path)?.len() <= *at {
            return Ok(String::new());
        }
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(*at))?;
        let mut text = String::new();
        *at += file.read_to_string(&mut text)? as u64;
        Ok(text)
    };
    read().unwrap_or_default()
}
