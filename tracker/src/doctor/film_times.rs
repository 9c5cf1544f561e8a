//! The times of a film's frames, as its file states them.

use calib::video::FrameSource;

use super::Finding;
use crate::Result;

/// Number of frames that are looked at.
const LOOK_THROUGH_FRAMES: usize = 20_000;
/// Gap without a frame that is told, in the film's own intervals.
const GAP_INTERVALS: f64 = 2.5;
/// Relative difference of a header's rate from the frames' times that is told.
const RATE_TOLERANCE: f64 = 0.02;
/// Difference of two films' start times that is told, in frames.
const START_FRAMES: f64 = 1.5;

/// Times of one film.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmTimes {
    /// Name of the film's camera.
    pub camera: String,
    /// Path of the film as it was given.
    pub film: String,
    /// Number of frames.
    pub frames: usize,
    /// Rate that the header states, frames a second.
    pub stated_hz: Option<f64>,
    /// Times of the frames, seconds on the film's own clock; empty where the file has none.
    pub times_s: Vec<f64>,
}

impl FilmTimes {
    /// Reads the times of a film's frames, up to 20,000 of them.
    ///
    /// # Errors
    /// A film that cannot be opened.
    pub fn read(camera: &str, film: &str) -> Result<Self> {
        Self::of_first(camera, film, LOOK_THROUGH_FRAMES)
    }

    /// Reads the times of a film's first frames.
    ///
    /// # Errors
    /// A film that cannot be opened.
    pub fn of_first(camera: &str, film: &str, at_most: usize) -> Result<Self> {
        let mut source = FrameSource::open(film)?;
        let stated_hz = source.rate();
        let (mut frames, mut times_s) = (0, Vec::new());
        while frames < at_most && source.skip() {
            frames += 1;
            times_s.extend(source.stamp().presentation_s);
        }
        if times_s.len() < frames {
            times_s.clear();
        }
        Ok(Self { camera: camera.to_owned(), film: film.to_owned(), frames, stated_hz, times_s })
    }

    /// Time of the first frame, seconds on the film's own clock.
    pub fn start_s(&self) -> Option<f64> {
        self.times_s.first().copied()
    }

    /// Time from the first frame to the last, seconds.
    pub fn lasts_s(&self) -> Option<f64> {
        Some(self.times_s.last()? - self.times_s.first()?)
    }

    /// Median time between two frames, seconds.
    fn interval_s(&self) -> Option<f64> {
        let mut steps: Vec<f64> = self.times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if steps.is_empty() {
            return None;
        }
        let middle = steps.len() / 2;
        steps.select_nth_unstable_by(middle, f64::total_cmp);
        Some(steps[middle]).filter(|step| *step > 0.0)
    }

    fn finding(&self, text: String) -> Finding {
        Finding { camera: self.camera.clone(), film: self.film.clone(), text }
    }

    /// Gaps in the film, and a rate that its header has wrong.
    pub fn findings(&self) -> Vec<Finding> {
        let Some(interval_s) = self.interval_s() else { return Vec::new() };
        let mut findings = Vec::new();
        let gaps = || self.times_s.windows(2).filter(|pair| pair[1] - pair[0] > GAP_INTERVALS * interval_s);
        let longest = gaps().max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        if let Some(longest) = longest {
            findings.push(self.finding(format!(
                "{} gaps between its frames, the longest of {:.2} s at {:.2} s: frames were lost; the run goes by the file's \
                 times, and is as good as they are (--times decides otherwise)",
                gaps().count(),
                longest[1] - longest[0],
                longest[0]
            )));
        }
        if let Some(stated_hz) = self.stated_hz
            && (stated_hz * interval_s - 1.0).abs() > RATE_TOLERANCE
        {
            findings.push(self.finding(format!(
                "the header states {stated_hz:.2} frames/s, its frames come at {:.2}/s: the run goes by the frames' times; give \
                 --rate if they are wrong",
                1.0 / interval_s
            )));
        }
        findings
    }
}

/// Problem of a film whose header says that frames were lost or come at an uneven rate; `None` without one.
pub fn uneven_rate(film: &FrameSource) -> Option<String> {
    let (stated_hz, mean_hz) = film.rate().zip(film.mean_rate())?;
    let is_uneven = (mean_hz / stated_hz - 1.0).abs() > RATE_TOLERANCE;
    is_uneven.then(|| {
        format!(
            "states {stated_hz:.2} frames/s, and {mean_hz:.2} on average: frames were lost, or come at an uneven rate; the run goes \
             by the file's times (--times decides otherwise)"
        )
    })
}

/// Films that begin at another time of their own clock than the first film does.
pub fn starts(films: &[FilmTimes]) -> Vec<Finding> {
    let known = || films.iter().filter_map(|film| Some((film, film.start_s()?)));
    let Some((first, first_s)) = known().min_by(|a, b| a.1.total_cmp(&b.1)) else { return Vec::new() };
    let later = known().filter(|(film, start_s)| {
        let interval_s = film.interval_s().unwrap_or(0.04).max(0.04);
        start_s - first_s > START_FRAMES * interval_s
    });
    let finding = |(film, start_s): (&FilmTimes, f64)| {
        film.finding(format!(
            "begins at {start_s:.3} s of its own clock, `{}` at {first_s:.3} s, and is taken to be {:.3} s later: give --offset \
             {}={:.3} if they began together",
            first.camera,
            start_s - first_s,
            film.camera,
            first_s - start_s
        ))
    };
    later.map(finding).collect()
}
