//! Kills of `tracker serve`: of the supervisor and of a room's worker in turn.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use super::readable::unreadable;
use super::{Moments, Outcome, place_of, quiet};
use crate::chain::StepResult;
use crate::data::{office, program};
use crate::folder_files::files;

/// Longest time from one kill to the next.
const LONGEST: Duration = Duration::from_secs(9);
/// Longest wait for a process to end, or to write.
const PATIENCE: Duration = Duration::from_mins(1);
const POLL: Duration = Duration::from_millis(50);
/// Name of the heat map: seconds that people spent on each cell of the floor, …
const HEAT_MAP: &str = "heat.csv";
/// … and what rounding may take from a cell, seconds.
const ROUNDING_S: f64 = 0.006;

/// Kills a service of one room, which films, again and again; at the end it is asked to end.
///
/// # Errors
/// A service that cannot be started.
pub fn serve(kills: usize, seed: u64) -> StepResult<Outcome> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let folder = scratch.path();
    let [room, cam0, cam1] = ["room", "video/cam0.mp4", "video/cam1.mp4"].map(|path| office().join(path));
    let site = format!(
        "out = \"out\"\n[run]\nsteps = 20\nfilm-width = 480\nevents = \"on\"\n[[room]]\nname = \"hall\"\npath = \"{}\"\n\
         cameras = {{ cam0 = \"{}\", cam1 = \"{}\" }}\n",
        room.display(),
        cam0.display(),
        cam1.display()
    );
    std::fs::write(folder.join("site.toml"), site).map_err(|e| e.to_string())?;
    let service = || quiet(program("tracker").args(["serve", "site.toml"]).current_dir(folder));
    let mut moments = Moments::new(seed, LONGEST);
    let mut outcome = Outcome::default();
    let mut before = Vec::new();
    let mut child = service()?;
    for kill in 0..kills {
        let after = moments.draw();
        std::thread::sleep(after);
        let worker = worker_of(child.id());
        let is_of_worker = kill % 2 == 1 && worker.is_some();
        if let Some(worker) = worker.filter(|_| is_of_worker) {
            signal("KILL", worker)?;
        } else {
            child.kill().and_then(|()| child.wait()).map_err(|e| e.to_string())?;
            // Its worker ends with it.
            outcome.add(&place_of(kill, after), worker.and_then(still_there));
            child = service()?;
        }
        outcome.killed += 1;
        let place = place_of(kill, after);
        let out = folder.join("out");
        // A line that is written at this very moment is looked at again.
        let mut faults = unreadable(&out).0;
        if !faults.is_empty() {
            std::thread::sleep(Duration::from_secs(1));
            let still = unreadable(&out).0;
            faults.retain(|fault| still.contains(fault));
        }
        outcome.add(&place, faults);
        outcome.add(&place, shortened(&out, &mut before));
    }
    wait_for_rows(&folder.join("out"), &before);
    signal("TERM", child.id())?;
    outcome.add("at the end", ended(&mut child));
    let left = files(&folder.join("out")).into_keys().filter(|name| {
        let name = name.to_string_lossy();
        ["partial", "remuxed", ".writing", "/."].iter().any(|part| name.contains(part))
    });
    outcome.add("at the end", left.map(|name| format!("{} was left", name.display())));
    outcome.add("at the end", unreadable(&folder.join("out")).0);
    Ok(outcome)
}

/// Id of the process's only child.
fn worker_of(supervisor: u32) -> Option<u32> {
    let path = format!("/proc/{supervisor}/task/{supervisor}/children");
    std::fs::read_to_string(path).ok()?.split_whitespace().next()?.parse().ok()
}

fn signal(name: &str, process: u32) -> StepResult<()> {
    let sent = Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status();
    sent.map(drop).map_err(|e| format!("kill: {e}"))
}

/// A process that does not end by itself.
fn still_there(process: u32) -> Option<String> {
    let until = Instant::now() + PATIENCE;
    // An ended process whose parent is dead may wait for a while to be collected.
    let is_there = || {
        let state = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        state.rsplit(')').next().is_some_and(|rest| !rest.is_empty() && !rest.trim_start().starts_with('Z'))
    };
    while is_there() {
        if Instant::now() > until {
            return Some(format!("worker {process} outlives its supervisor"));
        }
        std::thread::sleep(POLL);
    }
    None
}

/// Files that have lost lines or seconds since the last look, which `before` holds.
fn shortened(out: &Path, before: &mut Vec<(PathBuf, Vec<u8>)>) -> Vec<String> {
    let is_of_lines = |name: &Path| name.extension().is_some_and(|end| end == "jsonl" || end == "csv");
    let now: Vec<_> = files(out).into_iter().filter(|(name, _)| is_of_lines(name)).collect();
    let lost = before.iter().filter(|(name, old)| {
        let Some((_, new)) = now.iter().find(|(other, _)| other == name) else { return true };
        if name.ends_with(HEAT_MAP) { has_lost_seconds(old, new) } else { has_lost_lines(old, new) }
    });
    let lost = lost.map(|(name, _)| format!("{} has lost lines", name.display())).collect();
    *before = now;
    lost
}

/// Whether a file that only grows at its end does not begin with the whole lines that it had.
fn has_lost_lines(old: &[u8], new: &[u8]) -> bool {
    let whole = old.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    !new.starts_with(&old[..whole])
}

/// Whether a cell of a heat map has fewer seconds than it had. The file is replaced as a whole, with its cells in the order of
/// the floor, so that new cells stand between old ones.
fn has_lost_seconds(old: &[u8], new: &[u8]) -> bool {
    let cells = |bytes: &[u8]| -> HashMap<String, f64> {
        let text = String::from_utf8_lossy(bytes).into_owned();
        let cell = |row: &str| {
            let (cell, seconds) = row.rsplit_once(',')?;
            Some((cell.to_owned(), seconds.parse().ok()?))
        };
        text.lines().skip(1).filter_map(cell).collect()
    };
    let new = cells(new);
    cells(old).iter().any(|(cell, seconds)| new.get(cell).is_none_or(|now| *now < seconds - ROUNDING_S))
}

/// Waits until the service writes again.
fn wait_for_rows(out: &Path, before: &[(PathBuf, Vec<u8>)]) {
    let length = |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(_, bytes)| bytes.len()).sum::<usize>();
    let until = Instant::now() + PATIENCE;
    while Instant::now() < until {
        let now: Vec<_> = files(out).into_iter().filter(|(name, _)| name.ends_with("tracks.jsonl")).collect();
        let old: Vec<_> = before.iter().filter(|(name, _)| name.ends_with("tracks.jsonl")).cloned().collect();
        if length(&now) > length(&old) {
            return;
        }
        std::thread::sleep(POLL);
    }
}

/// Fault of a service that does not end as it was asked to.
fn ended(child: &mut Child) -> Option<String> {
    let until = Instant::now() + PATIENCE;
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return None,
            Ok(Some(status)) => return Some(format!("the service ends with {status}")),
            _ if Instant::now() > until => {
                // An error means that it has ended.
                let _ = child.kill();
                return Some("the service does not end".to_owned());
            }
            _ => std::thread::sleep(POLL),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heat_map_may_gain_cells_and_seconds_and_lose_neither() {
        let old = b"x,y,seconds\n0.125,0.125,1.50\n0.375,0.125,0.20\n";
        let grown = b"x,y,seconds\n0.125,0.125,1.50\n-0.125,0.375,0.10\n0.375,0.125,0.90\n";
        assert!(!has_lost_seconds(old, grown) && !has_lost_seconds(old, old));
        assert!(has_lost_seconds(grown, old), "a cell is gone");
        assert!(has_lost_seconds(old, b"x,y,seconds\n0.125,0.125,1.40\n0.375,0.125,0.20\n"));
        assert!(has_lost_seconds(old, b"x,y,seconds\n") && has_lost_seconds(old, b""));
    }

    #[test]
    fn lines_may_be_added_at_the_end_alone() {
        assert!(!has_lost_lines(b"1\n2\n", b"1\n2\n3\n"));
        assert!(!has_lost_lines(b"1\n2", b"1\n"), "the last line was not whole");
        assert!(has_lost_lines(b"1\n2\n", b"1\n") && has_lost_lines(b"1\n2\n", b"0\n1\n2\n"));
    }
}
