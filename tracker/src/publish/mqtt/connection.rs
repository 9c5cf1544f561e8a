//! The connection to a broker, on a thread of its own: made, kept, made again.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rumqttc::{AsyncClient, Event, EventLoop, Incoming, LastWill, Outgoing, QoS};
use tokio::runtime::Builder;
use tokio::sync::Notify;
use tokio::time::timeout;

use super::failure::Failure;
use super::queue::{DeliveryCounts, Queue};
use super::{MqttOptions, OFFLINE, ONLINE};
use crate::{Error, Result};

/// Wait before the second attempt to connect…
const FIRST_WAIT: Duration = Duration::from_millis(250);
/// …which doubles with each attempt, up to this.
const LONGEST_WAIT: Duration = Duration::from_secs(4);
/// Interval of signs of life while there is nothing to send; the broker publishes the last will one and a half of it after
/// the machine has gone without a word.
const KEEP_ALIVE: Duration = Duration::from_secs(10);
/// Longest wait for an attempt to connect, seconds.
const CONNECT_S: u64 = 5;
/// Longest wait at the end for what is not acknowledged.
const FAREWELL: Duration = Duration::from_secs(10);
/// Messages that may wait in the connection.
const CHANNEL: usize = 64;
/// Largest message, bytes: 1000 people seen by 8 cameras.
const LARGEST: usize = 1 << 20;

/// State that the tracker's thread shares with the connection's.
#[derive(Debug)]
struct Shared {
    state: Mutex<ConnectionState>,
    changed: Condvar,
    end: Notify,
}

#[derive(Debug)]
struct ConnectionState {
    queue: Queue,
    /// Client of the present connection.
    client: Option<AsyncClient>,
    /// Result of the latest attempt; `None` before the first.
    latest: Option<std::result::Result<(), Failure>>,
    /// Messages of the latest state that were not sent because the connection was absent or busy.
    skipped: u64,
}

/// Connection to a broker. Publishing never waits for the network.
#[derive(Debug)]
pub(super) struct Connection {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    status: String,
    /// The broker's address, for messages.
    broker: String,
}

/// State of a connection, for figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ConnectionCounts {
    /// Whether there is a connection now.
    pub is_connected: bool,
    /// Events by what became of them.
    pub delivery: DeliveryCounts,
    /// Messages of people that were not sent because the connection was absent or busy.
    pub skipped: u64,
}

impl Connection {
    /// Starts to connect. The last will is `offline` at the topic `status`.
    ///
    /// # Errors
    /// A file of the options that cannot be used, or a thread that cannot be started.
    pub(super) fn start(options: &MqttOptions, status: String) -> Result<Self> {
        let refused = |e: std::io::Error| Error::option("mqtt", format!("{e}; run without it"));
        let client_options = client_options(options, &status)?;
        let mut queue = Queue::new(options.keep);
        queue.retain(status.clone(), ONLINE.into());
        let state = ConnectionState { queue, client: None, latest: None, skipped: 0 };
        let shared =
            Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new(), end: Notify::new() });
        let (own, broker) = (Arc::clone(&shared), options.address.to_string());
        let own_broker = broker.clone();
        let runtime = Builder::new_current_thread().enable_all().build().map_err(refused)?;
        let work = move || {
            runtime.block_on(async {
                tokio::select! {
                    () = keep_connected(client_options, &own, &own_broker) => {}
                    () = own.end.notified() => {}
                }
            });
            own.lock().client = None;
            // A look-up of a name may still be going on.
            runtime.shutdown_background();
        };
        let thread = thread::Builder::new().name("mqtt".into()).spawn(work).map_err(refused)?;
        Ok(Self { shared, thread: Some(thread), status, broker })
    }

    /// Waits for the first attempt to connect, at most `longest`. A broker that cannot be reached is no error.
    ///
    /// # Errors
    /// The broker refuses this machine, or this machine the broker: another attempt would fail, too.
    pub(super) fn check(&self, longest: Duration) -> Result<()> {
        let state = self.shared.wait(longest, |state| state.latest.is_some());
        match &state.latest {
            Some(Err(failure)) if failure.is_refusal => {
                Err(Error::option("mqtt", format!("{}: {}", self.broker, failure.line)))
            }
            _ => Ok(()),
        }
    }

    /// Publishes an event: at least once, however long the broker is away.
    pub(super) fn publish_event(&self, topic: String, payload: Vec<u8>) {
        let mut state = self.shared.lock();
        let is_first = state.queue.push(topic, payload) && state.queue.counts().dropped == 1;
        state.fill();
        drop(state);
        if is_first {
            tracing::warn!(
                "{}: more events wait for the broker than are kept (--mqtt-keep): the oldest are dropped",
                self.broker
            );
        }
    }

    /// Sets the value of a retained topic; the latest value arrives.
    pub(super) fn retain(&self, topic: String, payload: Vec<u8>) {
        let mut state = self.shared.lock();
        state.queue.retain(topic, payload);
        state.fill();
    }

    /// Publishes the latest state of something at most once; it is skipped while the connection is absent or busy.
    pub(super) fn publish_latest(&self, topic: String, payload: Vec<u8>) {
        let mut state = self.shared.lock();
        let sent = match &state.client {
            Some(client) => client.try_publish(topic, QoS::AtMostOnce, false, payload).is_ok(),
            None => false,
        };
        state.skipped += u64::from(!sent);
    }

    /// Present counts.
    pub(super) fn counts(&self) -> ConnectionCounts {
        let state = self.shared.lock();
        ConnectionCounts {
            is_connected: state.client.is_some(),
            delivery: state.queue.counts(),
            skipped: state.skipped,
        }
    }

    /// Counts of a connection that may have been finished since.
    pub(super) fn gauge(&self) -> impl Fn() -> ConnectionCounts + Send + Sync + 'static {
        let observer = Self {
            shared: Arc::clone(&self.shared),
            thread: None,
            status: String::new(),
            broker: String::new(),
        };
        move || observer.counts()
    }

    /// Delivers what waits, says `offline`, and disconnects. Waits for the broker for some seconds where events wait.
    /// Events that the broker has not acknowledged then are counted in one line of the log.
    pub(super) fn finish(mut self) {
        let begun = Instant::now();
        let waits = |state: &ConnectionState| state.client.is_some() || state.queue.counts().waiting > 0;
        if waits(&self.shared.lock()) {
            drop(self.shared.wait(FAREWELL, |state| state.queue.is_delivered()));
        }
        self.retain(self.status.clone(), OFFLINE.into());
        let rest = FAREWELL.saturating_sub(begun.elapsed());
        let state = self.shared.wait(rest, |state| state.client.is_none() || state.queue.is_delivered());
        let counts = state.queue.counts();
        if let Some(client) = &state.client {
            // A connection that is too busy to be told so is closed without a farewell.
            let _ = client.try_disconnect();
        }
        drop(state);
        let DeliveryCounts { events, acknowledged, dropped, waiting } = counts;
        if waiting + dropped > 0 {
            tracing::warn!(
                "{}: {waiting} of {events} events were not acknowledged by the broker, and {dropped} were dropped before; \
                 `tracker events` makes all of them from the run's tracks",
                self.broker
            );
        } else {
            tracing::info!("{}: all {acknowledged} events were acknowledged", self.broker);
        }
        // The farewell leaves within this time, or never.
        drop(self.shared.wait(Duration::from_secs(1), |state| state.client.is_none()));
        self.stop();
    }

    fn stop(&mut self) {
        if let Some(thread) = self.thread.take() {
            self.shared.end.notify_one();
            // A failure of the thread has already been printed.
            let _ = thread.join();
        }
    }
}

impl Drop for Connection {
    /// Ends without a farewell; the broker publishes the last will.
    fn drop(&mut self) {
        self.stop();
    }
}

/// Course of a connection after an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Progress {
    Open,
    Farewell,
}

impl Shared {
    /// Hands out through a client that has connected; number of events that had waited.
    fn connected(&self, client: AsyncClient) -> u64 {
        let mut state = self.lock();
        state.queue.begin();
        state.client = Some(client);
        state.latest = Some(Ok(()));
        state.fill();
        let waiting = state.queue.counts().waiting;
        drop(state);
        self.changed.notify_all();
        waiting
    }

    /// Hands out no more until a client has connected again.
    fn disconnected(&self, failure: Failure) {
        let mut state = self.lock();
        state.client = None;
        state.latest = Some(Err(failure));
        drop(state);
        self.changed.notify_all();
    }

    /// Takes an event of the connection into account.
    fn take(&self, event: &Event) -> Progress {
        let mut state = self.lock();
        match event {
            Event::Outgoing(Outgoing::Publish(packet)) if *packet != 0 => state.queue.set_sent(*packet),
            Event::Incoming(Incoming::PubAck(acknowledgement)) => {
                state.queue.acknowledge(acknowledgement.pkid);
                self.changed.notify_all();
            }
            Event::Outgoing(Outgoing::Disconnect) => {
                state.client = None;
                drop(state);
                self.changed.notify_all();
                return Progress::Farewell;
            }
            _ => {}
        }
        state.fill();
        Progress::Open
    }

    fn lock(&self) -> MutexGuard<'_, ConnectionState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until the state is as wanted, or for the longest time.
    fn wait(
        &self,
        longest: Duration,
        is_wanted: impl Fn(&ConnectionState) -> bool,
    ) -> MutexGuard<'_, ConnectionState> {
        let waited = self.changed.wait_timeout_while(self.lock(), longest, |state| !is_wanted(state));
        waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

impl ConnectionState {
    /// Gives the connection as many messages as it takes now.
    fn fill(&mut self) {
        let Some(client) = &self.client else { return };
        while let Some((ticket, message)) = self.queue.next() {
            let given =
                client.try_publish(message.topic, QoS::AtLeastOnce, message.is_retained, message.payload);
            // A full connection asks again when it has sent something.
            if given.is_err() {
                return;
            }
            self.queue.set_handed(ticket);
        }
    }
}

fn client_options(options: &MqttOptions, status: &str) -> Result<rumqttc::MqttOptions> {
    let address = &options.address;
    let mut client = rumqttc::MqttOptions::new(&options.client_id, &address.host, address.port);
    client.set_keep_alive(KEEP_ALIVE).set_max_packet_size(LARGEST, LARGEST);
    client.set_last_will(LastWill::new(status, OFFLINE, QoS::AtLeastOnce, true));
    if let Some(credentials) = &options.credentials {
        client.set_credentials(&credentials.user, &credentials.password);
    }
    if address.is_tls {
        let config = options.tls.config()?;
        client.set_transport(rumqttc::Transport::tls_with_config(rumqttc::TlsConfiguration::Rustls(config)));
    }
    Ok(client)
}

/// Connects, and again whenever the connection breaks, until the broker has been told of the end.
async fn keep_connected(options: rumqttc::MqttOptions, shared: &Shared, broker: &str) {
    let mut wait = FIRST_WAIT;
    let mut told: Option<Failure> = None;
    loop {
        // A new client for each connection: what is sent again is the queue's decision alone.
        let (client, mut connection) = AsyncClient::new(options.clone(), CHANNEL);
        let mut network = connection.network_options();
        network.set_tcp_nodelay(true);
        network.set_connection_timeout(CONNECT_S);
        connection.set_network_options(network);
        let was_connected = if let Err(error) = connection.poll().await {
            Some(Failure::of(&error))
        } else {
            let waiting = shared.connected(client);
            if told.take().is_some() {
                tracing::info!("{broker}: connected again; {waiting} events had waited");
            } else {
                tracing::info!("{broker}: connected");
            }
            wait = FIRST_WAIT;
            serve(&mut connection, shared).await
        };
        let Some(failure) = was_connected else { return };
        // One line an outage, whatever its later reasons; a refusal at the start is `check`'s to report.
        let is_told = told.as_ref().is_some_and(|told| told.is_refusal == failure.is_refusal)
            || (failure.is_refusal && shared.lock().latest.is_none());
        if is_told {
            tracing::debug!("{broker}: {}", failure.line);
        } else {
            tracing::warn!("{broker}: {}; it is tried again, and events are kept until then", failure.line);
            told = Some(failure.clone());
        }
        shared.disconnected(failure);
        tokio::time::sleep(wait).await;
        wait = (2 * wait).min(LONGEST_WAIT);
    }
}

/// Sends and receives until the connection breaks; `None` after a farewell.
async fn serve(connection: &mut EventLoop, shared: &Shared) -> Option<Failure> {
    loop {
        let event = match connection.poll().await {
            Ok(event) => event,
            Err(error) => return Some(Failure::of(&error)),
        };
        if shared.take(&event) == Progress::Farewell {
            // The broker closes the connection when it has read the farewell.
            let _ = timeout(Duration::from_millis(200), connection.poll()).await;
            return None;
        }
    }
}
