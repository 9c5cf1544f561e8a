//! Server of the page: one project, on the loopback unless told otherwise, and then with a token.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

use axum::Router;
use axum::extract::{Path, State};
use axum::routing::{get, post, put};
use shell::files::FileError;
use shell::loopback::{Answer, JsonBody, Listener, PageFile, Protection};

use super::page::FILES;
use super::session::{EpipolarRequest, ResidualsRequest, SaveRequest, Session};
use super::work;
use crate::{Error, Result};

/// A page of picks that listens.
pub struct Server(Listener);

impl Server {
    /// Listens on an address of this machine, by name or number; port 0 is any free one. Beyond the loopback, requests need
    /// a token, which [`link`](Self::link) carries.
    ///
    /// # Errors
    /// [`Error::Room`] with one line: an address that is not this machine's, a port in use, files of the protection that
    /// cannot be used.
    pub fn bind(host: &str, port: u16, protection: &Protection) -> Result<Self> {
        let bound = Listener::bind(host, port, "--port").and_then(|listener| listener.protected(protection));
        bound.map(Self).map_err(|e| Error::Room(e.to_string()))
    }

    /// Address of the page, with the token if there is one, for a person to open.
    pub fn link(&self) -> String {
        self.0.link()
    }

    /// Address of the socket.
    pub fn address(&self) -> SocketAddr {
        self.0.address()
    }

    /// Starts the work on the captures, and answers pages until the process ends.
    ///
    /// # Errors
    /// An I/O error when the system closes the socket.
    pub fn run(self, session: Arc<Session>) -> io::Result<()> {
        work::start_captures(&session);
        self.serve(session)
    }

    /// Answers pages of a session whose work is not started here.
    pub(super) fn serve(self, session: Arc<Session>) -> io::Result<()> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        runtime.block_on(self.0.serve(routes(session)))
    }
}

type SharedSession = State<Arc<Session>>;

/// Routes of the page: its files, and what its scripts ask for.
fn routes(session: Arc<Session>) -> Router {
    PageFile::routes(&FILES)
        .route(
            "/project.json",
            get(|State(s): SharedSession| on_worker(s, |s| Answer::json(&s.described()?))),
        )
        .route("/state.json", get(|State(s): SharedSession| on_worker(s, |s| Answer::json(&s.progress()))))
        .route(
            "/reference/{name}",
            get(|State(s): SharedSession, Path(name): Path<String>| on_worker(s, move |s| s.picture(&name))),
        )
        .route(
            "/epipolar",
            post(|State(s): SharedSession, JsonBody(asked): JsonBody<EpipolarRequest>| {
                on_worker(s, move |s| Answer::json(&s.epipolar(&asked)?))
            }),
        )
        .route(
            "/residuals",
            post(|State(s): SharedSession, JsonBody(asked): JsonBody<ResidualsRequest>| {
                on_worker(s, move |s| Answer::json(&s.residuals(&asked)?))
            }),
        )
        .route(
            "/project",
            put(|State(s): SharedSession, JsonBody(asked): JsonBody<SaveRequest>| {
                on_worker(s, move |s| Answer::json(&s.save(&asked)?))
            }),
        )
        .route(
            "/build",
            post(|State(s): SharedSession, JsonBody(_): JsonBody<Nothing>| {
                on_worker(s, |s| {
                    work::start_build(s)?;
                    Answer::json(&s.progress())
                })
            }),
        )
        .route("/built/plan", get(|State(s): SharedSession| on_worker(s, |s| s.built_picture(None))))
        .route(
            "/built/preview/{name}",
            get(|State(s): SharedSession, Path(name): Path<String>| {
                on_worker(s, move |s| s.built_picture(Some(&name)))
            }),
        )
        .route(
            "/zones",
            post(|State(s): SharedSession, JsonBody(_): JsonBody<Nothing>| {
                on_worker(s, |s| Answer::json(&s.zones()?))
            }),
        )
        .with_state(session)
}

/// A question without content.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

/// Answers on a worker thread: files and geometry take their time; meanwhile other requests are accepted.
async fn on_worker(
    session: Arc<Session>,
    answer: impl FnOnce(&Arc<Session>) -> std::result::Result<Answer, Answer> + Send + 'static,
) -> std::result::Result<Answer, Answer> {
    let answered = tokio::task::spawn_blocking(move || answer(&session)).await;
    answered.unwrap_or_else(|e| Err(Answer::error(500, &e.to_string())))
}

impl From<Error> for Answer {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Changed(_) => 409,
            Error::File(FileError::Content { .. }) | Error::Room(_) | Error::Capture { .. } => 422,
            _ => 500,
        };
        Self::error(status, &error.to_string())
    }
}
