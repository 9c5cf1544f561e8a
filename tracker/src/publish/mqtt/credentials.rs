//! User and password for a broker, from the environment or a file: a command line can be read by everyone on the machine.

use std::path::Path;

use serde::Deserialize;
use shell::files::FileError;

use crate::{Error, Result};

/// Environment variable of the user's name…
const USER: &str = "ROOMTRACK_MQTT_USER";
/// …and of the password.
const PASSWORD: &str = "ROOMTRACK_MQTT_PASSWORD";

/// User and password.
#[derive(Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Credentials {
    /// Name of the user.
    pub user: String,
    /// Password; empty for a user without one.
    #[serde(default)]
    pub password: String,
}

impl std::fmt::Debug for Credentials {
    /// Leaves the password out of logs.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Credentials").field("user", &self.user).finish_non_exhaustive()
    }
}

impl Credentials {
    /// Credentials of a TOML file with the keys `user` and `password`.
    ///
    /// # Errors
    /// The file with its line, and the mend. The error does not repeat the file's content.
    pub fn read(file: &Path) -> Result<Self> {
        calib::files::read_toml(file).map_err(|error| match error {
            // TOML's messages may quote a line.
            calib::Error::File(FileError::Content { path, place, .. }) => Error::content(
                &path,
                place,
                "is no file of credentials; write the two lines user = \"NAME\" and password = \"WORD\"",
            ),
            other => other.into(),
        })
    }

    /// Credentials of the environment, if it names a user.
    ///
    /// # Errors
    /// A password without a user, or text that is not UTF-8.
    pub fn of_environment() -> Result<Option<Self>> {
        let variable = |name: &str| match std::env::var(name) {
            Ok(text) => Ok(Some(text).filter(|text| !text.is_empty())),
            Err(std::env::VarError::NotPresent) => Ok(None),
            Err(std::env::VarError::NotUnicode(_)) => {
                Err(Error::option(name, "is not valid UTF-8; set it again"))
            }
        };
        Self::of(variable(USER)?, variable(PASSWORD)?)
    }

    fn of(user: Option<String>, password: Option<String>) -> Result<Option<Self>> {
        match (user, password) {
            (Some(user), password) => Ok(Some(Self { user, password: password.unwrap_or_default() })),
            (None, None) => Ok(None),
            (None, Some(_)) => {
                Err(Error::option(PASSWORD, format!("is set without a user; set {USER}, too")))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_needs_a_user() {
        let some = |text: &str| Some(text.to_owned());
        let both = Credentials::of(some("me"), some("secret")).unwrap().unwrap();
        assert_eq!((both.user.as_str(), both.password.as_str()), ("me", "secret"));
        assert!(!format!("{both:?}").contains("secret"));
        assert_eq!(Credentials::of(None, None).unwrap(), None);
        let line = Credentials::of(None, some("secret")).unwrap_err().to_string();
        assert!(line.contains(USER) && !line.contains("secret"), "{line}");
    }

    #[test]
    fn files_are_read_and_their_defects_named_without_their_content() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("broker.toml");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Credentials::read(&path)
        };
        assert_eq!(read("user = \"me\"\npassword = \"secret\"\n").unwrap().password, "secret");
        assert_eq!(read("user = \"me\"\n").unwrap().password, "");
        for bad in
            ["", "secret", "user = \"me\"\npasword = \"secret\"\n", "user = \"me\npassword = \"secret\""]
        {
            let line = read(bad).unwrap_err().to_string();
            assert!(line.contains("broker.toml") && line.contains("user = \"NAME\""), "{line}");
            assert!(!line.contains("secret") && !line.contains('\n'), "{line}");
        }
    }
}
