//! Protection of a server by what a command's options say: a token for other machines, and TLS.

use std::fs;
use std::path::{Path, PathBuf};

use super::{AccessToken, ListenError, Listener};

/// Token and certificate that a command's options name.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Protection {
    /// File whose first line is the token. Without it a server that other machines can reach takes a random one.
    pub token_file: Option<PathBuf>,
    /// Certificate chain and private key, files in PEM form, with which the server speaks HTTPS.
    pub certificate_and_key: Option<(PathBuf, PathBuf)>,
}

impl Listener {
    /// Listener with that protection. One beyond the loopback always has a token.
    ///
    /// # Errors
    /// [`ListenError`] with the file and the mend.
    pub fn protected(self, protection: &Protection) -> Result<Self, ListenError> {
        let is_local = self.address().ip().is_loopback();
        let token = match &protection.token_file {
            Some(file) => Some(token_of(file)?),
            None if is_local => None,
            None => Some(AccessToken::random().map_err(|e| ListenError {
                address: self.address().to_string(),
                problem: format!("no random token ({e}); name a file with one"),
            })?),
        };
        let listener = match token {
            Some(token) => self.with_token(token),
            None => self,
        };
        match &protection.certificate_and_key {
            Some((certificate, key)) => listener.with_tls(certificate, key),
            None => Ok(listener),
        }
    }
}

/// Token in the first line of a file.
fn token_of(file: &Path) -> Result<AccessToken, ListenError> {
    let defect = |problem: String| ListenError { address: file.display().to_string(), problem };
    let text = fs::read_to_string(file)
        .map_err(|e| defect(format!("{e}; name a file whose first line is the token")))?;
    AccessToken::chosen(text.lines().next().unwrap_or_default().trim())
        .map_err(|problem| defect(format!("line 1: {problem}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_loopback_is_served_without_a_token() {
        let bind = |host: &str| Listener::bind(host, 0, "--port").unwrap();
        let open = Protection::default();
        assert!(!bind("127.0.0.1").protected(&open).unwrap().has_token());
        assert!(bind("0.0.0.0").protected(&open).unwrap().has_token());
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("token");
        let chosen = Protection { token_file: Some(file.clone()), ..open };
        let refusal = |listener: Listener| listener.protected(&chosen).unwrap_err().to_string();
        assert!(refusal(bind("127.0.0.1")).contains("first line is the token"));
        fs::write(&file, "short\n").unwrap();
        let told = refusal(bind("127.0.0.1"));
        assert!(told.contains("token: line 1: a token has at least 16"), "{told}");
        fs::write(&file, " 0123456789abcdef \nmore\n").unwrap();
        let link = bind("127.0.0.1").protected(&chosen).unwrap().link();
        assert!(link.ends_with("/?token=0123456789abcdef"), "{link}");
    }
}
