//! Memory that stays allocated after reading.

use super::films::noisy_film;
use crate::video::FrameSource;

/// Resident memory of this process, bytes.
#[cfg(target_os = "linux")]
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    let kibibytes: u64 = line.trim().trim_end_matches(" kB").parse().unwrap();
    1024 * kibibytes
}

#[cfg(target_os = "linux")]
#[test]
fn reading_films_again_and_again_takes_no_more_memory() {
    const FILMS: u64 = 16;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("noise.mp4");
    noisy_film(&path, 320, 240, 100);
    let film_bytes = std::fs::metadata(&path).unwrap().len();
    let decode = || {
        let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
        while source.skip() {}
        assert_eq!(source.delivered(), 100);
    };
    decode();
    let before = resident_bytes();
    (0..FILMS).for_each(|_| decode());
    let grown = resident_bytes().saturating_sub(before);
    println!("a film of {film_bytes} bytes, read {FILMS} times: {grown} bytes more");
    // A leak of each film's packets would grow memory by all films together.
    assert!(grown < FILMS * film_bytes / 4, "{grown} bytes more after {FILMS} films of {film_bytes}");
}
