//! `tracker run` as a child process: its log, its rows as they come, its end.

use std::io::{BufRead, BufReader};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::chain::StepResult;
use crate::data::program;
use crate::live::rows::{LiveRow, RowWatch};

/// Polling interval of a wait.
const POLL: Duration = Duration::from_millis(20);
/// Time that an interrupted run has to write its results.
const FAREWELL: Duration = Duration::from_mins(1);

/// A run that goes on until it is interrupted or dropped.
#[derive(Debug)]
pub struct LiveRun {
    child: Child,
    log: Arc<Mutex<Vec<String>>>,
    reader: Option<JoinHandle<()>>,
    rows: RowWatch,
    /// Address of the run's page, if one was asked for.
    page: Option<SocketAddr>,
}

/// A run that is over.
#[derive(Debug)]
pub struct EndedRun {
    /// Exit status of the process.
    pub status: ExitStatus,
    /// The lines of its standard error.
    pub log: Vec<String>,
    /// Rows of the run.
    pub rows: Vec<LiveRow>,
}

/// `--video NAME=SPEC` for each camera.
pub fn videos<'a>(cameras: impl IntoIterator<Item = (&'a str, String)>) -> Vec<String> {
    cameras.into_iter().flat_map(|(name, spec)| ["--video".to_owned(), format!("{name}={spec}")]).collect()
}

impl LiveRun {
    /// Starts `tracker run ROOM --out OUT` with further arguments.
    ///
    /// # Errors
    /// A line when the process does not start.
    pub fn start(room: &Path, out: &Path, arguments: &[String]) -> StepResult<Self> {
        let mut command = program("tracker");
        command.arg("run").arg(room).arg("--out").arg(out).args(arguments);
        Self::spawn(&mut command, out, None)
    }

    /// Starts the same run with a page at a free port (`--view`).
    ///
    /// # Errors
    /// As [`Self::start`]; when no port is free.
    pub fn start_with_page(room: &Path, out: &Path, arguments: &[String]) -> StepResult<Self> {
        let page = free_address()?;
        let mut command = program("tracker");
        command.arg("run").arg(room).arg("--out").arg(out).args(arguments);
        command.args(["--view", "--view-port", &page.port().to_string()]);
        Self::spawn(&mut command, out, Some(page))
    }

    /// Starts `tracker station ROOM --method agents --camera CAMERA --out OUT` with further arguments.
    ///
    /// # Errors
    /// The process does not start.
    pub fn start_agents(room: &Path, camera: &str, out: &Path, arguments: &[String]) -> StepResult<Self> {
        let mut command = program("tracker");
        command.arg("station").arg(room).args(["--method", "agents", "--camera", camera]);
        command.arg("--out").arg(out).args(arguments);
        Self::spawn(&mut command, out, None)
    }

    fn spawn(command: &mut Command, out: &Path, page: Option<SocketAddr>) -> StepResult<Self> {
        let started = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
        let mut child = started.map_err(|e| format!("{command:?}: {e}"))?;
        let log = Arc::<Mutex<Vec<String>>>::default();
        let own = Arc::clone(&log);
        let reader = child.stderr.take().map(|errors| {
            thread::spawn(move || {
                for line in BufReader::new(errors).lines().map_while(Result::ok) {
                    own.lock().unwrap_or_else(PoisonError::into_inner).push(line);
                }
            })
        });
        let rows = RowWatch::start(out.join("tracks.jsonl"));
        Ok(Self { child, log, reader, rows, page })
    }

    /// The process's id.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Address of the page, if the run was started with one.
    pub fn page(&self) -> Option<SocketAddr> {
        self.page
    }

    /// The rows so far.
    pub fn rows(&self) -> Vec<LiveRow> {
        self.rows.rows()
    }

    /// Whether the process is running.
    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Waits until a time.
    ///
    /// # Errors
    /// The run's last line, if the run ends before.
    pub fn wait_until(&mut self, time: Instant) -> StepResult<()> {
        self.wait_for(time, |_| false).map(|_| ())
    }

    /// Waits until `is_true` holds for the rows; `false` if it does not before `until`.
    ///
    /// # Errors
    /// The run's last line, if the run ends before.
    pub fn wait_for(
        &mut self,
        until: Instant,
        mut is_true: impl FnMut(&[LiveRow]) -> bool,
    ) -> StepResult<bool> {
        loop {
            if is_true(&self.rows.rows()) {
                return Ok(true);
            }
            if !self.is_running() {
                return Err(self.failure());
            }
            let rest = until.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return Ok(false);
            }
            thread::sleep(rest.min(POLL));
        }
    }

    /// Waits for the end of a run that ends by itself.
    ///
    /// # Errors
    /// The run's last line, if it fails; a run that goes on until then.
    pub fn finish(mut self, until: Instant) -> StepResult<EndedRun> {
        while self.is_running() {
            if Instant::now() > until {
                return Err(format!("the run has not ended in time; {}", self.failure()));
            }
            thread::sleep(POLL);
        }
        self.ended()
    }

    /// Sends the process a signal, as in `STOP`.
    ///
    /// # Errors
    /// The program `kill` cannot be run.
    pub fn signal(&self, name: &str) -> StepResult<()> {
        let sent = Command::new("kill").args([&format!("-{name}"), &self.pid().to_string()]).status();
        sent.map(drop).map_err(|e| format!("kill: {e}"))
    }

    /// Interrupts the run as Ctrl-C does, and waits for its end.
    ///
    /// # Errors
    /// The run's last line, if it fails or does not end.
    pub fn interrupt(mut self) -> StepResult<EndedRun> {
        if self.is_running() {
            self.signal("INT")?;
        }
        self.finish(Instant::now() + FAREWELL)
    }

    fn ended(&mut self) -> StepResult<EndedRun> {
        let status = self.child.wait().map_err(|e| e.to_string())?;
        if !status.success() {
            return Err(self.failure());
        }
        if let Some(reader) = self.reader.take() {
            // A thread that panicked has printed why.
            let _ = reader.join();
        }
        // The last rows are found at the next look.
        thread::sleep(POLL);
        Ok(EndedRun { status, log: self.log(), rows: self.rows() })
    }

    /// The lines of the log so far.
    pub fn log(&self) -> Vec<String> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Error line of a failed run, in its own words.
    fn failure(&mut self) -> String {
        if !self.is_running()
            && let Some(reader) = self.reader.take()
        {
            let _ = reader.join();
        }
        error_line(&self.log())
    }
}

impl Drop for LiveRun {
    fn drop(&mut self) {
        // An error means that the process has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Line of a program's log that states the problem: the first that begins with `error`, else the last.
pub fn error_line<S: AsRef<str>>(log: &[S]) -> String {
    let lines = || log.iter().map(|line| line.as_ref().trim()).filter(|line| !line.is_empty());
    let error = lines().find(|line| line.to_lowercase().starts_with("error"));
    error.or_else(|| lines().last()).unwrap_or("ended without a word").to_owned()
}

/// Free address of the loopback: no process listens there.
///
/// # Errors
/// No port is free.
pub fn free_address() -> StepResult<SocketAddr> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(|e| e.to_string())?;
    listener.local_addr().map_err(|e| e.to_string())
}

/// Folder for one scenario's files, removed when it is dropped.
#[derive(Debug)]
pub struct Scratch(tempfile::TempDir);

impl Scratch {
    /// Makes a new folder.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn new() -> StepResult<Self> {
        tempfile::tempdir().map(Self).map_err(|e| e.to_string())
    }

    /// Path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}
