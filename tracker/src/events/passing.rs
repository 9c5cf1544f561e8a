//! State machines of one person at one border.
//!
//! A person's position is known up to the posterior's standard deviation, so near a border nobody knows on which side
//! they are. A change is decided when the probability of being on the other side is high (the position is
//! [`EventOptions::border_sigmas`] standard deviations beyond the border) for [`EventOptions::border_s`], and dated back to the moment at which it was
//! one half: when the estimated path last crossed the border. A person who stands on a border decides nothing.

use nalgebra::{Point2, Vector2};
use scenes::room::Line;

use super::EventOptions;
use super::border::{Area, meetings, offset_from_line};

/// A person's estimated position at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fix {
    pub frame: u32,
    pub time_s: f64,
    pub place: Point2<f64>,
    pub sigma_m: Vector2<f64>,
}

impl Fix {
    /// Position at a share of the way to a later fix; its frame is the last that is not after it.
    fn toward(&self, later: &Self, share: f64) -> Self {
        let share = share.clamp(0.0, 1.0);
        if share >= 1.0 {
            return *later;
        }
        let time_s = self.time_s + share * (later.time_s - self.time_s);
        let place = self.place + (later.place - self.place) * share;
        Self { time_s, place, ..*self }
    }

    /// Distance from a border, across it, at which the side is decided, metres.
    fn decided_m(&self, across: &Vector2<f64>, options: &EventOptions) -> f64 {
        let across = if *across == Vector2::zeros() { Vector2::repeat(0.5_f64.sqrt()) } else { *across };
        let variance = across.component_mul(&self.sigma_m).norm_squared() + options.path_sigma_m.powi(2);
        options.border_sigmas * variance.sqrt()
    }
}

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
        self.since.is_some_and(|(_, since_s)| time_s - since_s >= lasting_s - 1e-6)
    }
}

/// A person and an area.
#[derive(Debug, Clone)]
pub(super) struct Stay {
    side: Side,
    doubt: Doubt,
    /// The last fix and its signed distance from the border, metres.
    last: Option<(Fix, f64)>,
    /// The latest time at which the path crossed the border, or began.
    turned: Option<Fix>,
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
            turned: None,
            has_crossed: false,
            dwell_due: None,
            has_dwelt: false,
        }
    }

    /// Takes the next fix; decisions in the order of their times.
    pub(super) fn step(&mut self, area: &Area, fix: &Fix, options: &EventOptions) -> Vec<Decision> {
        let offset = area.offset(&fix.place);
        let signed_m = offset.signed_m;
        match self.last {
            None => self.turned = Some(*fix),
            Some((before, was_m)) if (was_m >= 0.0) != (signed_m >= 0.0) => {
                self.turned = Some(before.toward(fix, was_m / (was_m - signed_m)));
                self.has_crossed = true;
            }
            Some(_) => {}
        }
        self.pass_dwell(area, fix);
        self.last = Some((*fix, signed_m));
        let outer_m = fix.decided_m(&offset.across, options);
        // In an area that is narrower than the uncertainty, half the way to its middle has to do.
        let inner_m = outer_m.min(0.5 * area.depth_m);
        let beyond = match self.side {
            Side::Inside(_) if signed_m >= inner_m => None,
            Side::Outside if signed_m <= -outer_m => None,
            _ if signed_m >= inner_m => Some(true),
            _ if signed_m <= -outer_m => Some(false),
            _ => None,
        };
        if self.side == Side::Unknown && beyond == Some(true) && !self.has_crossed {
            self.side = Side::BeganInside(self.turned.unwrap_or(*fix));
        }
        let mut decided = Vec::new();
        if self.doubt.step(beyond, fix.time_s, options.border_s) {
            let turned = self.turned.unwrap_or(*fix);
            self.doubt = Doubt::default();
            if beyond == Some(true) {
                self.side = Side::Inside(turned);
                (self.dwell_due, self.has_dwelt) = (None, false);
                decided.push(Decision::Entered(turned));
                self.pass_dwell(area, fix);
            } else {
                decided.extend(self.left(&turned));
                (self.side, self.dwell_due) = (Side::Outside, None);
            }
        }
        if signed_m >= 0.0
            && let (Side::Inside(since), Some(due)) = (self.side, self.dwell_due.take())
        {
            self.has_dwelt = true;
            decided.push(Decision::Dwelt(since, due));
        }
        decided
    }

    /// Decisions if the person is never seen again; the state stays, in case they are.
    pub(super) fn end(&self) -> Vec<Decision> {
        let Some((last, signed_m)) = self.last else { return Vec::new() };
        let turned = self.turned.unwrap_or(last);
        // There is no more evidence to wait for.
        let entered = self.undecided_entry();
        let end = if signed_m < 0.0 { turned } else { last };
        match entered {
            Some(since) => vec![Decision::Entered(since), Decision::Left(since, end)],
            None => self.left(&end),
        }
    }

    /// Decisions at the end of the run about a person who is still there.
    pub(super) fn end_of_run(&self) -> Vec<Decision> {
        if matches!(self.doubt.since, Some((false, _))) {
            return self.turned.map_or_else(Vec::new, |turned| self.left(&turned));
        }
        self.undecided_entry().map(Decision::Entered).into_iter().collect()
    }

    /// Beginning of a stay that has not lasted for long enough to be decided.
    fn undecided_entry(&self) -> Option<Fix> {
        match self.side {
            Side::BeganInside(first) => Some(first),
            _ if matches!(self.doubt.since, Some((true, _))) => self.turned,
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
    /// The latest crossing inward and outward.
    inward: Option<Fix>,
    outward: Option<Fix>,
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

    /// Takes the next fix.
    pub(super) fn step(&mut self, line: &Line, fix: &Fix, options: &EventOptions) -> Option<Crossed> {
        if let Some(last) = self.last {
            for met in meetings(line, &last.place, &fix.place) {
                let at = Some(last.toward(fix, met.share));
                if met.is_inward {
                    (self.net, self.inward) = (self.net + 1, at);
                } else {
                    (self.net, self.outward) = (self.net - 1, at);
                }
            }
        }
        self.last = Some(*fix);
        if self.net == 0 {
            self.doubt = Doubt::default();
            return None;
        }
        let offset = offset_from_line(line, &fix.place);
        let is_beyond = offset.signed_m >= fix.decided_m(&offset.across, options);
        let side = is_beyond.then_some(self.net > 0);
        if !self.doubt.step(side, fix.time_s, options.border_s) {
            return None;
        }
        let crossed = self.crossed();
        (self.net, self.doubt) = (0, Doubt::default());
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
        let fix = if is_inward { self.inward } else { self.outward };
        fix.filter(|_| self.net != 0).map(|fix| Crossed { fix, is_inward })
    }
}
