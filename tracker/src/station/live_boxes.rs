//! The station of a live detector: it observes the boxes of each frame as they come out of a pipe.

use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use super::observer::{FrameInput, Observer};
use super::seen::{Event, ObservedFrame, Pictures};
use crate::observation::Feedback;
use crate::source::{ArrivalClock, ArrivedFrame, BoxStream, FrameAssembler, next_line, utc_s};
use crate::{Error, Result};

/// Silence after a row that completes its frame.
const COMPLETE_AFTER: Duration = Duration::from_millis(20);
/// Interval at which a station without rows checks whether its receiver is still there.
const LISTEN: Duration = Duration::from_millis(200);

/// Station of one live detector.
pub struct LiveBoxStation {
    /// Pipe to which the detector writes.
    pub source: BoxStream,
    /// Maker of the observations.
    pub observer: Observer,
}

/// Line with its arrival, seconds since 1970, or the reason why there are no more.
type ReadLine = std::io::Result<(String, f64)>;

impl LiveBoxStation {
    /// Observes until the detector closes the pipe, or the receiver is gone, which `send` reports by `false`.
    ///
    /// A line that is no frame fails the station if it is the first one; later ones are passed over.
    pub fn run(self, feedback: &Receiver<Feedback>, send: impl FnMut(Event) -> bool) {
        let (give, lines) = channel();
        let source = self.source.clone();
        // The thread ends with the detector: a pipe that nobody writes to may block it.
        thread::spawn(move || read(&source, &give));
        self.observe_lines(&lines, feedback, send);
    }

    fn observe_lines(
        self,
        lines: &Receiver<ReadLine>,
        feedback: &Receiver<Feedback>,
        mut send: impl FnMut(Event) -> bool,
    ) {
        let Self { source, mut observer } = self;
        let path = Path::new(&source.spec);
        let (mut clock, mut assembler) = (ArrivalClock::new(&source.spec), FrameAssembler::default());
        let (mut count, mut sequence, mut has_warned) = (0_u64, 0, false);
        loop {
            // Boxes need no estimates; the channel tells whether the receiver is there.
            while feedback.try_recv().is_ok() {}
            if matches!(feedback.try_recv(), Err(TryRecvError::Disconnected)) {
                return;
            }
            let wait = if assembler.is_open() { COMPLETE_AFTER } else { LISTEN };
            let (frames, is_over) = match lines.recv_timeout(wait) {
                Err(RecvTimeoutError::Timeout) => (assembler.finish().into_iter().collect(), false),
                Err(RecvTimeoutError::Disconnected) => (assembler.finish().into_iter().collect(), true),
                Ok(Err(error)) => {
                    send(Event::Failed(Error::content(path, "the pipe", format!("cannot be read: {error}"))));
                    return;
                }
                Ok(Ok((line, arrived_s))) => {
                    count += 1;
                    match assembler.take(&line, arrived_s) {
                        Ok(frames) => (frames, false),
                        Err(problem) => {
                            let error = Error::content(path, format!("line {count}"), problem);
                            if sequence == 0 && !assembler.is_open() {
                                send(Event::Failed(error));
                                return;
                            }
                            if !std::mem::replace(&mut has_warned, true) {
                                tracing::warn!("{error}; such lines are passed over");
                            }
                            continue;
                        }
                    }
                }
            };
            for arrived in frames {
                sequence += 1;
                let event = match observe(&mut observer, &mut clock, sequence, arrived) {
                    Ok(seen) => Event::Seen(Box::new(seen)),
                    Err(error) => Event::Failed(error),
                };
                if !send(event) {
                    return;
                }
            }
            if is_over {
                send(Event::Ended);
                return;
            }
        }
    }
}

fn observe(
    observer: &mut Observer,
    clock: &mut ArrivalClock,
    sequence: u64,
    ArrivedFrame { frame, arrived_s }: ArrivedFrame,
) -> Result<ObservedFrame> {
    let started = Instant::now();
    let time_s = clock.next(None, frame.time_s, arrived_s);
    let input = FrameInput { boxes: Some(&frame.boxes), ..FrameInput::default() };
    let observed = observer.observe(sequence, time_s, &input)?;
    Ok(ObservedFrame {
        observation: observed.observation,
        pictures: Pictures::default(),
        decode: Duration::ZERO,
        foreground: started.elapsed(),
    })
}

/// Reads lines until the detector closes the pipe or nobody wants them.
fn read(source: &BoxStream, give: &Sender<ReadLine>) {
    let mut reader = match source.open() {
        Ok(reader) => reader,
        Err(error) => return drop(give.send(Err(error))),
    };
    loop {
        let line = match next_line(&mut reader) {
            Ok(None) => return,
            Ok(Some(line)) => Ok((line, utc_s(SystemTime::now()))),
            Err(error) => Err(error),
        };
        let is_last = line.is_err();
        if give.send(line).is_err() || is_last {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreground::health::Health;
    use crate::method::Needs;
    use crate::method::mcmc::test_room::empty_room;
    use crate::station::Masks;

    /// Events of a station whose detector writes these lines, each so many seconds after 1970, and closes the pipe.
    fn events(lines: &[(&str, f64)]) -> Vec<Event> {
        let room = empty_room();
        let needs = Needs { masks: true, pictures: false, empty_scene: false };
        let observer =
            Observer::new(&room, &room.cameras[0].name, Masks::Unneeded(Health::default()), needs).unwrap();
        let station = LiveBoxStation { source: BoxStream { spec: "boxes.pipe".into() }, observer };
        let (give, read) = channel();
        for (line, arrived_s) in lines {
            give.send(Ok(((*line).to_owned(), *arrived_s))).unwrap();
        }
        drop(give);
        let (_keep, feedback) = channel();
        let mut events = Vec::new();
        station.observe_lines(&read, &feedback, |event| {
            events.push(event);
            true
        });
        events
    }

    /// Sequence, time and number of boxes of the frames.
    fn seen(events: &[Event]) -> Vec<(u64, f64, usize)> {
        let of = |event: &Event| match event {
            Event::Seen(seen) => {
                let seen = &seen.observation;
                Some((seen.sequence, seen.time_s, seen.boxes.as_ref().unwrap().len()))
            }
            _ => None,
        };
        events.iter().filter_map(of).collect()
    }

    #[test]
    fn each_frame_of_a_pipe_is_observed_at_its_time() {
        let events = events(&[
            ("1,-1,10,10,20,60", 100.0),
            ("1,-1,40,10,20,60", 100.01),
            (r#"{"time":100.2,"boxes":[]}"#, 100.3),
            ("garbage", 100.35),
            ("3,-1,10,10,20,60", 100.4),
        ]);
        assert_eq!(seen(&events), [(1, 100.0, 2), (2, 100.2, 0), (3, 100.4, 1)]);
        assert!(matches!(events.last(), Some(Event::Ended)) && events.len() == 4, "{events:?}");
    }

    #[test]
    fn a_pipe_that_begins_with_something_else_is_refused() {
        match &events(&[("hello", 1.0)])[..] {
            [Event::Failed(error)] => {
                let said = error.to_string();
                assert!(said.contains("boxes.pipe: line 1") && said.contains("no number"), "{said}");
            }
            other => panic!("{other:?}"),
        }
    }
}
