//! Which moments a run has, and which frame of each camera belongs to each.
//!
//! Cameras on one clock are taken frame by frame. Where rates or starts differ, the moments are the frames of the fastest
//! camera from when all have begun, and every other camera gives the frame that is nearest in time. A frame that is too
//! far from the moment says where somebody was, not where they are: the camera then has none. So a slow camera beside a
//! fast one is neither believed for too long nor does it hold the fast one back.

use super::Times;
use crate::{Error, Result};

/// A frame this near belongs to a moment even where the moments are closer together: somebody walking has gone 5 cm.
const NEAR_S: f64 = 0.04;

/// When one camera's frames were taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// The camera's own times.
    pub times: Times,
    /// What must be added to them to have everybody's, seconds.
    pub offset_s: f64,
}

impl Clock {
    /// The time of a frame (from 1), seconds.
    ///
    /// # Errors
    /// As [`Times::of`].
    pub fn of(&self, frame: u32) -> Result<f64> {
        Ok(self.times.of(frame)? + self.offset_s)
    }

    /// The frame nearest to a time; 0 before the first, and one that may not exist after the last.
    fn nearest(&self, time_s: f64) -> u32 {
        self.times.nearest(time_s - self.offset_s)
    }
}

/// The moments of a run. A moment has the number and the time of the leading camera's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    clocks: Vec<Clock>,
    lead: usize,
    first: u32,
    near_s: f64,
    /// All cameras have the same clock.
    is_even: bool,
}

impl Schedule {
    /// The schedule of cameras with these clocks, at least one.
    ///
    /// # Errors
    /// Without clocks; with an offset that is not finite.
    pub fn new(clocks: Vec<Clock>) -> Result<Self> {
        let Some(first_clock) = clocks.first() else {
            return Err(Error::option("--video", "no camera has a source"));
        };
        if let Some(odd) = clocks.iter().find(|c| !c.offset_s.is_finite()) {
            return Err(Error::option("--offset", format!("{} is no time; give seconds", odd.offset_s)));
        }
        let is_even = clocks.iter().all(|c| c == first_clock);
        // The first of several that are equally fast.
        let lead = (1..clocks.len()).fold(0, |lead, c| {
            if clocks[c].times.mean_rate() > clocks[lead].times.mean_rate() { c } else { lead }
        });
        let near_s = (0.5 / clocks[lead].times.mean_rate()).max(NEAR_S);
        let mut all_begun_s = f64::NEG_INFINITY;
        for clock in &clocks {
            all_begun_s = all_begun_s.max(clock.of(1)?);
        }
        let first = if is_even { 1 } else { clocks[lead].nearest(all_begun_s).max(1) };
        Ok(Self { clocks, lead, first, near_s, is_even })
    }

    /// The schedule of so many cameras that all have these times.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn frame_by_frame(times: &Times, cameras: usize) -> Result<Self> {
        Self::new(vec![Clock { times: times.clone(), offset_s: 0.0 }; cameras])
    }

    /// The number of the first moment.
    pub fn first(&self) -> u32 {
        self.first
    }

    /// The camera whose frames the moments are.
    pub fn lead(&self) -> usize {
        self.lead
    }

    /// Whether all cameras have the same clock, so that frame belongs to frame.
    pub fn is_frame_by_frame(&self) -> bool {
        self.is_even
    }

    /// Moments a second, on average.
    pub fn mean_rate(&self) -> f64 {
        self.clocks[self.lead].times.mean_rate()
    }

    /// When a moment is, seconds.
    ///
    /// # Errors
    /// As [`Times::of`].
    pub fn time_s(&self, moment: u32) -> Result<f64> {
        self.clocks[self.lead].of(moment)
    }

    /// When a camera's frame was taken, seconds.
    ///
    /// # Errors
    /// As [`Times::of`].
    pub fn frame_time_s(&self, camera: usize, frame: u32) -> Result<f64> {
        self.clocks[camera].of(frame)
    }

    /// A camera's frame that belongs to a moment; it may lie beyond the camera's last. `None` where no frame is near.
    ///
    /// # Errors
    /// When the moment has no time.
    pub fn frame(&self, camera: usize, moment: u32) -> Result<Option<u32>> {
        if self.is_even || camera == self.lead {
            return Ok(Some(moment));
        }
        let (time_s, clock) = (self.time_s(moment)?, &self.clocks[camera]);
        let frame = clock.nearest(time_s);
        // A frame beyond the file's last line has no time; whether there is such a frame, its source knows.
        let is_near =
            clock.of(frame.max(1)).map_or(true, |taken_s| (taken_s - time_s).abs() <= self.near_s + 1e-9);
        Ok((frame > 0 && is_near).then_some(frame))
    }

    /// Whether there is a time for every frame of the run, when each camera has at most so many frames; `None` where one
    /// cannot know. A file may end early where the run does.
    ///
    /// # Errors
    /// Names the first line that is missing.
    pub fn check_times(&self, frames: &[Option<usize>]) -> Result<()> {
        let known = || self.clocks.iter().zip(frames).filter_map(|(clock, frames)| Some((clock, (*frames)?)));
        if self.is_even {
            let moments =
                frames.iter().copied().collect::<Option<Vec<_>>>().and_then(|f| f.into_iter().min());
            return moments.map_or(Ok(()), |moments| self.clocks[self.lead].times.check_count(moments));
        }
        let is_whole = |clock: &Clock, frames: usize| clock.times.check_count(frames).is_ok();
        let ends_s = known().filter(|(clock, frames)| is_whole(clock, *frames));
        let ends_s = ends_s.filter_map(|(clock, frames)| clock.of(u32::try_from(frames.max(1)).ok()?).ok());
        let end_s = ends_s.fold(f64::INFINITY, f64::min);
        known().try_for_each(|(clock, frames)| match clock.times.end_s() {
            Some(last_s) if last_s + clock.offset_s < end_s => clock.times.check_count(frames),
            _ => Ok(()),
        })
    }

    /// How many moments there are when each camera has at most so many frames; 0 where the recordings do not overlap.
    /// A camera of which nothing is known has `None`.
    pub fn moments(&self, frames: &[Option<usize>]) -> Option<usize> {
        if self.is_even {
            return frames.iter().copied().collect::<Option<Vec<_>>>()?.into_iter().min();
        }
        let mut last = u32::MAX;
        for (camera, frames) in frames.iter().enumerate() {
            let frames = u32::try_from((*frames)?).unwrap_or(u32::MAX);
            last = last.min(if camera == self.lead {
                frames
            } else {
                let end_s = self.clocks[camera].of(frames.max(1)).ok()?;
                self.clocks[self.lead].nearest(end_s)
            });
        }
        Some((last + 1).saturating_sub(self.first) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(rate: f64, offset_s: f64) -> Clock {
        Clock { times: Times::steady(rate).unwrap(), offset_s }
    }

    fn frames(schedule: &Schedule, camera: usize, moments: std::ops::Range<u32>) -> Vec<Option<u32>> {
        moments.map(|m| schedule.frame(camera, m).unwrap()).collect()
    }

    #[test]
    fn one_clock_is_frame_by_frame_wherever_it_starts() {
        for offset_s in [0.0, -3.0, 100.0] {
            let schedule = Schedule::new(vec![clock(12.0, offset_s); 3]).unwrap();
            assert!(schedule.is_frame_by_frame() && schedule.first() == 1);
            assert_eq!(frames(&schedule, 2, 1..4), [Some(1), Some(2), Some(3)]);
            assert!((schedule.time_s(13).unwrap() - offset_s - 1.0).abs() < 1e-9);
            assert_eq!(schedule.moments(&[Some(5), Some(3), Some(9)]), Some(3));
            assert_eq!(schedule.moments(&[Some(5), None, Some(9)]), None);
        }
    }

    #[test]
    fn every_frame_is_the_nearest_one_and_near() {
        let rates = [3.0, 12.0, 24.0, 25.0, 29.97, 60.0];
        for (a, b) in rates.iter().flat_map(|a| rates.iter().map(move |b| (*a, *b))) {
            for offset_s in [-2.03, 0.0, 0.017, 5.5] {
                let schedule = Schedule::new(vec![clock(a, 0.0), clock(b, offset_s)]).unwrap();
                let (lead, other) = if b > a { (1, 0) } else { (0, 1) };
                assert_eq!(schedule.lead(), lead);
                let near_s = (0.5 / a.max(b)).max(0.04);
                let mut had = 0;
                for moment in schedule.first()..schedule.first() + 200 {
                    assert_eq!(schedule.frame(lead, moment).unwrap(), Some(moment));
                    let time_s = schedule.time_s(moment).unwrap();
                    // The slow way: all frames that could be meant.
                    let off = |frame: u32| (schedule.frame_time_s(other, frame).unwrap() - time_s).abs();
                    let best = (1..1500).map(off).fold(f64::INFINITY, f64::min);
                    match schedule.frame(other, moment).unwrap() {
                        Some(frame) => {
                            had += 1;
                            assert!(off(frame) <= best + 1e-9 && best <= near_s + 1e-6, "{a}, {b}, {moment}");
                        }
                        None => assert!(best >= near_s - 1e-6, "{a}, {b}, {offset_s}, {moment}: {best}"),
                    }
                }
                // The slower camera's every frame belongs to some moment.
                assert!(had as f64 >= 199.0 / a.max(b) * a.min(b) - 2.0, "{a}, {b}: {had}");
            }
        }
    }

    #[test]
    fn moments_begin_when_all_have_begun_and_end_with_the_first() {
        let schedule = Schedule::new(vec![clock(10.0, 0.0), clock(10.0, 2.0)]).unwrap();
        assert_eq!((schedule.first(), schedule.frame(1, 21).unwrap()), (21, Some(1)));
        assert_eq!(schedule.moments(&[Some(100), Some(30)]), Some(30));
        assert_eq!(schedule.moments(&[Some(40), Some(30)]), Some(20));
        assert_eq!(schedule.moments(&[Some(15), Some(30)]), Some(0), "one ends before the other begins");
        // The lead itself begins later: the other's first frames belong to nothing.
        let schedule = Schedule::new(vec![clock(10.0, 2.0), clock(5.0, 0.0)]).unwrap();
        assert_eq!((schedule.lead(), schedule.first(), schedule.frame(1, 1).unwrap()), (0, 1, Some(11)));
    }

    #[test]
    fn irregular_times_are_matched_by_time() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("times.txt");
        std::fs::write(&file, "0.0\n0.3\n0.5\n0.9\n").unwrap();
        let times = Times::read(&file).unwrap();
        let clocks = vec![Clock { times, offset_s: 10.0 }, clock(10.0, 10.0)];
        let schedule = Schedule::new(clocks).unwrap();
        let nearest = [Some(1), None, None, Some(2), None, Some(3), None, None, None, Some(4)];
        assert_eq!(frames(&schedule, 0, 1..11), nearest);
        // After the last line the source decides whether anything is left.
        assert_eq!(schedule.frame(0, 15).unwrap(), Some(5));
        assert!(schedule.frame_time_s(0, 5).is_err());
    }

    #[test]
    fn a_file_may_end_early_only_where_the_run_does() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("few.txt");
        let lines: Vec<String> = (0..20).map(|i| (f64::from(i) * 0.1).to_string()).collect();
        std::fs::write(&file, lines.join("\n")).unwrap();
        let few = || Clock { times: Times::read(&file).unwrap(), offset_s: 0.0 };
        let said = |clocks: Vec<Clock>, frames: &[Option<usize>]| {
            Schedule::new(clocks).unwrap().check_times(frames).err().map(|e| e.to_string())
        };
        for other in [clock(10.0, 0.0), clock(25.0, 0.0), clock(4.0, 0.5)] {
            // The other goes on for 10 s, or ends after 1 s; headers may promise a few frames too many.
            let [long, short] = [10.0, 1.0].map(|s: f64| Some((s * other.times.mean_rate()) as usize));
            let refused = said(vec![other.clone(), few()], &[long, Some(40)]).unwrap();
            assert!(refused.contains("few.txt") && refused.contains("line 21"), "{refused}");
            assert_eq!(said(vec![other.clone(), few()], &[short, Some(40)]), None);
            assert_eq!(said(vec![other.clone(), few()], &[long, Some(22)]), None);
            assert_eq!(said(vec![other.clone(), few()], &[long, None]), None, "a stream");
        }
        assert!(said(vec![few(), few()], &[Some(40), Some(40)]).unwrap().contains("line 21"));
        assert_eq!(said(vec![few(), few()], &[Some(40), Some(20)]), None);
    }

    #[test]
    fn what_makes_no_schedule_is_refused() {
        assert!(Schedule::new(Vec::new()).is_err());
        assert!(Schedule::new(vec![clock(3.0, f64::NAN)]).is_err());
    }
}
