//! Options of a simulation.

use serde::{Deserialize, Serialize};

/// Layout of the stations and of the people's trajectories.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Six people cross one line at the same time.
    Once,
    /// Four people meet; two of them meet two others after that, one by one.
    Sequence,
    /// Four people walk side by side for 2.5 s; one of them stays and meets two others.
    Along,
    /// Any number of people walk from spot to spot in the hall between the stations.
    Hall,
    /// Any number of people walk along a corridor that closes to a ring, with the stations along it.
    Corridor,
}

impl Layout {
    /// The three layouts of six people.
    pub const SIX: [Self; 3] = [Self::Once, Self::Sequence, Self::Along];
}

impl std::fmt::Display for Layout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Once => "once",
            Self::Sequence => "sequence",
            Self::Along => "along",
            Self::Hall => "hall",
            Self::Corridor => "corridor",
        })
    }
}

/// Measurement errors, each uniform within ± its value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Error along the line of sight, metres.
    pub along_m: f64,
    /// Error across the line of sight, metres.
    pub across_m: f64,
    /// Error of the attribute, which is between 0 and 1.
    pub attribute: f64,
    /// Factor of all errors where people are close.
    pub close_factor: f64,
}

impl Default for Noise {
    /// Errors as published (Nakazawa et al., section 4.2.2).
    fn default() -> Self {
        Self { along_m: 0.6, across_m: 0.3, attribute: 0.15, close_factor: 2.0 }
    }
}

/// Options of a simulated world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Layout of the stations and of the people's trajectories.
    pub layout: Layout,
    /// Number of stations.
    pub stations: usize,
    /// Number of people; six in the layouts of six people.
    pub people: usize,
    /// Length of a trial, seconds.
    pub seconds: f64,
    /// Frame rate, Hz.
    pub rate_hz: f64,
    /// Measurement errors.
    pub noise: Noise,
    /// Fraction of packets lost, independently for each sender, receiver and frame.
    pub loss: f64,
    /// Number of stations whose packets one station receives, the nearest first; `None` for all that overlap.
    pub neighbours: Option<usize>,
    /// Difference of attribute: between persons 3 and 4 in the layouts of six people, and between neighbours in the
    /// order of attributes in the others.
    pub attribute_gap: f64,
    /// Whether stations see only a sector each and walls stand in the hall.
    pub has_partial_views: bool,
}

impl Options {
    /// Experiment 2 as published, in one of the layouts of six people.
    pub fn published(layout: Layout) -> Self {
        Self {
            layout,
            stations: 6,
            people: 6,
            seconds: 26.0,
            rate_hz: 10.0,
            noise: Noise::default(),
            loss: 0.0,
            neighbours: None,
            attribute_gap: 0.1,
            has_partial_views: false,
        }
    }

    /// Harder experiment: partial views, walls, 20 people whose attributes are 0.03 apart, 20 % of the packets lost.
    pub fn hard() -> Self {
        Self {
            stations: 8,
            people: 20,
            seconds: 30.0,
            loss: 0.2,
            attribute_gap: 0.03,
            has_partial_views: true,
            ..Self::published(Layout::Hall)
        }
    }

    /// Corridor in which each station overlaps four neighbours.
    pub fn corridor(stations: usize, people: usize) -> Self {
        Self { stations, people, ..Self::published(Layout::Corridor) }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        (self.seconds * self.rate_hz) as usize
    }
}
