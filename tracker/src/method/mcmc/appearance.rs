//! Where and how often people are expected to appear, and where they are proposed to: through the zones, at persistent
//! evidence for a person whom nobody explains ([`super::rescue`]), and out of the company of somebody with whom they were
//! taken for one.
//!
//! Who comes in beside somebody, or hidden by them, cannot be born there: births keep a body's width from everybody. Once the
//! two part, nobody is in a zone any more. So somebody may also appear where, close to a person who is followed in sight, a
//! camera has most of a person whom none of the predicted people explains.

use nalgebra::Point2;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::births::BirthMap;
use super::boxes::Hotspots;
use crate::likelihood::prior::LOG_IMPOSSIBLE;
use crate::prepared_room::Floor;

/// Two people who were taken for one until now are no farther apart than this.
pub(super) const COMPANY_M: f64 = 1.2;

/// The one of them who is new has to explain so many times what somebody in a zone does: what is left over beside a person
/// is mostly theirs, in every camera.
const COMPANY_EVIDENCE: f64 = 3.0;

/// People are this near to where others see them, metres.
pub(super) const EXPECTED_M: f64 = 0.8;

/// A person whom persistent evidence shows has to explain so many times what somebody in a zone does.
const RESCUE_EVIDENCE: f64 = 1.0;

/// The part of ADD's proposals that go to places where a detector's boxes ask for people, where there are any.
const TO_HOTSPOTS: f64 = 0.8;

/// The part of ADD's proposals that go to openings, where there are any.
const TO_OPENINGS: f64 = 0.5;

/// The logarithm of the density of those who come out of somebody's company, 1/m², where so many are expected of everybody
/// and chance explains so many nats of whoever appears in a zone.
pub(super) fn log_company_density(expected: f64, chance_nats: f64) -> f64 {
    let around_m2 = std::f64::consts::PI * COMPANY_M.powi(2);
    (expected / around_m2).ln() - COMPANY_EVIDENCE * chance_nats
}

/// The logarithm of the density of births at persistent evidence that fills such an area, 1/m², where so many are expected
/// there together and chance explains so many nats.
pub(super) fn log_rescue_density(expected: f64, area_m2: f64, chance_nats: f64) -> f64 {
    (expected / area_m2.max(1e-3)).ln() - RESCUE_EVIDENCE * chance_nats
}

/// The logarithm of the density of people where others see somebody, 1/m²: one is there, and chance explains so many nats
/// of whoever appears in a zone.
pub(super) fn log_expected_density(chance_nats: f64) -> f64 {
    let around_m2 = std::f64::consts::PI * EXPECTED_M.powi(2);
    (1.0 / around_m2).ln() - chance_nats
}

/// Cells away from the zones where people may appear in a moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Opening<'a> {
    /// The cells: those that are weighed for this moment.
    pub(super) map: &'a BirthMap,
    /// Logarithm of the density of births there, 1/m².
    pub(super) log_density: f64,
}

/// The density of births at a moment, a Poisson process over the floor, and that of their proposals.
pub(super) struct Appearance<'a> {
    pub(super) floor: &'a Floor,
    /// People may appear anywhere: they were inside already.
    pub(super) anywhere: bool,
    /// Where ADD may put people, weighed for this moment: the zones, or anywhere.
    pub(super) births: &'a BirthMap,
    /// The part of those proposals that go by weight.
    pub(super) informed: f64,
    /// Of the expected number a m² there.
    pub(super) log_density: f64,
    /// Where else they may appear: where others see them, at persistent evidence, and where company comes apart. The first
    /// that holds a place decides about it.
    pub(super) openings: [Opening<'a>; 3],
    /// Of the expected number a m² everywhere else; [`LOG_IMPOSSIBLE`] without boxes, which tell people from what else moves.
    pub(super) log_elsewhere: f64,
    /// Where boxes ask for people.
    pub(super) hotspots: &'a Hotspots,
}

impl Appearance<'_> {
    /// The logarithm of the expected number of people who appear at a place in this moment, a m²; [`LOG_IMPOSSIBLE`] where
    /// nobody does.
    pub(super) fn log_density(&self, x_m: f64, y_m: f64) -> f64 {
        if self.anywhere || self.floor.may_appear(x_m, y_m) {
            self.log_density
        } else {
            let mut holding = self.open().filter(|opening| opening.map.density(x_m, y_m, 1.0) > 0.0);
            holding.next().map_or(self.log_elsewhere, |opening| opening.log_density)
        }
    }

    /// Whether anybody may appear at a place.
    pub(super) fn is_possible(&self, x_m: f64, y_m: f64) -> bool {
        self.log_density(x_m, y_m) > LOG_IMPOSSIBLE
    }

    /// Whether there is nowhere to appear.
    pub(super) fn is_nowhere(&self) -> bool {
        self.births.is_empty() && self.open().next().is_none() && self.hotspots.is_empty()
    }

    /// Proposes a place, which need not be a possible one. There must be somewhere to appear.
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

    /// The density of [`Self::sample`] at a place, 1/m².
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

    /// The openings in which a person would explain something.
    fn open(&self) -> impl Iterator<Item = &Opening<'_>> {
        self.openings.iter().filter(|opening| opening.map.is_weighed())
    }

    /// The part of the proposals that goes to hotspots.
    fn share_of_hotspots(&self) -> f64 {
        if self.hotspots.is_empty() {
            0.0
        } else if self.births.is_empty() && self.open().next().is_none() {
            1.0
        } else {
            TO_HOTSPOTS
        }
    }

    /// The part of the rest that goes to each of the openings.
    fn share_of_opening(&self) -> f64 {
        let together = if self.births.is_empty() { 1.0 } else { TO_OPENINGS };
        match self.open().count() {
            0 => 0.0,
            n => together / n as f64,
        }
    }
}
