//! State machines of one person at one border.
//!
//! A person's position is known up to the posterior's standard deviation, so near a border nobody knows on which side
//! they are. A change is decided when the probability of being on the other side is high (the position is
//! [`EventOptions::border_sigmas`] standard deviations beyond the border) for [`EventOptions::border_s`], and dated back to the most
//! probable of the moments at which the estimated path crossed the border ([`ChangePoint`]). A person who stands on a border decides
//! nothing.

use scenes::room::Line;

use super::EventOptions;
use super::border::{Area, meetings, offset_from_line};
use super::change_point::ChangePoint;
use super::fix::Fix;

/// Largest error of a difference of times, seconds.
const ROUNDING_S: f64 = 1e-6;

/// A decided side of an area's border.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    Unknown,
    /// Not decided; the path began inside, and was beyond doubt there before it crossed the border.
    BeganInside(Fix),
    Outside,
    /// Inside since a time.
    Inside(Fix),
}

/// A decision about a person and an area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Decision {
    Entered(Fix),
    /// The stay that began at the first fix has passed the area's `dwell_s`.
    Dwelt(Fix, Fix),
    /// Left, after a stay that began at the first fix.
    Left(Fix, Fix),
}

/// A probable change of side, while it has not lasted for long enough to be decided.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Doubt {
    /// The new side, and since when the position is beyond doubt.
    since: Option<(bool, f64)>,
}

impl Doubt {
    /// Takes the side that is beyond doubt now, if there is one; whether it has been for `lasting_s`.
    fn step(&mut self, side: Option<bool>, time_s: f64, lasting_s: f64) -> bool {
        self.since = match (side, self.since) {
            (Some(side), Some((same, since_s))) if side == same => Some((side, since_s)),
            (side, _) => side.map(|side| (side, time_s)),
        };
        // Rounding must not hold a decision for one more frame.
        self.since.is_some_and(|(_, since_s)| time_s - since_s >= lasting_s - ROUNDING_S)
    }

    /// Doubt that a fix at `time_s` does not resolve, but one more on the same side does.
    fn until_after(side: bool, time_s: f64, lasting_s: f64) -> Self {
        Self { since: Some((side, time_s - lasting_s + 2.0 * ROUNDING_S)) }
    }
}

/// A person and an area.
#[derive(Debug, Clone)]
pub(super) struct Stay {
    side: Side,
    doubt: Doubt,
    /// The last fix and its signed distance from the border, metres.
    last: Option<(Fix, f64)>,
    /// The time at which the path came in, or began inside, and that at which it went out, or began outside.
    inward: ChangePoint,
    outward: ChangePoint,
    has_crossed: bool,
    /// The time at which the stay passed `dwell_s`, while the event is not decided.
    dwell_due: Option<Fix>,
    has_dwelt: bool,
}

impl Stay {
    pub(super) fn new() -> Self {
        Self {
            side: Side::Unknown,
            doubt: Doubt::default(),
            last: None,
            inward: ChangePoint::default(),
            outward: ChangePoint::default(),
            has_crossed: false,
            dwell_due: None,
            has_dwelt: false,
        }
    }

    /// State of a person who has come through this area: inside beyond doubt where their path begins.
    pub(super) fn through(area: &Area, began: Fix) -> Self {
        let signed_m = area.offset(&began.place).signed_m;
        let mut stay = Self { side: Side::BeganInside(began), last: Some((began, signed_m)), ..Self::new() };
        stay.turn(began, signed_m);
        stay
    }

    /// Takes a position of the path that decides nothing. Returns its distance inside the border, and that distance's standard
    /// deviation, metres.
    pub(super) fn walk(&mut self, area: &Area, fix: &Fix, options: &EventOptions) -> (f64, f64) {
        let offset = area.offset(&fix.place);
        let signed_m = offset.signed_m;
        match self.last {
            None => self.turn(*fix, signed_m),
            Some((before, was_m)) if (was_m >= 0.0) != (signed_m >= 0.0) => {
                self.turn(before.toward(fix, was_m / (was_m - signed_m)), signed_m);
                self.has_crossed = true;
            }
            Some(_) => {}
        }
        let sigma_m = fix.across_m(&offset, options);
        self.inward.take(signed_m / sigma_m);
        self.outward.take(-signed_m / sigma_m);
        self.pass_dwell(area, fix);
        self.last = Some((*fix, signed_m));
        (signed_m, sigma_m)
    }

    /// Takes the next fix; decisions in the order of their times.
    pub(super) fn step(&mut self, area: &Area, fix: &Fix, options: &EventOptions) -> Vec<Decision> {
        let (signed_m, sigma_m) = self.walk(area, fix, options);
        let outer_m = options.border_sigmas * sigma_m;
        // In an area that is narrower than the uncertainty, half the way to its middle has to do.
        let inner_m = outer_m.min(0.5 * area.depth_m);
        let beyond = match self.side {
            // A certain return: a change that begins later does not begin at an earlier meeting of the border.
            Side::Inside(_) if signed_m >= inner_m => {
                self.outward = ChangePoint::default();
                None
            }
            Side::Outside if signed_m <= -outer_m => {
                self.inward = ChangePoint::default();
                None
            }
            _ if signed_m >= inner_m => Some(true),
            _ if signed_m <= -outer_m => Some(false),
            _ => None,
        };
        if self.side == Side::Unknown && beyond == Some(true) && !self.has_crossed {
            self.side = Side::BeganInside(self.inward.at().unwrap_or(*fix));
        }
        let mut decided = Vec::new();
        if self.doubt.step(beyond, fix.time_s, options.border_s) {
            self.doubt = Doubt::default();
            let (inward, outward) = (std::mem::take(&mut self.inward), std::mem::take(&mut self.outward));
            if beyond == Some(true) {
                let since = inward.at().unwrap_or(*fix);
                self.side = Side::Inside(since);
                (self.dwell_due, self.has_dwelt) = (None, false);
                decided.push(Decision::Entered(since));
                self.pass_dwell(area, fix);
            } else {
                decided.extend(self.left(&outward.at().unwrap_or(*fix)));
                (self.side, self.dwell_due) = (Side::Outside, None);
            }
        }
        if signed_m >= 0.0
            && let (Side::Inside(since), Some(due)) = (self.side, self.dwell_due.take())
        {
            self.has_dwelt = true;
            self.outward = ChangePoint::default();
            decided.push(Decision::Dwelt(since, due));
        }
        decided
    }

    /// Takes the positions of a gap between the last fix and `end`, by time. They decide a stay, or an absence, that begins and ends
    /// between the two. A side on which the person is at either fix is left to the fixes: the path leads there, however wrong that fix
    /// is. One fix after `end` is enough then.
    pub(super) fn pass_gap(
        &mut self,
        area: &Area,
        gap: &[Fix],
        end: &Fix,
        options: &EventOptions,
    ) -> Vec<Decision> {
        let mut unseen = self.clone();
        let decided: Vec<Decision> = gap.iter().flat_map(|fix| unseen.step(area, fix, options)).collect();
        let has_changed = decided.iter().any(|decision| !matches!(decision, Decision::Dwelt(..)));
        let began_inside = self.last.is_some_and(|(_, signed_m)| signed_m >= 0.0);
        let ends_inside = area.offset(&end.place).signed_m >= 0.0;
        if has_changed && began_inside == ends_inside {
            unseen.doubt = Doubt::default();
            *self = unseen;
            return decided;
        }
        for fix in gap {
            self.walk(area, fix, options);
        }
        if has_changed {
            self.doubt = Doubt::until_after(ends_inside, end.time_s, options.border_s);
        }
        Vec::new()
    }

    /// Decisions if the person is never seen again; the state stays, in case they are.
    pub(super) fn end(&self) -> Vec<Decision> {
        let Some((last, signed_m)) = self.last else { return Vec::new() };
        // There is no more evidence to wait for.
        let entered = self.undecided_entry();
        let end = if signed_m < 0.0 { self.outward.at().unwrap_or(last) } else { last };
        match entered {
            Some(since) => vec![Decision::Entered(since), Decision::Left(since, end)],
            None => self.left(&end),
        }
    }

    /// Decisions if the person leaves through this area, and is last there at `end`.
    pub(super) fn end_through(&self, end: &Fix) -> Vec<Decision> {
        if matches!(self.side, Side::Inside(_)) {
            return self.left(end);
        }
        let is_inside = self.last.is_some_and(|(_, signed_m)| signed_m >= 0.0);
        let came_in = self.inward.at().filter(|_| is_inside);
        let since = self.undecided_entry().or(came_in).unwrap_or(*end);
        vec![Decision::Entered(since), Decision::Left(since, *end)]
    }

    /// Decisions at the end of the run about a person who is still there.
    pub(super) fn end_of_run(&self) -> Vec<Decision> {
        if matches!(self.doubt.since, Some((false, _))) {
            return self.outward.at().map_or_else(Vec::new, |left_at| self.left(&left_at));
        }
        self.undecided_entry().map(Decision::Entered).into_iter().collect()
    }

    /// The path comes to the side of this offset, or begins there.
    fn turn(&mut self, at: Fix, signed_m: f64) {
        if signed_m >= 0.0 { self.inward.meet(at) } else { self.outward.meet(at) }
    }

    /// Beginning of a stay that has not lasted for long enough to be decided.
    fn undecided_entry(&self) -> Option<Fix> {
        match self.side {
            Side::BeganInside(first) => Some(first),
            _ if matches!(self.doubt.since, Some((true, _))) => self.inward.at(),
            _ => None,
        }
    }

    /// Decisions of the end of a stay: it may have passed `dwell_s` while it was doubtful, and begun with the path.
    fn left(&self, end: &Fix) -> Vec<Decision> {
        if let Side::BeganInside(first) = self.side {
            return vec![Decision::Entered(first), Decision::Left(first, *end)];
        }
        let Side::Inside(since) = self.side else { return Vec::new() };
        let dwelt = self.dwell_due.filter(|due| due.time_s <= end.time_s);
        let dwelt = dwelt.map(|due| Decision::Dwelt(since, due));
        dwelt.into_iter().chain([Decision::Left(since, *end)]).collect()
    }

    /// Notes the time at which the stay passes `dwell_s`.
    fn pass_dwell(&mut self, area: &Area, fix: &Fix) {
        let (Side::Inside(since), Some(dwell_s)) = (self.side, area.dwell_s) else { return };
        let due_s = since.time_s + dwell_s;
        if self.has_dwelt || self.dwell_due.is_some() || fix.time_s < due_s {
            return;
        }
        let before = self.last.map_or(since, |(last, _)| last);
        let span_s = fix.time_s - before.time_s;
        let share = if span_s > 0.0 { (due_s - before.time_s) / span_s } else { 1.0 };
        let due = before.toward(fix, share);
        self.dwell_due = Some(Fix { time_s: due_s, ..due });
    }
}

/// A person and a line.
#[derive(Debug, Clone, Default)]
pub(super) struct Crossings {
    last: Option<Fix>,
    /// Crossings inward less those outward, since the side was last certain.
    net: i32,
    doubt: Doubt,
    /// The time of the crossing inward, and that of the crossing outward.
    inward: ChangePoint,
    outward: ChangePoint,
}

/// A decided crossing of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crossed {
    pub fix: Fix,
    pub is_inward: bool,
}

impl Crossings {
    /// Crossings of a path that begins at a fix.
    pub(super) fn from(first: Fix) -> Self {
        Self { last: Some(first), ..Self::default() }
    }

    /// Takes a position of the path that decides nothing. Returns its distance from the line, standard deviations.
    pub(super) fn walk(&mut self, line: &Line, fix: &Fix, options: &EventOptions) -> f64 {
        if let Some(last) = self.last {
            for met in meetings(line, &last.place, &fix.place) {
                let at = last.toward(fix, met.share);
                if met.is_inward {
                    self.net += 1;
                    self.inward.meet(at);
                } else {
                    self.net -= 1;
                    self.outward.meet(at);
                }
            }
        }
        self.last = Some(*fix);
        let offset = offset_from_line(line, &fix.place);
        let sigmas = offset.signed_m / fix.across_m(&offset, options);
        self.inward.take(if self.net > 0 { sigmas } else { -sigmas });
        self.outward.take(if self.net < 0 { sigmas } else { -sigmas });
        sigmas
    }

    /// Takes the next fix.
    pub(super) fn step(&mut self, line: &Line, fix: &Fix, options: &EventOptions) -> Option<Crossed> {
        let is_beyond = self.walk(line, fix, options) >= options.border_sigmas;
        if self.net == 0 {
            self.doubt = Doubt::default();
            if is_beyond {
                // A certain return: a later crossing does not begin at an earlier meeting of the line.
                *self = Self::from(*fix);
            }
            return None;
        }
        let side = is_beyond.then_some(self.net > 0);
        if !self.doubt.step(side, fix.time_s, options.border_s) {
            return None;
        }
        let crossed = self.crossed();
        *self = Self::from(*fix);
        crossed
    }

    /// The crossing that is more probable than none if nothing more is seen of the person; the state stays, in case it is.
    pub(super) fn end(&self) -> Option<Crossed> {
        self.crossed()
    }

    /// The crossing of somebody who is still there at the end of the run, and beyond doubt on the other side.
    pub(super) fn end_of_run(&self) -> Option<Crossed> {
        self.doubt.since.and_then(|_| self.crossed())
    }

    fn crossed(&self) -> Option<Crossed> {
        let is_inward = self.net > 0;
        let change = if is_inward { self.inward } else { self.outward };
        change.at().filter(|_| self.net != 0).map(|fix| Crossed { fix, is_inward })
    }
}
