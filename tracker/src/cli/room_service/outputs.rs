//! The outputs of a service's room: files of the day, and reports to the supervisor.

use std::collections::BTreeMap;
use std::path::Path;

use scenes::room::Room;

use super::message::{Report, send};
use crate::cli::run_arguments::{MethodName, RunArgs};
use crate::events::{Clock, Event, EventFiles};
use crate::prepared_room::PreparedRoom;
use crate::run::{AgencyLog, EventLog, Output, ProcessedMoment};
use crate::serve::{DailyFilm, DailyOutputs, RoomJournal, StartFilm};
use crate::tracks::{Persistence, TrackFiles};

/// Interval of the reports of heights, seconds.
const HEIGHTS_EVERY_S: f64 = 1.0;

/// Outputs in the journal's folder. `film` starts the films, if there are to be any; `shown` are the outputs that show
/// and publish.
pub(in crate::cli) fn room_outputs<'a>(
    args: &'a RunArgs,
    room: &'a Room,
    prepared: &'a PreparedRoom,
    journal: RoomJournal,
    film: Option<StartFilm<'a>>,
    shown: Vec<Box<dyn Output + 'a>>,
) -> Box<dyn Output + 'a> {
    let (clock, earlier) = (journal.clock(), journal.last_folder());
    if let Some(earlier) = &earlier {
        DailyFilm::complete(earlier);
    }
    let begin = move |folder: &Path| {
        let persistence = Persistence::lasting();
        let tracks = TrackFiles::new(folder, prepared).with_clock(Some(clock)).kept(&persistence);
        let mut outputs: Vec<Box<dyn Output + 'a>> = vec![Box::new(tracks), Box::<HeightReporter>::default()];
        if args.events.are_on(room) {
            let files =
                EventFiles::new(folder, room, &args.room, &args.events.options())?.kept(&persistence)?;
            let files = files.after(earlier.as_deref())?;
            let log = EventLog::new(files, prepared, Some(clock));
            outputs.push(Box::new(log.with_listener(Box::new(move |events| report(events, &clock)))));
        }
        if args.method == MethodName::Agents {
            outputs.push(Box::new(AgencyLog::new(folder, prepared).kept(&persistence)));
        }
        if let Some(film) = film {
            outputs.push(Box::new(DailyFilm::new(folder, film)?));
        }
        outputs.extend(shown);
        Ok(outputs)
    };
    Box::new(DailyOutputs::new(journal, Box::new(begin)))
}

/// Reports events to the supervisor.
fn report(events: &[Event], clock: &Clock) {
    for event in events {
        let utc_s = clock.unix_s() + event.time;
        tell(&Report::Event { utc_s, event: event.clone() });
    }
}

fn tell(report: &Report) {
    // A supervisor that is gone has closed the standard input as well, which ends the worker.
    let _ = send(&mut std::io::stdout().lock(), report);
}

/// Reports the people's heights to the supervisor, for those who go to other rooms.
#[derive(Default)]
struct HeightReporter {
    due_s: f64,
}

impl Output for HeightReporter {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> crate::Result<()> {
        let time_s = followed.moment.time_s;
        if time_s >= self.due_s && !followed.people.is_empty() {
            self.due_s = time_s + HEIGHTS_EVERY_S;
            let heights: BTreeMap<_, _> = followed.people.iter().map(|p| (p.id, p.height_m)).collect();
            tell(&Report::Heights(heights.into_iter().collect()));
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> crate::Result<()> {
        Ok(())
    }
}
