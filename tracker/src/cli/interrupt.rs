//! Ctrl-C, SIGTERM and the end of the terminal: the first asks a run to finish, the second ends the program.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

/// Exit status of a program that SIGINT ended, as shells report it.
const INTERRUPTED: i32 = 128 + SIGINT;

/// Returns a flag that Ctrl-C, SIGTERM and SIGHUP set from now on; when it is already set, they end the program at once. A
/// program that was started to ignore SIGHUP, as by `nohup`, goes on ignoring it.
pub(super) fn watch() -> io::Result<Arc<AtomicBool>> {
    let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    watch_signals([SIGINT, SIGTERM].into_iter().chain(hang_up))
}

/// The same for a service, which reads its file again at SIGHUP: the flag of Ctrl-C and SIGTERM.
pub(super) fn watch_as_service() -> io::Result<Arc<AtomicBool>> {
    watch_signals([SIGINT, SIGTERM])
}

fn watch_signals(signals: impl IntoIterator<Item = i32>) -> io::Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in signals {
        // In this order: the first signal must find the flag unset.
        flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(&interrupted))?;
        flag::register(signal, Arc::clone(&interrupted))?;
    }
    Ok(interrupted)
}

/// Whether this process ignores a signal; unknown counts as no.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    ignores(&status, signal)
}

/// Whether a process whose status is this (proc(5)) ignores a signal.
fn ignores(status: &str, signal: i32) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_those_of_the_mask() {
        let status = "Name:\ttracker\nSigIgn:\t0000000000001001\nSigCgt:\t0000000000000002\n";
        assert!(ignores(status, SIGHUP) && ignores(status, 13));
        assert!(!ignores(status, SIGINT) && !ignores("", SIGHUP));
    }
}
