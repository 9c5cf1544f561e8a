//! Outputs that grow with the estimates: files, films, a plan, a page.

use std::sync::Arc;

use image::RgbImage;

use crate::film::{Film, Shot};
use crate::foreground::Verdict;
use crate::method::agents::Packet;
use crate::plan::TrajectoryPlan;
use crate::station::Pictures;
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
    /// Health of each camera.
    pub verdicts: &'a [Verdict],
    pub(super) pictures: &'a [Pictures],
    /// What the stations of a distributed method told each other at the last moment.
    pub packets: &'a [Packet],
}

impl Followed<'_> {
    /// A camera's picture as it was filmed, at the size at which it is drawn; `None` where nobody asked for it
    /// ([`crate::station::PictureDemand`]), or only masks are given.
    pub fn filmed(&self, camera: usize) -> Option<&Arc<RgbImage>> {
        self.pictures[camera].filmed.as_ref()
    }

    /// All cameras' pictures and masks, for painters.
    fn shots(&self) -> Vec<Shot> {
        let cameras = self.moment.cameras.iter().enumerate();
        let shot = |(i, camera): (usize, &CameraFrame)| Shot {
            image: self.filmed(i).cloned(),
            mask: camera.mask.clone(),
        };
        cameras.map(shot).collect()
    }
}

/// Something that is made of the estimates while they are made. An output that draws gets pictures where the stations were
/// told that they are wanted.
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
