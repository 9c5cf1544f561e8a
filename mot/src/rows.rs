//! Reader of MOTChallenge rows, on the floor (3-D) or in an image (2-D).
//!
//! One row a person and frame: `frame,id,left,top,width,height,confidence[,x,y,z]`. Floor rows have −1 in the box's
//! columns, image rows −1 (or nothing) in the position's. An id of −1 means an unknown identity.
//!
//! A row with a width and a height is a box. After its confidence may stand a class and a visibility (MOT16, MOT17,
//! MOT20, CVAT: up to nine columns) or, in ten columns, the person's position on the floor besides (3-D MOT15).

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use nalgebra::Point2;
use shell::ranges::{FRAME_NUMBER, PIXELS, ROOM_M};

use crate::{Error, Result};

/// A box in an image, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelBox {
    /// Left edge.
    pub left: f64,
    /// Top edge.
    pub top: f64,
    /// Width, positive.
    pub width: f64,
    /// Height, positive.
    pub height: f64,
}

impl PixelBox {
    /// Intersection over union with another box: 1 for the same box, 0 for disjoint boxes.
    pub fn iou(&self, other: &Self) -> f64 {
        let overlap =
            |a: f64, a_len: f64, b: f64, b_len: f64| ((a + a_len).min(b + b_len) - a.max(b)).max(0.0);
        let shared = overlap(self.left, self.width, other.left, other.width)
            * overlap(self.top, self.height, other.top, other.height);
        let union = self.width * self.height + other.width * other.height - shared;
        if union > 0.0 { shared / union } else { 0.0 }
    }

    /// Middle of the lower edge, where the person stands.
    pub fn foot(&self) -> Point2<f64> {
        Point2::new(self.left + 0.5 * self.width, self.top + self.height)
    }
}

/// A person in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Line of the file, from 1.
    pub line: usize,
    /// Frame, from 1.
    pub frame: u32,
    /// Id of the person or track; `None` (−1 in the file) if unknown.
    pub id: Option<u32>,
    /// The 7th column: a tracker's confidence; in truth files 0 marks a row that does not count.
    pub confidence: f64,
    /// Box in the image, if the row has one.
    pub pixel_box: Option<PixelBox>,
    /// Position on the floor, metres, if the row has one.
    pub position: Option<Point2<f64>>,
    /// The 8th column of a box's row; `None` where it is −1 or absent.
    pub class_column: Option<f64>,
    /// The 9th column of a box's row; `None` where it is −1 or absent.
    pub visibility_column: Option<f64>,
}

impl Row {
    /// Class of a box (MOT17's 8th column); `None` where that column is not a non-negative integer.
    pub fn class(&self) -> Option<u32> {
        let class = self.class_column?;
        (class >= 0.0 && class.fract() == 0.0 && class <= f64::from(u32::MAX)).then_some(class as u32)
    }
}

/// Rows of a file, in file order.
#[derive(Debug, Clone, PartialEq)]
pub struct RowFile {
    /// Path of the file, for messages.
    pub path: PathBuf,
    /// Rows.
    pub rows: Vec<Row>,
}

impl RowFile {
    /// Reads a file; an empty file has no rows.
    ///
    /// # Errors
    /// Names file, line and mend of: a column that is not a finite number, a frame below 1, a row with neither box nor
    /// position, an id that occurs twice in one frame.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &calib::files::read_text(path)?)
    }

    /// Parses rows from text; `path` is for messages.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let mut rows = Vec::new();
        let mut seen = HashSet::new();
        for (index, content) in text.lines().enumerate() {
            let (line, content) = (index + 1, content.trim().trim_start_matches('\u{feff}'));
            if content.is_empty() || content.starts_with('#') {
                continue;
            }
            let refuse = |problem: String| Error::content(path, format!("line {line}"), problem);
            let row = parse_row(line, content).map_err(refuse)?;
            if let Some(id) = row.id
                && !seen.insert((row.frame, id))
            {
                return Err(refuse(format!("frame {} holds id {id} twice; keep one of the rows", row.frame)));
            }
            rows.push(row);
        }
        Ok(Self { path: path.to_owned(), rows })
    }

    /// Whether every row has a position on the floor.
    pub fn is_on_floor(&self) -> bool {
        self.rows.iter().all(|r| r.position.is_some())
    }

    /// Whether every row has a box.
    pub fn has_boxes(&self) -> bool {
        self.rows.iter().all(|r| r.pixel_box.is_some())
    }
}

fn parse_row(line: usize, content: &str) -> std::result::Result<Row, String> {
    /// Names of the columns that are read.
    const COLUMNS: [&str; 10] =
        ["frame", "id", "left", "top", "width", "height", "confidence", "x", "y", "z"];
    let mut values = Vec::with_capacity(COLUMNS.len());
    for (text, name) in content.split(',').map(str::trim).zip(COLUMNS) {
        let value: f64 = text.parse().map_err(|_| format!("{name} is `{text}`, which is no number"))?;
        if !value.is_finite() {
            return Err(format!("{name} is {text}; only finite numbers can be used"));
        }
        values.push(value);
    }
    if values.len() < 6 {
        return Err(format!(
            "has {} columns; a row is frame,id,left,top,width,height,confidence,x,y,z",
            values.len()
        ));
    }
    // As the file writes it: a number of 64 bits has more digits than a double.
    let written = |index: usize| content.split(',').nth(index).unwrap_or_default().trim();
    let whole = |value: f64| value.fract() == 0.0 && value <= f64::from(u32::MAX);
    if !(whole(values[0]) && values[0] >= 1.0) {
        return Err(format!("frame is {}; frames are whole numbers from 1 to {}", written(0), u32::MAX));
    }
    if let Some(problem) = FRAME_NUMBER.defect(values[0]) {
        return Err(format!("frame {problem}"));
    }
    if !(whole(values[1]) && values[1] >= -1.0) {
        return Err(format!(
            "id is {}; ids are whole numbers from 0 to {}, or −1 if the person is unknown: number them anew",
            written(1),
            u32::MAX
        ));
    }
    let column = |index: usize| values.get(index).copied();
    let (width, height) = (values[4], values[5]);
    if (width > 0.0) != (height > 0.0) {
        return Err(format!(
            "is {width} wide and {height} high; a box has both above 0, a floor position has −1 in both"
        ));
    }
    let pixel_box = (width > 0.0).then(|| PixelBox { left: values[2], top: values[3], width, height });
    let position = match (column(7), column(8), column(9)) {
        // After a box, eight or nine columns hold its class and visibility.
        (_, _, None) if pixel_box.is_some() => None,
        (Some(x), Some(y), z) if (x, y, z.unwrap_or(0.0)) != (-1.0, -1.0, -1.0) => Some(Point2::new(x, y)),
        _ => None,
    };
    // A box's row may have other things in the columns of the place, and the place's row in those of the box.
    let columns = if pixel_box.is_some() { 2..6 } else { 7..values.len().min(10) };
    let range = if pixel_box.is_some() { PIXELS } else { ROOM_M };
    for index in columns {
        if let Some(problem) = range.defect(values[index]) {
            return Err(format!("{} {problem}", COLUMNS[index]));
        }
    }
    let attribute =
        |index: usize| column(index).filter(|value| pixel_box.is_some() && (*value + 1.0).abs() > 0.0);
    if pixel_box.is_none() && position.is_none() {
        return Err("has neither a box (width and height above 0) nor a floor position (x, y, z)".into());
    }
    Ok(Row {
        line,
        frame: values[0] as u32,
        id: (values[1] >= 0.0).then_some(values[1] as u32),
        confidence: column(6).unwrap_or(1.0),
        pixel_box,
        position,
        class_column: attribute(7),
        visibility_column: attribute(8),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn parse(text: &str) -> Result<RowFile> {
        RowFile::parse(Path::new("rows.txt"), text)
    }

    #[test]
    fn both_kinds_are_read() {
        let floor = parse("1,3,-1,-1,-1,-1,0.9,1.25,-1,0\r\n\n7,-1,-1,-1,-1,-1,1,-1,-1,0\n").unwrap();
        assert!(floor.is_on_floor() && !floor.has_boxes());
        assert_eq!((floor.rows[0].id, floor.rows[0].position), (Some(3), Some(Point2::new(1.25, -1.0))));
        assert_eq!((floor.rows[1].line, floor.rows[1].frame, floor.rows[1].id), (3, 7, None));

        let image = parse("# boxes\n2, 1, 10, 20, 30.5, 40, 1\n3,1,10,20,30,40,0,-1,-1,-1").unwrap();
        assert!(image.has_boxes() && !image.is_on_floor());
        assert_relative_eq!(image.rows[0].pixel_box.unwrap().foot(), Point2::new(25.25, 60.0));
        assert!(image.rows[1].confidence.abs() < 1e-12);

        let empty = parse("").unwrap();
        assert!(empty.is_on_floor() && empty.has_boxes());
    }

    #[test]
    fn class_and_visibility_of_a_box_are_no_position() {
        let file =
            parse("1,1,105,50,40,100,1,1,0.9\n1,2,105,50,40,100,1,7\n1,3,105,50,40,100,1,1,1\n").unwrap();
        assert!(file.has_boxes() && file.rows.iter().all(|row| row.position.is_none()));
        assert_eq!(file.rows.iter().map(Row::class).collect::<Vec<_>>(), [Some(1), Some(7), Some(1)]);
        assert_eq!(file.rows[0].visibility_column, Some(0.9));
        // Ten columns may hold a position besides the box, nine without a box always hold one.
        let both = parse("1,1,10,10,40,100,1,2.5,3.5,0\n").unwrap();
        assert!(both.has_boxes() && both.is_on_floor() && both.rows[0].class().is_none());
        assert_eq!(parse("1,1,-1,-1,-1,-1,1,2,3\n").unwrap().rows[0].position, Some(Point2::new(2.0, 3.0)));
    }

    #[test]
    fn bad_rows_are_named_with_their_line() {
        for (bad, word) in [
            ("1,2,a,4,5,6,7", "left"),
            ("1,2,3,4,5", "5 columns"),
            ("1,1,-1,-1,-1,-1,1,NaN,0,0", "x is NaN"),
            ("1,1,-1,-1,-1,-1,1,0,inf,0", "y is inf"),
            ("1e10,1,1,1,5,5,1", "frames are"),
            ("4000000001,1,1,1,5,5,1", "1 to 4000000000"),
            ("1,1,1,1e300,5,5,1", "top is 1e300; give -1000000 to 1000000 pixels"),
            ("1,1,-1,-1,-1,-1,1,0,20000,0", "y is 20000; give -10000 to 10000 metres"),
            ("0,1,1,1,5,5,1", "frames are"),
            ("1.5,1,1,1,5,5,1", "frames are"),
            ("1,-2,1,1,5,5,1", "ids are"),
            (
                "1,18446744073709551615,1,1,5,5,1",
                "id is 18446744073709551615; ids are whole numbers from 0 to 4294967295",
            ),
            ("4294967296,1,1,1,5,5,1", "4294967295"),
            ("1,1,1,1,5,0,1,2,3,0", "5 wide and 0 high"),
            ("1,1,1,1,-1,5,1", "-1 wide and 5 high"),
            ("1,1,-1,-1,-1,-1,1,-1,-1,-1", "neither"),
            ("2,1,1,1,5,5,1\n2,1,1,1,5,5,1", "twice"),
            ("\u{0}\u{1}binary", "no number"),
        ] {
            let text = format!("1,1,0,0,5,5,1\n{bad}\n");
            let error = parse(&text).unwrap_err().to_string();
            let line = if word == "twice" { "line 3" } else { "line 2" };
            assert!(error.contains("rows.txt") && error.contains(line) && error.contains(word), "{error}");
            assert_eq!(error.lines().count(), 1);
        }
    }

    #[test]
    fn overlap_is_the_shared_area_over_the_joint_area() {
        let a = PixelBox { left: 0.0, top: 0.0, width: 4.0, height: 2.0 };
        let b = PixelBox { left: 2.0, top: 1.0, width: 4.0, height: 2.0 };
        assert_relative_eq!(a.iou(&b), 2.0 / 14.0);
        assert_relative_eq!(a.iou(&a), 1.0);
        assert_relative_eq!(a.iou(&PixelBox { left: 4.0, ..a }), 0.0);
    }
}
