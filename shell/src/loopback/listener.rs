//! Socket of a server, and the check of who may send requests.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};

use axum::Router;
use axum::extract::Request;
use axum::http::header::{ALLOW, HOST};
use axum::http::{HeaderMap, Uri};
use axum::middleware::{Next, from_fn, map_response};
use axum::response::{IntoResponse, Response};

use super::Answer;
use super::answer::with_common_headers;

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

    /// Answers requests by these routes, within the runtime that this is called in, until the runtime ends. A path
    /// without a route is answered by 404, a method that its route does not take by 405.
    ///
    /// # Errors
    /// An I/O error when the system closes the socket.
    pub async fn serve(self, routes: Router) -> io::Result<()> {
        let is_local = self.address.ip().is_loopback();
        let not_found =
            |uri: Uri| async move { Answer::error(404, &format!("there is no {} here", uri.path())) };
        let router = Router::new()
            // The layers are around the whole router, since it names a path's methods outside of its own layers.
            .fallback_service(routes.fallback(not_found))
            .layer(from_fn(explain_other_method))
            .layer(from_fn(move |request: Request, next: Next| async move {
                if !is_local || names_loopback(request.headers()) {
                    next.run(request).await
                } else {
                    Answer::error(403, "this server answers to localhost and 127.0.0.1 alone").into_response()
                }
            }))
            .layer(map_response(with_common_headers));
        axum::serve(tokio::net::TcpListener::from_std(self.listener)?, router).await
    }
}

/// Gives the router's answer 405 a line for a person, with the methods that the path takes.
async fn explain_other_method(request: Request, next: Next) -> Response {
    let path = request.uri().path().to_owned();
    let response = next.run(request).await;
    match response.headers().get(ALLOW).and_then(|methods| methods.to_str().ok()) {
        Some(methods) => {
            let methods = methods.replace(',', ", ");
            let line = format!("{path} is for {methods}");
            ([(ALLOW, methods)], Answer::error(405, &line)).into_response()
        }
        None => response,
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
