//! HTTP server of the page, for this machine alone, on a thread of its own.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::{Path, RawQuery, Request, State};
use axum::middleware::{Next, from_fn};
use axum::routing::get;
use shell::loopback::{Answer, Listener, PageFile};
use tokio::runtime::Builder;
use tokio::sync::oneshot;
use tokio::task::spawn_blocking;
use tokio::time::{sleep, timeout};

use super::Screens;
use crate::Error;

/// Files of the page.
const FILES: [PageFile; 5] = [
    PageFile::html("/", include_str!("page/index.html")),
    PageFile::svg("/icon.svg", include_str!("page/icon.svg")),
    PageFile::PALETTE,
    PageFile::css("/style.css", include_str!("page/style.css")),
    PageFile::script("/view.js", include_str!("page/view.js")),
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
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Binds a loopback address: with this port (0: any free one), or with the default one or, where that is in use,
    /// any other. `option` is the option of the port, which the error names.
    ///
    /// # Errors
    /// [`crate::Error::Listen`] for a port that is in use or reserved.
    pub fn bind(port: Option<u16>, option: &str) -> crate::Result<Listener> {
        let bind = |port| Listener::bind("127.0.0.1", port, option);
        Ok(match port {
            Some(port) => bind(port)?,
            None => bind(PORT).or_else(|_| bind(0))?,
        })
    }

    /// Starts answering requests.
    ///
    /// # Errors
    /// An error of the operating system that prevents the thread or its event loop.
    pub fn start(listener: Listener, screens: Screens) -> crate::Result<Self> {
        let refused = |e: std::io::Error| Error::option("view", format!("{e}; run without it"));
        let address = listener.address();
        // One picture is encoded at a time, so that the other cores stay with the tracker.
        let runtime =
            Builder::new_current_thread().enable_all().max_blocking_threads(1).build().map_err(refused)?;
        let (end, ended) = oneshot::channel();
        let own = screens.clone();
        let serve = move || {
            runtime.block_on(serve(listener, own, ended));
            // Clients that do not read their answers are disconnected.
            runtime.shutdown_background();
        };
        let thread = thread::Builder::new().name("view".into()).spawn(serve).map_err(refused)?;
        Ok(Self { screens, address, end: Some(end), thread: Some(thread) })
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

/// Time of the latest request or answer.
type LastActivity = Arc<Mutex<Option<Instant>>>;

/// Serves until the end has been announced.
async fn serve(listener: Listener, screens: Screens, ended: oneshot::Receiver<()>) {
    let last_activity = LastActivity::default();
    let answers = listener.serve(routes(screens, Arc::clone(&last_activity)));
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
fn routes(screens: Screens, last_activity: LastActivity) -> Router {
    PageFile::routes(&FILES)
        .route("/moment", get(moment))
        .route("/camera/{file}", get(picture))
        .with_state(screens)
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
async fn moment(State(screens): State<Screens>, RawQuery(query): RawQuery) -> Result<Answer, Answer> {
    if let Some(after) = query.as_deref().and_then(after) {
        let mut news = screens.wait();
        // Not "greater": the page may have been open since another run.
        let _ = timeout(PATIENCE, news.wait_for(|now| now.number != after || now.has_ended)).await;
    }
    screens.look(Answer::json)
}

/// Picture of a camera: `0.jpg` is the first camera's.
async fn picture(State(screens): State<Screens>, Path(file): Path<String>) -> Result<Answer, Answer> {
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
