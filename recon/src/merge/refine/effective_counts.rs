//! Effective number of independent observations in the contacts of each camera pair.
//!
//! If a capture's motion has bent its space, its surfaces err together, however many contacts there are; aligned with
//! another camera's they keep a distance that no rotation or scale removes. Stereo's noise keeps them apart as well,
//! and picks' depths are measured at edges, near other surfaces: a space counts as bent if both the contacts and the
//! picks indicate it. Even a straight space has errors common to all its surface, such as a tenth of a pixel of drift
//! of the features, so the effective number is always below the number of contacts.

use nalgebra::Similarity3;

use crate::merge::overlap::Contact;

/// Number of independent observations in the contacts of two straight spaces: neighbouring errors are correlated.
const STEREO: f64 = 64.0;
/// The same number where matches constrain the cameras: two spaces bent alike agree and nevertheless rotate the
/// cameras, which picks by hand are too coarse to reveal, and matches are not.
const STEREO_BESIDE_MATCHES: f64 = 4.0;
/// Number of ways in which a space bends: by depth, across and along the image; a bent space counts as so many
/// observations.
const BENDS: f64 = 3.0;

/// Effective number of independent observations, of stereo's standard deviation, in the contacts of each pair of
/// cameras.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EffectiveCounts {
    cameras: usize,
    /// Number for straight spaces.
    stereo: f64,
    /// Number for each pair, row by row, the lower camera first.
    independent: Vec<f64>,
}

impl EffectiveCounts {
    /// Numbers for straight spaces; `beside_matches`: whether matches constrain the cameras.
    pub(super) fn straight(cameras: usize, beside_matches: bool) -> Self {
        let stereo = if beside_matches { STEREO_BESIDE_MATCHES } else { STEREO };
        Self { cameras, stereo, independent: vec![stereo; cameras * cameras] }
    }

    /// Reduces the numbers by the distances that remain between aligned surfaces; `depth_sigma` is stereo's own
    /// deviation, and `pick_sigma` the estimated one of depths at picks.
    pub(super) fn bent(
        mut self,
        contacts: &[Contact],
        poses: &[Similarity3<f64>],
        depth_sigma: f64,
        pick_sigma: f64,
    ) -> Self {
        /// Median of the absolute value of a standard normal variable.
        const MEDIAN: f64 = 0.6745;
        /// Ratio of the picks' deviation to stereo's up to which a space may be straight.
        const BENT: f64 = 2.0;
        let at_picks = ((pick_sigma / depth_sigma).powi(2) - BENT.powi(2)).max(0.0);
        let mut errors: Vec<Vec<f64>> = vec![Vec::new(); self.independent.len()];
        for contact in contacts {
            errors[self.pair(contact)].push(contact.in_sigmas(poses).abs());
        }
        for (of_pair, independent) in errors.iter_mut().zip(&mut self.independent) {
            of_pair.sort_by(f64::total_cmp);
            if let Some(median) = of_pair.get(of_pair.len() / 2) {
                let bent = (median / MEDIAN).powi(2).min(at_picks);
                *independent = 1.0 / (1.0 / self.stereo + bent / BENDS);
            }
        }
        self
    }

    /// Factor on each contact's residual.
    pub(super) fn weights(&self, contacts: &[Contact]) -> Vec<f64> {
        let mut counts = vec![0_usize; self.independent.len()];
        for contact in contacts {
            counts[self.pair(contact)] += 1;
        }
        let weight = |pair: usize| (self.independent[pair] / counts[pair].max(1) as f64).min(1.0).sqrt();
        contacts.iter().map(|contact| weight(self.pair(contact))).collect()
    }

    fn pair(&self, contact: &Contact) -> usize {
        contact.from.min(contact.onto) * self.cameras + contact.from.max(contact.onto)
    }
}
