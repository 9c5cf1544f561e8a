//! Trans-dimensional MCMC tracker: Y. Osawa, X. Wu, K. Sudo, T. Wakabayashi, H. Yasuno, "MCMC based Multiple People
//! Tracking using 3D Environmental Information" (paper LI-007), section 3. Section and equation numbers in this
//! folder refer to it. Reversible jumps: Z. Khan, T. Balch, F. Dellaert, "MCMC-based particle filtering for tracking
//! a variable number of interacting targets", IEEE TPAMI 27(11), 2005; P. J. Green, "Trans-dimensional Markov chain
//! Monte Carlo", 2003.
//!
//! The state is the number of people, and each person's place, radius and height. One moment is processed in these
//! steps:
//!
//! 1. The motion model predicts every person ([`motion`]).
//! 2. A Markov chain proposes changes of one person at a time (ADD, DELETE, UPDATE-P, UPDATE-S) and accepts them by how
//!    well the simulated masks then fit the observed ones ([`chain`]).
//! 3. The mean over the last states is the estimate ([`tally`]), which updates the tracks ([`belief`], [`track`]).
//!    Where boxes are observed, tracks that people exchanged when they met are exchanged back ([`reassociation`]), and
//!    ids later still ([`encounters`]).
//!    Confirmed tracks are reported ([`report`]), at once or after fixed-lag smoothing ([`smoother`]).
//!
//! Births are modelled and proposed by [`appearance`]: in the zones, anywhere for a while ([`outage`]), and at
//! persistent evidence ([`rescue`]). [`births`] divides the floor into cells and weights them by the foreground that
//! the predicted people leave unexplained ([`left_over`]). [`McmcOptions`] holds the options.

mod appearance;
mod belief;
mod births;
mod blackout;
mod boxes;
mod by_boxes;
mod chain;
mod encounters;
mod evidence;
mod filled;
mod learnt_length;
mod left_over;
mod lost;
mod measured;
mod motion;
mod options;
mod outage;
mod passage;
mod person;
mod population;
mod posture;
mod reassociation;
mod report;
mod rescue;
mod sampling;
mod sighting;
mod smoother;
mod tally;
mod trace;
mod track;
mod traits;
mod vector_places;

use nalgebra::{Point2, Vector2};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use self::births::BirthMap;
use self::blackout::Blackout;
use self::boxes::Boxes;
use self::encounters::{Encounters, REMEMBERED_S};
use self::left_over::LeftOver;
use self::lost::LostTracks;
pub use self::measured::Measured;
pub use self::options::{Acceptance, BoxOptions, McmcOptions, MotionOptions, MoveWeights, Spread};
use self::outage::{FORGOTTEN_AFTER_S, OUTAGE_S, Settling};
use self::person::{Key, Person};
use self::rescue::Rescue;
use self::smoother::FixedLagSmoother;
use self::track::{BirthPhase, Track};
use super::capacity::Capacity;
use super::{Method, Needs};
use crate::identity::Identities;
use crate::likelihood::{Layers, PreparedLikelihood, Simulation, pack};
use crate::prepared_room::{PreparedCamera, PreparedRoom, resolution};
use crate::silhouette::{Body, View};
use crate::{CameraFrame, Error, Moment, PersonEstimate, Result};

/// Time step assumed before the first moment, seconds.
const FIRST_STEP_S: f64 = 0.1;
/// Least time step, seconds: repeated or decreasing time stamps are errors of the source, which the tracker
/// tolerates.
const LEAST_STEP_S: f64 = 1e-3;

/// Tracker by trans-dimensional MCMC over the cameras' masks and boxes.
#[derive(Debug, Clone)]
pub struct Mcmc {
    stage: PreparedRoom,
    options: McmcOptions,
    rule: PreparedLikelihood,
    layers: Layers,
    /// Views at full resolution, for the visible fractions that are reported.
    views: Vec<View>,
    typical_px: Vec<f64>,
    zones: BirthMap,
    anywhere: BirthMap,
    /// Birth cells near followed people, for two people who were taken for one.
    company: BirthMap,
    /// Birth cells with persistent evidence of a person whom no track explains.
    rescued: BirthMap,
    /// Birth cells near the places at which other trackers see people.
    expected: BirthMap,
    expected_at: Vec<Vector2<f64>>,
    rescue: Rescue,
    settling: Settling,
    blackout: Blackout,
    left_over: LeftOver,
    simulation: Simulation,
    boxes: Boxes,
    capacity: Capacity,
    tracks: Vec<Track>,
    /// Tracks that ended far from every exit.
    lost: LostTracks,
    identities: Identities,
    smoother: FixedLagSmoother,
    encounters: Encounters,
    rng: Pcg64Mcg,
    next_key: Key,
    next_id: u32,
    last_time_s: Option<f64>,
}

impl Mcmc {
    /// Prepares the tracker for a room.
    ///
    /// # Errors
    /// [`Error::Option`] when an option makes no sense.
    pub fn new(stage: PreparedRoom, options: McmcOptions) -> Result<Self> {
        options.validate()?;
        let views: Vec<View> = stage.cameras.iter().map(View::new).collect();
        let average = options.average_body();
        let coarse =
            stage.cameras.iter().map(|c| View::coarse(c, resolution::block(c, &average, &stage.floor)));
        let layers = Layers::new(coarse.collect(), options.likelihood.shapes());
        let (anywhere, zones) = birth_maps(&stage, &layers, &average);
        Ok(Self {
            typical_px: anywhere.typical_px(&layers),
            left_over: LeftOver::default(),
            simulation: Simulation::new(&layers),
            boxes: Boxes::new(&stage),
            layers,
            encounters: Encounters::new(&options),
            rng: Pcg64Mcg::seed_from_u64(options.seed),
            stage,
            rule: options.likelihood.prepared(),
            capacity: Capacity::new(options.max_people),
            options,
            views,
            zones,
            company: anywhere.clone(),
            rescued: anywhere.clone(),
            expected: anywhere.clone(),
            expected_at: Vec::new(),
            rescue: Rescue::default(),
            settling: Settling::default(),
            blackout: Blackout::default(),
            anywhere,
            tracks: Vec::new(),
            lost: LostTracks::default(),
            identities: Identities::default(),
            smoother: FixedLagSmoother::default(),
            next_key: 0,
            next_id: 1,
            last_time_s: None,
        })
    }

    fn packed_masks(&self, moment: &Moment<'_>) -> Result<Vec<Option<Vec<u64>>>> {
        let packed = |((camera, view), frame): ((&PreparedCamera, &View), &CameraFrame)| {
            let Some(mask) = &frame.mask else { return Ok(None) };
            if mask.dimensions() != (camera.width(), camera.height()) {
                return Err(Error::FrameSize {
                    camera: camera.name.clone(),
                    frame: moment.frame,
                    found_width: mask.width(),
                    found_height: mask.height(),
                    width: camera.width(),
                    height: camera.height(),
                });
            }
            Ok(Some(pack(mask, view)))
        };
        self.stage.cameras.iter().zip(self.layers.views()).zip(moment.cameras).map(packed).collect()
    }

    /// Whether the masks of a moment have lost everybody at once.
    fn is_blackout(&mut self, masks: &[Option<Vec<u64>>], moment: &Moment<'_>) -> bool {
        if !self.may_rescue() || masks.iter().all(Option::is_none) {
            return false;
        }
        let foreground_px = masks.iter().zip(self.layers.views()).filter_map(|(mask, view)| {
            let ones: u64 = mask.as_ref()?.iter().map(|word| u64::from(word.count_ones())).sum();
            Some(ones * u64::from(view.block).pow(2))
        });
        self.blackout.observe(moment.time_s, foreground_px.sum())
    }

    /// Whether people may be born outside the zones, where evidence for them persists; without zones they are born
    /// anywhere anyway.
    fn may_rescue(&self) -> bool {
        self.options.rescues_per_s > 0.0 && !self.stage.zones.is_empty()
    }

    /// Handles a gap of `unseen_s` seconds without observations: lowers the probability that people are still there,
    /// and ends all tracks after [`FORGOTTEN_AFTER_S`].
    fn handle_gap(&mut self, unseen_s: f64, sees_anything: bool) {
        if unseen_s > FORGOTTEN_AFTER_S {
            self.tracks.clear();
        } else if unseen_s >= OUTAGE_S && sees_anything {
            let left = -(-unseen_s / FORGOTTEN_AFTER_S).exp_m1();
            self.tracks.iter_mut().for_each(|track| track.may_have_left(left));
        }
        if unseen_s >= OUTAGE_S {
            self.rescue.forget();
        }
    }

    /// Predicts all tracks and returns their people with silhouettes drawn; tracks of people who have probably left
    /// unseen end. `in_doubt`: whether anybody may be deleted anywhere, as after an outage.
    fn predicted(&mut self, dt_s: f64, in_doubt: bool) -> Vec<Person> {
        let (layers, floor, options, simulation) =
            (&self.layers, &self.stage.floor, &self.options, &self.simulation);
        let left = -(-options.deaths_per_s * dt_s).exp_m1();
        let person = |track: &mut Track| {
            let (before, stood) = (track.body(), track.motion.place());
            track.predict(dt_s, options);
            let mut body = track.body();
            let is_at_exit = floor.may_disappear(body.x_m, body.y_m);
            if track.is_tentative() || is_at_exit {
                track.may_have_left(left);
            }
            let at_exit = [&before, &body].map(|body| floor.touches_exit(body.x_m, body.y_m));
            track.may_leave_unseen(at_exit, dt_s, options);
            if !floor.is_standable(body.x_m, body.y_m) && floor.is_standable(before.x_m, before.y_m) {
                // The prediction walked into a wall; the person more probably stopped.
                (body.x_m, body.y_m) = (before.x_m, before.y_m);
                if !track.in_sight {
                    // No observation of a hidden person would correct the prediction.
                    track.motion.halt(stood);
                }
            }
            let silhouettes = layers.silhouettes(&body, |layer| simulation.in_use(layer));
            Person {
                key: track.key,
                body,
                silhouettes,
                at_exit: floor.may_disappear(body.x_m, body.y_m),
                known: Some(track.known()),
                tentative: in_doubt || track.is_tentative(),
            }
        };
        let people = self.tracks.iter_mut().map(person).collect::<Vec<_>>();
        let gone: Vec<Track> = self.tracks.extract_if(.., |track| track.is_gone()).collect();
        let people = people.into_iter().filter(|person| gone.iter().all(|track| track.key != person.key));
        let people = people.collect();
        for track in gone {
            self.lost.add(track);
        }
        people
    }
}

impl Method for Mcmc {
    fn needs(&self) -> Needs {
        Needs { masks: true, pictures: false, empty_scene: false }
    }

    fn step(&mut self, moment: &Moment<'_>) -> Result<Vec<PersonEstimate>> {
        let mut masks = self.packed_masks(moment)?;
        if self.is_blackout(&masks, moment) {
            masks.fill(None);
        }
        self.simulation.restart(&masks);
        self.boxes.restart(moment.cameras.iter().map(|camera| camera.boxes.as_deref()));
        let dt_s = self.last_time_s.map_or(FIRST_STEP_S, |last| moment.time_s - last).max(LEAST_STEP_S);
        self.last_time_s = Some(moment.time_s);
        let sees_anything = self.simulation.sees_anything() || self.boxes.is_in_use();
        let unseen_s = self.settling.observe(moment.time_s, sees_anything);
        self.handle_gap(unseen_s, sees_anything);
        let settling = self.settling.is_on(moment.time_s, self.options.settling_s);
        let found = match (settling, self.settling.had_outage()) {
            (false, _) => BirthPhase::Appearing,
            (true, false) => BirthPhase::AtStart,
            (true, true) => BirthPhase::AfterOutage,
        };

        let people = self.predicted(dt_s, found == BirthPhase::AfterOutage);
        // The birth maps weight the foreground that the predicted people leave unexplained.
        for person in &people {
            self.simulation.insert(&person.silhouettes);
            self.boxes.insert(&person.body);
        }
        let tally = self.sample(people, dt_s, settling);
        self.update_tracks(&tally, found);
        self.update_existence(&masks, moment.time_s, dt_s);
        self.confirm_tracks(moment.time_s);
        self.reidentify(moment.cameras, moment.time_s);
        let (now, traces) = ((moment.frame, moment.time_s), self.traces());
        if self.observes_boxes_alone() {
            self.smoother.push(now, self.options.lag_s.max(REMEMBERED_S), traces, true);
            self.reassociate();
            self.rename_by_traits();
            return Ok(self.smoother.latest().map_or_else(Vec::new, |latest| self.confirmed(latest)));
        }
        let confirmed = self.confirmed(&traces);
        if self.options.lag_s > 0.0 {
            self.smoother.push(now, self.options.lag_s, traces, false);
        }
        Ok(confirmed)
    }

    fn lag_s(&self) -> f64 {
        self.options.lag_s
    }

    fn replace_zones(&mut self, room: &PreparedRoom) -> bool {
        self.stage.floor = room.floor.clone();
        self.stage.zones.clone_from(&room.zones);
        let (anywhere, zones) = birth_maps(&self.stage, &self.layers, &self.options.average_body());
        self.typical_px = anywhere.typical_px(&self.layers);
        for map in [&mut self.company, &mut self.rescued, &mut self.expected] {
            map.clone_from(&anywhere);
        }
        (self.anywhere, self.zones) = (anywhere, zones);
        // Its cells are those of the old maps.
        self.rescue = Rescue::default();
        true
    }

    fn smoothed(&mut self, frame: u32) -> Option<Vec<PersonEstimate>> {
        let people = self.smoother.take(frame)?;
        Some(self.inside_room(people))
    }
}

/// Cells of the floor in which people may be born: anywhere, and in the zones.
fn birth_maps(stage: &PreparedRoom, layers: &Layers, average: &Body) -> (BirthMap, BirthMap) {
    let bounds = stage.floor.bounds();
    let anywhere = BirthMap::new(layers, average, bounds, |x, y| {
        stage.floor.is_standable(x, y) && is_seen(stage, x, y, average.height_m)
    });
    let zones = if stage.zones.is_empty() {
        anywhere.clone()
    } else {
        BirthMap::new(layers, average, bounds, |x, y| {
            stage.floor.is_standable(x, y) && stage.floor.may_appear(x, y)
        })
    };
    (anywhere, zones)
}

/// Whether the feet, middle or head of a person standing here are in some camera's image.
fn is_seen(stage: &PreparedRoom, x_m: f64, y_m: f64, height_m: f64) -> bool {
    stage.cameras.iter().any(|camera| {
        [0.0, 0.5, 1.0].iter().any(|part| {
            let pixel = camera.pinhole.project(&nalgebra::Point3::new(x_m, y_m, part * height_m));
            pixel.is_some_and(|p: Point2<f64>| camera.pinhole.intrinsics.contains(&p))
        })
    })
}

#[cfg(test)]
mod presence_tests;
#[cfg(test)]
mod rendered_tests;
#[cfg(test)]
mod stillness_tests;
#[cfg(test)]
mod tests;

/// Test room with two cameras, and masks of people in it.
#[cfg(test)]
pub(crate) mod test_room {
    pub(crate) use super::tests::{empty_room, masks, standing};
}
