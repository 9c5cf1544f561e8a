//! Image of an ellipsoid in a pinhole camera.
//!
//! Scale space so that the ellipsoid becomes the unit sphere; the camera's centre goes to `o` and the ray of pixel
//! `(u, v)` to `o + t·w(u, v)`, where `w` is linear in the pixel and `t` is the depth along the camera's z (rays are
//! scaled to z = 1). The ray meets the sphere where `a t² + 2 b t + c = 0` with
//!
//! ```text
//! a = w·w      b = o·w      c = o·o − 1        (a: quadratic in the pixel, b: linear, c: constant)
//! ```
//!
//! so the image is `{(u, v) : b² − c a ≥ 0, b < 0}`: the inside of a conic, on the branch in front of the camera. In a
//! row, `b² − c a` is a quadratic in u: its roots bound the span. `b < 0` cannot change within a span, because a ray
//! from outside meets the ellipsoid either wholly in front or wholly behind.
//!
//! Nearly always the conic is an ellipse. The middles of its spans lie on a line and their half widths are `√(widest² −
//! fall · (v − v₀)²)`: one root a row, and no division.
//!
//! f64, although it renders: a span must end at the same pixel as a ray computed by any other formula.

use std::ops::Range;

use nalgebra::Vector3;
use wide::f64x8;

use super::{Ellipsoid, View};

/// Number of rows whose spans are computed together.
pub(super) const SPANS: usize = 8;
/// Offsets of the lanes from the first.
const LANES: f64x8 = f64x8::new([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

/// Image of one body in one view.
#[derive(Debug, Clone)]
pub struct ImageConic {
    /// Coefficients of `a = w·w` over (1, u, v): the constant, and those of 2u, 2v, u², 2uv, v².
    a: [f64; 6],
    /// Coefficients of `b = o·w` over (1, u, v).
    b: [f64; 3],
    c: f64,
    /// Coefficients of `b² − c a`, laid out as `a`: not negative on the image of the body.
    inside: [f64; 6],
    width: i32,
    height: i32,
    /// Smallest depth along z of any point of the ellipsoid, metres.
    pub nearest_z_m: f64,
    /// Upper bound of the depth along z of the side that faces the camera, metres.
    pub near_side_to_z_m: f64,
}

/// Location of a body in the image.
#[derive(Debug, Clone)]
pub enum ImageOutline {
    /// Outside the image.
    Nowhere,
    /// Inside an ellipse.
    Ellipse(Ellipse),
    /// Unbounded: the body reaches behind the camera's image plane, or around the camera.
    Open,
}

/// Image of a body that is wholly in front of the camera. Pixels.
#[derive(Debug, Clone)]
pub struct Ellipse {
    /// Rows of the image that can hold its pixels.
    pub rows: Range<i32>,
    /// Columns of the image that can hold its pixels.
    pub columns: Range<i32>,
    /// Last row of the whole image plane that holds a point of it.
    pub last_row: f64,
    middle_u: f64,
    middle_v: f64,
    /// Shift of the middle of a row's span to the right from that of the row above, columns.
    slope: f64,
    /// Square of half the width of the widest row.
    widest: f64,
    /// Decrease of the square of half the width for each squared row from the middle.
    fall: f64,
}

impl Ellipse {
    /// Spans of [`SPANS`] rows, beginning with `v`, computed together in vector registers.
    pub fn spans(&self, v: i32) -> [Range<i32>; SPANS] {
        /// Adding this number rounds to integers: floats of this size are 1 apart, and their last bits count them.
        const WHOLE: f64 = 1.5 * (1_u64 << 52) as f64;
        let [from, to] = [f64::from(self.columns.start), f64::from(self.columns.end)];
        let dv = LANES + (f64::from(v) - self.middle_v);
        let square = self.widest - dv * dv * self.fall;
        // For a row that misses the ellipse, the start comes after the end.
        let half = square.simd_lt(f64x8::ZERO).select(f64x8::splat(-1.0), square.sqrt());
        let middle = self.middle_u + dv * self.slope;
        let start = (middle - half).fast_max(f64x8::splat(from)).fast_min(f64x8::splat(to)).ceil();
        let end = (middle + half).fast_max(f64x8::splat(from - 1.0)).fast_min(f64x8::splat(to - 1.0)).floor();
        let (starts, ends) = ((start + WHOLE).to_array(), (end + (WHOLE + 1.0)).to_array());
        std::array::from_fn(|i| starts[i].to_bits() as i32..ends[i].to_bits() as i32)
    }
}

/// One row of the image of a body: `b² − c a` and the depth as functions of u.
#[derive(Debug, Clone, Copy)]
pub struct ConicRow {
    /// `a = a0 + 2 a1 u + a2 u²`.
    a0: f64,
    a1: f64,
    a2: f64,
    /// `b = b0 + b1 u`.
    b0: f64,
    b1: f64,
    c: f64,
}

impl ConicRow {
    /// Columns, of eight beginning with `u`, in which a static point at depth `static_z_m` along z leaves the body's
    /// near surface visible; one bit a column.
    ///
    /// The static point is behind the near surface when it lies inside the ellipsoid or beyond its middle, so no root
    /// is needed. Only meaningful inside a span. All columns are computed together, because finding the doubtful ones
    /// takes longer.
    #[inline]
    pub fn is_in_front_of(&self, u: i32, static_z_m: &[f32; 8]) -> u8 {
        let u = LANES + f64::from(u);
        let z = f64x8::new(static_z_m.map(f64::from));
        let a = self.a0 + u * (2.0 * self.a1 + u * self.a2);
        let b = self.b0 + u * self.b1;
        let none = f64x8::ZERO;
        // At infinity the last condition holds.
        let (is_in_front, is_inside, is_beyond) =
            (z.simd_gt(none), ((a * z + 2.0 * b) * z + self.c).simd_lt(none), (a * z + b).simd_gt(none));
        (is_in_front & (is_inside | is_beyond)).to_bitmask() as u8
    }

    /// Depth along z of the body's near surface at column `u`, metres; only meaningful inside a span.
    pub fn near_z_m(&self, u: i32) -> f64 {
        let u = f64::from(u);
        let a = self.a0 + u * (2.0 * self.a1 + u * self.a2);
        let b = self.b0 + u * self.b1;
        // c / (√(b² − c a) − b) is the near root (−b − √(b² − c a)) / a without its cancellation.
        self.c.max(0.0) / ((b * b - self.c * a).max(0.0).sqrt() - b)
    }
}

/// Whole pixels of `[from, to]`, which is clipped to the image.
fn whole_pixels(from: f64, to: f64) -> Option<Range<i32>> {
    // Also rejects NaN.
    if !(from >= 0.0 && from <= to) {
        return None;
    }
    let pixels = from.ceil() as i32..to as i32 + 1;
    (!pixels.is_empty()).then_some(pixels)
}

impl ImageConic {
    /// Image of `body` in `view`.
    pub fn new(view: &View, body: &Ellipsoid) -> Self {
        let axes = body.semi_axes;
        let scale = |v: &Vector3<f64>| v.component_div(&axes);
        let (w0, wu, wv) = (scale(&view.ray_0), scale(&view.ray_u), scale(&view.ray_v));
        let o = scale(&(view.center - body.center));
        let c = o.norm_squared() - 1.0;
        let a = [w0.dot(&w0), w0.dot(&wu), w0.dot(&wv), wu.dot(&wu), wu.dot(&wv), wv.dot(&wv)];
        let b = [o.dot(&w0), o.dot(&wu), o.dot(&wv)];
        let b_squared = [b[0] * b[0], b[0] * b[1], b[0] * b[2], b[1] * b[1], b[1] * b[2], b[2] * b[2]];
        // Depth along z is linear: over the scaled body it rises by `reach` from the middle. The camera sees the side
        // bounded by the circle of tangent rays, which lies `1 / |o|` from the middle.
        let forward = axes.component_mul(&view.forward);
        let reach = forward.norm();
        let middle = (body.center - view.center).dot(&view.forward);
        let near_side_to = if c > 0.0 && middle > 0.0 {
            let o_squared = o.norm_squared();
            let toward = forward.dot(&o);
            let around = (forward.norm_squared() - toward * toward / o_squared).max(0.0);
            toward / o_squared + ((1.0 - 1.0 / o_squared) * around).sqrt()
        } else {
            reach
        };
        Self {
            inside: std::array::from_fn(|i| b_squared[i] - c * a[i]),
            a,
            b,
            c,
            width: view.width as i32,
            height: view.height as i32,
            nearest_z_m: middle - reach,
            near_side_to_z_m: middle + near_side_to,
        }
    }

    /// Whether the camera is inside the body.
    pub fn holds_camera(&self) -> bool {
        self.c <= 0.0
    }

    /// Location of the body in the image.
    pub fn outline(&self) -> ImageOutline {
        if self.holds_camera() {
            return ImageOutline::Open;
        }
        let [f, d, e, a, b, c] = self.inside;
        // A row (column) holds pixels where its quadratic in u (v) has roots.
        let rows = [b * b - a * c, d * b - a * e, d * d - a * f];
        let columns = [b * b - a * c, e * b - c * d, e * e - c * f];
        if a >= 0.0 || rows[0] >= 0.0 {
            return if self.nearest_z_m <= 0.0 { ImageOutline::Open } else { ImageOutline::Nowhere };
        }
        // All of the ellipse is in front or behind; its centre decides.
        let v = -rows[1] / rows[0];
        let u = -(b * v + d) / a;
        if self.b[0] + self.b[1] * u + self.b[2] * v >= 0.0 {
            return ImageOutline::Nowhere;
        }
        let (Some((row_range, last_row)), Some((column_range, _))) =
            (extent(&rows, self.height), extent(&columns, self.width))
        else {
            return ImageOutline::Nowhere;
        };
        let scale = 1.0 / (a * a);
        ImageOutline::Ellipse(Ellipse {
            rows: row_range,
            // One pixel more on either side, so that rounding never puts the end of a span outside.
            columns: (column_range.start - 1).max(0)..(column_range.end + 1).min(self.width),
            last_row,
            middle_u: u,
            middle_v: v,
            slope: -b / a,
            widest: (rows[1] * v + rows[2]) * scale,
            fall: -rows[0] * scale,
        })
    }

    /// All rows and all columns of the image.
    pub fn image(&self) -> [Range<i32>; 2] {
        [0..self.height, 0..self.width]
    }

    /// Functions of row `v` for depth and spans.
    pub fn row(&self, v: i32) -> ConicRow {
        let v = f64::from(v);
        let [a_1, a_u, a_v, a_uu, a_uv, a_vv] = self.a;
        ConicRow {
            a0: a_1 + v * (2.0 * a_v + v * a_vv),
            a1: a_u + v * a_uv,
            a2: a_uu,
            b0: self.b[0] + self.b[2] * v,
            b1: self.b[1],
            c: self.c,
        }
    }

    /// Spans of a row, for any outline: none, one, or (for a body that reaches behind the image plane) up to two.
    pub fn spans(&self, row: &ConicRow) -> [Option<Range<i32>>; 2] {
        let (start, end) = (0.0, f64::from(self.width - 1));
        if self.holds_camera() {
            return [Some(0..self.width), None];
        }
        let square = self.inside[3];
        let half_b = row.b0 * row.b1 - self.c * row.a1;
        let constant = row.b0 * row.b0 - self.c * row.a0;
        let d = half_b * half_b - square * constant;
        if square < 0.0 {
            if d < 0.0 {
                return [None, None];
            }
            let root = d.sqrt();
            let (low, high) = ((-half_b + root) / square, (-half_b - root) / square);
            return [Self::span(row, low.max(start), high.min(end)), None];
        }
        if square == 0.0 {
            let root = -0.5 * constant / half_b;
            return match half_b.partial_cmp(&0.0) {
                Some(std::cmp::Ordering::Greater) => [Self::span(row, root.max(start), end), None],
                Some(std::cmp::Ordering::Less) => [Self::span(row, start, root.min(end)), None],
                _ if constant >= 0.0 => [Self::span(row, start, end), None],
                _ => [None, None],
            };
        }
        if d < 0.0 {
            return [Self::span(row, start, end), None];
        }
        let root = d.sqrt();
        let (low, high) = ((-half_b - root) / square, (-half_b + root) / square);
        [Self::span(row, start, low.min(end)), Self::span(row, high.max(start), end)]
    }

    /// Whole pixels of `[from, to]` whose rays meet the body in front of the camera.
    fn span(row: &ConicRow, from: f64, to: f64) -> Option<Range<i32>> {
        whole_pixels(from, to).filter(|span| row.b0 + row.b1 * f64::from(span.start) < 0.0)
    }
}

/// Integers within `0..size` at which `q2 x² + 2 q1 x + q0 ≥ 0` for a negative `q2`, and the largest real `x`; `None`
/// without any.
fn extent(&[q2, q1, q0]: &[f64; 3], size: i32) -> Option<(Range<i32>, f64)> {
    let d = q1 * q1 - q2 * q0;
    let root = (d >= 0.0).then(|| d.sqrt())?;
    let largest = (-q1 - root) / q2;
    let first = ((-q1 + root) / q2).ceil().max(0.0);
    let last = largest.floor().min(f64::from(size - 1));
    (first <= last).then(|| (first as i32..last as i32 + 1, largest))
}
