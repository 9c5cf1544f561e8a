//! Procedural surfaces: enough detail at every scale for feature tracking and stereo.
//!
//! A [`Material`] gives the colour of each point of a surface from its place on it (metres). All randomness is a hash
//! of lattice coordinates, so a surface looks the same from everywhere and in every run.

use glam::{IVec2, Vec2, Vec3};

/// Appearance of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Material {
    /// Main colour, sRGB from 0 to 1.
    pub base: Vec3,
    /// Second colour, where the pattern has one.
    pub accent: Vec3,
    /// Pattern.
    pub pattern: Pattern,
    /// Seed that makes two surfaces of one pattern differ.
    pub seed: u32,
}

/// The patterns that materials come in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pattern {
    /// Painted wall: faint clouds and speckles.
    Plaster,
    /// Wallpaper with scattered motifs.
    Wallpaper,
    /// Floor boards along u.
    Boards,
    /// Square tiles with joints.
    Tiles,
    /// Wood with grain along u.
    Wood,
    /// Stone with veins.
    Stone,
    /// Checked cloth.
    Plaid,
    /// Cloth with stripes across v.
    Stripes,
    /// Plain cloth.
    Cloth,
    /// Backs of books on shelves 35 cm apart.
    Books,
    /// A picture of random shapes in a white rim, from (0, 0) to (1, 1) and repeated.
    Poster,
    /// Cardboard with a strip of tape.
    Cardboard,
}

impl Material {
    /// Colour at a place of the surface (u, v in metres), sRGB from 0 to 1.
    pub(super) fn color(&self, at: Vec2) -> Vec3 {
        let grain = 1.0 + 0.10 * (fbm(at * 45.0, self.seed ^ 0x51) - 0.5);
        let clouds = 1.0 + 0.22 * (fbm(at * 2.3, self.seed) - 0.5);
        let color = match self.pattern {
            Pattern::Plaster => self.base,
            Pattern::Wallpaper => self.wallpaper(at),
            Pattern::Boards => self.boards(at),
            Pattern::Tiles => self.tiles(at),
            Pattern::Wood => self.base * (0.75 + 0.5 * fbm(at * Vec2::new(3.0, 42.0), self.seed)),
            Pattern::Stone => self.stone(at),
            Pattern::Plaid => self.plaid(at),
            Pattern::Stripes => self.base.lerp(self.accent, step((at.y * 14.0).fract_gl() - 0.5)),
            Pattern::Cloth => self.base * (0.85 + 0.3 * fbm(at * 11.0, self.seed)),
            Pattern::Books => self.books(at),
            Pattern::Poster => self.poster(at),
            Pattern::Cardboard => self.cardboard(at),
        };
        (color * grain * clouds).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// A motif of five petals in most cells of a jittered lattice.
    fn wallpaper(&self, at: Vec2) -> Vec3 {
        const CELL_M: f32 = 0.31;
        let home = (at / CELL_M).floor().as_ivec2();
        let mut strength = 0.0_f32;
        for dy in -1..=1 {
            for dx in -1..=1 {
                let cell = home + IVec2::new(dx, dy);
                let r = |k: u32| unit(cell, self.seed.wrapping_add(k));
                let center = (cell.as_vec2() + Vec2::new(0.2 + 0.6 * r(1), 0.2 + 0.6 * r(2))) * CELL_M;
                let (size, turn) = (0.05 + 0.06 * r(3), std::f32::consts::TAU * r(4));
                let offset = at - center;
                let petals = 0.62 + 0.38 * (5.0 * offset.y.atan2(offset.x) + turn).cos();
                let inside = size * petals - offset.length();
                let heart = 0.2 * size - offset.length();
                strength = strength.max(smooth(inside / 0.006) * (1.0 - 0.7 * smooth(heart / 0.004)));
            }
        }
        self.base.lerp(self.accent, 0.8 * strength)
    }

    fn boards(&self, at: Vec2) -> Vec3 {
        const WIDTH_M: f32 = 0.145;
        const LENGTH_M: f32 = 1.15;
        let row = (at.y / WIDTH_M).floor();
        let shift = unit(IVec2::new(row as i32, 7), self.seed) * LENGTH_M;
        let along = (at.x + shift) / LENGTH_M;
        let board = IVec2::new(along.floor() as i32, row as i32);
        let tint = 0.72 + 0.5 * unit(board, self.seed ^ 0x9e);
        let grain = fbm(at * Vec2::new(2.2, 38.0) + Vec2::splat(tint * 91.0), self.seed);
        let joint_m = ((at.y / WIDTH_M).fract_gl() - 0.5).abs().mul_add(-WIDTH_M, 0.5 * WIDTH_M);
        let end_m = ((along.fract_gl() - 0.5).abs()).mul_add(-LENGTH_M, 0.5 * LENGTH_M);
        let seam = smooth((joint_m.min(end_m) - 0.002) / 0.003);
        self.base * tint * (0.85 + 0.3 * grain) * (0.45 + 0.55 * seam)
    }

    fn tiles(&self, at: Vec2) -> Vec3 {
        const SIDE_M: f32 = 0.42;
        let cell = (at / SIDE_M).floor().as_ivec2();
        let within = at / SIDE_M - cell.as_vec2();
        let rim_m = SIDE_M * within.min(Vec2::ONE - within).min_element();
        let tint = 0.8 + 0.3 * unit(cell, self.seed);
        let color = if unit(cell, self.seed ^ 3) < 0.25 { self.accent } else { self.base };
        let cloud = 0.85 + 0.3 * fbm(at * 9.0 + Vec2::splat(tint * 50.0), self.seed);
        (color * tint * cloud).lerp(Vec3::splat(0.35), 1.0 - smooth((rim_m - 0.004) / 0.003))
    }

    fn stone(&self, at: Vec2) -> Vec3 {
        let bend = Vec2::new(fbm(at * 3.0, self.seed ^ 5), fbm(at * 3.0, self.seed ^ 6));
        let vein = (fbm(at * 4.0 + bend * 2.0, self.seed) - 0.5).abs();
        self.base.lerp(self.accent, (1.0 - 9.0 * vein).max(0.0))
            * (0.85 + 0.3 * fbm(at * 17.0, self.seed ^ 8))
    }

    fn plaid(&self, at: Vec2) -> Vec3 {
        let band = |t: f32, width: f32| step(width - t.fract_gl());
        let mix = 0.4 * band(at.x * 9.0, 0.5) + 0.4 * band(at.y * 9.0, 0.5);
        let line = 0.5 * (band(at.x * 9.0 + 0.3, 0.08)).max(band(at.y * 9.0 + 0.3, 0.08));
        self.base.lerp(self.accent, mix).lerp(Vec3::ONE, line)
    }

    fn books(&self, at: Vec2) -> Vec3 {
        const SHELF_M: f32 = 0.35;
        let shelf = (at.y / SHELF_M).floor();
        let height = (at.y / SHELF_M).fract_gl() * SHELF_M;
        // Books of two to five centimetres: halve a coarse lattice at a random place.
        let slot = (at.x / 0.07).floor();
        let cell = IVec2::new(slot as i32, shelf as i32);
        let cut = 0.3 + 0.4 * unit(cell, self.seed);
        let within = (at.x / 0.07).fract_gl();
        let side = u32::from(within > cut);
        let r = |k: u32| unit(cell, self.seed.wrapping_add(10 * side + k));
        let edge_m = 0.07 * (within - cut).abs().min(within).min(1.0 - within);
        if height < 0.025 {
            return self.base;
        }
        if height > 0.2 + 0.1 * r(1) || edge_m < 0.0015 || r(5) < 0.08 {
            return self.base * 0.25;
        }
        let color = Vec3::new(r(2), r(3), r(4)) * 0.75 + 0.1;
        let label = (height - 0.12 - 0.06 * r(6)).abs() < 0.014;
        if label { color.lerp(Vec3::ONE, 0.7) } else { color }
    }

    fn poster(&self, at: Vec2) -> Vec3 {
        let within = Vec2::new(at.x.fract_gl(), at.y.fract_gl());
        if within.min(Vec2::ONE - within).min_element() < 0.06 {
            return Vec3::splat(0.93);
        }
        let mut color = self.base;
        for k in 0..14 {
            let r = |j: i32| unit(IVec2::new(k, j), self.seed);
            let offset = within - Vec2::new(r(1), r(2));
            let size = 0.06 + 0.16 * r(3);
            let inside = match (3.0 * r(4)) as i32 {
                0 => offset.length() < size,
                1 => offset.x.abs() < size && offset.y.abs() < 0.5 * size,
                _ => offset.x.abs() + offset.y.abs() < size,
            };
            if inside {
                color = Vec3::new(r(5), r(6), r(7));
            }
        }
        color
    }

    fn cardboard(&self, at: Vec2) -> Vec3 {
        let flutes = 0.96 + 0.08 * (at.y * 900.0).sin();
        let tape = (at.x + 0.02).abs() < 0.03;
        let print = (at - Vec2::new(0.1, 0.08)).abs().max_element() < 0.045
            && unit((at * 90.0).floor().as_ivec2(), self.seed) < 0.5;
        if print {
            self.base * 0.3
        } else if tape {
            self.base.lerp(Vec3::ONE, 0.35)
        } else {
            self.base * flutes
        }
    }
}

/// Hash of a lattice point and a seed to a number from 0 to 1.
pub(super) fn unit(cell: IVec2, seed: u32) -> f32 {
    // Multiply and shift (Wang's and Jenkins' constants): every input bit reaches every output bit.
    let mut h = seed.wrapping_mul(0x9e37_79b9) ^ (cell.x as u32).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d) ^ (cell.y as u32).wrapping_mul(0xc2b2_ae35);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    h = (h ^ (h >> 15)).wrapping_mul(0x1656_67b1);
    (h ^ (h >> 16)) as f32 / u32::MAX as f32
}

/// Smooth noise from 0 to 1 with a lattice of spacing 1.
fn noise(at: Vec2, seed: u32) -> f32 {
    let cell = at.floor();
    let t = at - cell;
    let t = t * t * (Vec2::splat(3.0) - 2.0 * t);
    let corner = |dx: i32, dy: i32| unit(cell.as_ivec2() + IVec2::new(dx, dy), seed);
    let (low, high) = (
        corner(0, 0) + (corner(1, 0) - corner(0, 0)) * t.x,
        corner(0, 1) + (corner(1, 1) - corner(0, 1)) * t.x,
    );
    low + (high - low) * t.y
}

/// Noise of four octaves, from 0 to 1.
fn fbm(at: Vec2, seed: u32) -> f32 {
    let octave = |k: i32| noise(at * 2.0_f32.powi(k), seed.wrapping_add(k as u32)) * 0.5_f32.powi(k + 1);
    (0..4).map(octave).sum::<f32>() / 0.9375
}

/// Smooth step: 0 below 0, 1 above 1.
fn smooth(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn step(t: f32) -> f32 {
    if t > 0.0 { 1.0 } else { 0.0 }
}

trait Fract {
    /// The fractional part, counted upwards also below zero.
    fn fract_gl(self) -> f32;
}

impl Fract for f32 {
    fn fract_gl(self) -> f32 {
        self - self.floor()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Pattern; 12] = [
        Pattern::Plaster,
        Pattern::Wallpaper,
        Pattern::Boards,
        Pattern::Tiles,
        Pattern::Wood,
        Pattern::Stone,
        Pattern::Plaid,
        Pattern::Stripes,
        Pattern::Cloth,
        Pattern::Books,
        Pattern::Poster,
        Pattern::Cardboard,
    ];

    #[test]
    fn every_pattern_is_a_colour_everywhere_and_varies() {
        for pattern in ALL {
            let material = Material {
                base: Vec3::new(0.7, 0.6, 0.5),
                accent: Vec3::new(0.2, 0.3, 0.4),
                pattern,
                seed: 9,
            };
            let samples: Vec<Vec3> = (0..2500)
                .map(|i| material.color(Vec2::new((i % 50) as f32, (i / 50) as f32) * 0.037 - 1.0))
                .collect();
            assert!(samples.iter().all(|c| c.cmpge(Vec3::ZERO).all() && c.cmple(Vec3::ONE).all()));
            let mean = samples.iter().sum::<Vec3>() / samples.len() as f32;
            let deviation =
                (samples.iter().map(|c| c.distance_squared(mean)).sum::<f32>() / samples.len() as f32).sqrt();
            assert!(deviation > 0.02, "{pattern:?} hardly varies: {deviation}");
            let other = Material { seed: 10, ..material };
            assert!((0..50).any(|i| {
                let at = Vec2::splat(0.083 * i as f32);
                other.color(at).distance(material.color(at)) > 0.01
            }));
        }
    }

    #[test]
    fn hashes_are_uniform_and_uncorrelated() {
        let n = 40_000;
        let values: Vec<f32> = (0..n).map(|i| unit(IVec2::new(i % 200 - 100, i / 200), 5)).collect();
        let mean = values.iter().sum::<f32>() / n as f32;
        // The standard deviation of the mean is 0.29 / √n = 0.0014.
        assert!((mean - 0.5).abs() < 0.007, "{mean}");
        let neighbours = values.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum::<f32>() / n as f32;
        assert!(neighbours.abs() < 0.003, "{neighbours}");
    }
}
