//! TCP proxy between two programs: counts what passes, and can cut the connection as a broken network does.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;

use crate::chain::StepResult;

/// Proxy that forwards connections to an address.
#[derive(Debug)]
pub struct Proxy {
    /// Address of the proxy itself.
    pub address: SocketAddr,
    shared: Arc<ProxyState>,
}

#[derive(Debug, Default)]
struct ProxyState {
    /// Bytes that have come back from the address.
    bytes: AtomicU64,
    /// Number of cuts so far; a connection ends with the first after its start.
    cuts: AtomicU64,
    is_cut: AtomicBool,
}

impl Proxy {
    /// Starts a proxy to an address, where somebody need not listen yet.
    ///
    /// # Errors
    /// No port is free.
    pub fn start(to: SocketAddr) -> StepResult<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(|e| e.to_string())?;
        let address = listener.local_addr().map_err(|e| e.to_string())?;
        let shared = Arc::<ProxyState>::default();
        let own = Arc::clone(&shared);
        // The thread waits for connections until the process ends.
        thread::spawn(move || {
            for client in listener.incoming().flatten() {
                if own.is_cut.load(Ordering::Relaxed) {
                    continue;
                }
                let Ok(server) = TcpStream::connect(to) else { continue };
                let (Ok(client_too), Ok(server_too)) = (client.try_clone(), server.try_clone()) else {
                    continue;
                };
                let [there, back] = [Arc::clone(&own), Arc::clone(&own)];
                thread::spawn(move || forward(client, server, &there, false));
                thread::spawn(move || forward(server_too, client_too, &back, true));
            }
        });
        Ok(Self { address, shared })
    }

    /// Bytes that have come back from the address.
    pub fn bytes(&self) -> u64 {
        self.shared.bytes.load(Ordering::Relaxed)
    }

    /// Cuts the network: what is sent on open connections is lost without a word, and no new ones are made.
    pub fn cut(&self) {
        self.shared.is_cut.store(true, Ordering::Relaxed);
        self.shared.cuts.fetch_add(1, Ordering::Relaxed);
    }

    /// Mends the network: new connections are made again.
    pub fn heal(&self) {
        self.shared.is_cut.store(false, Ordering::Relaxed);
    }
}

fn forward(mut from: TcpStream, mut to: TcpStream, shared: &ProxyState, is_back: bool) {
    let cuts = shared.cuts.load(Ordering::Relaxed);
    let mut chunk = [0; 16384];
    while let Ok(count) = from.read(&mut chunk) {
        if count == 0 {
            break;
        }
        if shared.cuts.load(Ordering::Relaxed) != cuts {
            continue;
        }
        if is_back {
            shared.bytes.fetch_add(count as u64, Ordering::Relaxed);
        }
        if to.write_all(&chunk[..count]).is_err() {
            break;
        }
    }
    // The other side may have closed it already.
    let _ = to.shutdown(Shutdown::Both);
}
