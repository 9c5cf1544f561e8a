//! Known metres of a project: lengths, heights, boards and control points, as tables and checked.

use std::collections::BTreeMap;
use std::path::Path;

use calib::vision::chessboard::Chessboard;
use nalgebra::Point2;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use shell::ranges::{DISTANCE_M, ROOM_M};

use super::ProjectCamera;
use super::checked_pick::{camera_called, finite};
use crate::{Error, Result};

/// A length that is known in metres.
#[derive(Debug, Clone, PartialEq)]
pub enum KnownLength {
    /// A known distance between the points at two pixels of one reference image.
    Distance {
        /// Index of the camera.
        camera: usize,
        /// One end, pixels.
        from: Point2<f64>,
        /// The other end, pixels.
        to: Point2<f64>,
        /// Distance between the two points, metres.
        metres: f64,
    },
    /// A known height of a camera's centre above the floor.
    Height {
        /// Index of the camera.
        camera: usize,
        /// Metres above the floor.
        height_m: f64,
    },
    /// A calibration board that lies still in a camera's capture.
    Board {
        /// Index of the camera.
        camera: usize,
        /// Inner corners of the board.
        board: Chessboard,
        /// Side of a square, metres.
        square_m: f64,
    },
}

impl KnownLength {
    /// Index of the camera in whose pictures it is known.
    pub fn camera(&self) -> usize {
        match self {
            Self::Distance { camera, .. } | Self::Height { camera, .. } | Self::Board { camera, .. } => {
                *camera
            }
        }
    }

    /// Its metres.
    pub fn metres(&self) -> f64 {
        match self {
            Self::Distance { metres, .. } => *metres,
            Self::Height { height_m, .. } => *height_m,
            Self::Board { square_m, .. } => *square_m,
        }
    }
}

/// A point whose coordinates on the floor are known, as in a plan of the building: the room gets those coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlPoint {
    /// Index into [`super::Project::cameras`] and the pixel, distorted as filmed.
    pub picks: Vec<(usize, Point2<f64>)>,
    /// Known coordinates on the floor, metres.
    pub place: Point2<f64>,
    /// Height above the floor, metres, where it is known, too.
    pub height_m: Option<f64>,
}

/// Least number of control points: two have a direction.
pub const LEAST_CONTROL_POINTS: usize = 2;
/// Least distance between two of the control points, metres.
const LEAST_SPREAD_M: f64 = 0.5;

/// A `[scale]` or `[[scale]]` table: a length between two pixels, a camera's height, or a calibration board.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaleTable {
    /// Name of the camera.
    pub camera: String,
    /// Pixel of one end of a known length …
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<[f64; 2]>,
    /// … and of the other end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<[f64; 2]>,
    /// The length, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metres: Option<f64>,
    /// Height of the camera above the floor, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<f64>,
    /// Inner corners of a calibration board, such as `9x6`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub board: Option<String>,
    /// Side of its squares, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub square: Option<f64>,
}

/// A `[[control]]` table: a point whose coordinates are known.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ControlTable {
    /// Coordinates on the floor and, if known, the height above it, metres.
    at: Vec<f64>,
    /// Pixel in each camera's reference picture that shows it.
    pixels: BTreeMap<String, [f64; 2]>,
}

/// One `[scale]` table, or several `[[scale]]` tables.
///
/// # Errors
/// Those of the table at fault: a derived `untagged` enum would name none.
pub(super) fn one_or_several<'de, D: Deserializer<'de>>(
    from: D,
) -> std::result::Result<Vec<ScaleTable>, D::Error> {
    struct Tables;
    impl<'de> Visitor<'de> for Tables {
        type Value = Vec<ScaleTable>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("a [scale] table, or [[scale]] tables")
        }

        fn visit_map<A: MapAccess<'de>>(self, table: A) -> std::result::Result<Self::Value, A::Error> {
            Ok(vec![ScaleTable::deserialize(MapAccessDeserializer::new(table))?])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, tables: A) -> std::result::Result<Self::Value, A::Error> {
            Vec::deserialize(SeqAccessDeserializer::new(tables))
        }
    }
    from.deserialize_any(Tables)
}

/// Name of a `[scale]` table in messages: with its number where there are several.
pub(crate) fn scale_place(number: usize, of: usize) -> String {
    if of > 1 { format!("[[scale]] {number}") } else { "[scale]".into() }
}

/// Known lengths of the tables, checked.
pub(super) fn lengths(
    path: &Path,
    tables: &[ScaleTable],
    cameras: &[ProjectCamera],
) -> Result<Vec<KnownLength>> {
    let of = tables.len();
    let numbered = (1..).zip(tables);
    numbered.map(|(number, table)| length(path, &scale_place(number, of), table, cameras)).collect()
}

fn length(path: &Path, place: &str, table: &ScaleTable, cameras: &[ProjectCamera]) -> Result<KnownLength> {
    let at = |key: &str| format!("{place}, {key}");
    let camera = camera_called(path, &at("camera"), &table.camera, cameras)?;
    let positive = |key: &str, value: f64| {
        let problem = if value.is_finite() && value > 0.0 {
            DISTANCE_M.defect(value)
        } else {
            Some(format!("{value} is not a positive number of metres"))
        };
        problem.map_or(Ok(value), |problem| Err(Error::content(path, at(key), problem)))
    };
    let distance = (table.from, table.to, table.metres);
    let board = (table.board.as_deref(), table.square);
    match (distance, table.height, board) {
        ((Some(from), Some(to), Some(metres)), None, (None, None)) => {
            let from = finite(path, &at("from"), from)?;
            let to = finite(path, &at("to"), to)?;
            if (from - to).norm() < 1.0 {
                let problem = "`from` and `to` are the same pixel: the distance has no length";
                return Err(Error::content(path, place, problem));
            }
            Ok(KnownLength::Distance { camera, from, to, metres: positive("metres", metres)? })
        }
        ((None, None, None), Some(height), (None, None)) => {
            Ok(KnownLength::Height { camera, height_m: positive("height", height)? })
        }
        ((None, None, None), None, (Some(board), Some(square))) => {
            let board =
                board.parse().map_err(|problem: String| Error::content(path, at("board"), problem))?;
            Ok(KnownLength::Board { camera, board, square_m: positive("square", square)? })
        }
        _ => Err(Error::content(
            path,
            place,
            "give either `from`, `to` and `metres`, or `height` (of the camera above the floor), or `board` and `square` (a \
             calibration board's inner corners, like \"9x6\", and the side of its squares in metres); several lengths are \
             [[scale]] tables, one each",
        )),
    }
}

/// Control points of the tables, checked: none, or enough for a direction.
pub(super) fn control_points(
    path: &Path,
    tables: &[ControlTable],
    cameras: &[ProjectCamera],
) -> Result<Vec<ControlPoint>> {
    let numbered = (1..).zip(tables);
    let points: Vec<ControlPoint> =
        numbered.map(|(number, table)| control_point(path, number, table, cameras)).collect::<Result<_>>()?;
    if points.is_empty() {
        return Ok(points);
    }
    let apart_m = |a: &ControlPoint, b: &ControlPoint| (a.place - b.place).norm();
    let widest_m = points.iter().flat_map(|a| points.iter().map(move |b| apart_m(a, b))).fold(0.0, f64::max);
    if points.len() < LEAST_CONTROL_POINTS || widest_m < LEAST_SPREAD_M {
        let problem = format!(
            "control points give the room its place and direction: give {LEAST_CONTROL_POINTS} or more, at least \
             {LEAST_SPREAD_M} m apart; there are {}, {widest_m:.2} m apart at most",
            points.len()
        );
        return Err(Error::content(path, "[[control]]", problem));
    }
    Ok(points)
}

fn control_point(
    path: &Path,
    number: usize,
    table: &ControlTable,
    cameras: &[ProjectCamera],
) -> Result<ControlPoint> {
    let place = |key: &str| format!("[[control]] {number}, {key}");
    let refuse = |key: &str, problem: String| Err(Error::content(path, place(key), problem));
    if let Some(problem) = table.at.iter().find_map(|metres| ROOM_M.defect(*metres)) {
        return refuse("at", problem);
    }
    let (x, y, height_m) = match table.at[..] {
        [x, y] => (x, y, None),
        [x, y, height] => (x, y, Some(height)),
        _ => {
            let problem =
                "give [x, y] in metres or, where the height above the floor is known, too, [x, y, height]";
            return refuse("at", problem.into());
        }
    };
    let mut picks = Vec::with_capacity(table.pixels.len());
    for (name, pixel) in &table.pixels {
        let place = place(name);
        picks.push((camera_called(path, &place, name, cameras)?, finite(path, &place, *pixel)?));
    }
    if picks.is_empty() {
        return refuse(
            "pixels",
            "give its pixel in one camera or more: pixels = { cam1 = [320, 240] }".into(),
        );
    }
    picks.sort_by_key(|(camera, _)| *camera);
    Ok(ControlPoint { picks, place: Point2::new(x, y), height_m })
}
