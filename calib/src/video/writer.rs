//! Films out: an MP4 that browsers and players open, under a temporary name until it is finished.
//!
//! While it is written the film is a fragmented MP4 (ISO 14496-12, 8.8): each quarter of a second is complete by itself and goes to
//! the file at once, so a program that is killed leaves a film that can be played up to its last second, `NAME.partial.mp4`.
//! At the end its packets are copied into an MP4 with one index in front, which players can seek in.

use std::fmt::Display;
use std::fs::File;
use std::path::{Path, PathBuf};

use ffmpeg::codec::{self, encoder, packet::Packet};
use ffmpeg::format::{self, Pixel, context::Output};
use ffmpeg::{Dictionary, Rational, frame};
use image::RgbImage;

use super::{pixels, remux};
use crate::{Error, Result};

/// Longest time between two key frames, at which a player can enter the film.
const KEY_FRAME_EVERY_S: f64 = 2.0;
/// Duration of a fragment, microseconds. The encoder holds some frames back, too; together that is less than a second from 6 frames/s on.
const FRAGMENT_US: &str = "250000";
/// Extensions of the film that is being written, and of its copy that is being completed.
const PARTIAL: &str = "partial.mp4";
const REMUXED: &str = "remuxed.mp4";
/// Largest numerator of the fraction that a rate is rounded to.
const FINEST_RATE: i32 = 100_000;

/// Writes an MP4 film, frame by frame, under a temporary name until [`FilmWriter::finish`]. One that is dropped before keeps
/// its frames under that name.
pub struct FilmWriter {
    target: PathBuf,
    partial: PathBuf,
    size: (u32, u32),
    frames: i64,
    is_finished: bool,
    rgb: frame::Video,
    yuv: frame::Video,
    packet: Packet,
    encoder: encoder::Video,
    /// Duration of one frame, seconds.
    tick: Rational,
    output: Output,
}

impl FilmWriter {
    /// Starts a film of `width` × `height` pixels (even numbers) at `rate` frames a second.
    ///
    /// H.264 where this FFmpeg has an encoder for it, MPEG-4 otherwise.
    ///
    /// # Errors
    /// [`Error`] when the folder cannot be made or no encoder opens.
    pub fn create(target: &Path, width: u32, height: u32, rate: f64) -> Result<Self> {
        if let Some(folder) = target.parent() {
            std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        }
        let partial = target.with_extension(PARTIAL);
        // A program that was killed while it completed a film has left it.
        let _ = std::fs::remove_file(target.with_extension(REMUXED));
        let opened = Self::open(target, &partial, (width, height), rate);
        if opened.is_err() {
            // Opening has created the file; a partial file must not stay.
            let _ = std::fs::remove_file(&partial);
        }
        opened.map_err(|error| {
            let place = format!("{width} × {height} at {rate} frames/s");
            Error::content(target, place, format!("cannot be encoded ({error}); run with --no-film"))
        })
    }

    fn open(
        target: &Path,
        partial: &Path,
        (width, height): (u32, u32),
        rate: f64,
    ) -> std::result::Result<Self, ffmpeg::Error> {
        super::start_ffmpeg()?;
        let mut output = format::output(partial)?;
        let (codec, options) = best_codec()?;
        let mut video = codec::context::Context::new_with_codec(codec).encoder().video()?;
        let rate_fraction =
            Rational::from(rate).reduce_with_limit(FINEST_RATE).unwrap_or_else(|nearest| nearest);
        let tick = rate_fraction.invert();
        video.set_width(width);
        video.set_height(height);
        video.set_format(Pixel::YUV420P);
        video.set_time_base(tick);
        video.set_frame_rate(Some(rate_fraction));
        video.set_gop((KEY_FRAME_EVERY_S * rate).round().clamp(1.0, 600.0) as u32);
        if output.format().flags().contains(format::Flags::GLOBAL_HEADER) {
            video.set_flags(codec::Flags::GLOBAL_HEADER);
        }
        let encoder = video.open_as_with(codec, options)?;
        let mut stream = output.add_stream(codec)?;
        stream.set_parameters(&encoder);
        stream.set_avg_frame_rate(rate_fraction);
        // The header waits for the first fragment, with which the times of the first frames are known.
        output.write_header_with(ffmpeg::dict!(
            "movflags" => "empty_moov+delay_moov+default_base_moof",
            "frag_duration" => FRAGMENT_US,
            "flush_packets" => "1",
        ))?;
        Ok(Self {
            target: target.to_owned(),
            partial: partial.to_owned(),
            size: (width, height),
            frames: 0,
            is_finished: false,
            rgb: frame::Video::new(Pixel::RGB24, width, height),
            yuv: frame::Video::empty(),
            packet: Packet::empty(),
            encoder,
            tick,
            output,
        })
    }

    /// Appends one frame.
    ///
    /// # Errors
    /// A frame of another size than the film's, or a full disk.
    pub fn write(&mut self, frame: &RgbImage) -> Result<()> {
        if frame.dimensions() != self.size {
            return Err(Error::Invalid(format!(
                "a film of {:?} pixels was given a frame of {:?}",
                self.size,
                frame.dimensions()
            )));
        }
        pixels::paste_rgb(frame, &mut self.rgb);
        // The encoder may still refer to the picture before.
        self.yuv = frame::Video::new(Pixel::YUV420P, self.size.0, self.size.1);
        pixels::convert(&self.rgb, &mut self.yuv).map_err(|error| self.refused(error))?;
        self.yuv.set_pts(Some(self.frames));
        self.frames += 1;
        self.encoder.send_frame(&self.yuv).map_err(|error| self.refused(error))?;
        self.write_what_is_encoded()
    }

    fn write_what_is_encoded(&mut self) -> Result<()> {
        while self.encoder.receive_packet(&mut self.packet).is_ok() {
            // The muxer chooses the ticks of its stream when the header is written.
            let stream_tick = self.output.stream(0).map_or(self.tick, |stream| stream.time_base());
            self.packet.set_stream(0);
            self.packet.set_duration(1);
            self.packet.rescale_ts(self.tick, stream_tick);
            self.packet.write_interleaved(&mut self.output).map_err(|error| self.refused(error))?;
        }
        Ok(())
    }

    /// Closes the film, gives it one index in front, and renames it to its final name. Where there is no room for that copy
    /// the fragmented film takes the name: it can be played, too.
    ///
    /// # Errors
    /// [`Error`] when the film cannot be finished or renamed, or is not whole on the disk: an earlier film keeps the name.
    pub fn finish(mut self) -> Result<()> {
        self.encoder.send_eof().map_err(|error| self.refused(error))?;
        self.write_what_is_encoded()?;
        self.output.write_trailer().map_err(|error| self.refused(error))?;
        let remuxed = self.target.with_extension(REMUXED);
        let copied = remux::with_index_in_front(&self.partial, &remuxed)
            .is_ok_and(|packets| packets as i64 == self.frames)
            && sync(&remuxed).is_ok();
        if !copied {
            let _ = std::fs::remove_file(&remuxed);
            // FFmpeg does not report every frame that it failed to write.
            let kept = remux::whole_packets(&self.partial) as i64;
            if kept < self.frames {
                return Err(self.refused_at(kept + 1, "the disk has not taken it"));
            }
        }
        let whole = if copied { &remuxed } else { &self.partial };
        // A full disk may show only now.
        sync(whole).and_then(|()| std::fs::rename(whole, &self.target)).map_err(Error::io(&self.target))?;
        self.is_finished = true;
        Ok(())
    }

    fn refused(&self, error: impl Display) -> Error {
        self.refused_at(self.frames, error)
    }

    fn refused_at(&self, frame: i64, error: impl Display) -> Error {
        let kept = self.partial.file_name().unwrap_or_default().to_string_lossy();
        let problem = format!("cannot be written: {error}; the frames before it are in {kept}");
        Error::content(&self.target, format!("frame {frame}"), problem)
    }
}

impl Drop for FilmWriter {
    fn drop(&mut self) {
        // After `finish` there is no file of this name, or it has been copied. After an error its frames are kept: they can be
        // played. Players cannot open a film without frames.
        if self.frames == 0 || self.is_finished {
            let _ = std::fs::remove_file(&self.partial);
        }
    }
}

/// Completes a film that a killed program left under its temporary name: its whole frames get one index in front and the
/// final name, unless another film has it. One without a whole frame is removed. Other files are left alone.
///
/// # Errors
/// A film that cannot be written.
pub fn complete_film(partial: &Path) -> Result<()> {
    let name = partial.file_name().unwrap_or_default().to_string_lossy();
    let Some(stem) = name.strip_suffix(PARTIAL).filter(|stem| stem.ends_with('.')) else { return Ok(()) };
    let [target, remuxed] = ["mp4", REMUXED].map(|end| partial.with_file_name(format!("{stem}{end}")));
    if target.exists() {
        return Ok(());
    }
    super::start_ffmpeg().map_err(|error| Error::content(partial, "whole film", error.to_string()))?;
    let copied = remux::with_index_in_front(partial, &remuxed);
    let completed = match &copied {
        Ok(0) => std::fs::remove_file(partial).map_err(Error::io(partial)),
        Ok(_) => sync(&remuxed)
            .and_then(|()| std::fs::rename(&remuxed, &target))
            .and_then(|()| std::fs::remove_file(partial))
            .map_err(Error::io(&target)),
        Err(error) => Err(Error::content(&target, "whole film", format!("cannot be written: {error}"))),
    };
    if remuxed.exists() {
        let _ = std::fs::remove_file(&remuxed);
    }
    completed
}

/// Waits until a file is on the disk.
fn sync(film: &Path) -> std::io::Result<()> {
    File::open(film)?.sync_all()
}

/// The best encoder available, with its settings: good visual quality, and fast. One thread: the same bytes on a machine of any
/// number of cores, and three frames are held back in place of a dozen.
pub(super) fn best_codec() -> std::result::Result<(ffmpeg::Codec, Dictionary<'static>), ffmpeg::Error> {
    if let Some(codec) = encoder::find_by_name("libx264") {
        return Ok((codec, ffmpeg::dict!("preset" => "superfast", "crf" => "23", "threads" => "1")));
    }
    let codec = encoder::find(codec::Id::MPEG4).ok_or(ffmpeg::Error::EncoderNotFound)?;
    Ok((codec, ffmpeg::dict!("b" => "4M", "threads" => "1")))
}
