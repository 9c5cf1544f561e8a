//! Files: replaced in one step, read as text or TOML, and those of `calib intrinsics` and `calib pose`.

use std::io::Write;
use std::path::Path;

use nalgebra::Matrix3;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use shell::files::StagedFile;

use crate::exact_length::ExactLength;
use crate::{Camera, Distortion, Error, Intrinsics, LensModel, Result};

/// Writes a file in one step, as [`StagedFile`] does: a reader, a full disk and a loss of power see the old content or
/// the new one, never a part.
///
/// # Errors
/// [`Error::File`] naming `path`; a file that stood there before is then untouched.
pub fn write_atomic(path: &Path, content: &[u8]) -> Result<()> {
    write_together(&[(path, content)])
}

/// Writes files that belong together: all are staged beside their places before the first takes its name, so a full
/// disk or a refused folder leaves every one of them as it was. They take their names in the given order.
///
/// # Errors
/// [`Error::File`] naming the file that could not be written; [`Error::File`] where a folder stands in its place.
pub fn write_together(files: &[(&Path, &[u8])]) -> Result<()> {
    let mut staged = Vec::with_capacity(files.len());
    for &(path, content) in files {
        let io = Error::io(path);
        if path.is_dir() {
            return Err(Error::content(path, "output", "is a folder; name a file in it"));
        }
        let mut file = StagedFile::create(path).map_err(io)?;
        file.write_all(content).map_err(io)?;
        staged.push(file);
    }
    StagedFile::finish_all(staged).map_err(|(number, source)| Error::io(files[number].0)(source))
}

/// Text of a file.
///
/// # Errors
/// [`Error::File`] naming the file.
pub fn read_text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(Error::io(path))
}

/// Parses a TOML file, naming file, line and problem when it does not fit `T`; an array that is longer than `T`'s does not
/// fit.
///
/// # Errors
/// [`Error::File`] with the line and column.
pub fn read_toml<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    parse_toml(path, &read_text(path)?)
}

/// Parses the text of a TOML file, naming file, line and problem when it does not fit `T`.
///
/// # Errors
/// [`Error::File`] with the line and column.
pub fn parse_toml<T: serde::de::DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    let parsed = toml::Deserializer::parse(text).and_then(|whole| T::deserialize(ExactLength(whole)));
    parsed.map_err(|e| {
        let place = e.span().map_or_else(
            || "whole file".to_owned(),
            |span| {
                let before = &text[..span.start.min(text.len())];
                let line = before.matches('\n').count() + 1;
                let column = before.len() - before.rfind('\n').map_or(0, |i| i + 1) + 1;
                format!("line {line}, column {column}")
            },
        );
        Error::content(path, place, e.message().replace('\n', " "))
    })
}

/// The intrinsics file: the entries of a camera in `scene.toml`, on their own.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct IntrinsicsFile {
    width: u32,
    height: u32,
    matrix: [[f64; 3]; 3],
    #[serde(default, skip_serializing_if = "LensModel::is_default")]
    lens: LensModel,
    distortion: Option<Vec<f64>>,
    /// `calib pose` writes an estimated lens beside the pose, so its keys are known here; any other key is an error.
    #[serde(default, skip_serializing)]
    #[expect(dead_code, reason = "only known, so that it is not called a mistake")]
    rotation: IgnoredAny,
    #[serde(default, skip_serializing)]
    #[expect(dead_code, reason = "only known, so that it is not called a mistake")]
    translation: IgnoredAny,
    #[serde(default, skip_serializing)]
    #[expect(dead_code, reason = "only known, so that it is not called a mistake")]
    rms_px: IgnoredAny,
}

impl IntrinsicsFile {
    fn of(intrinsics: &Intrinsics) -> Self {
        Self {
            width: intrinsics.width,
            height: intrinsics.height,
            matrix: rows_of_matrix(&intrinsics.matrix()),
            lens: intrinsics.distortion.model(),
            distortion: Some(intrinsics.distortion.coefficients()),
            rotation: IgnoredAny,
            translation: IgnoredAny,
            rms_px: IgnoredAny,
        }
    }
}

/// The pose file: the entries of a camera's pose in `scene.toml`, on their own.
#[derive(Serialize)]
struct PoseFile {
    #[serde(flatten)]
    lens: Option<IntrinsicsFile>,
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
    rms_px: f64,
}

/// Text of a pose file: the pose and its root mean square residual, pixels. With `with_lens` the camera's intrinsics
/// come before them, so that the file also serves as an intrinsics file.
///
/// # Errors
/// [`Error::Invalid`] for numbers that cannot be written.
pub fn pose_text(camera: &Camera, rms_px: f64, with_lens: bool) -> Result<String> {
    let pose = &camera.camera_from_world;
    let file = PoseFile {
        lens: with_lens.then(|| IntrinsicsFile::of(&camera.intrinsics)),
        rotation: rows_of_matrix(pose.rotation.to_rotation_matrix().matrix()),
        translation: pose.translation.vector.into(),
        rms_px,
    };
    toml::to_string(&file).map_err(|e| Error::Invalid(e.to_string()))
}

/// Reads a camera's intrinsics as written by `calib intrinsics`, or by `calib pose` with an estimated lens.
///
/// # Errors
/// [`Error::File`], naming file and place.
pub fn read_intrinsics(path: &Path) -> Result<Intrinsics> {
    let file: IntrinsicsFile = read_toml(path)?;
    let distortion = Distortion::from_file(file.lens, file.distortion.as_deref())
        .map_err(|problem| Error::content(path, "distortion", problem))?;
    Intrinsics::from_matrix(file.width, file.height, &matrix_from_rows(&file.matrix), distortion)
        .map_err(|e| Error::content(path, "matrix, distortion", e.to_string()))
}

/// Writes a camera's intrinsics for `room.toml`'s `intrinsics` line.
///
/// # Errors
/// [`Error::File`].
pub fn write_intrinsics(path: &Path, intrinsics: &Intrinsics) -> Result<()> {
    let text = toml::to_string(&IntrinsicsFile::of(intrinsics)).map_err(|e| Error::Invalid(e.to_string()))?;
    write_atomic(path, text.as_bytes())
}

/// Matrix of rows as stored in files, as nalgebra's.
pub fn matrix_from_rows(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| rows[r][c])
}

/// nalgebra's matrix as rows, as stored in files.
pub fn rows_of_matrix(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intrinsics_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/cam.toml");
        let mut camera = Intrinsics::from_horizontal_fov(640, 480, 70.0);
        camera.distortion = [-0.2, 0.1, 0.001, -0.002, 0.03].into();
        write_intrinsics(&path, &camera).unwrap();
        assert_eq!(read_intrinsics(&path).unwrap(), camera);
        assert!(!std::fs::read_to_string(&path).unwrap().contains("lens"));
        for model in [LensModel::Rational, LensModel::Fisheye] {
            let numbers = [-0.02, 0.01, 1e-3, 0.1 + 0.2, 0.0, 0.3, 0.07, -0.01];
            let count = model.coefficient_names().len();
            camera.distortion = Distortion::new(model, &numbers[..count]).unwrap();
            write_intrinsics(&path, &camera).unwrap();
            assert_eq!(read_intrinsics(&path).unwrap(), camera);
            assert!(std::fs::read_to_string(&path).unwrap().contains(&format!("lens = \"{model}\"")));
        }
    }

    #[test]
    fn a_lens_beside_its_pose_is_read_as_a_lens() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pose.toml");
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 70.0);
        let camera =
            Camera { intrinsics, camera_from_world: nalgebra::Isometry3::translation(1.0, 2.0, 3.0) };
        std::fs::write(&path, pose_text(&camera, 0.5, true).unwrap()).unwrap();
        assert_eq!(read_intrinsics(&path).unwrap(), camera.intrinsics);
        let pose = pose_text(&camera, 0.5, false).unwrap();
        let written: toml::Table = toml::from_str(&pose).unwrap();
        assert_eq!(written.keys().collect::<Vec<_>>(), ["rms_px", "rotation", "translation"]);
        assert_eq!(written["translation"].as_array().unwrap()[2].as_float(), Some(3.0));
        std::fs::write(&path, pose).unwrap();
        assert!(read_intrinsics(&path).unwrap_err().to_string().contains("width"));
    }

    #[test]
    fn a_folder_is_not_written_over_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        let (file, taken) = (folder.path().join("a.txt"), folder.path().join("b"));
        std::fs::create_dir(&taken).unwrap();
        let said = write_together(&[(&file, b"1"), (&taken, b"2")]).unwrap_err().to_string();
        assert!(said.contains("b: ") && said.contains("name a file in it"), "{said}");
        assert!(!file.exists());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn errors_name_file_and_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cam.toml");
        let said = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_intrinsics(&path).unwrap_err().to_string()
        };
        assert!(said("").contains("cam.toml"));
        let misspelt = said("width = 640\nheight = 480\nmatrx = 3\n");
        assert!(misspelt.contains("line 3") && misspelt.contains("matrx"), "{misspelt}");
        let long = said(
            "width = 6\nheight = 4\nmatrix = [[4, 0, 3], [0, 4, 2], [0, 0, 1]]\ndistortion = [1, 2, 3, 4, 5, 6, 7, 8]\n",
        );
        assert!(long.contains("cam.toml: distortion: 8 numbers") && long.contains("\"rational\""), "{long}");
        let unknown =
            said("width = 6\nheight = 4\nmatrix = [[4, 0, 3], [0, 4, 2], [0, 0, 1]]\nlens = \"cylinder\"\n");
        assert!(unknown.contains("line 4") && unknown.contains("`fisheye`"), "{unknown}");
        let bare =
            said("width = 6\nheight = 4\nmatrix = [[4, 0, 3], [0, 4, 2], [0, 0, 1]]\nlens = \"fisheye\"\n");
        assert!(bare.contains("distortion: 0 numbers") && bare.contains("k1, k2, k3, k4"), "{bare}");
        let negative =
            said("width = 6\nheight = 4\nmatrix = [[-4.0, 0.0, 3.0], [0.0, 4.0, 2.0], [0.0, 0.0, 1.0]]");
        assert!(negative.contains("not positive"), "{negative}");
        std::fs::remove_file(&path).unwrap();
        assert!(read_intrinsics(&path).unwrap_err().to_string().contains("cam.toml"));
    }
}
