//! Copies of films into another layout of the container, without coding them again.

use std::path::Path;

use ffmpeg::format::context::Input;
use ffmpeg::{Packet, codec, format};

/// Copies a film of one stream to an MP4 with its index in front: a player on a page can start, and seek, before it has the
/// whole film. Returns the number of packets: a torn film is copied up to its first damaged one, and 0 is that of a file
/// that cannot be read.
///
/// # Errors
/// A copy that cannot be written.
pub(super) fn with_index_in_front(from: &Path, to: &Path) -> Result<usize, ffmpeg::Error> {
    let Ok(mut input) = format::input(from) else { return Ok(0) };
    let mut next = next_packet(&mut input);
    let Some(stream) = input.stream(0).filter(|_| next.is_some()) else { return Ok(0) };
    let tick = stream.time_base();
    let mut output = format::output(to)?;
    let mut copy = output.add_stream(codec::Id::None)?;
    copy.set_parameters(stream.parameters());
    copy.set_time_base(tick);
    copy.set_avg_frame_rate(stream.avg_frame_rate());
    output.write_header_with(ffmpeg::dict!("movflags" => "faststart"))?;
    let own_tick = output.stream(0).map_or(tick, |stream| stream.time_base());
    let mut copied = 0;
    while let Some(mut packet) = next {
        packet.set_stream(0);
        packet.set_position(-1);
        packet.rescale_ts(tick, own_tick);
        packet.write_interleaved(&mut output)?;
        copied += 1;
        next = next_packet(&mut input);
    }
    output.write_trailer()?;
    Ok(copied)
}

/// Number of packets of a film before its first damaged one; 0 where it cannot be read.
pub(super) fn whole_packets(film: &Path) -> usize {
    let Ok(mut input) = format::input(film) else { return 0 };
    std::iter::from_fn(|| next_packet(&mut input)).count()
}

/// The next whole packet of a film.
fn next_packet(input: &mut Input) -> Option<Packet> {
    let mut packet = Packet::empty();
    (packet.read(input).is_ok() && !packet.is_corrupt()).then_some(packet)
}
