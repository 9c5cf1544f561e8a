//! Options of the distributed agents, for all stations in one process and for one station a process.

use super::sampler::SamplerArguments;
use crate::method::agents::modern::ModernOptions;
use crate::method::agents::published::PublishedOptions;
use crate::method::agents::{AgentsOptions, RuleOptions};

/// Options of the agents, the same for all stations. `has_boxes_alone`: whether a detector's boxes are all that there is.
pub(super) fn options(
    sampler: &SamplerArguments,
    seed: u64,
    most_people: Option<usize>,
    has_boxes_alone: bool,
) -> anyhow::Result<AgentsOptions> {
    let rule = if sampler.published {
        RuleOptions::Published(PublishedOptions::default())
    } else {
        RuleOptions::Modern(ModernOptions::default())
    };
    let mut sampler = if has_boxes_alone { sampler.of_boxes(seed)? } else { sampler.image_tracking(seed)? };
    sampler.max_people = most_people.unwrap_or(sampler.max_people);
    Ok(AgentsOptions { sampler, rule })
}
