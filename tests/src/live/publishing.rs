//! Latency from a picture's capture to the MQTT message that contains it.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::broker::{Broker, BrokerOptions, Subscriber};
use crate::chain::StepResult;
use crate::live::latency::{Latencies, latencies};
use crate::live::{Figure, quantile};

/// Rate at which each frame is a message, messages a second.
const EVERY_FRAME: &str = "100";

/// Ages of messages when a subscriber received them, seconds from the capture of their newest picture.
fn ages_s(measured_s: f64) -> StepResult<Vec<f64>> {
    let broker = Broker::start(&BrokerOptions::default())?;
    let subscriber = Subscriber::start(&broker)?;
    let url = format!("mqtt://{}", broker.address());
    let arguments = ["--mqtt", &url, "--mqtt-room", "office", "--mqtt-rate", EVERY_FRAME];
    let Latencies { zero, counted, .. } = latencies(measured_s, &arguments)?;
    let now =
        (Instant::now(), SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64());
    let mut ages = Vec::new();
    for message in subscriber.received().iter().filter(|m| m.topic == "roomtrack/office/people") {
        let json: serde_json::Value = serde_json::from_str(&message.payload).map_err(|e| e.to_string())?;
        let time_s = json["time"].as_f64().ok_or("a message has no time")?;
        let ago = Duration::try_from_secs_f64(now.1 - message.at_s).unwrap_or_default();
        let Some(at) = now.0.checked_sub(ago).filter(|at| counted.contains(at)) else { continue };
        ages.push(at.saturating_duration_since(zero).as_secs_f64() - time_s);
    }
    if ages.is_empty() { Err("no message came".to_owned()) } else { Ok(ages) }
}

/// Latency of two live cameras' messages on the loopback, as figures.
pub fn capture_to_message(measured_s: f64) -> Vec<Figure> {
    let what = "two live cameras at 12/s, no lag: capture to MQTT message";
    let ages = match ages_s(measured_s) {
        Ok(ages) => ages,
        Err(why) => return vec![Figure::unavailable(what, why, "<= 250")],
    };
    let rate = ages.len() as f64 / measured_s;
    let mut figures = vec![Figure::new(format!("{what}: messages"), rate, "1/s", "12")];
    for (name, share, asked) in [("p50", 0.5, ""), ("p99", 0.99, "<= 250")] {
        if let Some(age_s) = quantile(ages.iter().copied(), share) {
            figures.push(Figure::new(format!("{what}, {name}"), 1e3 * age_s, "ms", asked));
        }
    }
    figures
}
