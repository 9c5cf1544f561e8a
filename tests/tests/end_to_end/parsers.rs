//! Readers of files and packets on damaged and hostile content: each ends in a value or in one line of error, soon.
//!
//! Good files are changed at random: bytes, numbers that no file should hold, lines cut, doubled and left out. `make fuzz` looks
//! for what this does not find, guided by coverage.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use tests::readers::readers;

/// Changes of each file.
const ROUNDS: u32 = 150;
/// Longest time of one reading.
const LONGEST: Duration = Duration::from_secs(10);

/// Texts that take the place of a number or a word; the fuzzer's are in `tests/fuzz/hostile.dict`.
const HOSTILE: [&str; 18] = [
    "1e308",
    "-1e308",
    "nan",
    "inf",
    "1e-320",
    "-1",
    "0",
    "4294967295",
    "4294967296",
    "-2147483648",
    "9223372036854775807",
    "18446744073709551615",
    "1e12",
    "\u{0}",
    "\u{1b}[2J",
    "\"",
    "[[[[[[[[",
    "99999999999999999999",
];

/// The content after a few random changes.
fn changed(content: &[u8], rng: &mut Pcg64Mcg) -> Vec<u8> {
    let mut bytes = content.to_vec();
    for _ in 0..rng.random_range(1..5) {
        if bytes.is_empty() {
            break;
        }
        let (a, b) = (rng.random_range(0..bytes.len()), rng.random_range(0..bytes.len()));
        let (low, high) = (a.min(b), a.max(b));
        let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'_');
        match rng.random_range(0..6) {
            0 => bytes[a] = rng.random(),
            1 => bytes.truncate(a),
            2 => drop(bytes.drain(low..high)),
            3 => {
                let part = bytes[low..high].to_vec();
                bytes.splice(b..b, part);
            }
            _ => {
                // The word around a place.
                let from = bytes[..a].iter().rposition(|byte| !is_word(byte)).map_or(0, |i| i + 1);
                let to = bytes[a..].iter().position(|byte| !is_word(byte)).map_or(bytes.len(), |i| a + i);
                let hostile = HOSTILE[rng.random_range(0..HOSTILE.len())];
                bytes.splice(from.min(to)..to, hostile.bytes());
            }
        }
    }
    bytes
}

#[test]
fn damaged_files_are_read_or_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    for (kind, reader) in readers().unwrap().iter().enumerate() {
        let name = reader.name;
        let path = reader.prepare(folder.path()).unwrap();
        std::fs::write(&path, &reader.content).unwrap();
        assert_eq!(reader.read(&path), Ok(()), "{name} is good");
        let mut refused = 0;
        for round in 0..ROUNDS {
            let mut rng = Pcg64Mcg::seed_from_u64(u64::from(round) << 8 | kind as u64);
            let bytes = changed(&reader.content, &mut rng);
            std::fs::write(&path, &bytes).unwrap();
            let begun = Instant::now();
            let shown = String::from_utf8_lossy(&bytes);
            let answer = std::panic::catch_unwind(|| reader.read(&path))
                .unwrap_or_else(|_| panic!("{name}, round {round}: {shown:?}"));
            assert!(begun.elapsed() < LONGEST, "{name}, round {round}: {shown:?}");
            refused += u32::from(answer.is_err());
        }
        assert!(refused > ROUNDS / 10, "{name}: {refused} of {ROUNDS} are refused");
    }
}

/// Inputs that cover most of what the fuzzer has ever reached in a reader, and those that one did not survive.
#[test]
fn inputs_that_the_fuzzer_found_are_read_or_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let corpus = folder.path().join("corpus");
    std::fs::create_dir(&corpus).unwrap();
    let archive = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus.tar.gz");
    let status = Command::new("tar").arg("-xzf").arg(&archive).arg("-C").arg(&corpus).status().unwrap();
    assert!(status.success(), "{}", archive.display());
    for reader in readers().unwrap() {
        let path = reader.prepare(folder.path()).unwrap();
        let inputs = std::fs::read_dir(corpus.join(reader.name.replace('/', "-"))).unwrap();
        let mut count = 0;
        for input in inputs {
            let input = input.unwrap().path();
            std::fs::copy(&input, &path).unwrap();
            let begun = Instant::now();
            // Both are right answers; what must not happen is a panic, a long wait, or an error of several lines.
            let _answer = std::panic::catch_unwind(|| reader.read(&path))
                .unwrap_or_else(|_| panic!("{}: {}", reader.name, input.display()));
            assert!(begun.elapsed() < LONGEST, "{}: {}", reader.name, input.display());
            count += 1;
        }
        assert!(count > 20, "{}: {count} inputs", reader.name);
    }
}
