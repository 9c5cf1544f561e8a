//! Evaluation protocols of benchmarks: the rows of truth and tracks that count.
//!
//! MOT16, MOT17 and MOT20 annotate more than the people who are judged: each row of their truth has a class in its 8th
//! column and a flag in its 7th. A. Milan et al., "MOT16: a benchmark for multi-object tracking", 2016, section 4.1.3,
//! and P. Dendorfer et al., "MOT20", 2020. In each frame the tracks' boxes are assigned to all boxes of the truth, for
//! the greatest total overlap from [`DISTRACTOR_IOU`] on; tracks on a distractor (a still person, a reflection, a person
//! on a vehicle) are taken out; then only people (class 1) whose flag is not 0 count.
//!
//! WILDTRACK (T. Chavdarova et al., "WILDTRACK: a multi-camera HD dataset for dense unscripted pedestrian detection",
//! CVPR 2018) annotates some frames of its films, on the floor. Trackers are compared in those frames, within
//! [`WILDTRACK_GATE_M`].

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt;
use std::str::FromStr;

use super::assignment::best;
use super::grid::PairTable;
use super::instant::SIMILARITY_TOLERANCE;
use crate::rows::{Row, RowFile};
use crate::{Error, Result};

/// Least overlap of a track and a distractor.
const DISTRACTOR_IOU: f64 = 0.5;
/// Largest distance of a match in WILDTRACK, metres.
const WILDTRACK_GATE_M: f64 = 1.0;

/// Class of people who are judged.
const PERSON: u32 = 1;
/// Classes of MOT16, MOT17 and MOT20.
const CLASSES: std::ops::RangeInclusive<u32> = 1..=13;
/// Person on a vehicle, still person, distractor, reflection.
const DISTRACTORS: [u32; 4] = [2, 7, 8, 12];
/// Vehicle without a motor: a distractor in MOT20.
const MOTORLESS_VEHICLE: u32 = 6;

/// Protocol of a benchmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Protocol {
    /// That of MOT17 where the truth's boxes have classes (of MOT20 where `MOT20` is in the truth's path), otherwise
    /// that of MOT15.
    #[default]
    Auto,
    /// All rows count, but those of the truth whose 7th column is 0.
    Mot15,
    /// MOT16's, which is the same as MOT17's.
    Mot16,
    /// People of class 1; tracks on distractors do not count.
    Mot17,
    /// As MOT17's; vehicles without a motor are distractors, too.
    Mot20,
    /// Frames that the truth annotates, on the floor, within 1 m.
    Wildtrack,
}

/// Names of the protocols on the command line.
const NAMES: [(Protocol, &str); 6] = [
    (Protocol::Auto, "auto"),
    (Protocol::Mot15, "mot15"),
    (Protocol::Mot16, "mot16"),
    (Protocol::Mot17, "mot17"),
    (Protocol::Mot20, "mot20"),
    (Protocol::Wildtrack, "wildtrack"),
];

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = NAMES.iter().find(|(protocol, _)| protocol == self).map_or("", |(_, name)| name);
        f.write_str(name)
    }
}

impl FromStr for Protocol {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let found = NAMES.iter().find(|(_, name)| *name == text).map(|(protocol, _)| *protocol);
        found.ok_or_else(|| {
            format!("`{text}` is no protocol; there are {}", NAMES.map(|(_, name)| name).join(", "))
        })
    }
}

/// Rows of truth and tracks that a protocol judges.
#[derive(Debug)]
pub struct JudgedRows<'a> {
    /// Truth.
    pub truth: Cow<'a, RowFile>,
    /// Tracks.
    pub tracks: Cow<'a, RowFile>,
    /// The protocol that was followed.
    pub summary: ProtocolSummary,
}

/// The protocol that was followed, and the number of rows that it left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProtocolSummary {
    /// Protocol; never [`Protocol::Auto`].
    pub protocol: Protocol,
    /// Number of rows of the truth that were left out by class, flag or frame.
    pub truth_rows: usize,
    /// Number of rows of the tracks that were left out, because of distractors or frames.
    pub track_rows: usize,
}

impl Protocol {
    /// Default of the gate: metres on the floor, least overlap in an image.
    pub fn gate(self) -> f64 {
        if self == Self::Wildtrack { WILDTRACK_GATE_M } else { super::EvalOptions::GATE }
    }

    /// Selects the rows that count. Rows of the truth whose 7th column is 0 are left to
    /// [`Scenario`](super::Scenario::new) where the protocol has no classes.
    ///
    /// # Errors
    /// Truth without classes where the protocol needs them, a row without one among others with classes, an unknown
    /// class, tracks of another class than people's, or boxes where the protocol is on the floor; names file and line.
    pub fn judged<'a>(self, truth: &'a RowFile, tracks: &'a RowFile) -> Result<JudgedRows<'a>> {
        let protocol = self.resolved(truth)?;
        let (judged_truth, judged_tracks) = match protocol {
            Self::Mot16 | Self::Mot17 | Self::Mot20 => {
                if tracks.has_boxes() {
                    check_classes_of(tracks)?;
                    people_and_their_tracks(truth, tracks, protocol == Self::Mot20)
                } else {
                    // Files of different kinds are refused by `common_space`.
                    (Cow::Borrowed(truth), Cow::Borrowed(tracks))
                }
            }
            Self::Wildtrack => {
                let annotated: BTreeSet<u32> = truth.rows.iter().map(|row| row.frame).collect();
                (Cow::Borrowed(truth), Cow::Owned(retained(tracks, |row| annotated.contains(&row.frame))))
            }
            Self::Auto | Self::Mot15 => (Cow::Borrowed(truth), Cow::Borrowed(tracks)),
        };
        let summary = ProtocolSummary {
            protocol,
            truth_rows: truth.rows.len() - judged_truth.rows.len(),
            track_rows: tracks.rows.len() - judged_tracks.rows.len(),
        };
        Ok(JudgedRows { truth: judged_truth, tracks: judged_tracks, summary })
    }

    /// The protocol to follow for this truth.
    fn resolved(self, truth: &RowFile) -> Result<Self> {
        match self {
            Self::Mot15 => Ok(self),
            Self::Wildtrack => match truth.rows.iter().find(|row| row.position.is_none()) {
                Some(row) => Err(Error::content(
                    &truth.path,
                    format!("line {}", row.line),
                    "is a box; the protocol of WILDTRACK compares positions on the floor",
                )),
                None => Ok(self),
            },
            Self::Auto if !has_classes(truth)? => Ok(Self::Mot15),
            Self::Auto if truth.path.to_string_lossy().contains("MOT20") => Ok(Self::Mot20),
            Self::Auto => Ok(Self::Mot17),
            Self::Mot16 | Self::Mot17 | Self::Mot20 if truth.rows.is_empty() || has_classes(truth)? => {
                Ok(self)
            }
            Self::Mot16 | Self::Mot17 | Self::Mot20 => {
                let problem = format!(
                    "has no classes in its 8th column, by which the protocol {self} tells people from distractors; give \
                     --protocol mot15"
                );
                Err(Error::content(&truth.path, "whole file", problem))
            }
        }
    }
}

/// Whether the boxes of a truth have classes in their 8th column, and visibilities in the 9th where there is one.
///
/// # Errors
/// A row without a class among others with one, or a class that the benchmarks do not have.
fn has_classes(truth: &RowFile) -> Result<bool> {
    let is_attribute = |row: &Row| {
        row.pixel_box.is_some()
            && row.class_column.is_none_or(|class| class.fract() == 0.0)
            && row.visibility_column.is_none_or(|visibility| (0.0..=1.0).contains(&visibility))
    };
    if !truth.rows.iter().all(is_attribute) || truth.rows.iter().all(|row| row.class_column.is_none()) {
        return Ok(false);
    }
    for row in &truth.rows {
        let refuse = |problem: String| {
            let problem = format!("{problem}; --protocol mot15 takes no notice of classes");
            Err(Error::content(&truth.path, format!("line {}", row.line), problem))
        };
        match (row.class(), row.class_column) {
            (Some(class), _) if CLASSES.contains(&class) => {}
            (_, None) => return refuse("has no class in its 8th column, where other rows have one".into()),
            (_, Some(class)) => {
                return refuse(format!(
                    "class {class} is none of MOT16, MOT17 and MOT20 (1 to 13, 1 is a person)"
                ));
            }
        }
    }
    Ok(true)
}

/// Refuses tracks of other classes than people's: the protocols judge people only.
fn check_classes_of(tracks: &RowFile) -> Result<()> {
    match tracks.rows.iter().find(|row| row.class().is_some_and(|class| class > PERSON)) {
        Some(row) => Err(Error::content(
            &tracks.path,
            format!("line {}", row.line),
            format!(
                "is of class {}, but only people (1) are judged; leave other classes out of the tracks",
                row.class().unwrap_or(0)
            ),
        )),
        None => Ok(()),
    }
}

/// The people of a truth with classes, and the tracks that are not on distractors.
fn people_and_their_tracks<'a>(
    truth: &'a RowFile,
    tracks: &'a RowFile,
    is_mot20: bool,
) -> (Cow<'a, RowFile>, Cow<'a, RowFile>) {
    let is_distractor = |row: &Row| {
        let is_vehicle = |class| is_mot20 && class == MOTORLESS_VEHICLE;
        row.class().is_some_and(|class| DISTRACTORS.contains(&class) || is_vehicle(class))
    };
    let mut by_frame: HashMap<u32, (Vec<&Row>, Vec<usize>)> = HashMap::new();
    for row in &truth.rows {
        by_frame.entry(row.frame).or_default().0.push(row);
    }
    for (index, row) in tracks.rows.iter().enumerate() {
        by_frame.entry(row.frame).or_default().1.push(index);
    }
    let mut on_distractor: HashSet<usize> = HashSet::new();
    for (truth, of_tracks) in by_frame.values() {
        let overlaps = PairTable::from_fn(truth.len(), of_tracks.len(), |i, j| {
            let boxes = truth[i].pixel_box.zip(tracks.rows[of_tracks[j]].pixel_box);
            let iou = boxes.map_or(0.0, |(a, b)| a.iou(&b));
            if iou < DISTRACTOR_IOU - SIMILARITY_TOLERANCE { 0.0 } else { iou }
        });
        let pairs = best(&overlaps).into_iter().filter(|(i, _)| is_distractor(truth[*i]));
        on_distractor.extend(pairs.map(|(_, j)| of_tracks[j]));
    }
    // The flag is a whole number; TrackEval drops what follows the point.
    let counts = |row: &Row| row.class() == Some(PERSON) && row.confidence.trunc() != 0.0;
    let mut judged = tracks.clone();
    let mut index = 0;
    judged.rows.retain(|_| {
        index += 1;
        !on_distractor.contains(&(index - 1))
    });
    (Cow::Owned(retained(truth, counts)), Cow::Owned(judged))
}

fn retained(file: &RowFile, is_kept: impl Fn(&Row) -> bool) -> RowFile {
    RowFile { path: file.path.clone(), rows: file.rows.iter().filter(|row| is_kept(row)).cloned().collect() }
}

impl ProtocolSummary {
    /// Sentence for the table's first line; empty where all rows count.
    pub fn text(&self) -> String {
        let name = match self.protocol {
            Protocol::Auto | Protocol::Mot15 => return String::new(),
            Protocol::Mot16 => "MOT16",
            Protocol::Mot17 => "MOT17",
            Protocol::Mot20 => "MOT20",
            Protocol::Wildtrack => {
                return format!(
                    "; WILDTRACK's protocol: {} rows in frames without truth left out",
                    self.track_rows
                );
            }
        };
        format!(
            "; {name}'s protocol: {} rows of other classes or flagged 0, and {} rows of tracks on distractors left out",
            self.truth_rows, self.track_rows
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn rows(name: &str, text: &str) -> RowFile {
        RowFile::parse(Path::new(name), text).unwrap()
    }

    fn kept(file: &RowFile) -> Vec<(u32, u32)> {
        file.rows.iter().map(|row| (row.frame, row.id.unwrap())).collect()
    }

    /// A person, a person whose flag is 0, a still person, a car and a bicycle cart, apart from each other.
    const TRUTH: &str = "1,1,0,0,10,20,1,1,1\n1,2,100,0,10,20,0,1,0.4\n1,3,200,0,10,20,0,7,1\n1,4,300,0,10,20,0,3,1\n\
                         1,5,400,0,10,20,0,6,1\n";

    #[test]
    fn tracks_on_distractors_do_not_count_and_tracks_on_ignored_people_do() {
        let truth = rows("MOT17/gt.txt", TRUTH);
        let row = |i: u32| format!("1,{},{},0,10,20,1,-1,-1,-1\n", 11 + i, 100 * i);
        let tracks = (0..5).map(row).collect::<Vec<_>>().concat();
        let tracks = rows("tracks.txt", &tracks);
        let judged = Protocol::Auto.judged(&truth, &tracks).unwrap();
        assert_eq!(judged.summary.protocol, Protocol::Mot17);
        assert_eq!(kept(&judged.truth), [(1, 1)]);
        assert_eq!(kept(&judged.tracks), [(1, 11), (1, 12), (1, 14), (1, 15)]);
        assert!(judged.summary.text().contains("4 rows of other classes"), "{}", judged.summary.text());
        // In MOT20 the cart is a distractor, too.
        let truth = rows("MOT20-01/gt/gt.txt", TRUTH);
        let judged = Protocol::Auto.judged(&truth, &tracks).unwrap();
        assert_eq!(kept(&judged.tracks), [(1, 11), (1, 12), (1, 14)]);
        let judged = Protocol::Mot15.judged(&truth, &tracks).unwrap();
        assert_eq!((judged.truth.rows.len(), judged.tracks.rows.len()), (5, 5));
    }

    #[test]
    fn a_person_beside_a_distractor_keeps_the_track() {
        // The track overlaps both; the person's box is nearer.
        let truth = rows("gt.txt", "1,1,0,0,10,20,1,1,1\n1,2,3,0,10,20,0,12,1\n");
        let tracks = rows("tracks.txt", "1,9,1,0,10,20,1\n");
        assert_eq!(kept(&Protocol::Auto.judged(&truth, &tracks).unwrap().tracks), [(1, 9)]);
        let tracks = rows("tracks.txt", "1,9,2,0,10,20,1\n");
        assert!(Protocol::Auto.judged(&truth, &tracks).unwrap().tracks.rows.is_empty());
    }

    #[test]
    fn files_without_classes_are_judged_whole() {
        for truth in [
            "1,1,0,0,10,20,1\n",
            "1,1,0,0,10,20,1,-1,-1,-1\n",
            "1,1,-1,-1,-1,-1,1,2,3,0\n",
            // A box and its person's position on the floor.
            "1,1,0,0,10,20,1,2.5,3.5,0\n",
            "1,1,0,0,10,20,1,2,-3,0\n",
            "",
        ] {
            let (truth, tracks) = (rows("truth.txt", truth), rows("tracks.txt", "1,1,0,0,10,20,1\n"));
            let judged = Protocol::Auto.judged(&truth, &tracks).unwrap();
            assert_eq!(judged.summary.protocol, Protocol::Mot15, "{truth:?}");
            assert_eq!((&*judged.truth, &*judged.tracks), (&truth, &tracks));
        }
    }

    #[test]
    fn wrong_classes_are_refused_with_their_line() {
        let good = "1,1,0,0,10,20,1,1,1\n";
        for (protocol, truth, tracks, words) in [
            (Protocol::Auto, "1,2,9,0,10,20,1,-1,-1\n", good, ["truth.txt: line 2", "no class"]),
            (Protocol::Auto, "1,2,9,0,10,20,1,14,1\n", good, ["truth.txt: line 2", "class 14"]),
            (Protocol::Auto, "1,2,9,0,10,20,1,0,1\n", good, ["truth.txt: line 2", "class 0"]),
            (Protocol::Mot17, "", "1,2,9,0,10,20,1,3,1\n", ["tracks.txt: line 1", "class 3"]),
            (Protocol::Wildtrack, "", good, ["truth.txt: line 1", "box"]),
        ] {
            let (truth, tracks) = (rows("truth.txt", &format!("{good}{truth}")), rows("tracks.txt", tracks));
            let error = protocol.judged(&truth, &tracks).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)) && !error.contains('\n'), "{error}");
        }
        let truth = rows("truth.txt", "1,1,0,0,10,20,1\n");
        assert!(Protocol::Mot17.judged(&truth, &truth).unwrap_err().to_string().contains("no classes"));
    }

    #[test]
    fn wildtrack_judges_annotated_frames_within_a_metre() {
        let at = |frame: u32, x: f64| format!("{frame},1,-1,-1,-1,-1,1,{x},0,0\n");
        let (truth, tracks) = (
            rows("t", &[at(1, 0.0), at(6, 0.0)].concat()),
            rows("k", &(1..=6).map(|f| at(f, 0.9)).collect::<Vec<_>>().concat()),
        );
        let options = super::super::EvalOptions { protocol: Protocol::Wildtrack, ..Default::default() };
        let found = super::super::Evaluation::of_rows(&truth, &tracks, &options, None).unwrap();
        assert_eq!((found.clear.matches, found.clear.false_positives), (2, 0));
        assert!(found.headline().contains("up to 1 m") && found.headline().contains("4 rows in frames"));
    }

    #[test]
    fn names_come_back() {
        for (protocol, name) in NAMES {
            assert_eq!((name.parse(), protocol.to_string()), (Ok(protocol), name.to_owned()));
        }
        assert!("mot99".parse::<Protocol>().unwrap_err().contains("wildtrack"));
    }
}
