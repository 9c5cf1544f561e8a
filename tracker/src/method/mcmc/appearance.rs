//! Birth model: the density at which people are expected to appear, and the proposal of ADD. People appear in the
//! zones, at persistent evidence of a person whom no track explains ([`super::rescue`]), and close to a person with
//! whom they were merged.
//!
//! A person who enters beside or behind another one cannot be born there, because births keep a body's width from
//! everybody. When the two part, neither is in a zone any more. A person may therefore also appear close to a
//! followed person in sight, where a camera shows most of a person whom no predicted person explains.

use nalgebra::Point2;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::births::BirthMap;
use super::boxes::Hotspots;
use crate::likelihood::prior::LOG_IMPOSSIBLE;
use crate::prepared_room::Floor;

/// Largest distance between two people who were merged in one track until now, metres.
pub(super) const COMPANY_M: f64 = 1.2;

/// Factor of the evidence that a person leaving a merged pair has to explain, relative to a birth in a zone:
/// foreground beside a followed person mostly belongs to that person, in every camera.
const COMPANY_EVIDENCE: f64 = 3.0;

/// Radius around the places at which other trackers see people, metres.
pub(super) const EXPECTED_M: f64 = 0.8;

/// Factor of the evidence that a birth at persistent evidence has to explain, relative to a birth in a zone.
const RESCUE_EVIDENCE: f64 = 1.0;

/// Fraction of ADD's proposals drawn from the hotspots of a detector's boxes, where there are any.
const TO_HOTSPOTS: f64 = 0.8;

/// Fraction of ADD's remaining proposals drawn from the openings, where there are any.
const TO_OPENINGS: f64 = 0.5;

/// Log density of births close to one followed person, 1/m², for this expected number of births, less the evidence
/// (nats) that chance explains.
pub(super) fn log_company_density(expected: f64, chance_nats: f64) -> f64 {
    let around_m2 = std::f64::consts::PI * COMPANY_M.powi(2);
    (expected / around_m2).ln() - COMPANY_EVIDENCE * chance_nats
}

/// Log density of births at persistent evidence, 1/m², for this expected number of births over this area, less the
/// evidence (nats) that chance explains.
pub(super) fn log_rescue_density(expected: f64, area_m2: f64, chance_nats: f64) -> f64 {
    (expected / area_m2.max(1e-3)).ln() - RESCUE_EVIDENCE * chance_nats
}

/// Log density of births near a place at which another tracker sees a person, 1/m²: one is expected, less the
/// evidence (nats) that chance explains.
pub(super) fn log_expected_density(chance_nats: f64) -> f64 {
    let around_m2 = std::f64::consts::PI * EXPECTED_M.powi(2);
    (1.0 / around_m2).ln() - chance_nats
}

/// Cells outside the zones in which people may appear in a moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Opening<'a> {
    /// Map whose cells of non-zero weight in this moment form the opening.
    pub(super) map: &'a BirthMap,
    /// Log density of births there, 1/m².
    pub(super) log_density: f64,
}

/// Density of births in a moment, a Poisson process over the floor, and density of their proposals.
pub(super) struct Appearance<'a> {
    pub(super) floor: &'a Floor,
    /// Whether people may appear anywhere, because they may have been inside already.
    pub(super) anywhere: bool,
    /// Cells in which ADD proposes people, weighted for this moment: the zones, or the whole floor.
    pub(super) births: &'a BirthMap,
    /// Fraction of those proposals drawn by weight; the rest is uniform.
    pub(super) informed: f64,
    /// Log density of births there, 1/m².
    pub(super) log_density: f64,
    /// Openings outside the zones: near people seen by other trackers, at persistent evidence, close to merged
    /// people. The first one that holds a place gives its density.
    pub(super) openings: [Opening<'a>; 3],
    /// Log density of births everywhere else, 1/m²; [`LOG_IMPOSSIBLE`] without boxes, since only boxes distinguish
    /// people from other moving things.
    pub(super) log_elsewhere: f64,
    /// Places proposed by boxes that no person explains.
    pub(super) hotspots: &'a Hotspots,
}

impl Appearance<'_> {
    /// Log density of births at a place in this moment, 1/m²; [`LOG_IMPOSSIBLE`] where nobody can appear.
    pub(super) fn log_density(&self, x_m: f64, y_m: f64) -> f64 {
        if self.anywhere || self.floor.may_appear(x_m, y_m) {
            self.log_density
        } else {
            let mut holding = self.open().filter(|opening| opening.map.density(x_m, y_m, 1.0) > 0.0);
            holding.next().map_or(self.log_elsewhere, |opening| opening.log_density)
        }
    }

    /// Whether a person can appear at a place.
    pub(super) fn is_possible(&self, x_m: f64, y_m: f64) -> bool {
        self.log_density(x_m, y_m) > LOG_IMPOSSIBLE
    }

    /// Whether ADD has no place to propose.
    pub(super) fn is_nowhere(&self) -> bool {
        self.births.is_empty() && self.open().next().is_none() && self.hotspots.is_empty()
    }

    /// Proposes a place, which need not be a possible one. [`Self::is_nowhere`] must be false.
    pub(super) fn sample(&self, rng: &mut Pcg64Mcg) -> Point2<f64> {
        let to_hotspots = self.share_of_hotspots();
        if to_hotspots > 0.0 && rng.random::<f64>() < to_hotspots {
            return self.hotspots.sample(rng).into();
        }
        let share = self.share_of_opening();
        let mut mark = if share > 0.0 { rng.random::<f64>() } else { 1.0 };
        for opening in self.open() {
            if mark < share {
                return opening.map.sample(1.0, rng);
            }
            mark -= share;
        }
        self.births.sample(self.informed, rng)
    }

    /// Density of [`Self::sample`] at a place, 1/m².
    pub(super) fn proposal_density(&self, x_m: f64, y_m: f64) -> f64 {
        let share = self.share_of_opening();
        let of_openings: f64 = self.open().map(|opening| opening.map.density(x_m, y_m, 1.0)).sum();
        let rest = 1.0 - share * self.open().count() as f64;
        let of_births =
            if self.births.is_empty() { 0.0 } else { self.births.density(x_m, y_m, self.informed) };
        let to_hotspots = self.share_of_hotspots();
        let of_hotspots = if to_hotspots > 0.0 { self.hotspots.density(x_m, y_m) } else { 0.0 };
        to_hotspots * of_hotspots + (1.0 - to_hotspots) * (share * of_openings + rest * of_births)
    }

    /// Openings with a cell of non-zero weight.
    fn open(&self) -> impl Iterator<Item = &Opening<'_>> {
        self.openings.iter().filter(|opening| opening.map.is_weighed())
    }

    /// Fraction of the proposals drawn from the hotspots.
    fn share_of_hotspots(&self) -> f64 {
        if self.hotspots.is_empty() {
            0.0
        } else if self.births.is_empty() && self.open().next().is_none() {
            1.0
        } else {
            TO_HOTSPOTS
        }
    }

    /// Fraction of the remaining proposals drawn from each opening.
    fn share_of_opening(&self) -> f64 {
        let together = if self.births.is_empty() { 1.0 } else { TO_OPENINGS };
        match self.open().count() {
            0 => 0.0,
            n => together / n as f64,
        }
    }
}
