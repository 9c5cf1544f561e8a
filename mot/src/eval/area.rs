//! Judged part of the floor, for a truth that covers less than the cameras' view.
//!
//! As with the ignored regions of image benchmarks, people outside do not count, and neither do tracks outside, unless
//! they are near enough to match a person inside.

use std::collections::HashMap;
use std::str::FromStr;

use nalgebra::{Isometry2, Point2};
use scenes::polygon::Polygon;

use super::EvalOptions;
use crate::rows::{Row, RowFile};
use crate::{Error, Result};

/// A part of the floor, in the truth's frame, metres. Written as its corners, `X,Y X,Y X,Y …`, or as two opposite
/// corners of a rectangle, `X,Y X,Y`.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedArea(Polygon);

impl JudgedArea {
    /// Selects the judged rows of truth and tracks. `to_truth` transforms the tracks' floor positions to the truth's
    /// frame.
    ///
    /// # Errors
    /// Rows without a floor position; names file and line.
    pub fn of(
        &self,
        mut truth: RowFile,
        mut tracks: RowFile,
        gate_m: Option<f64>,
        to_truth: Option<&Isometry2<f64>>,
    ) -> Result<(RowFile, RowFile)> {
        for file in [&truth, &tracks] {
            if let Some(row) = file.rows.iter().find(|r| r.position.is_none()) {
                let place = format!("line {}", row.line);
                return Err(Error::content(
                    &file.path,
                    place,
                    "has no place on the floor, of which the judged area is a part; leave the area out",
                ));
            }
        }
        let gate_m = gate_m.unwrap_or(EvalOptions::GATE);
        truth.rows.retain(|r| r.position.is_some_and(|p| self.0.contains(&p)));
        let mut people: HashMap<u32, Vec<Point2<f64>>> = HashMap::new();
        for Row { frame, position, .. } in &truth.rows {
            people.entry(*frame).or_default().extend(*position);
        }
        tracks.rows.retain(|row| {
            let Some(place) = row.position.map(|p| to_truth.map_or(p, |t| t * p)) else { return false };
            let is_near = |p: &Point2<f64>| (p - place).norm() <= gate_m;
            self.0.contains(&place) || people.get(&row.frame).is_some_and(|people| people.iter().any(is_near))
        });
        Ok((truth, tracks))
    }
}

impl FromStr for JudgedArea {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let corner = |part: &str| {
            let (x, y) = part.split_once(',')?;
            Some(Point2::new(x.trim().parse().ok()?, y.trim().parse().ok()?))
        };
        let corners: Option<Vec<Point2<f64>>> = text.split_whitespace().map(corner).collect();
        let polygon = match corners.as_deref() {
            Some([a, b]) => Polygon::rectangle(*a, *b),
            Some(corners) => Polygon(corners.to_vec()),
            None => return Err(format!("`{text}` is no list of corners; write them as \"0,0 6.5,0 6.5,4\"")),
        };
        polygon.defect().map_or(Ok(Self(polygon)), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> RowFile {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.txt");
        std::fs::write(&path, text).unwrap();
        RowFile::read(&path).unwrap()
    }

    fn on_floor(rows_at: &[(u32, u32, f64, f64)]) -> RowFile {
        let lines: Vec<String> =
            rows_at.iter().map(|(f, id, x, y)| format!("{f},{id},-1,-1,-1,-1,1,{x},{y},0\n")).collect();
        rows(&lines.concat())
    }

    fn kept(file: &RowFile) -> Vec<(u32, u32)> {
        file.rows.iter().map(|r| (r.frame, r.id.unwrap())).collect()
    }

    #[test]
    fn outside_only_tracks_that_match_people_inside_count() {
        let area: JudgedArea = "2,0 6,4".parse().unwrap();
        let truth = on_floor(&[(1, 1, 2.1, 1.0), (1, 2, 1.9, 3.0), (2, 1, 1.5, 1.0)]);
        // Near person 1; alone outside; inside; at the same place as the first, when person 1 has left.
        let tracks = on_floor(&[(1, 7, 1.8, 1.0), (1, 8, 1.9, 3.1), (1, 9, 5.0, 3.0), (2, 7, 1.8, 1.0)]);
        let (truth, tracks) = area.of(truth, tracks, None, None).unwrap();
        assert_eq!(kept(&truth), [(1, 1)]);
        assert_eq!(kept(&tracks), [(1, 7), (1, 9)]);
    }

    #[test]
    fn tracks_of_another_room_are_moved_first() {
        let area: JudgedArea = "0,0 1,0 1,1 0,1".parse().unwrap();
        let to_truth = Isometry2::translation(-10.0, 0.0);
        let tracks = on_floor(&[(1, 1, 10.5, 0.5), (1, 2, 0.5, 0.5)]);
        let (_, tracks) = area.of(on_floor(&[]), tracks, Some(0.1), Some(&to_truth)).unwrap();
        assert_eq!(kept(&tracks), [(1, 1)]);
    }

    #[test]
    fn malformed_areas_and_boxes_are_refused() {
        for bad in ["", "1,2", "a,b 1,2", "0,0 1,1 2,2", "0,0 0,5", "1 2 3 4", "0,0 NaN,1 1,1"] {
            assert!(bad.parse::<JudgedArea>().is_err(), "{bad}");
        }
        let area: JudgedArea = "0,0 1,1".parse().unwrap();
        let error = area.of(on_floor(&[]), rows("1,1,0,0,5,5,1\n"), None, None).unwrap_err().to_string();
        assert!(error.contains("rows.txt") && error.contains("line 1"), "{error}");
    }
}
