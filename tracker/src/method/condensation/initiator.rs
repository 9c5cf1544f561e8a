//! Track initiation (section 4.3, figure 13): people are found over each gate, at every moment, and as far into the
//! room as they walk before two cameras have seen them for long enough.
//!
//! The paper spreads new hypotheses over a gate at each moment and starts one track at a time. Here half of the
//! hypotheses are resampled from the moment before, so that they gather around a person who is coming; and several
//! people apart from each other are found in the same moment.
//!
//! People leave through gates only. A person whose track was lost elsewhere is still in the room, so they are searched
//! for around the place where they were lost, in an area that grows with time, and keep their id.

use nalgebra::{Point2, Vector2, Vector3};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use scenes::polygon::Polygon;
use scenes::room::ZoneKind;

use super::options::CondensationOptions;
use super::search::{Criteria, HeadSearch};
use super::step_times::StepTimes;
use super::weight::{ExpectedHead, WeighingInput, is_hidden};
use crate::TrackId;
use crate::prepared_room::{Floor, PreparedRoom};

/// Distance from a gate within which people are still found, metres: the way walked in
/// [`LifeOptions::believed_after_s`] and a little more.
///
/// [`LifeOptions::believed_after_s`]: super::options::LifeOptions::believed_after_s
const FOUND_WITHIN_M: f64 = 1.0;
/// Reach of the search around the place where a track was lost, metres, and its growth, m/s, up to…
const LOST_REACH_M: f64 = 0.5;
const LOST_SPEED_M_S: f64 = 1.0;
/// …this reach, metres, and for this time, seconds.
const LOST_FARTHEST_M: f64 = 2.5;
const LOST_FOR_S: f64 = 20.0;

/// Track initiator: searches the gates of a room, and around lost tracks.
#[derive(Debug, Clone)]
pub struct Initiator {
    entries: Vec<HeadSearch>,
    lost: Vec<LostTrack>,
    criteria: Criteria,
    rng: Pcg64Mcg,
}

/// A lost track.
#[derive(Debug, Clone)]
struct LostTrack {
    id: TrackId,
    place: Point2<f64>,
    for_s: f64,
    search: HeadSearch,
}

/// Entry zones that cannot be used as gates.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct UnseenZones {
    /// Names of entry zones in which two cameras never see the same place of a head, each with the cameras that see
    /// some.
    pub zones: Vec<(String, Vec<String>)>,
    /// Whether no entry zone can be used.
    pub is_all: bool,
}

impl Initiator {
    /// Gates of a room. Without entry zones, or where none of them can be used, people are searched for everywhere.
    pub fn new(room: &PreparedRoom, options: &CondensationOptions) -> (Self, UnseenZones) {
        let mut rng = Pcg64Mcg::seed_from_u64(options.seed ^ 0x6761_7465);
        let mut unseen = UnseenZones::default();
        let mut areas = Vec::new();
        let height_m = 0.5 * (options.life.lowest_born_m + options.life.highest_m);
        for zone in room.zones.iter().filter(|z| z.kind != ZoneKind::Exit) {
            let (is_seen_twice, cameras) = seen_from(room, &zone.polygon, height_m, &mut rng);
            if !is_seen_twice {
                unseen.zones.push((zone.name.clone(), cameras));
            }
            let area = surroundings(&zone.polygon);
            if is_seen_twice || seen_from(room, &area, height_m, &mut rng).0 {
                areas.push(area);
            }
        }
        if areas.is_empty() {
            unseen.is_all = true;
            let (low, high) = room.floor.bounds();
            areas.push(Polygon::rectangle(low, high));
        }
        let entries = areas.into_iter().map(|area| HeadSearch::over(area, &mut rng)).collect();
        (Self { entries, lost: Vec::new(), criteria: Criteria::new(options), rng }, unseen)
    }

    /// Registers a track that was lost here without leaving.
    pub fn miss(&mut self, id: TrackId, head: &Vector3<f64>) {
        let place = Point2::new(head.x, head.y);
        let search = HeadSearch::over(around(&place, LOST_FARTHEST_M), &mut self.rng);
        self.lost.push(LostTrack { id, place, for_s: 0.0, search });
    }

    /// Heads that are seen now and not yet tracked, each with the id of the lost track that it continues, if any.
    pub fn new_heads(
        &mut self,
        dt_s: f64,
        floor: &Floor,
        input: &WeighingInput<'_>,
        times: &mut StepTimes,
    ) -> Vec<(ExpectedHead, Option<TrackId>)> {
        times.gates.start();
        let mut found: Vec<ExpectedHead> = Vec::new();
        let mut names = Vec::new();
        self.lost.retain_mut(|lost| {
            lost.for_s += dt_s;
            let reach_m = (LOST_REACH_M + LOST_SPEED_M_S * lost.for_s).min(LOST_FARTHEST_M);
            lost.search.move_to(around(&lost.place, reach_m));
            lost.search.heads(&self.criteria, floor, input, &mut found, &mut self.rng);
            // Only one head continues the track; other heads found there will be found again.
            found.truncate(names.len() + 1);
            let is_found = found.len() > names.len();
            if is_found {
                names.push(Some(lost.id));
            }
            !is_found && lost.for_s < LOST_FOR_S
        });
        for entry in &mut self.entries {
            entry.heads(&self.criteria, floor, input, &mut found, &mut self.rng);
        }
        names.resize(found.len(), None);
        times.gates.stop();
        found.into_iter().zip(names).collect()
    }
}

/// A gate and its surroundings.
fn surroundings(gate: &Polygon) -> Polygon {
    let reaches = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];
    let corners = gate.0.iter();
    let reached = corners.flat_map(|p| reaches.map(|(x, y)| p + FOUND_WITHIN_M * Vector2::new(x, y)));
    Polygon::convex_hull(reached.collect())
}

fn around(place: &Point2<f64>, reach_m: f64) -> Polygon {
    let reach = Vector2::repeat(reach_m);
    Polygon::rectangle(place - reach, place + reach)
}

/// Whether two cameras see the same place of a head above an area, and the names of the cameras that see any.
fn seen_from(room: &PreparedRoom, area: &Polygon, height_m: f64, rng: &mut Pcg64Mcg) -> (bool, Vec<String>) {
    /// Number of sampled places.
    const PROBES: usize = 200;
    let mut seeing = vec![false; room.cameras.len()];
    let mut is_seen_twice = false;
    for _ in 0..PROBES {
        let place = area.sample(rng);
        let head = Vector3::new(place.x, place.y, height_m);
        let mut cameras = 0;
        for (camera, seeing) in room.cameras.iter().zip(&mut seeing) {
            let pixel = camera.pinhole.project(&head.into());
            if pixel.is_some_and(|p| camera.pinhole.intrinsics.contains(&p)) && !is_hidden(camera, &head) {
                *seeing = true;
                cameras += 1;
            }
        }
        is_seen_twice |= cameras >= 2;
    }
    let names = room.cameras.iter().zip(seeing).filter(|(_, s)| *s).map(|(c, _)| c.name.clone());
    (is_seen_twice, names.collect())
}

impl std::fmt::Display for UnseenZones {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("--method condensation finds people where two cameras see the head at once. ")?;
        for (zone, cameras) in &self.zones {
            match &cameras[..] {
                [] => write!(f, "Zone `{zone}`: no camera sees heads there. ")?,
                [one] => write!(f, "Zone `{zone}`: {one} alone sees heads there. ")?,
                names => {
                    write!(f, "Zone `{zone}`: {} see heads there, but never the same. ", names.join(", "))?;
                }
            }
        }
        f.write_str(if self.is_all {
            "No zone is left, so people are looked for everywhere; turn a second camera to the zones, or use --method mcmc"
        } else {
            "There people are found late or not at all, where two cameras see them; turn a second camera to it, or use \
             --method mcmc"
        })
    }
}
