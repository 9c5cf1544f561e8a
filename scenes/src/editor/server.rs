//! Server of the zone editor: one room, HTTP, on the loopback unless told otherwise.
//!
//! A request that changes or queries something has to come as JSON, which a browser does not send across sites without
//! a preflight request; that request is answered by 405.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

use axum::body::{Bytes, to_bytes};
use axum::extract::Request;
use axum::http::header::CONTENT_TYPE;
use axum::http::request::Parts;
use serde::de::DeserializeOwned;

use super::page::FILES;
use super::session::{OutlinesRequest, PlaceRequest, Session, ZonesRequest};
use crate::Error;
use shell::loopback::{Answer, Listener, PageFile};

/// Largest body that is read.
const MOST_BODY_BYTES: usize = 1 << 20;
/// Largest number of corners in one request.
const MOST_CORNERS: usize = 5000;
const JSON: &str = "application/json";

/// A zone editor that listens.
pub struct Server(Listener);

impl Server {
    /// Listens on an address of this machine, by name or number; port 0 is any free one.
    ///
    /// # Errors
    /// [`Error::Listen`] when the address is not this machine's, or the port is in use or reserved.
    pub fn bind(host: &str, port: u16) -> crate::Result<Self> {
        Ok(Self(Listener::bind(host, port, "--port")?))
    }

    /// Address of the socket.
    pub fn address(&self) -> SocketAddr {
        self.0.address()
    }

    /// Answers pages that edit this room until the process ends.
    ///
    /// # Errors
    /// An I/O error when the system closes the socket.
    pub fn run(self, session: Session) -> io::Result<()> {
        let session = Arc::new(session);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
        runtime.block_on(self.0.serve(move |request| serve(Arc::clone(&session), request)))
    }
}

async fn serve(session: Arc<Session>, request: Request) -> Answer {
    let answer = match accepted(request).await {
        // Files, rays and pictures take their time; meanwhile other requests are accepted.
        Ok((route, body)) => tokio::task::spawn_blocking(move || answer(&session, route, &body))
            .await
            .unwrap_or_else(|e| Err(Answer::error(500, &e.to_string()))),
        Err(refusal) => Err(refusal),
    };
    answer.unwrap_or_else(|refusal| refusal)
}

/// Route of a request, with its body if the route takes one; or the answer that refuses the request.
async fn accepted(request: Request) -> Result<(EditorRoute, Bytes), Answer> {
    let (head, body) = request.into_parts();
    let path = head.uri.path();
    let route = EditorRoute::of(path).ok_or_else(|| Answer::not_found(path))?;
    let allow = route.methods();
    if !allow.split(", ").any(|method| method == head.method.as_str()) {
        return Err(Answer::other_method(path, allow));
    }
    if !route.takes_body() {
        return Ok((route, Bytes::new()));
    }
    if !is_json(&head) {
        return Err(Answer::error(415, "the body has to be JSON, with `Content-Type: application/json`"));
    }
    // A body a little too large is read to its end, so that the client reads the answer.
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

fn answer(session: &Session, route: EditorRoute, body: &[u8]) -> Result<Answer, Answer> {
    match route {
        EditorRoute::Page(file) => Ok(Answer::file(file)),
        EditorRoute::Room => Answer::json(&session.room()?),
        EditorRoute::Plan => {
            let editor_room = session.editor_room();
            Ok(Answer::ok(editor_room.plan().media_type, editor_room.plan().bytes.clone()))
        }
        EditorRoute::Camera(name) => {
            let picture = session.editor_room().picture(&name)?;
            Ok(Answer::ok(picture.media_type, picture.bytes.clone()))
        }
        EditorRoute::Outlines => {
            let asked: OutlinesRequest = parsed(body)?;
            if asked.corners() > MOST_CORNERS {
                return Err(Answer::error(400, &format!("more than {MOST_CORNERS} corners; draw fewer")));
            }
            Answer::json(&session.editor_room().outlines(&asked))
        }
        EditorRoute::Place => Answer::json(&session.editor_room().place(&parsed::<PlaceRequest>(body)?)?),
        EditorRoute::Zones => Answer::json(&session.save(parsed::<ZonesRequest>(body)?)?),
    }
}

fn parsed<T: DeserializeOwned>(body: &[u8]) -> Result<T, Answer> {
    serde_json::from_slice(body).map_err(|e| Answer::error(400, &format!("the body is not understood: {e}")))
}

/// Routes of the server.
enum EditorRoute {
    Page(&'static PageFile),
    Room,
    Plan,
    Camera(String),
    Outlines,
    Place,
    Zones,
}

impl EditorRoute {
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

    /// Methods of the route, as in an `Allow` header.
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

/// Decodes the percent escapes of a part of a URL's path.
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
