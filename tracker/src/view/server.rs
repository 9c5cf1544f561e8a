//! The server of the page: HTTP, to this machine alone, on a thread of its own.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use axum::extract::Request;
use axum::http::Method;
use shell::loopback::{Answer, Listener, PageFile};
use tokio::runtime::Builder;
use tokio::sync::oneshot;
use tokio::task::spawn_blocking;
use tokio::time::{sleep, timeout};

use super::Screens;
use crate::{Error, Result};

/// The page's own files.
const FILES: [PageFile; 5] = [
    PageFile::html("/", include_str!("page/index.html")),
    PageFile::svg("/icon.svg", include_str!("page/icon.svg")),
    PageFile::PALETTE,
    PageFile::css("/style.css", include_str!("page/style.css")),
    PageFile::script("/view.js", include_str!("page/view.js")),
];
/// The address, unless somebody else has it.
const PORT: u16 = 8081;
const PORT_OPTION: &str = "--view-port";
/// A question is answered after so long, news or not: whoever asks knows that the run is still there.
const PATIENCE: Duration = Duration::from_secs(10);
/// Whoever asked within this time is watching.
const WATCHING: Duration = Duration::from_secs(15);
/// After the end whoever watches is given what is asked for, until so long nothing was…
const QUIET: Duration = Duration::from_millis(500);
/// …but no longer than this.
const LONGEST_FAREWELL: Duration = Duration::from_secs(3);

/// Serves the screens until it is dropped.
#[derive(Debug)]
pub struct Server {
    screens: Screens,
    address: SocketAddr,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Takes an address of the loopback: with this port (0: any free one), or with the usual one or, where that is in
    /// use, any other.
    ///
    /// # Errors
    /// [`crate::Error::Listen`] when the port is in use or reserved.
    pub fn bind(port: Option<u16>) -> Result<Listener> {
        let bind = |port| Listener::bind("127.0.0.1", port, PORT_OPTION);
        Ok(match port {
            Some(port) => bind(port)?,
            None => bind(PORT).or_else(|_| bind(0))?,
        })
    }

    /// Answers from now on.
    ///
    /// # Errors
    /// When the system gives no thread or no events.
    pub fn start(listener: Listener, screens: Screens) -> Result<Self> {
        let refused = |e: std::io::Error| Error::option("--view", format!("{e}; run without it"));
        let address = listener.address();
        // One picture is encoded at a time: the other cores are the tracker's.
        let runtime =
            Builder::new_current_thread().enable_all().max_blocking_threads(1).build().map_err(refused)?;
        let (end, ended) = oneshot::channel();
        let own = screens.clone();
        let serve = move || {
            runtime.block_on(serve(listener, own, ended));
            // Whoever does not take what they asked for is left.
            runtime.shutdown_background();
        };
        let thread = thread::Builder::new().name("view".into()).spawn(serve).map_err(refused)?;
        Ok(Self { screens, address, end: Some(end), thread: Some(thread) })
    }

    /// Where it answers.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What it shows.
    pub fn screens(&self) -> &Screens {
        &self.screens
    }

    /// Tells whoever watches that the run has ended. The last pictures can still be fetched while the program goes on, and
    /// for a moment when this is dropped.
    pub fn tell_the_end(&mut self) {
        if let Some(end) = self.end.take() {
            self.screens.end();
            // A server whose socket the system took away has said so.
            let _ = end.send(());
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.tell_the_end();
        if let Some(thread) = self.thread.take() {
            // What it failed of has been told.
            let _ = thread.join();
        }
    }
}

/// When somebody last asked for something, or was answered.
type Heard = Arc<Mutex<Option<Instant>>>;

/// Serves until the end has been told.
async fn serve(listener: Listener, screens: Screens, ended: oneshot::Receiver<()>) {
    let heard = Heard::default();
    let note = Arc::clone(&heard);
    let answers = listener.serve(move |request| {
        let (screens, heard) = (screens.clone(), Arc::clone(&note));
        async move {
            set_now(&heard);
            let answer = answer(&screens, request).await.unwrap_or_else(|refusal| refusal);
            set_now(&heard);
            answer
        }
    });
    tokio::spawn(async {
        if let Err(e) = answers.await {
            tracing::warn!("the page is served no longer: {e}");
        }
    });
    // Whoever could end it has gone: that is an end, too.
    let _ = ended.await;
    farewell(&heard).await;
}

fn set_now(heard: &Heard) {
    *heard.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
}

/// Waits until whoever watches has been told the end.
async fn farewell(heard: &Heard) {
    let silence = || heard.lock().unwrap_or_else(PoisonError::into_inner).map(|at| at.elapsed());
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

async fn answer(screens: &Screens, request: Request) -> std::result::Result<Answer, Answer> {
    let path = request.uri().path();
    let route = Route::of(path).ok_or_else(|| Answer::not_found(path))?;
    if ![Method::GET, Method::HEAD].contains(request.method()) {
        return Err(Answer::other_method(path, "GET, HEAD"));
    }
    match route {
        Route::Page(file) => Ok(Answer::file(file)),
        Route::Moment => {
            if let Some(after) = request.uri().query().and_then(after) {
                let mut news = screens.wait();
                // Not "greater": the page may have been left open since another run.
                let _ = timeout(PATIENCE, news.wait_for(|now| now.number != after || now.has_ended)).await;
            }
            screens.look(Answer::json)
        }
        Route::Camera(camera) => {
            let picture = screens.look(|now| now.picture(camera));
            let picture = picture.ok_or_else(|| Answer::error(404, "that camera has no picture yet"))?;
            let jpeg = spawn_blocking(move || picture.jpeg()).await.unwrap_or_default();
            if jpeg.is_empty() {
                return Err(Answer::error(500, "the picture cannot be encoded"));
            }
            Ok(Answer::ok("image/jpeg", jpeg))
        }
    }
}

/// The number in `after=17`.
fn after(query: &str) -> Option<u64> {
    query.split('&').find_map(|part| part.strip_prefix("after="))?.parse().ok()
}

/// What there is to ask for.
enum Route {
    Page(&'static PageFile),
    /// What there is to see; with a number, not before that is another.
    Moment,
    /// A camera's picture, by the camera's number.
    Camera(usize),
}

impl Route {
    fn of(path: &str) -> Option<Self> {
        if let Some(file) = FILES.iter().find(|file| file.path == path) {
            return Some(Self::Page(file));
        }
        if path == "/moment" {
            return Some(Self::Moment);
        }
        let number = path.strip_prefix("/camera/")?.strip_suffix(".jpg")?;
        number.parse().ok().map(Self::Camera)
    }
}
