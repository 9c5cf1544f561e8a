//! Topics of a room.

use std::fmt::Write;

/// Prefix of all topics unless the address names another.
pub(super) const DEFAULT_PREFIX: &str = "roomtrack";

/// Topics of one room: `PREFIX/ROOM/…`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Topics {
    prefix: String,
    base: String,
}

impl Topics {
    /// Topics of the room of this name below a prefix.
    pub(super) fn new(prefix: &str, room: &str) -> Self {
        Self { prefix: prefix.to_owned(), base: format!("{prefix}/{}", level(room)) }
    }

    /// People of the latest frame.
    pub(super) fn people(&self) -> String {
        format!("{}/people", self.base)
    }

    /// Events, one a message.
    pub(super) fn event(&self) -> String {
        format!("{}/event", self.base)
    }

    /// Counts of a zone, region or line, or of `room`.
    pub(super) fn count(&self, name: &str) -> String {
        format!("{}/count/{}", self.base, level(name))
    }

    /// `online` while the tracker runs, else `offline`.
    pub(super) fn status(&self) -> String {
        format!("{}/status", self.base)
    }

    /// Topic at which consumers of `SceneScape` look for a scene's objects, where the prefix is `scenescape`.
    pub(super) fn regulated_scene(&self, scene: &str) -> String {
        format!("{}/regulated/scene/{scene}", self.prefix)
    }
}

/// A name as one level of a topic: percent-encoded where a character has a meaning in topics. Different names stay
/// different.
fn level(name: &str) -> String {
    let mut level = String::with_capacity(name.len());
    for c in name.chars() {
        if matches!(c, '/' | '+' | '#' | '%') || c.is_control() {
            let mut bytes = [0; 4];
            for byte in c.encode_utf8(&mut bytes).bytes() {
                // Writing to a string cannot fail.
                let _ = write!(level, "%{byte:02X}");
            }
        } else {
            level.push(c);
        }
    }
    level
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_single_levels_that_stay_different() {
        let names = ["counter", "a/b", "a%2Fb", "a+b", "#", "Küche links", "a\nb"];
        let levels: Vec<String> = names.iter().map(|name| level(name)).collect();
        assert_eq!(levels, ["counter", "a%2Fb", "a%252Fb", "a%2Bb", "%23", "Küche links", "a%0Ab"]);
        let topics = Topics::new("site/x", "hall #1");
        assert_eq!(topics.people(), "site/x/hall %231/people");
        assert_eq!(topics.count("a/b"), "site/x/hall %231/count/a%2Fb");
        assert_eq!(topics.regulated_scene("7"), "site/x/regulated/scene/7");
    }
}
