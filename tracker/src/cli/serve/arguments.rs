//! A table of options as arguments of `tracker run`. The names, and whether they take values, are those of its own
//! definition.

use clap::{Arg, ArgAction, Args, Command};
use toml::Value;

use super::site_file::Options;
use crate::cli::run_arguments::RunArgs;

/// Options that a service decides itself, with the mend.
const REFUSED: [(&str, &str); 4] = [
    ("out", "give the folder as `out` of the site or of the room"),
    ("video", "list the cameras in the room's table `cameras`"),
    ("start", "leave it out: a service knows the time of day"),
    ("smooth", "leave it out: it needs a whole recording"),
];

/// `--KEY=VALUE` for each option, in the order of their names. The error is `key: problem; mend`.
pub(super) fn arguments(options: &Options) -> Result<Vec<String>, String> {
    let command = RunArgs::augment_args(Command::new("run"));
    let mut arguments = Vec::new();
    for (key, value) in options {
        if let Some((_, mend)) = REFUSED.iter().find(|(name, _)| name == key) {
            return Err(format!("`{key}`: is no option of a service's rooms; {mend}"));
        }
        let option = command.get_arguments().find(|argument| argument.get_long() == Some(key));
        let option = option.ok_or_else(|| unknown(&command, key))?;
        let given = of_option(option, key, value).map_err(|problem| format!("`{key}`: {problem}"))?;
        arguments.extend(given);
    }
    Ok(arguments)
}

/// `NAME=VALUE`, as cameras are given.
pub(super) fn named(name: &str, value: &Value) -> Result<String, String> {
    Ok(format!("{name}={}", text(value).ok_or("is no text or number; give a stream, a file or a device")?))
}

fn of_option(option: &Arg, key: &str, value: &Value) -> Result<Vec<String>, String> {
    if matches!(option.get_action(), ArgAction::SetTrue) {
        return match value {
            Value::Boolean(true) => Ok(vec![format!("--{key}")]),
            Value::Boolean(false) => Ok(Vec::new()),
            _ => Err("is a switch; give true or false".into()),
        };
    }
    let values = match value {
        Value::Boolean(_) => return Err("takes a value, not true or false; see `tracker run --help`".into()),
        Value::Array(values) => values.iter().map(text).collect::<Option<Vec<_>>>(),
        Value::Table(values) => {
            let pairs = values.iter().map(|(name, value)| Some(format!("{name}={}", text(value)?)));
            pairs.collect::<Option<Vec<_>>>()
        }
        value => text(value).map(|text| vec![text]),
    };
    let values = values.ok_or("is nested; give a text, a number, a list or a table of these")?;
    if values.len() > 1 && !matches!(option.get_action(), ArgAction::Append) {
        return Err("takes one value; give one".into());
    }
    Ok(values.into_iter().map(|value| format!("--{key}={value}")).collect())
}

/// A single value as an argument.
fn text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(number) => Some(number.to_string()),
        Value::Float(number) => Some(number.to_string()),
        Value::Datetime(time) => Some(time.to_string()),
        Value::Boolean(_) | Value::Array(_) | Value::Table(_) => None,
    }
}

/// Error of a key that is no option; one with a similar name is proposed.
fn unknown(command: &Command, key: &str) -> String {
    let own = ["name", "path", "out", "cameras"];
    let names = command.get_arguments().filter_map(Arg::get_long).chain(own);
    let plain = key.replace('_', "-").to_lowercase();
    let nearest = names.map(|name| (distance(name, &plain), name)).min();
    let mend = match nearest {
        Some((distance, name)) if distance <= 1 + key.len() / 4 => format!("is `{name}` meant?"),
        _ => "the keys are the long options of `tracker run --help`".to_owned(),
    };
    format!("`{key}`: is no option; {mend}")
}

/// Number of letters to insert, remove or replace (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.chars().count()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.chars().enumerate() {
            let above = row[j + 1];
            row[j + 1] = (diagonal + usize::from(x != y)).min(above + 1).min(row[j] + 1);
            diagonal = above;
        }
    }
    row.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<Vec<String>, String> {
        arguments(&toml::from_str::<Options>(text).unwrap())
    }

    #[test]
    fn every_kind_of_value_becomes_arguments() {
        let text = "no-film = true\nno-occlusion = false\nlatency = 0.5\nseed = 7\nevents = \"on\"\n\
             times = [\"a=a.txt\", \"b=b.txt\"]\n[offset]\nb = -2.4\n[background]\na = \"empty.mp4\"";
        let expected = [
            "--background=a=empty.mp4",
            "--events=on",
            "--latency=0.5",
            "--no-film",
            "--offset=b=-2.4",
            "--seed=7",
            "--times=a=a.txt",
            "--times=b=b.txt",
        ];
        assert_eq!(of(text).unwrap(), expected);
    }

    #[test]
    fn keys_and_values_that_are_no_options_are_named_with_the_mend() {
        for (text, words) in [
            ("counts_every = 60", ["`counts_every`", "is `counts-every` meant?"]),
            ("camera = 1", ["`camera`", "is `cameras` meant?"]),
            ("colour = 1", ["`colour`", "tracker run --help"]),
            ("no-film = 1", ["`no-film`", "true or false"]),
            ("latency = true", ["`latency`", "takes a value"]),
            ("latency = [0.1, 0.2]", ["`latency`", "one value"]),
            ("offset = [[1]]", ["`offset`", "nested"]),
            ("out = \"x\"", ["`out`", "of the site"]),
            ("video = \"a=b\"", ["`video`", "cameras"]),
            ("start = \"now\"", ["`start`", "leave it out"]),
        ] {
            let line = of(text).unwrap_err();
            assert!(words.iter().all(|word| line.contains(word)), "{line}");
        }
    }
}
