//! Commands on disks that are full after a random number of bytes (a limit of each file). Asked: exit status 2 with one line
//! of error, nothing that was there is lost, no half-written file under a final name.
//!
//! `cargo build --release --bins && cargo bench -p tests --bench full_disk [-- SIZES [WORD …]]`: 50 sizes by default; words
//! choose the commands that have one of them.
#![forbid(unsafe_code)]

use tests::chain::StepResult;
use tests::full_disk::WRITERS;

/// Seed of the sizes.
const SEED: u64 = 1000;

fn main() -> StepResult<()> {
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let sizes = asked.iter().find_map(|a| a.parse().ok()).unwrap_or(50);
    let words: Vec<&String> = asked.iter().filter(|a| a.parse::<usize>().is_err()).collect();
    println!("{:<24} {:>8} {:>7} {:>7}", "command", "refused", "enough", "faults");
    let mut faults = 0;
    for writer in WRITERS {
        let name = format!("{} {}", writer.program, writer.arguments[0]);
        if !words.is_empty() && !words.iter().any(|word| name.contains(*word)) {
            continue;
        }
        let found = writer.on_full_disks(sizes, SEED)?;
        println!("{name:<24} {:>8} {:>7} {:>7}", found.refused, found.enough, found.faults.len());
        for fault in &found.faults {
            println!("         {fault}");
        }
        faults += found.faults.len();
    }
    if faults == 0 { Ok(()) } else { Err(format!("{faults} faults")) }
}
