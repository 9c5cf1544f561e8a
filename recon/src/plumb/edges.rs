//! Straight edges in a capture's pictures. Each is the image of a line somewhere in the plane through it and the
//! camera's centre, its interpretation plane (S. T. Barnard, "Interpreting perspective images", Artificial Intelligence
//! 21, 1983); a single picture determines only that the line's direction is perpendicular to this plane's normal.
//!
//! An edge's own direction is that of the structure tensor (J. Bigün, G. H. Granlund, "Optimal orientation detection of
//! linear symmetry", ICCV 1987), the mean over a few pixels: one gradient alone is off by degrees, and more so the
//! weaker the edge, towards whatever lies beside it.

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::{Isometry3, Point2, Vector2, Vector3};
use rayon::prelude::*;

use crate::features::Intensity;

/// Number of pictures used, spread evenly over the capture: neighbours show much the same.
const PICTURES: usize = 12;
/// Size above which pictures are halved, pixels: edges are then of similar length, and memory is limited.
const LARGEST_PX: usize = 1000;
/// Largest number of edge pixels of a picture, spread evenly over it.
const MOST: usize = 1500;
/// Least gradient of an edge, grey levels a pixel, above a sensor's noise.
const LEAST_GRADIENT: f32 = 4.0;
/// Standard deviation of the averaging of gradients, pixels.
const AVERAGED_PX: f32 = 2.0;
/// Least coherence of the averaged gradients: 1 where all are parallel, 0 without a direction.
const COHERENT: f32 = 0.9;
/// Least length of an edge, pixels: shorter ones belong to patterns and things, with any direction.
const LEAST_RUN_PX: usize = 24;
/// Largest sine of the angle between the directions of pixels of one edge.
const STRAIGHT: f32 = 0.1;

/// Unit normals of the interpretation planes of a capture's edges, one an edge pixel, in the world's frame. Frames
/// without a pose are left out.
pub fn of_capture(
    frames: &[RgbImage],
    lens: &Intrinsics,
    camera_from_world: &[Option<Isometry3<f64>>],
) -> Vec<Vector3<f64>> {
    let posed: Vec<(&RgbImage, &Isometry3<f64>)> =
        frames.iter().zip(camera_from_world).filter_map(|(f, pose)| Some((f, pose.as_ref()?))).collect();
    let taken = evenly(posed.len(), PICTURES).collect::<Vec<usize>>();
    let of_picture = |index: usize| {
        let (picture, pose) = posed[index];
        let world_from_camera = pose.rotation.inverse();
        let edges = of_size(Intensity::new(picture));
        let chosen = evenly(edges.len(), MOST).filter_map(|k| edges[k].plane(lens));
        chosen.map(|normal| world_from_camera * normal).collect::<Vec<_>>()
    };
    taken.into_par_iter().map(of_picture).collect::<Vec<_>>().concat()
}

/// Edges of a picture, after halving it to the size limit.
fn of_size(mut picture: Intensity) -> Vec<EdgePixel> {
    let mut px = 1.0;
    while picture.width.max(picture.height) > LARGEST_PX {
        picture = picture.halved();
        px *= 2.0;
    }
    let middle = Vector2::repeat(0.5);
    let whole = |edge: EdgePixel| EdgePixel { pixel: (edge.pixel + middle) * px - middle, ..edge };
    in_picture(&picture).into_iter().map(whole).collect()
}

/// At most `most` of `count` indices, evenly spread, the last among them.
fn evenly(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let taken = count.min(most);
    (1..=taken).map(move |k| k * count / taken - 1)
}

/// A pixel on an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
struct EdgePixel {
    pixel: Point2<f64>,
    /// Unit vector along the edge.
    along: Vector2<f64>,
}

impl EdgePixel {
    /// Unit normal of its interpretation plane, in the camera's frame; `None` where the lens has no image.
    fn plane(&self, lens: &Intrinsics) -> Option<Vector3<f64>> {
        let [before, after] = [-1.0, 1.0].map(|way| lens.unproject(&(self.pixel + way * self.along)));
        before?.cross(&after?).try_normalize(0.0)
    }
}

/// Derivatives of brightness to the right and downwards, by H. Scharr's operator ("Optimale Operatoren in der Digitalen
/// Bildverarbeitung", 2000), whose directions are accurate at all angles; the border repeats.
fn gradients(picture: &Intensity) -> (Intensity, Intensity) {
    const SIDE: f32 = 3.0 / 32.0;
    const MIDDLE: f32 = 10.0 / 32.0;
    let (width, height) = (picture.width, picture.height);
    let of = |difference: fn(&Intensity, usize, usize) -> f32| {
        Intensity::from_fn(width, height, |x, y| {
            difference(picture, x.clamp(1, width - 2), y.clamp(1, height - 2))
        })
    };
    let across = of(|p, x, y| {
        let at = |y: usize| p.pixel(x + 1, y) - p.pixel(x - 1, y);
        SIDE * (at(y - 1) + at(y + 1)) + MIDDLE * at(y)
    });
    let down = of(|p, x, y| {
        let at = |x: usize| p.pixel(x, y + 1) - p.pixel(x, y - 1);
        SIDE * (at(x - 1) + at(x + 1)) + MIDDLE * at(x)
    });
    (across, down)
}

/// Edge pixels of a picture, where brightness changes fastest across a straight edge, row by row.
fn in_picture(picture: &Intensity) -> Vec<EdgePixel> {
    let (width, height) = (picture.width, picture.height);
    if width < 3 || height < 3 {
        return Vec::new();
    }
    let (across, down) = gradients(picture);
    let averaged = |a: &Intensity, b: &Intensity| {
        Intensity::from_fn(width, height, |x, y| a.pixel(x, y) * b.pixel(x, y)).smoothed(AVERAGED_PX)
    };
    let (xx, xy, yy) = (averaged(&across, &across), averaged(&across, &down), averaged(&down, &down));
    let squared = |x: usize, y: usize| across.pixel(x, y).powi(2) + down.pixel(x, y).powi(2);
    // Angle across each pixel's edge; NaN where there is none.
    let angle = Intensity::from_fn(width, height, |x, y| {
        let (difference, twice) = (xx.pixel(x, y) - yy.pixel(x, y), 2.0 * xy.pixel(x, y));
        let is_edge = squared(x, y) >= LEAST_GRADIENT * LEAST_GRADIENT
            && difference.hypot(twice) >= COHERENT * (xx.pixel(x, y) + yy.pixel(x, y));
        if is_edge { 0.5 * twice.atan2(difference) } else { f32::NAN }
    });
    let mut edges = Vec::new();
    for (y, x) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (y, x))) {
        let (sin, cos) = angle.pixel(x, y).sin_cos();
        // Neighbours across the edge.
        let beside = |way: f32| {
            let step = |part: f32| (way * part).round() as isize;
            squared(x.wrapping_add_signed(step(cos)), y.wrapping_add_signed(step(sin)))
        };
        let is_ridge = !sin.is_nan() && squared(x, y) >= beside(1.0) && squared(x, y) > beside(-1.0);
        if is_ridge && run_px(&angle, x, y) >= LEAST_RUN_PX {
            let along = Vector2::new(-f64::from(sin), f64::from(cos));
            edges.push(EdgePixel { pixel: Point2::new(x as f64, y as f64), along });
        }
    }
    edges
}

/// Length of a straight edge to both sides of one of its pixels, up to a limit.
fn run_px(angle: &Intensity, x: usize, y: usize) -> usize {
    let (sin, cos) = angle.pixel(x, y).sin_cos();
    let goes_on = |step: f32| {
        let (x, y) = ((x as f32 - step * sin).round(), (y as f32 + step * cos).round());
        let inside = x >= 0.0 && y >= 0.0 && x < angle.width as f32 && y < angle.height as f32;
        // Sine of the angle between both; the comparison is false for NaN.
        inside && {
            let (s, c) = angle.pixel(x as usize, y as usize).sin_cos();
            (s * cos - c * sin).abs() < STRAIGHT
        }
    };
    let reach = |way: f32| (1..LEAST_RUN_PX).take_while(|k| goes_on(way * *k as f32)).count();
    1 + reach(1.0) + reach(-1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, UnitQuaternion};

    /// A step edge through the middle, seen under an angle, anti-aliased.
    fn step(angle_deg: f32) -> Intensity {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        Intensity::from_fn(80, 60, |x, y| {
            let across = (x as f32 - 40.0) * cos + (y as f32 - 30.0) * sin;
            100.0 + 60.0 * (across / 1.2).tanh()
        })
    }

    #[test]
    fn an_edge_is_where_it_is_drawn_and_runs_as_it_is_drawn() {
        for angle_deg in (-85..=90).step_by(5) {
            let angle_deg = angle_deg as f32;
            let edges = in_picture(&step(angle_deg));
            assert!(edges.len() > 30, "{angle_deg}: {}", edges.len());
            let (sin, cos) = f64::from(angle_deg).to_radians().sin_cos();
            let across = Vector2::new(cos, sin);
            for edge in edges {
                let off_px = (edge.pixel - Point2::new(40.0, 30.0)).dot(&across);
                let off_deg = edge.along.dot(&across).asin().to_degrees();
                assert!(off_px.abs() < 0.8 && off_deg.abs() < 0.5, "{angle_deg}: {off_px} px, {off_deg}°");
            }
        }
    }

    #[test]
    fn a_flat_picture_a_ramp_and_a_tiny_one_have_no_edges_and_a_disc_no_straight_ones() {
        assert!(in_picture(&Intensity::from_fn(60, 40, |_, _| 7.0)).is_empty());
        assert!(in_picture(&Intensity::from_fn(60, 40, |x, _| 6.0 * x as f32)).is_empty());
        for (width, height) in [(1, 1), (2, 9), (9, 2)] {
            assert!(in_picture(&Intensity::from_fn(width, height, |x, y| (99 * (x + y)) as f32)).is_empty());
        }
        let spot = Intensity::from_fn(40, 40, |x, y| {
            200.0 * (-0.5 * ((x as f32 - 20.0).powi(2) + (y as f32 - 20.0).powi(2)) / 4.0).exp()
        });
        assert!(in_picture(&spot).len() < 20);
    }

    #[test]
    fn a_line_lies_in_the_planes_of_all_its_pictures() {
        // A bright half of the world, whose border is a line; each camera sees it elsewhere, through a distorting lens.
        let mut lens = Intrinsics::from_horizontal_fov(160, 120, 70.0);
        lens.distortion = [-0.1, 0.0, 0.0, 0.0, 0.0].into();
        let (through, direction) = (Point3::new(0.2, 0.1, 4.0), Vector3::new(0.2, 1.0, 0.3).normalize());
        let poses: Vec<Option<Isometry3<f64>>> = (0..5)
            .map(|k| {
                let way = f64::from(k) - 2.0;
                let turn = UnitQuaternion::from_euler_angles(0.05 * way, -0.08 * way, 0.2 * way);
                (k != 3).then(|| Isometry3::from_parts(Vector3::new(0.3 * way, 0.1, 0.0).into(), turn))
            })
            .collect();
        let film = |pose: &Isometry3<f64>| {
            let normal = (pose * through).coords.cross(&(pose * direction)).normalize();
            RgbImage::from_fn(160, 120, |x, y| {
                let ray = lens.unproject(&Point2::new(x.into(), y.into())).unwrap();
                let value = 120.0 + 80.0 * (150.0 * normal.dot(&ray)).tanh();
                image::Rgb([value as u8; 3])
            })
        };
        let unseen = Isometry3::identity();
        let frames: Vec<RgbImage> = poses.iter().map(|pose| film(pose.as_ref().unwrap_or(&unseen))).collect();
        let planes = of_capture(&frames, &lens, &poses);
        assert!(planes.len() > 300, "{}", planes.len());
        let mut off_deg: Vec<f64> =
            planes.iter().map(|n| n.dot(&direction).asin().to_degrees().abs()).collect();
        off_deg.sort_by(f64::total_cmp);
        let [half, nearly_all] = [0.5, 0.95].map(|share| off_deg[(share * off_deg.len() as f64) as usize]);
        assert!(half < 0.3 && nearly_all < 1.5, "{half}°, {nearly_all}°");
        assert!(of_capture(&frames, &lens, &[None, None, None, None, None]).is_empty());
    }

    #[test]
    fn short_edges_are_left_out_however_many() {
        // A wall of bars, each a few pixels long, and the same bars uninterrupted.
        let bars = |length: usize| {
            let bar = move |x: usize, y: usize| if x % 16 < 8 && y % 32 < length { 200.0 } else { 60.0 };
            in_picture(&Intensity::from_fn(128, 96, bar).smoothed(0.8))
        };
        assert!(bars(16).is_empty(), "{}", bars(16).len());
        assert!(bars(32).len() > 1000, "{}", bars(32).len());
    }

    #[test]
    fn a_large_picture_tells_what_a_small_one_would_of_the_same_place() {
        // A border through the middle of one of the smaller picture's pixels.
        const BORDER: f64 = 360.5 / 600.0;
        let film = |width: u32, height: u32| {
            RgbImage::from_fn(width, height, |x, _| {
                let share = (BORDER * f64::from(width) - f64::from(x)).clamp(0.0, 1.0);
                image::Rgb([(60.0 + 120.0 * share) as u8; 3])
            })
        };
        let off_deg = [(600, 45), (2400, 180)].map(|(width, height)| {
            let lens = Intrinsics::from_horizontal_fov(width, height, 60.0);
            let planes = of_capture(&[film(width, height)], &lens, &[Some(Isometry3::identity())]);
            let border = Point2::new(BORDER * f64::from(width) - 0.5, 0.0);
            let border = lens.unproject(&border).unwrap().normalize();
            assert!(planes.len() > 30 && planes.iter().all(|normal| normal.y.abs() < 1e-3));
            let off = planes.iter().map(|normal| normal.dot(&border)).sum::<f64>() / planes.len() as f64;
            off.to_degrees()
        });
        assert!(off_deg.iter().all(|off| off.abs() < 0.01), "{off_deg:?}");
    }

    #[test]
    fn indices_are_spread_evenly() {
        assert_eq!(evenly(5, 9).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        assert_eq!(evenly(10, 3).collect::<Vec<_>>(), [2, 5, 9]);
        assert_eq!(evenly(0, 3).count(), 0);
    }
}
