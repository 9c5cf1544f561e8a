//! Programs that are killed (SIGKILL) at random moments: their files can be read, and a second run makes the same files as a run
//! that nobody disturbed, and no others.
//!
//! * [`build()`] — `recon build`; [`run()`] — `tracker run`; [`serve()`] — `tracker serve`.
//! * [`Outcome`] — what was found.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::chain::StepResult;

mod build;
pub(crate) mod readable;
mod run;
mod serve;

pub use build::build;
pub use run::run;
pub use serve::serve;

/// Most that a film may lack of the rows that are on the disk, seconds: its last second, and the frames that wait for the
/// painter of a recording.
const MOST_FILM_LOST_S: f64 = 1.75;

/// Outcome of many kills.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Kills of a program that was running.
    pub killed: usize,
    /// Kills that came after the program's end.
    pub late: usize,
    /// Faults, each with the moment of its kill.
    pub faults: Vec<String>,
    /// Greatest time by which a film was behind the rows, seconds.
    pub film_lost_s: f64,
}

impl Outcome {
    fn kill(&mut self, command: &mut Command, after: Duration) -> StepResult<()> {
        if kill_after(command, after)? {
            self.killed += 1;
        } else {
            self.late += 1;
        }
        Ok(())
    }

    fn add(&mut self, place: &str, faults: impl IntoIterator<Item = String>) {
        self.faults.extend(faults.into_iter().map(|fault| format!("{place}: {fault}")));
    }
}

/// Random moments within a program's time.
struct Moments {
    random: Pcg64Mcg,
    within_s: f64,
}

impl Moments {
    fn new(seed: u64, within: Duration) -> Self {
        Self { random: Pcg64Mcg::seed_from_u64(seed), within_s: within.as_secs_f64() }
    }

    /// The next moment.
    fn draw(&mut self) -> Duration {
        Duration::from_secs_f64(self.random.random_range(0.0..self.within_s))
    }
}

/// Place of a fault.
fn place_of(kill: usize, after: Duration) -> String {
    format!("kill {kill} after {:.2} s", after.as_secs_f64())
}

/// Kills a program so long after its start; `false` where it had ended by then.
fn kill_after(command: &mut Command, after: Duration) -> StepResult<bool> {
    let mut child = quiet(command)?;
    std::thread::sleep(after);
    let is_running = matches!(child.try_wait(), Ok(None));
    // An error means that it has ended.
    let _ = child.kill();
    child.wait().map_err(|e| e.to_string())?;
    Ok(is_running)
}

fn quiet(command: &mut Command) -> StepResult<Child> {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().map_err(|e| format!("{command:?}: {e}"))
}

/// Differences of a folder's files from those of an undisturbed run.
fn differences(
    found: &BTreeMap<PathBuf, Vec<u8>>,
    expected: &BTreeMap<PathBuf, Vec<u8>>,
    is_timed: impl Fn(&Path) -> bool,
) -> Vec<String> {
    let left = found.keys().filter(|name| !expected.contains_key(*name));
    let missing = expected.keys().filter(|name| !found.contains_key(*name));
    let other = expected
        .iter()
        .filter(|(name, bytes)| !is_timed(name) && found.get(*name).is_some_and(|b| b != *bytes));
    left.map(|name| format!("{} was left", name.display()))
        .chain(missing.map(|name| format!("{} is missing", name.display())))
        .chain(other.map(|(name, _)| format!("{} differs", name.display())))
        .collect()
}
