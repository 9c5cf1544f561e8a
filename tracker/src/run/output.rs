//! Outputs of a run that grow with the estimates: files, films, a plan, a page.

use std::path::Path;
use std::sync::Arc;

use image::RgbImage;
use scenes::room::Room;

use crate::film::{Film, Shot};
use crate::foreground::Verdict;
use crate::gathering::LeftOut;
use crate::method::agents::Packet;
use crate::plan::TrajectoryPlan;
use crate::publish::metrics::RunMetrics;
use crate::publish::mqtt::MqttOutput;
use crate::station::Pictures;
use crate::tracks::TrackFiles;
use crate::view::{FeedInput, LiveDrawer, LiveFeed};
use crate::{CameraFrame, Moment, PersonEstimate, Result};

/// One moment with its estimates.
#[derive(Debug, Clone, Copy)]
pub struct ProcessedMoment<'a> {
    /// Input of the method.
    pub moment: Moment<'a>,
    /// Estimates of the method.
    pub people: &'a [PersonEstimate],
    /// Health of each camera.
    pub verdicts: &'a [Verdict],
    pub(crate) pictures: &'a [Pictures],
    /// Packets that the stations of a distributed method exchanged at the latest moment.
    pub packets: &'a [Packet],
    /// Capture time, seconds since 1970, where the cameras are live.
    pub utc_s: Option<f64>,
    /// Frames and moments that a live run has left out until the moment was processed.
    pub left_out: LeftOut,
}

impl ProcessedMoment<'_> {
    /// A camera's filmed picture, at the size at which it is drawn; `None` where it was not demanded
    /// ([`crate::station::PictureDemand`]), or only masks are given.
    pub fn filmed(&self, camera: usize) -> Option<&Arc<RgbImage>> {
        self.pictures[camera].filmed.as_ref()
    }

    /// Indices of the cameras without usable pictures, with the reason.
    pub(super) fn set_aside(&self) -> Vec<(usize, Verdict)> {
        self.verdicts.iter().copied().enumerate().filter(|(_, verdict)| verdict.is_set_aside()).collect()
    }

    /// Pictures and masks of all cameras, for painters.
    fn shots(&self) -> Vec<Shot> {
        let cameras = self.moment.cameras.iter().enumerate();
        let shot = |(i, camera): (usize, &CameraFrame)| Shot {
            image: self.filmed(i).cloned(),
            mask: camera.mask.clone(),
        };
        cameras.map(shot).collect()
    }
}

/// A consumer of the estimates during a run. An output that draws gets pictures only where the stations'
/// [`crate::station::PictureDemand`] asks for them.
pub trait Output {
    /// Adds one moment and its estimates.
    ///
    /// # Errors
    /// An output that cannot be written.
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()>;

    /// Goes on in another folder, with the same people; what is in the old one is completed. Outputs without files stay
    /// as they are.
    ///
    /// # Errors
    /// An output that cannot be written.
    fn move_to(&mut self, _out: &Path) -> Result<()> {
        Ok(())
    }

    /// Goes on with the zones, regions and lines of a changed room; cameras and geometry are the same. Outputs that do not
    /// depend on them stay as they are.
    ///
    /// # Errors
    /// An output that cannot be written.
    fn replace_room(&mut self, _room: &Room) -> Result<()> {
        Ok(())
    }

    /// Completes the output at the end of the run.
    ///
    /// # Errors
    /// An output that cannot be written.
    fn finish(self: Box<Self>) -> Result<()>;
}

impl Output for TrackFiles {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let Moment { frame, time_s, .. } = followed.moment;
        self.write(frame, time_s, followed.people, &followed.set_aside())
    }

    fn move_to(&mut self, out: &Path) -> Result<()> {
        TrackFiles::move_to(self, out);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        TrackFiles::finish(*self)
    }
}

impl Output for Film {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let Moment { frame, time_s, .. } = followed.moment;
        self.push(frame, time_s, followed.shots(), followed.people)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Film::finish(*self)
    }
}

impl Output for TrajectoryPlan {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        self.extend(followed.moment.time_s, followed.people);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        TrajectoryPlan::finish(&self)
    }
}

impl Output for LiveDrawer {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let Moment { frame, time_s, .. } = followed.moment;
        self.offer(frame, time_s, followed.people, || followed.shots());
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        LiveDrawer::finish(&self);
        Ok(())
    }
}

impl Output for LiveFeed {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let ProcessedMoment { moment, people, verdicts, utc_s, left_out, .. } = *followed;
        let left_out = left_out.passed_over + left_out.late + left_out.skipped;
        LiveFeed::put(
            self,
            FeedInput { frame: moment.frame, time_s: moment.time_s, people, verdicts, utc_s, left_out },
        );
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

impl Output for MqttOutput {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let Moment { frame, time_s, .. } = followed.moment;
        self.publish(frame, time_s, followed.people, &followed.set_aside())
    }

    fn replace_room(&mut self, room: &Room) -> Result<()> {
        MqttOutput::replace_room(self, room)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        MqttOutput::finish(*self)
    }
}

impl Output for RunMetrics {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        self.observe(followed.people.len(), followed.utc_s, followed.verdicts, followed.left_out);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}
