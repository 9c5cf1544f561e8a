//! Check that every pixel of the project lies in the image in which it was picked.

use nalgebra::Point2;

use super::{KnownLength, Project, scale_place};
use crate::{Error, Result};

impl Project {
    /// Checks every pixel against the image sizes, once the captures are read.
    ///
    /// # Errors
    /// [`Error::File`] naming the first pixel that lies outside.
    pub fn check_pixels(&self, sizes: &[(u32, u32)]) -> Result<()> {
        let of = self.lengths.len();
        let ends = (1..).zip(&self.lengths).flat_map(|(number, length)| match length {
            KnownLength::Distance { camera, from, to, .. } => {
                let place = scale_place(number, of);
                vec![(format!("{place}, from"), *camera, *from), (format!("{place}, to"), *camera, *to)]
            }
            KnownLength::Height { .. } | KnownLength::Board { .. } => Vec::new(),
        });
        let known = (1..).zip(&self.control_points).flat_map(|(number, point)| {
            point.picks.iter().map(move |(camera, pixel)| {
                (format!("[[control]] {number}, {}", self.cameras[*camera].name), *camera, *pixel)
            })
        });
        let picks = self.points.iter().enumerate().flat_map(|(i, point)| {
            point.picks.iter().map(move |(camera, pixel)| {
                (format!("[[point]] {}, {}", i + 1, self.cameras[*camera].name), *camera, *pixel)
            })
        });
        for (place, camera, pixel) in ends.chain(known).chain(picks) {
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
}
