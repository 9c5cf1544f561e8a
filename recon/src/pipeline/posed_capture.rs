//! Motion of a capture in the room that was built from it, kept beside the room's other results for [`super::export()`], and
//! its part of a COLMAP model: pinhole frames without distortion and rolling shutter, their poses, and the sparse points.

use std::path::Path;

use calib::Intrinsics;
use calib::undistort::UndistortMap;
use nalgebra::{Isometry3, Point2, Point3, Similarity3};
use scenes::exchange::colmap::{SparseModel, SparsePicture, SparsePoint};
use serde::{Deserialize, Serialize};

use super::camera::CameraMotion;
use super::output::write_jpeg;
use crate::Result;
use crate::capture::{Capture, CaptureFile};
use crate::rolling_shutter::RollingShutter;
use crate::working_size::WorkingSize;

/// Least number of pictures that show a point.
const LEAST_SIGHTINGS: usize = 2;

/// Motion of a capture and its place in the room.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct PosedCapture {
    /// Intrinsics as filmed, at the working size.
    lens: Intrinsics,
    /// Pose of each frame.
    camera_from_world: Vec<Option<Isometry3<f64>>>,
    /// Sparse points.
    points: Vec<Point3<f64>>,
    /// Frame and rectified pixel of each point's observations.
    observations: Vec<Vec<(usize, Point2<f64>)>>,
    /// Readout time, as a share of the time between two frames; 0 for a global shutter.
    readout: f64,
    /// Room from the frame and unit of `camera_from_world`.
    room_from_world: Similarity3<f64>,
}

impl PosedCapture {
    pub(super) fn new(motion: CameraMotion, room_from_world: &Similarity3<f64>) -> Self {
        let readout = motion.report.readout;
        let CameraMotion { lens, camera_from_world, points, observations, .. } = motion;
        Self { lens, camera_from_world, points, observations, readout, room_from_world: *room_from_world }
    }

    /// Pose of a frame in the room: the capture's unit becomes the metre.
    fn camera_from_room(&self, frame: usize) -> Option<Isometry3<f64>> {
        let camera_from_world = self.camera_from_world[frame]?;
        // A camera's own frame is measured in metres, too: X_camera = s P (S⁻¹ X_room) is rigid.
        let scale = self.room_from_world.scaling();
        let world_from_room = self.room_from_world.isometry.inverse();
        let mut camera_from_world_m = camera_from_world;
        camera_from_world_m.translation.vector *= scale;
        Some(camera_from_world_m * world_from_room)
    }

    /// The same, with lens and observations in pixels of the filmed size.
    pub(super) fn in_filmed_pixels(self, size: WorkingSize) -> Self {
        let filmed = |(frame, pixel): (usize, Point2<f64>)| (frame, size.filmed_pixel(&pixel));
        let observations = self.observations.into_iter().map(|of| of.into_iter().map(filmed).collect());
        Self { lens: size.filmed_lens(&self.lens), observations: observations.collect(), ..self }
    }

    /// Whether it is of a capture of so many frames, and whole.
    pub(super) fn is_of(&self, frames: usize) -> bool {
        self.camera_from_world.len() == frames
            && self.points.len() == self.observations.len()
            && self.observations.iter().flatten().all(|(frame, _)| *frame < frames)
    }

    /// Rolling-shutter model of the capture; `None` for a global shutter.
    fn shutter(&self) -> Option<RollingShutter> {
        (self.readout != 0.0)
            .then(|| RollingShutter::new(self.readout, &self.camera_from_world, self.lens.height))
    }

    /// Name of a frame's picture in the model.
    fn name(capture: &Capture, frame: usize) -> String {
        format!("{}/{:05}.jpg", capture.name, capture.sampled.number(frame))
    }

    /// Adds the frames that have a pose, and the points, to a model. `capture` has the frames as they were filmed, from which
    /// the points take their colours.
    pub(super) fn add_to(&self, model: &mut SparseModel, capture: &Capture, size: WorkingSize) {
        let (lens, pinhole) = (model.lenses.len(), self.lens.pinhole());
        let shutter = self.shutter();
        let mut sightings = vec![Vec::new(); capture.frames.len()];
        for (place, observations) in self.points.iter().zip(&self.observations) {
            let seen: Vec<(usize, Point2<f64>, f64)> = observations
                .iter()
                .filter_map(|(frame, pixel)| {
                    let seen = pinhole.project(&self.lens.unproject(pixel)?.into())?;
                    let expected = pinhole.project(&(self.camera_from_world[*frame]? * place))?;
                    pinhole.contains(&seen).then_some((*frame, seen, (expected - seen).norm()))
                })
                .collect();
            let Some((frame, pixel)) = observations.first().filter(|_| seen.len() >= LEAST_SIGHTINGS) else {
                continue;
            };
            let filmed = shutter.as_ref().and_then(|shutter| shutter.filmed(&self.lens, *frame, pixel));
            let at = size.worked_pixel(&filmed.unwrap_or(*pixel));
            let color = capture.frames[*frame].get_pixel_checked(at.x.round() as u32, at.y.round() as u32);
            let error_px = seen.iter().map(|(_, _, error)| error).sum::<f64>() / seen.len() as f64;
            for (frame, pixel, _) in &seen {
                sightings[*frame].push((model.points.len(), *pixel));
            }
            model.points.push(SparsePoint {
                place: self.room_from_world * place,
                color: color.map_or([0; 3], |color| color.0),
                error_px,
            });
        }
        for (frame, sightings) in sightings.into_iter().enumerate() {
            let Some(camera_from_world) = self.camera_from_room(frame) else { continue };
            let name = Self::name(capture, frame);
            model.pictures.push(SparsePicture { name, lens, camera_from_world, sightings });
        }
        model.lenses.push(pinhole);
    }

    /// Writes the pictures of the frames that have a pose, straightened at the filmed size.
    pub(super) fn write_pictures(&self, file: &CaptureFile, capture: &Capture, folder: &Path) -> Result<()> {
        let (straight, shutter) = (UndistortMap::to(&self.lens, &self.lens.pinhole()), self.shutter());
        let mut index = 0;
        file.each_frame(file.size().filmed, &mut |picture| {
            let frame = index;
            index += 1;
            if self.camera_from_world.get(frame).is_none_or(Option::is_none) {
                return Ok(());
            }
            let at_once = shutter.as_ref().map(|shutter| shutter.frame(&self.lens, frame, &picture));
            let picture = straight.image(at_once.as_ref().unwrap_or(&picture));
            write_jpeg(&folder.join(Self::name(capture, frame)), &picture)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Sampled;
    use image::{Rgb, RgbImage};
    use nalgebra::{UnitQuaternion, Vector3};
    use scenes::exchange::{ModelOptions, colmap};

    /// A capture of four frames, the second without a pose, and five points that all of them show.
    fn posed() -> (Capture, PosedCapture) {
        let mut lens = Intrinsics::from_horizontal_fov(160, 120, 75.0);
        lens.distortion = [-0.3, 0.1, 0.0, 0.0, 0.0].into();
        let pose = |x: f64| Isometry3::new(Vector3::new(x, 0.02, -0.01), Vector3::new(0.03, -0.1 * x, 0.02));
        let camera_from_world = vec![Some(Isometry3::identity()), None, Some(pose(-0.2)), Some(pose(0.3))];
        let points: Vec<Point3<f64>> =
            [[0.0, 0.0, 3.0], [-1.0, 0.4, 2.5], [1.1, -0.6, 4.0], [0.5, 0.7, 2.0], [-0.6, -0.5, 3.5]]
                .map(Point3::from)
                .to_vec();
        let seen = |point: &Point3<f64>| {
            let of_frame = |frame: usize| Some((frame, lens.project(&(camera_from_world[frame]? * point))?));
            (0..4).filter_map(of_frame).collect::<Vec<_>>()
        };
        let observations: Vec<_> = points.iter().map(seen).collect();
        let room_from_world = Similarity3::from_parts(
            Vector3::new(4.0, -1.0, 2.2).into(),
            UnitQuaternion::from_scaled_axis(Vector3::new(-1.9, 0.2, 0.1)),
            1.7,
        );
        let capture = Capture {
            name: "door".into(),
            frames: vec![RgbImage::from_pixel(160, 120, Rgb([200, 90, 40])); 4],
            sampled: Sampled { first: 1, stride: 3 },
            reference: 0,
            intrinsics: None,
            exif_focal_px: None,
            larger: None,
        };
        let posed =
            PosedCapture { lens, camera_from_world, points, observations, readout: 0.0, room_from_world };
        (capture, posed)
    }

    #[test]
    fn an_exported_capture_projects_its_points_where_its_frames_saw_them() {
        let (folder, (capture, posed)) = (tempfile::tempdir().unwrap(), posed());
        let mut model = SparseModel::default();
        posed.add_to(&mut model, &capture, WorkingSize::of((160, 120)));
        model.write(folder.path()).unwrap();
        let twin = posed.lens.pinhole();
        let names = ["door/00002.jpg", "door/00008.jpg", "door/00011.jpg"];

        // Read back by the importer: the cameras see the points, moved to the room, at the straightened pixels.
        let found = colmap::read(folder.path(), &ModelOptions::default()).unwrap().cameras;
        assert_eq!(found.iter().map(|camera| camera.picture.as_str()).collect::<Vec<_>>(), names);
        for (camera, frame) in found.iter().zip([0, 2, 3]) {
            for (point, seen) in posed.points.iter().zip(&posed.observations) {
                let (_, filmed) = seen.iter().find(|(at, _)| *at == frame).unwrap();
                let expected = twin.project(&posed.lens.unproject(filmed).unwrap().into()).unwrap();
                let projected = camera.entry.camera.project(&(posed.room_from_world * point)).unwrap();
                assert!((projected - expected).norm() < 1e-6, "{projected} {expected}");
            }
        }
        let Some(scenes::geometry::Geometry::Discs(discs)) =
            colmap::geometry(folder.path(), &scenes::geometry::scan::Placing::default()).unwrap()
        else {
            panic!("no points")
        };
        assert_eq!(discs.len(), posed.points.len());
        for (disc, point) in discs.iter().zip(&posed.points) {
            let expected = posed.room_from_world * point;
            let off = scenes::geometry::point_from_vec3(disc.center) - expected;
            assert!(off.norm() < 1e-5 && disc.color == [200, 90, 40], "{disc:?} {expected}");
        }
        // A metre is a metre for the cameras, too.
        let [first, .., last] = &found[..] else { unreachable!() };
        let moved = (last.entry.camera.center() - first.entry.camera.center()).norm();
        let filmed = posed.camera_from_world[3].unwrap().inverse() * Point3::origin();
        assert!((moved - 1.7 * filmed.coords.norm()).abs() < 1e-9, "{moved}");
    }

    #[test]
    fn pictures_of_frames_with_a_pose_are_straight_and_of_the_filmed_size() {
        let (folder, (_, posed)) = (tempfile::tempdir().unwrap(), posed());
        let film = folder.path().join("film");
        std::fs::create_dir(&film).unwrap();
        // White right of a line that is straight in the world.
        let white = |x: u32, y: u32| {
            let ray = posed.lens.unproject(&Point2::new(f64::from(x), f64::from(y))).unwrap();
            if ray.x > 0.55 { 255 } else { 0 }
        };
        for number in 0..4 {
            let picture = RgbImage::from_fn(160, 120, |x, y| Rgb([white(x, y); 3]));
            picture.save(film.join(format!("{number}.png"))).unwrap();
        }
        let file = CaptureFile::open("door", &film, "first".parse().unwrap(), None).unwrap();
        posed.write_pictures(&file, &file.read().unwrap(), folder.path()).unwrap();
        let twin = posed.lens.pinhole();
        let edge = twin.project(&Point3::new(0.55, 0.0, 1.0)).unwrap().x;
        for (number, is_there) in [(1, true), (2, false), (3, true), (4, true)] {
            let path = folder.path().join(format!("door/{number:05}.jpg"));
            assert_eq!(path.exists(), is_there, "{number}");
            if is_there {
                let picture = calib::picture::read(&path).unwrap().into_rgb8();
                assert_eq!(picture.dimensions(), (twin.width, twin.height));
                for y in [twin.height / 8, twin.height / 2, 7 * twin.height / 8] {
                    let first = (0..twin.width).find(|x| picture.get_pixel(*x, y)[0] > 127).unwrap();
                    assert!((f64::from(first) - edge).abs() < 2.0, "{first} {edge}");
                }
            }
        }
    }
}
