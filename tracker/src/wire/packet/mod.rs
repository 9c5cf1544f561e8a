//! Bytes of a [`Packet`] between stations that track together, version 1.
//!
//! A packet is small (about 36 bytes a report), and lossy only by the quantisation below. *Varint*: LEB128, here up to
//! 32 bits. *Signed*: a varint of `2 n` for `n ≥ 0`, of `−2 n − 1` below. Integers of fixed length and *numbers* (IEEE
//! 754) come lowest byte first. Bytes after the end are an error, and so are a wrong version, an unknown kind or flag,
//! counts above [`MOST_REPORTS`] and [`MOST_MESSAGES`], two reports of one target, and positions outside
//! ±[`FARTHEST_M`].
//!
//! | part | bytes | content |
//! |---|---|---|
//! | version | 1 | 1 |
//! | station | 1 | number of the sender's camera |
//! | life | 4 | |
//! | sequence | 1–5 | varint |
//! | capture time | 8 | number, seconds on the sender's clock |
//! | sending | 1–5 | signed: from capture to sending, microseconds, at most half an hour either way |
//! | greatest target | 1–5 | varint |
//! | flags | 1 | 1: the sender is blind |
//! | reports, messages | 1 + 1 | their counts, then the reports, then the messages |
//!
//! **Report.** Varints: the agent's number (its station is the sender), the target. Byte of flags: 1 with looks, 2
//! crowded. *Place*: two signed, mm. Covariance: two varints, the standard deviations along its axes, mm, at least 1
//! and at most 65,535, the longer first; a byte, the direction of the longer, 1/256 of 180°. Velocity: two signed,
//! cm/s, at most ±10,000. Varint: height, mm, at most 65,535. Two bytes: confidence, 1/65,535. With looks: *looks*,
//! for each of three colours a byte each of hue (1/256 of 360°), saturation and brightness (1/255).
//!
//! **Message.** A byte of kind. 1 request, 2 request with looks: varints, the agent's number (of the sender's
//! station) and the candidate; place; looks. 3 refused, 4 granted: a byte, the agent's station; varints, its number
//! and the candidate.

mod quantised;
#[cfg(test)]
mod tests;

use nalgebra::{Point2, Vector2};

use self::quantised::{
    confidence, covariance, place, put_confidence, put_covariance, put_looks, put_place, put_signed,
    put_within, signed, within,
};
use super::encoding::Malformed;
use super::encoding::bytes::{Decoded, Reader, put_f64, put_varint};
use crate::method::agents::{AgentId, MediatorMessage, Packet, Report, StationId, TargetId};

/// The packets' version, the first byte of each.
pub const PACKET_VERSION: u8 = 1;
/// Largest number of reports in a packet.
pub const MOST_REPORTS: usize = 64;
/// Largest number of messages in a packet.
pub const MOST_MESSAGES: usize = 64;
/// Longest packet in bytes; more is refused before it is read.
pub const LONGEST_PACKET: usize = 6 << 10;
/// Largest coordinate of a position, metres.
pub const FARTHEST_M: f64 = 100_000.0;

/// Largest encoded speed along x or y, cm/s.
const FASTEST_CM_S: f64 = 10_000.0;
/// Largest encoded height, mm.
const TALLEST_MM: f64 = 65_535.0;
/// Longest time between capture and sending, either way, microseconds.
const LONGEST_DELAY_US: f64 = 1.8e9;

const WITH_LOOKS: u8 = 1;
const IS_CROWDED: u8 = 2;

/// Encodes a packet that is sent at `sent_s`, seconds on the sender's clock.
///
/// # Errors
/// A packet that cannot be decoded on the other side: too many reports or messages, two reports of one target, an agent
/// of another station, a number that is not finite, a position that is too far away.
pub fn encode(packet: &Packet, sent_s: f64) -> Result<Vec<u8>, Malformed> {
    check(packet)?;
    let delay_us = (sent_s - packet.time_s) * 1e6;
    if !packet.time_s.is_finite() || !sent_s.is_finite() || delay_us.abs() > LONGEST_DELAY_US {
        return Err(Malformed("the capture time is not finite, or half an hour from the sending"));
    }
    let mut out = vec![PACKET_VERSION, packet.station.0];
    out.extend_from_slice(&packet.life.to_le_bytes());
    put_varint(&mut out, packet.sequence.into());
    put_f64(&mut out, packet.time_s);
    put_signed(&mut out, delay_us.round() as i32);
    put_varint(&mut out, packet.greatest.0.into());
    out.extend([u8::from(packet.is_blind), packet.reports.len() as u8, packet.messages.len() as u8]);
    for report in &packet.reports {
        put_report(&mut out, report)?;
    }
    for message in &packet.messages {
        put_message(&mut out, message)?;
    }
    Ok(out)
}

/// Decodes a packet, and the time of its sending on the sender's clock, seconds.
///
/// # Errors
/// Bytes that are not exactly one packet of this version within the limits.
pub fn decode(bytes: &[u8]) -> Result<(Packet, f64), Malformed> {
    if bytes.len() > LONGEST_PACKET {
        return Err(Malformed("the packet is longer than 6 KiB"));
    }
    let mut reader = Reader::new(bytes);
    if reader.byte()? != PACKET_VERSION {
        return Err(Malformed("the packet has another version"));
    }
    let station = StationId(reader.byte()?);
    let life = u32::from_le_bytes(reader.array()?);
    let sequence = reader.size(u32::MAX)?;
    let time_s = reader.finite()?;
    let delay_us = f64::from(signed(&mut reader)?);
    if delay_us.abs() > LONGEST_DELAY_US {
        return Err(Malformed("the capture time is half an hour from the sending"));
    }
    let greatest = TargetId(reader.size(u32::MAX)?);
    let is_blind = match reader.byte()? {
        0 => false,
        1 => true,
        _ => return Err(Malformed("the packet has an unknown flag")),
    };
    let (reports, messages) = (usize::from(reader.byte()?), usize::from(reader.byte()?));
    if reports > MOST_REPORTS || messages > MOST_MESSAGES {
        return Err(Malformed("the packet has more than 64 reports or messages"));
    }
    let reports = (0..reports).map(|_| report(&mut reader, station)).collect::<Decoded<_>>()?;
    let messages = (0..messages).map(|_| message(&mut reader, station)).collect::<Decoded<_>>()?;
    reader.finish()?;
    let packet = Packet { station, life, sequence, time_s, greatest, is_blind, reports, messages };
    check(&packet)?;
    Ok((packet, time_s + delay_us / 1e6))
}

/// Checks the conditions on every packet, before sending and after receiving.
fn check(packet: &Packet) -> Decoded<()> {
    if packet.reports.len() > MOST_REPORTS || packet.messages.len() > MOST_MESSAGES {
        return Err(Malformed("the packet has more than 64 reports or messages"));
    }
    let mut targets: Vec<TargetId> = packet
        .reports
        .iter()
        .map(|report| report.target)
        .filter(|target| *target > TargetId::ALONE)
        .collect();
    targets.sort_unstable();
    if targets.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(Malformed("two reports are of one target"));
    }
    let is_own = |agent: AgentId| agent.station == packet.station;
    let asks_for_own = |message: &MediatorMessage| match message {
        MediatorMessage::Request { agent, .. } => is_own(*agent),
        MediatorMessage::Answer { .. } => true,
    };
    if packet.reports.iter().all(|report| is_own(report.agent)) && packet.messages.iter().all(asks_for_own) {
        Ok(())
    } else {
        Err(Malformed("an agent is of another station than the sender"))
    }
}

fn put_report(out: &mut Vec<u8>, report: &Report) -> Decoded<()> {
    put_varint(out, report.agent.number.into());
    put_varint(out, report.target.0.into());
    let flag = |is_set: bool, flag: u8| if is_set { flag } else { 0 };
    out.push(flag(report.looks.is_some(), WITH_LOOKS) | flag(report.is_crowded, IS_CROWDED));
    put_place(out, report.position)?;
    put_covariance(out, &report.covariance)?;
    for speed in [report.velocity.x, report.velocity.y] {
        let speed_cm_s = (speed * 100.0).clamp(-FASTEST_CM_S, FASTEST_CM_S);
        if speed_cm_s.is_nan() {
            return Err(Malformed("a velocity is not a number"));
        }
        put_signed(out, speed_cm_s.round() as i32);
    }
    put_within(out, report.height_m * 1000.0, [0.0, TALLEST_MM])?;
    put_confidence(out, report.confidence)?;
    if let Some(looks) = &report.looks {
        put_looks(out, looks)?;
    }
    Ok(())
}

fn report(reader: &mut Reader<'_>, station: StationId) -> Decoded<Report> {
    let agent = AgentId { station, number: reader.size(u32::MAX)? };
    let target = TargetId(reader.size(u32::MAX)?);
    let flags = reader.byte()?;
    if flags > WITH_LOOKS | IS_CROWDED {
        return Err(Malformed("a report has an unknown flag"));
    }
    let (position, covariance) = (place(reader)?, covariance(reader)?);
    let mut speed = || -> Decoded<f64> {
        let speed_cm_s = f64::from(signed(reader)?);
        if speed_cm_s.abs() > FASTEST_CM_S {
            return Err(Malformed("a velocity is above its limit"));
        }
        Ok(speed_cm_s / 100.0)
    };
    let velocity = Vector2::new(speed()?, speed()?);
    let height_m = f64::from(within(reader, [0.0, TALLEST_MM])?) / 1000.0;
    let confidence = confidence(reader)?;
    let looks = if flags & WITH_LOOKS == 0 { None } else { Some(quantised::looks(reader)?) };
    let is_crowded = flags & IS_CROWDED != 0;
    Ok(Report { agent, target, position, covariance, velocity, height_m, looks, confidence, is_crowded })
}

fn put_message(out: &mut Vec<u8>, message: &MediatorMessage) -> Decoded<()> {
    match message {
        MediatorMessage::Request { agent, candidate, position, looks } => {
            out.push(if looks.is_some() { 2 } else { 1 });
            put_varint(out, agent.number.into());
            put_varint(out, candidate.0.into());
            put_place(out, *position)?;
            looks.as_ref().map_or(Ok(()), |looks| put_looks(out, looks))
        }
        MediatorMessage::Answer { agent, candidate, is_granted } => {
            out.extend([if *is_granted { 4 } else { 3 }, agent.station.0]);
            put_varint(out, agent.number.into());
            put_varint(out, candidate.0.into());
            Ok(())
        }
    }
}

fn message(reader: &mut Reader<'_>, station: StationId) -> Decoded<MediatorMessage> {
    let kind = reader.byte()?;
    let asked_of = match kind {
        1 | 2 => station,
        3 | 4 => StationId(reader.byte()?),
        _ => return Err(Malformed("a message's kind is unknown")),
    };
    let agent = AgentId { station: asked_of, number: reader.size(u32::MAX)? };
    let candidate = TargetId(reader.size(u32::MAX)?);
    if kind > 2 {
        return Ok(MediatorMessage::Answer { agent, candidate, is_granted: kind == 4 });
    }
    let position: Point2<f64> = place(reader)?;
    let looks = if kind == 2 { Some(quantised::looks(reader)?) } else { None };
    Ok(MediatorMessage::Request { agent, candidate, position, looks })
}
