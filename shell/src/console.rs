//! Start and end of each program, and its output to a person on standard error: the log, the progress of long work, the
//! one line of an error, the exit status.
//!
//! libav and OpenCV print to the process's standard error on their own account, past every log level that can be set
//! from outside. A program that promises one clear line on standard error takes the stream for itself.

use std::error::Error;
use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal, StdoutLock, Write};
use std::os::fd::AsFd;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::error::ErrorKind as ArgumentErrorKind;
use indicatif::{ProgressBar, ProgressStyle};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

use crate::plain_text::{self, PlainWriter};
use crate::program;

/// Exit status of a command that failed: bad input, misuse, a full disk.
pub const CANNOT: u8 = 2;

/// Interval between two progress lines where standard error is not a terminal.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Largest length of a message of the log, bytes, so that level and message fit into one line.
const LONGEST_MESSAGE: usize = plain_text::LONGEST_LINE - 6;
/// Levels of the log, the quietest first. The last one includes the log of the libraries below.
const LEVELS: [&str; 4] = ["warn", "info", "debug", "trace"];

/// Arguments of the program. Wrong ones are told in one line and end it with [`CANNOT`].
pub fn arguments<A: clap::Parser>() -> A {
    parsed(A::command(), A::from_arg_matches)
}

/// Arguments of the program by its command line `command`, read by `read`, as [`arguments`] does.
pub fn parsed<A>(
    mut command: clap::Command,
    read: impl FnOnce(&clap::ArgMatches) -> Result<A, clap::Error>,
) -> A {
    let matches = command.try_get_matches_from_mut(std::env::args_os());
    let arguments = matches.and_then(|matches| read(&matches)).map_err(|error| error.format(&mut command));
    arguments.unwrap_or_else(|error| {
        let is_help = error.kind() == ArgumentErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;
        if is_help || !error.use_stderr() {
            error.exit();
        }
        // There is no other place to report to when standard error is closed.
        let _ = writeln!(
            io::stderr(),
            "error: {}",
            plain_text::cut_to(&program::as_called(&argument_problem(&error)), LONGEST_MESSAGE - 1)
        );
        std::process::exit(i32::from(CANNOT));
    })
}

/// Problem of wrong arguments on one line, without the advice that spans several.
pub fn argument_problem(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines = text
        .split('\n')
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"))
        .filter(|line| !line.is_empty());
    let problem = lines.fold(String::new(), |all, line| {
        let gap = match all.as_str() {
            "" => "",
            _ if line.starts_with("tip:") => "; ",
            _ => " ",
        };
        all + gap + line
    });
    plain_text::escaped(problem.trim_start_matches("error: "))
}

/// Standard output for text: control characters of files and names are escaped.
pub fn stdout() -> PlainWriter<StdoutLock<'static>> {
    PlainWriter::new(io::stdout().lock())
}

/// Standard error; a private copy of it where libraries print over the stream.
#[derive(Debug, Clone)]
pub struct Console {
    own: Option<Arc<File>>,
}

impl Console {
    /// Takes standard error over and sends the log there. Verbosity 0 shows warnings, 1 the steps done, 2 more, 3
    /// everything, with what the libraries below print. `RUST_LOG` overrides it where it is set.
    ///
    /// Call this once, before any work: afterwards `std::io::stderr` and `eprintln!` are discarded.
    pub fn start(verbosity: u8) -> Self {
        let verbosity = usize::from(verbosity).min(LEVELS.len() - 1);
        let own = if verbosity + 1 < LEVELS.len() { take_stderr().ok() } else { None };
        let console = Self { own: own.map(Arc::new) };
        let level = LEVELS[verbosity];
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| {
            EnvFilter::new(format!("warn,calib={level},scenes={level},recon={level},tracker={level}"))
        });
        let log = console.clone();
        tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_ansi(console.is_terminal())
            .event_format(PlainEvents)
            .with_writer(move || log.writer())
            .init();
        // A panic must not end the program without a message.
        let witness = console.clone();
        std::panic::set_hook(Box::new(move |panic| witness.line(&panic.to_string())));
        console
    }

    /// Writer to standard error.
    pub fn writer(&self) -> Box<dyn Write + Send> {
        match &self.own {
            Some(file) => Box::new(Arc::clone(file)),
            None => Box::new(io::stderr()),
        }
    }

    /// Writes a line, as [`plain_text::one_line`] makes it.
    pub fn line(&self, text: &str) {
        // There is no other place to report to when standard error is closed.
        let _ = writeln!(self.writer(), "{}", plain_text::one_line(&program::as_called(text)));
    }

    /// Exit status of finished work; an error is first printed in one line. A reader who closes the pipe early, as in
    /// `tracker eval … | head -1`, is no failure.
    pub fn end<E: AsRef<dyn Error>>(&self, done: Result<(), E>, failure: u8) -> ExitCode {
        let Err(error) = done else { return ExitCode::SUCCESS };
        if is_closed_pipe(error.as_ref()) {
            return ExitCode::SUCCESS;
        }
        self.line(&format!("error: {}", in_one_line(error.as_ref())));
        ExitCode::from(failure)
    }

    /// Starts a progress display of work with `steps` steps, where their number is known.
    pub fn progress(&self, what: &str, steps: Option<u64>) -> Progress {
        let bar = self.is_terminal().then(|| {
            let bar = steps.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
            let line = if steps.is_some() {
                "{msg} {wide_bar} {pos}/{len}, {per_sec}, {eta} left"
            } else {
                "{msg} {spinner} {pos}, {per_sec}"
            };
            self.shown(bar, line).with_message(plain_text::one_line(what))
        });
        Progress { what: what.to_owned(), steps, done: 0, bar, latest_line: Instant::now() }
    }

    /// Starts a progress display of work in `of` stages, each announced as it begins.
    pub fn stages(&self, of: usize) -> ProgressStages {
        let bar = self.is_terminal().then(|| {
            let bar = self.shown(ProgressBar::new(of as u64), "{bar:24} {pos}/{len}  {elapsed}  {wide_msg}");
            bar.enable_steady_tick(Duration::from_millis(200));
            bar
        });
        ProgressStages { console: self.clone(), of, bar }
    }

    fn shown(&self, bar: ProgressBar, template: &str) -> ProgressBar {
        // The templates are constants of this file; the fallback only looks plainer.
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_draw_target(self.draw_target());
        bar.with_style(style)
    }

    fn is_terminal(&self) -> bool {
        self.own.as_ref().map_or_else(|| io::stderr().is_terminal(), |file| file.is_terminal())
    }

    fn draw_target(&self) -> indicatif::ProgressDrawTarget {
        match self.own.as_ref().and_then(|file| file.try_clone().ok()) {
            Some(file) => {
                let term = console::Term::read_write_pair(io::stdin(), file);
                indicatif::ProgressDrawTarget::term(term, 10)
            }
            None => indicatif::ProgressDrawTarget::stderr_with_hz(10),
        }
    }
}

/// Progress bar on a terminal; elsewhere a log line every few seconds.
#[derive(Debug)]
pub struct Progress {
    what: String,
    steps: Option<u64>,
    done: u64,
    bar: Option<ProgressBar>,
    latest_line: Instant,
}

impl Progress {
    /// Counts one finished step.
    pub fn advance(&mut self) {
        self.done += 1;
        match &self.bar {
            Some(bar) => bar.inc(1),
            None if self.latest_line.elapsed() >= LINE_EVERY => {
                self.latest_line = Instant::now();
                let of = self.steps.map_or(String::new(), |steps| format!(" of {steps}"));
                tracing::info!("{}: {}{of}", self.what, self.done);
            }
            None => {}
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress bar on a terminal; elsewhere a log line a stage.
#[derive(Debug)]
pub struct ProgressStages {
    console: Console,
    of: usize,
    bar: Option<ProgressBar>,
}

impl ProgressStages {
    /// Announces the beginning of stage `number` (from 0).
    pub fn show(&self, number: usize, what: &str) {
        match &self.bar {
            Some(bar) => {
                bar.set_position(number as u64);
                bar.set_message(plain_text::one_line(what));
            }
            None => self.console.line(&format!("{number:2} of {}  {what}", self.of)),
        }
    }
}

impl Drop for ProgressStages {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Takes standard error for the program alone: returns it as a file to write to, and discards everything else that is
/// written to the process's standard error.
fn take_stderr() -> io::Result<File> {
    let own = io::stderr().as_fd().try_clone_to_owned()?;
    let discard = File::options().write(true).open("/dev/null")?;
    rustix::stdio::dup2_stderr(&discard)?;
    Ok(File::from(own))
}

/// An error and its causes. A cause that the message already contains is not repeated.
fn in_one_line(error: &dyn Error) -> String {
    let mut line = String::new();
    let mut next = Some(error);
    while let Some(cause) = next {
        let text = cause.to_string();
        if !line.contains(&text) {
            let gap = if line.is_empty() { "" } else { ": " };
            line = format!("{line}{gap}{text}");
        }
        next = cause.source();
    }
    line
}

/// Lines of the log: level and message, as [`plain_text::one_line`] makes them. The libraries' own details are not cut.
struct PlainEvents;

impl<S, N> FormatEvent<S, N> for PlainEvents
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let mut message = String::new();
        context.format_fields(Writer::new(&mut message), event)?;
        let level = *event.metadata().level();
        // Room for the level before it.
        let message = plain_text::escaped(&program::as_called(&message));
        let message =
            if level > Level::INFO { message } else { plain_text::cut_to(&message, LONGEST_MESSAGE) };
        let color = match level {
            _ if !writer.has_ansi_escapes() => return writeln!(writer, "{level:>5} {message}"),
            Level::ERROR => 31,
            Level::WARN => 33,
            Level::INFO => 32,
            _ => 34,
        };
        writeln!(writer, "\u{1b}[{color}m{level:>5}\u{1b}[0m {message}")
    }
}

fn is_closed_pipe(error: &(dyn Error + 'static)) -> bool {
    let mut next = Some(error);
    while let Some(cause) = next {
        if cause.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == ErrorKind::BrokenPipe) {
            return true;
        }
        next = cause.source();
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("{path}: {source}")]
    struct FileError {
        path: &'static str,
        source: io::Error,
    }

    fn missing() -> FileError {
        FileError { path: "cam.toml", source: io::Error::new(ErrorKind::NotFound, "no such file") }
    }

    #[test]
    fn a_cause_is_told_once_and_on_the_same_line() {
        assert_eq!(in_one_line(&missing()), "cam.toml: no such file");
        let wrapped = anyhow::Error::from(missing()).context("camera `a`");
        assert_eq!(in_one_line(wrapped.as_ref()), "camera `a`: cam.toml: no such file");
        assert_eq!(plain_text::one_line(&in_one_line(&io::Error::other("two\nlines"))), "two lines");
    }

    #[derive(Debug, clap::Parser)]
    struct Arguments {
        #[arg(long)]
        threads: u8,
    }

    #[test]
    fn wrong_arguments_are_told_in_one_line() {
        let problem = |words: &[&str]| {
            let words = std::iter::once(&"program").chain(words);
            argument_problem(&<Arguments as clap::Parser>::try_parse_from(words).unwrap_err())
        };
        let said = problem(&["--threads", "9\u{1b}[2J\u{7}\n9"]);
        assert!(said.starts_with("invalid value '9") && said.contains("for '--threads <THREADS>'"), "{said}");
        assert!(!said.contains(char::is_control), "{said}");
        let said = problem(&["--thread", "9"]);
        assert!(said.contains("unexpected argument '--thread' found; tip: a similar argument"), "{said}");
        let said = problem(&[]);
        assert!(said.contains("not provided: --threads <THREADS>") && !said.contains('\n'), "{said}");
    }

    #[test]
    fn a_closed_pipe_is_seen_below_other_errors() {
        let pipe = || io::Error::from(ErrorKind::BrokenPipe);
        assert!(is_closed_pipe(&pipe()));
        let source = FileError { path: "out", source: pipe() };
        assert!(is_closed_pipe(anyhow::Error::from(source).context("writing").as_ref()));
        assert!(!is_closed_pipe(&missing()));
    }
}
