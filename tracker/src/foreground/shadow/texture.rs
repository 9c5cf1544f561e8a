//! Comparison of a surface's texture with the background's: normalised cross-correlation from sums.

/// Least number of pixels for a comparison of texture…
const LEAST_PIXELS: i32 = 12;
/// …and least share of the changed pixels, as a divisor.
const LEAST_SHARE: i32 = 3;
/// Largest ratio, either way, of the factor of texture to that of brightness: light scales both alike.
const SAME_FACTOR: f32 = 2.0;
/// Standard deviation of the background's grey levels below which there is no texture to compare.
const LEAST_TEXTURE: f32 = 4.0;
/// Standard deviation of the frame's grey levels above which the picture does not show a plain background.
const FOREIGN_TEXTURE: f32 = 16.0;

/// Result of comparing the frame's texture around a cell with the background's.
pub(super) enum Texture {
    Same,
    Different,
    /// Neither has texture.
    None,
}

/// Sums over the frame's (x) and the background's (e) brightness, at pixels where the frame may show the background's
/// surface: a leg beside a shadow must not count.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TextureSums {
    /// Number of changed pixels, and of those that count.
    pub(super) pixels: i32,
    pub(super) n: i32,
    pub(super) x: i32,
    pub(super) e: i32,
    pub(super) xx: i32,
    pub(super) ee: i32,
    pub(super) xe: i32,
}

impl TextureSums {
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            n: self.n + other.n,
            x: self.x + other.x,
            e: self.e + other.e,
            xx: self.xx + other.xx,
            ee: self.ee + other.ee,
            xe: self.xe + other.xe,
        }
    }

    pub(super) fn compare(&self, correlation: f32) -> Texture {
        if self.n < LEAST_PIXELS || LEAST_SHARE * self.n < self.pixels {
            return Texture::Different;
        }
        let n = self.n as f32;
        let (mx, me) = (self.x as f32 / n, self.e as f32 / n);
        let (vx, ve) = (self.xx as f32 / n - mx * mx, self.ee as f32 / n - me * me);
        if ve < LEAST_TEXTURE * LEAST_TEXTURE {
            // A fold, a pattern or an edge before a plain background belongs to a person; the rim of a soft shadow is
            // weaker.
            return if vx > FOREIGN_TEXTURE * FOREIGN_TEXTURE { Texture::Different } else { Texture::None };
        }
        let covariance = self.xe as f32 / n - mx * me;
        let (factor, of_texture) = (mx / me.max(1.0), covariance / ve);
        let same = covariance >= correlation * (vx.max(1.0) * ve).sqrt()
            && (factor / SAME_FACTOR..=factor * SAME_FACTOR).contains(&of_texture);
        if same { Texture::Same } else { Texture::Different }
    }
}
