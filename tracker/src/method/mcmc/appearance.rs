//! Where and how often people are expected to appear, and where they are proposed to: through the zones, and out of the
//! company of somebody with whom they were taken for one.
//!
//! Who comes in beside somebody, or hidden by them, cannot be born there: births keep a body's width from everybody. Once the
//! two part, nobody is in a zone any more. So somebody may also appear where, close to a person who is followed in sight, a
//! camera has most of a person whom none of the predicted people explains.

use nalgebra::Point2;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::births::BirthMap;
use crate::likelihood::prior::LOG_IMPOSSIBLE;
use crate::stage::Floor;

/// Two people who were taken for one until now are no farther apart than this.
pub(super) const COMPANY_M: f64 = 1.2;

/// The one of them who is new has to explain so many times what somebody in a zone does: what is left over beside a person
/// is mostly theirs, in every camera.
const COMPANY_EVIDENCE: f64 = 3.0;

/// The part of ADD's proposals that go to company, where there is any.
const TO_COMPANY: f64 = 0.5;

/// The logarithm of the density of those who come out of somebody's company, 1/m², where so many are expected of everybody
/// and chance explains so many nats of whoever appears in a zone.
pub(super) fn log_company_density(expected: f64, chance_nats: f64) -> f64 {
    let around_m2 = std::f64::consts::PI * COMPANY_M.powi(2);
    (expected / around_m2).ln() - COMPANY_EVIDENCE * chance_nats
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
    /// Where company comes apart, weighed for this moment.
    pub(super) company: &'a BirthMap,
    /// Of the expected number a m² there.
    pub(super) log_company_density: f64,
}

impl Appearance<'_> {
    /// The logarithm of the expected number of people who appear at a place in this moment, a m²; [`LOG_IMPOSSIBLE`] where
    /// nobody does.
    pub(super) fn log_density(&self, x_m: f64, y_m: f64) -> f64 {
        if self.anywhere || self.floor.may_appear(x_m, y_m) {
            self.log_density
        } else if self.company.density(x_m, y_m, 1.0) > 0.0 {
            self.log_company_density
        } else {
            LOG_IMPOSSIBLE
        }
    }

    /// Whether anybody may appear at a place.
    pub(super) fn is_possible(&self, x_m: f64, y_m: f64) -> bool {
        self.log_density(x_m, y_m) > LOG_IMPOSSIBLE
    }

    /// Whether there is nowhere to appear.
    pub(super) fn is_nowhere(&self) -> bool {
        self.births.is_empty() && !self.company.is_weighed()
    }

    /// Proposes a place, which need not be a possible one. There must be somewhere to appear.
    pub(super) fn sample(&self, rng: &mut Pcg64Mcg) -> Point2<f64> {
        let to_company = self.to_company();
        if to_company > 0.0 && rng.random::<f64>() < to_company {
            self.company.sample(1.0, rng)
        } else {
            self.births.sample(self.informed, rng)
        }
    }

    /// The density of [`Self::sample`] at a place, 1/m².
    pub(super) fn proposal_density(&self, x_m: f64, y_m: f64) -> f64 {
        let to_company = self.to_company();
        let mut density = 0.0;
        if to_company > 0.0 {
            density += to_company * self.company.density(x_m, y_m, 1.0);
        }
        if to_company < 1.0 {
            density += (1.0 - to_company) * self.births.density(x_m, y_m, self.informed);
        }
        density
    }

    fn to_company(&self) -> f64 {
        if !self.company.is_weighed() {
            0.0
        } else if self.births.is_empty() {
            1.0
        } else {
            TO_COMPANY
        }
    }
}
