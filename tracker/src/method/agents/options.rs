//! Options of the stations and their rules.

use super::modern::ModernOptions;
use super::published::PublishedOptions;
use crate::method::mcmc::McmcOptions;

/// Options of all stations.
#[derive(Debug, Clone, PartialEq)]
pub struct AgentsOptions {
    /// Options of image tracking. Each station adds its number to the seed.
    pub sampler: McmcOptions,
    /// Rule by which the agents of several stations cooperate.
    pub rule: RuleOptions,
}

/// A rule with its options.
#[derive(Debug, Clone, PartialEq)]
pub enum RuleOptions {
    /// Each station associates all received measurements itself: the default.
    Modern(ModernOptions),
    /// Confidences, agencies and mediators as published (Nakazawa et al., section 3).
    Published(PublishedOptions),
}
