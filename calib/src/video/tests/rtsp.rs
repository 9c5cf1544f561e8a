//! The sender's clock, from a camera that speaks RTSP and sends reports (RFC 2326, 3550).

use std::io::{Read, Write};
use std::net::TcpStream;

use ffmpeg::codec::Id;
use image::RgbImage;

use super::films::{EncodedTrack, MILLISECONDS, smooth};
use super::live::camera;
use crate::video::FrameSource;

/// Seconds from 1900, the zero of NTP, to 1970.
const NTP_EPOCH_S: f64 = 2_208_988_800.0;
/// The camera's RTP clock at the time of its first frame.
const FIRST_TICK: u32 = 123_456_789;

/// One frame of a camera: capture time, RTP payloads, and the camera's wall clock in the sender report before the
/// frame, if one is sent.
struct Sent {
    time_ms: i64,
    payloads: Vec<Vec<u8>>,
    report_s: Option<f64>,
}

fn rtp_tick(time_ms: i64) -> u32 {
    FIRST_TICK.wrapping_add((90 * time_ms) as u32)
}

/// Answers requests until the viewer asks to play.
fn negotiate(viewer: &mut TcpStream, media: &str) -> std::io::Result<()> {
    loop {
        let mut request = Vec::new();
        while !request.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            viewer.read_exact(&mut byte)?;
            request.push(byte[0]);
        }
        let request = String::from_utf8(request).unwrap();
        let sequence = request.lines().find(|line| line.starts_with("CSeq")).unwrap();
        let method = request.split(' ').next().unwrap();
        let (headers, body) = match method {
            "DESCRIBE" => (
                "Content-Type: application/sdp\r\n",
                format!(
                    "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=camera\r\nt=0 0\r\n{media}a=control:track1\r\n"
                ),
            ),
            "SETUP" => ("Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 1\r\n", String::new()),
            "PLAY" => ("Session: 1\r\n", String::new()),
            _ => ("Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN\r\n", String::new()),
        };
        let length = body.len();
        write!(viewer, "RTSP/1.0 200 OK\r\n{sequence}\r\n{headers}Content-Length: {length}\r\n\r\n{body}")?;
        if method == "PLAY" {
            return Ok(());
        }
    }
}

fn send(viewer: &mut TcpStream, channel: u8, packet: &[u8]) -> std::io::Result<()> {
    viewer.write_all(&[b'$', channel])?;
    viewer.write_all(&(packet.len() as u16).to_be_bytes())?;
    viewer.write_all(packet)
}

fn play(viewer: &mut TcpStream, payload_type: u8, film: &[Sent]) -> std::io::Result<()> {
    let mut number = 0_u16;
    for frame in film {
        let tick = rtp_tick(frame.time_ms).to_be_bytes();
        if let Some(report_s) = frame.report_s {
            let ntp_s = report_s + NTP_EPOCH_S;
            let ntp = ((ntp_s.floor() as u64) << 32) | (ntp_s.fract() * 4_294_967_296.0) as u64;
            let report = [[0x80, 200, 0, 6, 0, 0, 0, 7].as_slice(), &ntp.to_be_bytes(), &tick, &[0; 8]];
            send(viewer, 1, &report.concat())?;
        }
        for (place, payload) in frame.payloads.iter().enumerate() {
            let marker = if place + 1 == frame.payloads.len() { 0x80 } else { 0 };
            let numbered = number.to_be_bytes();
            number = number.wrapping_add(1);
            let kind = [0x80, marker | payload_type];
            let packet = [kind.as_slice(), &numbered, &tick, &[0, 0, 0, 7], payload].concat();
            send(viewer, 0, &packet)?;
        }
    }
    Ok(())
}

/// Film with uneven times and with reports before some frames; from the second report on the camera's clock is half a
/// second ahead.
fn film(payloads: impl Fn(usize) -> Vec<Vec<u8>>) -> Vec<Sent> {
    let mut time_ms = 0;
    (0..60)
        .map(|k| {
            time_ms += 40 + 7 * (k as i64 * k as i64 % 5);
            let clock_s = 1_700_000_000.25 + time_ms as f64 / 1000.0;
            let report_s = match k {
                5 => Some(clock_s),
                40 => Some(clock_s + 0.5),
                _ => None,
            };
            Sent { time_ms, payloads: payloads(k), report_s }
        })
        .collect()
}

/// Presentation and sender's time of each frame, as received over RTSP.
fn seen(media: &'static str, payload_type: u8, film: Vec<Sent>) -> Vec<(f64, Option<f64>)> {
    let (url, serving) = camera("rtsp", move |mut viewer| {
        negotiate(&mut viewer, media)?;
        play(&mut viewer, payload_type, &film)
    });
    let mut source = FrameSource::open(&url).unwrap();
    assert!(source.is_live());
    let mut times = Vec::new();
    while source.advance().unwrap() {
        let stamp = source.stamp();
        match stamp.presentation_s {
            Some(presentation_s) => times.push((presentation_s, stamp.sender_s)),
            // FFmpeg may give the first frame of a stream no time stamp.
            None => assert!(times.is_empty()),
        }
    }
    drop(source);
    serving.join().unwrap();
    times
}

/// Compares received times with the camera's own clock. At least `least` frames must have come, and those sent after
/// the first report must have a sender's time.
fn assert_on_time(seen: &[(f64, Option<f64>)], film: &[Sent], least: usize) {
    assert!(seen.len() >= least, "{seen:?}");
    let first = &film[film.len() - seen.len()..];
    let offset_s = first[0].time_ms as f64 / 1000.0 - seen[0].0;
    let mut reported = None;
    for ((presentation_s, sender_s), sent) in seen.iter().zip(first) {
        let taken_s = sent.time_ms as f64 / 1000.0;
        assert!((presentation_s + offset_s - taken_s).abs() < 1e-3, "{presentation_s} {taken_s}");
        reported = sent.report_s.map(|report_s| report_s - taken_s).or(reported);
        match (reported, sender_s) {
            (Some(offset_s), Some(sender_s)) => {
                assert!((sender_s - offset_s - taken_s).abs() < 1e-3, "{taken_s}: {sender_s}");
            }
            // The frame with which the report comes may already have been on its way.
            (Some(_), None) => assert!(sent.report_s.is_some(), "{taken_s}"),
            (None, told) => assert_eq!(*told, None, "{taken_s}"),
        }
    }
    assert!(seen.iter().filter(|(_, sender_s)| sender_s.is_some()).count() > 50);
}

#[test]
fn h264_frames_have_the_senders_time_after_a_report() {
    let shown: Vec<(i64, RgbImage)> = (0..60).map(|k| (40 * i64::from(k), smooth(64, 48, k))).collect();
    // Parameters in the stream, no frame out of order: as cameras encode.
    let options = [("flags", "-global_header"), ("preset", "ultrafast"), ("tune", "zerolatency")];
    let track = EncodedTrack::new(Id::H264, &options, MILLISECONDS, &shown);
    let payloads = |k: usize| units(track.packets[k].data().unwrap());
    let media = "m=video 0 RTP/AVP 96\r\na=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1\r\n";
    let seen = seen(media, 96, film(payloads));
    assert_on_time(&seen, &film(payloads), 58);
}

#[test]
fn motion_jpeg_frames_have_the_senders_time_after_a_report() {
    let shown: Vec<(i64, RgbImage)> = (0..60).map(|k| (40 * i64::from(k), smooth(64, 48, k))).collect();
    let track = EncodedTrack::new(Id::MJPEG, &[("huffman", "default")], MILLISECONDS, &shown);
    let payloads = |k: usize| vec![jpeg_payload(track.packets[k].data().unwrap())];
    let seen = seen("m=video 0 RTP/AVP 26\r\n", 26, film(payloads));
    assert_on_time(&seen, &film(payloads), 58);
}

/// The units of an H.264 byte stream (annex B), without their start codes.
fn units(stream: &[u8]) -> Vec<Vec<u8>> {
    let starts: Vec<usize> = (0..stream.len() - 3).filter(|&at| stream[at..at + 3] == [0, 0, 1]).collect();
    let ends = starts.iter().skip(1).copied().chain([stream.len()]);
    starts
        .iter()
        .zip(ends)
        .map(|(start, end)| {
            let unit = &stream[start + 3..end];
            // The next start code may have four bytes; a unit never ends in a zero.
            let last = unit.iter().rposition(|byte| *byte != 0).unwrap();
            unit[..=last].to_vec()
        })
        .collect()
}

/// A JPEG with the standard Huffman tables as one RTP payload (RFC 2435), its quantization tables in the stream.
fn jpeg_payload(jpeg: &[u8]) -> Vec<u8> {
    let (mut at, mut tables, mut size) = (2, Vec::new(), [0; 2]);
    let scan = loop {
        let length = usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]));
        let segment = &jpeg[at + 4..at + 2 + length];
        match jpeg[at + 1] {
            0xdb => segment.chunks_exact(65).for_each(|table| tables.push(table[1..].to_vec())),
            0xc0 => size = [segment[4] / 8, segment[2] / 8],
            0xda => break &jpeg[at + 2 + length..],
            _ => {}
        }
        at += 2 + length;
    };
    let chroma = tables.last().unwrap().clone();
    let header = [0, 0, 0, 0, 1, 255, size[0], size[1], 0, 0, 0, 128];
    [header.as_slice(), &tables[0], &chroma, scan].concat()
}
