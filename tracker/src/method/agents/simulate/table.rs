//! Results as text.

use std::fmt::Write;

use super::experiment::{Comparison, Tally, percent};

/// Explanation of the results of the centralised variant.
const FINDING: &str = "\
B loses people because each station's next look is where the fused place was: errors of a crossing are fed back. It is
the feedback that loses, not the centre: C assigns every measurement that it hears itself and feeds nothing back; a
station of C that hears all others without loss is such a centre.
";

/// Table of kept, lost and confused people, the sweep over the doubling of noise, and speed.
pub fn text(comparison: &Comparison) -> String {
    let options = &comparison.options;
    let mut text = format!(
        "{}: {} stations, {} people, {} trials of {} s, seed {}, {} % of packets lost\n\n",
        options.layout,
        options.stations,
        options.people,
        comparison.rows.first().map_or(0, |row| row.tally.trials),
        options.seconds,
        comparison.seed,
        100.0 * options.loss,
    );
    // Writing to a string cannot fail, here and below.
    let _ = writeln!(text, "{:<30} {:>10} {:>8} {:>8} {:>9}", "%", "all kept", "kept", "lost", "confused");
    for row in &comparison.rows {
        let Tally { people, kept, lost, confused, .. } = row.tally;
        let _ = writeln!(
            text,
            "{:<30} {:>10.1} {:>8.1} {:>8.1} {:>9.1}",
            row.name,
            row.tally.all_kept_percent(),
            percent(kept, people),
            percent(lost, people),
            percent(confused, people),
        );
    }
    if !comparison.sweep.is_empty() {
        let _ = writeln!(
            text,
            "\n{:<30} {:>10} {:>8}  best with",
            "B: noise of close people, x", "published", "best"
        );
        for row in &comparison.sweep {
            let best = &row.best_options;
            let _ = writeln!(
                text,
                "{:<30} {:>10.1} {:>8.1}  attribute within {}, {}, {} s of patience",
                row.close_factor,
                row.published.all_kept_percent(),
                row.best.all_kept_percent(),
                best.attribute_limit,
                if best.predicts { "prediction fed back" } else { "fused place fed back" },
                best.coast_s,
            );
        }
        let _ = write!(text, "\n{FINDING}");
    }
    text.push('\n');
    for speed in &comparison.speeds {
        let _ = writeln!(
            text,
            "{:<12} {:>7.1} x real time, {:>6.1} us a station and frame",
            speed.name, speed.real_time_factor, speed.station_frame_us
        );
    }
    text
}
