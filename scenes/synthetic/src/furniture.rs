//! Furniture made of boxes, each standing on the floor at a place and turned about the vertical.

use glam::{Vec2, Vec3};
use nalgebra::Point2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::texture::{Material, Pattern};
use scenes::polygon::Polygon;

/// A box; every side has the same material.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    pub center: Vec3,
    pub half: Vec3,
    pub yaw: f32,
    pub material: Material,
    /// Material of the sides at −y, if it differs: the front of a shelf.
    pub front: Option<Material>,
}

/// A piece of furniture.
#[derive(Debug, Clone)]
pub struct Furniture {
    /// Kind of piece.
    pub name: &'static str,
    /// Floor that the piece occupies for a person (a table with its legs and the space between).
    pub footprint: Polygon,
    /// Height of the piece.
    pub height_m: f64,
    pub(super) blocks: Vec<Block>,
}

/// Kinds of furniture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Table,
    Chair,
    Sofa,
    Shelf,
    Cabinet,
    Pillar,
    Boxes,
}

impl Kind {
    /// Width, depth and height.
    pub(super) fn size(self, room_height: f32, rng: &mut Pcg64Mcg) -> Vec3 {
        let mut about = |value: f32, share: f32| value * (1.0 + share * rng.random_range(-1.0..1.0));
        match self {
            Self::Table => Vec3::new(about(1.35, 0.25), about(0.8, 0.15), about(0.74, 0.03)),
            Self::Chair => Vec3::new(0.46, 0.46, about(0.92, 0.05)),
            Self::Sofa => Vec3::new(about(1.8, 0.15), about(0.85, 0.06), about(0.82, 0.06)),
            Self::Shelf => Vec3::new(about(1.3, 0.3), 0.36, about(1.8, 0.12)),
            Self::Cabinet => Vec3::new(about(1.2, 0.3), about(0.5, 0.1), about(1.0, 0.2)),
            Self::Pillar => {
                let side = about(0.34, 0.15);
                Vec3::new(side, side, room_height)
            }
            Self::Boxes => Vec3::new(about(0.5, 0.2), about(0.42, 0.2), about(0.5, 0.4)),
        }
    }

    /// Tells whether the piece stands with its back (+y) against a wall.
    pub(super) fn wants_wall(self) -> bool {
        matches!(self, Self::Sofa | Self::Shelf | Self::Cabinet | Self::Boxes)
    }
}

impl Furniture {
    /// Builds a piece around a place on the floor.
    pub(super) fn new(kind: Kind, size: Vec3, at: Vec2, yaw: f32, rng: &mut Pcg64Mcg) -> Self {
        let mut builder = Builder { blocks: Vec::new(), at, yaw };
        let name = match kind {
            Kind::Table => builder.table(size, rng),
            Kind::Chair => builder.chair(size, rng),
            Kind::Sofa => builder.sofa(size, rng),
            Kind::Shelf => builder.shelf(size, rng),
            Kind::Cabinet => builder.cabinet(size, rng),
            Kind::Pillar => builder.pillar(size, rng),
            Kind::Boxes => builder.boxes(size, rng),
        };
        let corner = |x: f32, y: f32| {
            let p = at + Vec2::from_angle(yaw).rotate(Vec2::new(x * size.x, y * size.y) * 0.5);
            Point2::new(f64::from(p.x), f64::from(p.y))
        };
        Self {
            name,
            footprint: Polygon(vec![
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
            ]),
            height_m: f64::from(size.z),
            blocks: builder.blocks,
        }
    }
}

/// An upright board that stands on the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct Screen {
    /// Middle of the board on the floor.
    pub middle: Point2<f64>,
    /// Direction of the width; 0 is along x.
    pub yaw_deg: f64,
    /// Width.
    pub width_m: f64,
    /// Height.
    pub height_m: f64,
}

impl Screen {
    /// Builds the board; `seed` decides its colours.
    pub(super) fn furniture(&self, seed: u64) -> Furniture {
        const THICKNESS_M: f64 = 0.05;
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ self.middle.x.to_bits() ^ self.middle.y.to_bits());
        let half = Vec3::new(0.5 * self.width_m as f32, 0.5 * THICKNESS_M as f32, 0.5 * self.height_m as f32);
        let (at, yaw) =
            (Vec2::new(self.middle.x as f32, self.middle.y as f32), self.yaw_deg.to_radians() as f32);
        let mut builder = Builder { blocks: Vec::new(), at, yaw };
        builder.block(-half.with_z(0.0), half.with_z(2.0 * half.z), colourful(Pattern::Cloth, &mut rng));
        let corner = |x: f32, y: f32| {
            let p = at + Vec2::from_angle(yaw).rotate(Vec2::new(x * half.x, y * half.y));
            Point2::new(f64::from(p.x), f64::from(p.y))
        };
        Furniture {
            name: "screen",
            footprint: Polygon(
                [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| corner(x, y)).to_vec(),
            ),
            height_m: self.height_m,
            blocks: builder.blocks,
        }
    }
}

struct Builder {
    blocks: Vec<Block>,
    at: Vec2,
    yaw: f32,
}

impl Builder {
    /// A box between two corners in the piece's own frame: x to its right, y to its back, z up.
    fn block(&mut self, low: Vec3, high: Vec3, material: Material) {
        let middle = 0.5 * (low + high);
        let place = self.at + Vec2::from_angle(self.yaw).rotate(middle.truncate());
        self.blocks.push(Block {
            center: place.extend(middle.z),
            half: 0.5 * (high - low),
            yaw: self.yaw,
            material,
            front: None,
        });
    }

    fn legs(&mut self, size: Vec3, thickness: f32, top: f32, material: Material) {
        for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let a = Vec2::new(sx, sy) * (0.5 * size.truncate() - Vec2::splat(0.02));
            let b = Vec2::new(sx, sy) * (0.5 * size.truncate() - Vec2::splat(0.02 + thickness));
            self.block(a.min(b).extend(0.0), a.max(b).extend(top), material);
        }
    }

    fn table(&mut self, size: Vec3, rng: &mut Pcg64Mcg) -> &'static str {
        let (half, wood) = (0.5 * size, wood(rng));
        self.block(Vec3::new(-half.x, -half.y, size.z - 0.05), half.with_z(size.z), wood);
        self.legs(size, 0.06, size.z - 0.05, wood);
        // A few things on the table.
        for _ in 0..rng.random_range(2..5) {
            let reach = half.truncate() - Vec2::splat(0.18);
            let at = Vec2::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)) * reach;
            let thing = Vec3::new(
                rng.random_range(0.04..0.13),
                rng.random_range(0.04..0.1),
                rng.random_range(0.03..0.28),
            );
            let low = (at - thing.truncate()).extend(size.z);
            self.block(
                low,
                (at + thing.truncate()).extend(size.z + thing.z),
                colourful(Pattern::Poster, rng),
            );
        }
        "table"
    }

    fn chair(&mut self, size: Vec3, rng: &mut Pcg64Mcg) -> &'static str {
        let (half, cloth) = (0.5 * size, colourful(Pattern::Cloth, rng));
        self.block(Vec3::new(-half.x, -half.y, 0.43), Vec3::new(half.x, half.y, 0.48), cloth);
        self.block(Vec3::new(-half.x, half.y - 0.05, 0.55), half.with_z(size.z), cloth);
        let dark = wood(rng);
        self.legs(size, 0.04, 0.43, dark);
        for side in [-1.0, 1.0] {
            let x = side * (half.x - 0.03);
            self.block(
                Vec3::new(x - 0.015, half.y - 0.04, 0.48),
                Vec3::new(x + 0.015, half.y - 0.01, 0.55),
                dark,
            );
        }
        "chair"
    }

    fn sofa(&mut self, size: Vec3, rng: &mut Pcg64Mcg) -> &'static str {
        let half = 0.5 * size;
        let cloth = colourful(if rng.random_bool(0.5) { Pattern::Plaid } else { Pattern::Cloth }, rng);
        self.block(Vec3::new(-half.x, -half.y, 0.06), Vec3::new(half.x, half.y, 0.4), cloth);
        self.block(Vec3::new(-half.x, half.y - 0.22, 0.4), half.with_z(size.z), cloth);
        for side in [-1.0, 1.0] {
            let (a, b) = (side * half.x, side * (half.x - 0.18));
            self.block(Vec3::new(a.min(b), -half.y, 0.4), Vec3::new(a.max(b), half.y - 0.22, 0.6), cloth);
        }
        let cushion = colourful(Pattern::Stripes, rng);
        self.block(Vec3::new(-0.5, half.y - 0.36, 0.4), Vec3::new(-0.12, half.y - 0.22, 0.7), cushion);
        "sofa"
    }

    fn shelf(&mut self, size: Vec3, rng: &mut Pcg64Mcg) -> &'static str {
        let half = 0.5 * size;
        let books = Material { pattern: Pattern::Books, ..wood(rng) };
        self.block(-half.with_z(0.0), half.with_z(size.z), Material { pattern: Pattern::Wood, ..books });
        if let Some(block) = self.blocks.last_mut() {
            block.front = Some(books);
        }
        "shelf"
    }

    fn cabinet(&mut self, size: Vec3, rng: &mut Pcg64Mcg) -> &'static str {
        let (half, wood) = (0.5 * size, wood(rng));
        self.block(-half.with_z(0.0), half.with_z(size.z), wood);
        // Handles and door seams make edges.
        for side in [-0.5, 0.5] {
            let x = side * half.x;
            self.block(
                Vec3::new(x - 0.01, -half.y - 0.02, 0.5 * size.z),
                Vec3::new(x + 0.01, -half.y, 0.5 * size.z + 0.14),
                Material { base: Vec3::splat(0.8), ..wood },
            );
        }
        "cabinet"
    }

    fn pillar(&mut self, size: Vec3, rng: &mut Pcg64Mcg) -> &'static str {
        let stone = Material {
            base: Vec3::new(0.78, 0.74, 0.7),
            accent: Vec3::new(0.45, 0.4, 0.38),
            pattern: Pattern::Stone,
            seed: rng.random(),
        };
        self.block(-(0.5 * size).with_z(0.0), (0.5 * size).with_z(size.z), stone);
        "pillar"
    }

    fn boxes(&mut self, size: Vec3, rng: &mut Pcg64Mcg) -> &'static str {
        let half = 0.5 * size;
        let card = |rng: &mut Pcg64Mcg| Material {
            base: Vec3::new(0.72, 0.55, 0.36),
            accent: Vec3::ONE,
            pattern: Pattern::Cardboard,
            seed: rng.random(),
        };
        let first = card(rng);
        self.block(-half.with_z(0.0), half.with_z(0.6 * size.z), first);
        self.yaw += 0.25;
        let second = card(rng);
        self.block((-0.7 * half).with_z(0.6 * size.z), (0.7 * half).with_z(size.z), second);
        self.yaw -= 0.25;
        "boxes"
    }
}

/// A random wood.
pub(super) fn wood(rng: &mut Pcg64Mcg) -> Material {
    let tone = rng.random_range(0.35..1.0_f32);
    let base = Vec3::new(0.75, 0.55, 0.36) * tone;
    Material { base, accent: base * 0.6, pattern: Pattern::Wood, seed: rng.random() }
}

/// Two matching colours in some pattern.
pub(super) fn colourful(pattern: Pattern, rng: &mut Pcg64Mcg) -> Material {
    let hue = rng.random_range(0.0..1.0_f32);
    let color = |hue: f32, value: f32| {
        let channel = |shift: f32| 0.5 + 0.5 * (std::f32::consts::TAU * (hue + shift)).cos();
        value * (0.25 + 0.75 * Vec3::new(channel(0.0), channel(0.33), channel(0.67)))
    };
    let (base, accent) = (color(hue, rng.random_range(0.45..0.85)), color(hue + 0.4, 0.7));
    Material { base, accent, pattern, seed: rng.random() }
}
