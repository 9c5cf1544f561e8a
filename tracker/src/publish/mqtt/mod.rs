//! MQTT: people, events and counts of a room to a broker.
//!
//! | topic | message | |
//! |---|---|---|
//! | `PREFIX/ROOM/people` | line of `tracks.jsonl` | at most some a second; lost while the broker is away |
//! | `PREFIX/ROOM/event` | line of `events.jsonl` | at least once, in order |
//! | `PREFIX/ROOM/count/NAME` | counts of a zone, region or line | retained |
//! | `PREFIX/ROOM/status` | `online` or `offline` | retained, and the last will |
//!
//! The tracker never waits for the network:
//!
//! * `output` — [`MqttOutput`]: output of a run, which makes the messages. Start here.
//! * `queue` — messages that the broker has to acknowledge, until it has done so; bounded.
//! * `connection` — thread that sends them, and connects again when the broker was away.
//! * `address`, `credentials`, `tls`, `topics` — where and as whom.
//! * `discovery` — announcement to Home Assistant; `scenescape` — people in `SceneScape`'s form.

mod address;
mod connection;
mod credentials;
mod discovery;
mod failure;
mod output;
mod queue;
mod scenescape;
mod tls;
mod topics;

pub use address::BrokerAddress;
pub use connection::ConnectionCounts;
pub use credentials::Credentials;
pub use output::{MqttOutput, PeopleForm, PublishOptions};
pub use queue::DeliveryCounts;
pub use tls::BrokerTls;

/// Status of a room whose tracker runs…
const ONLINE: &str = "online";
/// …and of one whose tracker has ended or broken off.
const OFFLINE: &str = "offline";

/// Options of the connection to a broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MqttOptions {
    /// Address of the broker, and prefix of the topics.
    pub address: BrokerAddress,
    /// Name by which the broker knows the connection; two connections of one name end each other.
    pub client_id: String,
    /// User and password, if the broker asks for them.
    pub credentials: Option<Credentials>,
    /// Certificates for `mqtts://`.
    pub tls: BrokerTls,
    /// Largest number of events that wait for the broker. Default 10 000.
    pub keep: usize,
}

impl MqttOptions {
    /// Options for a broker without user or certificates, with a name that no other connection has.
    pub fn new(address: BrokerAddress) -> Self {
        Self {
            address,
            client_id: unique_client_id(),
            credentials: None,
            tls: BrokerTls::default(),
            keep: 10_000,
        }
    }
}

/// `roomtrack` and 12 hexadecimal digits: brokers must accept 23 letters and digits.
fn unique_client_id() -> String {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    let mut hasher = blake3::Hasher::new();
    hasher.update(&now.as_nanos().to_le_bytes());
    hasher.update(&std::process::id().to_le_bytes());
    // Two connections of one process, begun at the same time.
    hasher.update(format!("{:?}", std::thread::current().id()).as_bytes());
    format!("roomtrack{}", &hasher.finalize().to_hex()[..12])
}
