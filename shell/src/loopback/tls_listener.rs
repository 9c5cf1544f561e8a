//! A listener whose connections are encrypted.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use rustls::ServerConfig;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::task::AbortHandle;
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;

/// Longest duration of a handshake.
const PATIENCE: Duration = Duration::from_secs(10);
/// Pause after an error of the socket, such as too many open files.
const AFTER_ERROR: Duration = Duration::from_millis(200);

type Connection = (TlsStream<TcpStream>, SocketAddr);

/// Listener that hands out connections after their handshakes; a client that does not finish its own keeps nobody
/// waiting.
pub(super) struct TlsListener {
    address: SocketAddr,
    connections: Receiver<Connection>,
    accepting: AbortHandle,
}

impl TlsListener {
    /// Listens on a bound socket, within the runtime that this is called in.
    pub(super) fn new(listener: TcpListener, config: Arc<ServerConfig>) -> io::Result<Self> {
        let address = listener.local_addr()?;
        let (sender, connections) = channel(16);
        let accepting = tokio::spawn(accept(listener, TlsAcceptor::from(config), sender)).abort_handle();
        Ok(Self { address, connections, accepting })
    }
}

impl Drop for TlsListener {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

async fn accept(listener: TcpListener, acceptor: TlsAcceptor, sender: Sender<Connection>) {
    loop {
        let Ok((stream, client)) = listener.accept().await else {
            sleep(AFTER_ERROR).await;
            continue;
        };
        let (acceptor, sender) = (acceptor.clone(), sender.clone());
        tokio::spawn(async move {
            // Clients that speak no TLS, or refuse the certificate, are disconnected.
            if let Ok(Ok(stream)) = timeout(PATIENCE, acceptor.accept(stream)).await {
                // A server that has ended takes no connection.
                let _ = sender.send((stream, client)).await;
            }
        });
    }
}

impl axum::serve::Listener for TlsListener {
    type Io = TlsStream<TcpStream>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        match self.connections.recv().await {
            Some(connection) => connection,
            // The accepting task has ended with the runtime: there will be none.
            None => std::future::pending().await,
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        Ok(self.address)
    }
}
