//! A picture's number painted into it as bars of bits, large enough to survive JPEG and a film at a fraction of the
//! size.
//!
//! The bars stand at the top right: people's heads do not reach there, and the caption of films and of the page
//! stands at the top left. From left to right: white, black, sixteen bits of the number, six bits of a check, the
//! highest bits first.

use image::{Rgb, RgbImage};

/// Bits of the number.
const NUMBER_BITS: u32 = 16;
/// Bits of the check: one in 64 pictures without a stamp passes as stamped.
const CHECK_BITS: u32 = 6;
/// Bars, the white and the black one included.
const BARS: u32 = NUMBER_BITS + CHECK_BITS + 2;
/// Left edge of the bars and width of one, as shares of the picture's width.
const LEFT: f64 = 0.45;
const BAR: f64 = 0.022;
/// Upper and lower edge, as shares of the picture's height.
const TOP: f64 = 0.012;
const BOTTOM: f64 = 0.045;
/// Least difference between white and black, grey levels.
const LEAST_CONTRAST: f64 = 80.0;

/// The largest number that can be painted.
pub const MAX_NUMBER: u32 = (1 << NUMBER_BITS) - 1;

fn check(number: u32) -> u32 {
    (number ^ number >> CHECK_BITS ^ number >> (2 * CHECK_BITS) ^ 0x2A) & ((1 << CHECK_BITS) - 1)
}

/// First and last column of a bar, without `margin` (a share of its width) on both sides.
fn columns(width: u32, bar: u32, margin: f64) -> std::ops::Range<u32> {
    let edge = |bars: f64| ((LEFT + BAR * bars) * f64::from(width)).round() as u32;
    edge(f64::from(bar) + margin)..edge(f64::from(bar + 1) - margin).max(edge(f64::from(bar) + margin) + 1)
}

fn rows(height: u32, margin: f64) -> std::ops::Range<u32> {
    let (top, bottom) = (TOP + margin * (BOTTOM - TOP), BOTTOM - margin * (BOTTOM - TOP));
    let first = (top * f64::from(height)).round() as u32;
    first..((bottom * f64::from(height)).round() as u32).max(first + 1)
}

/// Paints the lowest sixteen bits of a number.
pub fn paint(picture: &mut RgbImage, number: u32) {
    let number = number & MAX_NUMBER;
    let code = 0b10 << (NUMBER_BITS + CHECK_BITS) | number << CHECK_BITS | check(number);
    let (width, height) = picture.dimensions();
    for bar in 0..BARS {
        let level = if code >> (BARS - 1 - bar) & 1 == 1 { 255 } else { 0 };
        for y in rows(height, 0.0) {
            for x in columns(width, bar, 0.0) {
                picture.put_pixel(x, y, Rgb([level; 3]));
            }
        }
    }
}

/// Number painted into the leftmost `width` pixels of a picture (the camera's panel of a film); `None` where no
/// number can be read.
pub fn read(picture: &RgbImage, width: u32) -> Option<u32> {
    let height = picture.height();
    let level = |bar: u32| -> f64 {
        let pixels =
            rows(height, 0.3).flat_map(|y| columns(width, bar, 0.3).map(move |x| picture.get_pixel(x, y)));
        let (sum, count) = pixels.fold((0.0, 0.0), |(sum, count), p| (sum + f64::from(p[1]), count + 1.0));
        sum / count
    };
    if width == 0 || width > picture.width() || height == 0 {
        return None;
    }
    let (white, black) = (level(0), level(1));
    if white - black < LEAST_CONTRAST {
        return None;
    }
    let code = (2..BARS).fold(0, |code, bar| code << 1 | u32::from(level(bar) > 0.5 * (white + black)));
    let number = code >> CHECK_BITS;
    (code & ((1 << CHECK_BITS) - 1) == check(number)).then_some(number)
}
