//! Walking: each foot is planted on the floor while the body passes over it, then swings to its next place.
//!
//! The gait depends on the distance walked, not on time, so that feet stay where they are planted at any speed and
//! around corners. Legs follow from the feet by inverse kinematics of two bones.

use glam::{Vec2, Vec3};

use super::proportions::{ANKLE, HIP, HIP_HALF_WIDTH, SHANK, SOLE, THIGH};

/// Length of a step as a share of the height.
const STEP: f32 = 0.37;
/// Distance of the body past a planted foot at which the foot leaves the floor, in steps.
const LEAVES: f32 = 0.72;
/// Distance of the body before a foot at which the foot lands, in steps.
const LANDS: f32 = 0.46;
/// Distance of the body past a foot at which the heel begins to rise, in steps.
const HEEL_RISES: f32 = 0.25;
/// Pitch of a foot when it leaves the floor.
const TOE_OFF_RAD: f32 = 0.75;
/// Distance from the ankle forward to the ball of the foot, and back to the heel.
const BALL: f32 = 0.085;
const HEEL: f32 = 0.028;
/// Height of the hips above the floor on a seat.
const SEATED_HIP: f32 = 0.285;
/// Height to which a swinging foot is lifted.
const LIFT: f32 = 0.035;

/// The angles of an arm.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Arm {
    /// Forwards from hanging down.
    pub shoulder_rad: f32,
    /// Further forwards.
    pub elbow_rad: f32,
}

/// The joints of a leg.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Leg {
    pub hip: Vec3,
    pub knee: Vec3,
    pub ankle: Vec3,
    /// Centres of the spheres that end the foot.
    pub heel: Vec3,
    pub toe: Vec3,
}

/// A body's pose.
#[derive(Debug, Clone)]
pub(super) struct BodyPose {
    /// Middle between the hip joints.
    pub pelvis: Vec3,
    /// Direction that the body faces; 0 is +x.
    pub heading_rad: f32,
    /// Angle by which the trunk leans forwards.
    pub lean_rad: f32,
    /// Left, right.
    pub arms: [Arm; 2],
    /// Left, right.
    pub legs: [Leg; 2],
}

/// A line on the floor that a person walks along: place and direction after a distance of `way_m` metres, also before
/// its beginning and beyond its end.
pub(super) trait WalkedLine {
    fn at(&self, way_m: f32) -> (Vec2, Vec2);
}

impl BodyPose {
    /// Standing still with both feet beside each other.
    #[cfg(test)]
    pub(super) fn standing(at: Vec2, heading_rad: f32, height_m: f32) -> Self {
        struct Standing(Vec2, Vec2);
        impl WalkedLine for Standing {
            fn at(&self, _: f32) -> (Vec2, Vec2) {
                (self.0, self.1)
            }
        }
        Self::walking(&Standing(at, Vec2::from_angle(heading_rad)), 0.0, 0.0, height_m)
    }

    /// Pose after a distance of `way_m` at a given speed, of a person of that height.
    pub(super) fn walking(way: &impl WalkedLine, way_m: f32, speed_m_s: f32, height_m: f32) -> Self {
        // Strength of the gait: people who hardly move do not lift their feet.
        let vigour = (speed_m_s / 0.5).clamp(0.0, 1.0);
        let (at, direction) = way.at(way_m);
        let forward = direction.extend(0.0);
        let left = direction.perp().extend(0.0);
        let feet = [0, 1].map(|side| Foot::new(way, way_m, side, vigour, height_m));
        // Height of the hips that the legs can reach: knees never quite straight.
        let reach = 0.992 * (THIGH + SHANK) * height_m;
        let hip_place = |side: usize| at.extend(0.0) + left * ([1.0, -1.0][side] * HIP_HALF_WIDTH * height_m);
        let highest = (HIP - 0.004) * height_m;
        let hip_z = [0, 1].into_iter().fold(highest, |z, side| {
            let ankle = feet[side].ankle;
            let across = (ankle - hip_place(side)).truncate().length_squared();
            z.min(ankle.z + (reach * reach - across).max(0.0).sqrt())
        });
        let legs = [0, 1].map(|side| {
            let hip = hip_place(side).with_z(hip_z);
            feet[side].leg(hip, forward, height_m)
        });
        // The left arm is ahead half a step after the left foot was below the body: when the right foot is ahead.
        let swing = 0.5 * vigour * (std::f32::consts::PI * way_m / (STEP * height_m)).sin();
        let arm = |angle: f32| Arm { shoulder_rad: angle, elbow_rad: 0.18 + 0.5 * angle.max(0.0) };
        Self {
            pelvis: at.extend(hip_z),
            heading_rad: direction.to_angle(),
            lean_rad: 0.06 * vigour,
            arms: [arm(swing), arm(-swing)],
            legs,
        }
    }

    /// The pose `share` of the way down to a seat below the pelvis: thighs level, shanks upright, hands on the knees.
    pub(super) fn seated(mut self, share: f32, height_m: f32) -> Self {
        let down = share * (self.pelvis.z - SEATED_HIP * height_m);
        let forward = Vec2::from_angle(self.heading_rad);
        self.pelvis.z -= down;
        self.lean_rad *= 1.0 - share;
        for leg in &mut self.legs {
            let hip = leg.hip - Vec3::Z * down;
            let ball = (hip.truncate() + forward * ((THIGH + BALL) * height_m)).extend(leg.toe.z);
            let floor = Foot::around_ball(leg.toe.lerp(ball, share).truncate(), forward, 0.0, 0.0, height_m);
            *leg = floor.leg(hip, forward.extend(0.0), height_m);
        }
        for arm in &mut self.arms {
            arm.shoulder_rad += share * (0.5 - arm.shoulder_rad);
            arm.elbow_rad += share * (0.8 - arm.elbow_rad);
        }
        self
    }
}

/// Position of a foot.
struct Foot {
    ankle: Vec3,
    heel: Vec3,
    toe: Vec3,
}

impl Foot {
    /// Left (0) or right (1) foot after the body has come `way_m` metres.
    fn new(way: &impl WalkedLine, way_m: f32, side: usize, vigour: f32, height_m: f32) -> Self {
        let step = STEP * height_m;
        // Left feet are planted at even numbers of steps, right ones at odd.
        let steps = way_m / step - side as f32;
        let planted = 2.0 * (0.5 * (steps + LANDS)).floor();
        let past = steps - planted;
        let outwards = [1.0, -1.0][side] * 0.8 * HIP_HALF_WIDTH * height_m;
        let place = |number: f32| {
            let (at, direction) = way.at((number + side as f32) * step);
            (at + direction * (BALL * height_m) + direction.perp() * outwards, direction)
        };
        let (ball, direction) = place(planted);
        if past <= LEAVES {
            let rise = ((past - HEEL_RISES) / (LEAVES - HEEL_RISES)).clamp(0.0, 1.0);
            return Self::around_ball(ball, direction, 0.0, vigour * TOE_OFF_RAD * rise * rise, height_m);
        }
        let (next, next_direction) = place(planted + 2.0);
        let progress = ((past - LEAVES) / (2.0 - LANDS - LEAVES)).clamp(0.0, 1.0);
        let eased = progress * progress * (3.0 - 2.0 * progress);
        let lift = vigour * LIFT * height_m * (std::f32::consts::PI * progress).sin();
        let pitch = vigour * TOE_OFF_RAD * (1.0 - 1.6 * progress).max(0.0).powi(2);
        let direction = direction.lerp(next_direction, eased).normalize_or(next_direction);
        Self::around_ball(ball.lerp(next, eased), direction, lift, pitch, height_m)
    }

    /// The foot whose ball is at a place, turned up behind it by `pitch`.
    fn around_ball(ball: Vec2, direction: Vec2, lift: f32, pitch: f32, height_m: f32) -> Self {
        let sole = SOLE * height_m;
        let toe = ball.extend(sole + lift);
        let forward = direction.extend(0.0);
        let behind = |back: f32, up: f32| {
            let (sin, cos) = pitch.sin_cos();
            toe + forward * (height_m * (up * sin - back * cos))
                + Vec3::Z * (height_m * (back * sin + up * cos))
        };
        // The foot pitches about its ball: the parts behind it rise.
        Self { ankle: behind(BALL, ANKLE - SOLE), heel: behind(BALL + HEEL, 0.001), toe }
    }

    /// The leg from a hip joint to this foot, the knee bent forwards.
    fn leg(&self, hip: Vec3, forward: Vec3, height_m: f32) -> Leg {
        let (thigh, shank) = (THIGH * height_m, SHANK * height_m);
        let along = self.ankle - hip;
        let length = along.length().clamp(1e-3, 0.9999 * (thigh + shank));
        let direction = along.normalize_or(Vec3::NEG_Z);
        // The knee's place along the leg and off it: two circles' intersection.
        let share = (length * length + thigh * thigh - shank * shank) / (2.0 * length);
        let off = (thigh * thigh - share * share).max(0.0).sqrt();
        let bend = (forward - direction * forward.dot(direction)).normalize_or_zero();
        let knee = hip + direction * share + bend * off;
        Leg { hip, knee, ankle: self.ankle, heel: self.heel, toe: self.toe }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of 2 m radius.
    struct Circle;
    impl WalkedLine for Circle {
        fn at(&self, way_m: f32) -> (Vec2, Vec2) {
            let angle = way_m / 2.0;
            (2.0 * Vec2::from_angle(angle), Vec2::from_angle(angle).perp())
        }
    }

    #[test]
    fn feet_stay_above_the_floor_and_where_they_are_planted() {
        let height = 1.75;
        let (mut planted, mut fastest) = (0, 0.0_f32);
        let poses: Vec<BodyPose> =
            (0..4000).map(|i| BodyPose::walking(&Circle, i as f32 * 0.002, 1.3, height)).collect();
        for pair in poses.windows(2) {
            for side in 0..2 {
                let (a, b) = (pair[0].legs[side], pair[1].legs[side]);
                for end in [b.toe, b.heel] {
                    assert!(end.z >= SOLE * height - 1e-5, "a foot sinks to {}", end.z - SOLE * height);
                }
                let moved = a.toe.distance(b.toe);
                let on_floor = a.toe.z <= SOLE * height + 1e-6 && b.toe.z <= SOLE * height + 1e-6;
                if on_floor {
                    planted += 1;
                    assert!(moved < 1e-5, "a planted foot slides {moved}");
                }
                fastest = fastest.max(moved / 0.002);
            }
        }
        // Each foot is on the floor for (0.72 + 0.46) / 2 of the time, and swings at a few times the body's speed.
        let share = f64::from(planted) / (2.0 * 3999.0);
        assert!((share - 0.59).abs() < 0.02, "{share}");
        assert!(fastest < 5.0, "a foot moves {fastest} times as fast as the body");
    }

    #[test]
    fn bones_keep_their_length_and_joints_move_smoothly() {
        let height = 1.6;
        let poses: Vec<BodyPose> =
            (0..2000).map(|i| BodyPose::walking(&Circle, i as f32 * 0.004, 1.2, height)).collect();
        let mut lowest = f32::MAX;
        for pair in poses.windows(2) {
            for (before, leg) in pair[0].legs.iter().zip(&pair[1].legs) {
                assert!((leg.hip.distance(leg.knee) - THIGH * height).abs() < 2e-3);
                assert!((leg.knee.distance(leg.ankle) - SHANK * height).abs() < 2e-3);
                assert!(before.knee.distance(leg.knee) < 0.06, "{}", before.knee.distance(leg.knee));
                assert!(before.ankle.distance(leg.ankle) < 0.03);
            }
            lowest = lowest.min(pair[0].pelvis.z);
        }
        // The pelvis bobs by a few centimetres.
        assert!(lowest > (HIP - 0.045) * height, "{} of {}", lowest / height, HIP);
    }

    #[test]
    fn a_seated_person_keeps_the_bones_lengths_and_both_soles_on_the_floor() {
        let height = 1.75;
        for share in [0.25, 0.5, 0.75, 1.0] {
            let pose = BodyPose::standing(Vec2::new(1.0, 2.0), 0.6, height).seated(share, height);
            for leg in &pose.legs {
                assert!((leg.hip.distance(leg.knee) - THIGH * height).abs() < 2e-3);
                assert!((leg.knee.distance(leg.ankle) - SHANK * height).abs() < 2e-3);
                assert!((leg.toe.z - SOLE * height).abs() < 1e-5);
                if share > 0.99 {
                    assert!((leg.knee.z - leg.hip.z).abs() < 0.02, "the thighs are level");
                    assert!((leg.knee - leg.ankle).truncate().length() < 0.05, "the shanks are upright");
                }
            }
        }
    }

    #[test]
    fn a_standing_person_has_both_soles_on_the_floor() {
        let pose = BodyPose::standing(Vec2::new(1.0, 2.0), 1.1, 1.8);
        for leg in &pose.legs {
            assert!((leg.heel.z - leg.toe.z).abs() < 0.01);
            assert!(leg.knee.distance(leg.hip.lerp(leg.ankle, 0.5)) < 0.08);
        }
        assert!((pose.pelvis.truncate() - Vec2::new(1.0, 2.0)).length() < 1e-5);
    }
}
