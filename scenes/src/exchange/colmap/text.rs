//! `cameras.txt`, `images.txt` and `points3D.txt` of a COLMAP model.

use std::str::{FromStr, SplitWhitespace};

use super::model::{Defect, MODELS, ModelCamera, ModelImage, ModelPoint, ModelPose};
use super::rigs::{Frame, FrameImage, Rig, Sensor};

type Parsed<T> = Result<T, Defect>;

/// The words of a line, read one after the other.
struct Words<'a> {
    line: usize,
    words: SplitWhitespace<'a>,
}

impl<'a> Words<'a> {
    fn wrong(&self, problem: impl Into<String>) -> Defect {
        (format!("line {}", self.line), problem.into())
    }

    fn word(&mut self, what: &str) -> Parsed<&'a str> {
        self.words.next().ok_or_else(|| (format!("line {}", self.line), format!("{what} is missing")))
    }

    fn number<T: FromStr>(&mut self, what: &str) -> Parsed<T> {
        let word = self.word(what)?;
        word.parse().map_err(|_| self.wrong(format!("`{word}` is no {what}")))
    }

    fn pose(&mut self) -> Parsed<ModelPose> {
        let mut numbers = [0.0; 7];
        for value in &mut numbers {
            *value = self.number("number of a pose")?;
        }
        Ok(ModelPose::of_numbers(numbers))
    }

    /// A sensor: whether it is a camera, and its number.
    fn sensor(&mut self) -> Parsed<(bool, u32)> {
        Ok((self.word("sensor type")? == "CAMERA", self.number("sensor number")?))
    }
}

/// Lines that are no comments, numbered from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    (1..).zip(text.lines().map(str::trim)).filter(|(_, line)| !line.starts_with('#'))
}

pub(super) fn cameras(text: &str) -> Parsed<Vec<ModelCamera>> {
    lines(text).filter(|(_, line)| !line.is_empty()).map(|(line, text)| camera(line, text)).collect()
}

fn camera(line: usize, text: &str) -> Parsed<ModelCamera> {
    let mut words = Words { line, words: text.split_whitespace() };
    let id = words.number("camera number")?;
    let name = words.word("camera model")?;
    let model = MODELS.iter().find(|m| m.name == name);
    let model = model.ok_or_else(|| words.wrong(format!("`{name}` is no camera model that is known")))?;
    let (width, height) = (words.number("width")?, words.number("height")?);
    let mut parameters = Vec::with_capacity(model.parameters);
    while let Some(word) = words.words.next() {
        let value = word.parse::<f64>().map_err(|_| words.wrong(format!("`{word}` is no number")))?;
        parameters.push(value);
    }
    if parameters.len() != model.parameters {
        let problem = format!("{name} has {} parameters, here are {}", model.parameters, parameters.len());
        return Err(words.wrong(problem));
    }
    Ok(ModelCamera { id, model, width, height, parameters })
}

/// Two lines a picture: the second, its points, may be empty.
pub(super) fn pictures(text: &str) -> Parsed<Vec<ModelImage>> {
    let mut pictures = Vec::new();
    let mut lines = lines(text);
    while let Some((line, text)) = lines.next() {
        if text.is_empty() {
            continue;
        }
        let mut words = Words { line, words: text.split_whitespace() };
        let id = u64::from(words.number::<u32>("image number")?);
        let pose = words.pose()?;
        let camera = words.number("camera number")?;
        // A name may hold spaces.
        let mut name = words.word("name")?.to_owned();
        for word in words.words {
            name.push(' ');
            name.push_str(word);
        }
        pictures.push(ModelImage { id, name, camera, pose });
        if let Some((line, text)) = lines.next() {
            check_sightings(line, text)?;
        }
    }
    Ok(pictures)
}

/// Checks the second line of a picture: two pixels and the number of a point, −1 for none, for each sighting.
fn check_sightings(line: usize, text: &str) -> Parsed<()> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let is_sighting = |words: &[&str]| match words {
        [x, y, point] => x.parse::<f64>().is_ok() && y.parse::<f64>().is_ok() && point.parse::<i64>().is_ok(),
        _ => false,
    };
    if words.chunks(3).all(is_sighting) {
        return Ok(());
    }
    let problem = "is no list of points (X Y POINT3D_ID for each), which every second line is: give each image its second \
                   line, which may be empty";
    Err((format!("line {line}"), problem.to_owned()))
}

pub(super) fn points(text: &str) -> Parsed<Vec<ModelPoint>> {
    lines(text)
        .filter(|(_, line)| !line.is_empty())
        .map(|(line, text)| {
            let mut words = Words { line, words: text.split_whitespace() };
            let _: u64 = words.number("point number")?;
            let mut coordinate = || words.number("coordinate");
            let place = [coordinate()?, coordinate()?, coordinate()?];
            let mut level = || words.number("colour from 0 to 255");
            let color = [level()?, level()?, level()?];
            Ok(ModelPoint { place, color })
        })
        .collect()
}

pub(super) fn rigs(text: &str) -> Parsed<Vec<Rig>> {
    let rig = |(line, text): (usize, &str)| {
        let mut words = Words { line, words: text.split_whitespace() };
        let (id, sensors) = (words.number("rig number")?, words.number::<u32>("number of sensors")?);
        let mut rig = Rig { id, cameras: Vec::new() };
        for number in 0..sensors {
            let (is_camera, camera) = words.sensor()?;
            // The first one is the rig's own frame.
            let pose = if number == 0 {
                Some(ModelPose::IDENTITY)
            } else if words.number::<u8>("0 or 1 for a sensor's pose")? == 0 {
                None
            } else {
                Some(words.pose()?)
            };
            if is_camera {
                rig.cameras.push(Sensor { camera, pose });
            }
        }
        Ok(rig)
    };
    lines(text).filter(|(_, line)| !line.is_empty()).map(rig).collect()
}

pub(super) fn frames(text: &str) -> Parsed<Vec<Frame>> {
    let frame = |(line, text): (usize, &str)| {
        let mut words = Words { line, words: text.split_whitespace() };
        let (id, rig) = (words.number("frame number")?, words.number("rig number")?);
        let mut frame = Frame { id, rig, pose: words.pose()?, images: Vec::new() };
        for _ in 0..words.number::<u32>("number of pictures")? {
            let (is_camera, camera) = words.sensor()?;
            let image = words.number("image number")?;
            if is_camera {
                frame.images.push(FrameImage { camera, image });
            }
        }
        Ok(frame)
    };
    lines(text).filter(|(_, line)| !line.is_empty()).map(frame).collect()
}
