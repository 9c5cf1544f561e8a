//! Tests of the whole path from pictures to masks, with the events that happen to cameras and rooms. Tests with
//! rendered people and their true masks: [`super::rendered_tests`].

use image::{Luma, Rgb};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

use super::*;

const SIZE: (u32, u32) = (96, 72);

/// A camera over a tiled floor, with sensor noise.
struct FloorCamera {
    rng: Pcg64Mcg,
    time_s: f64,
}

impl FloorCamera {
    const STEP_S: f64 = 0.2;

    fn new() -> Self {
        Self { rng: Pcg64Mcg::seed_from_u64(4), time_s: 0.0 }
    }

    /// Next picture: the floor in `light` (a factor for each pixel), and a block of clothes in front of it.
    fn look(&mut self, block: Option<(u32, u32)>, light: impl Fn(u32, u32) -> f64) -> (RgbImage, f64) {
        let normal = Normal::new(0.0, 2.0).unwrap();
        self.time_s += Self::STEP_S;
        let picture = RgbImage::from_fn(SIZE.0, SIZE.1, |u, v| {
            let tile = if (u / 9 + v / 7) % 2 == 0 { 0.0 } else { 22.0 };
            let color = match block {
                Some((left, top)) if (left..left + 14).contains(&u) && (top..top + 34).contains(&v) => {
                    [40.0, 45.0, 130.0]
                }
                _ => [120.0 + tile, 115.0 + tile, 105.0 + tile],
            };
            Rgb(color
                .map(|c| (c * light(u, v) + normal.sample(&mut self.rng)).clamp(0.0, 255.0).round() as u8))
        });
        (picture, self.time_s)
    }
}

fn even(_: u32, _: u32) -> f64 {
    1.0
}

fn known(camera: &mut FloorCamera, options: ForegroundOptions) -> Foreground {
    let frames: Vec<RgbImage> = (0..15).map(|_| camera.look(None, even).0).collect();
    let start = InitialBackground::from(Backdrop::learn(&frames).unwrap());
    Foreground::new(SIZE.0, SIZE.1, start, options).unwrap()
}

/// Processes pictures for a time; returns the last verdict and mask.
fn watch(
    foreground: &mut Foreground,
    camera: &mut FloorCamera,
    seconds: f64,
    block: Option<(u32, u32)>,
    light: impl Fn(u32, u32) -> f64,
) -> (Verdict, GrayImage) {
    let mut mask = GrayImage::default();
    let mut verdict = Verdict::Usable;
    for _ in 0..(seconds / FloorCamera::STEP_S).round() as usize {
        let (picture, time_s) = camera.look(block, &light);
        verdict = foreground.mask(&picture, time_s, &mut mask).unwrap();
    }
    (verdict, mask)
}

/// Intersection over union with the block's true mask.
fn overlap(mask: &GrayImage, block: (u32, u32)) -> f64 {
    let truth = GrayImage::from_fn(SIZE.0, SIZE.1, |u, v| {
        let inside = (block.0..block.0 + 14).contains(&u) && (block.1..block.1 + 34).contains(&v);
        Luma([if inside { 255 } else { 0 }])
    });
    shared(mask, &truth).iou()
}

#[derive(Default)]
struct MaskOverlap {
    both: usize,
    either: usize,
}

impl MaskOverlap {
    fn iou(&self) -> f64 {
        self.both as f64 / self.either.max(1) as f64
    }
}

fn shared(mask: &GrayImage, truth: &GrayImage) -> MaskOverlap {
    let mut shared = MaskOverlap::default();
    for (m, t) in mask.iter().zip(truth.iter()) {
        shared.both += usize::from(*m > 0 && *t > 0);
        shared.either += usize::from(*m > 0 || *t > 0);
    }
    shared
}

fn is_empty(mask: &GrayImage) -> bool {
    mask.iter().all(|m| *m == 0)
}

#[test]
fn a_person_standing_for_a_minute_is_still_seen_and_a_moved_chair_is_absorbed() {
    let (mut camera, block) = (FloorCamera::new(), (30, 20));
    let mut median = known(&mut camera, ForegroundOptions::default());
    let mut online = Foreground::new(
        SIZE.0,
        SIZE.1,
        InitialBackground::Nothing(AdaptiveKind::Mog2),
        ForegroundOptions::default(),
    )
    .unwrap();
    watch(&mut online, &mut camera, 10.0, None, even);
    for (name, foreground) in [("median", &mut median), ("online", &mut online)] {
        let (verdict, mask) = watch(foreground, &mut camera, 60.0, Some(block), even);
        assert_eq!(verdict, Verdict::Usable);
        assert!(overlap(&mask, block) > 0.85, "{name}: {}", overlap(&mask, block));
        let (_, mask) = watch(foreground, &mut camera, 200.0, Some(block), even);
        assert!(is_empty(&mask), "{name}: still there after four minutes");
    }
    // Background and exposure must not drift together: at most half a level in four minutes.
    assert!(median.exposure.gain.iter().all(|g| (g - 1.0).abs() < 0.005), "{:?}", median.exposure);
    // The former background is known at once when the chair goes.
    let (_, mask) = watch(&mut median, &mut camera, 0.4, None, even);
    let left: Vec<(u32, u32)> = mask.enumerate_pixels().filter(|p| p.2[0] > 0).map(|p| (p.0, p.1)).collect();
    assert!(left.is_empty(), "a ghost of the chair: {left:?}");
}

fn of_reference(picture: RgbImage) -> InitialBackground {
    InitialBackground::Reference { camera: "cam0".to_owned(), picture }
}

#[test]
fn a_person_in_the_first_frame_is_seen_with_a_reference_picture_of_the_room() {
    let (mut camera, block) = (FloorCamera::new(), (30, 20));
    let options = ForegroundOptions::default;
    // A picture in evening light, with a chair that has gone since.
    let evening = |u: u32, _: u32| 0.6 + 0.002 * f64::from(u);
    let (reference, _) = camera.look(Some((75, 30)), evening);
    let made = |start: InitialBackground| Foreground::new(SIZE.0, SIZE.1, start, options()).unwrap();
    let (mut known, mut unknown) =
        (made(of_reference(reference)), made(InitialBackground::Nothing(AdaptiveKind::Mog2)));
    for seconds in [0.2, 60.0] {
        let (verdict, mut mask) = watch(&mut known, &mut camera, seconds, Some(block), even);
        assert_eq!(verdict, Verdict::Usable);
        // The reference picture does not show the floor behind the chair.
        let gone = mask.enumerate_pixels_mut().filter(|(u, ..)| *u >= 70);
        gone.for_each(|(.., pixel)| pixel[0] = 0);
        assert!(overlap(&mask, block) > 0.85, "{seconds} s: {}", overlap(&mask, block));
    }
    let (_, mask) = watch(&mut unknown, &mut camera, 10.0, Some(block), even);
    assert!(overlap(&mask, block) < 0.1, "the test needs no reference");
}

#[test]
fn a_picture_of_another_view_is_left_aside() {
    let mut camera = FloorCamera::new();
    let other = RgbImage::from_fn(SIZE.0, SIZE.1, |u, v| {
        let stripe = ((u * 13 + v * 29) % 97) as u8;
        Rgb([200 - stripe, 2 * stripe, 90 + stripe])
    });
    let start = |picture: RgbImage| {
        Foreground::new(SIZE.0, SIZE.1, of_reference(picture), ForegroundOptions::default())
    };
    let mut foreground = start(other).unwrap();
    let (verdict, mask) = watch(&mut foreground, &mut camera, 5.0, None, even);
    assert!(verdict == Verdict::Usable && is_empty(&mask));
    let small = start(RgbImage::new(9, 9)).err().unwrap().to_string();
    assert!(small.contains("9 × 9") && small.contains("96 × 72"), "{small}");
}

#[test]
fn exposure_and_shadows_leave_no_trace() {
    let (mut camera, block) = (FloorCamera::new(), (50, 25));
    let mut foreground = known(&mut camera, ForegroundOptions::default());
    for gain in [0.7, 0.85, 1.15, 1.3] {
        let (verdict, mask) = watch(&mut foreground, &mut camera, 0.2, Some(block), |_, _| gain);
        assert_eq!(verdict, Verdict::Usable, "gain {gain}");
        assert!(overlap(&mask, block) > 0.85, "gain {gain}: {}", overlap(&mask, block));
    }
    let cast = |u: u32, v: u32| if (10..45).contains(&u) && (50..62).contains(&v) { 0.65 } else { 1.0 };
    let (_, mask) = watch(&mut foreground, &mut camera, 0.2, Some(block), cast);
    assert!(overlap(&mask, block) > 0.8, "with a shadow: {}", overlap(&mask, block));
    let kept = ForegroundOptions { shadows: None, ..ForegroundOptions::default() };
    let (_, mask) = watch(&mut known(&mut camera, kept), &mut camera, 0.2, Some(block), cast);
    assert!(overlap(&mask, block) < 0.65, "the shadow should be in the mask when it is asked for");
}

#[test]
fn a_switched_lamp_sets_the_camera_aside_until_it_has_learnt() {
    let mut camera = FloorCamera::new();
    // A lamp in one corner: no gain explains it.
    let lamp = |u: u32, v: u32| 0.25 + 1.6 * (-((u * u + v * v) as f64) / 1800.0).exp();
    for start in ["median", "online"] {
        let mut foreground = if start == "median" {
            known(&mut camera, ForegroundOptions::default())
        } else {
            Foreground::new(
                SIZE.0,
                SIZE.1,
                InitialBackground::Nothing(AdaptiveKind::Knn),
                ForegroundOptions::default(),
            )
            .unwrap()
        };
        watch(&mut foreground, &mut camera, 10.0, None, even);
        let (verdict, _) = watch(&mut foreground, &mut camera, 0.2, None, lamp);
        assert_eq!(verdict, Verdict::AllForeground, "{start}");
        let (verdict, mask) = watch(&mut foreground, &mut camera, 8.0, None, lamp);
        assert_eq!(verdict, Verdict::Usable, "{start}");
        assert!(is_empty(&mask), "{start}: the new light is still foreground");
        let block = (14, 10);
        let (_, mask) = watch(&mut foreground, &mut camera, 0.4, Some(block), lamp);
        assert!(overlap(&mask, block) > 0.7, "{start}: {}", overlap(&mask, block));
    }
}

#[test]
fn frozen_and_dark_pictures_are_set_aside_and_the_camera_is_taken_back() {
    let mut camera = FloorCamera::new();
    let mut foreground = known(&mut camera, ForegroundOptions::default());
    watch(&mut foreground, &mut camera, 4.0, None, even);
    let (still, mut time_s) = camera.look(Some((30, 20)), even);
    let mut mask = GrayImage::default();
    let verdicts: Vec<Verdict> = (0..10)
        .map(|_| {
            time_s += 0.2;
            foreground.mask(&still, time_s, &mut mask).unwrap()
        })
        .collect();
    assert!(
        verdicts[0] == Verdict::Usable && verdicts[5..].iter().all(|v| *v == Verdict::Frozen),
        "{verdicts:?}"
    );
    camera.time_s = time_s;
    assert_eq!(watch(&mut foreground, &mut camera, 0.2, None, even).0, Verdict::Usable);
    assert_eq!(watch(&mut foreground, &mut camera, 0.2, None, |_, _| 0.01).0, Verdict::Dark);
    let (verdict, mask) = watch(&mut foreground, &mut camera, 0.2, Some((30, 20)), even);
    assert!(verdict == Verdict::Usable && overlap(&mask, (30, 20)) > 0.85);
}

#[test]
fn a_backdrop_of_another_size_is_refused() {
    let start = InitialBackground::from(Backdrop::learn(&[RgbImage::new(8, 6)]).unwrap());
    let said = Foreground::new(16, 12, start, ForegroundOptions::default()).err().unwrap().to_string();
    assert!(said.contains("8 × 6") && said.contains("16 × 12"), "{said}");
}
