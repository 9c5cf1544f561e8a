//! Keys under which stations and gatherers, and stations that track together, find each other and exchange messages.
//!
//! | key | content |
//! |---|---|
//! | `roomtrack/station/VERSION/ROOM/CAMERA/STATION` | liveliness token of a station |
//! | `roomtrack/gatherer/VERSION/ROOM/GATHERER` | liveliness token of a gatherer |
//! | `roomtrack/VERSION/ROOM/up/CAMERA/STATION/GATHERER` | messages of a station |
//! | `roomtrack/VERSION/ROOM/down/CAMERA/STATION/GATHERER` | messages to a station |
//! | `roomtrack/agents/VERSION/ROOM/CAMERA/LIFE` | liveliness token of a station that tracks with others |
//! | `roomtrack/VERSION/ROOM/agents/CAMERA` | packets of such a station |
//!
//! VERSION is the encoding's (for agents: the packets'), LIFE a number drawn at the start, ROOM the [`Fingerprint`] in
//! hexadecimal digits, STATION and GATHERER the Zenoh ids of their sessions. CAMERA is the camera's name with every
//! byte except ASCII letters, digits, `-` and `_` written as `%XX`. The tokens' keys are the same in all versions, so
//! that other versions are noticed.

use super::Fingerprint;
use super::encoding::VERSION;
use super::packet::PACKET_VERSION;

/// Every token of a station.
pub(super) const STATIONS: &str = "roomtrack/station/*/*/*/*";
/// Every token of a gatherer.
pub(super) const GATHERERS: &str = "roomtrack/gatherer/*/*/*";
/// Every token of a station that tracks with others.
pub(super) const AGENTS: &str = "roomtrack/agents/*/*/*/*";
/// Every key of this program.
pub(super) const ALL: &str = "roomtrack/**";

/// Contents of a liveliness token's key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Token {
    /// Version of the encoding that its owner uses.
    pub version: String,
    /// Its owner's room.
    pub room: String,
    /// Camera of a station; `None` for a gatherer.
    pub camera: Option<String>,
    /// Its owner's id.
    pub id: String,
}

impl Token {
    /// Token of a station or, without a camera, of a gatherer of this version.
    pub(super) fn new(room: Fingerprint, camera: Option<&str>, id: &str) -> Self {
        Self {
            version: VERSION.to_string(),
            room: room.to_string(),
            camera: camera.map(str::to_owned),
            id: id.to_owned(),
        }
    }

    /// Key of the token.
    pub(super) fn key(&self) -> String {
        let Self { version, room, camera, id } = self;
        match camera {
            Some(camera) => format!("roomtrack/station/{version}/{room}/{}/{id}", escaped(camera)),
            None => format!("roomtrack/gatherer/{version}/{room}/{id}"),
        }
    }

    /// Parses the token of a key; `None` for other keys.
    pub(super) fn of(key: &str) -> Option<Self> {
        let parts: Vec<&str> = key.split('/').collect();
        let (version, room, camera, id) = match parts[..] {
            ["roomtrack", "station", version, room, camera, id] => {
                (version, room, Some(unescaped(camera)?), id)
            }
            ["roomtrack", "gatherer", version, room, id] => (version, room, None, id),
            _ => return None,
        };
        Some(Self { version: version.into(), room: room.into(), camera, id: id.into() })
    }
}

/// Key of the messages from (`up`) or to (`down`) a station.
pub(super) fn messages(room: Fingerprint, way: &str, camera: &str, station: &str, gatherer: &str) -> String {
    format!("roomtrack/{VERSION}/{room}/{way}/{}/{station}/{gatherer}", escaped(camera))
}

/// Keys of all messages to one gatherer.
pub(super) fn messages_to_gatherer(room: Fingerprint, gatherer: &str) -> String {
    format!("roomtrack/{VERSION}/{room}/up/*/*/{gatherer}")
}

/// Keys of all messages to one station.
pub(super) fn messages_to_station(room: Fingerprint, camera: &str, station: &str) -> String {
    format!("roomtrack/{VERSION}/{room}/down/{}/{station}/*", escaped(camera))
}

/// Camera, station and gatherer of a message's key.
pub(super) fn parties(key: &str) -> Option<(String, String, String)> {
    let mut parts = key.rsplit('/');
    let (gatherer, station, camera) = (parts.next()?, parts.next()?, parts.next()?);
    Some((unescaped(camera)?, station.to_owned(), gatherer.to_owned()))
}

/// Contents of the key of the liveliness token of a station that tracks with others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct AgentsToken {
    /// Version of the packets that the station uses.
    pub version: String,
    /// Its room.
    pub room: String,
    /// Its camera.
    pub camera: String,
    /// Number drawn at its start.
    pub life: u32,
}

impl AgentsToken {
    /// Token of a station of this version.
    pub(super) fn new(room: Fingerprint, camera: &str, life: u32) -> Self {
        Self { version: PACKET_VERSION.to_string(), room: room.to_string(), camera: camera.to_owned(), life }
    }

    /// Key of the token.
    pub(super) fn key(&self) -> String {
        let Self { version, room, camera, life } = self;
        format!("roomtrack/agents/{version}/{room}/{}/{life:x}", escaped(camera))
    }

    /// Parses the token of a key; `None` for other keys.
    pub(super) fn of(key: &str) -> Option<Self> {
        let parts: Vec<&str> = key.split('/').collect();
        let ["roomtrack", "agents", version, room, camera, life] = parts[..] else { return None };
        let life = u32::from_str_radix(life, 16).ok()?;
        Some(Self { version: version.into(), room: room.into(), camera: unescaped(camera)?, life })
    }
}

/// Key of the packets of one camera's station, or of all without a camera; of all rooms without a room.
pub(super) fn packets(room: Option<Fingerprint>, camera: Option<&str>) -> String {
    let room = room.map_or("*".to_owned(), |room| room.to_string());
    format!("roomtrack/{PACKET_VERSION}/{room}/agents/{}", camera.map_or("*".to_owned(), escaped))
}

/// Room and camera of a packet's key.
pub(super) fn room_and_camera(key: &str) -> Option<(String, String)> {
    let mut parts = key.rsplit('/');
    let (camera, _, room) = (parts.next()?, parts.next()?, parts.next()?);
    Some((room.to_owned(), unescaped(camera)?))
}

/// Digits of `%XX`.
const HEXADECIMAL: &[u8; 16] = b"0123456789ABCDEF";

fn escaped(name: &str) -> String {
    let mut key = String::new();
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_' {
            key.push(char::from(byte));
        } else {
            key.push('%');
            key.extend([byte >> 4, byte & 15].map(|digit| char::from(HEXADECIMAL[usize::from(digit)])));
        }
    }
    key
}

fn unescaped(key: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = key.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        if *first == b'%' {
            let (digits, after) = after.split_at_checked(2)?;
            bytes.push(u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?);
            rest = after;
        } else {
            bytes.push(*first);
            rest = after;
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROOM: Fingerprint = Fingerprint([0xab; Fingerprint::BYTES]);

    proptest! {
        #[test]
        fn every_camera_name_returns_from_its_keys(camera in ".{1,30}") {
            let token = Token::new(ROOM, Some(&camera), "1f2e");
            prop_assert!(!token.key().contains(['*', '$', '?', '#', '@', ' ']));
            prop_assert_eq!(Token::of(&token.key()), Some(token));
            let key = messages(ROOM, "up", &camera, "1f2e", "9a");
            prop_assert_eq!(parties(&key), Some((camera.clone(), "1f2e".to_owned(), "9a".to_owned())));
            let token = AgentsToken::new(ROOM, &camera, 0xdead_beef);
            prop_assert!(!token.key().contains(['*', '$', '?', '#', '@', ' ']));
            prop_assert_eq!(AgentsToken::of(&token.key()), Some(token));
            let key = packets(Some(ROOM), Some(&camera));
            prop_assert_eq!(room_and_camera(&key), Some((ROOM.to_string(), camera)));
        }
    }

    #[test]
    fn other_keys_are_no_tokens() {
        let gatherer = Token::new(ROOM, None, "77");
        assert_eq!(gatherer.key(), "roomtrack/gatherer/1/abababababababab/77");
        assert_eq!(Token::of(&gatherer.key()), Some(gatherer));
        for key in [
            "",
            "roomtrack/station/1/ab/cam0",
            "roomtrack/station/1/ab/%C3%28/7",
            "roomtrack/station/1/ab/%4/7",
            "a/b/c/d/e/f",
        ] {
            assert_eq!(Token::of(key), None, "{key}");
            assert_eq!(AgentsToken::of(key), None, "{key}");
        }
    }
}
