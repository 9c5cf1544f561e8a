//! A person's body: a head, a torso, arms and legs of ellipsoids and tapered capsules, in textured clothes.
//!
//! Deliberately unlike the single upright ellipsoid by which trackers model people.

use glam::{Quat, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::furniture::colourful;
use super::gait::BodyPose;
use super::proportions::{HIP, SOLE};
use super::shape::Shape;
use super::texture::{Material, Pattern};

/// Appearance of a person.
#[derive(Debug, Clone)]
pub struct Body {
    /// Standing height.
    pub height_m: f64,
    /// Stoutness: 1 is average.
    girth: f32,
    shirt: Material,
    trousers: Material,
    skin: Material,
    hair: Material,
    shoes: Material,
    long_sleeves: bool,
}

/// A part of a body.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyPart {
    pub shape: Shape,
    pub material: Material,
}

impl Body {
    /// A random person.
    pub(super) fn random(rng: &mut Pcg64Mcg) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(rng.random());
        let clothes = [Pattern::Cloth, Pattern::Stripes, Pattern::Plaid, Pattern::Cloth];
        let shirt = colourful(clothes[rng.random_range(0..clothes.len())], &mut rng);
        let mut trousers = colourful(Pattern::Cloth, &mut rng);
        trousers.base = trousers.base.lerp(Vec3::splat(0.25), 0.6) * rng.random_range(0.45..1.0);
        let plain = |base: Vec3, seed: u32| Material { base, accent: base, pattern: Pattern::Cloth, seed };
        let skin = Vec3::new(0.86, 0.66, 0.53).lerp(Vec3::new(0.36, 0.23, 0.16), rng.random_range(0.0..1.0));
        let hair = Vec3::new(0.08, 0.06, 0.05).lerp(Vec3::new(0.55, 0.42, 0.25), rng.random_range(0.0..1.0));
        Self {
            height_m: rng.random_range(1.55..1.92),
            girth: rng.random_range(0.9..1.15),
            shirt,
            trousers,
            skin: plain(skin, rng.random()),
            hair: plain(hair, rng.random()),
            shoes: plain(Vec3::splat(rng.random_range(0.05..0.4)), rng.random()),
            long_sleeves: rng.random_bool(0.6),
        }
    }

    /// Middle of the head in a pose: half-way between chin and crown, skin and hair together.
    pub(super) fn head(&self, pose: &BodyPose) -> Vec3 {
        self.frame(pose)(0.003, 0.0, 0.932)
    }

    /// Map to the room from the body's own frame, in shares of the height (x forwards, y to its left, z up, the floor
    /// below the pelvis at the origin).
    fn frame(&self, pose: &BodyPose) -> impl Fn(f32, f32, f32) -> Vec3 {
        let h = self.height_m as f32;
        let turn = Quat::from_rotation_z(pose.heading_rad);
        let lean = Quat::from_rotation_y(pose.lean_rad);
        let pelvis = pose.pelvis;
        move |x, y, z| pelvis + turn * (lean * (Vec3::new(x, y, z - HIP) * h))
    }

    /// The parts of the body in a pose.
    pub(super) fn parts(&self, pose: &BodyPose) -> Vec<BodyPart> {
        let h = self.height_m as f32;
        let g = h * self.girth;
        let turn = Quat::from_rotation_z(pose.heading_rad);
        let lean = Quat::from_rotation_y(pose.lean_rad);
        let at = self.frame(pose);
        let mut parts = Vec::with_capacity(20);
        let mut ellipsoid = |center: Vec3, axes: Vec3, material: Material| {
            parts.push(BodyPart { shape: Shape::Ellipsoid { center, axes, turn: turn * lean }, material });
        };
        ellipsoid(at(0.0, 0.0, 0.525), Vec3::new(0.07, 0.098, 0.075) * g, self.trousers);
        ellipsoid(at(0.003, 0.0, 0.615), Vec3::new(0.066, 0.09, 0.095) * g, self.shirt);
        ellipsoid(at(0.0, 0.0, 0.725), Vec3::new(0.072, 0.108, 0.12) * g, self.shirt);
        ellipsoid(at(0.012, 0.0, 0.93), Vec3::new(0.056, 0.046, 0.066) * h, self.skin);
        ellipsoid(at(-0.006, 0.0, 0.942), Vec3::new(0.056, 0.05, 0.058) * h, self.hair);
        let mut capsule = |a: Vec3, b: Vec3, radius_a: f32, radius_b: f32, material: Material| {
            parts.push(BodyPart { shape: Shape::Capsule { a, b, radius_a, radius_b }, material });
        };
        capsule(at(0.0, 0.0, 0.79), at(0.006, 0.0, 0.89), 0.034 * g, 0.028 * h, self.skin);
        capsule(at(0.0, 0.09, 0.795), at(0.0, -0.09, 0.795), 0.042 * g, 0.042 * g, self.shirt);
        let forearm = if self.long_sleeves { self.shirt } else { self.skin };
        for (side, arm) in [(1.0_f32, pose.arms[0]), (-1.0, pose.arms[1])] {
            let shoulder = at(0.0, side * 0.118, 0.8);
            let hang =
                |angle: f32| turn * (lean * Vec3::new(angle.sin(), side * 0.08, -angle.cos()).normalize());
            let elbow = shoulder + hang(arm.shoulder_rad) * (0.175 * h);
            let wrist = elbow + hang(arm.shoulder_rad + arm.elbow_rad) * (0.15 * h);
            let hand = wrist + hang(arm.shoulder_rad + arm.elbow_rad) * (0.05 * h);
            capsule(shoulder, elbow, 0.032 * g, 0.026 * g, self.shirt);
            capsule(elbow, wrist, 0.025 * g, 0.018 * g, forearm);
            capsule(wrist, hand, 0.02 * h, 0.022 * h, self.skin);
        }
        for leg in &pose.legs {
            capsule(leg.hip, leg.knee, 0.056 * g, 0.036 * g, self.trousers);
            capsule(leg.knee, leg.ankle, 0.035 * g, 0.024 * g, self.trousers);
            capsule(leg.heel, leg.toe, SOLE * 1.05 * h, SOLE * h, self.shoes);
            capsule(leg.ankle, leg.heel, 0.024 * h, SOLE * 1.05 * h, self.shoes);
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    #[test]
    fn a_standing_body_is_as_tall_as_it_says_and_stands_on_the_floor() {
        for seed in 0..20 {
            let body = Body::random(&mut Pcg64Mcg::seed_from_u64(seed));
            let pose = BodyPose::standing(Vec2::new(1.0, 2.0), 0.7, body.height_m as f32);
            let (mut top, mut bottom) = (f32::MIN, f32::MAX);
            for part in body.parts(&pose) {
                match part.shape {
                    Shape::Capsule { a, b, radius_a, radius_b } => {
                        top = top.max(a.z + radius_a).max(b.z + radius_b);
                        bottom = bottom.min(a.z - radius_a).min(b.z - radius_b);
                    }
                    Shape::Ellipsoid { center, axes, .. } => top = top.max(center.z + axes.z),
                }
            }
            assert!((f64::from(top) - body.height_m).abs() < 0.03, "{top} instead of {}", body.height_m);
            assert!(bottom.abs() < 0.01, "{bottom}");
            // A head measures 0.136 of the height.
            let head = f64::from(body.head(&pose).z);
            assert!((head + 0.068 * body.height_m - f64::from(top)).abs() < 0.03, "{head} below {top}");
        }
    }
}
