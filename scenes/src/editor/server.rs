//! The server of the zone editor: one room, HTTP, on the loopback unless told otherwise.
//!
//! A page of another site must not reach it. So on the loopback the `Host` has to be the loopback's (a name that somebody
//! else's DNS turns to 127.0.0.1 is refused), and what changes or asks something has to come as JSON, which a browser
//! does not send across sites without asking first; that question is answered by 405.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;

use axum::Router;
use axum::body::{Body, Bytes, to_bytes};
use axum::extract::Request;
use axum::http::header::{ALLOW, CONTENT_TYPE, HOST};
use axum::http::request::Parts;
use axum::http::{HeaderName, HeaderValue, Response, StatusCode};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::page::{FILES, PageFile};
use super::session::{OutlinesRequest, PlaceRequest, Session, ZonesRequest};
use crate::Error;

/// The largest body that is read.
const MOST_BODY_BYTES: usize = 1 << 20;
/// The most corners in one question.
const MOST_CORNERS: usize = 5000;
/// For every answer: nothing is kept by the browser, taken for another type, framed, or loaded from elsewhere.
const HEADERS: [(&str, &str); 4] = [
    ("cache-control", "no-store"),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
];
const JSON: &str = "application/json";

/// A zone editor that listens.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
}

impl Server {
    /// Listens on an address of this machine, by name or number; port 0 is any free one.
    ///
    /// # Errors
    /// [`Error::Listen`] when the address is not this machine's, or the port is in use or reserved.
    pub fn bind(host: &str, port: u16) -> crate::Result<Self> {
        let listen = || {
            let listener = TcpListener::bind((host, port))?;
            // What the runtime asks of a socket that it takes over.
            listener.set_nonblocking(true)?;
            Ok(Self { address: listener.local_addr()?, listener })
        };
        listen().map_err(|e: io::Error| {
            let problem = match e.kind() {
                ErrorKind::AddrInUse => {
                    "the port is in use; name another by --port, or take any free one by --port 0".into()
                }
                ErrorKind::PermissionDenied => "the port is reserved; name one above 1023 by --port".into(),
                ErrorKind::AddrNotAvailable => {
                    "this machine has no such address; leave out --host, or name one it has".into()
                }
                _ => format!("{e}; leave out --host, or name an address of this machine"),
            };
            Error::Listen { address: format!("{host}:{port}"), problem }
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers pages that edit this room until the process ends.
    ///
    /// # Errors
    /// When the system takes the socket away.
    pub fn run(self, session: Session) -> io::Result<()> {
        let session = Arc::new(session);
        let is_local = self.address.ip().is_loopback();
        let router =
            Router::new().fallback(move |request: Request| serve(is_local, Arc::clone(&session), request));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(self.listener)?;
            axum::serve(listener, router).await
        })
    }
}

async fn serve(is_local: bool, session: Arc<Session>, request: Request) -> Response<Body> {
    let answer = match accepted(is_local, request).await {
        // Files, rays and pictures take their time; meanwhile others are listened to.
        Ok((route, body)) => tokio::task::spawn_blocking(move || answer(&session, route, &body))
            .await
            .unwrap_or_else(|e| Err(Answer::error(500, &e.to_string()))),
        Err(refusal) => Err(refusal),
    };
    answer.unwrap_or_else(|refusal| refusal).into()
}

/// What is asked for, with the body if there is to be one; or why the request is refused.
async fn accepted(is_local: bool, request: Request) -> Result<(Route, Bytes), Answer> {
    let (head, body) = request.into_parts();
    let header = |name| head.headers.get(name).and_then(|value: &HeaderValue| value.to_str().ok());
    if is_local && !header(HOST).is_some_and(is_loopback) {
        return Err(Answer::error(403, "this server answers to localhost and 127.0.0.1 alone"));
    }
    let path = head.uri.path();
    let route = Route::of(path).ok_or_else(|| Answer::error(404, &format!("there is no {path} here")))?;
    let allow = route.methods();
    if !allow.split(", ").any(|method| method == head.method.as_str()) {
        return Err(Answer { allow, ..Answer::error(405, &format!("{path} is for {allow}")) });
    }
    if !route.takes_body() {
        return Ok((route, Bytes::new()));
    }
    if !is_json(&head) {
        return Err(Answer::error(415, "the body has to be JSON, with `Content-Type: application/json`"));
    }
    // Whoever sends a little too much is heard out, to read the answer.
    match to_bytes(body, 2 * MOST_BODY_BYTES).await {
        Ok(bytes) if bytes.len() <= MOST_BODY_BYTES => Ok((route, bytes)),
        Ok(_) => Err(Answer::error(413, "the body is larger than 1 MiB; draw fewer corners")),
        Err(e) => Err(Answer::error(413, &format!("the body is larger than 1 MiB, or ends early: {e}"))),
    }
}

fn is_json(head: &Parts) -> bool {
    let media_type = head.headers.get(CONTENT_TYPE).and_then(|value| value.to_str().ok()?.split(';').next());
    media_type.is_some_and(|media_type| media_type.trim().eq_ignore_ascii_case(JSON))
}

fn answer(session: &Session, route: Route, body: &[u8]) -> Result<Answer, Answer> {
    match route {
        Route::Page(file) => Ok(Answer::ok(file.media_type, file.text.as_bytes().to_vec())),
        Route::Room => Answer::json(&session.room()?),
        Route::Plan => {
            let stage = session.stage();
            Ok(Answer::ok(stage.plan().media_type, stage.plan().bytes.clone()))
        }
        Route::Camera(name) => {
            let picture = session.stage().picture(&name)?;
            Ok(Answer::ok(picture.media_type, picture.bytes.clone()))
        }
        Route::Outlines => {
            let asked: OutlinesRequest = parsed(body)?;
            if asked.corners() > MOST_CORNERS {
                return Err(Answer::error(400, &format!("more than {MOST_CORNERS} corners; draw fewer")));
            }
            Answer::json(&session.stage().outlines(&asked))
        }
        Route::Place => Answer::json(&session.stage().place(&parsed::<PlaceRequest>(body)?)?),
        Route::Zones => Answer::json(&session.save(parsed::<ZonesRequest>(body)?)?),
    }
}

fn parsed<T: DeserializeOwned>(body: &[u8]) -> Result<T, Answer> {
    serde_json::from_slice(body).map_err(|e| Answer::error(400, &format!("the body is not understood: {e}")))
}

/// What there is to ask for.
enum Route {
    Page(&'static PageFile),
    Room,
    Plan,
    Camera(String),
    Outlines,
    Place,
    Zones,
}

impl Route {
    fn of(path: &str) -> Option<Self> {
        if let Some(file) = FILES.iter().find(|file| file.path == path) {
            return Some(Self::Page(file));
        }
        match path {
            "/room.json" => Some(Self::Room),
            "/plan.png" => Some(Self::Plan),
            "/outlines" => Some(Self::Outlines),
            "/place" => Some(Self::Place),
            "/zones" => Some(Self::Zones),
            _ => path.strip_prefix("/camera/").and_then(percent_decoded).map(Self::Camera),
        }
    }

    /// As in an `Allow` header.
    fn methods(&self) -> &'static str {
        match self {
            Self::Page(_) | Self::Room | Self::Plan | Self::Camera(_) => "GET, HEAD",
            Self::Outlines | Self::Place => "POST",
            Self::Zones => "PUT",
        }
    }

    fn takes_body(&self) -> bool {
        matches!(self, Self::Outlines | Self::Place | Self::Zones)
    }
}

/// What goes back.
struct Answer {
    status: u16,
    media_type: &'static str,
    /// The methods there are, where another was tried.
    allow: &'static str,
    body: Vec<u8>,
}

impl Answer {
    fn ok(media_type: &'static str, body: Vec<u8>) -> Self {
        Self { status: 200, media_type, allow: "", body }
    }

    fn json(value: &impl Serialize) -> Result<Self, Self> {
        match serde_json::to_vec(value) {
            Ok(body) => Ok(Self::ok(JSON, body)),
            Err(e) => Err(Self::error(500, &e.to_string())),
        }
    }

    /// One line, for a person.
    fn error(status: u16, line: &str) -> Self {
        let body = serde_json::json!({ "error": line }).to_string().into_bytes();
        Self { status, ..Self::ok(JSON, body) }
    }
}

impl From<Error> for Answer {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Changed { .. } => 409,
            Error::Room { .. } => 422,
            Error::UnknownCamera { .. } => 404,
            _ => 500,
        };
        Self::error(status, &error.to_string())
    }
}

impl From<Answer> for Response<Body> {
    fn from(answer: Answer) -> Self {
        let mut response = Self::new(answer.body.into());
        // Each of them is a constant of this file.
        *response.status_mut() = StatusCode::from_u16(answer.status).unwrap_or_default();
        let own = [(CONTENT_TYPE, answer.media_type), (ALLOW, answer.allow)];
        let common = HEADERS.map(|(name, value)| (HeaderName::from_static(name), value));
        for (name, value) in own.into_iter().chain(common).filter(|(_, value)| !value.is_empty()) {
            response.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        response
    }
}

/// Whether a `Host` header, with or without a port, names the loopback.
fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next(),
        None => host.split(':').next(),
    };
    name.is_some_and(|name| {
        ["127.0.0.1", "localhost", "::1"].iter().any(|own| name.eq_ignore_ascii_case(own))
    })
}

/// A part of a URL's path as it was before it was escaped.
fn percent_decoded(part: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(part.len());
    let mut rest = part.as_bytes();
    while let [first, after @ ..] = rest {
        rest = after;
        if *first != b'%' {
            bytes.push(*first);
            continue;
        }
        let (digits, after) = after.split_first_chunk::<2>()?;
        bytes.push(u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?);
        rest = after;
    }
    String::from_utf8(bytes).ok()
}
