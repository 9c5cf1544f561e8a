//! Programs that are killed (SIGKILL) at random moments: `recon build`, `tracker run` and `tracker serve`. Asked: every output
//! can be read, reruns are equal to the byte, nothing is left behind.
//!
//! `cargo build --release --bins && cargo bench -p tests --bench kills [-- KILLS [build|run|serve …]]`: 10 kills of each by
//! default; the whole campaign is `-- 100`.
#![forbid(unsafe_code)]

use tests::chain::StepResult;
use tests::kills::{self, Outcome};

/// Seed of the moments.
const SEED: u64 = 1000;

/// A program, and its kills.
type Scenario = (&'static str, fn(usize, u64) -> StepResult<Outcome>);

fn main() -> StepResult<()> {
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let kills = asked.iter().find_map(|a| a.parse().ok()).unwrap_or(10);
    let names: Vec<&String> = asked.iter().filter(|a| a.parse::<usize>().is_err()).collect();
    println!("{:<8} {:>7} {:>8} {:>7}  film behind the rows", "program", "killed", "too late", "faults");
    let scenarios: [Scenario; 3] = [("build", kills::build), ("run", kills::run), ("serve", kills::serve)];
    let mut faults = 0;
    for (name, scenario) in scenarios {
        if !names.is_empty() && !names.iter().any(|asked| *asked == name) {
            continue;
        }
        let found = scenario(kills, SEED)?;
        let behind = if name == "run" { format!("{:.2} s", found.film_lost_s) } else { String::new() };
        println!("{name:<8} {:>7} {:>8} {:>7}  {behind}", found.killed, found.late, found.faults.len());
        for fault in &found.faults {
            println!("         {fault}");
        }
        faults += found.faults.len();
    }
    if faults == 0 { Ok(()) } else { Err(format!("{faults} faults")) }
}
