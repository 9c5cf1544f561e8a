//! The event, as a line of `events.jsonl`.

use std::path::Path;

use mot::CameraState;
use serde::{Deserialize, Serialize};

use crate::{Error, Result, TrackId};

/// Name of the file of events.
pub(super) const EVENTS: &str = "events.jsonl";

/// Something that happened: a line of `events.jsonl`.
///
/// ```
/// # use tracker::events::{Event, EventKind};
/// let line = r#"{"time":12.4,"frame":149,"kind":"enter","where":"counter","id":3,"x":1.2,"y":0.4}"#;
/// let event: Event = serde_json::from_str(line).unwrap();
/// assert_eq!((event.kind, event.place.as_deref()), (EventKind::Enter, Some("counter")));
/// assert_eq!(serde_json::to_string(&event).unwrap(), line);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Time at which it happened, seconds; earlier than the time at which it was certain.
    pub time: f64,
    /// Number of the last frame that is not after `time`, from 1.
    pub frame: u32,
    /// Kind of the event.
    pub kind: EventKind,
    /// Kind of the event that is taken back; only for [`EventKind::Revoke`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revoked: Option<EventKind>,
    /// Zone, region, line or camera; `None` for an appearance or disappearance outside the zones.
    #[serde(rename = "where")]
    pub place: Option<String>,
    /// The person's track; `None` for an event of a camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<TrackId>,
    /// Position of the person along x, metres; `None` for an event of a camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<f64>,
    /// Position of the person along y, metres; `None` for an event of a camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<f64>,
    /// Duration of the stay, seconds: of the whole stay for [`EventKind::Leave`], so far for [`EventKind::Dwell`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Direction of [`EventKind::Cross`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Direction>,
    /// State of the camera from `time` on, for [`EventKind::Camera`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state: Option<CameraState>,
    /// Time of day of `time`, RFC 3339, where the run knows it (`tracker run --start`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<String>,
}

/// Kind of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EventKind {
    /// A track begins; [`Event::place`] is the zone.
    Appear,
    /// A track ends; [`Event::place`] is the zone.
    Disappear,
    /// A person enters a zone or region.
    Enter,
    /// A person leaves a zone or region, or disappears in it.
    Leave,
    /// A stay in a region has passed its `dwell_s`.
    Dwell,
    /// A person crosses a line.
    Cross,
    /// A camera's state changes.
    Camera,
    /// An earlier event with the same fields, whose kind is [`Event::revoked`], did not happen.
    Revoke,
}

/// Direction in which a line is crossed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// From the line's left to its right, walking along it.
    In,
    /// From the line's right to its left.
    Out,
}

impl Event {
    /// The event that takes this one back: the same fields.
    #[must_use]
    pub fn revocation(self) -> Self {
        Self { kind: EventKind::Revoke, revoked: Some(self.kind), ..self }
    }

    /// The event that this one takes back; `None` unless it is of kind [`EventKind::Revoke`].
    pub fn taken_back(&self) -> Option<Self> {
        let kind = self.revoked.filter(|_| self.kind == EventKind::Revoke)?;
        Some(Self { kind, revoked: None, ..self.clone() })
    }

    /// The event's line, with a line break; `path` is for messages.
    ///
    /// # Errors
    /// [`Error::File`] when it cannot be serialised.
    pub fn text(&self, path: &Path) -> Result<String> {
        let json = serde_json::to_string(self).map_err(|e| {
            Error::content(path, format!("frame {}", self.frame), format!("cannot be written ({e})"))
        })?;
        Ok(json + "\n")
    }
}

impl EventKind {
    /// The word in `events.jsonl`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Appear => "appear",
            Self::Disappear => "disappear",
            Self::Enter => "enter",
            Self::Leave => "leave",
            Self::Dwell => "dwell",
            Self::Cross => "cross",
            Self::Camera => "camera",
            Self::Revoke => "revoke",
        }
    }
}
