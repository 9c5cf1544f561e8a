//! Where a person can stand: the function H of the paper's state prior, as a map of the floor.
//!
//! A room may say it (`[floor]` in `scene.toml`); otherwise it is derived from the geometry: the floor's extent minus
//! what stands on it between ankle and head height. Reconstructions have holes and strays, so the map errs on the
//! side of letting people stand: see [`WalkableOptions`].

mod cached;
mod derive;
mod grid;
mod obstacles;
mod survey;
#[cfg(test)]
mod tests;

use nalgebra::Point2;

use crate::Result;
use crate::polygon::Polygon;
use crate::room::Room;

pub use cached::cached;
pub use grid::Grid;

/// How a walkable map is derived from geometry.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkableOptions {
    /// Side of a cell, metres. Grows with very large rooms, so that no side has more than 2000 cells.
    pub cell_m: f64,
    /// Surfaces within this height of z = 0 that face up or down are floor.
    pub floor_tolerance_m: f64,
    /// What is lower than this can be stepped on, and is lost in the noise of a reconstructed floor.
    pub ankle_m: f64,
    /// What is higher than this is walked under.
    pub head_m: f64,
    /// A place is obstructed when the surfaces between ankle and head make up this fraction of the floor's area around
    /// it, or more. Well below 1: what stereo sees at a grazing angle is sparse.
    pub obstructed_fraction: f64,
    /// How far "around it" reaches, metres.
    pub window_m: f64,
    /// Obstructed patches smaller than this (m²) are strays, unless they are as high as `pole_height_m`.
    pub stray_area_m2: f64,
    /// How high a narrow thing must reach to be believed.
    pub pole_height_m: f64,
    /// Holes in obstructed patches narrower than twice this are closed, metres.
    pub close_m: f64,
    /// How far the middle of a person may reach over the edge of a table top or a shelf board, metres.
    pub lean_m: f64,
    /// How far from floor that was seen, or from places that a camera looks onto freely, hidden floor is believed in.
    pub hidden_reach_m: f64,
    /// Walkable pockets smaller than this (m²) that hold no zone cannot be walked into: the inside of a pillar.
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

/// Where on the floor a person can stand.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkableMap {
    /// `None`: everywhere.
    grid: Option<Grid>,
}

impl WalkableMap {
    /// Everywhere: nothing is known of the room.
    pub fn everywhere() -> Self {
        Self { grid: None }
    }

    /// Inside any of the polygons, to the nearest cell.
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

    /// The map of a room: its own polygons; else derived from its geometry, with its zones walkable in any case; else
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

    /// Whether a person can stand at a place of the floor, metres. Never at one that is not finite.
    pub fn contains(&self, x_m: f64, y_m: f64) -> bool {
        let place = Point2::new(x_m, y_m);
        self.grid.as_ref().map_or(x_m.is_finite() && y_m.is_finite(), |grid| grid.contains(&place))
    }

    /// Whether a person can stand somewhere in a region of the floor.
    pub fn reaches_into(&self, region: &Polygon) -> bool {
        let Some(grid) = &self.grid else { return true };
        (0..grid.bits.len()).any(|cell| grid.bits[cell] && region.contains(&grid.center(cell)))
    }

    /// The cells, unless everywhere is walkable.
    pub fn grid(&self) -> Option<&Grid> {
        self.grid.as_ref()
    }

    /// The smallest and the largest corner of the rectangle around all walkable cells, metres; `None` if everywhere is
    /// walkable, or nothing.
    pub fn bounds(&self) -> Option<(Point2<f64>, Point2<f64>)> {
        self.grid.as_ref()?.bounds()
    }

    /// Walkable area in square metres; `None` if everywhere is walkable.
    pub fn area_m2(&self) -> Option<f64> {
        self.grid.as_ref().map(Grid::area_m2)
    }
}
