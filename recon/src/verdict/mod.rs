//! A build's verdict: green, amber or red, with reasons, from what the build's own figures know.
//!
//! A room can be finished and wrong: three picks of a pair fit whatever they are, a façade can be taken for the floor, a
//! length can be in millimetres. [`evidence`] gathers what bears a room out or contradicts it: surfaces that stand in
//! another camera's view, how alike pictures are where surfaces coincide, features that are found in both, the number of picks
//! and whether the captures' motions contradict them, vertical lines in the pictures, heights and distances in metres, known
//! lengths that contradict each other. [`judge`] compares these with bounds. *Red*: the room contradicts itself or
//! is of an impossible size. *Amber*: it is doubtful, or nothing bears it out. *Green*: all else.

pub mod evidence;
mod metres;
#[cfg(test)]
mod tests;

use serde::Serialize;

pub use evidence::{CameraEvidence, PairEvidence, RoomEvidence};

/// Bounds of the verdict: `doubtful` is amber from here on, `impossible` is red.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    doubtful: f64,
    impossible: f64,
}

impl Bounds {
    fn light(self, value: f64) -> Light {
        if value >= self.impossible {
            Light::Red
        } else if value >= self.doubtful {
            Light::Amber
        } else {
            Light::Green
        }
    }
}

/// Share of one camera's measured surface that stands in another's view.
const IN_THE_WAY: Bounds = Bounds { doubtful: 0.15, impossible: 0.3 };
/// Number of pixels below which such a share tells nothing.
const LEAST_OVERLAPPING: usize = 200;
/// Least median correlation of the pictures where two surfaces coincide that bears a pair out, …
const ALIKE: f64 = 0.35;
/// … and the largest of pictures that show different things; both at least at this number of places.
const UNLIKE: f64 = 0.3;
const LEAST_COMPARED: usize = 40;
/// Number of picks that fit a pair whatever they are.
const FITS_ANYTHING: usize = 3;
/// Largest share of a pair's points that may be left out where the program proposed them.
const MOST_LEFT_OUT: f64 = 0.34;
/// Root mean square distance of the picks, in shares of the picture's width.
const PICKS_OFF: f64 = 0.008;
/// Height of a camera above the floor and median distance of the surfaces from the cameras, metres.
const HEIGHT_M: Bounds = Bounds { doubtful: 30.0, impossible: 100.0 };
const REACH_M: Bounds = Bounds { doubtful: 100.0, impossible: 300.0 };
/// The same, downwards.
const LEAST_HEIGHT_M: [f64; 2] = [0.2, 0.02];
const LEAST_REACH_M: [f64; 2] = [0.3, 0.05];
/// Angle between the floor's normal and the vertical of a camera's lines, degrees, …
const LEAN_DEG: f64 = 8.0;
/// … and how many times as many lines have to be for another vertical.
const OUTVOTED: f64 = 1.6;
/// Share of the seen area below which a floor is doubtful.
const LEAST_FLOOR: f64 = 0.03;
/// Median angle between the rays to a point, degrees.
const LEAST_PARALLAX_DEG: f64 = 1.6;
/// Relative standard deviation of an estimated focal length.
const FOCAL_DOUBT: f64 = 0.05;

/// Colour of a verdict; the worse is the larger.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Light {
    /// Nothing speaks against the room.
    #[default]
    Green,
    /// Look at the room before you use it.
    Amber,
    /// The room is wrong.
    Red,
}

impl Light {
    /// Name of the colour.
    pub fn word(self) -> &'static str {
        match self {
            Self::Green => "green",
            Self::Amber => "amber",
            Self::Red => "red",
        }
    }
}

/// One reason of a verdict.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// Colour that this reason alone would give; green for what is only worth knowing.
    pub light: Light,
    /// One sentence with the mend.
    pub text: String,
}

/// Verdict about a room.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// The worst colour of the reasons.
    pub light: Light,
    /// Reasons, the worst first.
    pub reasons: Vec<Reason>,
}

impl Verdict {
    /// Adds what is only worth knowing.
    pub(crate) fn note(&mut self, text: String) {
        self.reasons.push(Reason { light: Light::Green, text });
    }
}

/// Figures of a capture that a verdict weighs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CaptureFigures {
    /// Name of the camera.
    pub name: String,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Median of the widest angle between the rays to a point, degrees.
    pub parallax_deg: f64,
    /// Relative standard deviation of a focal length that was estimated.
    pub focal_sigma: Option<f64>,
    /// Doubts about the motion, a sentence each.
    pub doubts: Vec<String>,
}

/// Judges a room by its evidence and its captures' figures, both in the order of the project's cameras.
pub fn judge(evidence: &RoomEvidence, captures: &[CaptureFigures]) -> Verdict {
    let mut reasons = Vec::new();
    sizes(evidence, captures, &mut reasons);
    metres::lengths(&evidence.lengths, &mut reasons);
    metres::control_points(&evidence.control_points, &mut reasons);
    pairs(evidence, captures, &mut reasons);
    adjustment(evidence, captures, &mut reasons);
    floor(evidence, captures, &mut reasons);
    for (index, capture) in captures.iter().enumerate() {
        of_capture(index, capture, evidence, &mut reasons);
    }
    reasons.sort_by_key(|reason| std::cmp::Reverse(reason.light));
    let light = reasons.iter().map(|reason| reason.light).max().unwrap_or_default();
    Verdict { light, reasons }
}

/// Metres that no room has: a length in millimetres, or of another thing.
fn sizes(evidence: &RoomEvidence, captures: &[CaptureFigures], reasons: &mut Vec<Reason>) {
    let small = |value: f64, [doubtful, impossible]: [f64; 2]| {
        if value <= impossible {
            Light::Red
        } else if value <= doubtful {
            Light::Amber
        } else {
            Light::Green
        }
    };
    let heights = evidence.cameras.iter().zip(captures).map(|(camera, capture)| {
        let height = camera.height_m;
        let light = HEIGHT_M.light(height).max(small(height, LEAST_HEIGHT_M));
        (light, format!("`{}` is {} above the floor", capture.name, metres(height)))
    });
    let reach = evidence.reach_m;
    let light = REACH_M.light(reach).max(small(reach, LEAST_REACH_M));
    let reach = (light, format!("what the cameras see is {} away", metres(reach)));
    // The first of the worst says it: one length makes all of them wrong.
    let worst = heights.chain([reach]).reduce(|worst, next| if next.0 > worst.0 { next } else { worst });
    if let Some((light, text)) = worst.filter(|(light, _)| *light > Light::Green) {
        let mend =
            "known lengths and control points are in metres, not in millimetres or centimetres: check them";
        reasons.push(Reason { light, text: format!("{text}: {mend}") });
    }
}

/// A length for a sentence.
fn metres(value: f64) -> String {
    if value < 0.1 { format!("{:.1} mm", 1e3 * value) } else { format!("{value:.1} m") }
}

/// Cameras that contradict each other, and joints that nothing bears out.
fn pairs(evidence: &RoomEvidence, captures: &[CaptureFigures], reasons: &mut Vec<Reason>) {
    for pair in &evidence.pairs {
        let [a, b] = pair.cameras.map(|camera| &captures[camera].name);
        let width = pair.cameras.map(|camera| captures[camera].width).into_iter().min().unwrap_or_default();
        let is_borne_out = pair.is_borne_out();
        let light = pair.contradiction();
        if light > Light::Green {
            let text = format!(
                "{:.0} % of what `{a}` and `{b}` measured stands in the other's view, which sees past it: check their picks, \
                 and that each capture is this camera's and not mirrored",
                100.0 * pair.in_the_way
            );
            reasons.push(Reason { light, text });
        } else if pair.is_unlike() {
            let text = format!(
                "`{a}` and `{b}` look different where their surfaces coincide (correlation {:.2}): check their picks",
                pair.correlation
            );
            reasons.push(Reason { light: Light::Amber, text });
        }
        if pair.picks == 0 {
            continue;
        }
        if pair.picks <= FITS_ANYTHING {
            let proof =
                format!("{} picks of `{a}` and `{b}` fit whatever they are and prove nothing", pair.picks);
            let reason = if is_borne_out && light == Light::Green {
                let text = format!(
                    "{proof}; their pictures agree where surfaces coincide (correlation {:.2})",
                    pair.correlation
                );
                Reason { light: Light::Green, text }
            } else {
                let text = format!("{proof}, and nothing else bears them out: pick two or three points more");
                Reason { light: Light::Amber, text }
            };
            reasons.push(reason);
        }
        let picked = pair.picks + pair.left_out;
        if pair.left_out > 0 {
            // A person's pick that is left out contradicts the room; of the program's own proposals some may be chance.
            let is_much = pair.left_out as f64 > MOST_LEFT_OUT * picked as f64;
            let light = if is_much || !evidence.are_picks_proposed { Light::Amber } else { Light::Green };
            let text = format!(
                "{} of {picked} picks of `{a}` and `{b}` do not fit and were left out: pick them again",
                pair.left_out
            );
            reasons.push(Reason { light, text });
        }
        if pair.rms_px > PICKS_OFF * f64::from(width) {
            let text = format!("picks of `{a}` and `{b}` are {:.1} px off: check each", pair.rms_px);
            reasons.push(Reason { light: Light::Amber, text });
        }
    }
}

impl PairEvidence {
    /// Whether both pictures are alike where the surfaces coincide.
    fn is_borne_out(&self) -> bool {
        self.compared >= LEAST_COMPARED && self.correlation >= ALIKE
    }

    /// Whether the pictures show different things where the surfaces coincide.
    fn is_unlike(&self) -> bool {
        self.compared >= LEAST_COMPARED && self.correlation < UNLIKE
    }

    /// Colour by the surfaces that stand in the other's view. Edges of things and vague depths stand there, too: where the
    /// pictures are alike a share is less doubtful, and where they differ it is more.
    fn contradiction(&self) -> Light {
        if self.overlapping < LEAST_OVERLAPPING {
            return Light::Green;
        }
        let is_compared = self.compared >= LEAST_COMPARED;
        match (IN_THE_WAY.light(self.in_the_way), self.is_borne_out()) {
            (Light::Red, true) => Light::Amber,
            (Light::Amber, true) => Light::Green,
            (Light::Amber, false) if is_compared => Light::Red,
            (light, _) => light,
        }
    }
}

/// Captures that contradict the picks, and a camera whose place nothing but the picks tells: its picture looks like the others'
/// and shares no feature with them, as a pattern that repeats does at a wrong place, or they have not been alike enough to search.
fn adjustment(evidence: &RoomEvidence, captures: &[CaptureFigures], reasons: &mut Vec<Reason>) {
    if evidence.adjustment_contradicts_picks {
        let text = "the captures' own motions contradict the picks, which alone place the cameras now: check each pick, and that \
                    each capture is of the camera that it is named for";
        reasons.push(Reason { light: Light::Amber, text: text.into() });
    }
    for (index, capture) in captures.iter().enumerate() {
        let of_camera = || evidence.pairs.iter().filter(move |pair| pair.cameras.contains(&index));
        let shares_features = of_camera().any(|pair| pair.shared_features.is_some_and(|count| count > 0));
        // Pictures that hardly overlap have nothing to share, and those that look different are told as such.
        let has_to_share = of_camera().any(|pair| pair.compared >= LEAST_COMPARED && !pair.is_unlike());
        // Of two cameras the first tells it for both.
        let is_told = evidence.cameras.len() == 2 && index == 1;
        if shares_features || !has_to_share || is_told {
            continue;
        }
        let name = &capture.name;
        let text = if of_camera().any(|pair| pair.shared_features.is_some()) {
            format!(
                "the picture of `{name}` looks like others where surfaces coincide, but no feature of it is found in them again: a \
                 pattern that repeats may deceive; check its picks, and that the capture is of this camera"
            )
        } else {
            format!(
                "where the picks put `{name}`, its surfaces and its picture do not agree well enough with the others' to bear them \
                 out: pick more points, at corners of things and far apart, and check that the capture is of this camera"
            )
        };
        reasons.push(Reason { light: Light::Amber, text });
    }
}

/// A floor that is small, or on which the pictures do not stand upright.
fn floor(evidence: &RoomEvidence, captures: &[CaptureFigures], reasons: &mut Vec<Reason>) {
    if evidence.floor_share < LEAST_FLOOR {
        let text = format!(
            "the floor is {:.1} % of what is seen: let the captures show more of it",
            100.0 * evidence.floor_share
        );
        reasons.push(Reason { light: Light::Amber, text });
    }
    let leaning = |camera: &&CameraEvidence| {
        camera.lean_deg.is_some_and(|lean| lean > LEAN_DEG) && camera.outvoted > OUTVOTED
    };
    let with_lines = evidence.cameras.iter().filter(|camera| camera.lean_deg.is_some()).count();
    let against = evidence.cameras.iter().filter(leaning).count();
    let first = evidence.cameras.iter().zip(captures).find(|(camera, _)| leaning(camera));
    // One camera's lines may be a pattern's; most of them are not.
    if let Some((camera, capture)) = first.filter(|_| 2 * against > with_lines) {
        let text = format!(
            "vertical lines in `{}` lean by {:.0}° against the floor that was found: a wall may have been taken for the floor; \
             look at plan.png, and let the captures show more of the floor",
            capture.name,
            camera.lean_deg.unwrap_or_default()
        );
        reasons.push(Reason { light: Light::Amber, text });
    }
}

/// Doubts about one capture; only worth knowing where its picture and another camera's bear its space out.
fn of_capture(index: usize, capture: &CaptureFigures, evidence: &RoomEvidence, reasons: &mut Vec<Reason>) {
    let name = &capture.name;
    let mut of_camera = evidence.pairs.iter().filter(|pair| pair.cameras.contains(&index));
    let is_borne_out = of_camera.any(|pair| pair.is_borne_out() && pair.contradiction() == Light::Green);
    let light = if is_borne_out { Light::Green } else { Light::Amber };
    let mut doubt = |text: String| reasons.push(Reason { light, text });
    if capture.parallax_deg < LEAST_PARALLAX_DEG {
        doubt(format!(
            "`{name}` hardly moved (points are seen from directions {:.1}° apart), so its depths are vague: film along a wider path",
            capture.parallax_deg
        ));
    }
    if let Some(sigma) = capture.focal_sigma.filter(|sigma| *sigma > FOCAL_DOUBT) {
        doubt(format!(
            "the focal length of `{name}` is known to {:.0} % only: calibrate it by `calib intrinsics`",
            100.0 * sigma
        ));
    }
    for text in &capture.doubts {
        doubt(format!("`{name}`: {text}"));
    }
}
