//! People of a state and boxes of one camera: odds of each pair, mutual occlusion, and the sum over the matchings,
//! updated incrementally by a move.

use super::camera::{BoxCamera, ExpectedBox, POINTS, hidden_by};
use super::detector::{Detected, Detector, residuals};
use super::matching::Matching;
use super::presence::Presence;
use crate::silhouette::Body;

/// Least odds of a pair of person and box, were the person surely detected; pairs below are dropped. Each changes the log sum by
/// at most this. The cost of a moment grows with the number of pairs and the size of the groups of people whom they connect. Chosen on
/// wildtrack for its speed, and checked on generated crowds.
const LEAST_ODDS: f64 = 3e-2;
/// Upper bound of the odds of a detection.
const MOST_HIT_ODDS: f64 = 32.4;
/// Margin within which an expected box counts as reaching the image's border, as a fraction of the width.
const BORDER_PART: f64 = 0.012;

/// Person whose terms a tried move changes.
#[derive(Debug, Clone, Copy)]
struct Changed {
    person: usize,
    presence: Presence,
}

/// State in one camera, and the move that was tried last.
#[derive(Debug, Clone)]
pub(super) struct InCamera {
    pub(super) camera: BoxCamera,
    number: usize,
    /// Whether the camera has a detector's boxes at this moment.
    pub(super) in_use: bool,
    pub(super) boxes: Vec<Detected>,
    log_clutter: f64,
    pub(super) people: Vec<Presence>,
    /// Points of each person (row) that each other one (column) hides.
    hides: Vec<u32>,
    stride: usize,
    /// Term of each box in the log sum over matchings.
    box_terms: Vec<f64>,
    /// Indices of the people whose candidate each box is.
    claimants: Vec<Vec<u32>>,
    /// Log-likelihood of the boxes.
    pub(super) value: f64,
    tried: Tried,
}

/// Move that was tried last, and memory for computing it.
#[derive(Debug, Clone, Default)]
struct Tried {
    proposed: Presence,
    /// Points of the proposed person that each person hides, and points of each person that the proposed one hides.
    hidden_by: Vec<u32>,
    hides: Vec<u32>,
    changed: Vec<Changed>,
    /// New terms of people other than the proposed one, and of boxes.
    people_terms: Vec<(usize, f64)>,
    box_terms: Vec<(usize, f64)>,
    value: f64,
    matching: Matching,
    /// Index of each box in the matching; [`NOT_REACHED`] for boxes that are not in it.
    in_matching: Vec<u32>,
    reached_boxes: Vec<u32>,
    reached_people: Vec<u32>,
    is_reached: Vec<bool>,
}

const NOT_REACHED: u32 = u32::MAX;

impl InCamera {
    pub(super) fn new(camera: BoxCamera, number: usize) -> Self {
        Self {
            camera,
            number,
            in_use: false,
            boxes: Vec::new(),
            log_clutter: 0.0,
            people: Vec::new(),
            hides: Vec::new(),
            stride: 0,
            box_terms: Vec::new(),
            claimants: Vec::new(),
            value: 0.0,
            tried: Tried::default(),
        }
    }

    /// Sets the boxes of a new moment; `None` leaves the camera out. Removes all people.
    pub(super) fn restart(&mut self, boxes: Option<impl Iterator<Item = Detected>>, detector: &Detector) {
        self.people.clear();
        self.boxes.clear();
        self.value = 0.0;
        self.in_use = boxes.is_some();
        self.boxes.extend(boxes.into_iter().flatten());
        self.log_clutter = detector.log_clutter(self.number, self.camera.width_px, self.camera.height_px);
        let count = self.boxes.len();
        self.box_terms.clear();
        self.box_terms.resize(count, 0.0);
        self.claimants.iter_mut().for_each(Vec::clear);
        self.claimants.resize_with(count.max(self.claimants.len()), Vec::new);
        self.tried.in_matching.clear();
        self.tried.in_matching.resize(count, NOT_REACHED);
    }

    /// Presence of a body in this camera, hidden by nobody yet.
    pub(super) fn presence(&self, body: &Body, detector: &Detector) -> Presence {
        let mut presence = Presence::of(self.camera.expected(body));
        let Some(expected) = presence.expected else {
            presence.set_hidden(0, detector);
            return presence;
        };
        let outside = self.camera.outside(&expected);
        presence.inside = POINTS - outside.count_ones();
        presence.fixed = outside | self.camera.hidden_by_room(&expected, outside);
        presence.noise = detector.noise(self.camera.focal_px, self.camera.height_px, expected.depth_m);
        presence.set_hidden(0, detector);
        if presence.hit_odds == 0.0 {
            return presence;
        }
        let noise = presence.noise;
        let max_squared_sigmas =
            noise.max_squared_sigmas(self.log_clutter + (LEAST_ODDS / MOST_HIT_ODDS).ln());
        let beyond = self.beyond_border(&expected);
        for (b, detected) in self.boxes.iter().enumerate() {
            let censored = std::array::from_fn(|i| detected.cut[i] && beyond[i]);
            let squared = noise.squared_sigmas(&residuals(&expected, detected, censored));
            if squared < max_squared_sigmas {
                presence.add((b as u32, noise.density_over(squared, self.log_clutter)));
            }
        }
        presence
    }

    /// Whether the expected box goes beyond the image's border at each edge.
    pub(super) fn beyond_border(&self, expected: &ExpectedBox) -> [bool; 4] {
        let margin = BORDER_PART * self.camera.width_px;
        let [left, top, right, bottom] = expected.edges;
        let (to_right, to_bottom) = (self.camera.width_px - margin, self.camera.height_px - margin);
        [left < margin, top < margin, right > to_right, bottom > to_bottom]
    }

    fn hidden(&self, person: usize, except: Option<usize>) -> u32 {
        let row = &self.hides[person * self.stride..person * self.stride + self.people.len()];
        row.iter()
            .enumerate()
            .filter(|(other, _)| Some(*other) != except)
            .fold(0, |all, (_, bits)| all | bits)
    }

    /// Log-likelihood of the state in which the person `old` is removed and `new` is added.
    pub(super) fn try_change(&mut self, old: Option<usize>, new: Option<&Body>, detector: &Detector) -> f64 {
        if !self.in_use {
            return 0.0;
        }
        let proposed = new.map(|body| self.presence(body, detector));
        let mut tried = std::mem::take(&mut self.tried);
        tried.changed.clear();
        tried.hidden_by.clear();
        tried.hides.clear();
        let mut hidden = 0;
        let mut value = self.value;
        for (person, other) in self.people.iter().enumerate() {
            if Some(person) == old {
                tried.hidden_by.push(0);
                tried.hides.push(0);
                continue;
            }
            let both = proposed.as_ref().and_then(|p| p.expected.as_ref()).zip(other.expected.as_ref());
            let (by_other, of_other) =
                both.map_or((0, 0), |(new, other)| (hidden_by(new, other), hidden_by(other, new)));
            hidden |= by_other;
            tried.hidden_by.push(by_other);
            tried.hides.push(of_other);
            let before = old.map_or(0, |old| self.hides[person * self.stride + old]);
            if before != of_other {
                let now = self.hidden(person, old) | of_other;
                if now != other.hidden {
                    let mut presence = *other;
                    presence.set_hidden(now, detector);
                    value += presence.log_miss - other.log_miss;
                    tried.changed.push(Changed { person, presence });
                }
            }
        }
        if let Some(old) = old {
            value -= self.people[old].log_miss;
        }
        if let Some(mut presence) = proposed {
            presence.set_hidden(hidden, detector);
            value += presence.log_miss;
            tried.proposed = presence;
        }
        value += self.change_of_matchings(&mut tried, old, new.is_some());
        tried.value = value;
        self.tried = tried;
        value
    }

    /// Change of the log sum over matchings. Only people and boxes that are connected with the change by pairs,
    /// before or after, have other terms than before.
    fn change_of_matchings(&self, tried: &mut Tried, old: Option<usize>, has_new: bool) -> f64 {
        tried.is_reached.clear();
        tried.is_reached.resize(self.people.len(), false);
        tried.reached_boxes.clear();
        tried.reached_people.clear();
        let mut start = 0;
        let reach_boxes = |presence: &Presence, in_matching: &mut [u32], reached: &mut Vec<u32>| {
            for (b, _) in presence.candidates() {
                if in_matching[*b as usize] == NOT_REACHED {
                    in_matching[*b as usize] = reached.len() as u32;
                    reached.push(*b);
                }
            }
        };
        if has_new {
            reach_boxes(&tried.proposed, &mut tried.in_matching, &mut tried.reached_boxes);
        }
        if let Some(old) = old {
            tried.is_reached[old] = true;
            reach_boxes(&self.people[old], &mut tried.in_matching, &mut tried.reached_boxes);
        }
        for changed in &tried.changed {
            tried.is_reached[changed.person] = true;
            tried.reached_people.push(changed.person as u32);
            reach_boxes(&self.people[changed.person], &mut tried.in_matching, &mut tried.reached_boxes);
        }
        while start < tried.reached_boxes.len() {
            let b = tried.reached_boxes[start] as usize;
            start += 1;
            for &person in &self.claimants[b] {
                if !std::mem::replace(&mut tried.is_reached[person as usize], true) {
                    tried.reached_people.push(person);
                    reach_boxes(
                        &self.people[person as usize],
                        &mut tried.in_matching,
                        &mut tried.reached_boxes,
                    );
                }
            }
        }
        let before: f64 = old.map_or(0.0, |old| self.people[old].term)
            + tried.reached_people.iter().map(|p| self.people[*p as usize].term).sum::<f64>()
            + tried.reached_boxes.iter().map(|b| self.box_terms[*b as usize]).sum::<f64>();
        // The people are in the state's order, so that the same state always has the same value.
        tried.reached_people.sort_unstable();
        tried.matching.restart(tried.reached_boxes.len());
        let changed = &tried.changed;
        for person in &tried.reached_people {
            let person = *person as usize;
            let presence =
                changed.iter().find(|c| c.person == person).map_or(&self.people[person], |c| &c.presence);
            let in_matching = &tried.in_matching;
            tried.matching.add(presence.odds().map(|(b, odds)| (in_matching[b] as usize, odds)));
        }
        if has_new {
            let in_matching = &tried.in_matching;
            tried.matching.add(tried.proposed.odds().map(|(b, odds)| (in_matching[b] as usize, odds)));
        }
        tried.matching.solve();
        tried.people_terms.clear();
        tried.box_terms.clear();
        let mut after = 0.0;
        let mut people = tried.reached_people.iter();
        for term in tried.matching.terms_of_people() {
            after += term;
            match people.next() {
                Some(person) => tried.people_terms.push((*person as usize, term)),
                None => tried.proposed.term = term,
            }
        }
        for (b, term) in tried.reached_boxes.iter().zip(tried.matching.terms_of_boxes()) {
            after += term;
            tried.box_terms.push((*b as usize, term));
            tried.in_matching[*b as usize] = NOT_REACHED;
        }
        after - before
    }

    /// Commits the change that was tried last, with the same `old`; `has_new`: whether a person was added. A new
    /// person is appended, and the last person takes the index of a removed one.
    pub(super) fn commit(&mut self, old: Option<usize>, has_new: bool) {
        if !self.in_use {
            return;
        }
        self.value = self.tried.value;
        for changed in &self.tried.changed {
            self.people[changed.person] = changed.presence;
        }
        for (person, term) in &self.tried.people_terms {
            self.people[*person].term = *term;
        }
        for (b, term) in &self.tried.box_terms {
            self.box_terms[*b] = *term;
        }
        if let Some(old) = old {
            self.unclaim(old);
        }
        match (old, has_new) {
            (Some(old), true) => self.put(old),
            (None, true) => {
                let new = self.people.len();
                self.people.push(Presence::default());
                self.make_room();
                self.hides[new * self.stride + new] = 0;
                self.put(new);
            }
            (Some(old), false) => self.swap_remove(old),
            (None, false) => {}
        }
    }

    fn unclaim(&mut self, person: usize) {
        for (b, _) in self.people[person].candidates() {
            self.claimants[*b as usize].retain(|claimant| *claimant != person as u32);
        }
    }

    /// Stores the proposed person at an index.
    fn put(&mut self, place: usize) {
        self.people[place] = self.tried.proposed;
        for other in (0..self.tried.hides.len()).filter(|other| *other != place) {
            self.hides[place * self.stride + other] = self.tried.hidden_by[other];
            self.hides[other * self.stride + place] = self.tried.hides[other];
        }
        for (b, _) in self.tried.proposed.candidates() {
            self.claimants[*b as usize].push(place as u32);
        }
    }

    fn swap_remove(&mut self, place: usize) {
        let last = self.people.len() - 1;
        if place != last {
            for (b, _) in self.people[last].candidates() {
                let claimants = &mut self.claimants[*b as usize];
                claimants.iter_mut().filter(|c| **c == last as u32).for_each(|c| *c = place as u32);
            }
            for other in 0..last {
                self.hides[place * self.stride + other] = self.hides[last * self.stride + other];
                self.hides[other * self.stride + place] = self.hides[other * self.stride + last];
            }
            self.hides[place * self.stride + place] = 0;
        }
        self.people.swap_remove(place);
    }

    /// Enlarges the table of occlusions to the number of people.
    fn make_room(&mut self) {
        let count = self.people.len();
        if count <= self.stride {
            return;
        }
        let stride = (2 * count).max(16);
        let mut hides = vec![0; stride * stride];
        for row in 0..count - 1 {
            let from = row * self.stride;
            hides[row * stride..row * stride + count - 1]
                .copy_from_slice(&self.hides[from..from + count - 1]);
        }
        (self.hides, self.stride) = (hides, stride);
    }

    /// Solved matching of all people of the state.
    pub(super) fn matching(&self) -> Matching {
        let mut matching = Matching::default();
        matching.restart(self.boxes.len());
        for presence in &self.people {
            matching.add(presence.odds());
        }
        matching.solve();
        matching
    }
}
