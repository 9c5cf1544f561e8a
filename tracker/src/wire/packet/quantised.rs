//! Quantised quantities of a packet.

use nalgebra::{Matrix2, Point2, SymmetricEigen, Vector2};

use super::super::encoding::Malformed;
use super::super::encoding::bytes::{Decoded, Reader, put_varint};
use super::FARTHEST_M;
use crate::method::agents::{Colour, Looks};

/// Range of encoded standard deviations, mm.
const DEVIATION_MM: [f64; 2] = [1.0, 65_535.0];
/// Number of directions in half a turn.
const DIRECTIONS: f64 = 256.0;
/// Number of hues in a turn.
const HUES: f64 = 256.0;

/// Appends a signed integer.
pub(super) fn put_signed(out: &mut Vec<u8>, value: i32) {
    put_varint(out, u64::from(((value << 1) ^ (value >> 31)) as u32));
}

/// The next signed integer.
pub(super) fn signed(reader: &mut Reader<'_>) -> Decoded<i32> {
    let folded = reader.size(u32::MAX)?;
    Ok((folded >> 1) as i32 ^ -((folded & 1) as i32))
}

/// Appends a quantity in whole steps, clamped to its limits.
pub(super) fn put_within(out: &mut Vec<u8>, value: f64, [least, most]: [f64; 2]) -> Decoded<()> {
    if value.is_nan() {
        return Err(Malformed("a quantity is not a number"));
    }
    put_varint(out, value.clamp(least, most).round() as u64);
    Ok(())
}

/// The next quantity in whole steps.
pub(super) fn within(reader: &mut Reader<'_>, [least, most]: [f64; 2]) -> Decoded<u32> {
    let value = reader.size(most as u32)?;
    if f64::from(value) < least { Err(Malformed("a size is below its limit")) } else { Ok(value) }
}

/// Appends a position on the floor.
pub(super) fn put_place(out: &mut Vec<u8>, place: Point2<f64>) -> Decoded<()> {
    for metres in [place.x, place.y] {
        if !metres.is_finite() || metres.abs() > FARTHEST_M {
            return Err(Malformed("a place is too far away"));
        }
        put_signed(out, (metres * 1000.0).round() as i32);
    }
    Ok(())
}

/// The next position on the floor.
pub(super) fn place(reader: &mut Reader<'_>) -> Decoded<Point2<f64>> {
    let mut metres = || -> Decoded<f64> {
        let metres = f64::from(signed(reader)?) / 1000.0;
        if metres.abs() > FARTHEST_M { Err(Malformed("a place is too far away")) } else { Ok(metres) }
    };
    Ok(Point2::new(metres()?, metres()?))
}

/// Appends a covariance, by its axes.
pub(super) fn put_covariance(out: &mut Vec<u8>, covariance: &Matrix2<f64>) -> Decoded<()> {
    if !covariance.iter().all(|entry| entry.is_finite()) {
        return Err(Malformed("a covariance is not finite"));
    }
    let axes = SymmetricEigen::new((covariance + covariance.transpose()) / 2.0);
    let long = axes.eigenvalues.imax();
    for axis in [long, 1 - long] {
        put_within(out, axes.eigenvalues[axis].max(0.0).sqrt() * 1000.0, DEVIATION_MM)?;
    }
    let direction = axes.eigenvectors.column(long);
    let half_turns = direction.y.atan2(direction.x) / std::f64::consts::PI;
    out.push((half_turns * DIRECTIONS).round().rem_euclid(DIRECTIONS) as u8);
    Ok(())
}

/// The next covariance: symmetric and positive definite for all bytes.
pub(super) fn covariance(reader: &mut Reader<'_>) -> Decoded<Matrix2<f64>> {
    let [long, short] = [within(reader, DEVIATION_MM)?, within(reader, DEVIATION_MM)?];
    let angle = f64::from(reader.byte()?) / DIRECTIONS * std::f64::consts::PI;
    let along = Vector2::new(angle.cos(), angle.sin());
    let across = Vector2::new(-along.y, along.x);
    let variance = |deviation_mm: u32| (f64::from(deviation_mm) / 1000.0).powi(2);
    let mut covariance = variance(long) * along * along.transpose();
    covariance += variance(short) * across * across.transpose();
    // Rounding must not make it asymmetric.
    covariance[(1, 0)] = covariance[(0, 1)];
    Ok(covariance)
}

/// Appends a confidence.
pub(super) fn put_confidence(out: &mut Vec<u8>, confidence: f64) -> Decoded<()> {
    if confidence.is_nan() {
        return Err(Malformed("a confidence is not a number"));
    }
    let steps = (confidence.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
    out.extend_from_slice(&steps.to_le_bytes());
    Ok(())
}

/// The next confidence.
pub(super) fn confidence(reader: &mut Reader<'_>) -> Decoded<f64> {
    Ok(f64::from(u16::from_le_bytes(reader.array()?)) / f64::from(u16::MAX))
}

/// Appends colours.
pub(super) fn put_looks(out: &mut Vec<u8>, looks: &Looks) -> Decoded<()> {
    for colour in &looks.colours {
        let [hue, saturation, value] =
            [colour.hue_deg / 360.0, colour.saturation, colour.value].map(f64::from);
        if !hue.is_finite() || saturation.is_nan() || value.is_nan() {
            return Err(Malformed("a colour is not finite"));
        }
        let part = |share: f64| (share.clamp(0.0, 1.0) * 255.0).round() as u8;
        out.extend([(hue * HUES).round().rem_euclid(HUES) as u8, part(saturation), part(value)]);
    }
    Ok(())
}

/// The next colours.
pub(super) fn looks(reader: &mut Reader<'_>) -> Decoded<Looks> {
    let mut colour = || -> Decoded<Colour> {
        let [hue, saturation, value] = reader.array()?;
        Ok(Colour {
            hue_deg: f32::from(hue) * (360.0 / HUES as f32),
            saturation: f32::from(saturation) / 255.0,
            value: f32::from(value) / 255.0,
        })
    };
    Ok(Looks { colours: [colour()?, colour()?, colour()?] })
}
