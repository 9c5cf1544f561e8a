//! Alignment of another program's world with the room's by points that are known in both: a file of their coordinates, and
//! the similarity between them ([`calib::absolute_orientation`]).

use std::path::Path;

use calib::absolute_orientation::{rigid, similarity};
use nalgebra::{Point3, Similarity3};
use serde::Deserialize;

use crate::{Error, Result};

/// A point that is known in both worlds.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownPoint {
    /// Name to show to people; the number of its line where it has none.
    pub name: String,
    /// Place in the model's world, its unit.
    pub in_model: Point3<f64>,
    /// Place in the room, metres.
    pub in_room: Point3<f64>,
}

/// A similarity between two worlds, and how well the points agree with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// Way from the model's world to the room's.
    pub room_from_model: Similarity3<f64>,
    /// Distance of each point, metres, from where the similarity puts it.
    pub residuals_m: Vec<f64>,
    /// Point that does not agree with the others, if there is one.
    pub outlier: Option<Outlier>,
}

/// A point that does not agree with the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Its number among the points, from 0.
    pub index: usize,
    /// Distance, metres, from where the others alone put it.
    pub distance_m: f64,
    /// Root mean square distance of the others without it, metres.
    pub others_rms_m: f64,
}

impl Alignment {
    /// Root mean square of the residuals, metres.
    pub fn rms_m(&self) -> f64 {
        root_mean_square(&self.residuals_m)
    }
}

#[derive(Deserialize)]
struct Row {
    x: f64,
    y: f64,
    z: f64,
    room_x: f64,
    room_y: f64,
    room_z: f64,
    #[serde(default)]
    name: String,
}

/// Reads known points: a header `x,y,z,room_x,room_y,room_z` (`name` may follow) and a line a point.
///
/// # Errors
/// [`Error::File`] naming the point and its problem.
pub fn read_points(path: &Path) -> Result<Vec<KnownPoint>> {
    let file = std::fs::File::open(path).map_err(Error::io(path))?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(file);
    let mut points = Vec::new();
    for (row, number) in reader.deserialize::<Row>().zip(1..) {
        let wrong = |problem: &str| Error::content(path, format!("point {number}"), problem);
        let row = row.map_err(|_| {
            wrong("is no x,y,z,room_x,room_y,room_z (and name) of numbers, which the header says the columns are")
        })?;
        let name = if row.name.is_empty() { format!("{number}") } else { row.name };
        let (in_model, in_room) = ([row.x, row.y, row.z], [row.room_x, row.room_y, row.room_z]);
        if !in_model.iter().chain(&in_room).all(|value| value.is_finite()) {
            return Err(wrong("a number is not finite; correct or remove the line"));
        }
        points.push(KnownPoint { name, in_model: in_model.into(), in_room: in_room.into() });
    }
    Ok(points)
}

/// Ratio of a point's distance to the others' agreement without it from which on it counts as an outlier …
const OUTLIER_RATIO: f64 = 5.0;
/// … and the least such distance, metres.
const LEAST_OUTLIER_M: f64 = 0.02;
/// Fewest points of which one can be told to be wrong: three always fit closely.
const FEWEST_FOR_OUTLIERS: usize = 5;
/// Share of the residual below which a mirrored model's makes the model a mirrored one.
const MIRRORED_SHARE: f64 = 0.2;

/// Finds the similarity that takes the points of the model to those of the room; with `scale`, metres a unit of the model,
/// only rotation and translation.
///
/// # Errors
/// One line without the file's name: too few points, points on a line, a mirrored world.
pub fn align(points: &[KnownPoint], scale: Option<f64>) -> std::result::Result<Alignment, String> {
    let fit = fit(points, scale)?;
    let residuals_m = residuals(points, &fit);
    // Points on a plane fit as well when they are mirrored: half a turn does that.
    let mirrored: Vec<KnownPoint> = points
        .iter()
        .map(|p| KnownPoint { in_model: Point3::new(-p.in_model.x, p.in_model.y, p.in_model.z), ..p.clone() })
        .collect();
    let rms_m = root_mean_square(&residuals_m);
    let of_mirrored = self::fit(&mirrored, scale).map(|fit| root_mean_square(&residuals(&mirrored, &fit)));
    if rms_m > LEAST_OUTLIER_M && of_mirrored.is_ok_and(|other| other < MIRRORED_SHARE * rms_m) {
        return Err(
            "the points fit only as in a mirror; is one of the worlds left-handed, or an axis' sign wrong?"
                .into(),
        );
    }
    Ok(Alignment { room_from_model: fit, residuals_m, outlier: outlier(points, scale) })
}

fn fit(points: &[KnownPoint], scale: Option<f64>) -> std::result::Result<Similarity3<f64>, String> {
    let room: Vec<Point3<f64>> = points.iter().map(|p| p.in_room).collect();
    let model: Vec<Point3<f64>> = points.iter().map(|p| p.in_model * scale.unwrap_or(1.0)).collect();
    let found = match scale {
        Some(scale) => rigid(&model, &room).map(|isometry| Similarity3::from_isometry(isometry, scale)),
        None => similarity(&model, &room),
    };
    found.map_err(|e| e.to_string())
}

fn residuals(points: &[KnownPoint], room_from_model: &Similarity3<f64>) -> Vec<f64> {
    points.iter().map(|p| (room_from_model * p.in_model - p.in_room).norm()).collect()
}

/// The point that stands out most from where the others put it.
fn outlier(points: &[KnownPoint], scale: Option<f64>) -> Option<Outlier> {
    if points.len() < FEWEST_FOR_OUTLIERS {
        return None;
    }
    let without = |index: usize| {
        let others: Vec<KnownPoint> =
            points.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, p)| p.clone()).collect();
        let fit = fit(&others, scale).ok()?;
        let distance_m = (fit * points[index].in_model - points[index].in_room).norm();
        Some(Outlier { index, distance_m, others_rms_m: root_mean_square(&residuals(&others, &fit)) })
    };
    let stands_out =
        |o: &Outlier| o.distance_m > LEAST_OUTLIER_M && o.distance_m > OUTLIER_RATIO * o.others_rms_m;
    (0..points.len())
        .filter_map(without)
        .filter(stands_out)
        .min_by(|a, b| a.others_rms_m.total_cmp(&b.others_rms_m))
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn truth() -> Similarity3<f64> {
        Similarity3::new(Vector3::new(500_000.0, -3.0, 1.5), Vector3::new(0.3, -1.2, 0.7), 0.37)
    }

    fn points() -> Vec<KnownPoint> {
        let corners = [
            [0.0, 0.0, 0.1],
            [9.0, 0.5, 0.0],
            [8.5, 7.0, 0.2],
            [0.2, 6.5, 5.0],
            [4.0, 3.0, 2.0],
            [1.0, 2.0, 4.0],
        ];
        corners
            .iter()
            .enumerate()
            .map(|(i, corner)| {
                let in_model = Point3::from(*corner);
                KnownPoint { name: format!("p{i}"), in_model, in_room: truth() * in_model }
            })
            .collect()
    }

    #[test]
    fn known_points_give_the_similarity_back() {
        let found = align(&points(), None).unwrap();
        assert!(found.rms_m() < 1e-8 && found.outlier.is_none(), "{found:?}");
        let off = found.room_from_model * truth().inverse();
        assert!((off.scaling() - 1.0).abs() < 1e-9 && off.isometry.rotation.angle() < 1e-9, "{off}");
        let rigid = align(&points(), Some(0.37)).unwrap();
        assert!(rigid.rms_m() < 1e-8 && (rigid.room_from_model.scaling() - 0.37).abs() < 1e-15);
        // A scale that is 1 % off leaves residuals of 1 % of the distances.
        let rms_m = align(&points(), Some(0.37 * 1.01)).unwrap().rms_m();
        assert!((0.005..0.03).contains(&rms_m), "{rms_m}");
    }

    #[test]
    fn a_wrong_point_is_named_and_a_mirrored_world_refused() {
        let mut wrong = points();
        wrong[3].in_room.x += 0.5;
        let found = align(&wrong, None).unwrap();
        let outlier = found.outlier.unwrap();
        assert_eq!(outlier.index, 3);
        assert!((outlier.distance_m - 0.5).abs() < 1e-6 && outlier.others_rms_m < 1e-8, "{outlier:?}");
        let mut mirrored = points();
        for point in &mut mirrored {
            point.in_model.y *= -1.0;
        }
        assert!(align(&mirrored, None).unwrap_err().contains("mirror"));
        assert!(align(&points()[..2], None).unwrap_err().contains("at least 3"));
    }

    #[test]
    fn files_of_points_are_read_and_their_defects_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picks.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_points(&path).map_err(|e| e.to_string())
        };
        let header = "x,y,z,room_x,room_y,room_z";
        let found =
            read(&format!("{header},name\n# corners\n1, 2,3, 4,5,6.5, door\n1,1,1,2,2,2,\n")).unwrap();
        assert_eq!((found[0].name.as_str(), found[1].name.as_str()), ("door", "2"));
        assert_eq!(
            (found[0].in_model, found[0].in_room),
            (Point3::new(1.0, 2.0, 3.0), Point3::new(4.0, 5.0, 6.5))
        );
        for (text, word) in [
            (format!("{header}\n1,2,3,4,5\n"), "point 1"),
            (format!("{header}\n1,2,3,4,5,six\n"), "room_x"),
            (format!("{header}\n1,2,3,4,5,inf\n"), "finite"),
            ("x,y,z,u,v\n1,2,3,4,5\n".to_owned(), "room_x"),
        ] {
            let said = read(&text).unwrap_err();
            assert!(said.contains("picks.csv") && said.contains(word) && !said.contains('\n'), "{said}");
        }
        assert_eq!(read(&format!("{header}\n")), Ok(vec![]));
        assert!(read_points(&folder.path().join("none.csv")).is_err());
    }
}
