//! Colours of surfaces from pictures laid over them, and the two scales of brightness in which files state colours.

use std::path::Path;

use image::RgbImage;

/// A picture laid over a surface.
#[derive(Debug, Clone)]
pub(super) struct Texture {
    image: RgbImage,
}

impl Texture {
    /// Decodes a picture; `path` is for messages. One that cannot be read costs the surface its colour, not the room its
    /// surface, and is told of.
    pub(super) fn decode(path: &Path, bytes: &[u8]) -> Option<Self> {
        match calib::picture::decode(path, bytes) {
            Ok(image) if image.width() > 0 && image.height() > 0 => Some(Self { image: image.into_rgb8() }),
            Ok(_) => None,
            Err(e) => {
                tracing::warn!("{e}; the surface has no texture");
                None
            }
        }
    }

    /// Colour, as bytes are shown, at `u` to the right and `v` downwards, each from 0 to 1 and repeated beyond.
    pub(super) fn at(&self, u: f32, v: f32) -> [u8; 3] {
        let pixel = |share: f32, side: u32| ((share.rem_euclid(1.0) * side as f32) as u32).min(side - 1);
        self.image.get_pixel(pixel(u, self.image.width()), pixel(v, self.image.height())).0
    }
}

/// Amount of light, 0 to 1, of a level of sRGB, 0 to 1 (IEC 61966-2-1).
pub(super) fn light_of_level(level: f32) -> f32 {
    if level <= 0.040_45 { level / 12.92 } else { ((level + 0.055) / 1.055).powf(2.4) }
}

/// Level of sRGB, 0 to 1, of an amount of light, 0 to 1.
pub(super) fn level_of_light(light: f32) -> f32 {
    let light = light.clamp(0.0, 1.0);
    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_and_light_are_inverse_and_known_at_middle_grey() {
        for level in 0..=255_u8 {
            let light = light_of_level(f32::from(level) / 255.0);
            // As glTF files store it: 16 bits.
            let stored = (65_535.0 * light).round() / 65_535.0;
            assert_eq!((255.0 * level_of_light(stored)).round() as u8, level);
        }
        assert!((light_of_level(0.5) - 0.214_04).abs() < 1e-4);
    }

    #[test]
    fn pictures_repeat_and_run_from_the_top() {
        let image = RgbImage::from_fn(4, 2, |x, y| image::Rgb([x as u8, y as u8, 0]));
        let texture = Texture { image };
        for (u, v, expected) in
            [(0.1, 0.1, [0, 0, 0]), (0.9, 0.6, [3, 1, 0]), (1.3, -0.1, [1, 1, 0]), (f32::NAN, 0.0, [0, 0, 0])]
        {
            assert_eq!(texture.at(u, v), expected, "{u} {v}");
        }
    }
}
