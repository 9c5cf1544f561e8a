//! Order of the names of pictures: numbers in names count as numbers, so that `10.jpg` comes after `9.jpg`.

use std::cmp::Ordering;

/// Sorts names: digits by the number that they write, all else as text. Equal numbers (`1`, `01`) are ordered as text.
///
/// Decimals in names (times in seconds, such as `12.5.png` and `12.25.png`) are read as such: the digits after the point are
/// a fraction. Programs write no zeros at the end of a decimal, so digits after a point that end in one, and differ in
/// number from name to name, are a number of their own (`2.9.png`, `2.10.png`).
pub(super) fn sort_by_number<T>(entries: &mut [T], name: impl Fn(&T) -> String) {
    let names: Vec<String> = entries.iter().map(&name).collect();
    let has_decimals = are_decimals(&names);
    entries.sort_by(|a, b| compare(&name(a), &name(b), has_decimals));
}

/// A part of a name.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part<'a> {
    Text(&'a str),
    Digits {
        digits: &'a str,
        /// Whether a point, and digits before it, precede these digits.
        follows_point: bool,
    },
}

fn compare(a: &str, b: &str, has_decimals: bool) -> Ordering {
    let by_part = |(a, b): (Part<'_>, Part<'_>)| match (a, b) {
        (
            Part::Digits { digits: a, follows_point: true },
            Part::Digits { digits: b, follows_point: true },
        ) if has_decimals => a.trim_end_matches('0').cmp(b.trim_end_matches('0')),
        (Part::Digits { digits: a, .. }, Part::Digits { digits: b, .. }) => {
            let (a, b) = (a.trim_start_matches('0'), b.trim_start_matches('0'));
            a.len().cmp(&b.len()).then_with(|| a.cmp(b))
        }
        (Part::Digits { digits: a, .. } | Part::Text(a), Part::Digits { digits: b, .. } | Part::Text(b)) => {
            a.cmp(b)
        }
    };
    let (parts_a, parts_b) = (parts(a), parts(b));
    let first_difference =
        parts_a.iter().copied().zip(parts_b.iter().copied()).map(by_part).find(|o| o.is_ne());
    first_difference.unwrap_or_else(|| parts_a.len().cmp(&parts_b.len())).then_with(|| a.cmp(b))
}

/// Whether the digits after a point in these names are fractions.
fn are_decimals(names: &[String]) -> bool {
    let parts_of_all: Vec<Vec<Part<'_>>> = names.iter().map(|name| parts(name)).collect();
    let fractions = parts_of_all.iter().flatten().filter_map(|part| match part {
        Part::Digits { digits, follows_point: true } => Some(*digits),
        _ => None,
    });
    let ends_in_zero = |digits: &str| digits.len() > 1 && digits.ends_with('0');
    let mut lengths: Vec<usize> = fractions.clone().map(str::len).collect();
    lengths.sort_unstable();
    lengths.dedup();
    lengths.len() > 1 && !fractions.clone().any(ends_in_zero)
}

/// Splits a name into runs of digits and the text between them.
fn parts(name: &str) -> Vec<Part<'_>> {
    let mut parts: Vec<Part<'_>> = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let is_number = first.is_ascii_digit();
        let end = rest.find(|c: char| c.is_ascii_digit() != is_number).unwrap_or(rest.len());
        let (run, after) = rest.split_at(end);
        let is_point = matches!(parts.as_slice(), [.., Part::Digits { .. }, Part::Text(".")]);
        parts.push(if is_number {
            Part::Digits { digits: run, follows_point: is_point }
        } else {
            Part::Text(run)
        });
        rest = after;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sorted(names: &[&str]) -> Vec<String> {
        let mut names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        sort_by_number(&mut names, String::clone);
        names
    }

    #[test]
    fn numbers_in_names_count_as_numbers() {
        for ordered in [
            &["1.jpg", "2.jpg", "9.jpg", "10.jpg", "11.jpg", "100.jpg"][..],
            &["frame-9.png", "frame-10.png"],
            &["a1_2.png", "a1_10.png", "a2_1.png", "a10_1.png"],
            &["0007.png", "0008.png", "0010.png"],
            &["008.png", "8.png", "9.png", "010.png"],
            &["a.png", "b.png", "c.png"],
            // More digits than any machine word holds.
            &["9.png", "123456789012345678901234567890.png", "123456789012345678901234567891.png"],
            // Times in seconds.
            &["12.25.png", "12.5.png", "12.75.png", "13.0.png", "100.0.png"],
            &["1305031102.175304.png", "1305031102.211214.png", "1305031103.043227.png"],
            // Two numbers with a point between them.
            &["2.8.png", "2.9.png", "2.10.png", "2.11.png"],
        ] {
            let backwards: Vec<&str> = ordered.iter().rev().copied().collect();
            assert_eq!(sorted(&backwards), ordered);
        }
    }

    proptest! {
        #[test]
        fn frames_come_in_the_order_of_their_numbers_at_any_width(
            numbers in prop::collection::btree_set(0u64..1_000_000, 1..30), width in 0usize..8,
        ) {
            let expected: Vec<String> = numbers.iter().map(|n| format!("im_{n:0width$}.jpg")).collect();
            let mut names = expected.clone();
            names.sort();
            sort_by_number(&mut names, String::clone);
            prop_assert_eq!(names, expected);
        }
    }
}
