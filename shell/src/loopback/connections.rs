//! Connections of a server: their number has a limit, their requests have deadlines, and idle ones make room.
//!
//! A client that opens a thousand sockets and says nothing must neither end the program, which shares its file
//! descriptors with films and results, nor keep others from being answered. So the server holds a limited number of
//! connections; where there are as many, the one that has been silent for longest is closed for a new one.

use std::collections::HashMap;
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, HttpBody, to_bytes};
use axum::extract::Request;
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Response};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use rustls::ServerConfig;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::AbortHandle;
use tokio::time::{Instant, sleep, timeout};
use tokio_rustls::TlsAcceptor;

use super::Answer;

/// Longest duration of a handshake, of a request's head, and of its body.
const PATIENCE: Duration = Duration::from_secs(10);
/// Longest duration of an answer; a page's questions wait for news for ten seconds.
const LONGEST_ANSWER: Duration = Duration::from_mins(1);
/// Time after which a request that is worked on may be given up for a new connection.
const BUSY_FOR: Duration = Duration::from_secs(1);
/// Pause after an error of the socket, such as too many open files.
const AFTER_ERROR: Duration = Duration::from_millis(20);
/// Largest number of connections; fewer where the process may open few files.
const MOST_CONNECTIONS: usize = 512;
/// Largest body that is read, twice what any route takes: a client that is still sending reads no answer.
const MOST_BODY_BYTES: usize = 2 << 20;

/// Answers requests on a bound socket, within the runtime that this is called in, until the runtime ends.
pub(super) async fn serve(
    listener: TcpListener,
    router: Router,
    tls: Option<Arc<ServerConfig>>,
) -> io::Result<()> {
    serve_at_most(most_connections(), listener, router, tls).await
}

/// [`serve`], with at most so many connections at once.
async fn serve_at_most(
    most: usize,
    listener: TcpListener,
    router: Router,
    tls: Option<Arc<ServerConfig>>,
) -> io::Result<()> {
    let acceptor = tls.map(TlsAcceptor::from);
    let connections = Arc::new(Connections::new(most));
    // A runtime that goes on without this server must not go on with its clients.
    let _ends = EndsAll(Arc::clone(&connections));
    loop {
        let (stream, _) = accept(&listener, &connections).await?;
        while !connections.has_room() {
            sleep(AFTER_ERROR).await;
        }
        let (router, acceptor) = (router.clone(), acceptor.clone());
        connections.start(|connection| async move {
            match acceptor {
                // Clients that speak no TLS, or refuse the certificate, are disconnected.
                Some(acceptor) => {
                    if let Ok(Ok(stream)) = timeout(PATIENCE, acceptor.accept(stream)).await {
                        answer(stream, router, connection).await;
                    }
                }
                None => answer(stream, router, connection).await,
            }
        });
    }
}

/// The next connection. Where the process may open no more files, an idle one is closed.
async fn accept(listener: &TcpListener, connections: &Connections) -> io::Result<(TcpStream, SocketAddr)> {
    loop {
        match listener.accept().await {
            // A client that has already gone.
            Err(e) if matches!(e.kind(), ErrorKind::ConnectionAborted | ErrorKind::ConnectionReset) => {}
            Err(e) if e.kind() == ErrorKind::InvalidInput => return Err(e),
            Err(_) => {
                connections.close_one();
                sleep(AFTER_ERROR).await;
            }
            Ok(accepted) => return Ok(accepted),
        }
    }
}

/// Answers the requests of a connection until it is closed.
async fn answer<S>(stream: S, router: Router, connection: Connection)
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let tracked = router.layer(from_fn(move |mut request: Request, next: Next| {
        let connection = connection.clone();
        async move {
            let _working = connection.work();
            request.extensions_mut().insert(connection);
            let answer = timeout(LONGEST_ANSWER, next.run(request)).await;
            answer.unwrap_or_else(|_| Answer::error(503, "the answer took too long").into_response())
        }
    }));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(PATIENCE);
    // A client that breaks off, or breaks the protocol, is disconnected.
    let _ = http.serve_connection(TokioIo::new(stream), TowerToHyperService::new(tracked)).await;
}

/// Reads a request's body before it is worked on, so that a slow client keeps nobody waiting.
pub(super) async fn with_whole_body(request: Request, next: Next) -> Response {
    let connection = request.extensions().get::<Connection>().cloned();
    let waiting = connection.as_ref().map(Connection::wait_for_client);
    let (head, body) = request.into_parts();
    if body.size_hint().lower() > MOST_BODY_BYTES as u64 {
        return Answer::error(413, "the body is larger than 1 MiB").into_response();
    }
    let body = match timeout(PATIENCE, to_bytes(body, MOST_BODY_BYTES)).await {
        Ok(Ok(body)) => body,
        Ok(Err(e)) => {
            let line = format!("the body is larger than 1 MiB, or ends early: {e}");
            return Answer::error(413, &line).into_response();
        }
        Err(_) => return Answer::error(408, "the body did not come in time").into_response(),
    };
    drop(waiting);
    next.run(Request::from_parts(head, Body::from(body))).await
}

/// Number of connections that a server may hold: half of the files that the process may open, at most.
fn most_connections() -> usize {
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let files =
        limits.lines().find_map(|line| line.strip_prefix("Max open files")?.split_whitespace().next());
    let files: Option<usize> = files.and_then(|number| number.parse().ok());
    files.map_or(MOST_CONNECTIONS, |files| (files / 2).clamp(8, MOST_CONNECTIONS))
}

/// The open connections of a server.
#[derive(Debug)]
struct Connections {
    most: usize,
    next: AtomicU64,
    open: Mutex<HashMap<u64, Open>>,
}

/// State of an open connection.
#[derive(Debug)]
struct Open {
    /// Whether a whole request of it is being answered; else the client's next word is awaited.
    is_working: bool,
    /// Begin of this state.
    since: Instant,
    task: Option<AbortHandle>,
}

impl Connections {
    fn new(most: usize) -> Self {
        Self { most, next: AtomicU64::new(0), open: Mutex::default() }
    }

    fn open(&self) -> MutexGuard<'_, HashMap<u64, Open>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether there is room for one more connection, after one was closed if need be.
    fn has_room(&self) -> bool {
        self.open().len() < self.most || self.close_one()
    }

    /// Closes the connection that has been idle for longest, or else the one that has been worked on for longest, unless
    /// all have just begun.
    fn close_one(&self) -> bool {
        let mut open = self.open();
        let may_go = |state: &Open| !state.is_working || state.since.elapsed() > BUSY_FOR;
        let closed = open.iter().filter(|(_, state)| state.task.is_some() && may_go(state));
        let Some(id) = closed.min_by_key(|(_, state)| (state.is_working, state.since)).map(|(id, _)| *id)
        else {
            return false;
        };
        if let Some(task) = open.remove(&id).and_then(|state| state.task) {
            task.abort();
        }
        true
    }

    /// Starts the work of a new connection.
    fn start<W>(self: &Arc<Self>, work: impl FnOnce(Connection) -> W)
    where
        W: Future<Output = ()> + Send + 'static,
    {
        let connection = Connection { id: self.next.fetch_add(1, Ordering::Relaxed), all: Arc::clone(self) };
        let state = Open { is_working: false, since: Instant::now(), task: None };
        self.open().insert(connection.id, state);
        let registered = Registered(connection.clone());
        let work = work(connection.clone());
        let task = tokio::spawn(async move {
            let _registered = registered;
            work.await;
        });
        if let Some(state) = self.open().get_mut(&connection.id) {
            state.task = Some(task.abort_handle());
        }
    }
}

/// Closes all connections when it is dropped.
struct EndsAll(Arc<Connections>);

impl Drop for EndsAll {
    fn drop(&mut self) {
        for task in self.0.open().drain().filter_map(|(_, state)| state.task) {
            task.abort();
        }
    }
}

/// One connection, as its requests know it.
#[derive(Debug, Clone)]
struct Connection {
    id: u64,
    all: Arc<Connections>,
}

impl Connection {
    fn set_working(&self, is_working: bool) {
        if let Some(state) = self.all.open().get_mut(&self.id) {
            (state.is_working, state.since) = (is_working, Instant::now());
        }
    }

    /// Marks the connection as worked on while the result lives.
    fn work(&self) -> Marked {
        self.set_working(true);
        Marked { connection: self.clone(), is_working_after: false }
    }

    /// Marks the connection as waiting for its client while the result lives.
    fn wait_for_client(&self) -> Marked {
        self.set_working(false);
        Marked { connection: self.clone(), is_working_after: true }
    }
}

struct Marked {
    connection: Connection,
    is_working_after: bool,
}

impl Drop for Marked {
    fn drop(&mut self) {
        self.connection.set_working(self.is_working_after);
    }
}

/// Takes a connection out of the table when its work ends in any way.
struct Registered(Connection);

impl Drop for Registered {
    fn drop(&mut self) {
        self.0.all.open().remove(&self.0.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::routing::{get, put};
    use std::io::{Read, Write};
    use std::net::TcpStream as Client;
    use std::thread;

    /// A server of at most four connections, which runs until the tests end.
    fn server() -> SocketAddr {
        let socket = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        socket.set_nonblocking(true).unwrap();
        let address = socket.local_addr().unwrap();
        let slow = async || {
            sleep(Duration::from_secs(5)).await;
            "slow"
        };
        let router = Router::new()
            .route("/", get(async || "here"))
            .route("/slow", get(slow))
            .route("/put", put(async |body: String| body))
            .layer(from_fn(with_whole_body));
        thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
            runtime.block_on(async {
                serve_at_most(4, TcpListener::from_std(socket).unwrap(), router, None).await.unwrap();
            });
        });
        address
    }

    fn ask(address: SocketAddr, request: &str) -> String {
        let mut client = Client::connect(address).unwrap();
        client.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        client.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        // A connection that was given up ends in an error.
        let _ = client.read_to_string(&mut answer);
        answer
    }

    const HERE: &str = "GET / HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n";

    #[test]
    fn idle_and_half_sent_requests_make_room_for_others() {
        let address = server();
        let silent = [
            "",
            "GET / HT",
            "PUT /put HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\nhalf",
            "GET / HTTP/1.1\r\nHost: a\r\n\r\n",
        ];
        let mut clients = Vec::new();
        for i in 0..40 {
            let mut client = Client::connect(address).unwrap();
            // The server may have closed it by now.
            let _ = client.write_all(silent[i % silent.len()].as_bytes());
            clients.push(client);
        }
        for _ in 0..3 {
            let answer = ask(address, HERE);
            assert!(answer.starts_with("HTTP/1.1 200") && answer.ends_with("here"), "{answer}");
        }
    }

    #[test]
    fn requests_that_are_worked_on_stay_while_idle_ones_go() {
        let address = server();
        let slow =
            thread::spawn(move || ask(address, "GET /slow HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n"));
        thread::sleep(Duration::from_millis(300));
        let idle: Vec<Client> = (0..20).map(|_| Client::connect(address).unwrap()).collect();
        assert!(ask(address, HERE).ends_with("here"));
        drop(idle);
        let answer = slow.join().unwrap();
        assert!(answer.ends_with("slow"), "{answer}");
    }

    #[test]
    fn a_body_is_read_to_its_end_and_not_beyond_its_limit() {
        let address = server();
        let put = |length: usize, body: &str| {
            ask(
                address,
                &format!(
                    "PUT /put HTTP/1.1\r\nHost: a\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n{body}"
                ),
            )
        };
        assert!(put(5, "whole").ends_with("whole"));
        assert!(put(MOST_BODY_BYTES + 1, "more").starts_with("HTTP/1.1 413"));
    }
}
