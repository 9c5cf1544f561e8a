//! Checks of numeric options, one line of error for all of them.

use shell::ranges::{Range, shown};

use crate::{Error, Result};

/// Checks that named numbers are finite and as wanted; `wanted` completes "give …".
///
/// # Errors
/// [`Error::Option`] for the first that is not.
pub(crate) fn check_numbers<'a>(
    options: impl IntoIterator<Item = (&'a str, f64)>,
    is_valid: impl Fn(f64) -> bool,
    wanted: &str,
) -> Result<()> {
    match options.into_iter().find(|(_, value)| !(value.is_finite() && is_valid(*value))) {
        Some((name, value)) => Err(Error::option(name, format!("is {}; give {wanted}", shown(value)))),
        None => Ok(()),
    }
}

/// Checks that named numbers are in a range.
///
/// # Errors
/// [`Error::Option`] for the first that is not; it names the range.
pub(crate) fn check_ranges<'a>(options: impl IntoIterator<Item = (&'a str, f64, Range)>) -> Result<()> {
    for (name, value, range) in options {
        if let Some(problem) = range.defect(value) {
            return Err(Error::option(name, problem));
        }
    }
    Ok(())
}
