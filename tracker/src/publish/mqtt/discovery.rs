//! Announcement of a room's counts and occupancy to Home Assistant.
//!
//! Home Assistant listens at `homeassistant/COMPONENT/NODE/OBJECT/config` for retained descriptions of sensors (its page
//! "MQTT discovery"). Each place gets a sensor of the people inside and a binary sensor of its occupancy; each line gets
//! two sensors of its crossings.

use serde_json::{Value, json};

use super::topics::Topics;
use super::{OFFLINE, ONLINE};

/// A place with counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CountedPlace<'a> {
    /// The whole room, a zone or a region: people are inside.
    Area(&'a str),
    /// A line: people cross it.
    Line(&'a str),
}

/// Topics and payloads of the announcement.
pub(super) fn announcement(room: &str, topics: &Topics, places: &[CountedPlace<'_>]) -> Vec<(String, Value)> {
    let node = format!("roomtrack_{}", identifier(&topics.status()));
    let device = json!({
        "identifiers": [node],
        "name": room,
        "manufacturer": "roomtrack",
        "model": "room",
        "sw_version": env!("CARGO_PKG_VERSION"),
    });
    let sensor = |component: &str, place: &str, what: &str, own: Value| {
        let object = format!("{}_{what}", identifier(place));
        let mut config = json!({
            "unique_id": format!("{node}_{object}"),
            "state_topic": topics.count(place),
            "availability_topic": topics.status(),
            "payload_available": ONLINE,
            "payload_not_available": OFFLINE,
            "device": device,
            "origin": { "name": "roomtrack", "sw_version": env!("CARGO_PKG_VERSION") },
        });
        if let (Value::Object(config), Value::Object(own)) = (&mut config, own) {
            config.extend(own);
        }
        (format!("homeassistant/{component}/{node}/{object}/config"), config)
    };
    let counted = |place: &str, what: &str, state_class: &str| {
        let own = json!({
            "name": format!("{place} {what}"),
            "value_template": format!("{{{{ value_json.{what} }}}}"),
            "state_class": state_class,
            "unit_of_measurement": "people",
            "icon": "mdi:account-group",
        });
        sensor("sensor", place, what, own)
    };
    let mut found = Vec::new();
    for place in places {
        match place {
            CountedPlace::Area(name) => {
                found.push(counted(name, "inside", "measurement"));
                let occupied = json!({
                    "name": format!("{name} occupied"),
                    "device_class": "occupancy",
                    "value_template": "{{ 'ON' if value_json.inside > 0 else 'OFF' }}",
                });
                found.push(sensor("binary_sensor", name, "occupied", occupied));
            }
            CountedPlace::Line(name) => {
                found.extend(["in", "out"].map(|direction| counted(name, direction, "total_increasing")));
            }
        }
    }
    found
}

/// Identifier of a name: Home Assistant takes letters, digits, `_` and `-`. Names that need another character get the
/// name's digest, so that different names stay different.
fn identifier(name: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
    if !name.is_empty() && name.chars().all(is_plain) {
        return name.to_owned();
    }
    let plain: String = name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    format!("{plain}_{}", &blake3::hash(name.as_bytes()).to_hex()[..6])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_place_has_its_sensors_with_names_that_home_assistant_takes() {
        let topics = Topics::new("roomtrack", "Café #1");
        let places = [
            CountedPlace::Area("room"),
            CountedPlace::Area("a b"),
            CountedPlace::Area("a_b"),
            CountedPlace::Line("gate"),
        ];
        let found = announcement("Café #1", &topics, &places);
        assert_eq!(found.len(), 8);
        let unique: BTreeSet<String> =
            found.iter().map(|(_, config)| config["unique_id"].to_string()).collect();
        assert_eq!(unique.len(), 8);
        for (topic, config) in &found {
            let levels: Vec<&str> = topic.split('/').collect();
            let [base, component, node, object, end] = levels[..] else { panic!("{topic}") };
            assert_eq!((base, end), ("homeassistant", "config"));
            assert!(["sensor", "binary_sensor"].contains(&component), "{topic}");
            let is_id = |text: &str| text.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
            assert!(is_id(node) && is_id(object), "{topic}");
            assert_eq!(config["availability_topic"], "roomtrack/Café %231/status");
        }
        let gate = found.iter().find(|(topic, _)| topic.ends_with("gate_in/config")).unwrap();
        assert_eq!(gate.1["state_topic"], "roomtrack/Café %231/count/gate");
        assert_eq!(gate.1["value_template"], "{{ value_json.in }}");
    }
}
