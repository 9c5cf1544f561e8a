//! HTTP server of the page, on a thread of its own; for this machine alone, or for others that know its token.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::extract::{Path, RawQuery, Request, State};
use axum::middleware::{Next, from_fn};
use axum::routing::get;
use scenes::room::Room;
use scenes::space::{SOLIDS_SCRIPT, SPACE_SCRIPT, SPACE_STYLE, SURFACES_TYPE};
use shell::loopback::{Answer, Listener, PageFile};
use tokio::runtime::Builder;
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::spawn_blocking;
use tokio::time::{sleep, timeout};

use super::feed::{FeedFrame, FrameRing, LiveFeed, WAITING_FRAMES};
use super::{RoomPage, Screens};
use crate::Error;
use crate::events::Clock;

/// Files of the page.
const FILES: [PageFile; 12] = [
    PageFile::html("/", include_str!("page/index.html")),
    PageFile::svg("/icon.svg", include_str!("page/icon.svg")),
    PageFile::PALETTE,
    PageFile::css("/style.css", include_str!("page/style.css")),
    PageFile::script("/view.js", include_str!("page/view.js")),
    PageFile::script("/recent.js", include_str!("page/recent.js")),
    PageFile::script("/pictures.js", include_str!("page/pictures.js")),
    PageFile::script("/plan.js", include_str!("page/plan.js")),
    PageFile::script("/run_scene.js", include_str!("page/run_scene.js")),
    SPACE_STYLE,
    SPACE_SCRIPT,
    SOLIDS_SCRIPT,
];
/// Default port, unless another program uses it.
const PORT: u16 = 8081;
/// Longest wait for news before a request is answered all the same, so that the page knows that the run goes on.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time after a request during which its viewer still counts.
const WATCHING: Duration = Duration::from_secs(15);
/// After the end of the run the server goes on until it has been quiet for this time…
const QUIET: Duration = Duration::from_millis(500);
/// …but no longer than this.
const LONGEST_FAREWELL: Duration = Duration::from_secs(3);

/// Server of the screens; it runs until it is dropped.
#[derive(Debug)]
pub struct Server {
    screens: Screens,
    address: SocketAddr,
    link: String,
    cameras: Vec<String>,
    /// Frames for the page's thread, until the end is announced.
    feed: Option<mpsc::Sender<FeedFrame>>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Binds an address of this machine with this port (0: any free one), or with the default one or, where that is in
    /// use, any other. `option` is the option of the port, which the error names.
    ///
    /// # Errors
    /// [`crate::Error::Listen`] for an address that is not this machine's, or a port that is in use or reserved.
    pub fn bind(host: &str, port: Option<u16>, option: &str) -> crate::Result<Listener> {
        let bind = |port| Listener::bind(host, port, option);
        Ok(match port {
            Some(port) => bind(port)?,
            None => bind(PORT).or_else(|_| bind(0))?,
        })
    }

    /// Starts answering requests. `cameras` are the names of the run's cameras.
    ///
    /// # Errors
    /// A listener that other machines can reach and that needs no token; an error of the operating system that prevents
    /// the thread or its event loop.
    pub fn start(
        listener: Listener,
        screens: Screens,
        room: RoomPage,
        cameras: Vec<String>,
    ) -> crate::Result<Self> {
        let (address, link) = (listener.address(), listener.link());
        if !address.ip().is_loopback() && !listener.has_token() {
            let problem = format!("{address} can be reached by other machines; it needs a token");
            return Err(Error::option("view_host", problem));
        }
        let refused = |e: std::io::Error| Error::option("view", format!("{e}; run without it"));
        // One picture is encoded at a time, so that the other cores stay with the tracker.
        let runtime =
            Builder::new_current_thread().enable_all().max_blocking_threads(1).build().map_err(refused)?;
        let (end, ended) = oneshot::channel();
        let (feed, frames) = mpsc::channel(WAITING_FRAMES);
        let state =
            PageState { screens: screens.clone(), room: Arc::new(room), ring: watch::Sender::default() };
        let serve = move || {
            super::yield_to_tracker();
            runtime.block_on(serve(listener, state, frames, ended));
            // Clients that do not read their answers are disconnected.
            runtime.shutdown_background();
        };
        let thread = thread::Builder::new().name("view".into()).spawn(serve).map_err(refused)?;
        Ok(Self { screens, address, link, cameras, feed: Some(feed), end: Some(end), thread: Some(thread) })
    }

    /// Output of a run that feeds the page; `None` after the end was announced.
    pub fn feed(&self, room: &Room, clock: Option<Clock>) -> Option<LiveFeed> {
        Some(LiveFeed::new(self.feed.clone()?, room, self.cameras.clone(), clock))
    }

    /// Address of the page for a person to open, with the token if there is one.
    pub fn link(&self) -> &str {
        &self.link
    }

    /// Address of the server.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Screens that it serves.
    pub fn screens(&self) -> &Screens {
        &self.screens
    }

    /// Informs viewers that the run has ended. The last pictures can still be fetched while the program goes on, and
    /// for a moment when this is dropped.
    pub fn announce_end(&mut self) {
        drop(self.feed.take());
        if let Some(end) = self.end.take() {
            self.screens.end();
            // A server whose socket the system closed has already reported it.
            let _ = end.send(());
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.announce_end();
        if let Some(thread) = self.thread.take() {
            // A failure of the thread has already been reported.
            let _ = thread.join();
        }
    }
}

/// State of the page, shared by its routes.
#[derive(Clone)]
struct PageState {
    screens: Screens,
    room: Arc<RoomPage>,
    ring: watch::Sender<FrameRing>,
}

/// Time of the latest request or answer.
type LastActivity = Arc<Mutex<Option<Instant>>>;

/// Serves until the end has been announced.
async fn serve(
    listener: Listener,
    state: PageState,
    mut frames: mpsc::Receiver<FeedFrame>,
    ended: oneshot::Receiver<()>,
) {
    let last_activity = LastActivity::default();
    let ring = state.ring.clone();
    let answers = listener.serve(routes(state, Arc::clone(&last_activity)));
    tokio::spawn(async move {
        while let Some(frame) = frames.recv().await {
            ring.send_modify(|ring| ring.push(&frame));
        }
        ring.send_modify(|ring| ring.has_ended = true);
    });
    tokio::spawn(async {
        if let Err(e) = answers.await {
            tracing::warn!("the page is served no longer: {e}");
        }
    });
    // The end also comes when its sender is dropped.
    let _ = ended.await;
    farewell(&last_activity).await;
}

fn set_now(last_activity: &LastActivity) {
    *last_activity.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
}

/// Waits until the viewers have received the end.
async fn farewell(last_activity: &LastActivity) {
    let silence = || last_activity.lock().unwrap_or_else(PoisonError::into_inner).map(|at| at.elapsed());
    if silence().is_none_or(|silence| silence > WATCHING) {
        return;
    }
    let end = Instant::now();
    let mut rest = QUIET;
    while !rest.is_zero() && end.elapsed() < LONGEST_FAREWELL {
        sleep(rest).await;
        rest = silence().map_or(Duration::ZERO, |silence| QUIET.saturating_sub(silence));
    }
}

/// Routes of the page; they record the time of each request and answer.
fn routes(state: PageState, last_activity: LastActivity) -> Router {
    PageFile::routes(&FILES)
        .route("/moment", get(moment))
        .route("/camera/{file}", get(picture))
        .route("/frames", get(frames))
        .route("/room.json", get(async |State(state): State<PageState>| description(&state.room)))
        .route("/plan.jpg", get(async |State(state): State<PageState>| part("image/jpeg", &state.room.plan)))
        .route(
            "/surfaces",
            get(async |State(state): State<PageState>| part(SURFACES_TYPE, &state.room.surfaces)),
        )
        .with_state(state)
        .layer(from_fn(move |request: Request, next: Next| {
            let last_activity = Arc::clone(&last_activity);
            async move {
                set_now(&last_activity);
                let answer = next.run(request).await;
                set_now(&last_activity);
                answer
            }
        }))
}

/// The present state; with `after=17`, as soon as the state has another number.
async fn moment(
    State(PageState { screens, .. }): State<PageState>,
    RawQuery(query): RawQuery,
) -> Result<Answer, Answer> {
    if let Some(after) = query.as_deref().and_then(after) {
        let mut news = screens.wait();
        // Not "greater": the page may have been open since another run.
        let _ = timeout(PATIENCE, news.wait_for(|now| now.number != after || now.has_ended)).await;
    }
    screens.look(Answer::json)
}

/// The newest frames; with `after=17`, those after the 17th, as soon as there is one.
async fn frames(State(state): State<PageState>, RawQuery(query): RawQuery) -> Answer {
    let after = query.as_deref().and_then(after).unwrap_or(0);
    let mut news = state.ring.subscribe();
    let _ = timeout(PATIENCE, news.wait_for(|ring| ring.number != after || ring.has_ended)).await;
    let body = news.borrow().since(after);
    Answer::ok("application/json", body)
}

/// Description of the room.
fn description(room: &RoomPage) -> Result<Answer, Answer> {
    part("application/json", &room.description)
}

/// A part of the page that not every room has.
fn part(media_type: &'static str, bytes: &Bytes) -> Result<Answer, Answer> {
    if bytes.is_empty() {
        return Err(Answer::error(404, "this room has none"));
    }
    Ok(Answer::ok(media_type, bytes.clone()))
}

/// Picture of a camera: `0.jpg` is the first camera's.
async fn picture(
    State(PageState { screens, .. }): State<PageState>,
    Path(file): Path<String>,
) -> Result<Answer, Answer> {
    let camera = file.strip_suffix(".jpg").and_then(|number| number.parse().ok());
    let picture = camera.and_then(|camera| screens.look(|now| now.picture(camera)));
    let picture = picture.ok_or_else(|| Answer::error(404, "that camera has no picture yet"))?;
    let jpeg = spawn_blocking(move || picture.jpeg()).await.unwrap_or_default();
    if jpeg.is_empty() {
        return Err(Answer::error(500, "the picture cannot be encoded"));
    }
    Ok(Answer::ok("image/jpeg", jpeg))
}

/// The number in `after=17`.
fn after(query: &str) -> Option<u64> {
    query.split('&').find_map(|part| part.strip_prefix("after="))?.parse().ok()
}
