//! Reasons why there is no connection to the broker, in words.

use std::error::Error as StdError;
use std::io::{self, ErrorKind};

use rumqttc::{ConnectReturnCode, ConnectionError};

/// A connection that could not be made, or broke off.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Failure {
    /// Whether an attempt with the same options will fail again: somebody has to change something.
    pub(super) is_refusal: bool,
    /// Reason and mend, on one line.
    pub(super) line: String,
}

impl Failure {
    pub(super) fn of(error: &ConnectionError) -> Self {
        if let ConnectionError::ConnectionRefused(code) = error {
            let line = match code {
                ConnectReturnCode::BadUserNamePassword | ConnectReturnCode::NotAuthorized => {
                    "the broker refuses the user or the password; set ROOMTRACK_MQTT_USER and ROOMTRACK_MQTT_PASSWORD, or \
                     give a file of credentials"
                        .to_owned()
                }
                ConnectReturnCode::ServiceUnavailable => {
                    return Self::passing("the broker says that it is not available");
                }
                other => format!("the broker refuses the connection ({other:?})"),
            };
            return Self { is_refusal: true, line };
        }
        if let Some(tls) = cause::<rustls::Error>(error) {
            return Self::of_tls(tls);
        }
        match cause::<io::Error>(error).map(io::Error::kind) {
            Some(ErrorKind::ConnectionRefused) => Self::passing("nobody listens there"),
            Some(ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::UnexpectedEof) => {
                Self::passing("the connection was closed")
            }
            _ if matches!(error, ConnectionError::NetworkTimeout) => Self::passing("there is no answer"),
            _ => Self::passing(&error.to_string().replace('\n', " ")),
        }
    }

    fn passing(line: &str) -> Self {
        Self { is_refusal: false, line: line.to_owned() }
    }

    fn of_tls(error: &rustls::Error) -> Self {
        let line = match error {
            rustls::Error::InvalidCertificate(reason) => format!(
                "the broker's certificate is not trusted ({reason:?}); give the file of the authority that signed it, and the \
                 name that stands in it"
            ),
            rustls::Error::AlertReceived(alert) => format!(
                "the broker refuses TLS with this machine ({alert:?}); give a certificate that it accepts, and its key"
            ),
            other => format!("TLS: {other}; is that the broker's port for TLS?"),
        };
        Self { is_refusal: true, line }
    }
}

/// The first error of a type in the chain of causes; an I/O error's inner error counts as its cause.
fn cause<'a, E: StdError + 'static>(error: &'a (dyn StdError + 'static)) -> Option<&'a E> {
    let mut next = Some(error);
    while let Some(error) = next {
        if let Some(found) = error.downcast_ref::<E>() {
            return Some(found);
        }
        let inner = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
        next = match inner {
            Some(inner) => Some(inner),
            None => error.source(),
        };
    }
    None
}
