//! How much the contacts of two cameras' surfaces are worth.
//!
//! Where a capture's motion has bent its space, its surfaces err together, however many contacts there are; laid on another
//! camera's they then keep a distance that no turn or stretch takes away. Stereo's noise keeps them apart as well, and picks'
//! depths are read at edges, where the next surface begins: a space is bent if both say so. Even a straight space has errors
//! that all its surface shares, such as a tenth of a pixel by which features were drawn along, so contacts are never worth
//! their number.

use nalgebra::Similarity3;

use crate::merge::overlap::Contact;

/// As many independent observations as stereo's own errors leave in the contacts of two cameras: neighbours err together.
const STEREO: f64 = 64.0;
/// The same where pictures' matches hold the cameras: two spaces that are bent alike agree and turn the cameras all the same,
/// which a hand's picks are too coarse to tell, and matches are not.
const STEREO_BESIDE_MATCHES: f64 = 4.0;
/// In how many ways a space bends: by depth, across and along the image. What is bent is known as often.
const BENDS: f64 = 3.0;

/// The number of independent observations, of stereo's standard deviation, that the contacts of each pair of cameras count
/// as.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Worth {
    cameras: usize,
    /// What contacts of straight spaces count as.
    stereo: f64,
    /// Row by row, the lower camera first.
    independent: Vec<f64>,
}

impl Worth {
    /// Only stereo errs; `beside_matches`: whether pictures' matches hold the cameras.
    pub(super) fn straight(cameras: usize, beside_matches: bool) -> Self {
        let stereo = if beside_matches { STEREO_BESIDE_MATCHES } else { STEREO };
        Self { cameras, stereo, independent: vec![stereo; cameras * cameras] }
    }

    /// The same from what contacts keep between surfaces that were laid on each other; `depth_sigma` is stereo's own, and
    /// `pick_sigma` what depths at picks turned out to be off by.
    pub(super) fn bent(
        mut self,
        contacts: &[Contact],
        poses: &[Similarity3<f64>],
        depth_sigma: f64,
        pick_sigma: f64,
    ) -> Self {
        /// Of the absolute value of a normal variable.
        const MEDIAN: f64 = 0.6745;
        /// Up to so many times what stereo claims for a single pick, a space may be straight.
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

    /// A factor for each contact's residual.
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
