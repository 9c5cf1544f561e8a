//! Common requirements on every program's refusal of bad input: one clear line of error, its exit status, no panic.

use std::process::Output;

/// Asserts one line of error with these words, no output of libraries besides warnings and plain lines of progress, and
/// this exit status.
pub(crate) fn refused_with(status: i32, output: &Output, words: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{said}");
    let (errors, others): (Vec<&str>, Vec<&str>) = said.lines().partition(|line| line.starts_with("error: "));
    assert_eq!(errors.len(), 1, "{said}");
    let expected = |line: &&str| {
        let line = line.trim_start();
        line.starts_with("WARN ") || line.starts_with("INFO ") || is_progress(line)
    };
    assert!(others.iter().all(expected), "{said}");
    for word in words {
        assert!(errors[0].contains(word), "`{word}` is not in: {said}");
    }
    let causes: Vec<&str> = errors[0].split(": ").collect();
    for (i, cause) in causes.iter().enumerate() {
        assert!(!causes[i + 1..].contains(cause), "`{cause}` is told twice: {said}");
    }
}

/// [`refused_with`] the exit status of a failed command.
pub(crate) fn refused(output: &Output, words: &[&str]) {
    refused_with(2, output, words);
}

/// `3 of 8  cam1: depth`
fn is_progress(line: &str) -> bool {
    let mut words = line.split_whitespace();
    let mut number = || words.next().is_some_and(|word| word.parse::<usize>().is_ok());
    number() && line.contains(" of ")
}
