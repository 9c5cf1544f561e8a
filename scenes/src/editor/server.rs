//! Server of the editor: one room, on the loopback unless told otherwise, and then with a token.
//!
//! A request that changes or queries something has to come as JSON ([`JsonBody`]), which a browser does not send across
//! sites without a preflight request; that request is answered by 405.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

use axum::Router;
use axum::extract::{Path, State};
use axum::routing::{get, post, put};

use super::page::FILES;
use super::picture::Picture;
use super::session::{OutlinesRequest, PlaceRequest, SaveRequest, Session};
use crate::Error;
use crate::space::SURFACES_TYPE;
use shell::loopback::{Answer, JsonBody, Listener, PageFile, Protection};

/// Largest number of corners in one request.
const MOST_CORNERS: usize = 5000;

/// An editor that listens.
pub struct Server(Listener);

impl Server {
    /// Listens on an address of this machine, by name or number; port 0 is any free one. Beyond the loopback, requests need
    /// a random token, which [`link`](Self::link) carries.
    ///
    /// # Errors
    /// [`Error::Listen`] when the address is not this machine's, or the port is in use or reserved, and for files of the
    /// protection that cannot be used.
    pub fn bind(host: &str, port: u16, protection: &Protection) -> crate::Result<Self> {
        Ok(Self(Listener::bind(host, port, "--port")?.protected(protection)?))
    }

    /// Address of the page, with the token if there is one, for a person to open.
    pub fn link(&self) -> String {
        self.0.link()
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
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        runtime.block_on(self.0.serve(routes(Arc::new(session))))
    }
}

type SharedSession = State<Arc<Session>>;

/// Routes of the editor: the page's files, and what its scripts ask for.
fn routes(session: Arc<Session>) -> Router {
    PageFile::routes(&FILES)
        .route(
            "/room.json",
            get(|State(session): SharedSession| on_worker(session, |s| Answer::json(&s.room()?))),
        )
        .route(
            "/plan.png",
            get(|State(session): SharedSession| {
                on_worker(session, |s| Ok(picture_answer(s.editor_room().plan())))
            }),
        )
        .route(
            "/camera/{name}",
            get(|State(session): SharedSession, Path(name): Path<String>| {
                on_worker(session, move |s| Ok(picture_answer(&*s.editor_room().picture(&name)?)))
            }),
        )
        .route(
            "/surfaces",
            get(|State(session): SharedSession| {
                on_worker(session, |s| Ok(Answer::ok(SURFACES_TYPE, s.editor_room().surfaces().to_vec())))
            }),
        )
        .route(
            "/outlines",
            post(|State(session): SharedSession, JsonBody(asked): JsonBody<OutlinesRequest>| {
                on_worker(session, move |s| {
                    if asked.corners() > MOST_CORNERS {
                        let line = format!("more than {MOST_CORNERS} corners; draw fewer");
                        return Err(Answer::error(400, &line));
                    }
                    Answer::json(&s.editor_room().outlines(&asked))
                })
            }),
        )
        .route(
            "/place",
            post(|State(session): SharedSession, JsonBody(asked): JsonBody<PlaceRequest>| {
                on_worker(session, move |s| Answer::json(&s.editor_room().place(&asked)?))
            }),
        )
        .route(
            "/drawing",
            put(|State(session): SharedSession, JsonBody(asked): JsonBody<SaveRequest>| {
                on_worker(session, move |s| Answer::json(&s.save(&asked)?))
            }),
        )
        .with_state(session)
}

/// Answers on a worker thread: files, rays and pictures take their time; meanwhile other requests are accepted.
async fn on_worker(
    session: Arc<Session>,
    answer: impl FnOnce(&Session) -> Result<Answer, Answer> + Send + 'static,
) -> Result<Answer, Answer> {
    let answered = tokio::task::spawn_blocking(move || answer(&session)).await;
    answered.unwrap_or_else(|e| Err(Answer::error(500, &e.to_string())))
}

fn picture_answer(picture: &Picture) -> Answer {
    Answer::ok(picture.media_type, picture.bytes.clone())
}

impl From<Error> for Answer {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Conflict { .. } => 409,
            Error::Room { .. } => 422,
            Error::UnknownCamera { .. } => 404,
            _ => 500,
        };
        Self::error(status, &error.to_string())
    }
}
