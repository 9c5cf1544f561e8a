//! Bytes of the messages between a station and its gatherer, version 1.
//!
//! A message is a byte of version, a byte of kind and a body. *Varint*: LEB128, up to 64 bits. *Number*: IEEE 754, 8
//! bytes, lowest first, finite. *Block*, *text*: a varint of length and so many bytes (a text's are UTF-8). Bytes after
//! the end are an error, and so are a wrong version, an unknown kind, flag or health, and sizes above [`Limits`].
//!
//! | kind | from | body |
//! |---|---|---|
//! | 1 hello | station | 16 bytes of [`Fingerprint`]; text: camera (≤ 256 bytes); varints: working width and height; byte: 1 live, 2 with a rate, 4 boxes alone; a number where there is a rate: Hz |
//! | 2 seen | station | below |
//! | 3 end | station | – |
//! | 4 failure | station | text: one line (≤ 1 KiB) |
//! | 16 call | gatherer | – (asks a station for its hello) |
//! | 17 start | gatherer | – (the station's observations are wanted from now on) |
//! | 18 refusal | gatherer | text: one line (≤ 1 KiB) |
//! | 19 feedback | gatherer | varint: sequence; varint: bodies (≤ 4096); for each four numbers: x, y, radius, height, metres |
//! | 20 done | gatherer | – (an end or a failure has arrived) |
//!
//! **Seen.** Varint: sequence. Number: capture time, seconds. Byte: health, 0 usable, 1 frozen, 2 dark, 3 all
//! foreground, 4 learning, 5 lost, 6 between, 7 silent, 8 other shape. Varints: nanoseconds of decoding, and of
//! foreground. Byte of flags: 1 with a mask, 2 with colours (only with a mask), 4 with the filmed picture, 8 with boxes.
//! With a mask: varints width and height, which must be the working size. With colours: a byte, the step. With a mask: a byte of
//! form, and a block:
//!
//! * form 0, *packed*: the mask's rows, each ⌈width / 8⌉ bytes, bit 0 of a row's first byte its leftmost pixel; then
//!   the colours' samples, two bytes each, lowest first.
//! * form 1, *coded*: the outline of the mask (see `outline`), then the samples (see `samples`), through one range
//!   coder.
//!
//! An encoder takes the shorter form, so that no mask makes a message longer than its limit. With the filmed picture:
//! a block, a JPEG file of at most 4096 × 4096 pixels. With boxes: a varint, their number (≤ 1024); for each four numbers:
//! left, top, right and lower edge; a byte: 1, 2, 4, 8 for an edge (in that order) that the image's border cuts, 16 with an
//! appearance vector; with one, a varint of its length (≤ 4096) and so many IEEE 754 numbers of 4 bytes, lowest first.
//! Everything but the picture is lossless.

mod boxes;
pub(super) mod bytes;
mod image_body;
mod outline;
mod range_coder;
mod samples;
#[cfg(test)]
mod tests;

use std::time::Duration;

use self::bytes::{Decoded, Reader, put_block, put_f64, put_text, put_varint};
use super::{Fingerprint, Hello};
use crate::foreground::Verdict;
use crate::observation::{Feedback, Observation};
use crate::silhouette::Body;
use crate::station::{ObservedFrame, Pictures};

pub use self::bytes::Malformed;

/// The encoding's version, the first byte of every message.
pub const VERSION: u8 = 1;
/// The longest camera name, in bytes.
pub const LONGEST_NAME: usize = 256;
/// Longest line of a failure or a refusal, in bytes; longer ones are cut.
const LONGEST_LINE: usize = 1024;
/// Largest number of bodies in a feedback.
const MOST_BODIES: u32 = 4096;
/// The largest working width and height.
const LARGEST_SIDE: u32 = 16_384;
/// The longest JPEG of a filmed picture, in bytes.
const LONGEST_PICTURE: usize = 8 << 20;

/// One message, in either direction.
#[derive(Debug, Clone)]
pub enum Message {
    /// First message of a station: its camera, size and rate.
    Hello(Hello),
    /// A frame that a station observed. Of its pictures only the filmed one is sent.
    Seen(Box<ObservedFrame>),
    /// A station's recording has no more frames.
    End,
    /// A station cannot go on: one line with the reason.
    Failure(String),
    /// A gatherer asks a station for its hello.
    Call,
    /// A gatherer wants a station's observations from now on.
    Start,
    /// A gatherer does not want a station: one line with the reason.
    Refusal(String),
    /// The tracker's estimates of the people.
    Feedback(Feedback),
    /// A gatherer has received a station's end or failure.
    Done,
}

/// Upper limits of a message's content, checked before anything is allocated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Width of the camera's masks in pixels.
    pub width: u32,
    /// Height of the camera's masks in pixels.
    pub height: u32,
}

impl Limits {
    /// Limits of messages without masks: everything that a gatherer sends.
    pub const NO_MASK: Self = Self { width: 0, height: 0 };

    /// The longest message of a station within these limits, in bytes.
    pub fn longest_message(self) -> usize {
        let packed =
            image_body::packed_bytes(self.width, self.height, self.width as usize * self.height as usize);
        packed + LONGEST_PICTURE + boxes::LONGEST_BOXES + LONGEST_LINE + 64
    }
}

impl Message {
    /// The message's bytes.
    ///
    /// # Errors
    /// A message that cannot be decoded on the other side: a name or picture that is too long, colours without a mask,
    /// a number that is not finite.
    pub fn encode(&self) -> Result<Vec<u8>, Malformed> {
        let mut out = vec![VERSION, self.kind()];
        match self {
            Self::Hello(hello) => put_hello(&mut out, hello)?,
            Self::Seen(seen) => put_seen(&mut out, seen)?,
            Self::Failure(line) | Self::Refusal(line) => put_text(&mut out, line, LONGEST_LINE),
            Self::Feedback(feedback) => put_feedback(&mut out, feedback)?,
            Self::End | Self::Call | Self::Start | Self::Done => {}
        }
        Ok(out)
    }

    /// Decodes a message.
    ///
    /// # Errors
    /// Bytes that are not exactly one message of this version within the limits.
    pub fn decode(bytes: &[u8], limits: Limits) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes);
        if reader.byte()? != VERSION {
            return Err(Malformed("the message has another encoding version"));
        }
        let message = match reader.byte()? {
            1 => Self::Hello(hello(&mut reader)?),
            2 => Self::Seen(Box::new(seen(&mut reader, limits)?)),
            3 => Self::End,
            4 => Self::Failure(reader.text(LONGEST_LINE)?),
            16 => Self::Call,
            17 => Self::Start,
            18 => Self::Refusal(reader.text(LONGEST_LINE)?),
            19 => Self::Feedback(feedback(&mut reader)?),
            20 => Self::Done,
            _ => return Err(Malformed("the message's kind is unknown")),
        };
        reader.finish()?;
        Ok(message)
    }

    fn kind(&self) -> u8 {
        match self {
            Self::Hello(_) => 1,
            Self::Seen(_) => 2,
            Self::End => 3,
            Self::Failure(_) => 4,
            Self::Call => 16,
            Self::Start => 17,
            Self::Refusal(_) => 18,
            Self::Feedback(_) => 19,
            Self::Done => 20,
        }
    }
}

fn put_hello(out: &mut Vec<u8>, hello: &Hello) -> Decoded<()> {
    if hello.camera.len() > LONGEST_NAME {
        return Err(Malformed("the camera's name is longer than 256 bytes"));
    }
    if hello.width.max(hello.height) > LARGEST_SIDE {
        return Err(Malformed("masks are wider or higher than 16,384 pixels"));
    }
    out.extend_from_slice(&hello.room.0);
    put_text(out, &hello.camera, LONGEST_NAME);
    put_varint(out, hello.width.into());
    put_varint(out, hello.height.into());
    out.push(
        u8::from(hello.is_live)
            | u8::from(hello.rate_hz.is_some()) << 1
            | u8::from(hello.has_boxes_alone) << 2,
    );
    if let Some(rate_hz) = hello.rate_hz {
        put_f64(out, rate_hz);
    }
    Ok(())
}

fn hello(reader: &mut Reader<'_>) -> Decoded<Hello> {
    let mut room = [0; Fingerprint::BYTES];
    room.copy_from_slice(reader.take(Fingerprint::BYTES)?);
    let camera = reader.text(LONGEST_NAME)?;
    let (width, height) = (reader.size(LARGEST_SIDE)?, reader.size(LARGEST_SIDE)?);
    let flags = reader.byte()?;
    if flags > 7 {
        return Err(Malformed("the hello has an unknown flag"));
    }
    let rate_hz = if flags & 2 == 0 { None } else { Some(reader.finite()?).filter(|rate| *rate > 0.0) };
    let (is_live, has_boxes_alone) = (flags & 1 == 1, flags & 4 == 4);
    Ok(Hello { room: Fingerprint(room), camera, width, height, is_live, rate_hz, has_boxes_alone })
}

fn put_feedback(out: &mut Vec<u8>, feedback: &Feedback) -> Decoded<()> {
    if feedback.people.len() > MOST_BODIES as usize {
        return Err(Malformed("a feedback has more than 4096 people"));
    }
    put_varint(out, feedback.sequence);
    put_varint(out, feedback.people.len() as u64);
    for body in &feedback.people {
        for number in [body.x_m, body.y_m, body.radius_m, body.height_m] {
            put_f64(out, number);
        }
    }
    Ok(())
}

fn feedback(reader: &mut Reader<'_>) -> Decoded<Feedback> {
    let sequence = reader.varint()?;
    let count = reader.size(MOST_BODIES)?;
    let mut body = || -> Decoded<Body> {
        let [x_m, y_m] = [reader.finite()?, reader.finite()?];
        Ok(Body { x_m, y_m, radius_m: reader.finite()?, height_m: reader.finite()? })
    };
    let people = (0..count).map(|_| body()).collect::<Decoded<_>>()?;
    Ok(Feedback { sequence, people })
}

/// Flags of a seen message.
const WITH_MASK: u8 = 1;
const WITH_COLOURS: u8 = 2;
const WITH_FILMED: u8 = 4;
const WITH_BOXES: u8 = 8;

fn put_seen(out: &mut Vec<u8>, seen: &ObservedFrame) -> Decoded<()> {
    let observation = &seen.observation;
    let (mask, colours) = (observation.mask.as_ref(), observation.colours.as_ref());
    if !observation.time_s.is_finite() {
        return Err(Malformed("an observation's time is not finite"));
    }
    put_varint(out, observation.sequence);
    put_f64(out, observation.time_s);
    out.push(health_code(observation.health));
    for duration in [seen.decode, seen.foreground] {
        put_varint(out, u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX));
    }
    let flag = |is_there: bool, flag: u8| if is_there { flag } else { 0 };
    let filmed = seen.pictures.filmed.as_deref();
    out.push(
        flag(mask.is_some(), WITH_MASK)
            | flag(colours.is_some(), WITH_COLOURS)
            | flag(filmed.is_some(), WITH_FILMED)
            | flag(observation.boxes.is_some(), WITH_BOXES),
    );
    match mask {
        Some(mask) => image_body::put_mask(out, mask, colours)?,
        None if colours.is_some() => return Err(Malformed("an observation has colours without a mask")),
        None => {}
    }
    if let Some(picture) = filmed {
        let jpeg = image_body::jpeg(picture)?;
        if jpeg.len() > LONGEST_PICTURE {
            return Err(Malformed("a picture has more than 8 MiB"));
        }
        put_block(out, &jpeg);
    }
    observation.boxes.as_ref().map_or(Ok(()), |found| boxes::put_boxes(out, found))
}

fn seen(reader: &mut Reader<'_>, limits: Limits) -> Decoded<ObservedFrame> {
    let (sequence, time_s) = (reader.varint()?, reader.finite()?);
    let health = health_of(reader.byte()?)?;
    let [decode, foreground] = [reader.varint()?, reader.varint()?].map(Duration::from_nanos);
    let flags = reader.byte()?;
    let has = |flag: u8| flags & flag != 0;
    if flags > (WITH_MASK | WITH_COLOURS | WITH_FILMED | WITH_BOXES) || has(WITH_COLOURS) && !has(WITH_MASK) {
        return Err(Malformed("an observation has an unknown flag"));
    }
    let (mask, colours) = if has(WITH_MASK) {
        let (mask, colours) = image_body::mask(reader, limits, has(WITH_COLOURS))?;
        (Some(mask), colours)
    } else {
        (None, None)
    };
    let filmed = if has(WITH_FILMED) {
        Some(image_body::picture(reader.block(LONGEST_PICTURE)?)?.into())
    } else {
        None
    };
    let boxes = if has(WITH_BOXES) { Some(boxes::boxes(reader)?) } else { None };
    let observation = Observation { sequence, time_s, health, mask, colours, boxes };
    Ok(ObservedFrame { observation, pictures: Pictures { pinhole: None, filmed }, decode, foreground })
}

fn health_code(health: Verdict) -> u8 {
    match health {
        Verdict::Usable => 0,
        Verdict::Frozen => 1,
        Verdict::Dark => 2,
        Verdict::AllForeground => 3,
        Verdict::Learning => 4,
        Verdict::Lost => 5,
        Verdict::Between => 6,
        Verdict::Silent => 7,
        Verdict::OtherShape => 8,
        Verdict::Moved => 9,
    }
}

fn health_of(code: u8) -> Decoded<Verdict> {
    Ok(match code {
        0 => Verdict::Usable,
        1 => Verdict::Frozen,
        2 => Verdict::Dark,
        3 => Verdict::AllForeground,
        4 => Verdict::Learning,
        5 => Verdict::Lost,
        6 => Verdict::Between,
        7 => Verdict::Silent,
        8 => Verdict::OtherShape,
        9 => Verdict::Moved,
        _ => return Err(Malformed("an observation's health is unknown")),
    })
}
