//! Reasons for which a station's packets are left out.

/// Reason for which packets are left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Refusal {
    /// Another version of the packets.
    Version,
    /// The station belongs to another room.
    Room,
    /// A camera that the room does not have, or numbers otherwise.
    Camera,
    /// More bytes than a packet can have.
    Oversized,
    /// Bytes that are no packet.
    Malformed,
    /// A sequence number that came before.
    Replayed,
    /// Another station of the same camera is heard already.
    Rival,
    /// The station's clock is wrong by more than a minute, or its capture times are.
    Clock,
    /// More than 2 s on its way.
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
