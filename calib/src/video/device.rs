//! A camera of this machine, by its number: `/dev/videoN`, read by Video4Linux.

use std::time::Duration;

use ffmpeg::format::Pixel;
use ffmpeg::{codec, decoder, frame};
use image::RgbImage;
use v4l::buffer::{Flags, Metadata, Type};
use v4l::io::traits::CaptureStream;
use v4l::prelude::MmapStream;
use v4l::video::Capture;
use v4l::{FourCC, Fraction};

use super::pixels::{Orientation, RgbBuffers};
use super::stamp::FrameStamp;

/// Supported formats: motion JPEG, and YUYV with two bytes a pixel, which nearly all devices offer.
const MOTION_JPEG: [u8; 4] = *b"MJPG";
const YUYV: [u8; 4] = *b"YUYV";

/// Longest wait for a picture.
const READS_WITHIN: Duration = Duration::from_secs(5);
/// Pictures that the driver may fill while one is in use.
const BUFFERS: u32 = 4;

/// A device, and the picture of it that came last.
pub(super) struct Device {
    stream: MmapStream<'static>,
    /// Decoder of motion JPEG; the other format needs none.
    decoder: Option<decoder::Video>,
    picture: frame::Video,
    rgb: RgbBuffers,
    stamp: FrameStamp,
    rate_hz: Option<f64>,
}

impl Device {
    /// Opens a camera at its present size and rate (`v4l2-ctl` sets them).
    pub(super) fn open(number: usize) -> Result<Self, String> {
        let said = |error: std::io::Error| format!("/dev/video{number}: {error}");
        let device = v4l::Device::new(number).map_err(said)?;
        let mut format = device.format().map_err(said)?;
        for known in [format.fourcc.repr, MOTION_JPEG, YUYV] {
            if [MOTION_JPEG, YUYV].contains(&format.fourcc.repr) {
                break;
            }
            format.fourcc = FourCC::new(&known);
            format = device.set_format(&format).map_err(said)?;
        }
        let decoder = match format.fourcc.repr {
            YUYV => None,
            MOTION_JPEG => Some(motion_jpeg().map_err(|error| error.to_string())?),
            _ => return Err(format!("gives {} only; motion JPEG or YUYV is needed", format.fourcc)),
        };
        let rate_hz = device.params().ok().and_then(|parameters| rate_hz(parameters.interval));
        let mut stream = MmapStream::with_buffers(&device, Type::VideoCapture, BUFFERS).map_err(said)?;
        stream.set_timeout(READS_WITHIN);
        let picture = frame::Video::new(Pixel::YUYV422, format.width, format.height);
        Ok(Self { stream, decoder, picture, rgb: RgbBuffers::new(), stamp: FrameStamp::now(), rate_hz })
    }

    /// Frames per second, where the driver states it.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// Width and height of the pictures.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.picture.width(), self.picture.height())
    }

    /// Waits for the next picture. `false` when no more come.
    pub(super) fn advance(&mut self) -> bool {
        // The first pictures of a camera are sometimes torn.
        const TRIES: usize = 10;
        (0..TRIES).any(|_| {
            let Ok((bytes, metadata)) = self.stream.next() else { return false };
            self.stamp = FrameStamp { presentation_s: driver_s(*metadata), ..FrameStamp::now() };
            let Some(decoder) = &mut self.decoder else { return paste_yuyv(bytes, &mut self.picture) };
            let packet = codec::packet::Packet::copy(bytes);
            decoder.send_packet(&packet).is_ok() && decoder.receive_frame(&mut self.picture).is_ok()
        })
    }

    /// Times of the picture that came last.
    pub(super) fn stamp(&self) -> FrameStamp {
        self.stamp
    }

    /// Converts the picture that came last into an image of any size.
    pub(super) fn picture(&mut self, into: &mut RgbImage) -> Result<(), ffmpeg::Error> {
        self.rgb.picture(&self.picture, Orientation::UPRIGHT, into)
    }
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Device").field("size", &self.size()).finish_non_exhaustive()
    }
}

fn motion_jpeg() -> Result<decoder::Video, ffmpeg::Error> {
    super::start_ffmpeg()?;
    let codec = decoder::find(codec::Id::MJPEG).ok_or(ffmpeg::Error::DecoderNotFound)?;
    codec::context::Context::new().decoder().open_as(codec)?.video()
}

/// Capture time by the driver, seconds of the machine's monotonic clock; `None` where the driver has none.
fn driver_s(metadata: Metadata) -> Option<f64> {
    let is_monotonic = metadata.flags & Flags::TIMESTAMP_MASK == Flags::TIMESTAMP_MONOTONIC;
    let seconds = metadata.timestamp.sec as f64 + metadata.timestamp.usec as f64 / 1e6;
    (is_monotonic && seconds > 0.0).then_some(seconds)
}

fn rate_hz(interval: Fraction) -> Option<f64> {
    (interval.numerator > 0).then(|| f64::from(interval.denominator) / f64::from(interval.numerator))
}

/// Copies YUYV bytes into a frame; `false` for bytes that are too few for a picture.
fn paste_yuyv(bytes: &[u8], into: &mut frame::Video) -> bool {
    let (row_bytes, stride) = (2 * into.width() as usize, into.stride(0));
    if bytes.len() < row_bytes * into.height() as usize {
        return false;
    }
    for (line, row) in into.data_mut(0).chunks_mut(stride).zip(bytes.chunks_exact(row_bytes)) {
        line[..row_bytes].copy_from_slice(row);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_bytes_a_pixel_are_luma_and_shared_chroma() {
        let mut picture = frame::Video::new(Pixel::YUYV422, 6, 2);
        // Mid grey, then BT.601's red.
        let bytes = [[128, 128, 128, 128].repeat(3), [81, 90, 81, 240].repeat(3)].concat();
        assert!(!paste_yuyv(&bytes[1..], &mut picture));
        assert!(paste_yuyv(&bytes, &mut picture));
        let mut image = RgbImage::new(6, 2);
        RgbBuffers::new().picture(&picture, Orientation::UPRIGHT, &mut image).unwrap();
        // (128 − 16) · 255 / 219
        assert!(image.rows().next().unwrap().all(|p| p.0.iter().all(|v| v.abs_diff(130) <= 2)), "{image:?}");
        assert!(image.rows().nth(1).unwrap().all(|p| p[0] > 250 && p[1] < 5 && p[2] < 5), "{image:?}");
    }

    #[test]
    fn the_drivers_time_is_taken_from_a_monotonic_clock_only() {
        let told = |flags, sec| {
            let timestamp = v4l::Timestamp::new(sec, 250_000);
            driver_s(Metadata { flags, timestamp, ..Metadata::default() })
        };
        assert_eq!(told(Flags::TIMESTAMP_MONOTONIC | Flags::DONE, 12), Some(12.25));
        assert_eq!(told(Flags::TIMESTAMP_COPY, 12), None);
        assert_eq!(told(Flags::TIMESTAMP_UNKNOWN, 12), None);
    }

    #[test]
    fn a_camera_that_is_not_there_is_named() {
        let said = Device::open(4711).unwrap_err();
        assert!(said.contains("/dev/video4711"), "{said}");
    }
}
