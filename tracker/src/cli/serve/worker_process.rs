//! A room's worker as the supervisor sees it.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::Sender;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::Context;
use shell::console::Console;
use shell::program;

use super::site_plan::RoomPlan;
use crate::cli::room_service::{Order, Report, send};

/// Shortest pause before a worker that has ended is started again…
const FIRST_PAUSE: Duration = Duration::from_secs(1);
/// …and the longest: it doubles with every failure…
const LONGEST_PAUSE: Duration = Duration::from_mins(1);
/// …and is the shortest again after a worker that ran for this time.
const HEALTHY: Duration = Duration::from_mins(1);

/// Settings of glibc's allocator, unless the environment has others. By default its threshold for `mmap` grows with the blocks that
/// are freed, and then the memory of a room that is read again stays with the process (see `mallopt(3)`).
const ALLOCATOR: [(&str, &str); 2] = [("MALLOC_MMAP_THRESHOLD_", "1048576"), ("MALLOC_ARENA_MAX", "2")];

/// A room that is to be followed.
pub(super) struct WorkerProcess {
    pub(super) plan: RoomPlan,
    state: State,
    /// Pause after the next failure.
    pause: Duration,
}

enum State {
    Waiting(Instant),
    Running(Box<Running>),
}

struct Running {
    child: Child,
    /// Closed to end the worker.
    orders: Option<ChildStdin>,
    readers: Vec<JoinHandle<()>>,
    started: Instant,
}

/// A report, and the name of its room.
pub(super) type RoomReport = (String, Report);

impl WorkerProcess {
    /// A room whose worker is started at the next look.
    pub(super) fn new(plan: RoomPlan) -> Self {
        Self { plan, state: State::Waiting(Instant::now()), pause: FIRST_PAUSE }
    }

    /// Starts the worker if it is time, and notices its end. Returns whether it has ended since the last look.
    pub(super) fn look(&mut self, console: &Console, verbose: u8, reports: &Sender<RoomReport>) -> bool {
        match &mut self.state {
            State::Waiting(due) if Instant::now() < *due => false,
            State::Waiting(_) => {
                match start(&self.plan, console, verbose, reports) {
                    Ok(running) => self.state = State::Running(Box::new(running)),
                    Err(error) => {
                        tracing::warn!("room {}: {error:#}", self.plan.name);
                        self.wait(false);
                    }
                }
                false
            }
            State::Running(running) => match running.child.try_wait() {
                Ok(None) => false,
                ended => {
                    let was_healthy = running.started.elapsed() >= HEALTHY;
                    running.join();
                    let status = ended.ok().flatten();
                    if was_healthy {
                        self.pause = FIRST_PAUSE;
                    }
                    self.wait(status.is_some_and(|status| status.success()));
                    self.log_end(status);
                    true
                }
            },
        }
    }

    /// Waits before the next start; longer after every failure.
    fn wait(&mut self, is_clean: bool) {
        let pause = if is_clean { FIRST_PAUSE } else { self.pause };
        if !is_clean {
            self.pause = (2 * self.pause).min(LONGEST_PAUSE);
        }
        self.state = State::Waiting(Instant::now() + pause);
    }

    fn log_end(&self, status: Option<ExitStatus>) {
        let State::Waiting(due) = &self.state else { return };
        let pause_s = due.saturating_duration_since(Instant::now()).as_secs_f64().round();
        match status {
            Some(status) if status.success() => {
                tracing::info!("room {}: has ended; it is started again in {pause_s} s", self.plan.name);
            }
            status => {
                let how =
                    status.map_or_else(|| "was lost".to_owned(), |status| format!("has failed ({status})"));
                tracing::warn!("room {}: {how}; it is started again in {pause_s} s", self.plan.name);
            }
        }
    }

    /// Makes the worker read its room again.
    pub(super) fn read_room(&mut self) {
        if let State::Running(running) = &mut self.state
            && let Some(orders) = &mut running.orders
        {
            // A worker that has just ended reads it at its next start.
            let _ = send(orders, &Order::ReadRoom);
        }
    }

    /// Makes the worker end.
    pub(super) fn end(&mut self) {
        if let State::Running(running) = &mut self.state {
            running.orders = None;
        }
    }

    /// Whether a worker that was made to end is gone; it is killed when `is_late`.
    pub(super) fn is_gone(&mut self, is_late: bool) -> bool {
        let State::Running(running) = &mut self.state else { return true };
        if is_late {
            tracing::warn!("room {}: does not end, and is killed", self.plan.name);
            // An error means that it has ended.
            let _ = running.child.kill();
        }
        if !is_late && matches!(running.child.try_wait(), Ok(None)) {
            return false;
        }
        // It has ended, or was killed.
        let _ = running.child.wait();
        running.join();
        true
    }
}

impl Running {
    /// Waits for the threads that read what the worker has written.
    fn join(&mut self) {
        self.orders = None;
        for reader in self.readers.drain(..) {
            // A thread that panicked has printed why.
            let _ = reader.join();
        }
    }
}

/// Path of this very program, also after another one has taken its place.
fn own_path() -> std::io::Result<PathBuf> {
    let own = Path::new("/proc/self/exe");
    if own.exists() { Ok(own.to_owned()) } else { std::env::current_exe() }
}

fn start(
    plan: &RoomPlan,
    console: &Console,
    verbose: u8,
    reports: &Sender<RoomReport>,
) -> anyhow::Result<Running> {
    let mut command = Command::new(own_path()?);
    command.arg0(OsStr::new("tracker")).args(program::arguments_before("tracker"));
    command.arg(super::super::WORKER).args((0..verbose).map(|_| "-v"));
    command.envs(ALLOCATOR.into_iter().filter(|(name, _)| std::env::var_os(name).is_none()));
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().context("its process")?;
    // The three have just been asked for.
    let (Some(mut orders), Some(output), Some(log)) =
        (child.stdin.take(), child.stdout.take(), child.stderr.take())
    else {
        anyhow::bail!("its process has no pipes");
    };
    let (name, reports) = (plan.name.clone(), reports.clone());
    let reader = thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            if let Ok(report) = serde_json::from_str(&line) {
                // Nobody listens to the last words of a service that ends.
                let _ = reports.send((name.clone(), report));
            }
        }
    });
    let (name, console) = (plan.name.clone(), console.clone());
    let logger = thread::spawn(move || {
        for line in BufReader::new(log).lines().map_while(Result::ok) {
            console.line(&format!("{name}: {}", line.trim_start()));
        }
    });
    tracing::info!("room {}: starts, process {}", plan.name, child.id());
    send(&mut orders, &Order::Run(plan.arguments.clone())).context("its process")?;
    Ok(Running { child, orders: Some(orders), readers: vec![reader, logger], started: Instant::now() })
}
