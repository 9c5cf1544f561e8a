//! Sobel operator of five pixels, `[−1 −2 0 2 1] × [1 4 6 4 1]` (section 4.2): on a head of five pixels' radius it
//! responds within two pixels of the contour, so that hypotheses beside a head are drawn to it.

use super::options::EdgeStrength;

/// Stored value of a full edge.
pub(super) const FULL: f32 = 1024.0;
/// Response of the operator to a slope of one grey level a pixel.
const PER_LEVEL: f32 = 128.0;
/// Largest slope of the operator's response: a step from black to white.
pub(super) const STEEPEST: f32 = 255.0 * 3.0 / 8.0;
/// Number of rows and columns along the image's border without a response.
pub(super) const RIM: usize = 2;

/// Buffers of the operator.
#[derive(Debug, Clone, Default)]
pub(super) struct Sobel {
    /// The picture, one value a pixel, 0 to 255.
    pub(super) values: Vec<i16>,
    /// `[−1 −2 0 2 1]` and `[1 4 6 4 1]` along each row.
    slope: Vec<i16>,
    smooth: Vec<i16>,
    /// Responses along u and v.
    u: Vec<i16>,
    v: Vec<i16>,
}

impl Sobel {
    /// Halves the picture by means of four pixels; a last odd row or column is left out. Returns the new size.
    pub(super) fn halve(&mut self, width: usize, height: usize) -> (usize, usize) {
        let (half_width, half_height) = (width / 2, height / 2);
        for row in 0..half_height {
            for column in 0..half_width {
                let at = 2 * row * width + 2 * column;
                let v = &self.values;
                // Written before the pixels that are still to be read.
                self.values[row * half_width + column] =
                    (v[at] + v[at + 1] + v[at + width] + v[at + width + 1] + 2) / 4;
            }
        }
        self.values.truncate(half_width * half_height);
        (half_width, half_height)
    }

    /// Stores the responses in units of 1/[`FULL`].
    pub(super) fn store(&self, strength: EdgeStrength, gradient: &mut Vec<[i16; 2]>) {
        let answers = self.u.iter().zip(&self.v).map(|(u, v)| (f32::from(*u), f32::from(*v)));
        gradient.clear();
        match strength {
            EdgeStrength::Linear => {
                let gain = FULL / (STEEPEST * PER_LEVEL);
                gradient.extend(answers.map(|(u, v)| [(u * gain) as i16, (v * gain) as i16]));
            }
            EdgeStrength::Saturating { half_at } => {
                let half_at = half_at as f32 * PER_LEVEL;
                gradient.extend(answers.map(|(u, v)| {
                    let gain = FULL / ((u * u + v * v).sqrt() + half_at);
                    [(u * gain) as i16, (v * gain) as i16]
                }));
            }
        }
    }

    /// Computes the slopes along u and v of a picture of this size.
    pub(super) fn answer(&mut self, width: usize, height: usize) {
        for buffer in [&mut self.slope, &mut self.smooth, &mut self.u, &mut self.v] {
            buffer.clear();
            buffer.resize(width * height, 0);
        }
        if width <= 2 * RIM || height <= 2 * RIM {
            return;
        }
        let rows = self.slope.chunks_exact_mut(width).zip(self.smooth.chunks_exact_mut(width));
        for ((slope, smooth), values) in rows.zip(self.values.chunks_exact(width)) {
            let taps = values.windows(5).zip(&mut slope[RIM..]).zip(&mut smooth[RIM..]);
            for ((v, slope), smooth) in taps {
                *slope = v[4] - v[0] + 2 * (v[3] - v[1]);
                *smooth = v[0] + v[4] + 4 * (v[1] + v[3]) + 6 * v[2];
            }
        }
        for row in RIM..height - RIM {
            let at = |of: usize| (row + of - RIM) * width..(row + of - RIM + 1) * width;
            let here = row * width..(row + 1) * width;
            let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|k| &self.slope[at(k)]);
            for (i, u) in self.u[here.clone()].iter_mut().enumerate() {
                *u = a[i] + e[i] + 4 * (b[i] + d[i]) + 6 * c[i];
            }
            let [a, b, d, e] = [0, 1, 3, 4].map(|k| &self.smooth[at(k)]);
            for (i, v) in self.v[here].iter_mut().enumerate() {
                *v = e[i] - a[i] + 2 * (d[i] - b[i]);
            }
        }
    }
}
