//! Time axis of charts as wide as the page: labels are HTML, so that they keep their size on a telephone, where drawings
//! are squeezed.

use std::fmt::Write;

/// Steps between labels, seconds.
const STEPS_S: [f64; 20] = [
    0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0, 3600.0, 7200.0,
    10_800.0, 21_600.0, 43_200.0,
];
/// Largest number of steps: more labels do not fit on a telephone.
const MOST_STEPS: f64 = 6.0;

/// Time axis from `first_s` to `last_s`, at least a moment long.
pub(super) struct TimeAxis {
    first_s: f64,
    duration_s: f64,
    /// Time of day at time 0, seconds after midnight; `None` where the run does not know it.
    zero_of_day: Option<f64>,
}

impl TimeAxis {
    /// Axis of a span of the run's time.
    pub(super) fn new((first_s, last_s): (f64, f64), day_s: Option<f64>) -> Self {
        Self { first_s, duration_s: (last_s - first_s).max(1e-9), zero_of_day: day_s }
    }

    /// Position of a time on the axis, 0 to 1.
    pub(super) fn share(&self, time_s: f64) -> f64 {
        ((time_s - self.first_s) / self.duration_s).clamp(0.0, 1.0)
    }

    /// Times of the labels: round times of day, where that is known, or of the run.
    fn ticks(&self) -> Vec<f64> {
        let zero_s = self.zero_of_day.unwrap_or(0.0);
        let least = self.duration_s / MOST_STEPS;
        let days = (least / 86_400.0).ceil() * 86_400.0;
        let step_s = STEPS_S.into_iter().find(|step| *step >= least).unwrap_or(days);
        let first = ((self.first_s + zero_s) / step_s - 1e-6).ceil();
        (0..=MOST_STEPS as u32 + 1)
            .map(|i| (first + f64::from(i)) * step_s - zero_s)
            .take_while(|time_s| *time_s <= self.first_s + self.duration_s * (1.0 + 1e-9))
            .collect()
    }

    /// Row of labels, to be put below a drawing of the same width.
    pub(super) fn html(&self) -> String {
        let mut labels = String::from("<div class=\"axis\">");
        for time_s in self.ticks() {
            let share = self.share(time_s);
            // A label at either end keeps inside.
            let aside = match share {
                ..0.05 => 0,
                0.95.. => -100,
                _ => -50,
            };
            // Writing to a string cannot fail.
            let _ = write!(
                labels,
                "<span style=\"left:{:.2}%;transform:translateX({aside}%)\">{}</span>",
                100.0 * share,
                self.label(time_s)
            );
        }
        labels + "</div>"
    }

    /// A time for people: of day, or since the beginning of the run.
    pub(super) fn label(&self, time_s: f64) -> String {
        let is_of_day = self.zero_of_day.is_some();
        let seconds = (time_s + self.zero_of_day.unwrap_or(0.0)).max(0.0);
        let rounded = (10.0 * seconds).round() / 10.0;
        let whole = rounded as u64;
        let (hours, minutes) = (whole / 3600, whole / 60 % 60);
        let (hours, minutes) = if is_of_day { (hours % 24, minutes) } else { (hours, minutes) };
        match () {
            () if !is_of_day && self.duration_s < 120.0 => format!("{rounded} s"),
            () if self.duration_s < 600.0 || (!is_of_day && hours == 0) => {
                let minutes =
                    if is_of_day { format!("{hours:02}:{minutes:02}") } else { minutes.to_string() };
                format!("{minutes}:{:02}", whole % 60)
            }
            () => format!("{hours}:{minutes:02}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(first_s: f64, last_s: f64, day_s: Option<f64>) -> Vec<String> {
        let axis = TimeAxis::new((first_s, last_s), day_s);
        axis.ticks().into_iter().map(|time_s| axis.label(time_s)).collect()
    }

    #[test]
    fn labels_are_round_and_few() {
        assert_eq!(labels(0.0, 25.0, None), ["0 s", "5 s", "10 s", "15 s", "20 s", "25 s"]);
        assert_eq!(labels(0.0, 0.5, None), ["0 s", "0.1 s", "0.2 s", "0.3 s", "0.4 s", "0.5 s"]);
        assert_eq!(labels(0.0, 1200.0, None), ["0:00", "5:00", "10:00", "15:00", "20:00"]);
        assert_eq!(labels(0.0, 4.0 * 3600.0, None), ["0:00", "1:00", "2:00", "3:00", "4:00"]);
        // A day from a quarter past eight on: whole hours of the day.
        let day = labels(0.0, 12.0 * 3600.0, Some(8.25 * 3600.0));
        assert_eq!(day, ["10:00", "12:00", "14:00", "16:00", "18:00", "20:00"]);
        assert_eq!(labels(0.0, 100.0, Some(3590.0)), ["01:00:00", "01:00:30", "01:01:00", "01:01:30"]);
    }

    #[test]
    fn spans_without_length_and_of_many_days_have_an_axis() {
        assert_eq!(labels(3.0, 3.0, None).len(), 1);
        assert!((1..=8).contains(&labels(0.0, 40.0 * 86_400.0, Some(0.0)).len()));
        let axis = TimeAxis::new((2.0, 4.0), None);
        for (time_s, share) in [(1.0, 0.0), (2.0, 0.0), (3.0, 0.5), (9.0, 1.0)] {
            assert!((axis.share(time_s) - share).abs() < 1e-12, "{time_s}");
        }
    }
}
