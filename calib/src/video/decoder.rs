//! One video, a file or a network stream, decoded by FFmpeg.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ffmpeg::codec::packet::side_data;
use ffmpeg::codec::threading;
use ffmpeg::error::EAGAIN;
use ffmpeg::format::context::Input;
use ffmpeg::format::{Pixel, stream::Stream};
use ffmpeg::media::Type;
use ffmpeg::{Error, Packet, Rational, codec, decoder, format, frame};
use image::{RgbImage, imageops};

use super::pixels;

/// How long a stream may take to open, and between two of its frames.
const OPENS_WITHIN: Duration = Duration::from_secs(10);
const READS_WITHIN: Duration = Duration::from_secs(5);

/// So many torn packets in a row end a video: noise, not a film.
const TORN_IN_A_ROW: usize = 500;

/// Above this, what a header calls frames a second is the ticking of its clock.
const FASTEST_HZ: f64 = 500.0;

/// A video, and the picture of it that was decoded last.
pub(super) struct Decoder {
    input: Input,
    stream: usize,
    codec: decoder::Video,
    packet: Packet,
    picture: frame::Video,
    rgb: frame::Video,
    quarter_turns: u8,
    torn: usize,
    /// With the network.
    patience: Option<Patience>,
    is_at_end: bool,
    rate_hz: Option<f64>,
    frames: Option<usize>,
}

impl Decoder {
    /// Opens a file.
    pub(super) fn open_file(path: &str) -> Result<Self, Error> {
        super::start_ffmpeg()?;
        // The prefix keeps a name with a colon from being read as a protocol's.
        let input = format::input(&format!("file:{path}"))?;
        Self::new(input, threading::Type::Frame, None)
    }

    /// Opens a network stream by its URL. Its pictures are not held back to be decoded side by side.
    pub(super) fn open_url(url: &str) -> Result<Self, Error> {
        super::start_ffmpeg()?;
        let patience = Patience::new(OPENS_WITHIN);
        let asked = patience.clone();
        // Cameras that stream over UDP lose packets, and pictures with them.
        let options = ffmpeg::dict!("rtsp_transport" => "tcp");
        let input = format::input_with_interrupt_and_dictionary(url, move || asked.is_over(), options)?;
        Self::new(input, threading::Type::Slice, Some(patience))
    }

    fn new(input: Input, kind: threading::Type, patience: Option<Patience>) -> Result<Self, Error> {
        let stream = input.streams().best(Type::Video).ok_or(Error::StreamNotFound)?;
        let mut context = codec::context::Context::from_parameters(stream.parameters())?;
        context.set_threading(threading::Config { kind, ..threading::Config::default() });
        let rate_hz = rate_hz(&stream);
        let (index, frames) = (stream.index(), frames(&stream, &input, rate_hz));
        let quarter_turns = quarter_turns(&stream);
        Ok(Self {
            codec: context.decoder().video()?,
            input,
            stream: index,
            packet: Packet::empty(),
            picture: frame::Video::empty(),
            rgb: frame::Video::empty(),
            quarter_turns,
            torn: 0,
            patience,
            is_at_end: false,
            rate_hz,
            frames,
        })
    }

    /// Frames a second, where the container says so.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// Frames in all, where the container says so or says how long it lasts.
    pub(super) fn frames(&self) -> Option<usize> {
        self.frames
    }

    /// Width and height of the picture that was decoded last, as it is to be seen.
    pub(super) fn size(&self) -> (u32, u32) {
        let (width, height) = (self.picture.width(), self.picture.height());
        if self.quarter_turns.is_multiple_of(2) { (width, height) } else { (height, width) }
    }

    /// Decodes the next picture. `false` when there are no more.
    pub(super) fn advance(&mut self) -> bool {
        if let Some(patience) = &self.patience {
            patience.renew(READS_WITHIN);
        }
        while self.torn < TORN_IN_A_ROW {
            match self.codec.receive_frame(&mut self.picture) {
                Ok(()) => {
                    self.torn = 0;
                    return true;
                }
                Err(Error::Other { errno: EAGAIN }) if !self.is_at_end => self.feed(),
                Err(Error::InvalidData) => self.torn += 1,
                Err(_) => return false,
            }
        }
        false
    }

    /// Hands the decoder the next packet, or tells it that there are no more.
    fn feed(&mut self) {
        let sent = match self.packet.read(&mut self.input) {
            Ok(()) if self.packet.stream() != self.stream => Ok(()),
            Ok(()) => self.codec.send_packet(&self.packet),
            Err(Error::InvalidData) => Err(Error::InvalidData),
            // Its end, or a stream that has broken off.
            Err(_) => {
                self.is_at_end = true;
                self.codec.send_eof()
            }
        };
        self.torn += usize::from(sent.is_err());
    }

    /// The picture that was decoded last, into an image of its [`size`](Self::size).
    pub(super) fn picture(&mut self, into: &mut RgbImage) -> Result<(), Error> {
        if (self.rgb.width(), self.rgb.height()) != (self.picture.width(), self.picture.height()) {
            self.rgb = frame::Video::empty();
        }
        pixels::convert(&self.picture, &mut self.rgb, Pixel::RGB24)?;
        if self.quarter_turns == 0 {
            pixels::copy_rgb(&self.rgb, into);
            return Ok(());
        }
        let mut lying = RgbImage::new(self.rgb.width(), self.rgb.height());
        pixels::copy_rgb(&self.rgb, &mut lying);
        // The image has the right size: these fail for another only.
        let _ = match self.quarter_turns {
            1 => imageops::rotate90_in(&lying, into),
            2 => imageops::rotate180_in(&lying, into),
            _ => imageops::rotate270_in(&lying, into),
        };
        Ok(())
    }
}

impl std::fmt::Debug for Decoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Decoder")
            .field("stream", &self.stream)
            .field("size", &self.size())
            .finish_non_exhaustive()
    }
}

fn rate_hz(stream: &Stream) -> Option<f64> {
    // The rate that all time stamps fit on, unless that is the clock's; then the mean.
    [stream.rate(), stream.avg_frame_rate()]
        .into_iter()
        .map(hertz)
        .find(|hz| (f64::MIN_POSITIVE..FASTEST_HZ).contains(hz))
}

/// 0 where it is not known.
fn hertz(rate: Rational) -> f64 {
    if rate.denominator() == 0 { 0.0 } else { f64::from(rate) }
}

fn frames(stream: &Stream, input: &Input, rate_hz: Option<f64>) -> Option<usize> {
    if stream.frames() > 0 {
        return usize::try_from(stream.frames()).ok();
    }
    let seconds = input.duration() as f64 / f64::from(ffmpeg::ffi::AV_TIME_BASE);
    let frames = (seconds * rate_hz?).round();
    (frames >= 1.0).then_some(frames as usize)
}

/// How often a picture is to be turned clockwise by a quarter before it is seen: telephones film lying and say so.
fn quarter_turns(stream: &Stream) -> u8 {
    let matrix = stream.side_data().find(|data| data.kind() == side_data::Type::DisplayMatrix);
    let Some(matrix) = matrix else { return 0 };
    // The first two entries of the first row, as 16.16 fixed point: where the picture's x goes, in an image's axes.
    let entry = |index: usize| {
        let bytes = matrix.data().get(4 * index..4 * index + 4)?;
        Some(f64::from(i32::from_ne_bytes(bytes.try_into().ok()?)))
    };
    let (Some(x), Some(y)) = (entry(0), entry(1)) else { return 0 };
    (y.atan2(x) / std::f64::consts::FRAC_PI_2).round().rem_euclid(4.0) as u8
}

/// Until when FFmpeg may wait for the network; it asks between its own waits.
#[derive(Clone)]
struct Patience(Arc<Mutex<Instant>>);

impl Patience {
    fn new(lasts: Duration) -> Self {
        Self(Arc::new(Mutex::new(Instant::now() + lasts)))
    }

    fn renew(&self, lasts: Duration) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now() + lasts;
    }

    fn is_over(&self) -> bool {
        Instant::now() > *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
