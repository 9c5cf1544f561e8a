//! The times of a frame: on the clock of its source, on the sender's, and on ours.

use std::collections::VecDeque;
use std::time::Instant;

use ffmpeg::codec::packet::side_data;
use ffmpeg::{Packet, Rational, codec, frame};

/// Number of packets whose times are kept until their frames leave the decoder: more than any codec reorders.
const PACKETS_REMEMBERED: usize = 64;

/// Ticks in one round of RTP's 32-bit clock.
const RTP_CLOCK_TICKS: f64 = 4_294_967_296.0;
/// Tolerance within which a step of the sender's clock counts as one round of RTP's clock, seconds.
const ROUND_FITS_WITHIN_S: f64 = 1.0;

/// Times of one frame, as far as its source knows them.
///
/// Times are given as they come. They may repeat or run backwards when a source is faulty or restarts; compare with
/// the frame before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameStamp {
    /// Presentation time on the source's own clock, seconds. `None` where the source has no clock: images, raw
    /// streams, motion JPEG over HTTP. Also `None` for the first frames of a stream that start without a time stamp,
    /// as those of RTSP may.
    ///
    /// * A recording (a file, or a URL that states its duration) of a format whose times count from the file's zero
    ///   (MP4, MOV, MKV, `WebM`, AVI, FLV and the like): the time that a player shows, edit lists applied. The first
    ///   frame may be later than 0.
    /// * Other recordings (MPEG-TS, whose clock starts anywhere) and live streams: since the earliest start of any of
    ///   the source's streams, picture or sound.
    /// * A device: the driver's monotonic clock, which all devices of a machine share.
    pub presentation_s: Option<f64>,
    /// Sender's wall clock when the frame was taken, seconds since 1970 UTC, from the RTCP sender reports of RTSP and
    /// RTP sources. `None` until the first report has come, and for all other sources.
    pub sender_s: Option<f64>,
    /// Time at which the last packet of the frame had been read, before decoding. FFmpeg knows that a frame of H.264
    /// or H.265 over RTP is complete only when the next one begins, so these arrivals are one frame late.
    pub arrival: Instant,
}

impl FrameStamp {
    /// Stamp of a frame that is read now from a source without a clock.
    pub(super) fn now() -> Self {
        Self { presentation_s: None, sender_s: None, arrival: Instant::now() }
    }
}

/// Converter from the ticks of a stream to seconds of its source's clock.
#[derive(Debug)]
pub(super) struct PresentationClock {
    tick: Rational,
    zero_s: f64,
    /// Duration of one frame, where the source states its rate.
    frame_s: Option<f64>,
    previous_s: Option<f64>,
}

impl PresentationClock {
    pub(super) fn new(tick: Rational, zero_s: f64, rate_hz: Option<f64>) -> Self {
        Self { tick, zero_s, frame_s: rate_hz.map(f64::recip), previous_s: None }
    }

    /// Presentation time of the next frame, seconds. A frame without a time stamp follows the one before it at the
    /// source's rate.
    pub(super) fn next_s(&mut self, ticks: Option<i64>) -> Option<f64> {
        let told_s = ticks.map(|ticks| seconds(ticks, self.tick) - self.zero_s);
        let next_s = told_s.or_else(|| Some(self.previous_s? + self.frame_s?));
        self.previous_s = next_s;
        next_s
    }
}

/// Converts a number of ticks, each of `tick` seconds, to seconds.
pub(super) fn seconds(ticks: i64, tick: Rational) -> f64 {
    ticks as f64 * f64::from(tick.numerator()) / f64::from(tick.denominator())
}

/// Times of the packets that were read last, looked up when their frames come out of the decoder.
#[derive(Debug)]
pub(super) struct PacketTimes {
    recent: VecDeque<PacketTime>,
    sender: SenderClock,
}

#[derive(Debug, Clone, Copy)]
struct PacketTime {
    pts: Option<i64>,
    dts: Option<i64>,
    sender_s: Option<f64>,
    arrival: Instant,
}

impl PacketTimes {
    pub(super) fn new(tick: Rational, codec: codec::Id) -> Self {
        Self { recent: VecDeque::with_capacity(PACKETS_REMEMBERED), sender: SenderClock::new(tick, codec) }
    }

    /// Remembers a packet that has just been read.
    pub(super) fn remember(&mut self, packet: &Packet) {
        let (pts, dts) = (packet.pts(), packet.dts());
        let sender_s = self.sender.next_s(wall_clock_s(packet), pts);
        if self.recent.len() == PACKETS_REMEMBERED {
            self.recent.pop_front();
        }
        self.recent.push_back(PacketTime { pts, dts, sender_s, arrival: Instant::now() });
    }

    /// Number of remembered packets whose time stamp lies after `after` and before `until`, ticks.
    pub(super) fn between(&self, after: i64, until: i64) -> usize {
        let shown = self.recent.iter().filter_map(|packet| packet.pts.or(packet.dts));
        shown.filter(|ticks| (after + 1..until).contains(ticks)).count()
    }

    /// Sender's time (seconds since 1970) and arrival of the packet that a frame was decoded from.
    pub(super) fn of_frame(&self, frame: &frame::Video) -> (Option<f64>, Instant) {
        let (pts, dts) = (frame.pts(), Some(frame.packet().dts).filter(|dts| *dts != i64::MIN));
        let newest_first = || self.recent.iter().rev();
        let found = newest_first()
            .find(|packet| pts.is_some() && packet.pts == pts)
            .or_else(|| newest_first().find(|packet| dts.is_some() && packet.dts == dts))
            .or_else(|| self.recent.back());
        found.map_or_else(|| (None, Instant::now()), |packet| (packet.sender_s, packet.arrival))
    }
}

/// Sender's wall clock attached to a packet, seconds since 1970: FFmpeg's `AVProducerReferenceTime`, which begins
/// with microseconds in 64 bits.
fn wall_clock_s(packet: &Packet) -> Option<f64> {
    let reference = packet.side_data().find(|data| data.kind() == side_data::Type::PRFT)?;
    let microseconds = reference.data().first_chunk::<8>()?;
    Some(i64::from_ne_bytes(*microseconds) as f64 / 1e6)
}

/// Sender's wall clock at each packet, from the times that FFmpeg attaches to the packets of an RTP stream.
#[derive(Debug)]
struct SenderClock {
    tick: Rational,
    /// Whether the time attached to a packet belongs to the packet after it. Where FFmpeg's parser cuts a stream into
    /// frames, a frame comes out when the next one begins, with the time attached to that beginning.
    is_one_ahead: bool,
    /// Sender's time of the next packet, used where `is_one_ahead`.
    ahead_s: Option<f64>,
    /// Sender's time and time stamp of the packet before.
    previous: Option<(f64, i64)>,
}

impl SenderClock {
    fn new(tick: Rational, codec: codec::Id) -> Self {
        let is_one_ahead = matches!(
            codec,
            codec::Id::H264
                | codec::Id::HEVC
                | codec::Id::MPEG4
                | codec::Id::H263
                | codec::Id::H263P
                | codec::Id::MPEG1VIDEO
                | codec::Id::MPEG2VIDEO
        );
        Self { tick, is_one_ahead, ahead_s: None, previous: None }
    }

    /// Sender's time of the next packet, seconds since 1970.
    fn next_s(&mut self, attached_s: Option<f64>, pts: Option<i64>) -> Option<f64> {
        let told_s =
            if self.is_one_ahead { std::mem::replace(&mut self.ahead_s, attached_s) } else { attached_s }?;
        let Some(pts) = pts else { return Some(told_s) };
        let sender_s = self.same_round_s(told_s, pts);
        self.previous = Some((sender_s, pts));
        Some(sender_s)
    }

    /// Corrects the sender's time by one round of RTP's clock (13 hours at 90 kHz), which FFmpeg before 6 loses or
    /// gains when that clock wraps, until the next sender report.
    fn same_round_s(&self, told_s: f64, pts: i64) -> f64 {
        let Some((previous_s, previous_pts)) = self.previous else { return told_s };
        let step_s = told_s - previous_s - seconds(pts.wrapping_sub(previous_pts), self.tick);
        let round_s = RTP_CLOCK_TICKS * f64::from(self.tick);
        if (step_s.abs() - round_s).abs() < ROUND_FITS_WITHIN_S {
            told_s - round_s.copysign(step_s)
        } else {
            told_s
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: Rational = Rational(1, 90_000);

    #[test]
    fn frames_without_a_time_stamp_follow_at_the_rate() {
        let mut clock = PresentationClock::new(Rational(1, 1000), 0.5, Some(10.0));
        let times: Vec<Option<f64>> =
            [None, Some(2500), None, None, Some(2600), Some(2400)].map(|ticks| clock.next_s(ticks)).into();
        let expected = [None, Some(2.0), Some(2.1), Some(2.2), Some(2.1), Some(1.9)];
        for (time, expected) in times.iter().zip(expected) {
            match (time, expected) {
                (Some(time), Some(expected)) => assert!((time - expected).abs() < 1e-9, "{times:?}"),
                _ => assert_eq!(*time, expected, "{times:?}"),
            }
        }
        let mut rateless = PresentationClock::new(Rational(1, 1000), 0.0, None);
        assert_eq!([rateless.next_s(Some(40)), rateless.next_s(None)], [Some(0.04), None]);
    }

    #[test]
    fn a_round_of_the_rtp_clock_is_no_step_of_the_senders() {
        let round_s = RTP_CLOCK_TICKS / 90_000.0;
        let mut clock = SenderClock::new(TICK, codec::Id::MJPEG);
        let mut at = |told_s: f64, frame: i64| clock.next_s(Some(told_s), Some(3600 * frame)).unwrap();
        assert!((at(1000.0, 0) - 1000.0).abs() < 1e-6);
        // The clock of the packets has wrapped, that of the last report has not.
        assert!((at(1000.04 - round_s, 1) - 1000.04).abs() < 1e-6);
        assert!((at(1000.08 - round_s, 2) - 1000.08).abs() < 1e-6);
        assert!((at(1000.12, 3) - 1000.12).abs() < 1e-6);
        // A camera's clock that was set to another time is followed.
        assert!((at(1.7e9, 4) - 1.7e9).abs() < 1e-6);
    }

    #[test]
    fn the_time_on_a_parsed_packet_belongs_to_the_next_frame() {
        let mut clock = SenderClock::new(TICK, codec::Id::H264);
        let told = [(None, 0), (Some(5.2), 3600), (Some(5.3), 18_000), (None, 27_000), (Some(9.0), 28_800)];
        let times: Vec<Option<f64>> = told.map(|(told_s, pts)| clock.next_s(told_s, Some(pts))).into();
        assert_eq!(times, [None, None, Some(5.2), Some(5.3), None]);
    }
}
