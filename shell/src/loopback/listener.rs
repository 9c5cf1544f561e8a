//! Socket of a server, and the check of who may send requests.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::sync::Arc;

use axum::Router;
use axum::extract::Request;
use axum::http::Uri;
use axum::http::header::ALLOW;
use axum::middleware::{Next, from_fn, map_response};
use axum::response::{IntoResponse, Response};
use rustls::ServerConfig;

use super::Answer;
use super::access::{self, AccessToken};
use super::answer::with_common_headers;
use super::connections;

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
    socket: TcpListener,
    address: SocketAddr,
    token: Option<AccessToken>,
    tls: Option<Arc<ServerConfig>>,
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
        Ok(Self { address: listener.local_addr()?, socket: listener, token: None, tls: None })
    }

    /// Listener that answers only requests that know a token: from a link at first, from a cookie afterwards.
    #[must_use]
    pub fn with_token(self, token: AccessToken) -> Self {
        Self { token: Some(token), ..self }
    }

    /// Listener that speaks TLS with a certificate chain and its private key, both in PEM form.
    ///
    /// # Errors
    /// [`ListenError`] with the file and the mend.
    pub fn with_tls(self, certificate: &Path, key: &Path) -> Result<Self, ListenError> {
        Ok(Self { tls: Some(access::tls(certificate, key)?), ..self })
    }

    /// Whether requests need a token.
    pub fn has_token(&self) -> bool {
        self.token.is_some()
    }

    /// Address of the page, with the token if there is one, for a person to open.
    pub fn link(&self) -> String {
        let scheme = if self.tls.is_some() { "https" } else { "http" };
        let origin = format!("{scheme}://{}", self.address);
        self.token.as_ref().map_or_else(|| format!("{origin}/"), |token| token.link(&origin))
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
        let Self { socket, address, token, tls } = self;
        let is_local = address.ip().is_loopback();
        let is_tls = tls.is_some();
        let not_found =
            |uri: Uri| async move { Answer::error(404, &format!("there is no {} here", uri.path())) };
        let router = Router::new()
            // The layers are around the whole router, since it names a path's methods outside of its own layers.
            .fallback_service(routes.fallback(not_found))
            .layer(from_fn(explain_other_method))
            .layer(from_fn(connections::with_whole_body))
            .layer(from_fn(move |request: Request, next: Next| {
                let token = token.clone();
                async move {
                    if is_local && !access::names_this_machine(&request, address.ip()) {
                        let line = "this server answers to localhost and 127.0.0.1 alone";
                        Answer::error(403, line).into_response()
                    } else if !access::is_of_own_page(request.headers()) {
                        Answer::error(403, "this server answers to its own pages alone").into_response()
                    } else if let Some(token) = token {
                        access::require_token(&token, address.port(), is_tls, request, next).await
                    } else {
                        next.run(request).await
                    }
                }
            }))
            .layer(map_response(with_common_headers));
        connections::serve(tokio::net::TcpListener::from_std(socket)?, router, tls).await
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
