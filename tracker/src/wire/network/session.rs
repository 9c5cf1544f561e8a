//! One Zenoh session: its settings, its token, its arrivals, and an end that is bounded in time.

use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::sample::SampleKind;
use zenoh::{Config, Session, Wait};

use super::super::keys;
use super::super::{Endpoint, Endpoints};
use crate::{Error, Result};

/// Longest time for closing a session that its peers hold open.
const CLOSE_BOUND: Duration = Duration::from_secs(2);

/// Time within which a router must answer.
const ROUTER_BOUND: Duration = Duration::from_secs(5);

/// Arrival from the network.
#[derive(Debug)]
pub(in crate::wire) enum Arrival {
    /// A token of the watched kind has appeared: its key.
    Appeared(String),
    /// A token of the watched kind has vanished: its key.
    Vanished(String),
    /// A message to this member.
    Message { key: String, bytes: Vec<u8> },
}

/// A member of the network.
pub(in crate::wire) struct Member {
    session: Option<Session>,
    /// Token and subscribers, in the order in which they are undeclared: the token first.
    declared: Option<(Option<LivelinessToken>, Vec<Subscriber<()>>)>,
}

/// Token that a member declares, and keys that it subscribes to.
pub(in crate::wire) struct Subscriptions {
    /// Key of its own token; `None` for a member that only listens.
    pub token: Option<String>,
    /// Keys of the tokens that it watches.
    pub tokens: &'static str,
    /// Keys of the messages to it.
    pub messages: Vec<String>,
}

impl Member {
    /// Joins the network. Only messages of at most `longest_message` bytes are received. The arrivals come from Zenoh's
    /// threads and must not wait.
    pub(in crate::wire) fn join(
        endpoints: &Endpoints,
        longest_message: usize,
        subscriptions: impl FnOnce(&str) -> Subscriptions,
        arrived: impl Fn(Arrival) + Clone + Send + Sync + 'static,
    ) -> Result<Self> {
        endpoints.check()?;
        for endpoint in &endpoints.listen {
            check_free(endpoint)?;
        }
        let config = config(endpoints, longest_message).map_err(|e| refused(endpoints, &*e))?;
        let session = zenoh::open(config).wait().map_err(|e| refused(endpoints, &*e))?;
        let subscriptions = subscriptions(&session.zid().to_string());
        let declare = || -> zenoh::Result<_> {
            let mut subscribers = Vec::new();
            for key in subscriptions.messages {
                let arrived = arrived.clone();
                let messages = session.declare_subscriber(key).callback(move |sample| {
                    let bytes = sample.payload().to_bytes().into_owned();
                    arrived(Arrival::Message { key: sample.key_expr().to_string(), bytes });
                });
                subscribers.push(messages.wait()?);
            }
            let tokens = session.liveliness().declare_subscriber(subscriptions.tokens).history(true);
            let tokens = tokens.callback(move |sample| {
                let key = sample.key_expr().to_string();
                arrived(match sample.kind() {
                    SampleKind::Put => Arrival::Appeared(key),
                    SampleKind::Delete => Arrival::Vanished(key),
                });
            });
            subscribers.push(tokens.wait()?);
            // The token is declared last, so that a peer that sees it can already be heard.
            let token =
                subscriptions.token.map(|key| session.liveliness().declare_token(key).wait()).transpose()?;
            Ok((token, subscribers))
        };
        let declared = Some(declare().map_err(|e| refused(endpoints, &*e))?);
        Ok(Self { session: Some(session), declared })
    }

    /// This member's id.
    pub(in crate::wire) fn id(&self) -> String {
        self.session.as_ref().map(|session| session.zid().to_string()).unwrap_or_default()
    }

    /// Sends a message at once. One that `may_drop` is dropped where the network is slower than its sender; otherwise
    /// this waits. A message that cannot be sent is lost: the token shows that a peer has gone.
    pub(in crate::wire) fn send(&self, key: &str, bytes: Vec<u8>, may_drop: bool) {
        let congestion = if may_drop { CongestionControl::Drop } else { CongestionControl::Block };
        let Some(session) = &self.session else { return };
        if let Err(error) = session.put(key, bytes).congestion_control(congestion).express(true).wait() {
            tracing::debug!("{key}: {error}");
        }
    }
}

impl Drop for Member {
    fn drop(&mut self) {
        let (session, declared) = (self.session.take(), self.declared.take());
        let (closed, is_closed) = mpsc::channel();
        // Closing can block for ever (zenoh issue 2675); the thread is then abandoned.
        let closing = thread::Builder::new().name("zenoh-close".to_owned()).spawn(move || {
            if let Some((token, subscribers)) = declared {
                if let Some(token) = token {
                    let _ = token.undeclare().wait();
                }
                drop(subscribers);
            }
            if let Some(session) = session {
                let _ = session.close().wait();
            }
            let _ = closed.send(());
        });
        if closing.is_ok() && is_closed.recv_timeout(CLOSE_BOUND).is_err() {
            tracing::debug!("the session does not close within {CLOSE_BOUND:?}: it is left");
        }
    }
}

/// Settings of the session. Zenoh's defaults listen on every interface, scout by multicast, accept messages of 1 GiB
/// and notice a dead peer after 10 s. Here only the requested endpoints are open, and a dead peer is noticed after 2 s.
fn config(endpoints: &Endpoints, longest_message: usize) -> zenoh::Result<Config> {
    let addresses = |endpoints: &[Endpoint]| endpoints.iter().map(Endpoint::to_string).collect::<Vec<_>>();
    let mut listen = addresses(&endpoints.listen);
    if endpoints.discover && listen.is_empty() && endpoints.connect.is_empty() {
        listen.push(format!("{}/[::]:0", if endpoints.tls.is_some() { "tls" } else { "tcp" }));
    }
    let mut settings = vec![
        ("mode", json!(if endpoints.via_router { "client" } else { "peer" })),
        // A peer connects in the background, without a time limit; a client when it joins.
        ("connect/timeout_ms", json!({ "peer": -1, "client": ROUTER_BOUND.as_millis() as u64 })),
        ("listen/endpoints", json!(listen)),
        ("connect/endpoints", json!(addresses(&endpoints.connect))),
        (
            "connect/retry",
            json!({ "period_init_ms": 100, "period_max_ms": 400, "period_increase_factor": 2.0 }),
        ),
        ("open/return_conditions/connect_scouted", json!(false)),
        ("scouting/multicast/enabled", json!(endpoints.discover)),
        ("transport/unicast/open_timeout", json!(3000)),
        ("transport/unicast/accept_timeout", json!(3000)),
        ("transport/link/tx/lease", json!(2000)),
        // A live station waits 1 ms before it drops a message, and 10 ms before it drops a large one.
        ("transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments", json!(10_000)),
        ("transport/link/rx/max_message_size", json!(longest_message + 1024)),
    ];
    if let Some(tls) = &endpoints.tls {
        let files = json!({
            "root_ca_certificate": tls.authority,
            "listen_certificate": tls.certificate,
            "listen_private_key": tls.key,
            "connect_certificate": tls.certificate,
            "connect_private_key": tls.key,
            "enable_mtls": true,
            "verify_name_on_connect": true,
        });
        settings.push(("transport/link/tls", files));
    }
    if !endpoints.allow.is_empty() {
        settings.push(("access_control", access(&endpoints.allow)));
    }
    if !endpoints.discover {
        // Peers announce other peers, but no connections are made to those.
        settings.push(("scouting/gossip/autoconnect", json!({ "peer": [] })));
    }
    let mut config = Config::default();
    for (key, value) in settings {
        config.insert_json5(key, &value.to_string())?;
    }
    Ok(config)
}

/// Access control: only owners of certificates with these names may do anything.
fn access(names: &[String]) -> Value {
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": [{
            "id": "messages",
            "messages": [
                "put", "declare_subscriber", "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
            ],
            "flows": ["ingress", "egress"],
            "permission": "allow",
            "key_exprs": [keys::ALL],
        }],
        "subjects": [{ "id": "members", "cert_common_names": names }],
        "policies": [{ "rules": ["messages"], "subjects": ["members"] }],
    })
}

/// Checks that an address is free to listen at; Zenoh's own error is less clear.
fn check_free(endpoint: &Endpoint) -> Result<()> {
    let address = format!("{}:{}", endpoint.host, endpoint.port);
    std::net::TcpListener::bind(&address).map(drop).map_err(|e| {
        Error::option("listen", format!("{endpoint}: {e}; give an address of this machine and a free port"))
    })
}

/// Error for a session that cannot be opened.
fn refused(endpoints: &Endpoints, error: &(dyn std::error::Error + Send + Sync)) -> Error {
    let text = error.to_string();
    // Zenoh appends places in its own source code.
    let problem = text.split(" at /").next().unwrap_or(&text).replace('\n', " ");
    let mend = if endpoints.tls.is_some() { "; check the endpoints and the certificates" } else { "" };
    Error::option("stations", format!("the network cannot be joined: {problem}{mend}"))
}
