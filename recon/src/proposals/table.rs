//! Proposed points as the `[[point]]` tables of `room.toml`.

use std::fmt::Write;

use crate::project::PickedPoint;

/// Tables to copy into `room.toml`; `points`: each with the correlation of its pictures; `names`: one a camera.
pub fn to_toml(points: &[(PickedPoint, f64)], names: &[&str]) -> String {
    let mut text = String::from(
        "# Proposed by `recon picks`. Look at the picture, delete what is not the same physical point in its images, and\n\
         # copy the rest into room.toml. Correlation: how alike the pictures are there; 1 is equal.\n",
    );
    for (number, (point, correlation)) in points.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "\n[[point]]   # {}, correlation {correlation:.2}", number + 1);
        for (camera, pixel) in &point.picks {
            let _ = writeln!(text, "{} = [{:.1}, {:.1}]", key(names[*camera]), pixel.x, pixel.y);
        }
    }
    text
}

/// Key of a TOML table: quoted only where necessary.
fn key(name: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(is_bare) {
        name.into()
    } else {
        toml::Value::from(name).to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    #[test]
    fn tables_read_back_even_with_unusual_names() {
        let picks = vec![(0, Point2::new(10.04, 20.0)), (1, Point2::new(3.0, 4.57))];
        let text = to_toml(&[(PickedPoint { picks }, 0.9)], &["cam 1.a", "b"]);
        assert!(text.contains("\nb = [3.0, 4.6]"), "{text}");
        let back: toml::Table = text.parse().unwrap();
        let point = back["point"][0].as_table().unwrap();
        assert_eq!(point["cam 1.a"][0].as_float(), Some(10.0));
        assert_eq!(point["b"][1].as_float(), Some(4.6));
    }
}
