//! The estimator on people who walk through generated rooms, filmed by cameras whose clocks are wrong by a known time.

mod office;
mod people;

use image::{GrayImage, Luma};
use nalgebra::Point2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scenes::room::Room;
use synthetic::{RoomOptions, Sequence, SequenceOptions, SyntheticRoom, Walker, WalkerOptions};

use super::*;
use crate::observation::Mask;
use crate::prepared_room::PreparationOptions;

/// Ticks a second: frames are asked for at whole multiples of a tick.
const TICKS_HZ: f64 = 1200.0;

/// A generated room, prepared.
struct FilmedRoom {
    made: SyntheticRoom,
    prepared: PreparedRoom,
}

/// Clock of a camera: true times at which it films, and times that it reports.
#[derive(Debug, Clone, Copy)]
struct CameraClock {
    /// True time of the first frame, seconds.
    first_s: f64,
    rate_hz: f64,
    /// True time less the camera's at true time 0, seconds: to be added to the camera's times.
    offset_s: f64,
    /// Growth of the offset, microseconds a second.
    drift_ppm: f64,
    /// Largest delay of filming behind the rate, seconds; the reported times are right.
    jitter_s: f64,
    /// Largest delay of the reported times, seconds, as of frames that arrive late.
    delay_s: f64,
    /// Probability of a frame to get lost.
    loss: f64,
}

impl CameraClock {
    fn new(rate_hz: f64, offset_s: f64) -> Self {
        Self { first_s: 0.0, rate_hz, offset_s, drift_ppm: 0.0, jitter_s: 0.0, delay_s: 0.0, loss: 0.0 }
    }

    /// True times of the frames of a recording until `end_s`, and the times by the camera, seconds.
    fn frames(&self, end_s: f64, rng: &mut Pcg64Mcg) -> Vec<(f64, f64)> {
        let mut frames = Vec::new();
        let count = ((end_s - self.first_s) * self.rate_hz) as u32;
        for i in 0..count {
            let is_lost = rng.random::<f64>() < self.loss;
            let jitter_s = self.jitter_s * rng.random::<f64>();
            let delay_s = self.delay_s * rng.random::<f64>();
            if !is_lost {
                let true_s = self.first_s + f64::from(i) / self.rate_hz + jitter_s;
                let true_s = (true_s * TICKS_HZ).round() / TICKS_HZ;
                frames.push((true_s, self.time_s(true_s) + delay_s));
            }
        }
        frames
    }

    fn time_s(&self, true_s: f64) -> f64 {
        true_s - self.offset_at(true_s)
    }

    fn offset_at(&self, true_s: f64) -> f64 {
        self.offset_s + 1e-6 * self.drift_ppm * true_s
    }
}

impl FilmedRoom {
    fn new(options: &RoomOptions) -> Self {
        let made = RoomOptions { image_px: [200, 150], ..options.clone() }.build().unwrap();
        let folder = tempfile::tempdir().unwrap();
        made.room.write(folder.path()).unwrap();
        let room = Room::read(folder.path()).unwrap();
        let prepared = PreparedRoom::prepare(&room, folder.path(), &PreparationOptions::default()).unwrap();
        Self { made, prepared }
    }

    fn seeded(seed: u64) -> Self {
        Self::new(&RoomOptions { seed, ..RoomOptions::default() })
    }

    fn walkers(&self, seed: u64, people: usize, interval_s: f64) -> Vec<Walker> {
        let options =
            WalkerOptions { seed, people, first_s: 0.5, interval_s, stops: 6, ..WalkerOptions::default() };
        self.made.walkers(&options)
    }

    fn sequence(&self, walkers: Vec<Walker>) -> Sequence<'_> {
        let options = SequenceOptions { rate_hz: TICKS_HZ, images: false, ..SequenceOptions::default() };
        self.made.sequence(walkers, options)
    }

    /// Estimate after cameras with these clocks have filmed the walkers until `end_s`, with noisy masks.
    fn estimate(
        &self,
        walkers: Vec<Walker>,
        clocks: &[CameraClock],
        end_s: f64,
        options: OffsetOptions,
    ) -> Offsets {
        self.observed(walkers, clocks, end_s, options).estimate()
    }

    /// Estimator after the same observations.
    fn observed(
        &self,
        walkers: Vec<Walker>,
        clocks: &[CameraClock],
        end_s: f64,
        options: OffsetOptions,
    ) -> OffsetEstimator {
        let sequence = self.sequence(walkers);
        let mut rng = Pcg64Mcg::seed_from_u64(71);
        let mut frames: Vec<(f64, usize, f64)> = Vec::new();
        for (camera, clock) in clocks.iter().enumerate() {
            let filmed = clock.frames(end_s, &mut rng);
            frames.extend(filmed.into_iter().map(|(true_s, time_s)| (true_s, camera, time_s)));
        }
        frames.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let mut estimator = OffsetEstimator::new(&self.prepared, options).unwrap();
        for (true_s, camera, time_s) in frames {
            let mut mask = mask_at(&sequence, true_s, camera);
            spoil(&mut mask, &mut rng);
            estimator.observe(camera, time_s, &Mask::from(&mask)).unwrap();
        }
        estimator
    }
}

fn mask_at(sequence: &Sequence<'_>, true_s: f64, camera: usize) -> GrayImage {
    let mut frame = sequence.frame((true_s * TICKS_HZ).round() as u32 + 1);
    frame.cameras.swap_remove(camera).mask
}

/// Puts false foreground and holes into a mask.
fn spoil(mask: &mut GrayImage, rng: &mut Pcg64Mcg) {
    for spot in 0..10 {
        let (width, height) = (rng.random_range(1..7), rng.random_range(1..7));
        let left = rng.random_range(0..mask.width() - width);
        let top = rng.random_range(0..mask.height() - height);
        let value = if spot < 3 { 255 } else { 0 };
        for (u, v) in (top..top + height).flat_map(|v| (left..left + width).map(move |u| (u, v))) {
            mask.put_pixel(u, v, Luma([value]));
        }
    }
}

/// Error of a camera's offset at the time for which it holds, seconds.
fn error_s(offsets: &Offsets, camera: usize, clock: &CameraClock) -> f64 {
    // Offsets hold at a time by the cameras' clocks, which are a few seconds from true time at most.
    offsets.cameras[camera].offset_s - clock.offset_at(offsets.at_s)
}

#[test]
fn observations_cost_little_memory_in_a_live_run() {
    let scene = FilmedRoom::seeded(1);
    let options = OffsetOptions { window_s: 20.0, ..OffsetOptions::live() };
    let mut estimator = OffsetEstimator::new(&scene.prepared, options).unwrap();
    let mask = GrayImage::from_pixel(200, 150, Luma([255]));
    let empty = GrayImage::new(200, 150);
    for i in 0..1500 {
        let seen = if i % 60 < 30 { &mask } else { &empty };
        for camera in [0, 1] {
            estimator.observe(camera, f64::from(i) / 30.0, &Mask::from(seen)).unwrap();
        }
    }
    for history in &estimator.histories {
        let kept = history.between(0.0, 100.0).count();
        assert!((70..=82).contains(&kept), "5 s at most 16 times a second, not {kept}");
    }
    let windows = estimator.pairs[0].windows().count();
    assert!(windows <= 6, "20 s in windows of 4 s, not {windows}");
}

/// The energy by which windows are weighted is that of one walker.
#[test]
fn one_walker_has_the_energy_that_the_fit_takes_for_one() {
    const INTERVAL_S: f64 = 1.0 / 12.0;
    let mut energies = Vec::new();
    for seed in 21..=28 {
        let scene = FilmedRoom::seeded(seed);
        let clocks = [CameraClock::new(12.0, 0.0); 2];
        let walkers = scene.walkers(seed, 1, 4.0);
        let estimator = scene.observed(walkers, &clocks, 25.0, OffsetOptions::live());
        let pair = &estimator.pairs[0];
        let whole = 2.0 * pair.largest_lag_s * PairCorrelation::window_pairs(INTERVAL_S);
        let of_windows =
            pair.windows().map(|(_, bins)| bins.iter().map(|bin| bin.energy).sum::<f64>() / whole);
        // Windows in which both cameras see a person.
        energies.extend(of_windows.filter(|energy| *energy > 0.05));
    }
    energies.sort_by(f64::total_cmp);
    let median = energies[energies.len() / 2];
    println!("median {median} of {} windows, the fit takes {}", energies.len(), fit::WALKER_ENERGY);
    assert!((0.67..1.5).contains(&(median / fit::WALKER_ENERGY)), "{median}");
}

#[test]
fn frames_out_of_order_and_without_a_time_are_left_out() {
    let scene = FilmedRoom::seeded(1);
    let mut estimator = OffsetEstimator::new(&scene.prepared, OffsetOptions::live()).unwrap();
    let mask = GrayImage::new(200, 150);
    for time_s in [0.0, 1.0, f64::NAN, 0.5, 2.0, f64::INFINITY, 2.5, 3.0] {
        estimator.observe(0, time_s, &Mask::from(&mask)).unwrap();
    }
    let kept: Vec<f64> = estimator.histories[0].between(0.0, 9.0).map(|o| o.time_s).collect();
    assert_eq!(kept, [2.0, 2.5, 3.0], "the first two seconds make the mean");
    assert!((estimator.estimate().at_s - 3.0).abs() < 1e-12);
}

#[test]
fn masks_of_another_size_are_refused() {
    let scene = FilmedRoom::seeded(1);
    let mut estimator = OffsetEstimator::new(&scene.prepared, OffsetOptions::live()).unwrap();
    let refused = estimator.observe(1, 0.0, &Mask::new(100, 150)).unwrap_err().to_string();
    assert_eq!(refused, "camera `cam1`: frame 1 is 100 × 150 pixels, but the room says 200 × 150");
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let prepared = FilmedRoom::seeded(1).prepared;
    for (options, name) in [
        (OffsetOptions { reach_s: 0.0, ..OffsetOptions::live() }, "reach_s"),
        (OffsetOptions { reach_s: 100.0, ..OffsetOptions::recording() }, "reach_s"),
        (OffsetOptions { window_s: f64::NAN, ..OffsetOptions::live() }, "window_s"),
        (OffsetOptions { keep_s: 0.2, ..OffsetOptions::live() }, "keep_s"),
        (OffsetOptions { drift_sigma_ppm: -1.0, ..OffsetOptions::live() }, "drift_sigma_ppm"),
    ] {
        let refused = OffsetEstimator::new(&prepared, options).unwrap_err().to_string();
        assert!(refused.starts_with(name), "{refused}");
    }
}
