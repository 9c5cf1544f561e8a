//! Track files that a run writes as it goes.

use std::fmt::Write;
use std::path::Path;

use mot::jsonl::{FrameLine, rounded};
use shell::files::FileError;

use super::Persistence;
use super::frame_line;
use super::line_file::LineFile;
use crate::events::Clock;
use crate::foreground::Verdict;
use crate::prepared_room::PreparedRoom;
use crate::silhouette::{Body, contour};
use crate::{Error, PersonEstimate, Result};

/// Writers of `tracks.txt`, `tracks.jsonl` and `boxes/NAME.txt` of a run.
///
/// Every frame's lines are passed to the operating system at once, under the files' final names, so a reader during the
/// run or after a crash of the program sees whole lines. Unless they are [`Persistence::lasting`], nothing is synchronised
/// to the disk: after a power failure the last lines may be missing or torn. No file is created before the first frame.
#[derive(Debug)]
pub struct TrackFiles {
    floor: LineFile,
    json: LineFile,
    boxes: Vec<(calib::Camera, LineFile)>,
    names: Vec<String>,
    clock: Option<Clock>,
    /// Whether a file could not be written.
    has_failed: bool,
}

impl TrackFiles {
    /// Files of a run in the folder `out`.
    pub fn new(out: &Path, prepared: &PreparedRoom) -> Self {
        let boxes = |name: &str| LineFile::new(out.join("boxes").join(format!("{name}.txt")));
        Self {
            floor: LineFile::new(out.join("tracks.txt")),
            json: LineFile::new(out.join("tracks.jsonl")),
            boxes: prepared.cameras.iter().map(|c| (c.filmed.clone(), boxes(&c.name))).collect(),
            names: prepared.cameras.iter().map(|c| c.name.clone()).collect(),
            clock: None,
            has_failed: false,
        }
    }

    /// The same files, with the time of day in the lines of `tracks.jsonl`.
    #[must_use]
    pub fn with_clock(self, clock: Option<Clock>) -> Self {
        Self { clock, ..self }
    }

    /// The same files, kept in this way.
    #[must_use]
    pub fn kept(self, persistence: &Persistence) -> Self {
        let boxes = self.boxes.into_iter().map(|(camera, file)| (camera, file.kept(persistence))).collect();
        Self { floor: self.floor.kept(persistence), json: self.json.kept(persistence), boxes, ..self }
    }

    /// Goes on in another folder.
    pub fn move_to(&mut self, out: &Path) {
        self.floor.move_to(out.join("tracks.txt"));
        self.json.move_to(out.join("tracks.jsonl"));
        for ((_, file), name) in self.boxes.iter_mut().zip(&self.names) {
            file.move_to(out.join("boxes").join(format!("{name}.txt")));
        }
    }

    /// Appends one frame. `set_aside` are the indices of the cameras without usable pictures, in the room's order, with
    /// the reason.
    ///
    /// # Errors
    /// [`Error::File`] with the file, or an estimate that is not finite.
    pub fn write(
        &mut self,
        frame: u32,
        time_s: f64,
        people: &[PersonEstimate],
        set_aside: &[(usize, Verdict)],
    ) -> Result<()> {
        let line = frame_line(frame, time_s, people, &self.names, set_aside, self.clock.as_ref());
        let written = self.write_line(&line, people);
        self.has_failed |= matches!(written, Err(Error::File(FileError::Io { .. })));
        written
    }

    /// Appends a line, and the rows of its people, to the files.
    fn write_line(&mut self, line: &FrameLine, people: &[PersonEstimate]) -> Result<()> {
        let frame = line.frame;
        let heights = people.iter().map(|p| p.z_m.is_finite());
        if let Some((odd, _)) =
            line.people.iter().zip(heights).find(|(p, is_finite)| !is_finite || !p.is_finite())
        {
            return Err(Error::content(
                self.json.path(),
                format!("frame {frame}"),
                format!("person {} was given a number that is not finite", odd.id),
            ));
        }
        // This file gets a line in each frame: a full disk shows here, before the others of an earlier run are replaced.
        let json = line.text(self.json.path())?;
        self.json.append(&json)?;
        let mut floor = String::new();
        for (person, estimate) in line.people.iter().zip(people) {
            let (x, y) = (person.x, person.y);
            // Methods that track the standing point have z = 0.
            let z = if estimate.z_m == 0.0 { "0".into() } else { format!("{:.4}", rounded(estimate.z_m)) };
            // Writing to a string cannot fail.
            let _ = writeln!(
                floor,
                "{frame},{},-1,-1,-1,-1,{:.3},{x:.4},{y:.4},{z}",
                person.id, person.confidence
            );
        }
        self.floor.append(&floor)?;
        for (camera, file) in &mut self.boxes {
            let mut rows = String::new();
            for person in people {
                let Some(found) = contour::bounding_box(&Body::from(person), camera) else { continue };
                let [left, top, width, height] =
                    [found.left, found.top, found.width, found.height].map(rounded);
                let _ = writeln!(
                    rows,
                    "{frame},{},{left:.2},{top:.2},{width:.2},{height:.2},{:.3},-1,-1,-1",
                    person.id,
                    rounded(person.confidence)
                );
            }
            file.append(&rows)?;
        }
        Ok(())
    }

    /// Creates files that are still missing, as after a run without people; not after a failure, such as a full disk, since
    /// older ones may stand there.
    ///
    /// # Errors
    /// [`Error::File`] with the file.
    pub fn finish(mut self) -> Result<()> {
        if self.has_failed {
            return Ok(());
        }
        let boxes = self.boxes.iter_mut().map(|(_, file)| file);
        [&mut self.floor, &mut self.json].into_iter().chain(boxes).try_for_each(|file| file.append(""))
    }
}

#[cfg(test)]
mod tests {
    use super::super::person_line;
    use super::*;
    use crate::prepared_room::PreparationOptions;
    use calib::{Camera, Intrinsics};
    use mot::{jsonl, rows::RowFile};
    use nalgebra::{Isometry3, Point3, Vector3};
    use scenes::room::{Room, RoomCamera};

    fn prepared() -> PreparedRoom {
        let camera = |name: &str, eye: [f64; 3]| RoomCamera {
            name: name.into(),
            camera: Camera {
                intrinsics: Intrinsics::from_horizontal_fov(320, 240, 70.0),
                camera_from_world: Isometry3::face_towards(
                    &Point3::from(eye),
                    &Point3::new(2.0, 2.0, 0.8),
                    &-Vector3::z(),
                )
                .inverse(),
            },
            reference: None,
        };
        let room = Room {
            cameras: vec![camera("left", [0.0, 0.0, 2.0]), camera("right", [-3.0, 2.0, 2.0])],
            ..Room::default()
        };
        PreparedRoom::prepare(&room, Path::new("."), &PreparationOptions::default()).unwrap()
    }

    fn person(id: u32, x_m: f64, y_m: f64) -> PersonEstimate {
        PersonEstimate {
            vx: -1e-9,
            vy: 0.5,
            sigma_m: [0.03, 0.02],
            confidence: 0.97,
            visible: vec![0.5, 1.0],
            ..PersonEstimate::standing(id, x_m, y_m)
        }
    }

    #[test]
    fn written_files_are_read_back() {
        let (folder, prepared) = (tempfile::tempdir().unwrap(), prepared());
        let mut files = TrackFiles::new(folder.path(), &prepared);
        assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "touched before the first frame");
        // Person 2 is behind the camera `left`.
        files.write(1, 0.0, &[], &[]).unwrap();
        files
            .write(2, 1.0 / 12.0, &[person(1, 2.0, 1.5), person(2, -1.5, 1.5)], &[(1, Verdict::Dark)])
            .unwrap();

        // The files are whole and readable before the end.
        let floor = RowFile::read(&folder.path().join("tracks.txt")).unwrap();
        assert!(floor.is_on_floor() && !floor.has_boxes());
        assert_eq!((floor.rows.len(), floor.rows[1].id, floor.rows[1].frame), (2, Some(2), 2));
        let left = RowFile::read(&folder.path().join("boxes/left.txt")).unwrap();
        let right = RowFile::read(&folder.path().join("boxes/right.txt")).unwrap();
        assert_eq!((left.rows.len(), right.rows.len()), (1, 2));
        assert!(left.has_boxes() && !left.is_on_floor());
        let lines = jsonl::read(&folder.path().join("tracks.jsonl")).unwrap();
        assert_eq!((lines.len(), lines[0].people.len(), lines[1].time), (2, 0, 0.083_333));
        assert_eq!(lines[1].people[1], person_line(&person(2, -1.5, 1.5), &["left".into(), "right".into()]));
        assert!(lines[0].set_aside.is_empty() && lines[1].set_aside == ["right"]);
        assert_eq!(lines[1].states, [Some(crate::events::CameraState::Dark)]);
        let text = std::fs::read_to_string(folder.path().join("tracks.jsonl")).unwrap();
        assert_eq!(
            text.matches("set_aside").count(),
            1,
            "written only where there is something to say: {text}"
        );
        assert!(!text.contains("-0.0,"), "a negative zero: {text}");
        files.finish().unwrap();
    }

    #[test]
    fn a_run_without_frames_leaves_empty_files_and_nan_is_refused() {
        let (folder, prepared) = (tempfile::tempdir().unwrap(), prepared());
        let mut files = TrackFiles::new(folder.path(), &prepared);
        let error = files.write(3, 0.0, &[person(7, f64::NAN, 0.0)], &[]).unwrap_err().to_string();
        assert!(error.contains("frame 3") && error.contains("person 7"), "{error}");
        files.finish().unwrap();
        for name in ["tracks.txt", "tracks.jsonl", "boxes/left.txt", "boxes/right.txt"] {
            assert_eq!(std::fs::read(folder.path().join(name)).unwrap(), b"", "{name}");
        }
    }

    #[test]
    fn a_full_disk_leaves_the_files_of_an_earlier_run_alone() {
        if !Path::new("/dev/full").exists() {
            return;
        }
        let (folder, prepared) = (tempfile::tempdir().unwrap(), prepared());
        let earlier = folder.path().join("tracks.txt");
        std::fs::write(&earlier, "earlier\n").unwrap();
        // A device that is always full has the name of the file with a line in each frame.
        std::os::unix::fs::symlink("/dev/full", folder.path().join("tracks.jsonl")).unwrap();
        let mut files = TrackFiles::new(folder.path(), &prepared);
        assert!(files.write(1, 0.0, &[], &[]).unwrap_err().to_string().contains("tracks.jsonl"));
        files.finish().unwrap();
        assert_eq!(std::fs::read(&earlier).unwrap(), b"earlier\n");
        assert!(!folder.path().join("boxes").exists());
    }

    #[test]
    fn a_line_that_is_still_being_written_is_no_error_but_a_broken_one_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tracks.jsonl");
        let good = r#"{"frame":1,"time":0.0,"people":[]}"#;
        std::fs::write(&path, format!("{good}\n{{\"frame\":2,\"ti")).unwrap();
        assert_eq!(jsonl::read(&path).unwrap().len(), 1);
        for (bad, word) in [("{\"frame\":2}", "time"), ("nonsense", "no frame"), (good, "later")] {
            std::fs::write(&path, format!("{good}\n{bad}\n")).unwrap();
            let error = jsonl::read(&path).unwrap_err().to_string();
            assert!(error.contains("line 2") && error.contains(word), "{error}");
        }
    }
}
