//! One video, a file or a network stream, decoded by FFmpeg.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ffmpeg::codec::threading;
use ffmpeg::error::EAGAIN;
use ffmpeg::format::context::Input;
use ffmpeg::media::Type;
use ffmpeg::{Discard, Error, Packet, codec, decoder, format, frame};
use image::RgbImage;

use super::container;
use super::pixels::{Orientation, RgbBuffers};
use super::stamp::{FrameStamp, PacketTimes, PresentationClock};
use crate::picture;

/// Longest time that a stream may take to open, and between two of its frames.
const OPENS_WITHIN: Duration = Duration::from_secs(10);
const READS_WITHIN: Duration = Duration::from_secs(5);

/// Number of torn packets in a row that end a video: it is noise, not a film.
const TORN_IN_A_ROW: usize = 500;

/// A video, and the picture of it that was decoded last.
pub(super) struct Decoder {
    input: Input,
    stream: usize,
    codec: decoder::Video,
    picture: frame::Video,
    rgb: RgbBuffers,
    orientation: Orientation,
    /// Packets that the decoder has refused since the last picture.
    torn: usize,
    /// Timeouts of the network; `None` for files.
    patience: Option<Patience>,
    end: Option<PacketEnd>,
    /// Whether the packet read last is shorter than the container states.
    is_short: bool,
    /// Clock of the time stamps; `None` for sources without one.
    clock: Option<PresentationClock>,
    packets: PacketTimes,
    /// Time stamp at which the shown part of the stream ends, ticks; an edit list may leave packets after it.
    shown_until: i64,
    /// Latest time stamp of a picture, ticks.
    last_ticks: Option<i64>,
    stamp: FrameStamp,
    rate_hz: Option<f64>,
    mean_rate_hz: Option<f64>,
    frames: Option<usize>,
}

/// Ways in which a video's packets can end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PacketEnd {
    /// Regular end of a file or stream.
    Regular,
    /// End in the middle of a packet; in MPEG-TS, after a packet that was damaged in transmission.
    InPacket,
    /// Read error, or a stream that has broken off.
    Broken(Error),
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
        // Cameras that stream over UDP lose packets, and pictures with them. Audio is not requested: it would be
        // discarded, and with it FFmpeg moves the time stamps of both when the first sender report comes.
        let options = ffmpeg::dict!("rtsp_transport" => "tcp", "allowed_media_types" => "video");
        let input = format::input_with_interrupt_and_dictionary(url, move || asked.is_over(), options)?;
        Self::new(input, threading::Type::Slice, Some(patience))
    }

    fn new(input: Input, kind: threading::Type, patience: Option<Patience>) -> Result<Self, Error> {
        let stream = input.streams().best(Type::Video).ok_or(Error::StreamNotFound)?;
        let mut context = codec::context::Context::from_parameters(stream.parameters())?;
        context.set_threading(threading::Config { kind, ..threading::Config::default() });
        let (index, tick, codec) = (stream.index(), stream.time_base(), stream.parameters().id());
        let rate_hz = container::rate_hz(&stream);
        let mean_rate_hz = container::mean_rate_hz(&stream);
        let frames = container::frames(&stream, &input);
        let orientation = container::orientation(&stream);
        let zero_s = container::zero_s(&input, patience.is_none() || frames.is_some());
        let is_end_known = stream.duration() > 0 && stream.start_time() != i64::MIN;
        let shown_until = if is_end_known { stream.start_time() + stream.duration() } else { i64::MAX };
        let mut decoder = context.decoder();
        decoder.set_packet_time_base(tick);
        let known = decoder::find(codec).ok_or(Error::DecoderNotFound)?;
        let limits = ffmpeg::dict!("max_pixels" => &picture::MOST_PIXELS.to_string());
        Ok(Self {
            codec: decoder.open_as_with(known, limits)?.video()?,
            input,
            stream: index,
            picture: frame::Video::empty(),
            rgb: RgbBuffers::new(),
            orientation,
            torn: 0,
            patience,
            end: None,
            is_short: false,
            clock: zero_s.map(|zero_s| PresentationClock::new(tick, zero_s, rate_hz)),
            packets: PacketTimes::new(tick, codec),
            shown_until,
            last_ticks: None,
            stamp: FrameStamp::now(),
            rate_hz,
            mean_rate_hz,
            frames,
        })
    }

    /// Skips, from now on, pictures that no other picture refers to.
    pub(super) fn only_references(&mut self) {
        self.codec.skip_frame(Discard::NonReference);
    }

    /// Frames per second, where the container states it.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// Frames per second on average, where the container states it.
    pub(super) fn mean_rate_hz(&self) -> Option<f64> {
        self.mean_rate_hz
    }

    /// Estimated number of frames, where the container states the number or its duration.
    pub(super) fn frames(&self) -> Option<usize> {
        self.frames
    }

    /// Width and height of the picture decoded last, upright.
    pub(super) fn size(&self) -> (u32, u32) {
        self.orientation.size((self.picture.width(), self.picture.height()))
    }

    /// Times of the picture decoded last.
    pub(super) fn stamp(&self) -> FrameStamp {
        self.stamp
    }

    /// FFmpeg's name of the container's format.
    pub(super) fn format(&self) -> String {
        self.input.format().name().to_owned()
    }

    /// End of the packets; `None` while there are more.
    pub(super) fn end(&self) -> Option<PacketEnd> {
        self.end
    }

    /// Number of packets (counted up to a few dozen) that should be shown after the last picture but gave no picture.
    pub(super) fn undecodable(&self) -> usize {
        let silent = self.last_ticks.map_or(0, |ticks| self.packets.between(ticks, self.shown_until));
        silent.max(self.torn)
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
                    let ticks = self.picture.pts().or_else(|| self.picture.timestamp());
                    self.last_ticks = ticks.max(self.last_ticks);
                    let (sender_s, arrival) = self.packets.of_frame(&self.picture);
                    let presentation_s = self.clock.as_mut().and_then(|clock| clock.next_s(ticks));
                    self.stamp = FrameStamp { presentation_s, sender_s, arrival };
                    return true;
                }
                Err(Error::Other { errno: EAGAIN }) if self.end.is_none() => self.feed(),
                Err(Error::InvalidData) => self.torn += 1,
                Err(_) => return false,
            }
        }
        false
    }

    /// Hands the decoder the next packet, or signals the end of the packets.
    fn feed(&mut self) {
        // A new packet for each read: FFmpeg overwrites a reused packet without freeing its contents; dropping it
        // frees them.
        let mut packet = Packet::empty();
        let read = packet.read(&mut self.input);
        if read.is_ok() {
            self.is_short = packet.is_corrupt();
        }
        let sent = match read {
            Ok(()) if packet.stream() != self.stream => Ok(()),
            Ok(()) => {
                self.packets.remember(&packet);
                self.codec.send_packet(&packet)
            }
            Err(Error::InvalidData) => Err(Error::InvalidData),
            Err(error) => {
                self.end = Some(match error {
                    Error::Eof if self.is_short => PacketEnd::InPacket,
                    Error::Eof => PacketEnd::Regular,
                    _ => PacketEnd::Broken(error),
                });
                self.codec.send_eof()
            }
        };
        self.torn += usize::from(sent.is_err());
    }

    /// Converts the picture decoded last into an image of any size.
    pub(super) fn picture(&mut self, into: &mut RgbImage) -> Result<(), Error> {
        self.rgb.picture(&self.picture, self.orientation, into)
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

/// Deadline until which FFmpeg may wait for the network; FFmpeg asks between its own waits.
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
