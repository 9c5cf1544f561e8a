//! HTTP server of the metrics, on a thread of its own.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use axum::Router;
use axum::extract::State;
use axum::routing::get;
use prometheus_client::encoding::text;
use prometheus_client::registry::Registry;
use shell::loopback::{Answer, Listener};
use tokio::runtime::Builder;
use tokio::sync::oneshot;

use crate::{Error, Result};

/// Media type of the text.
const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Server of `/metrics`; it runs until it is dropped.
#[derive(Debug)]
pub struct MetricsServer {
    address: SocketAddr,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl MetricsServer {
    /// Serves a registry at an address; port 0 is any free one.
    ///
    /// # Errors
    /// An address that is not this machine's, or a port that is in use or reserved.
    pub fn start(address: SocketAddr, registry: Registry) -> Result<Self> {
        let refused = |e: std::io::Error| {
            let mend = match e.kind() {
                ErrorKind::AddrInUse => "the port is in use; give another one",
                ErrorKind::PermissionDenied => "the port is reserved; give one above 1023",
                ErrorKind::AddrNotAvailable => {
                    "this machine has no such address; give one that it has, such as 127.0.0.1"
                }
                _ => return Error::option("metrics", format!("{address}: {e}; give another address")),
            };
            Error::option("metrics", format!("{address}: {mend}"))
        };
        let listener = TcpListener::bind(address).and_then(Listener::of).map_err(refused)?;
        let runtime = Builder::new_current_thread().enable_all().build().map_err(refused)?;
        let own_address = listener.address();
        let (end, ended) = oneshot::channel();
        let serve = move || {
            runtime.block_on(async move {
                let routes = Router::new().route("/metrics", get(metrics)).with_state(Arc::new(registry));
                let answers = listener.serve(routes);
                tokio::select! {
                    served = answers => {
                        if let Err(e) = served {
                            tracing::warn!("the metrics are served no longer: {e}");
                        }
                    }
                    // The end also comes when its sender is dropped.
                    _ = ended => {}
                }
            });
            // Clients that do not read their answers are disconnected.
            runtime.shutdown_background();
        };
        let thread = thread::Builder::new().name("metrics".into()).spawn(serve).map_err(refused)?;
        Ok(Self { address: own_address, end: Some(end), thread: Some(thread) })
    }

    /// Address of the server.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for MetricsServer {
    fn drop(&mut self) {
        drop(self.end.take());
        if let Some(thread) = self.thread.take() {
            // A failure of the thread has already been reported.
            let _ = thread.join();
        }
    }
}

async fn metrics(State(registry): State<Arc<Registry>>) -> Answer {
    let mut body = String::new();
    match text::encode(&mut body, &registry) {
        Ok(()) => Answer::ok(OPEN_METRICS, body),
        Err(e) => Answer::error(500, &e.to_string()),
    }
}
