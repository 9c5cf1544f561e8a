//! Options of the distributed agents, for all stations in one process and for one station a process.

use tracker::method::agents::modern::ModernOptions;
use tracker::method::agents::{AgentsOptions, RuleOptions};

use super::sampler::SamplerArguments;

/// The options of all stations.
pub(super) fn options(
    sampler: &SamplerArguments,
    seed: u64,
    most_people: Option<usize>,
) -> anyhow::Result<AgentsOptions> {
    let mut sampler = sampler.options(seed)?;
    sampler.max_people = most_people.unwrap_or(sampler.max_people);
    Ok(AgentsOptions { sampler, rule: RuleOptions::Modern(ModernOptions::default()) })
}
