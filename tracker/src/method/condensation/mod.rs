//! CONDENSATION tracker of heads, with weights that are robust to occlusion.
//!
//! Y. Matsumoto, T. Kato and T. Wada, "An occlusion robust weight integration method for multi-camera CONDENSATION" (in
//! Japanese); section and equation numbers in this folder refer to it. CONDENSATION: M. Isard and A. Blake,
//! "CONDENSATION – conditional density propagation for visual tracking", IJCV 29(1), 1998.
//!
//! This method needs no room and no masks, only two or more calibrated cameras that see the edges of a head; a picture
//! of the empty scene helps ([`Method::set_empty_scene`]). The steps of a moment:
//!
//! 1. every camera's picture becomes an edge image ([`camera_edges`], [`edges`]);
//! 2. everybody's hypotheses of their head's position are predicted ([`track`], [`filter`]);
//! 3. each hypothesis is projected as a spheroid ([`contour`]), weighed in each camera ([`weight`], equation 9), and
//!    the weights are integrated ([`integration`], equations 4 to 7);
//! 4. hypotheses that are closer to another person's distribution lose their weight ([`exclusion`], equations 12 to
//!    14); steps 3 and 4 are repeated with smaller spreads;
//! 5. tracks begin for people who are seen at a gate ([`initiator`]), and end for those who have left.
//!
//! [`CondensationOptions`] has the parameters; [`weight_map`] draws the paper's figures 5 to 8; [`StepTimes`] has the times
//! of its table 2.

pub mod camera_edges;
mod climb;
pub mod contour;
pub mod edges;
pub mod exclusion;
pub mod filter;
pub mod initiator;
pub mod integration;
mod options;
mod report;
pub mod search;
mod shoulder;
mod sobel;
mod step_times;
mod track;
pub mod weight;
pub mod weight_map;

use image::RgbImage;
use nalgebra::Vector3;

use self::camera_edges::CameraEdges;
use self::contour::HeadShape;
use self::edges::EdgeImage;
use self::exclusion::{APART_M, HeadDistribution};
use self::initiator::Initiator;
use self::integration::{Integration, MOST_CAMERAS};
pub use self::options::{
    CondensationOptions, EdgeOptions, EdgeStrength, HeadModel, HeadMotionOptions, LifeOptions,
};
pub use self::step_times::{StepTimer, StepTimes};
use self::track::HeadTrack;
use self::weight::{ExpectedHead, HeadWeights, WeighingInput};
use self::weight_map::WeightMap;
use super::capacity::Capacity;
use super::{Method, Needs};
use crate::prepared_room::PreparedRoom;
use crate::silhouette::View;
use crate::{Error, Moment, PersonEstimate, Result, TrackId};

/// Assumed step before the first moment, seconds.
const FIRST_STEP_S: f64 = 0.1;
/// Least step, seconds: the times of a faulty source may stand still or run backwards.
const LEAST_STEP_S: f64 = 1e-3;
/// Time after which two tracks at one place are one, seconds.
const DOUBLED_FOR_S: f64 = 0.5;

/// CONDENSATION tracker of heads.
pub struct Condensation {
    room: PreparedRoom,
    options: CondensationOptions,
    head_weights: HeadWeights,
    edges: CameraEdges,
    views: Vec<View>,
    initiator: Initiator,
    capacity: Capacity,
    tracks: Vec<HeadTrack>,
    gaussians: Vec<HeadDistribution>,
    expected: Vec<ExpectedHead>,
    next_key: u64,
    next_id: u32,
    last_time_s: Option<f64>,
    times: StepTimes,
}

impl Condensation {
    /// Prepares the tracker for a room. Gates that no two cameras see are logged.
    ///
    /// # Errors
    /// An invalid option ([`Error::Option`]), fewer than two cameras, or too many.
    pub fn new(room: PreparedRoom, options: CondensationOptions) -> Result<Self> {
        options.validate()?;
        if !(2..=MOST_CAMERAS).contains(&room.cameras.len()) {
            return Err(Error::option(
                "condensation",
                format!(
                    "needs 2 to {MOST_CAMERAS} cameras, a head's place is where their rays meet; there {} {}",
                    if room.cameras.len() == 1 { "is" } else { "are" },
                    room.cameras.len()
                ),
            ));
        }
        let (initiator, unseen) = Initiator::new(&room, &options);
        if !unseen.zones.is_empty() {
            tracing::warn!("{unseen}");
        }
        let shape = HeadShape::new(&options.head);
        let head_weights = HeadWeights::new(
            &room.cameras,
            &shape,
            &options.edges,
            options.integration,
            (options.rays, options.beta),
            options.life.seen_at,
        );
        Ok(Self {
            head_weights,
            edges: CameraEdges::new(&room.cameras, options.edges),
            views: room.cameras.iter().map(View::new).collect(),
            initiator,
            capacity: Capacity::new(options.life.max_people),
            tracks: Vec::new(),
            gaussians: Vec::new(),
            expected: Vec::new(),
            next_key: 1,
            next_id: 1,
            last_time_s: None,
            times: StepTimes::default(),
            room,
            options,
        })
    }

    /// Weights of heads at height `height_m` over the whole floor at a moment, for each of some integrations. Tracks do
    /// not change.
    ///
    /// # Errors
    /// As [`Method::step`].
    pub fn weight_maps(
        &mut self,
        moment: &Moment<'_>,
        integrations: &[Integration],
        height_m: f64,
    ) -> Result<Vec<WeightMap>> {
        self.find_edges(moment)?;
        let input = WeighingInput {
            head_weights: &self.head_weights,
            cameras: &self.room.cameras,
            edges: self.edges.images(),
            everybody: &[],
            sharpness: 1.0,
        };
        Ok(integrations.iter().map(|i| WeightMap::new(&self.room, &input, *i, height_m)).collect())
    }

    /// Follows everybody to a moment by its edges, one image a camera: a step whose edges are already there, since another tracker
    /// of the same cameras, empty scene and [`EdgeOptions`] has found them. The images have the sizes of the cameras.
    pub fn follow(&mut self, time_s: f64, edges: &[Option<EdgeImage>]) -> Vec<PersonEstimate> {
        let dt_s = self.last_time_s.map_or(FIRST_STEP_S, |last| time_s - last).max(LEAST_STEP_S);
        self.last_time_s = Some(time_s);
        self.update_tracks(dt_s, edges);
        self.initiate_tracks(dt_s, edges);
        self.delete_tracks(dt_s);
        self.report()
    }

    /// Finder of this tracker's edges, for trackers that share them.
    pub fn edges(&self) -> &CameraEdges {
        &self.edges
    }

    /// Times of the steps so far.
    pub fn step_times(&self) -> &StepTimes {
        &self.times
    }

    /// Hypotheses of all tracks with their ids, tentative tracks included; for pictures.
    pub fn hypotheses(&self) -> impl Iterator<Item = (Option<TrackId>, &[Vector3<f64>])> {
        self.tracks.iter().map(|t| (t.id, t.filter.hypotheses.as_slice()))
    }

    /// Computes the edges of every camera's picture.
    fn find_edges(&mut self, moment: &Moment<'_>) -> Result<()> {
        for (camera, frame) in self.room.cameras.iter().zip(moment.cameras) {
            let Some(image) = &frame.image else { continue };
            if image.dimensions() != (camera.width(), camera.height()) {
                return Err(Error::FrameSize {
                    camera: camera.name.clone(),
                    frame: moment.frame,
                    found_width: image.width(),
                    found_height: image.height(),
                    width: camera.width(),
                    height: camera.height(),
                });
            }
        }
        self.times.edges.start();
        self.edges.find(moment);
        self.times.edges.stop();
        Ok(())
    }

    /// Predicts, weighs and separates the hypotheses of all tracks.
    fn update_tracks(&mut self, dt_s: f64, edges: &[Option<EdgeImage>]) {
        let options = &self.options;
        for track in &mut self.tracks {
            track.predict(dt_s, &options.motion, &mut self.times);
        }
        self.expected.clear();
        self.expected.extend(self.tracks.iter().map(|t| ExpectedHead { head: t.head(), trust: t.trust }));
        let input = WeighingInput {
            head_weights: &self.head_weights,
            cameras: &self.room.cameras,
            edges,
            everybody: &self.expected,
            sharpness: options.sharpness,
        };
        for layer in 0..options.layers {
            for track in &mut self.tracks {
                track.weigh(layer, &input, &mut self.times);
            }
            self.times.integration.start();
            self.gaussians.clear();
            self.gaussians.extend(self.tracks.iter().map(|t| t.filter.gaussian()));
            for (own, track) in self.tracks.iter_mut().enumerate() {
                let filter = &mut track.filter;
                exclusion::exclude(
                    &filter.hypotheses,
                    &mut filter.weights,
                    own,
                    &self.gaussians,
                    options.equal_covariances,
                );
            }
            self.times.integration.stop();
        }
        for track in &mut self.tracks {
            track.update(dt_s, &input, options);
            track.check_for_shoulder(dt_s, &input, options.life.highest_m);
        }
    }

    /// Begins the tracks of people who are found at a gate.
    fn initiate_tracks(&mut self, dt_s: f64, edges: &[Option<EdgeImage>]) {
        self.expected.clear();
        self.expected.extend(self.tracks.iter().map(|t| ExpectedHead { head: t.head(), trust: t.trust }));
        let input = WeighingInput {
            head_weights: &self.head_weights,
            cameras: &self.room.cameras,
            edges,
            everybody: &self.expected,
            sharpness: self.options.sharpness,
        };
        for (found, name) in self.initiator.new_heads(dt_s, &self.room.floor, &input, &mut self.times) {
            if self.capacity.has_room(self.tracks.len()) {
                let mut track = HeadTrack::born(&found, self.next_key, &self.options);
                track.id = name;
                self.tracks.push(track);
                self.next_key += 1;
            }
        }
        self.capacity.note(self.tracks.len());
    }

    /// Ends the tracks of people who have left, were lost, or are tracked twice; confirms those that have been seen for
    /// long enough.
    fn delete_tracks(&mut self, dt_s: f64) {
        let life = self.options.life;
        let places: Vec<_> = self.tracks.iter().map(|t| (t.head(), t.trust)).collect();
        for (i, track) in self.tracks.iter_mut().enumerate() {
            let is_doubled = places.iter().enumerate().any(|(j, (place, trust))| {
                let is_better = (*trust, i) > (track.trust, j);
                let apart_m = (place - track.head()).xy().norm();
                let is_same = apart_m < APART_M || shoulder::is_beside(&track.head(), place);
                j != i && is_better && is_same
            });
            track.doubled_s = if is_doubled { track.doubled_s + dt_s } else { 0.0 };
        }
        let floor = &self.room.floor;
        self.tracks.retain(|track| {
            let head = track.head();
            let is_leaving = floor.may_disappear(head.x, head.y) && track.unseen_s > life.unseen_at_exit_s;
            let is_mistake = track.id.is_none() && track.unseen_s > 1.5 * dt_s;
            let is_in_volume = floor.is_standable(head.x, head.y)
                && (life.lowest_m - 0.1..=life.highest_m + 0.1).contains(&head.z);
            let is_somebody_else = track.doubled_s >= DOUBLED_FOR_S;
            let is_lost = f64::from(track.trust) < life.lost_at;
            let is_still_inside = is_lost && !is_somebody_else && !floor.may_disappear(head.x, head.y);
            if let Some(id) = track.id.filter(|_| is_still_inside) {
                self.initiator.miss(id, &head);
            }
            is_in_volume && !is_lost && !is_leaving && !is_mistake && !is_somebody_else
        });
        for track in self.tracks.iter_mut().filter(|t| t.id.is_none()) {
            if track.seen_s >= life.believed_after_s {
                track.id = Some(TrackId(self.next_id));
                self.next_id += 1;
            }
        }
    }
}

impl Method for Condensation {
    fn needs(&self) -> Needs {
        let empty_scene = self.options.edges.moving_only;
        Needs { masks: false, pictures: true, empty_scene }
    }

    /// The edges of an empty scene are not heads.
    fn set_empty_scene(&mut self, camera: usize, picture: &RgbImage) {
        self.edges.set_empty_scene(camera, picture);
    }

    fn step(&mut self, moment: &Moment<'_>) -> Result<Vec<PersonEstimate>> {
        self.find_edges(moment)?;
        let edges = std::mem::take(&mut self.edges);
        let people = self.follow(moment.time_s, edges.images());
        self.edges = edges;
        Ok(people)
    }
}

#[cfg(test)]
mod tests;
