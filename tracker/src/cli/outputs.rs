//! Inputs of the commands, which none of their outputs may be.

use std::path::PathBuf;

use shell::files::paths_of;

use crate::source::NamedSource;

/// Paths of what sources read.
pub(super) fn paths_of_all<'a>(sources: impl IntoIterator<Item = &'a NamedSource>) -> Vec<PathBuf> {
    sources.into_iter().flat_map(|source| paths_of(&source.spec)).collect()
}
