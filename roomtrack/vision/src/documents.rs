//! Documents that are made from the command line: completions of shells, manual pages.

use std::io::Write;
use std::path::Path;

use anyhow::Context;

use roomtrack::NAME;

use crate::arguments;

/// Prints the completions of `shell`.
pub(crate) fn completions(shell: clap_complete::Shell) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut arguments::command(), NAME, &mut script);
    Ok(std::io::stdout().lock().write_all(&script)?)
}

/// Writes the manual page of each command into the folder `out`: `roomtrack.1`, `roomtrack-tracker-run.1`, ….
pub(crate) fn man_pages(out: &Path) -> anyhow::Result<()> {
    let written =
        std::fs::create_dir_all(out).and_then(|()| clap_mangen::generate_to(arguments::command(), out));
    written.with_context(|| format!("{}: cannot write the manual pages", out.display()))
}
