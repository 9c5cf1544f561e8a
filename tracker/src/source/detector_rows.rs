//! Rows of a detector: boxes of people, a MOTChallenge row a box, or a JSON line a frame.
//!
//! A MOTChallenge row is `frame,id,left,top,width,height[,confidence[,x,y,z[,appearance…]]]`. Ids and floor positions are
//! ignored. Numbers after the tenth column are an appearance vector, of the same length in all rows.
//!
//! A JSON line is `{"boxes":[{"left":…,"top":…,"width":…,"height":…,"appearance":[…]},…]}`, complete in itself, so that it
//! can say that nobody is there; `"frame"` and `"time"` (of the capture, seconds since 1970) may be given, and further keys
//! are ignored.

use std::sync::Arc;

use serde::Deserialize;
use shell::ranges::{PIXELS, TIME_S};

use mot::rows::PixelBox;

/// Names of the first columns of a row.
const COLUMNS: [&str; 10] = ["frame", "id", "left", "top", "width", "height", "confidence", "x", "y", "z"];
/// Columns that every row has.
const LEAST_COLUMNS: usize = 6;
/// Largest frame number: 46 days at 25 frames a second. Larger ones are times, or another column.
const LAST_FRAME: f64 = 1e8;

/// Box of a detector, as its row gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectedBox {
    /// Box in pixels of what the camera films.
    pub pixels: PixelBox,
    /// Numbers after the tenth column; `None` without any.
    pub appearance: Option<Arc<[f32]>>,
}

/// All boxes of one frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DetectedFrame {
    /// Capture time, seconds since 1970, if it is given.
    pub time_s: Option<f64>,
    /// The boxes.
    pub boxes: Vec<DetectedBox>,
}

/// A frame as a JSON line gives it.
#[derive(Deserialize)]
struct JsonFrame {
    time: Option<f64>,
    boxes: Vec<JsonBox>,
}

#[derive(Deserialize)]
struct JsonBox {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    #[serde(default)]
    appearance: Vec<f32>,
}

/// Frame of a JSON line.
pub(super) fn parse_json(content: &str) -> Result<DetectedFrame, String> {
    let frame: JsonFrame = serde_json::from_str(content).map_err(|error| format!("is no frame: {error}"))?;
    if let Some(problem) = frame.time.and_then(|time_s| TIME_S.defect(time_s)) {
        return Err(format!("time {problem}"));
    }
    let boxes = frame.boxes.into_iter().map(|JsonBox { left, top, width, height, appearance }| {
        checked(PixelBox { left, top, width, height }, appearance)
    });
    Ok(DetectedFrame { time_s: frame.time, boxes: boxes.collect::<Result<_, _>>()? })
}

/// A box whose numbers are in their ranges.
fn checked(pixels: PixelBox, vector: Vec<f32>) -> Result<DetectedBox, String> {
    let PixelBox { left, top, width, height } = pixels;
    if !(width > 0.0 && height > 0.0) {
        return Err(format!("the box is {width} × {height} pixels; give a width and a height above 0"));
    }
    for (name, value) in COLUMNS[2..6].iter().zip([left, top, width, height]) {
        if let Some(problem) = PIXELS.defect(value) {
            return Err(format!("{name} {problem}"));
        }
    }
    if let Some(value) = vector.iter().find(|value| !value.is_finite()) {
        return Err(format!("an appearance value is {value}; appearance values are at most {:e}", f32::MAX));
    }
    let appearance = (!vector.is_empty()).then(|| vector.into());
    Ok(DetectedBox { pixels, appearance })
}

/// Frame and box of one row.
pub(super) fn parse_row(content: &str) -> Result<(u32, DetectedBox), String> {
    let mut values = [0.0; COLUMNS.len()];
    let mut count = 0;
    let mut vector: Vec<f32> = Vec::new();
    for text in content.split(',').map(str::trim) {
        let name = || COLUMNS.get(count).map_or_else(|| format!("column {}", count + 1), |c| (*c).to_owned());
        let value: f64 = text.parse().map_err(|_| format!("{} is `{text}`, which is no number", name()))?;
        if !value.is_finite() {
            return Err(format!("{} is {text}; only finite numbers can be used", name()));
        }
        match values.get_mut(count) {
            Some(column) => *column = value,
            None if (value as f32).is_finite() => vector.push(value as f32),
            None => {
                return Err(format!("{} is {text}; appearance values are at most {:e}", name(), f32::MAX));
            }
        }
        count += 1;
    }
    if count < LEAST_COLUMNS {
        return Err(format!("has {count} columns; a row is frame,id,left,top,width,height,confidence"));
    }
    let [frame, _, left, top, width, height, ..] = values;
    if !(frame.fract() == 0.0 && (1.0..=LAST_FRAME).contains(&frame)) {
        return Err(format!("frame is {frame}; frames are whole numbers from 1 to {LAST_FRAME}"));
    }
    Ok((frame as u32, checked(PixelBox { left, top, width, height }, vector)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_json_line_is_a_frame_with_or_without_people() {
        let line = r#"{"frame":7,"time":1764151200.25,"boxes":[{"left":1,"top":2,"width":3,"height":4,"score":0.9},
            {"left":1.5,"top":2,"width":3,"height":4,"appearance":[0.5,-1]}]}"#;
        let frame = parse_json(line).unwrap();
        assert_eq!((frame.time_s, frame.boxes.len()), (Some(1_764_151_200.25), 2));
        assert_eq!(frame.boxes[0].pixels, PixelBox { left: 1.0, top: 2.0, width: 3.0, height: 4.0 });
        assert_eq!(frame.boxes[1].appearance.as_deref(), Some(&[0.5, -1.0][..]));
        assert_eq!(parse_json(r#"{"boxes":[]}"#).unwrap(), DetectedFrame::default());
    }

    #[test]
    fn bad_json_lines_say_what_is_wrong() {
        for (bad, word) in [
            (r#"{"frame":1}"#, "boxes"),
            (r#"{"boxes":[{"left":1,"top":2,"width":3}]}"#, "height"),
            (r#"{"boxes":[{"left":1,"top":2,"width":0,"height":4}]}"#, "0 × 4 pixels"),
            (r#"{"boxes":[{"left":1e9,"top":2,"width":1,"height":4}]}"#, "left is"),
            (r#"{"boxes":[{"left":1,"top":2,"width":1,"height":4,"appearance":[1e300]}]}"#, "appearance"),
            (r#"{"time":1e300,"boxes":[]}"#, "time is"),
            ("{", "EOF"),
        ] {
            let said = parse_json(bad).unwrap_err();
            assert!(said.contains(word) && said.lines().count() == 1, "{bad}: {said}");
        }
    }
}
