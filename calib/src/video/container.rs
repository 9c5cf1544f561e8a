//! Facts about a video from its container's header: rate, length, rotation, clock.

use ffmpeg::codec::packet::side_data;
use ffmpeg::format::context::Input;
use ffmpeg::format::stream::Stream;
use ffmpeg::{Rational, media};

use super::pixels::Orientation;
use super::stamp::seconds;

/// Highest plausible frame rate; a header that claims more states the tick rate of its clock.
const FASTEST_HZ: f64 = 500.0;

/// FFmpeg's names of the formats whose time stamps are those of a clock, and count from the file's own zero.
const FROM_ZERO: &[&str] =
    &["mov", "matroska", "avi", "flv", "asf", "asf_o", "nut", "ogg", "gif", "apng", "ivf", "mxf", "gxf"];
/// FFmpeg's names of the formats whose clock starts at any value. For all other formats (motion JPEG over HTTP, raw
/// streams, images) FFmpeg invents the time stamps.
const FROM_ANYWHERE: &[&str] =
    &["mpegts", "mpeg", "rtsp", "rtp", "sdp", "live_flv", "hls", "dash", "concat", "dv", "wtv", "rm"];

/// Zero of the container's clock, in seconds of its time stamps; `None` where FFmpeg invents the time stamps.
pub(super) fn zero_s(input: &Input, is_recording: bool) -> Option<f64> {
    let format = input.format();
    let is_in = |names: &[&str]| format.name().split(',').any(|name| names.contains(&name));
    match (is_in(FROM_ZERO), is_in(FROM_ANYWHERE)) {
        (true, _) if is_recording => Some(0.0),
        (false, false) => None,
        _ => Some(start_s(input).unwrap_or(0.0)),
    }
}

/// Earliest start of the container's video and audio streams, seconds.
fn start_s(input: &Input) -> Option<f64> {
    let is_played =
        |stream: &Stream| [media::Type::Video, media::Type::Audio].contains(&stream.parameters().medium());
    let starts = input.streams().filter(|stream| is_played(stream) && stream.start_time() != i64::MIN);
    starts.map(|stream| seconds(stream.start_time(), stream.time_base())).min_by(f64::total_cmp)
}

/// Frames per second, where the container states it.
pub(super) fn rate_hz(stream: &Stream) -> Option<f64> {
    // The rate whose grid fits all time stamps, unless it is the tick rate of the clock; then the mean rate.
    [stream.rate(), stream.avg_frame_rate()].into_iter().find_map(plausible_hz)
}

/// Frames per second on average, where the container states it: less than [`rate_hz`] where frames were lost.
pub(super) fn mean_rate_hz(stream: &Stream) -> Option<f64> {
    plausible_hz(stream.avg_frame_rate())
}

fn plausible_hz(rate: Rational) -> Option<f64> {
    let hz = if rate.denominator() == 0 { 0.0 } else { f64::from(rate) };
    (f64::MIN_POSITIVE..FASTEST_HZ).contains(&hz).then_some(hz)
}

/// Estimated number of frames that are shown; `None` where the container states neither their number nor its
/// duration. An edit list shows fewer frames than are stored, and the mean rate may be off.
pub(super) fn frames(stream: &Stream, input: &Input) -> Option<usize> {
    let mean_hz = mean_rate_hz(stream).or_else(|| rate_hz(stream));
    let lasts_s = lasts_s(stream, input);
    let lasting = lasts_s.zip(mean_hz).map(|(lasts_s, hz)| (lasts_s * hz).round() as usize);
    let stored = usize::try_from(stream.frames()).ok().filter(|stored| *stored > 0);
    match (stored, lasting.filter(|frames| *frames > 0)) {
        (Some(stored), Some(lasting)) => Some(stored.min(lasting)),
        (stored, lasting) => stored.or(lasting),
    }
}

/// Duration for which the stream is shown, seconds, without the time before its start.
fn lasts_s(stream: &Stream, input: &Input) -> Option<f64> {
    if stream.duration() > 0 {
        return Some(seconds(stream.duration(), stream.time_base()));
    }
    let lasts_s = input.duration() as f64 / f64::from(ffmpeg::ffi::AV_TIME_BASE);
    // Matroska's duration counts from zero.
    let is_from_zero = input.format().name().starts_with("matroska") && stream.start_time() > 0;
    let before_s = if is_from_zero { seconds(stream.start_time(), stream.time_base()) } else { 0.0 };
    (lasts_s > before_s).then_some(lasts_s - before_s)
}

/// Orientation in which a picture is shown: telephones store it lying and state the turn, front cameras may mirror it.
pub(super) fn orientation(stream: &Stream) -> Orientation {
    let matrix = stream.side_data().find(|data| data.kind() == side_data::Type::DisplayMatrix);
    let Some(matrix) = matrix else { return Orientation::UPRIGHT };
    // Entries of the matrix row by row, 16.16 fixed point; those of the first two rows and columns are the directions
    // of the picture's x and y axes, in image axes.
    let entry = |index: usize| {
        let bytes = matrix.data().get(4 * index..4 * index + 4)?;
        Some(f64::from(i32::from_ne_bytes(bytes.try_into().ok()?)))
    };
    let [Some(x_right), Some(x_down), Some(y_right), Some(y_down)] = [0, 1, 3, 4].map(entry) else {
        return Orientation::UPRIGHT;
    };
    let is_mirrored = x_right * y_down - x_down * y_right < 0.0;
    // A mirrored picture's x axis points the other way before it is turned.
    let sign = if is_mirrored { -1.0 } else { 1.0 };
    let turns = (sign * x_down).atan2(sign * x_right) / std::f64::consts::FRAC_PI_2;
    Orientation { is_mirrored, quarter_turns: turns.round().rem_euclid(4.0) as u8 }
}
