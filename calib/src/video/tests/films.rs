//! Films for tests: of any container, with any times, smooth or full of noise.

use std::path::Path;

use ffmpeg::codec::{self, encoder};
use ffmpeg::format::{self, Pixel};
use ffmpeg::{Packet, Rational, frame};
use image::{Rgb, RgbImage};

use crate::video::{FilmWriter, pixels};

pub(super) const MILLISECONDS: Rational = Rational(1, 1000);

/// Picture of random colours, determined by its seed.
pub(super) fn noise(width: u32, height: u32, seed: u32) -> RgbImage {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
    let mut picture = RgbImage::new(width, height);
    for value in picture.iter_mut() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value = (state >> 24) as u8;
    }
    picture
}

/// Picture of large soft shapes, different for each seed.
pub(super) fn smooth(width: u32, height: u32, seed: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let wave = |scale: f64, phase: f64| {
            let along = f64::from(x) / f64::from(width) + 0.5 * f64::from(y) / f64::from(height);
            (127.0 + 100.0 * (6.0 * scale * along + phase + f64::from(seed)).sin()) as u8
        };
        Rgb([wave(1.0, 0.0), wave(0.7, 2.0), wave(1.3, 4.0)])
    })
}

/// Writes a film of noise, ten frames a second.
pub(super) fn noisy_film(path: &Path, width: u32, height: u32, frames: u32) {
    let mut writer = FilmWriter::create(path, width, height, 10.0).unwrap();
    for seed in 0..frames {
        writer.write(&noise(width, height, seed)).unwrap();
    }
    writer.finish().unwrap();
}

/// One encoded stream of pictures.
pub(super) struct EncodedTrack {
    pub(super) packets: Vec<Packet>,
    parameters: codec::Parameters,
    tick: Rational,
}

impl EncodedTrack {
    /// Encodes pictures, each with the time at which it is shown, in ticks.
    pub(super) fn new(
        codec: codec::Id,
        options: &[(&str, &str)],
        tick: Rational,
        shown: &[(i64, RgbImage)],
    ) -> Self {
        crate::video::start_ffmpeg().unwrap();
        let codec = encoder::find(codec).unwrap();
        let mut video = codec::context::Context::new_with_codec(codec).encoder().video().unwrap();
        let (width, height) = shown[0].1.dimensions();
        let format = if codec.id() == codec::Id::MJPEG { Pixel::YUVJ420P } else { Pixel::YUV420P };
        video.set_width(width);
        video.set_height(height);
        video.set_format(format);
        video.set_time_base(tick);
        video.set_flags(codec::Flags::GLOBAL_HEADER);
        let mut encoder = video.open_as_with(codec, options.iter().copied().collect()).unwrap();
        let parameters = codec::Parameters::from(&encoder);
        let mut packets = Vec::new();
        let frames = shown.iter().map(|(time, picture)| {
            let mut rgb = frame::Video::new(Pixel::RGB24, width, height);
            pixels::paste_rgb(picture, &mut rgb);
            let mut yuv = frame::Video::new(format, width, height);
            pixels::convert(&rgb, &mut yuv).unwrap();
            yuv.set_pts(Some(*time));
            yuv
        });
        for frame in frames.map(Some).chain([None]) {
            match frame {
                Some(frame) => encoder.send_frame(&frame).unwrap(),
                None => encoder.send_eof().unwrap(),
            }
            loop {
                let mut packet = Packet::empty();
                if encoder.receive_packet(&mut packet).is_err() {
                    break;
                }
                packets.push(packet);
            }
        }
        // Each picture is shown until the next; the last for as long as the one before it.
        let times: Vec<i64> = shown.iter().map(|(time, _)| *time).collect();
        for packet in &mut packets {
            let place = times.iter().position(|time| Some(*time) == packet.pts()).unwrap();
            let from = place.min(times.len() - 2);
            packet.set_duration(times[from + 1] - times[from]);
        }
        Self { packets, parameters, tick }
    }

    /// Encodes smooth pictures of one size, shown at these times.
    pub(super) fn of_times(codec: codec::Id, tick: Rational, times: impl Iterator<Item = i64>) -> Self {
        let shown: Vec<(i64, RgbImage)> =
            times.zip(0..).map(|(time, seed)| (time, smooth(64, 48, seed))).collect();
        Self::new(codec, &[], tick, &shown)
    }
}

/// Writes tracks into a container of the kind that the path's extension names.
pub(super) fn mux(path: &Path, tracks: &[EncodedTrack], options: &[(&str, &str)]) {
    let mut output = format::output(path).unwrap();
    for track in tracks {
        let mut stream = output.add_stream(codec::Id::None).unwrap();
        stream.set_parameters(track.parameters.clone());
        stream.set_time_base(track.tick);
    }
    output.write_header_with(options.iter().copied().collect()).unwrap();
    let mut packets: Vec<(usize, &Packet)> = tracks
        .iter()
        .enumerate()
        .flat_map(|(index, track)| track.packets.iter().map(move |packet| (index, packet)))
        .collect();
    packets.sort_by_key(|(_, packet)| packet.dts());
    for (index, packet) in packets {
        let tick = output.stream(index).unwrap().time_base();
        let mut packet = packet.clone();
        packet.set_stream(index);
        packet.rescale_ts(tracks[index].tick, tick);
        packet.write_interleaved(&mut output).unwrap();
    }
    output.write_trailer().unwrap();
}
