//! Drawing for the viewers of a run that makes no film.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use super::Screens;
use crate::PersonEstimate;
use crate::film::{FilmOptions, Painted, Painter, Shot};
use crate::prepared_room::PreparedRoom;

/// Longest time for which the end of a run waits for the moment that is being drawn.
const LAST_DRAWN: Duration = Duration::from_secs(2);
/// Interval of looks at whether it is done.
const LOOKED_EVERY: Duration = Duration::from_millis(5);

/// Drawer that draws a moment for all screens when a viewer waits for one, on a thread of its own; moments that arrive
/// during that time are skipped.
#[derive(Debug)]
pub struct LiveDrawer {
    screens: Screens,
    scenes: SyncSender<DrawJob>,
    is_free: Arc<AtomicBool>,
    /// Whether some camera has pictures, when there are viewers.
    has_pictures: bool,
}

/// A moment to be drawn.
struct DrawJob {
    frame: u32,
    time_s: f64,
    shots: Vec<Shot>,
    people: Vec<PersonEstimate>,
}

impl LiveDrawer {
    /// Starts the drawer of the room's cameras for these screens. `has_pictures` is true if some camera has more than
    /// masks.
    pub fn start(room: &PreparedRoom, options: &FilmOptions, screens: &Screens, has_pictures: bool) -> Self {
        let (scenes, received) = sync_channel(1);
        let is_free = Arc::new(AtomicBool::new(true));
        let (room, options) = (room.clone(), options.clone());
        let (own_screens, own_is_free) = (screens.clone(), Arc::clone(&is_free));
        // The thread ends with the channel, or with the program: it has nothing to save.
        thread::spawn(move || draw(&room, &options, &received, &own_screens, &own_is_free));
        Self { screens: screens.clone(), scenes, is_free, has_pictures }
    }

    /// Offers one moment; `shots`, one a camera in the room's order, is called only if a viewer waits for it.
    pub fn offer(
        &self,
        frame: u32,
        time_s: f64,
        people: &[PersonEstimate],
        shots: impl FnOnce() -> Vec<Shot>,
    ) {
        if !self.screens.is_awaited() || !self.is_free.swap(false, Ordering::AcqRel) {
            return;
        }
        let shots = shots();
        // Frames from before there was a viewer have no picture.
        if self.has_pictures && shots.iter().all(|shot| shot.image.is_none()) {
            self.is_free.store(true, Ordering::Release);
            return;
        }
        let scene = DrawJob { frame, time_s, shots, people: people.to_vec() };
        // The channel has room for the moment of an idle drawer; one that has failed takes none.
        let _ = self.scenes.try_send(scene);
    }

    /// Waits for the moment that is being drawn, for at most two seconds: on a busy machine, where the drawer yields to the
    /// tracker, viewers of a short run would see none.
    pub fn finish(&self) {
        let until = Instant::now() + LAST_DRAWN;
        while !self.is_free.load(Ordering::Acquire) && Instant::now() < until {
            thread::sleep(LOOKED_EVERY);
        }
    }
}

fn draw(
    room: &PreparedRoom,
    options: &FilmOptions,
    scenes: &Receiver<DrawJob>,
    screens: &Screens,
    is_free: &AtomicBool,
) {
    super::yield_to_tracker();
    let mut painters: Vec<Painter> = Vec::new();
    for DrawJob { frame, time_s, shots, people } in scenes {
        if painters.is_empty() {
            painters = (0..room.cameras.len()).map(|index| Painter::new(room, index, options)).collect();
        }
        let painted = painters.iter_mut().zip(shots).enumerate().map(|(camera, (painter, shot))| Painted {
            camera,
            frame,
            time_s,
            people: people.len(),
            picture: painter.paint(frame, time_s, &shot, &people),
        });
        // Collected before `show`, which must not block others.
        let painted: Vec<Painted> = painted.collect();
        screens.show(painted);
        is_free.store(true, Ordering::Release);
    }
}
