//! The watch over a camera's pose in hours of light that changes, shadows, people and a chair that is moved: false alarms, and
//! whether the turn in the end is told. Asked: none in 24 hours.
//!
//! `cargo bench -p tests --bench pose_watch [-- HOURS [FIRST-SEED]]`: a room an hour, two looks a second; one hour by default, the whole
//! campaign is `-- 24`. No bound was chosen on these rooms.
#![forbid(unsafe_code)]

use rayon::prelude::*;
use tests::chain::StepResult;
use tests::watched_room;

/// First seed where none is given.
const FIRST_SEED: u64 = 1300;
/// Length of a watch, seconds.
const HOUR_S: f64 = 3600.0;

fn main() -> StepResult<()> {
    let mut asked = std::env::args().skip(1).filter_map(|a| a.parse::<u64>().ok());
    let hours = asked.next().unwrap_or(1);
    let first = asked.next().unwrap_or(FIRST_SEED);
    let seeds: Vec<u64> = (first..first + hours).collect();
    let watched = seeds.into_par_iter().with_max_len(1).map(|seed| {
        let watched = watched_room::watch(seed, HOUR_S)?;
        let alarm = watched.false_alarm_s.map_or("none".to_owned(), |time_s| format!("at {time_s:.1} s"));
        let told = watched
            .told_after_s
            .map_or("not told".to_owned(), |after_s| format!("told after {after_s:.1} s"));
        println!(
            "{seed}: {} looks, false alarm {alarm}, {} doubts; turned by {:.1}°, {told}",
            watched.looks,
            watched.doubts_s.len(),
            watched.turned_deg
        );
        Ok(watched)
    });
    let watched: Vec<_> = watched.collect::<StepResult<_>>()?;
    let alarms = watched.iter().filter(|w| w.false_alarm_s.is_some()).count();
    let told = watched.iter().filter(|w| w.is_told()).count();
    println!("\n{hours} hours: {alarms} false alarms; {told} turns told in time");
    Ok(())
}
