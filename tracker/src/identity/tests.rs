use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point3, Vector3};

use super::*;
use crate::observation::{Colours, Mask};
use crate::prepared_room::PreparedCamera;
use crate::silhouette::Silhouette;
use calib::{Camera, Intrinsics};

const RED: Rgb<u8> = Rgb([200, 30, 30]);
const BLUE: Rgb<u8> = Rgb([30, 40, 190]);

fn view() -> View {
    let pose =
        Isometry3::face_towards(&Point3::new(0.0, -5.0, 1.6), &Point3::new(0.0, 0.0, 0.9), &-Vector3::z());
    let intrinsics = Intrinsics::from_horizontal_fov(320, 240, 70.0);
    View::new(&PreparedCamera::new("c", &Camera { intrinsics, camera_from_world: pose.inverse() }))
}

fn at(x_m: f64, y_m: f64) -> Body {
    Body { x_m, y_m, radius_m: 0.25, height_m: 1.75 }
}

/// Picture of people in plain clothes before a grey wall; the nearest is drawn last.
fn picture(view: &View, people: &[(Body, Rgb<u8>)]) -> CameraFrame {
    let mut image = RgbImage::from_pixel(320, 240, Rgb([120, 120, 120]));
    let mut order: Vec<_> = people.iter().collect();
    order.sort_by(|a, b| b.0.y_m.total_cmp(&a.0.y_m));
    for (body, colour) in order {
        for (u, v) in Silhouette::new(view, &body.ellipsoid()).pixels() {
            image.put_pixel(u, v, *colour);
        }
    }
    let mask = Mask::from_fn(320, 240, |_, _| true);
    CameraFrame { colours: Some(Colours::of_picture(&mask, 1, &image)), ..CameraFrame::default() }
}

/// Two people walk towards each other, pass, and go on; after they have passed, the tracker exchanges them if
/// `confused`. Returns all exchanges that were requested.
fn pass_by(colours: [Rgb<u8>; 2], confused: bool, pictures: bool) -> Vec<(TrackId, TrackId)> {
    walk_by(colours, confused, pictures, 0)
}

/// The same, but the second person appears at step `from`; they are closest to each other at step 20.
fn walk_by(colours: [Rgb<u8>; 2], confused: bool, pictures: bool, from: usize) -> Vec<(TrackId, TrackId)> {
    walk_by_with([&[], &[]], colours, confused, pictures, from)
}

/// The same, with boxes that have these appearance vectors.
fn walk_by_with(
    vectors: [&[f32]; 2],
    colours: [Rgb<u8>; 2],
    confused: bool,
    pictures: bool,
    from: usize,
) -> Vec<(TrackId, TrackId)> {
    let (view, mut identities) = (view(), Identities::default());
    let mut asked = Vec::new();
    for step in 0..=40_usize {
        let x = -2.0 + 0.1 * step as f64;
        let (first, second) = (at(x, 0.2), at(-x, -0.2));
        let there = if step < from { 1 } else { 2 };
        let frame = picture(&view, &[(first, colours[0]), (second, colours[1])][..there]);
        let shown = [(first, vectors[0]), (second, vectors[1])].map(|(body, vector)| {
            let mut mean = MeanVector::default();
            (0..3).for_each(|_| mean.add_box(vector));
            (body, mean)
        });
        let mut named = [1, 2].map(|id| (TrackId(id), shown[id as usize - 1].clone()));
        // Ids are exchanged back as soon as that is requested.
        if confused && x > 0.0 && asked.is_empty() {
            let [first, second] = shown;
            (named[0].1, named[1].1) = (second, first);
        }
        let frame = CameraFrame { colours: frame.colours.filter(|_| pictures), ..frame };
        let named = named.map(|(id, (body, vector))| NamedPerson { id, body, vector });
        let time_s = step as f64 / 10.0;
        asked.extend(identities.observe(&[frame], std::slice::from_ref(&view), &named[..there], time_s));
    }
    asked
}

#[test]
fn names_exchanged_in_an_encounter_are_given_back_once() {
    assert_eq!(pass_by([RED, BLUE], true, true), [(TrackId(1), TrackId(2))]);
}

#[test]
fn names_that_were_kept_stay() {
    assert_eq!(pass_by([RED, BLUE], false, true), []);
}

#[test]
fn somebody_who_appears_beside_another_does_not_keep_their_name() {
    assert_eq!(walk_by([RED, BLUE], true, true, 20), [(TrackId(1), TrackId(2))]);
    assert_eq!(walk_by([RED, BLUE], false, true, 20), []);
    assert_eq!(walk_by([RED, RED], true, true, 20), []);
}

#[test]
fn vectors_give_names_back_without_pictures() {
    let (here, there): (&[f32], &[f32]) = (&[1.0, 0.2, 0.1], &[0.4, 1.0, 0.0]);
    let exchanged = [(TrackId(1), TrackId(2))];
    assert_eq!(walk_by_with([here, there], [RED, RED], true, false, 0), exchanged);
    assert_eq!(walk_by_with([here, there], [RED, RED], false, false, 0), []);
    assert_eq!(walk_by_with([here, there], [RED, RED], true, false, 20), exchanged, "never seen apart");
    assert_eq!(walk_by_with([here, here], [RED, RED], true, false, 0), [], "they look alike");
}

#[test]
fn what_was_seen_newly_goes_along_with_an_exchange() {
    let (mut identities, view) = (Identities::default(), view());
    let mut asked = |step: u32, vectors: [&[f32]; 2]| {
        let people = [1, 2].map(|id| {
            let mut vector = MeanVector::default();
            (0..3).for_each(|_| vector.add_box(vectors[id as usize - 1]));
            NamedPerson { id: TrackId(id), body: at(f64::from(id), 0.0), vector }
        });
        let time_s = f64::from(step) / 10.0;
        identities.observe(&[CameraFrame::default()], std::slice::from_ref(&view), &people, time_s)
    };
    let (a, b): (&[f32], &[f32]) = (&[1.0, 0.2, 0.1], &[0.4, 1.0, 0.0]);
    assert!((0..30).all(|step| asked(step, [a, b]).is_empty()));
    let first = (30..60).find(|step| !asked(*step, [b, a]).is_empty()).expect("an exchange");
    // The names are right again, and no box says so.
    assert!((first + 1..first + 20).all(|step| asked(step, [&[], &[]]).is_empty()));
}

#[test]
fn colours_and_vectors_decide_together() {
    let (here, like_here): (&[f32], &[f32]) = (&[1.0, 0.2, 0.1], &[1.0, 0.25, 0.1]);
    assert_eq!(walk_by_with([here, like_here], [RED, BLUE], true, true, 0), [(TrackId(1), TrackId(2))]);
    assert_eq!(walk_by_with([here, like_here], [RED, BLUE], false, true, 0), []);
}

#[test]
fn people_who_look_alike_and_masks_without_pictures_decide_nothing() {
    assert_eq!(pass_by([RED, RED], true, true), []);
    assert_eq!(pass_by([RED, BLUE], true, false), []);
}

#[test]
fn only_what_a_camera_sees_of_a_person_is_theirs() {
    // The second person stands behind the first and is hardly visible.
    let view = view();
    let (near, far) = (at(0.0, -1.0), at(0.05, 1.0));
    let frame = picture(&view, &[(near, RED), (far, BLUE)]);
    let looks = appearance::sample(&[frame], std::slice::from_ref(&view), &[near, far]);
    assert!(looks[0].pixels() > 200.0, "{}", looks[0].pixels());
    assert!(looks[1].pixels() < 1.0, "{}", looks[1].pixels());
}
