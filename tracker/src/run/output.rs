//! What a run leaves behind: whatever is made of the tracks while they grow.

use image::RgbImage;

use crate::film::{Film, Shot};
use crate::foreground::Verdict;
use crate::plan::TrajectoryPlan;
use crate::tracks::TrackFiles;
use crate::view::Drawer;
use crate::{CameraFrame, Moment, PersonEstimate, Result};

/// One moment with what was made of it.
#[derive(Debug, Clone, Copy)]
pub struct Followed<'a> {
    /// What the method was given.
    pub moment: Moment<'a>,
    /// What it gave back.
    pub people: &'a [PersonEstimate],
    /// What each camera's mask was worth.
    pub verdicts: &'a [Verdict],
    pub(super) real: &'a [Option<RgbImage>],
}

impl Followed<'_> {
    /// A camera's picture as it was filmed, with distortion; `None` where only masks are given.
    pub fn real_picture(&self, camera: usize) -> Option<&RgbImage> {
        self.real[camera].as_ref().or(self.moment.cameras[camera].image.as_ref())
    }

    /// Copies of all cameras' pictures and masks, for painters.
    fn shots(&self) -> Vec<Shot> {
        let cameras = self.moment.cameras.iter().enumerate();
        let shot = |(i, camera): (usize, &CameraFrame)| Shot {
            image: self.real_picture(i).cloned(),
            mask: camera.mask.clone(),
        };
        cameras.map(shot).collect()
    }
}

/// Something that is made of the tracks while they grow: files, a film, a plan.
pub trait Output {
    /// Takes in one moment and the people in it.
    ///
    /// # Errors
    /// When something cannot be written.
    fn put(&mut self, followed: &Followed<'_>) -> Result<()>;

    /// Nothing more comes.
    ///
    /// # Errors
    /// When something cannot be written.
    fn finish(self: Box<Self>) -> Result<()>;
}

impl Output for TrackFiles {
    fn put(&mut self, followed: &Followed<'_>) -> Result<()> {
        let verdicts = followed.verdicts.iter().enumerate();
        let set_aside: Vec<usize> = verdicts.filter(|(_, v)| v.is_set_aside()).map(|(i, _)| i).collect();
        self.write(followed.moment.frame, followed.moment.time_s, followed.people, &set_aside)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        TrackFiles::finish(*self)
    }
}

impl Output for Film {
    fn put(&mut self, followed: &Followed<'_>) -> Result<()> {
        let Moment { frame, time_s, .. } = followed.moment;
        self.push(frame, time_s, followed.shots(), followed.people)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Film::finish(*self)
    }
}

impl Output for TrajectoryPlan {
    fn put(&mut self, followed: &Followed<'_>) -> Result<()> {
        self.extend(followed.moment.time_s, followed.people);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        TrajectoryPlan::finish(&self)
    }
}

impl Output for Drawer {
    fn put(&mut self, followed: &Followed<'_>) -> Result<()> {
        let Moment { frame, time_s, .. } = followed.moment;
        self.offer(frame, time_s, followed.people, || followed.shots());
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}
