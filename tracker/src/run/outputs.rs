//! What a run leaves behind, as outputs of the pipeline.

use super::{Followed, Output};
use crate::Result;
use crate::film::{Film, Shot};
use crate::plan::TrajectoryPlan;
use crate::tracks::TrackFiles;

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
        let moment = &followed.moment;
        let shots = moment
            .cameras
            .iter()
            .enumerate()
            .map(|(i, camera)| Shot { image: followed.real_picture(i).cloned(), mask: camera.mask.clone() });
        self.push(moment.frame, moment.time_s, shots.collect(), followed.people)
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
