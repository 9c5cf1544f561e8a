//! The walkable floor: the function H of the paper's state prior (T. Osawa et al., "MCMC based Multiple People Tracking
//! using 3D Environmental Information", paper LI-007), as a map of the floor.
//!
//! A room may state it (`[floor]` in `scene.toml`); otherwise it is derived from the geometry: the floor's extent minus
//! the obstacles between ankle and head height. Reconstructions have holes and strays, so the map errs on the side of
//! letting people stand: see [`WalkableOptions`].

mod cached;
mod derive;
mod grid;
mod obstacles;
mod survey;
#[cfg(test)]
mod tests;
mod warnings;

use nalgebra::Point2;

use crate::Result;
use crate::polygon::Polygon;
use crate::room::Room;

pub use cached::cached;
pub use grid::Grid;
pub use warnings::unreachable;

/// Options of the derivation of a walkable map from geometry.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkableOptions {
    /// Side of a cell, metres. Grows with very large rooms, so that no side has more than 2000 cells; 400 from a kilometre
    /// on.
    pub cell_m: f64,
    /// Height around z = 0 within which surfaces that face up or down are floor, metres.
    pub floor_tolerance_m: f64,
    /// Height below which things can be stepped on, and are lost in the noise of a reconstructed floor, metres.
    pub ankle_m: f64,
    /// Height above which things are walked under, metres.
    pub head_m: f64,
    /// Ratio of the surface area between ankle and head to the floor area around a place from which on the place is
    /// obstructed. Well below 1: stereo at a grazing angle is sparse.
    pub obstructed_fraction: f64,
    /// Radius of "around a place", metres.
    pub window_m: f64,
    /// Area below which obstructed patches are strays, m², unless they are as high as `pole_height_m`.
    pub stray_area_m2: f64,
    /// Least height of a narrow thing that counts as an obstacle, metres.
    pub pole_height_m: f64,
    /// Half the width of holes in obstructed patches that are closed, metres.
    pub close_m: f64,
    /// Distance by which the middle of a person may reach over the edge of a table top or a shelf board, metres.
    pub lean_m: f64,
    /// Distance from seen floor, or from places that a camera looks onto freely, within which hidden floor is assumed,
    /// metres.
    pub hidden_reach_m: f64,
    /// Area below which walkable pockets without a zone are closed, m²: the inside of a pillar.
    pub pocket_area_m2: f64,
}

impl Default for WalkableOptions {
    fn default() -> Self {
        Self {
            cell_m: 0.05,
            floor_tolerance_m: 0.1,
            ankle_m: 0.2,
            head_m: 1.8,
            obstructed_fraction: 0.25,
            window_m: 0.1,
            stray_area_m2: 0.03,
            pole_height_m: 0.4,
            close_m: 0.1,
            lean_m: 0.1,
            hidden_reach_m: 0.5,
            pocket_area_m2: 1.0,
        }
    }
}

/// Map of the floor on which a person can stand.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkableMap {
    /// `None` if everywhere is walkable.
    grid: Option<Grid>,
}

impl WalkableMap {
    /// Map for an unknown room: everywhere is walkable.
    pub fn everywhere() -> Self {
        Self { grid: None }
    }

    /// Map of the inside of any of the polygons, to the nearest cell.
    pub fn of_polygons(polygons: &[Polygon]) -> Self {
        let cell_m = WalkableOptions::default().cell_m;
        let Some(mut grid) = Grid::around(polygons.iter().map(Polygon::bounds), cell_m) else {
            return Self::everywhere();
        };
        for polygon in polygons {
            grid.fill(polygon);
        }
        Self { grid: Some(grid) }
    }

    /// Map of a room: its own polygons; else derived from its geometry, with its zones walkable in any case; else
    /// everywhere.
    ///
    /// # Errors
    /// [`crate::Error::Geometry`] when the geometry cannot be intersected.
    pub fn of_room(room: &Room) -> Result<Self> {
        Self::of_room_with(room, &WalkableOptions::default())
    }

    /// [`Self::of_room`] with other options.
    ///
    /// # Errors
    /// As [`Self::of_room`].
    pub fn of_room_with(room: &Room, options: &WalkableOptions) -> Result<Self> {
        match (&room.walkable, &room.geometry) {
            (Some(polygons), _) => Ok(Self::of_polygons(polygons)),
            (None, Some(geometry)) => {
                Ok(Self { grid: derive::from_geometry(geometry, &room.cameras, &room.zones, options)? })
            }
            (None, None) => Ok(Self::everywhere()),
        }
    }

    /// Tells whether a person can stand at a place of the floor, metres; `false` where it is not finite.
    pub fn contains(&self, x_m: f64, y_m: f64) -> bool {
        let place = Point2::new(x_m, y_m);
        self.grid.as_ref().map_or(x_m.is_finite() && y_m.is_finite(), |grid| grid.contains(&place))
    }

    /// Tells whether a person can stand somewhere in a region of the floor.
    pub fn reaches_into(&self, region: &Polygon) -> bool {
        let Some(grid) = &self.grid else { return true };
        let mut inside = grid.cleared();
        inside.fill(region);
        inside.set_cells().any(|cell| grid.bits[cell])
    }

    /// Tells whether a person can stand somewhere on a line of straight pieces.
    pub fn reaches_line(&self, pieces: impl IntoIterator<Item = (Point2<f64>, Point2<f64>)>) -> bool {
        let Some(grid) = &self.grid else { return true };
        let cell_m = WalkableOptions::default().cell_m;
        pieces.into_iter().any(|(a, b)| {
            // Places about a cell apart; a line drawn over a continent needs no more than these.
            let steps = ((b - a).norm() / cell_m).ceil().clamp(1.0, 1e5) as u32;
            (0..=steps).any(|i| grid.contains(&(a + (b - a) * (f64::from(i) / f64::from(steps)))))
        })
    }

    /// Cells of the map; `None` if everywhere is walkable.
    pub fn grid(&self) -> Option<&Grid> {
        self.grid.as_ref()
    }

    /// Smallest and largest corner of the rectangle around all walkable cells, metres; `None` if everywhere is
    /// walkable, or nothing.
    pub fn bounds(&self) -> Option<(Point2<f64>, Point2<f64>)> {
        self.grid.as_ref()?.bounds()
    }

    /// Walkable area in square metres; `None` if everywhere is walkable.
    pub fn area_m2(&self) -> Option<f64> {
        self.grid.as_ref().map(Grid::area_m2)
    }
}
