//! What can be set of the agents.

use super::modern::ModernOptions;
use super::published::PublishedOptions;
use crate::method::mcmc::McmcOptions;

/// Options of all stations.
#[derive(Debug, Clone, PartialEq)]
pub struct AgentsOptions {
    /// Image tracking. Each station adds its number to the seed.
    pub sampler: McmcOptions,
    /// The rule by which agents work together.
    pub rule: RuleOptions,
}

/// A rule with its options.
#[derive(Debug, Clone, PartialEq)]
pub enum RuleOptions {
    /// Each station assigns what it hears by itself: the default.
    Modern(ModernOptions),
    /// Confidences, agencies and mediators, as published.
    Published(PublishedOptions),
}
