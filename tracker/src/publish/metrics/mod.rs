//! Figures of a run for Prometheus, in the text format of `OpenMetrics`.
//!
//! | metric | |
//! |---|---|
//! | `roomtrack_frames_total` | frames that were processed |
//! | `roomtrack_people` | people in the latest frame |
//! | `roomtrack_latency_seconds` | from capture to result, of live cameras (histogram) |
//! | `roomtrack_camera_state{camera,state}` | 1 for the camera's present state, else 0 |
//! | `roomtrack_dropped_total{reason}` | frames and moments that a live run left out |
//! | `roomtrack_mqtt_…` | connection and queue of MQTT, where it is used |

mod broker;
mod server;

use std::time::{SystemTime, UNIX_EPOCH};

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::Registry;

pub use server::MetricsServer;

use crate::foreground::Verdict;
use crate::gathering::LeftOut;
use crate::prepared_room::PreparedRoom;
use crate::publish::mqtt::ConnectionCounts;
use broker::BrokerMetrics;

/// Upper bounds of the latency's buckets, seconds.
const BUCKETS_S: [f64; 12] = [0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.25, 0.5, 1.0, 2.5, 5.0];
/// States of a camera, as labels.
const STATES: [&str; 6] = ["usable", "learning", "lost", "frozen", "dark", "moved"];

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct CameraLabels {
    camera: String,
    state: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct ReasonLabel {
    reason: &'static str,
}

/// Figures of one run.
#[derive(Debug)]
pub struct RunMetrics {
    frames: Counter,
    people: Gauge,
    latency: Histogram,
    states: Family<CameraLabels, Gauge>,
    dropped: Family<ReasonLabel, Counter>,
    cameras: Vec<String>,
    latest: Vec<Option<&'static str>>,
    left_out: LeftOut,
}

impl RunMetrics {
    /// Figures of a run in this room, and the registry that makes their text. `broker` reads the counts of MQTT.
    pub fn new(
        prepared: &PreparedRoom,
        broker: Option<impl Fn() -> ConnectionCounts + Send + Sync + 'static>,
    ) -> (Self, Registry) {
        Self::of_cameras(prepared.cameras.iter().map(|camera| camera.name.clone()).collect(), broker)
    }

    fn of_cameras(
        cameras: Vec<String>,
        broker: Option<impl Fn() -> ConnectionCounts + Send + Sync + 'static>,
    ) -> (Self, Registry) {
        let metrics = Self {
            frames: Counter::default(),
            people: Gauge::default(),
            latency: Histogram::new(BUCKETS_S),
            states: Family::default(),
            dropped: Family::default(),
            latest: vec![None; cameras.len()],
            cameras,
            left_out: LeftOut::default(),
        };
        let mut registry = Registry::with_prefix("roomtrack");
        let version = Info::new([("version", env!("CARGO_PKG_VERSION"))]);
        registry.register("build", "Version of the program", version);
        registry.register("frames", "Frames that were processed", metrics.frames.clone());
        registry.register("people", "People in the latest frame", metrics.people.clone());
        let help = "Time from capture to result, of live cameras, seconds";
        registry.register("latency_seconds", help, metrics.latency.clone());
        let help = "1 for the present state of the camera, else 0";
        registry.register("camera_state", help, metrics.states.clone());
        let help = "Frames and moments of live cameras that were left out";
        registry.register("dropped", help, metrics.dropped.clone());
        if let Some(broker) = broker {
            registry.register_collector(Box::new(BrokerMetrics::new(broker)));
        }
        (metrics, registry)
    }

    /// Adds a processed frame. `utc_s` is the capture time of live cameras, seconds since 1970.
    pub fn observe(&mut self, people: usize, utc_s: Option<f64>, verdicts: &[Verdict], left_out: LeftOut) {
        self.frames.inc();
        self.people.set(people as i64);
        if let Some(utc_s) = utc_s {
            let now_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
            self.latency.observe((now_s - utc_s).max(0.0));
        }
        for ((camera, latest), verdict) in self.cameras.iter().zip(&mut self.latest).zip(verdicts) {
            let Some(state) = state(*verdict).filter(|state| *latest != Some(state)) else { continue };
            for other in STATES {
                let labels = CameraLabels { camera: camera.clone(), state: other };
                self.states.get_or_create(&labels).set(i64::from(other == state));
            }
            *latest = Some(state);
        }
        let before = std::mem::replace(&mut self.left_out, left_out);
        for (reason, now, before) in [
            ("passed_over", left_out.passed_over, before.passed_over),
            ("late", left_out.late, before.late),
            ("skipped", left_out.skipped, before.skipped),
        ] {
            self.dropped.get_or_create(&ReasonLabel { reason }).inc_by(now.saturating_sub(before));
        }
    }
}

/// Label of a camera's state; `None` between two of its frames.
fn state(verdict: Verdict) -> Option<&'static str> {
    match verdict {
        Verdict::Between => None,
        Verdict::Usable => Some("usable"),
        Verdict::Learning => Some("learning"),
        Verdict::Lost | Verdict::Silent | Verdict::OtherShape => Some("lost"),
        Verdict::Frozen => Some("frozen"),
        Verdict::Dark => Some("dark"),
        Verdict::AllForeground | Verdict::Moved => Some("moved"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::publish::mqtt::DeliveryCounts;
    use std::io::{Read, Write};
    use std::net::{SocketAddr, TcpStream};

    /// Body and head of the answer to a GET.
    fn get(address: SocketAddr, path: &str) -> (String, String) {
        let mut stream = TcpStream::connect(address).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        (head.to_owned(), body.to_owned())
    }

    /// Value of a sample, by its name with labels.
    fn value(body: &str, sample: &str) -> f64 {
        let found = body.lines().find_map(|line| line.strip_prefix(sample)?.strip_prefix(' '));
        found.unwrap_or_else(|| panic!("no {sample} in {body}")).parse().unwrap()
    }

    #[test]
    fn figures_are_served_as_text_that_can_be_parsed() {
        let counts = || ConnectionCounts {
            is_connected: true,
            delivery: DeliveryCounts { events: 7, acknowledged: 4, dropped: 1, waiting: 2 },
            skipped: 3,
        };
        let (mut metrics, registry) = RunMetrics::of_cameras(vec!["a\"b".into(), "c".into()], Some(counts));
        let server = MetricsServer::start("127.0.0.1:0".parse().unwrap(), registry).unwrap();
        let now_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
        let left_out = LeftOut { passed_over: 5, late: 0, skipped: 1 };
        metrics.observe(2, Some(now_s - 0.2), &[Verdict::Usable, Verdict::Dark], left_out);
        metrics.observe(3, Some(now_s - 20.0), &[Verdict::Between, Verdict::Usable], left_out);
        metrics.observe(1, None, &[Verdict::Frozen, Verdict::Between], left_out);

        let (head, body) = get(server.address(), "/metrics");
        assert!(head.starts_with("HTTP/1.1 200") && head.contains("openmetrics-text"), "{head}");
        assert!(body.ends_with("# EOF\n"), "{body}");
        for (sample, expected) in [
            ("roomtrack_frames_total", 3.0),
            ("roomtrack_people", 1.0),
            ("roomtrack_latency_seconds_count", 2.0),
            ("roomtrack_latency_seconds_bucket{le=\"0.15\"}", 0.0),
            ("roomtrack_latency_seconds_bucket{le=\"5.0\"}", 1.0),
            ("roomtrack_latency_seconds_bucket{le=\"+Inf\"}", 2.0),
            (r#"roomtrack_camera_state{camera="a\"b",state="frozen"}"#, 1.0),
            (r#"roomtrack_camera_state{camera="a\"b",state="usable"}"#, 0.0),
            (r#"roomtrack_camera_state{camera="c",state="usable"}"#, 1.0),
            (r#"roomtrack_camera_state{camera="c",state="dark"}"#, 0.0),
            ("roomtrack_dropped_total{reason=\"passed_over\"}", 5.0),
            ("roomtrack_dropped_total{reason=\"skipped\"}", 1.0),
            ("roomtrack_mqtt_connected", 1.0),
            ("roomtrack_mqtt_waiting", 2.0),
            ("roomtrack_mqtt_acknowledged_total", 4.0),
            ("roomtrack_mqtt_dropped_total", 1.0),
            ("roomtrack_mqtt_skipped_total", 3.0),
        ] {
            assert!((value(&body, sample) - expected).abs() < 1e-9, "{sample}: {body}");
        }
        let states =
            body.lines().filter(|line| line.starts_with("roomtrack_camera_state{") && line.ends_with(" 1"));
        assert_eq!(states.count(), 2);
        assert!(get(server.address(), "/elsewhere").0.starts_with("HTTP/1.1 404"));
    }

    #[test]
    fn an_address_that_is_taken_is_refused_with_the_mend() {
        let (_, registry) = RunMetrics::of_cameras(Vec::new(), None::<fn() -> ConnectionCounts>);
        let server = MetricsServer::start("127.0.0.1:0".parse().unwrap(), registry).unwrap();
        let line = MetricsServer::start(server.address(), Registry::default()).unwrap_err().to_string();
        assert!(line.starts_with("metrics: ") && line.contains("in use") && !line.contains('\n'), "{line}");
    }
}
