//! The capture project `room.toml`: which captures make the room, the picked points that join them, the metres.
//!
//! Everything that can be known to be wrong before hours of film are read is found here, and named with its place.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use calib::Intrinsics;
use nalgebra::Point2;
use serde::Deserialize;

use crate::capture::ReferenceFrame;
use crate::{Error, Result};

/// Points a pair of cameras must share for Horn's closed form.
pub const LEAST_SHARED_POINTS: usize = 3;

/// A capture project, checked.
#[derive(Debug, Clone)]
pub struct Project {
    /// The file it was read from, for messages.
    pub path: PathBuf,
    /// In file order; the first one gives the room its origin.
    pub cameras: Vec<ProjectCamera>,
    /// Physical points picked in two or more reference images.
    pub points: Vec<PickedPoint>,
    /// What fixes the metres.
    pub scale: Scale,
}

/// One camera of the project.
#[derive(Debug, Clone)]
pub struct ProjectCamera {
    /// Unique; letters, digits, `-`, `_` and `.`: it becomes a file name.
    pub name: String,
    /// A folder of images or a video file, relative paths resolved against the project file's folder.
    pub capture: PathBuf,
    /// The frame at the installed pose.
    pub reference: ReferenceFrame,
    /// As calibrated, if it was.
    pub intrinsics: Option<Intrinsics>,
}

/// One physical point and its pixels in reference images.
#[derive(Debug, Clone, PartialEq)]
pub struct PickedPoint {
    /// Index into [`Project::cameras`] and the pixel, distorted as filmed.
    pub picks: Vec<(usize, Point2<f64>)>,
}

impl PickedPoint {
    /// The pixel in one camera.
    pub fn pixel(&self, camera: usize) -> Option<Point2<f64>> {
        self.picks.iter().find(|(c, _)| *c == camera).map(|(_, pixel)| *pixel)
    }
}

/// What fixes the metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// A known distance between what two pixels of one reference image show.
    Distance {
        /// Index of the camera.
        camera: usize,
        /// One end, pixels.
        from: Point2<f64>,
        /// The other end, pixels.
        to: Point2<f64>,
        /// Their distance.
        metres: f64,
    },
    /// A known height of a camera's centre above the floor.
    Height {
        /// Index of the camera.
        camera: usize,
        /// Metres above the floor.
        height_m: f64,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProjectFile {
    #[serde(default)]
    camera: Vec<CameraTable>,
    #[serde(default)]
    point: Vec<BTreeMap<String, [f64; 2]>>,
    scale: Option<ScaleTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraTable {
    name: String,
    capture: PathBuf,
    #[serde(default)]
    reference: ReferenceValue,
    intrinsics: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum ReferenceValue {
    Word(String),
    Number(i64),
}

impl Default for ReferenceValue {
    fn default() -> Self {
        Self::Word("last".into())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScaleTable {
    camera: String,
    from: Option<[f64; 2]>,
    to: Option<[f64; 2]>,
    metres: Option<f64>,
    height: Option<f64>,
}

impl Project {
    /// Reads and checks a project file and the intrinsics files it names. Captures are only looked for, not read.
    ///
    /// # Errors
    /// [`Error::Content`] naming the table and key at fault, or [`Error::Calib`] for a file that cannot be read or
    /// parsed.
    pub fn read(path: &Path) -> Result<Self> {
        let file: ProjectFile = calib::files::read_toml(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let wrong = |place: String, problem: String| Error::content(path, place, problem);
        if file.camera.is_empty() {
            return Err(wrong("[[camera]]".into(), "no camera; add a [[camera]] table for each".into()));
        }
        let mut cameras: Vec<ProjectCamera> = Vec::with_capacity(file.camera.len());
        for (i, table) in file.camera.into_iter().enumerate() {
            let camera = camera(path, folder, i + 1, table)?;
            if cameras.iter().any(|c| c.name == camera.name) {
                return Err(wrong(
                    format!("[[camera]] {}, name", i + 1),
                    format!("`{}` is already taken; names must differ", camera.name),
                ));
            }
            cameras.push(camera);
        }
        let points = file
            .point
            .iter()
            .enumerate()
            .map(|(i, table)| point(path, i + 1, table, &cameras))
            .collect::<Result<Vec<_>>>()?;
        let scale = file.scale.ok_or_else(|| {
            wrong("[scale]".into(), "missing; a known distance or camera height fixes the metres".into())
        })?;
        let scale = scale_of(path, &scale, &cameras)?;
        let project = Self { path: path.to_owned(), cameras, points, scale };
        project.check_connected()?;
        Ok(project)
    }

    /// The points seen by both cameras, as pairs of pixels.
    pub fn shared(&self, a: usize, b: usize) -> Vec<(Point2<f64>, Point2<f64>)> {
        self.points.iter().filter_map(|p| Some((p.pixel(a)?, p.pixel(b)?))).collect()
    }

    /// Checks every pixel against the image sizes, once the captures are read.
    ///
    /// # Errors
    /// [`Error::Content`] naming the first pixel that lies outside.
    pub fn check_pixels(&self, sizes: &[(u32, u32)]) -> Result<()> {
        let scale = match &self.scale {
            Scale::Distance { camera, from, to, .. } => {
                vec![("[scale], from".to_owned(), *camera, *from), ("[scale], to".to_owned(), *camera, *to)]
            }
            Scale::Height { .. } => Vec::new(),
        };
        let picks = self.points.iter().enumerate().flat_map(|(i, point)| {
            point.picks.iter().map(move |(camera, pixel)| {
                (format!("[[point]] {}, {}", i + 1, self.cameras[*camera].name), *camera, *pixel)
            })
        });
        for (place, camera, pixel) in scale.into_iter().chain(picks) {
            if let Some(size) = sizes.get(camera) {
                self.check_inside(&place, camera, &pixel, *size)?;
            }
        }
        Ok(())
    }

    fn check_inside(
        &self,
        place: &str,
        camera: usize,
        pixel: &Point2<f64>,
        (width, height): (u32, u32),
    ) -> Result<()> {
        let inside = (-0.5..=f64::from(width) - 0.5).contains(&pixel.x)
            && (-0.5..=f64::from(height) - 0.5).contains(&pixel.y);
        if inside {
            return Ok(());
        }
        let problem = format!(
            "[{}, {}] lies outside the {width} × {height} image of `{}`",
            pixel.x, pixel.y, self.cameras[camera].name
        );
        Err(Error::content(&self.path, place, problem))
    }

    /// Every camera must hang together with the first over pairs that share enough points, not on a line.
    fn check_connected(&self) -> Result<()> {
        let known: Vec<Option<(u32, u32)>> =
            self.cameras.iter().map(|c| c.intrinsics.as_ref().map(|k| (k.width, k.height))).collect();
        if let Some(sizes) = known.into_iter().collect::<Option<Vec<_>>>() {
            self.check_pixels(&sizes)?;
        }
        let mut joined = vec![false; self.cameras.len()];
        joined[0] = true;
        let mut line: Option<(usize, usize)> = None;
        loop {
            let mut grown = false;
            for b in 0..self.cameras.len() {
                for a in 0..self.cameras.len() {
                    let shared = self.shared(a, b);
                    if joined[b] || !joined[a] || shared.len() < LEAST_SHARED_POINTS {
                        continue;
                    }
                    let (in_a, in_b): (Vec<_>, Vec<_>) = shared.into_iter().unzip();
                    if on_a_line(&in_a) && on_a_line(&in_b) {
                        line = Some((a, b));
                        continue;
                    }
                    joined[b] = true;
                    grown = true;
                }
            }
            if !grown {
                break;
            }
        }
        let Some(alone) = joined.iter().position(|j| !j) else { return Ok(()) };
        if let Some((a, b)) = line {
            let problem = format!(
                "the points shared by `{}` and `{}` lie on a line, which leaves a turn about it open; pick some beside it",
                self.cameras[a].name, self.cameras[b].name
            );
            return Err(Error::content(&self.path, "[[point]]", problem));
        }
        let most = (0..self.cameras.len())
            .filter(|a| joined[*a])
            .map(|a| (self.shared(a, alone).len(), a))
            .max_by_key(|(count, a)| (*count, usize::MAX - a));
        let (count, other) = most.unwrap_or((0, 0));
        let problem = format!(
            "`{}` and `{}` share {count} points; at least {LEAST_SHARED_POINTS} a pair are needed to join `{}` to the others",
            self.cameras[other].name, self.cameras[alone].name, self.cameras[alone].name
        );
        Err(Error::content(&self.path, "[[point]]", problem))
    }
}

fn camera(path: &Path, folder: &Path, number: usize, table: CameraTable) -> Result<ProjectCamera> {
    let place = |key: &str| format!("[[camera]] {number}, {key}");
    let fits = |c: char| c.is_alphanumeric() || ['-', '_', '.', ' '].contains(&c);
    if table.name.trim().is_empty() || !table.name.chars().all(fits) || table.name.starts_with('.') {
        let problem = format!("`{}` cannot become a file name; use letters, digits, `-`, `_`", table.name);
        return Err(Error::content(path, place("name"), problem));
    }
    let capture = folder.join(&table.capture);
    if !capture.exists() && !capture.to_string_lossy().contains('%') {
        let problem = format!("`{}` is neither a folder of images nor a video file", capture.display());
        return Err(Error::content(path, place("capture"), problem));
    }
    let text = match table.reference {
        ReferenceValue::Word(word) => word,
        ReferenceValue::Number(number) => number.to_string(),
    };
    let reference: ReferenceFrame = text.parse().map_err(|_| {
        let problem = format!("`{text}` is none of \"first\", \"last\" or a frame counted from 1");
        Error::content(path, place("reference"), problem)
    })?;
    let intrinsics =
        table.intrinsics.map(|file| calib::files::read_intrinsics(&folder.join(file))).transpose()?;
    Ok(ProjectCamera { name: table.name, capture, reference, intrinsics })
}

fn point(
    path: &Path,
    number: usize,
    table: &BTreeMap<String, [f64; 2]>,
    cameras: &[ProjectCamera],
) -> Result<PickedPoint> {
    let mut picks = Vec::with_capacity(table.len());
    for (name, pixel) in table {
        let place = format!("[[point]] {number}, {name}");
        let camera = camera_called(path, &place, name, cameras)?;
        picks.push((camera, finite(path, &place, *pixel)?));
    }
    if picks.len() < 2 {
        let problem = "a point must be picked in two or more cameras to join them";
        return Err(Error::content(path, format!("[[point]] {number}"), problem));
    }
    picks.sort_by_key(|(camera, _)| *camera);
    Ok(PickedPoint { picks })
}

fn scale_of(path: &Path, table: &ScaleTable, cameras: &[ProjectCamera]) -> Result<Scale> {
    let camera = camera_called(path, "[scale], camera", &table.camera, cameras)?;
    let positive = |key: &str, value: f64| {
        if value.is_finite() && value > 0.0 {
            return Ok(value);
        }
        Err(Error::content(
            path,
            format!("[scale], {key}"),
            format!("{value} is not a positive number of metres"),
        ))
    };
    match (table.from, table.to, table.metres, table.height) {
        (Some(from), Some(to), Some(metres), None) => {
            let from = finite(path, "[scale], from", from)?;
            let to = finite(path, "[scale], to", to)?;
            if (from - to).norm() < 1.0 {
                let problem = "`from` and `to` are the same pixel: the distance has no length";
                return Err(Error::content(path, "[scale]", problem));
            }
            Ok(Scale::Distance { camera, from, to, metres: positive("metres", metres)? })
        }
        (None, None, None, Some(height)) => {
            Ok(Scale::Height { camera, height_m: positive("height", height)? })
        }
        _ => Err(Error::content(
            path,
            "[scale]",
            "give either `from`, `to` and `metres`, or `height` (of the camera above the floor)",
        )),
    }
}

fn camera_called(path: &Path, place: &str, name: &str, cameras: &[ProjectCamera]) -> Result<usize> {
    cameras.iter().position(|c| c.name == name).ok_or_else(|| {
        let known = cameras.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", ");
        Error::content(path, place, format!("no camera is called `{name}`; there are {known}"))
    })
}

fn finite(path: &Path, place: &str, [x, y]: [f64; 2]) -> Result<Point2<f64>> {
    if x.is_finite() && y.is_finite() {
        return Ok(Point2::new(x, y));
    }
    Err(Error::content(path, place, format!("[{x}, {y}] is not a pixel")))
}

/// Whether pixels lie on a line to within half a pixel: the smaller principal spread.
fn on_a_line(pixels: &[Point2<f64>]) -> bool {
    let n = pixels.len() as f64;
    let mean = pixels.iter().map(|p| p.coords).sum::<nalgebra::Vector2<f64>>() / n;
    let scatter: nalgebra::Matrix2<f64> =
        pixels.iter().map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum();
    let smallest = scatter.symmetric_eigenvalues().min();
    (smallest.max(0.0) / n).sqrt() < 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERAS: &str = r#"
[[camera]]
name = "a"
capture = "frames"
intrinsics = "lens.toml"
[[camera]]
name = "b"
capture = "frames"
reference = 3
intrinsics = "lens.toml"
"#;
    const POINTS: &str = "
[[point]]\na = [10, 20]\nb = [30.5, 40]
[[point]]\na = [100, 20]\nb = [30, 140]
[[point]]\na = [110, 200]\nb = [130, 40]
";
    const SCALE: &str = "[scale]\ncamera = \"b\"\nfrom = [1, 2]\nto = [30, 4]\nmetres = 1.5\n";

    fn read(text: &str) -> std::result::Result<Project, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("frames")).unwrap();
        let lens = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        calib::files::write_intrinsics(&folder.path().join("lens.toml"), &lens).unwrap();
        let path = folder.path().join("room.toml");
        std::fs::write(&path, text).unwrap();
        let result = Project::read(&path).map_err(|e| e.to_string());
        if let Err(line) = &result {
            assert!(line.contains("room.toml") || line.contains("lens.toml"), "names no file: {line}");
            assert_eq!(line.lines().count(), 1, "{line}");
        }
        result
    }

    /// The message for a project that is right but for `from` → `to`.
    fn refusal(from: &str, to: &str) -> String {
        let text = format!("{CAMERAS}{POINTS}{SCALE}");
        assert!(text.contains(from), "{from}");
        read(&text.replacen(from, to, 1)).unwrap_err()
    }

    #[test]
    fn a_whole_project_is_read() {
        let project = read(&format!("{CAMERAS}{POINTS}{SCALE}")).unwrap();
        assert_eq!(project.cameras.len(), 2);
        assert_eq!(project.cameras[0].reference, ReferenceFrame::Last);
        assert_eq!(project.cameras[1].reference, ReferenceFrame::Number(3));
        assert_eq!(project.shared(0, 1)[1], (Point2::new(100.0, 20.0), Point2::new(30.0, 140.0)));
        let Scale::Distance { camera, metres, .. } = project.scale else { panic!("{:?}", project.scale) };
        assert_eq!((camera, metres), (1, 1.5));
        let height = read(&format!("{CAMERAS}{POINTS}[scale]\ncamera = \"a\"\nheight = 2.4\n")).unwrap();
        assert_eq!(height.scale, Scale::Height { camera: 0, height_m: 2.4 });
    }

    #[test]
    fn one_camera_needs_no_points() {
        let one = CAMERAS.split("[[camera]]\nname = \"b\"").next().unwrap();
        assert!(read(&format!("{one}[scale]\ncamera = \"a\"\nheight = 2\n")).is_ok());
    }

    #[test]
    fn a_missing_or_empty_file_is_named() {
        let gone = Project::read(Path::new("/nowhere/room.toml")).unwrap_err().to_string();
        assert!(gone.contains("/nowhere/room.toml"), "{gone}");
        assert!(read("").unwrap_err().contains("[[camera]]"));
        assert!(read("[[camera]\n").unwrap_err().contains("line 1"));
    }

    #[test]
    fn unknown_keys_and_cameras_are_named() {
        assert!(refusal("capture =", "captrue =").contains("captrue"));
        let line = refusal("a = [10, 20]", "c = [10, 20]");
        assert!(line.contains("[[point]] 1, c") && line.contains("`a`, `b`"), "{line}");
        assert!(refusal("camera = \"b\"", "camera = \"x\"").contains("[scale], camera"));
    }

    #[test]
    fn a_missing_capture_or_lens_is_named() {
        assert!(refusal("capture = \"frames\"", "capture = \"film.mp4\"").contains("[[camera]] 1, capture"));
        assert!(refusal("\"lens.toml\"", "\"other/lens.toml\"").contains("other/lens.toml"));
    }

    #[test]
    fn names_must_differ_and_make_file_names() {
        assert!(refusal("name = \"b\"", "name = \"a\"").contains("already taken"));
        for bad in ["", "../a", "a/b", ".", " "] {
            assert!(
                refusal("name = \"a\"", &format!("name = \"{bad}\"")).contains("[[camera]] 1, name"),
                "{bad}"
            );
        }
    }

    #[test]
    fn references_are_first_last_or_a_frame() {
        for bad in ["\"middle\"", "0", "-2"] {
            assert!(
                refusal("reference = 3", &format!("reference = {bad}")).contains("[[camera]] 2, reference")
            );
        }
    }

    #[test]
    fn pixels_must_be_numbers_inside_the_image() {
        for bad in ["[nan, 20]", "[10, inf]"] {
            assert!(refusal("a = [10, 20]", &format!("a = {bad}")).contains("[[point]] 1, a"), "{bad}");
        }
        let line = refusal("b = [30, 140]", "b = [30, 240]");
        assert!(line.contains("[[point]] 2, b") && line.contains("320 × 240"), "{line}");
        assert!(refusal("to = [30, 4]", "to = [330, 4]").contains("[scale], to"));
    }

    #[test]
    fn too_few_points_or_points_on_a_line_join_nothing() {
        let third = POINTS.rfind("[[point]]").unwrap();
        let line = read(&format!("{CAMERAS}{}{SCALE}", &POINTS[..third])).unwrap_err();
        assert!(line.contains("`a` and `b` share 2 points"), "{line}");
        let alone = refusal("a = [10, 20]\n", "");
        assert!(alone.contains("[[point]] 1") && alone.contains("two or more"), "{alone}");
        let line = "[[point]]\na = [10, 10]\nb = [5, 5]\n[[point]]\na = [20, 20]\nb = [5, 15]\n[[point]]\na = [90, 90]\nb = [5, 100]\n";
        assert!(read(&format!("{CAMERAS}{line}{SCALE}")).unwrap_err().contains("on a line"));
    }

    #[test]
    fn a_scale_needs_a_length() {
        assert!(refusal("to = [30, 4]", "to = [1, 2]").contains("no length"));
        for bad in ["0", "-1.0", "nan", "inf"] {
            assert!(refusal("metres = 1.5", &format!("metres = {bad}")).contains("[scale], metres"), "{bad}");
        }
        assert!(refusal("metres = 1.5", "").contains("either"));
        assert!(read(&format!("{CAMERAS}{POINTS}")).unwrap_err().contains("[scale]"));
    }
}
