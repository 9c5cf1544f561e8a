//! Names of the library's options on the command line, for error lines.

use shell::options::FlagNames;

use crate::Error;

/// Flags of the crate's options.
const FLAGS: FlagNames = FlagNames {
    renamed: &[
        ("frames_per_s", "--rate"),
        ("max_area_change_px2", "--max-area-change"),
        ("smooth_frames", "--smooth"),
        ("to_truth", "--truth-room"),
    ],
    same: &[
        "birth_cost",
        "detection_offset",
        "direction_threshold",
        "folds",
        "gate",
        "link_cost",
        "max_colour_distance",
        "max_distance",
        "max_gap",
        "min_score",
        "skip",
        "solver",
        "window",
    ],
};

/// The error with the flag in place of the field that an [`Error::Option`] names; other errors stay.
pub(super) fn named(error: anyhow::Error) -> anyhow::Error {
    FLAGS.put_in_error(error, |error| if let Error::Option(option) = error { Some(option) } else { None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Args;

    #[test]
    fn every_name_is_a_flag_of_a_command() {
        let commands = super::super::link::LinkArgs::augment_args(clap::Command::new("mot"));
        let commands =
            commands.subcommand(super::super::eval::EvalArgs::augment_args(clap::Command::new("eval")));
        assert_eq!(FLAGS.missing_in(&commands), [""; 0]);
    }
}
