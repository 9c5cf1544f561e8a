//! `--mqtt` and `--metrics`: results of a run for other programs, while it goes on.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use scenes::room::Room;
use shell::ranges::WAITING;

use crate::Error;
use crate::events::Clock;
use crate::prepared_room::PreparedRoom;
use crate::publish::metrics::{MetricsServer, RunMetrics};
use crate::publish::mqtt::{
    BrokerAddress, BrokerTls, Credentials, MqttOptions, MqttOutput, PeopleForm, PublishOptions,
};
use crate::run::Output;

/// Form of the messages of people.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormName {
    /// The line of tracks.jsonl.
    Line,
    /// `SceneScape`'s regulated scene message, also at PREFIX/regulated/scene/ID: with the prefix scenescape its
    /// consumers find it.
    Scenescape,
}

/// Options of what is published.
#[derive(Debug, Args)]
#[command(next_help_heading = "Publishing")]
pub(super) struct PublishArguments {
    /// Publish people, events and counts to an MQTT broker, at PREFIX/ROOM/people, event, count/NAME and status [default
    /// prefix: roomtrack]. mqtts:// encrypts. While the broker is away, events are kept and it is tried again; the
    /// tracker never waits for it. User and password come from ROOMTRACK_MQTT_USER and ROOMTRACK_MQTT_PASSWORD, or from
    /// --mqtt-credentials. As in `--mqtt mqtt://localhost:1883/shop`
    #[arg(long, value_name = "URL")]
    mqtt: Option<BrokerAddress>,
    /// Name of the room in topics [default: that of its directory]
    #[arg(long, value_name = "NAME", requires = "mqtt")]
    mqtt_room: Option<String>,
    /// Largest number of messages of people a second
    #[arg(long, value_name = "HZ", requires = "mqtt", default_value_t = 5.0)]
    mqtt_rate: f64,
    /// Form of the messages of people
    #[arg(long, value_enum, requires = "mqtt", default_value = "line")]
    mqtt_form: FormName,
    /// Announce counts and occupancy to Home Assistant
    #[arg(long, requires = "mqtt")]
    mqtt_discovery: bool,
    /// File with the two lines user = "NAME" and password = "WORD"
    #[arg(long, value_name = "FILE", requires = "mqtt")]
    mqtt_credentials: Option<PathBuf>,
    /// Certificates of the authorities that may have signed the broker's certificate, in PEM form, for mqtts:// [default:
    /// those that this system trusts]
    #[arg(long, value_name = "FILE", requires = "mqtt")]
    mqtt_ca: Option<PathBuf>,
    /// Certificate of this machine in PEM form, for brokers that ask for one
    #[arg(long, value_name = "FILE", requires = "mqtt_key")]
    mqtt_certificate: Option<PathBuf>,
    /// Private key of that certificate
    #[arg(long, value_name = "FILE", requires = "mqtt_certificate")]
    mqtt_key: Option<PathBuf>,
    /// Largest number of events that wait for the broker; beyond it the oldest are dropped
    #[arg(long, value_name = "N", requires = "mqtt", default_value_t = 10_000, value_parser = WAITING.whole::<usize>())]
    mqtt_keep: usize,
    /// Serve figures of the run for Prometheus at this address, as in --metrics 127.0.0.1:9464: frames, latency, people,
    /// states of cameras, drops. 0.0.0.0:9464 lets other machines read them, too
    #[arg(long, value_name = "IP:PORT", value_parser = socket_address)]
    metrics: Option<SocketAddr>,
}

/// Outputs of a run to other programs.
pub(super) struct Published {
    /// Output to the broker.
    pub(super) mqtt: Option<MqttOutput>,
    /// Output to the metrics' server.
    pub(super) metrics: Option<RunMetrics>,
    /// The server; it ends when this is dropped.
    pub(super) server: Option<MetricsServer>,
}

impl Published {
    /// The outputs of a run, and the server, which has to live as long.
    pub(super) fn into_outputs(self) -> (Vec<Box<dyn Output>>, Option<MetricsServer>) {
        let mut outputs: Vec<Box<dyn Output>> = Vec::new();
        outputs.extend(self.mqtt.map(|mqtt| Box::new(mqtt) as Box<dyn Output>));
        outputs.extend(self.metrics.map(|metrics| Box::new(metrics) as Box<dyn Output>));
        (outputs, self.server)
    }
}

fn socket_address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| "give an IP address and a port, as in 127.0.0.1:9464".to_owned())
}

impl PublishArguments {
    /// Checks what can be checked before a room is read.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        self.broker().map(drop)
    }

    /// The option that was given, if one was.
    pub(super) fn given(&self) -> Option<&'static str> {
        match (&self.mqtt, &self.metrics) {
            (Some(_), _) => Some("--mqtt"),
            (None, Some(_)) => Some("--metrics"),
            (None, None) => None,
        }
    }

    /// Connects and serves what was asked for.
    pub(super) fn start(
        &self,
        room: &Room,
        room_dir: &Path,
        prepared: &PreparedRoom,
        clock: Option<Clock>,
    ) -> anyhow::Result<Published> {
        let mqtt = match self.broker()? {
            None => None,
            Some(broker) => {
                let name = self.mqtt_room.clone().unwrap_or_else(|| directory_name(room_dir));
                let options = PublishOptions {
                    rate_hz: self.mqtt_rate,
                    form: match self.mqtt_form {
                        FormName::Line => PeopleForm::Line,
                        FormName::Scenescape => PeopleForm::SceneScape,
                    },
                    discovery: self.mqtt_discovery,
                    clock,
                    ..PublishOptions::new(name)
                };
                Some(MqttOutput::start(&broker, options, room, prepared)?)
            }
        };
        let (mut metrics, mut server) = (None, None);
        if let Some(address) = self.metrics {
            let (own, registry) = RunMetrics::new(prepared, mqtt.as_ref().map(MqttOutput::gauge));
            let started = MetricsServer::start(address, registry)?;
            let served = started.address();
            tracing::info!("metrics at http://{served}/metrics");
            if !served.ip().is_loopback() {
                tracing::warn!(
                    "--metrics {served}: every machine that reaches this address can read the metrics"
                );
            }
            (metrics, server) = (Some(own), Some(started));
        }
        Ok(Published { mqtt, metrics, server })
    }

    /// Options of the connection, if there is to be one.
    fn broker(&self) -> anyhow::Result<Option<MqttOptions>> {
        let Some(address) = &self.mqtt else { return Ok(None) };
        let has_certificates = self.mqtt_ca.is_some() || self.mqtt_certificate.is_some();
        if has_certificates && !address.is_tls {
            let problem =
                format!("{address} is not encrypted and has no use for certificates; write mqtts://");
            return Err(Error::option("mqtt", problem).into());
        }
        let credentials = match &self.mqtt_credentials {
            Some(file) => Some(Credentials::read(file)?),
            None => Credentials::of_environment()?,
        };
        let client = self.mqtt_certificate.clone().zip(self.mqtt_key.clone());
        Ok(Some(MqttOptions {
            credentials,
            tls: BrokerTls { authority: self.mqtt_ca.clone(), client },
            keep: self.mqtt_keep,
            ..MqttOptions::new(address.clone())
        }))
    }
}

/// Name of a directory, also where it was given as `.`; `room` where it has none.
fn directory_name(dir: &Path) -> String {
    let whole = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    whole.file_name().map_or_else(|| "room".to_owned(), |name| name.to_string_lossy().into_owned())
}
