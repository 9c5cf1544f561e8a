//! `site.toml` as it is written.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::PathBuf;

use serde::Deserialize;
use toml::Value;

/// Options of `tracker run` by their long names.
pub(super) type Options = BTreeMap<String, Value>;

/// The whole file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SiteFile {
    /// Folder of all results.
    pub(super) out: PathBuf,
    /// Options of every room.
    #[serde(default)]
    pub(super) run: Options,
    /// Options of the connection to a broker: `url`, and others without `mqtt-` before their names.
    #[serde(default)]
    pub(super) mqtt: Options,
    pub(super) page: Option<PageTable>,
    pub(super) metrics: Option<MetricsTable>,
    #[serde(default)]
    pub(super) retention: Retention,
    #[serde(default)]
    pub(super) room: Vec<RoomTable>,
    #[serde(default)]
    pub(super) door: Vec<DoorTable>,
}

/// Pages of the rooms.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PageTable {
    /// Port of the first room's page; 0 for any free ones.
    pub(super) port: u16,
}

/// Figures of the rooms for Prometheus.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MetricsTable {
    /// Address of the first room's figures; port 0 for any free ones.
    pub(super) address: SocketAddr,
}

/// Days after which files are removed; without a number they stay.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Retention {
    /// All files of a day.
    pub(super) days: Option<u32>,
    /// Films.
    pub(super) film_days: Option<u32>,
}

/// A room. Unknown keys are options of `tracker run`, and refused there if they are none.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct RoomTable {
    /// Name, unique in the site.
    pub(super) name: String,
    /// Room directory.
    pub(super) path: PathBuf,
    /// Folder of the results; default: one of the room's name in the site's.
    pub(super) out: Option<PathBuf>,
    /// Each camera's stream or file.
    #[serde(default)]
    pub(super) cameras: BTreeMap<String, Value>,
    /// Other options.
    #[serde(flatten)]
    pub(super) options: Options,
}

/// A door that two rooms share.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DoorTable {
    /// The rooms' names.
    pub(super) rooms: [String; 2],
    /// The zone of each room.
    pub(super) zones: [String; 2],
    /// Shortest and longest plausible time of a passage, seconds.
    pub(super) seconds: [f64; 2],
}
