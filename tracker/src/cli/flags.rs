//! Names of the library's options on the command line, for error lines.

use crate::Error;

/// Fields whose flag has another name, or that only one value of a flag concerns.
const RENAMED: &[(&str, &str)] = &[
    ("agents", "--method agents"),
    ("alignments", "--offset"),
    ("condensation", "--method condensation"),
    ("counts_every_s", "--counts-every"),
    ("expected", "--stations"),
    ("frames_per_s", "--rate"),
    ("labelled", "--boxes"),
    ("lag_s", "--lag"),
    ("latency_s", "--latency"),
    ("life.max_people", "--most-people"),
    ("max_area_change_px2", "--max-area-change"),
    ("max_height_px", "--max-height"),
    ("max_people", "--most-people"),
    ("min_height_px", "--min-height"),
    ("ports", "--video"),
    ("smooth_frames", "--smooth"),
    ("tls", "--tls-certificate"),
    ("tls.authority", "--tls-authority"),
    ("tls.certificate", "--tls-certificate"),
    ("tls.key", "--tls-key"),
    ("to_truth", "--truth-room"),
    ("via_router", "--router"),
    ("videos", "--video"),
    ("working_width_px", "--mask-width"),
];

/// Fields whose flag has the same name, with hyphens.
const SAME: &[&str] = &[
    "allow",
    "background",
    "birth_cost",
    "connect",
    "detection_offset",
    "detections",
    "direction_threshold",
    "folds",
    "gate",
    "hypotheses",
    "layers",
    "link_cost",
    "listen",
    "masks",
    "max_colour_distance",
    "max_distance",
    "max_gap",
    "max_overlap",
    "metrics",
    "min_score",
    "mqtt",
    "mqtt_ca",
    "mqtt_certificate",
    "mqtt_key",
    "mqtt_rate",
    "rate",
    "scale_step",
    "skip",
    "solver",
    "view",
    "window",
];

/// The error with the flag in place of the field that an [`Error::Option`] names; other errors stay.
pub(super) fn named(mut error: anyhow::Error) -> anyhow::Error {
    if let Some(Error::Option { option, .. }) = error.downcast_mut::<Error>()
        && let Some(name) = flag(option)
    {
        *option = name;
    }
    error
}

/// The flag of a field, which a value may follow after a space.
fn flag(option: &str) -> Option<String> {
    let (field, value) = option.split_at(option.find(' ').unwrap_or(option.len()));
    let renamed = RENAMED.iter().find(|(name, _)| *name == field).map(|(_, flag)| (*flag).to_owned());
    let same = || SAME.contains(&field).then(|| format!("--{}", field.replace('_', "-")));
    Some(renamed.or_else(same)? + value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;
    use clap::CommandFactory;

    fn has_flag(command: &clap::Command, flag: &str) -> bool {
        command.get_arguments().any(|argument| argument.get_long() == Some(flag))
            || command.get_subcommands().any(|command| has_flag(command, flag))
    }

    #[test]
    fn every_name_is_a_flag_of_the_program() {
        let command = super::super::Arguments::command();
        let fields = RENAMED.iter().map(|(field, _)| *field).chain(SAME.iter().copied());
        for flag in fields.map(|field| flag(field).unwrap()) {
            let name = flag.split(' ').next().and_then(|name| name.strip_prefix("--")).unwrap();
            assert!(has_flag(&command, name), "{flag}");
        }
    }

    #[test]
    fn fields_become_flags_below_a_context_and_other_errors_stay() {
        let error = |option: &str| anyhow::Error::from(Error::option(option, "is 0"));
        assert_eq!(named(error("max_gap")).to_string(), "--max-gap: is 0");
        assert_eq!(named(error("videos left=a.mp4")).to_string(), "--video left=a.mp4: is 0");
        assert_eq!(named(error("station `max_gap`")).to_string(), "station `max_gap`: is 0");
        let within = Err::<(), _>(error("folds")).context("a.txt").unwrap_err();
        assert_eq!(format!("{:#}", named(within)), "a.txt: --folds: is 0");
        assert_eq!(named(anyhow::anyhow!("rate")).to_string(), "rate");
    }
}
