//! Programs on a full disk, simulated by a limit on the size of each file that they write.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::SystemTime;

use image::{Rgb, RgbImage};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::chain::StepResult;
use crate::data::{office, program};
use crate::folder_files::files;
use crate::kills::readable::unreadable;

/// One of the project's programs, whose files cannot grow beyond so many bytes (`setrlimit`, `RLIMIT_FSIZE`).
pub fn limited(name: &str, bytes: u64) -> Command {
    let mut command = Command::new("bash");
    let limited = format!("trap '' XFSZ; exec prlimit --fsize={bytes} \"$0\" \"$@\"");
    command.args(["-c", &limited]).arg(program(name).get_program());
    command
}

/// A command, run in a folder with some inputs; it writes to `out` or below it.
#[derive(Debug, Clone, Copy)]
pub struct Writer {
    /// Name of the program.
    pub program: &'static str,
    /// Arguments; ROOM stands for the office's room, CAM0 and CAM1 for the options of its films.
    pub arguments: &'static [&'static str],
}

/// Commands that write.
pub const WRITERS: [Writer; 9] = [
    Writer { program: "scenes", arguments: &["plan", "ROOM", "--out", "out.png"] },
    Writer { program: "scenes", arguments: &["depth", "ROOM", "--camera", "cam0", "--out", "out.png"] },
    Writer { program: "scenes", arguments: &["export", "ROOM", "--format", "colmap", "--out", "out"] },
    Writer { program: "scenes", arguments: &["export", "ROOM", "--format", "glb", "--out", "out.glb"] },
    Writer { program: "tracker", arguments: &["link", "det.txt", "--out", "out.txt"] },
    Writer { program: "tracker", arguments: &["masks", "--video", "a=a", "--out", "out", "--outlines"] },
    Writer {
        program: "tracker",
        arguments: &["run", "ROOM", "CAM0", "CAM1", "--out", "out", "--steps", "10", "--film-width", "320"],
    },
    Writer { program: "tracker", arguments: &["events", "run", "--room", "ROOM"] },
    Writer { program: "tracker", arguments: &["report", "run", "--room", "ROOM", "--out", "out.html"] },
];

/// Outcome of one command on disks of many sizes.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Number of runs that were refused by the disk.
    pub refused: usize,
    /// Number of runs that had enough.
    pub enough: usize,
    /// Faults, with their sizes.
    pub faults: Vec<String>,
}

/// An argument with the office's paths in place of ROOM, CAM0 and CAM1.
fn of_the_office(argument: &str) -> String {
    let film =
        |camera: &str| format!("--video={camera}={}", office().join(format!("video/{camera}.mp4")).display());
    match argument {
        "ROOM" => office().join("room").display().to_string(),
        "CAM0" => film("cam0"),
        "CAM1" => film("cam1"),
        other => other.to_owned(),
    }
}

impl Writer {
    fn arguments(&self) -> Vec<String> {
        self.arguments.iter().map(|argument| of_the_office(argument)).collect()
    }

    /// Runs the command on disks of random sizes, in a folder that has its results already.
    ///
    /// # Errors
    /// A command that fails undisturbed.
    pub fn on_full_disks(&self, sizes: usize, seed: u64) -> StepResult<Outcome> {
        let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
        let folder = scratch.path();
        inputs(folder)?;
        let given = written_at(folder);
        let whole = program(self.program).args(self.arguments()).current_dir(folder).output();
        let whole = whole.map_err(|e| e.to_string())?;
        if !whole.status.success() {
            return Err(format!("{self:?}: {}", String::from_utf8_lossy(&whole.stderr)));
        }
        let expected = files(folder);
        // A command may write again what was there.
        let now = written_at(folder);
        let results = expected.iter().filter(|(name, _)| given.get(*name) != now.get(*name));
        let largest = results.map(|(_, bytes)| bytes.len()).max().unwrap_or(1) as f64;
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut outcome = Outcome::default();
        for _ in 0..sizes {
            // Evenly by the logarithm: small files fail, too.
            let bytes = (1.1 * largest).powf(random.random_range(0.0..1.0)) as u64;
            restore(folder, &expected).map_err(|e| e.to_string())?;
            let output = limited(self.program, bytes).args(self.arguments()).current_dir(folder).output();
            let output = output.map_err(|e| e.to_string())?;
            let mut faults = reported_badly(&output, &mut outcome);
            if self.arguments[0] == "run" && !output.status.success() {
                // It replaces the results of an earlier run from its first frame on.
                faults.extend(unreadable(&folder.join("out")).0);
            } else {
                faults.extend(changed(folder, &expected));
            }
            outcome.faults.extend(faults.into_iter().map(|fault| format!("{bytes} bytes: {fault}")));
        }
        Ok(outcome)
    }
}

/// Time at which each file was written.
fn written_at(folder: &Path) -> BTreeMap<PathBuf, Option<SystemTime>> {
    let time = |name: &Path| folder.join(name).metadata().and_then(|found| found.modified()).ok();
    files(folder).into_keys().map(|name| (name.clone(), time(&name))).collect()
}

/// Makes a folder hold these files again, and no others.
fn restore(folder: &Path, whole: &BTreeMap<PathBuf, Vec<u8>>) -> std::io::Result<()> {
    for name in files(folder).into_keys().filter(|name| !whole.contains_key(name)) {
        std::fs::remove_file(folder.join(name))?;
    }
    for (name, content) in whole {
        let path = folder.join(name);
        if std::fs::read(&path).ok().as_ref() != Some(content) {
            std::fs::write(path, content)?;
        }
    }
    Ok(())
}

/// Faults of the messages and the exit status of a command with little room.
fn reported_badly(output: &Output, outcome: &mut Outcome) -> Vec<String> {
    let said = String::from_utf8_lossy(&output.stderr);
    let errors = said.lines().filter(|line| line.starts_with("error: ")).count();
    match output.status.code() {
        Some(0) => outcome.enough += 1,
        Some(2) if errors == 1 => outcome.refused += 1,
        _ => return vec![format!("{} with {:?}", output.status, said.lines().last())],
    }
    Vec::new()
}

/// Files that a command with little room has left, changed or taken away; `expected` is what it writes with enough.
fn changed(folder: &Path, expected: &BTreeMap<PathBuf, Vec<u8>>) -> Vec<String> {
    let mut faults = Vec::new();
    for (name, now) in files(folder) {
        let text = name.to_string_lossy();
        match expected.get(&name) {
            None => faults.push(format!("{text} was left")),
            // Times differ.
            Some(whole) if now != *whole && !text.ends_with("timings.json") && !text.ends_with(".html") => {
                faults.push(format!("{text} is not what it was ({} of {} bytes)", now.len(), whole.len()));
            }
            Some(_) => {}
        }
    }
    let lost = expected.keys().filter(|name| !folder.join(name).exists());
    faults.extend(lost.map(|name| format!("{} is lost", name.display())));
    faults
}

/// Inputs of all commands: pictures of noise, detections, a finished run.
fn inputs(folder: &Path) -> StepResult<()> {
    let problem = |e: std::io::Error| e.to_string();
    std::fs::create_dir(folder.join("a")).map_err(problem)?;
    for frame in 1..=6u32 {
        let noise = |u: u32, v: u32| Rgb([(u * u * 31 + v * 57 + u * v * frame) as u8; 3]);
        let path = folder.join(format!("a/{frame}.png"));
        RgbImage::from_fn(320, 240, noise).save(path).map_err(|e| e.to_string())?;
    }
    let rows = (1..400).fold(String::new(), |rows, frame| rows + &format!("{frame},-1,10,10,30,60,0.9\n"));
    std::fs::write(folder.join("det.txt"), rows).map_err(problem)?;
    let run = ["run", "ROOM", "CAM0", "CAM1", "--out", "run", "--steps", "10", "--no-film"];
    let run = run.map(of_the_office);
    crate::chain::run(program("tracker").args(run).current_dir(folder)).map(drop)
}
