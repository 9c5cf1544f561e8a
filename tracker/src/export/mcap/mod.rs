//! MCAP: a finished run as a recording for Foxglove and Rerun, in Foxglove's schemas as Protocol Buffers.
//!
//! | channel | schema | |
//! |---|---|---|
//! | `/people` | `SceneUpdate` | a body and a label for each person, every frame |
//! | `/poses` | `PosesInFrame` | where people stand, every frame |
//! | `/events` | `Log` | lines of `events.jsonl`, where there is one |
//! | `/room` | `SceneUpdate` | outlines of zones, regions, lines and floor, once |
//! | `/plan` | `CompressedImage` | `plan.png`, once |
//! | `/cameras/NAME/transform` | `FrameTransform` | pose of a camera, once |
//! | `/cameras/NAME/calibration` | `CameraCalibration` | its intrinsics, once |
//! | `/cameras/NAME/film` | `CompressedImage` | frames of its film, if asked |
//!
//! * `messages` — the messages; `schema` — what tells readers how to decode them; `wire` — their bytes.

mod messages;
mod schema;
#[cfg(test)]
mod tests;
mod wire;

use std::collections::BTreeMap;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use calib::video::FrameSource;
use image::RgbImage;
use mcap::records::MessageHeader;
use mcap::{Compression, McapError, WriteOptions, Writer};
use mot::jsonl::{self, FrameLine};
use scenes::room::Room;
use shell::files::StagedFile;

use self::messages::Timestamp;
use self::wire::ProtoMessage;
use crate::events::{Clock, Event};
use crate::{Error, Result, TrackId};

/// Options of the export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct McapOptions {
    /// Whether the films' frames are included, as JPEG pictures.
    pub pictures: bool,
}

/// Counts of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct McapReport {
    /// Number of frames.
    pub frames: u64,
    /// Number of messages.
    pub messages: u64,
    /// Number of pictures among them.
    pub pictures: u64,
}

/// Writes the file, atomically, for the run in `out` and its room.
///
/// # Errors
/// A run that cannot be read or has no frame, a film that cannot be read, a file that cannot be written.
pub fn write(out: &Path, room: &Room, file: &Path, options: McapOptions) -> Result<McapReport> {
    let mut beside = StagedFile::create(file).map_err(Error::io(file))?;
    let report = {
        let mut export = Export::start(BufWriter::new(&mut beside), file)?;
        export.run(out, room, options)?;
        export.finish()?
    };
    beside.finish().map_err(Error::io(file))?;
    Ok(report)
}

/// A file that is being written.
struct Export<W: Write + Seek> {
    writer: Writer<W>,
    /// Path for messages.
    file: PathBuf,
    schemas: BTreeMap<&'static str, u16>,
    channels: BTreeMap<String, (u16, u32)>,
    descriptors: Vec<u8>,
    report: McapReport,
}

impl<W: Write + Seek> Export<W> {
    fn start(to: W, file: &Path) -> Result<Self> {
        let options = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .library(concat!("roomtrack ", env!("CARGO_PKG_VERSION")));
        Ok(Self {
            writer: options.create(to).map_err(refused(file))?,
            file: file.to_owned(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            descriptors: schema::descriptors(),
            report: McapReport::default(),
        })
    }

    fn run(&mut self, out: &Path, room: &Room, options: McapOptions) -> Result<()> {
        let path = out.join("tracks.jsonl");
        let mut lines = jsonl::lines(&path)?;
        let Some(first) = lines.next().transpose()? else {
            return Err(Error::content(&path, "whole file", "it has no frame; export a run that has some"));
        };
        let times = RunTimes::of(&first);
        self.write_room(times.at(first.time), out, room)?;
        self.write_events(&out.join("events.jsonl"), &times, first.time)?;
        let mut films = if options.pictures { open_films(out, room)? } else { Vec::new() };
        let mut present: Vec<TrackId> = Vec::new();
        for line in std::iter::once(Ok(first)).chain(lines) {
            let line = line?;
            self.write_frame(&line, times.at(line.time), &mut present)?;
            self.write_pictures(&mut films, times.at(line.time))?;
        }
        Ok(())
    }

    fn write_room(&mut self, time: Timestamp, out: &Path, room: &Room) -> Result<()> {
        self.write("/room", "foxglove.SceneUpdate", time, messages::room(time, room))?;
        for camera in &room.cameras {
            let topic = |what: &str| format!("/cameras/{}/{what}", camera.name);
            let transform = messages::camera_transform(time, camera);
            self.write(&topic("transform"), "foxglove.FrameTransform", time, transform)?;
            let calibration = messages::calibration(time, camera);
            self.write(&topic("calibration"), "foxglove.CameraCalibration", time, calibration)?;
        }
        let plan = out.join("plan.png");
        // A run that was broken off has no plan.
        if plan.is_file() {
            let data = std::fs::read(&plan).map_err(Error::io(&plan))?;
            self.write(
                "/plan",
                "foxglove.CompressedImage",
                time,
                messages::picture(time, "plan", "png", &data),
            )?;
        }
        Ok(())
    }

    /// Writes all events. Their order is that of the decisions, not of the times, which a reader sorts by anyway.
    fn write_events(&mut self, path: &Path, times: &RunTimes, first_s: f64) -> Result<()> {
        if !path.is_file() {
            return Ok(());
        }
        let text = calib::files::read_text(path)?;
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        for (index, line) in whole.lines().enumerate().filter(|(_, line)| !line.is_empty()) {
            let event: Event = serde_json::from_str(line).map_err(|e| {
                Error::content(
                    path,
                    format!("line {}", index + 1),
                    format!("is no event ({e}); write it again"),
                )
            })?;
            let time = times.at(event.time.max(first_s));
            self.write("/events", "foxglove.Log", time, messages::log(time, line))?;
        }
        Ok(())
    }

    fn write_frame(&mut self, line: &FrameLine, time: Timestamp, present: &mut Vec<TrackId>) -> Result<()> {
        let now: Vec<TrackId> = line.people.iter().map(|person| person.id).collect();
        let gone: Vec<TrackId> = present.iter().copied().filter(|id| !now.contains(id)).collect();
        *present = now;
        let people = messages::people(time, &line.people, &gone);
        self.write("/people", "foxglove.SceneUpdate", time, people)?;
        self.write("/poses", "foxglove.PosesInFrame", time, messages::poses(time, &line.people))?;
        self.report.frames += 1;
        Ok(())
    }

    /// Writes the next frame of each film; a film that is shorter than the run has ended.
    fn write_pictures(&mut self, films: &mut [ExportFilm], time: Timestamp) -> Result<()> {
        for film in films {
            if film.has_ended || !film.source.read(&mut film.picture)? {
                film.has_ended = true;
                continue;
            }
            let jpeg = calib::picture::encode(Path::new("film.jpg"), &film.picture)?;
            let picture = messages::picture(time, &film.frame, "jpeg", &jpeg);
            self.write(&film.topic, "foxglove.CompressedImage", time, picture)?;
            self.report.pictures += 1;
        }
        Ok(())
    }

    fn write(
        &mut self,
        topic: &str,
        schema: &'static str,
        time: Timestamp,
        message: ProtoMessage,
    ) -> Result<()> {
        let refused = refused(&self.file);
        let written = (|| {
            if !self.channels.contains_key(topic) {
                let schema_id = match self.schemas.get(schema) {
                    Some(id) => *id,
                    None => self.writer.add_schema(schema, "protobuf", &self.descriptors)?,
                };
                self.schemas.insert(schema, schema_id);
                let channel = self.writer.add_channel(schema_id, topic, "protobuf", &BTreeMap::new())?;
                self.channels.insert(topic.to_owned(), (channel, 0));
            }
            let Some((channel_id, sequence)) = self.channels.get_mut(topic) else { return Ok(()) };
            *sequence += 1;
            let Timestamp(time) = time;
            let header = MessageHeader {
                channel_id: *channel_id,
                sequence: *sequence,
                log_time: time,
                publish_time: time,
            };
            self.writer.write_to_known_channel(&header, &message.into_bytes())
        })();
        self.report.messages += 1;
        written.map_err(refused)
    }

    fn finish(mut self) -> Result<McapReport> {
        self.writer.finish().map_err(refused(&self.file))?;
        self.writer.into_inner().flush().map_err(Error::io(&self.file))?;
        Ok(self.report)
    }
}

fn refused(file: &Path) -> impl Fn(McapError) -> Error + use<> {
    let file = file.to_owned();
    move |error| match error {
        McapError::Io(source) => Error::io(&file)(source),
        other => Error::content(&file, "whole file", format!("cannot be written ({other})")),
    }
}

/// Times of a run as timestamps: since 1970 where the run knows its time of day, else since its time 0.
struct RunTimes {
    zero_s: f64,
}

impl RunTimes {
    fn of(first: &FrameLine) -> Self {
        let clock = first.clock.as_deref().and_then(|clock| Clock::of_moment(clock, first.time));
        Self { zero_s: clock.map_or(0.0, |clock| clock.unix_s()) }
    }

    fn at(&self, time_s: f64) -> Timestamp {
        // The clock is in milliseconds, times in microseconds: the sum in nanoseconds is a whole number that fits.
        let (zero_us, time_us) = ((self.zero_s * 1e6).round() as i128, (time_s * 1e6).round() as i128);
        Timestamp(u64::try_from((zero_us + time_us) * 1000).unwrap_or(0))
    }
}

/// A film whose frames are exported.
struct ExportFilm {
    source: FrameSource,
    topic: String,
    frame: String,
    picture: RgbImage,
    has_ended: bool,
}

/// Films of the run's cameras.
fn open_films(out: &Path, room: &Room) -> Result<Vec<ExportFilm>> {
    let mut films = Vec::new();
    for camera in &room.cameras {
        let path = out.join("overlay").join(format!("{}.mp4", camera.name));
        // A camera that was not in use has none.
        if path.is_file() {
            films.push(ExportFilm {
                source: FrameSource::open(&path.to_string_lossy())?,
                topic: format!("/cameras/{}/film", camera.name),
                frame: format!("{}/film", messages::camera_frame(&camera.name)),
                picture: RgbImage::default(),
                has_ended: false,
            });
        }
    }
    if films.is_empty() {
        let problem = "there is no film in it; run without --no-film, or export without pictures";
        return Err(Error::content(&out.join("overlay"), "films", problem));
    }
    Ok(films)
}
