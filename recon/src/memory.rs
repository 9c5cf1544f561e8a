//! Bound on the memory that the pictures of captures take.
//!
//! While a capture is worked on, its frames are in memory, and their brightness in single precision beside them: by far the most
//! that a build holds; what refinement in filmed pictures keeps of features is less than the brightness, which is gone by then.
//! A bound decides how many captures are worked on at a time, and, where one alone does not fit, how many
//! of its frames are used.

use std::str::FromStr;

use crate::working_size::WorkingSize;

/// Bytes that a pixel of a frame takes at the most: three of its colours, four of its brightness.
const PER_PIXEL: u64 = 7;
/// Bytes beside the frames, a capture: the program itself, and pictures of the filmed size while they are decoded.
const BESIDE: u64 = 256 << 20;
/// Bytes that a pixel of the working size takes in stereo, whatever the number of frames.
const STEREO_PER_PIXEL: u64 = 500;
/// Fewest frames that a bound leaves a capture.
const FEWEST_FRAMES: usize = 30;
/// Share of the machine's memory that is used where no bound is given.
const DEFAULT_SHARE: u64 = 4;
/// Memory of a machine that does not state it.
const ASSUMED_BYTES: u64 = 8 << 30;

/// Bound in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryBound(pub u64);

impl Default for MemoryBound {
    /// A quarter of the machine's memory.
    fn default() -> Self {
        let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
        Self(total_bytes(&text).unwrap_or(ASSUMED_BYTES) / DEFAULT_SHARE)
    }
}

/// Memory of the machine by the content of `/proc/meminfo`.
fn total_bytes(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}

impl FromStr for MemoryBound {
    type Err = String;

    /// A number with a unit, as in `6G` or `800M`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no amount of memory; give it as in 6G or 800M, at least 512M");
        let number = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
        let unit: u64 = match text[number.len()..].to_ascii_lowercase().as_str() {
            "g" | "gb" | "gib" => 1 << 30,
            "m" | "mb" | "mib" => 1 << 20,
            _ => return Err(wrong()),
        };
        let number: f64 = number.trim().parse().map_err(|_| wrong())?;
        let bytes = number * unit as f64;
        let is_possible = bytes >= (512_u64 << 20) as f64 && bytes <= (1_u64 << 50) as f64;
        if is_possible { Ok(Self(bytes as u64)) } else { Err(wrong()) }
    }
}

impl MemoryBound {
    /// Most frames of a capture that the bound leaves, at most `most`.
    pub fn frames(self, size: WorkingSize, most: usize) -> usize {
        let left = self.0.saturating_sub(beside(size));
        let fit = left / (PER_PIXEL * size.worked_pixels()).max(1);
        usize::try_from(fit).unwrap_or(usize::MAX).clamp(FEWEST_FRAMES.min(most), most)
    }

    /// Number of captures that are worked on at a time, the first of which need these bytes; at least one.
    pub fn at_a_time(self, needs: &[u64]) -> usize {
        let mut sum = 0_u64;
        let fit = needs.iter().take_while(|need| {
            sum = sum.saturating_add(**need);
            sum <= self.0
        });
        fit.count().max(1)
    }
}

/// Bytes of a capture beside its frames.
fn beside(size: WorkingSize) -> u64 {
    BESIDE + STEREO_PER_PIXEL * size.worked_pixels()
}

/// Bytes that a capture of some frames takes while it is worked on.
pub fn need(size: WorkingSize, frames: usize) -> u64 {
    beside(size).saturating_add(PER_PIXEL.saturating_mul(size.worked_pixels()).saturating_mul(frames as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_have_units() {
        for (text, bytes) in [("6G", 6 << 30), ("800M", 800 << 20), ("1.5GiB", 3 << 29), ("4 gb", 4 << 30)] {
            assert_eq!(text.parse(), Ok(MemoryBound(bytes)), "{text}");
        }
        for text in ["", "6", "G", "-1G", "nanG", "infG", "6T", "100M", "9999999999G", "6Gé"] {
            let line = text.parse::<MemoryBound>().unwrap_err();
            assert!(line.contains("6G"), "{line}");
        }
    }

    #[test]
    fn the_machine_states_its_memory() {
        assert_eq!(total_bytes("MemTotal:       24576 kB\nMemFree: 1 kB\n"), Some(24 << 20));
        assert_eq!(total_bytes("nothing"), None);
        assert!(MemoryBound::default().0 > 0);
    }

    #[test]
    fn captures_take_turns_and_lose_frames_where_they_do_not_fit() {
        let size = WorkingSize::of((3840, 2160));
        let each = need(size, 120);
        assert_eq!(MemoryBound(4 * each).at_a_time(&[each; 3]), 3);
        assert_eq!(MemoryBound(2 * each + 1).at_a_time(&[each; 3]), 2);
        assert_eq!(MemoryBound(each / 2).at_a_time(&[each; 3]), 1);
        assert_eq!(MemoryBound(each).frames(size, 120), 120);
        let fewer = MemoryBound(each - 10 * PER_PIXEL * size.worked_pixels()).frames(size, 120);
        assert_eq!(fewer, 110);
        assert_eq!(MemoryBound(1).frames(size, 120), FEWEST_FRAMES);
        assert_eq!(MemoryBound(1).frames(size, 20), 20);
    }
}
