//! `plan.png`: the floor plan of the room with the trajectories of all people.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Point2;
use scenes::plan::{FloorPlan, PlanOptions};
use scenes::room::Room;
use shell::canvas::Color;

use crate::{PersonEstimate, Result, TrackId};

/// A track with a gap longer than this is drawn in parts, seconds.
const BREAK_S: f64 = 1.0;
/// Most positions kept. A live run may last for weeks; beyond this number the oldest tracks are dropped.
const MOST_PLACES: usize = 2_000_000;

/// Collects the trajectories of a run and draws them at its end.
#[derive(Debug, Clone)]
pub struct TrajectoryPlan {
    room: Room,
    room_dir: PathBuf,
    path: PathBuf,
    ways: BTreeMap<TrackId, Vec<(f64, Point2<f64>)>>,
    /// Number of positions in all trajectories together.
    places: usize,
}

impl TrajectoryPlan {
    /// Plan of a run in a room that was read from `room_dir`; it is written into the folder `out`.
    pub fn new(out: &Path, room: &Room, room_dir: &Path) -> Self {
        Self {
            room: room.clone(),
            room_dir: room_dir.to_owned(),
            path: out.join("plan.png"),
            ways: BTreeMap::new(),
            places: 0,
        }
    }

    /// Adds everybody's position at one time.
    pub fn extend(&mut self, time_s: f64, people: &[PersonEstimate]) {
        for person in people {
            let way = self.ways.entry(person.id).or_default();
            way.push((time_s, Point2::new(person.x_m, person.y_m)));
        }
        self.places += people.len();
        while self.places > MOST_PLACES
            && let Some((_, way)) = self.ways.pop_first()
        {
            self.places -= way.len();
        }
    }

    /// Draws the plan and writes it atomically.
    ///
    /// # Errors
    /// Geometry that cannot be drawn, or a file that cannot be written.
    pub fn finish(&self) -> Result<()> {
        let places = self.ways.values().flatten().map(|(_, place)| *place);
        let options = PlanOptions {
            places: beyond_the_room(&self.room, places),
            room_dir: Some(self.room_dir.clone()),
            ..PlanOptions::default()
        };
        let mut plan = FloorPlan::new(&self.room, &options)?;
        for (id, way) in &self.ways {
            let stretches: Vec<&[(f64, Point2<f64>)]> = way.chunk_by(|a, b| b.0 - a.0 <= BREAK_S).collect();
            for (index, stretch) in stretches.iter().enumerate() {
                let places: Vec<Point2<f64>> = stretch.iter().map(|(_, place)| *place).collect();
                let label = if index + 1 == stretches.len() { id.to_string() } else { String::new() };
                plan.trajectory(&places, Color::of_id(id.0), &label);
            }
        }
        Ok(calib::picture::write(&self.path, &plan.into_image())?)
    }
}

/// Positions that extend the plan: all of them in a room whose extent is unknown, none otherwise, so that a false track
/// far outside does not shrink the room's drawing.
pub fn beyond_the_room(room: &Room, places: impl Iterator<Item = Point2<f64>>) -> Vec<Point2<f64>> {
    let has_extent = room.geometry.is_some() || room.walkable.is_some() || !room.zones.is_empty();
    if has_extent { Vec::new() } else { places.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use scenes::polygon::Polygon;

    #[test]
    fn ways_lie_where_people_went_and_a_gap_stays_open() {
        let folder = tempfile::tempdir().unwrap();
        let floor = Polygon::rectangle(Point2::new(0.0, 0.0), Point2::new(6.0, 4.0));
        let room = Room { walkable: Some(vec![floor]), ..Room::default() };
        let mut plan = TrajectoryPlan::new(folder.path(), &room, folder.path());
        // Along y = 1 from x = 1 to 2, away for three seconds, then from 4 to 5.
        for i in 0..=10 {
            plan.extend(f64::from(i) * 0.1, &[PersonEstimate::standing(1, 1.0 + 0.1 * f64::from(i), 1.0)]);
        }
        for i in 0..=10 {
            plan.extend(
                4.0 + f64::from(i) * 0.1,
                &[PersonEstimate::standing(1, 4.0 + 0.1 * f64::from(i), 1.0)],
            );
        }
        plan.finish().unwrap();
        let picture = image::open(folder.path().join("plan.png")).unwrap().into_rgb8();
        let mapping = FloorPlan::new(&room, &PlanOptions::default()).unwrap().mapping();
        let color = Color::of_id(1);
        let is_drawn = |x: f64| {
            let p = mapping.pixel(&Point2::new(x, 1.0)) + Vector2::new(0.5, 0.5);
            let pixel = picture.get_pixel(p.x as u32, p.y as u32);
            pixel[0].abs_diff(color.r) < 40 && pixel[2].abs_diff(color.b) < 40
        };
        assert!(is_drawn(1.5) && is_drawn(4.5));
        assert!(!is_drawn(3.0), "nobody was seen to go there");
    }

    #[test]
    fn a_plan_of_an_endless_run_forgets_its_first_tracks() {
        let mut plan = TrajectoryPlan::new(Path::new("."), &Room::default(), Path::new("."));
        let long = MOST_PLACES / 4 - 1;
        for id in 1..=9 {
            for i in 0..long {
                plan.extend(i as f64, &[PersonEstimate::standing(id, 0.0, 0.0)]);
            }
        }
        let kept: Vec<(u32, usize)> = plan.ways.iter().map(|(id, way)| (id.0, way.len())).collect();
        assert_eq!(kept, [6, 7, 8, 9].map(|id| (id, long)));
    }

    #[test]
    fn a_room_without_extent_is_as_large_as_where_people_went() {
        let folder = tempfile::tempdir().unwrap();
        let mut plan = TrajectoryPlan::new(folder.path(), &Room::default(), folder.path());
        plan.extend(0.0, &[PersonEstimate::standing(1, 20.0, 0.0), PersonEstimate::standing(2, 40.0, 10.0)]);
        plan.finish().unwrap();
        let picture = image::open(folder.path().join("plan.png")).unwrap().into_rgb8();
        // 20 m by 10 m: lying, and person 2's colour is on it.
        assert!(picture.width() > picture.height());
        let color = Color::of_id(2);
        assert!(picture.pixels().any(|p| *p == image::Rgb::from(color)));
        let zone = Polygon::rectangle(Point2::new(0.0, 0.0), Point2::new(1.0, 1.0));
        let room = Room { walkable: Some(vec![zone]), ..Room::default() };
        assert!(beyond_the_room(&room, std::iter::once(Point2::new(99.0, 0.0))).is_empty());
    }
}
