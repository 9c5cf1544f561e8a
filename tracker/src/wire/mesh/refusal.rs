//! Reasons for refusing a station's packets.

/// Reason for refusing packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Refusal {
    /// The packets have another version.
    Version,
    /// The station belongs to another room.
    Room,
    /// The room does not have the camera, or has another number for it.
    Camera,
    /// The packet is too long.
    Oversized,
    /// The bytes are not a packet.
    Malformed,
    /// The sequence number does not grow.
    Replayed,
    /// Another station of the same camera is already heard.
    Rival,
    /// The station's clock is wrong by more than a minute, or its capture times are.
    Clock,
    /// The packet was delayed by more than 2 s.
    Late,
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Version => "of another version",
            Self::Room => "of another room",
            Self::Camera => "of a camera that the room does not have or numbers otherwise",
            Self::Oversized => "too long",
            Self::Malformed => "not readable",
            Self::Replayed => "sent again or out of order",
            Self::Rival => "of a second station of one camera",
            Self::Clock => "of a wrong clock",
            Self::Late => "late",
        })
    }
}
