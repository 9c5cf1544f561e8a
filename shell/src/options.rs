//! Checks of numeric options, their errors, and the flags under which the command line knows them.

use crate::ranges::{Range, shown};

/// An invalid option, or an invalid combination of options.
#[derive(Debug, thiserror::Error)]
#[error("{option}: {problem}")]
pub struct OptionError {
    /// Name of the field of the options, or of the thing at fault, such as a camera. The command line prints its flag in
    /// place of a field.
    pub option: String,
    /// Description of the defect and of its mend.
    pub problem: String,
}

impl OptionError {
    /// Builds the error of an option.
    pub fn new(option: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { option: option.into(), problem: problem.into() }
    }
}

/// Implements `Error::option` of an error enum that is made from an [`OptionError`].
#[macro_export]
macro_rules! option_error_constructor {
    ($error:ty) => {
        impl $error {
            /// Builds the error of an option.
            pub fn option(option: impl Into<String>, problem: impl Into<String>) -> Self {
                $crate::options::OptionError::new(option, problem).into()
            }
        }
    };
}

/// Checks that named numbers are finite and as wanted; `wanted` completes "give …".
///
/// # Errors
/// [`OptionError`] for the first that is not.
pub fn check_numbers<'a>(
    options: impl IntoIterator<Item = (&'a str, f64)>,
    is_valid: impl Fn(f64) -> bool,
    wanted: &str,
) -> Result<(), OptionError> {
    match options.into_iter().find(|(_, value)| !(value.is_finite() && is_valid(*value))) {
        Some((name, value)) => Err(OptionError::new(name, format!("is {}; give {wanted}", shown(value)))),
        None => Ok(()),
    }
}

/// Checks that named numbers are in a range.
///
/// # Errors
/// [`OptionError`] for the first that is not; it names the range.
pub fn check_ranges<'a>(options: impl IntoIterator<Item = (&'a str, f64, Range)>) -> Result<(), OptionError> {
    for (name, value, range) in options {
        if let Some(problem) = range.defect(value) {
            return Err(OptionError::new(name, problem));
        }
    }
    Ok(())
}

/// Flags of options' fields.
#[derive(Debug, Clone, Copy)]
pub struct FlagNames {
    /// Fields whose flag has another name, or that only one value of a flag concerns.
    pub renamed: &'static [(&'static str, &'static str)],
    /// Fields whose flag has the same name, with hyphens.
    pub same: &'static [&'static str],
}

impl FlagNames {
    /// The error with the flag in place of the field that it names, if it is an `E` that `option_of` finds to be an error of
    /// an option; other errors stay.
    pub fn put_in_error<E: std::error::Error + Send + Sync + 'static>(
        &self,
        mut error: anyhow::Error,
        option_of: impl FnOnce(&mut E) -> Option<&mut OptionError>,
    ) -> anyhow::Error {
        if let Some(option) = error.downcast_mut::<E>().and_then(option_of) {
            self.put_in(option);
        }
        error
    }

    /// Puts the flag in place of the field that an error names; other names stay.
    fn put_in(&self, error: &mut OptionError) {
        if let Some(name) = self.flag(&error.option) {
            error.option = name;
        }
    }

    /// The flag of a field, which a value may follow after a space.
    pub fn flag(&self, option: &str) -> Option<String> {
        let (field, value) = option.split_at(option.find(' ').unwrap_or(option.len()));
        let renamed =
            self.renamed.iter().find(|(name, _)| *name == field).map(|(_, flag)| (*flag).to_owned());
        let same = || self.same.contains(&field).then(|| format!("--{}", field.replace('_', "-")));
        Some(renamed.or_else(same)? + value)
    }

    /// Flags of all fields that are not flags of a command or of its subcommands: none, if the names are right.
    pub fn missing_in(&self, command: &clap::Command) -> Vec<String> {
        let fields = self.renamed.iter().map(|(field, _)| *field).chain(self.same.iter().copied());
        let flags = fields.filter_map(|field| self.flag(field));
        flags
            .filter(|flag| {
                let name = flag.split(' ').next().and_then(|name| name.strip_prefix("--"));
                !name.is_some_and(|name| has_flag(command, name))
            })
            .collect()
    }
}

/// Whether a command, or one of its subcommands, has a flag.
fn has_flag(command: &clap::Command, name: &str) -> bool {
    command.get_arguments().any(|argument| argument.get_long() == Some(name))
        || command.get_subcommands().any(|command| has_flag(command, name))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: FlagNames =
        FlagNames { renamed: &[("videos", "--video"), ("agents", "--method agents")], same: &["max_gap"] };

    #[test]
    fn fields_become_flags_and_other_names_stay() {
        let named = |option: &str| {
            let mut error = OptionError::new(option, "is 0");
            NAMES.put_in(&mut error);
            error.to_string()
        };
        assert_eq!(named("max_gap"), "--max-gap: is 0");
        assert_eq!(named("videos left=a.mp4"), "--video left=a.mp4: is 0");
        assert_eq!(named("station `max_gap`"), "station `max_gap`: is 0");
    }

    #[test]
    fn flags_that_no_command_has_are_missing() {
        let flag = |name: &'static str| clap::Arg::new(name).long(name);
        let deep = clap::Command::new("deep").arg(flag("video")).arg(flag("method"));
        let command = clap::Command::new("program").subcommand(deep);
        assert_eq!(NAMES.missing_in(&command), ["--max-gap"]);
        assert_eq!(NAMES.missing_in(&command.arg(flag("max-gap"))), [""; 0]);
    }
}
