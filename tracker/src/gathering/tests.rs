//! Moments of scripted stations: tests of the observations that belong to each moment.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, SystemTime};

use super::*;
use crate::observation::{Feedback, Observation};
use crate::source::utc_s;
use crate::station::{Pictures, Port};

/// Stations that send scripted observations.
struct Stations {
    inbox: Sender<(usize, Event)>,
    feedback: Vec<Receiver<Feedback>>,
    sent: Vec<u64>,
}

fn gathering(rates_hz: &[f64], offsets_s: &[f64], is_live: bool) -> (Stations, Gathering) {
    let (inbox, events) = channel();
    let mut feedback = Vec::new();
    let ports = rates_hz.iter().enumerate().map(|(camera, rate_hz)| {
        let (give, take) = channel();
        feedback.push(take);
        let feedback = Box::new(move |f| give.send(f).unwrap_or_default());
        Port {
            name: format!("cam{camera}"),
            is_live,
            rate_hz: Some(*rate_hz),
            has_boxes_alone: false,
            feedback,
        }
    });
    let alignments =
        offsets_s.iter().map(|offset_s| ClockAlignment { offset_s: *offset_s, ..ClockAlignment::default() });
    let options = GatheringOptions { alignments: alignments.collect(), latency_s: 0.3 };
    let gathering = Gathering::new(ports.collect(), events, &options).unwrap();
    (Stations { inbox, feedback, sent: vec![0; rates_hz.len()] }, gathering)
}

impl Stations {
    fn see(&mut self, camera: usize, time_s: f64) {
        self.sent[camera] += 1;
        let observation = Observation::unusable(self.sent[camera], time_s, Verdict::Usable);
        let (decode, foreground) = (Duration::ZERO, Duration::ZERO);
        let seen = ObservedFrame { observation, pictures: Pictures::default(), decode, foreground };
        self.inbox.send((camera, Event::Seen(Box::new(seen)))).unwrap();
    }

    fn record(&mut self, camera: usize, times_s: impl IntoIterator<Item = f64>) {
        times_s.into_iter().for_each(|time_s| self.see(camera, time_s));
        self.inbox.send((camera, Event::Ended)).unwrap();
    }
}

/// Number and time of a moment, with each camera's own time in it.
type MomentTimes = (u32, f64, Vec<Option<f64>>);

/// All moments, and the camera that ended first.
fn all(gathering: &mut Gathering) -> (Vec<MomentTimes>, String) {
    let mut moments = Vec::new();
    loop {
        match gathering.next_moment().unwrap() {
            NextMoment::Moment(gathered) => moments.push(times_of(&gathered)),
            NextMoment::Idle => panic!("recordings say all they have"),
            NextMoment::Ended(name) => return (moments, name),
        }
    }
}

fn times_of(gathered: &Gathered) -> MomentTimes {
    let time = |part: &MomentPart| match part {
        MomentPart::Seen(seen) => Some(seen.observation.time_s),
        MomentPart::Nothing(_) => None,
    };
    (gathered.frame, gathered.time_s, gathered.parts.iter().map(time).collect())
}

fn steady(rate_hz: f64, frames: u32) -> impl Iterator<Item = f64> {
    (0..frames).map(move |frame| f64::from(frame) / rate_hz)
}

#[test]
fn recordings_on_one_clock_are_taken_frame_by_frame() {
    for offset_s in [0.0, -3.0, 100.0] {
        let (mut stations, mut gathering) = gathering(&[12.0; 3], &[offset_s; 3], false);
        for (camera, frames) in [(0, 5), (1, 3), (2, 9)] {
            stations.record(camera, steady(12.0, frames));
        }
        let (moments, ended) = all(&mut gathering);
        assert_eq!((moments.len(), ended.as_str()), (3, "cam1"));
        for (i, (frame, time_s, seen)) in moments.iter().enumerate() {
            let own_s = i as f64 / 12.0;
            assert_eq!(*frame, i as u32 + 1);
            assert!((time_s - offset_s - own_s).abs() < 1e-9);
            assert!(seen.iter().all(|s| s.is_some_and(|s| (s - own_s).abs() < 1e-9)));
        }
    }
}

#[test]
fn every_camera_gives_its_nearest_frame_if_that_is_near() {
    let rates = [3.0, 12.0, 24.0, 25.0, 29.97, 60.0];
    for (a, b) in rates.iter().flat_map(|a| rates.iter().map(move |b| (*a, *b))) {
        for offset_s in [-2.03, 0.0, 0.017, 5.5] {
            let (mut stations, mut gathering) = gathering(&[a, b], &[0.0, offset_s], false);
            stations.record(0, steady(a, (a * 20.0) as u32));
            stations.record(1, steady(b, (b * 20.0) as u32));
            let (moments, _) = all(&mut gathering);
            let (lead, other) = if b > a { (1, 0) } else { (0, 1) };
            let (rate, offset) = [(a, 0.0), (b, offset_s)][other];
            let near_s = (0.5 / a.max(b)).max(0.04);
            assert!(moments.len() as f64 > 14.0 * a.max(b) - 2.0, "{a}, {b}, {offset_s}: {}", moments.len());
            let mut had = 0;
            for (frame, time_s, seen) in &moments {
                assert!(seen[lead].is_some(), "{a}, {b}, {frame}");
                // Brute force over all frames in question.
                let off = |s: f64| (s + offset - time_s).abs();
                let best = steady(rate, (rate * 20.0) as u32).map(off).fold(f64::INFINITY, f64::min);
                match seen[other] {
                    Some(s) => {
                        had += 1;
                        assert!(off(s) <= best + 1e-9 && best <= near_s + 1e-6, "{a}, {b}, {time_s}");
                    }
                    None => assert!(best >= near_s - 1e-6, "{a}, {b}, {offset_s}, {time_s}: {best}"),
                }
            }
            // Every frame of the slower camera belongs to some moment.
            assert!(
                had as f64 >= (moments.len() as f64 - 1.0) / a.max(b) * a.min(b) - 2.0,
                "{a}, {b}: {had}"
            );
        }
    }
}

#[test]
fn moments_begin_when_all_have_begun_and_end_with_the_first() {
    let frames = |frames: [u32; 2], offsets_s: [f64; 2], rates_hz: [f64; 2]| {
        let (mut stations, mut gathering) = gathering(&rates_hz, &offsets_s, false);
        stations.record(0, steady(rates_hz[0], frames[0]));
        stations.record(1, steady(rates_hz[1], frames[1]));
        let (moments, ended) = all(&mut gathering);
        (moments.first().map(|m| m.0), moments.len(), ended)
    };
    assert_eq!(frames([100, 30], [0.0, 2.0], [10.0; 2]), (Some(21), 30, "cam1".to_owned()));
    assert_eq!(frames([40, 30], [0.0, 2.0], [10.0; 2]), (Some(21), 20, "cam0".to_owned()));
    let (mut stations, mut apart) = gathering(&[10.0; 2], &[0.0, 2.0], false);
    stations.record(0, steady(10.0, 15));
    stations.record(1, steady(10.0, 30));
    let refused = apart.next_moment().unwrap_err().to_string();
    assert!(refused.contains("no moment") && refused.contains("cam0"), "{refused}");
    // The lead itself begins later.
    assert_eq!(frames([30, 50], [2.0, 0.0], [10.0, 5.0]).0, Some(1));
}

#[test]
fn a_gap_in_one_recording_shifts_nothing_and_another_fills_the_leads() {
    let with_gap = |s: &f64| !(3.0..5.0).contains(s);
    for lead_has_gap in [false, true] {
        let (mut stations, mut gathering) = gathering(&[10.0, 10.0], &[0.0; 2], false);
        for camera in [0, 1] {
            let keeps = |s: &f64| (camera == 0) != lead_has_gap || with_gap(s);
            stations.record(camera, steady(10.0, 100).filter(keeps).collect::<Vec<_>>());
        }
        let (moments, _) = all(&mut gathering);
        assert_eq!(moments.len(), 100, "{lead_has_gap}");
        for (_, time_s, seen) in &moments {
            let is_in_gap = !with_gap(&(time_s + 1e-6));
            let with = usize::from(!lead_has_gap);
            assert_eq!(seen[with].is_none(), is_in_gap, "{lead_has_gap}, {time_s}");
            assert!(seen.iter().flatten().all(|s| (s - time_s).abs() < 1e-9));
        }
    }
}

#[test]
fn each_observation_of_a_recording_is_acknowledged_once_in_order() {
    let (mut stations, mut gathering) = gathering(&[10.0, 4.0], &[0.0, 1.0], false);
    stations.record(0, steady(10.0, 50));
    stations.record(1, steady(4.0, 30));
    let (_, _) = all(&mut gathering);
    for take in &stations.feedback {
        let sequences: Vec<u64> = take.try_iter().map(|f| f.sequence).collect();
        assert!(sequences.len() > 10);
        assert!(sequences.iter().zip(1..).all(|(a, b)| *a == b), "{sequences:?}");
    }
}

/// Plays live cameras: `(seconds from now at which it arrives, camera, seconds from now of its capture)`, in the order
/// of arrival. Returns the moments until one second after the last arrival.
fn played(
    gathering: &mut Gathering,
    mut stations: Stations,
    script: Vec<(f64, usize, f64)>,
) -> Vec<(f64, Vec<Option<f64>>)> {
    let zero_s = utc_s(SystemTime::now());
    let end_s = script.last().map_or(0.0, |last| last.0) + 1.0;
    let player = std::thread::spawn(move || {
        for (arrives_s, camera, taken_s) in script {
            let now_s = utc_s(SystemTime::now()) - zero_s;
            std::thread::sleep(Duration::from_secs_f64((arrives_s - now_s).max(0.0)));
            stations.see(camera, zero_s + taken_s);
        }
        stations
    });
    let mut moments = Vec::new();
    let mut start_s = None;
    while utc_s(SystemTime::now()) - zero_s < end_s {
        if let NextMoment::Moment(gathered) = gathering.next_moment().unwrap() {
            let (_, time_s, seen) = times_of(&gathered);
            let lead_s = seen.iter().flatten().next().copied().unwrap_or(f64::NAN);
            start_s.get_or_insert(lead_s - time_s);
            moments.push((
                utc_s(SystemTime::now()) - zero_s,
                seen.iter().map(|s| s.map(|s| s - zero_s)).collect(),
            ));
        }
    }
    player.join().unwrap();
    moments
}

#[test]
fn a_silent_camera_delays_and_shifts_nobody() {
    let (stations, mut gathering) = gathering(&[10.0, 10.0], &[0.0; 2], true);
    // The second camera is silent from 1 to 3 s and sends nothing of that time afterwards.
    let mut script: Vec<(f64, usize, f64)> = Vec::new();
    for frame in 0..50 {
        let s = f64::from(frame) * 0.1;
        script.push((s + 0.01, 0, s));
        if !(1.0..3.0).contains(&s) {
            script.push((s + 0.04, 1, s + 0.02));
        }
    }
    script.sort_by(|a, b| a.0.total_cmp(&b.0));
    let moments = played(&mut gathering, stations, script);
    assert!((48..=50).contains(&moments.len()), "{}", moments.len());
    for (_, seen) in &moments {
        let lead_s = seen[0].unwrap();
        match seen[1] {
            Some(other_s) => assert!((other_s - lead_s).abs() <= 0.05 + 1e-6, "{lead_s}: {other_s}"),
            None => assert!(lead_s < 0.05 || (0.9..3.1).contains(&lead_s), "{lead_s}"),
        }
    }
}

/// A delay beyond the latency: the others' frames wait because that camera leads.
#[test]
fn frames_that_always_come_later_than_the_latency_are_in_moments_all_the_same() {
    for delay_s in [0.2, 0.45] {
        let (stations, mut gathering) = gathering(&[10.0, 10.0], &[0.0; 2], true);
        let mut script: Vec<(f64, usize, f64)> = Vec::new();
        for frame in 0..50_u32 {
            let (s, jitter_s) = (f64::from(frame) * 0.1, 0.01 * f64::from(frame % 5));
            script.push((s + 0.01 + jitter_s, 0, s));
            script.push((s + delay_s + jitter_s, 1, s + 0.02));
        }
        script.sort_by(|a, b| a.0.total_cmp(&b.0));
        let moments = played(&mut gathering, stations, script);
        let settled: Vec<_> = moments.iter().filter(|(at_s, _)| (2.5..4.9).contains(at_s)).collect();
        assert!((20..=27).contains(&settled.len()), "{delay_s} s: {}", settled.len());
        for (at_s, seen) in settled {
            let (Some(first_s), Some(second_s)) = (seen[0], seen[1]) else { panic!("{delay_s} s: {seen:?}") };
            assert!((first_s - second_s).abs() <= 0.05 + 1e-6, "{delay_s} s: {seen:?}");
            assert!(at_s - second_s < delay_s + 0.3, "{delay_s} s: {seen:?} at {at_s}");
        }
    }
}

#[test]
fn moments_that_a_slow_tracker_cannot_keep_up_with_are_skipped() {
    let (mut stations, mut gathering) = gathering(&[10.0], &[0.0], true);
    let zero_s = utc_s(SystemTime::now());
    // Thirty frames wait; the newest is of now.
    for frame in 0..30 {
        stations.see(0, zero_s - 0.1 * f64::from(29 - frame));
    }
    std::thread::sleep(Duration::from_millis(700));
    stations.see(0, utc_s(SystemTime::now()));
    let NextMoment::Moment(first) = gathering.next_moment().unwrap() else { panic!("there is a moment") };
    let (_, _, seen) = times_of(&first);
    assert!(seen[0].is_some_and(|s| s >= zero_s), "{seen:?}");
    assert!(gathering.left_out().skipped >= 25, "{:?}", gathering.left_out());
}
