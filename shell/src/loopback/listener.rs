//! Socket of a server, and the check of who may send requests.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};

use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use axum::http::header::HOST;
use axum::http::{HeaderMap, Response};

use super::Answer;

/// Error of an address at which no page can be served.
#[derive(Debug, thiserror::Error)]
#[error("{address}: {problem}")]
pub struct ListenError {
    /// Host and port.
    pub address: String,
    /// Problem, and what to do about it.
    pub problem: String,
}

/// A bound socket of this machine that listens.
#[derive(Debug)]
pub struct Listener {
    listener: TcpListener,
    address: SocketAddr,
}

impl Listener {
    /// Listens on an address of this machine, by name or number; port 0 is any free one. `option` is the command-line
    /// option that names the port, for the error's text.
    ///
    /// # Errors
    /// [`ListenError`] when the address is not this machine's, or the port is in use or reserved.
    pub fn bind(host: &str, port: u16, option: &str) -> Result<Self, ListenError> {
        TcpListener::bind((host, port)).and_then(Self::of).map_err(|e: io::Error| {
            let problem = match e.kind() {
                ErrorKind::AddrInUse => {
                    format!(
                        "the port is in use; name another by {option}, or take any free one by {option} 0"
                    )
                }
                ErrorKind::PermissionDenied => {
                    format!("the port is reserved; name one above 1023 by {option}")
                }
                ErrorKind::AddrNotAvailable => {
                    "this machine has no such address; leave out --host, or name one it has".into()
                }
                _ => format!("{e}; leave out --host, or name an address of this machine"),
            };
            ListenError { address: format!("{host}:{port}"), problem }
        })
    }

    /// Listener of a socket that is already bound.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn of(listener: TcpListener) -> io::Result<Self> {
        // The runtime requires a non-blocking socket.
        listener.set_nonblocking(true)?;
        Ok(Self { address: listener.local_addr()?, listener })
    }

    /// Address of the socket.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers every request, within the runtime that this is called in, until the runtime ends.
    ///
    /// # Errors
    /// An I/O error when the system closes the socket.
    pub async fn serve<A, F>(self, answer: A) -> io::Result<()>
    where
        A: Fn(Request) -> F + Clone + Send + Sync + 'static,
        F: Future<Output = Answer> + Send + 'static,
    {
        let is_local = self.address.ip().is_loopback();
        let router = Router::new().fallback(move |request: Request| {
            let asked = (!is_local || names_loopback(request.headers())).then(|| answer(request));
            async move {
                let answer = match asked {
                    Some(answer) => answer.await,
                    None => Answer::error(403, "this server answers to localhost and 127.0.0.1 alone"),
                };
                Response::<Body>::from(answer)
            }
        });
        axum::serve(tokio::net::TcpListener::from_std(self.listener)?, router).await
    }
}

/// Tells whether the `Host`, with or without a port, names the loopback.
fn names_loopback(headers: &HeaderMap) -> bool {
    let Some(host) = headers.get(HOST).and_then(|value| value.to_str().ok()) else { return false };
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next(),
        None => host.split(':').next(),
    };
    name.is_some_and(|name| {
        ["127.0.0.1", "localhost", "::1"].iter().any(|own| name.eq_ignore_ascii_case(own))
    })
}
