//! A run as the room of a service (`tracker serve`): where its results go, and the orders that it follows.
//!
//! * [`RoomService`] — the supervisor's orders: read the room again, end.
//! * [`room_outputs`] — files of the day, and reports to the supervisor.
//! * [`Order`], [`Report`] — what passes between supervisor and worker.

mod message;
mod outputs;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::thread;

use scenes::room::Room;

pub(super) use message::{Order, Report, send};
pub(super) use outputs::room_outputs;

use crate::prepared_room::{PreparationOptions, PreparedRoom};
use crate::run::ChangedRoom;
use crate::serve::{Day, RoomJournal};

/// The service that a room's run belongs to.
pub(super) struct RoomService {
    /// Set when the run has to end.
    pub(super) is_ended: Arc<AtomicBool>,
    changes: Receiver<Box<ChangedRoom>>,
    source: Arc<OnceLock<RoomSource>>,
}

/// The room as the run has read it, to be read again.
struct RoomSource {
    dir: PathBuf,
    room: Room,
    options: PreparationOptions,
}

/// Follows the supervisor's orders until there are no more.
fn listen(
    lines: impl Iterator<Item = String>,
    source: &OnceLock<RoomSource>,
    is_ended: &AtomicBool,
    changes: &Sender<Box<ChangedRoom>>,
) {
    let mut present = None;
    for line in lines {
        if !matches!(serde_json::from_str(&line), Ok(Order::ReadRoom)) {
            continue;
        }
        // A room that has not been read yet is read as it is now.
        let Some(source) = source.get() else { continue };
        match read_again(source, present.as_ref()) {
            Ok(RoomChange::Nothing) => {}
            Ok(RoomChange::Markings(changed)) => {
                present = Some(without_geometry(&changed.room));
                tracing::info!("zones, regions and lines are those of the changed room");
                // A run that has ended needs no change.
                let _ = changes.send(changed);
            }
            Ok(RoomChange::Cameras) => {
                tracing::info!("cameras or geometry of the room have changed: it is started again");
                is_ended.store(true, Ordering::Relaxed);
            }
            Err(error) => tracing::warn!("{error:#}; the room stays as it was"),
        }
    }
}

/// Change of a room's directory.
enum RoomChange {
    Nothing,
    /// Zones, regions, lines, or the floor where people can stand.
    Markings(Box<ChangedRoom>),
    /// Cameras or geometry, which a run cannot change.
    Cameras,
}

/// Reads a room again. `present` is the room after earlier changes.
fn read_again(source: &RoomSource, present: Option<&Room>) -> anyhow::Result<RoomChange> {
    let room = Room::read(&source.dir)?;
    if room.cameras != source.room.cameras || room.geometry != source.room.geometry {
        return Ok(RoomChange::Cameras);
    }
    let before = present.unwrap_or(&source.room);
    let is_same = room.zones == before.zones
        && room.regions == before.regions
        && room.lines == before.lines
        && room.walkable == before.walkable;
    if is_same {
        return Ok(RoomChange::Nothing);
    }
    let prepared = PreparedRoom::prepare(&room, &source.dir, &source.options)?;
    Ok(RoomChange::Markings(Box::new(ChangedRoom { room, prepared })))
}

/// The room without what takes much memory.
fn without_geometry(room: &Room) -> Room {
    let Room { cameras, zones, regions, lines, geo, source, walkable, geometry: _ } = room;
    Room {
        cameras: cameras.clone(),
        zones: zones.clone(),
        regions: regions.clone(),
        lines: lines.clone(),
        geo: *geo,
        source: *source,
        walkable: walkable.clone(),
        geometry: None,
    }
}

impl RoomService {
    /// A service that follows the supervisor's orders, a line each, until there are no more; then the run has to end.
    pub(super) fn start(
        orders: impl Iterator<Item = String> + Send + 'static,
        is_ended: Arc<AtomicBool>,
    ) -> Self {
        let (give, changes) = channel();
        let source = Arc::<OnceLock<RoomSource>>::default();
        let (own_source, own_end) = (Arc::clone(&source), Arc::clone(&is_ended));
        // It ends with the process.
        thread::spawn(move || {
            listen(orders, &own_source, &own_end, &give);
            // The supervisor has closed the input, or is gone.
            own_end.store(true, Ordering::Relaxed);
        });
        Self { is_ended, changes, source }
    }

    /// Opens the room's folder.
    pub(super) fn journal(out: &Path) -> anyhow::Result<RoomJournal> {
        let journal = RoomJournal::open(out, Day::today())?;
        if let Some(last) = journal.last() {
            tracing::info!(
                "goes on after frame {} of {}; new people have ids from {} on",
                last.frame,
                last.clock.as_deref().unwrap_or("an earlier run"),
                journal.next_id()
            );
        }
        Ok(journal)
    }

    /// Makes it possible to read the room again.
    pub(super) fn watch(&self, dir: &Path, room: &Room, options: &PreparationOptions) {
        let source = RoomSource { dir: dir.to_owned(), room: room.clone(), options: options.clone() };
        // It is called once.
        let _ = self.source.set(source);
    }

    /// The room, if it was changed.
    pub(super) fn changed_room(&self) -> Option<Box<ChangedRoom>> {
        self.changes.try_recv().ok()
    }
}
