//! Tables of the evaluation and of the time per stage.

use std::fmt::Write;

use mot::eval::Evaluation;

use super::markup::escape;
use crate::tracks::Timings;

/// Table of all figures with their meaning.
pub(super) fn evaluation(evaluation: &Evaluation) -> String {
    let mut rows = String::new();
    for figure in evaluation.figures() {
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\">{}</th><td class=\"number\">{}</td><td>{}</td></tr>",
            escape(figure.name),
            escape(&figure.text().replace('-', "−")),
            escape(figure.meaning)
        );
    }
    format!("<div class=\"scroll\"><table class=\"figures\"><tbody>\n{rows}</tbody></table></div>")
}

/// Table of median, 95th percentile and total of each stage, with bars for the totals.
pub(super) fn timings(timings: &Timings) -> String {
    let longest = timings.stages.iter().map(|(_, times)| times.total_ms).fold(1e-9, f64::max);
    let mut rows = String::new();
    for (name, times) in &timings.stages {
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\">{}</th><td class=\"number\">{:.2} ms</td><td class=\"number\">{:.2} ms</td>\
             <td class=\"number\">{:.2} s</td><td class=\"bar\"><span style=\"width:{:.1}%\"></span></td></tr>",
            escape(name),
            times.median_ms,
            times.p95_ms,
            times.total_ms / 1e3,
            100.0 * times.total_ms / longest
        );
    }
    format!(
        "<div class=\"scroll\"><table class=\"times\"><thead><tr><th>stage</th><th class=\"number\">median</th>\
         <th class=\"number\">95 % within</th><th class=\"number\">in all</th><th></th></tr></thead><tbody>\n{rows}</tbody></table></div>"
    )
}
