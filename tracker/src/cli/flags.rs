//! Names of the library's options on the command line, for error lines.

use shell::options::FlagNames;

use crate::Error;

/// Flags of the crate's options; those of [`mot`] are named in [`mot::cli`].
const FLAGS: FlagNames = FlagNames {
    renamed: &[
        ("agents", "--method agents"),
        ("alignments", "--offset"),
        ("condensation", "--method condensation"),
        ("counts_every_s", "--counts-every"),
        ("expected", "--stations"),
        ("labelled", "--boxes"),
        ("lag_s", "--lag"),
        ("latency_s", "--latency"),
        ("life.max_people", "--most-people"),
        ("max_height_px", "--max-height"),
        ("max_people", "--most-people"),
        ("min_height_px", "--min-height"),
        ("ports", "--video"),
        ("tls", "--tls-certificate"),
        ("tls.authority", "--tls-authority"),
        ("tls.certificate", "--tls-certificate"),
        ("tls.key", "--tls-key"),
        ("via_router", "--router"),
        ("videos", "--video"),
        ("working_width_px", "--mask-width"),
    ],
    same: &[
        "allow",
        "background",
        "connect",
        "detections",
        "hypotheses",
        "layers",
        "listen",
        "masks",
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
        "view",
    ],
};

/// The error with the flag in place of the field that an [`Error::Option`] names; other errors stay.
pub(super) fn named(error: anyhow::Error) -> anyhow::Error {
    FLAGS.put_in_error(error, |error| if let Error::Option(option) = error { Some(option) } else { None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;
    use clap::CommandFactory;

    #[test]
    fn every_name_is_a_flag_of_the_program() {
        assert_eq!(FLAGS.missing_in(&super::super::Arguments::command()), [""; 0]);
    }

    #[test]
    fn fields_become_flags_below_a_context_and_other_errors_stay() {
        let error = Error::option("lag_s", "is 0");
        let within = Err::<(), _>(error).context("a.txt").unwrap_err();
        assert_eq!(format!("{:#}", named(within)), "a.txt: --lag: is 0");
        assert_eq!(named(anyhow::anyhow!("rate")).to_string(), "rate");
    }
}
