//! Where a person is told things: the log and the progress of long work, on standard error.

use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use tracing_subscriber::EnvFilter;

/// Standard error, as the program's own file where libraries print over the stream.
#[derive(Debug, Clone)]
pub(crate) struct Console {
    own: Option<Arc<File>>,
}

/// Plain lines come this often where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(5);

impl Console {
    /// `own`: what [`calib::vision::chatter::take_stderr`] gave, if it was called.
    pub(crate) fn new(own: Option<Arc<File>>) -> Self {
        Self { own }
    }

    /// To write a line to.
    pub(crate) fn writer(&self) -> Box<dyn Write + Send> {
        match &self.own {
            Some(file) => Box::new(Arc::clone(file)),
            None => Box::new(io::stderr()),
        }
    }

    /// Sends the log here: warnings and what is done at 0, more at 1 and 2; `RUST_LOG` decides where it is set.
    pub(crate) fn start_log(&self, verbose: u8) {
        let level = ["info", "debug", "trace"][usize::from(verbose.min(2))];
        let default = format!("warn,tracker={level},scenes={level},calib={level}");
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
        let console = self.clone();
        tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_ansi(self.is_terminal())
            .with_target(false)
            .without_time()
            .with_writer(move || console.writer())
            .init();
    }

    /// Progress of work with so many steps, if that is known.
    pub(crate) fn progress(&self, what: &str, steps: Option<u64>) -> Progress {
        let bar = self.is_terminal().then(|| {
            let bar = steps.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
            let line = if steps.is_some() {
                "{msg} {wide_bar} {pos}/{len}, {per_sec}, {eta} left"
            } else {
                "{msg} {spinner} {pos}, {per_sec}"
            };
            // The template is a constant of this file; the fallback only looks plainer.
            let style = ProgressStyle::with_template(line).unwrap_or_else(|_| ProgressStyle::default_bar());
            bar.set_draw_target(self.draw_target());
            bar.with_style(style).with_message(what.to_owned())
        });
        Progress { what: what.to_owned(), steps, done: 0, bar, latest_line: Instant::now() }
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

/// A bar on a terminal, a line every few seconds elsewhere.
pub(crate) struct Progress {
    what: String,
    steps: Option<u64>,
    done: u64,
    bar: Option<ProgressBar>,
    latest_line: Instant,
}

impl Progress {
    /// One step is done.
    pub(crate) fn advance(&mut self) {
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
