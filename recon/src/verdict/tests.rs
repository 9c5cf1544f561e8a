//! Verdicts about figures of rooms that are right, and of the same with one mistake.

use super::*;
use crate::scale::LengthResidual;
use crate::scale::control::ControlResidual;

fn captures() -> Vec<CaptureFigures> {
    let of = |name: &str| CaptureFigures {
        name: name.into(),
        width: 640,
        parallax_deg: 4.0,
        ..CaptureFigures::default()
    };
    vec![of("left"), of("right")]
}

/// Two cameras under the ceiling of a room whose pictures agree where their surfaces coincide.
fn evidence() -> RoomEvidence {
    let camera = CameraEvidence { height_m: 2.4, lean_deg: Some(0.4), outvoted: 1.0 };
    let pair = PairEvidence {
        cameras: [0, 1],
        picks: 6,
        left_out: 0,
        rms_px: 0.8,
        overlapping: 4000,
        in_the_way: 0.02,
        compared: 300,
        correlation: 0.7,
        shared_features: Some(60),
    };
    RoomEvidence {
        cameras: vec![camera.clone(), camera],
        pairs: vec![pair],
        floor_share: 0.2,
        reach_m: 4.0,
        ..RoomEvidence::default()
    }
}

/// Verdict about the sound room with a change, and the worst reason's text.
fn judged(change: impl FnOnce(&mut RoomEvidence, &mut Vec<CaptureFigures>)) -> (Light, String) {
    let (mut evidence, mut captures) = (evidence(), captures());
    change(&mut evidence, &mut captures);
    let Verdict { light, reasons } = judge(&evidence, &captures);
    let worst = reasons.into_iter().next();
    (light, worst.map(|reason| reason.text).unwrap_or_default())
}

#[test]
fn nothing_is_said_of_a_sound_room() {
    assert_eq!(judge(&evidence(), &captures()), Verdict::default());
}

#[test]
fn three_picks_prove_nothing_unless_the_pictures_agree() {
    let (light, text) = judged(|room, _| room.pairs[0].picks = 3);
    assert!(light == Light::Green && text.contains("3 picks") && text.contains("pictures agree"), "{text}");
    let (light, text) = judged(|room, _| {
        room.pairs[0].picks = 3;
        room.pairs[0].correlation = 0.32;
    });
    assert!(
        light == Light::Amber && text.contains("prove nothing") && text.contains("points more"),
        "{text}"
    );
    let (light, _) = judged(|room, _| {
        room.pairs[0].picks = 3;
        room.pairs[0].compared = 5;
    });
    assert_eq!(light, Light::Amber, "a handful of places is no evidence");
    // A pair that is joined by way of a third camera needs none.
    assert_eq!(judged(|room, _| room.pairs[0].picks = 0).0, Light::Green);
}

#[test]
fn surfaces_in_anothers_view_contradict_the_room() {
    let with = |share: f64, correlation: f64, overlapping: usize| {
        judged(|room, _| {
            let pair = &mut room.pairs[0];
            (pair.in_the_way, pair.correlation, pair.overlapping) = (share, correlation, overlapping);
        })
    };
    assert_eq!(with(0.5, 0.6, 4000).0, Light::Amber);
    let (light, text) = with(0.5, 0.3, 4000);
    assert!(light == Light::Red && text.contains("50 %") && text.contains("mirrored"), "{text}");
    assert_eq!(with(0.2, 0.6, 4000).0, Light::Green, "edges of things, where the pictures agree");
    assert_eq!(with(0.2, 0.2, 4000).0, Light::Red, "pictures that differ, too");
    assert_eq!(with(0.5, 0.5, 20).0, Light::Green, "of a few pixels nothing is known");
    assert_eq!(with(0.02, 0.0, 4000).0, Light::Amber);
}

#[test]
fn metres_that_no_room_has_are_red_and_told_once() {
    let mut evidence = evidence();
    evidence.reach_m = 4000.0;
    for camera in &mut evidence.cameras {
        camera.height_m = 2400.0;
    }
    let verdict = judge(&evidence, &captures());
    assert_eq!((verdict.light, verdict.reasons.len()), (Light::Red, 1));
    let text = &verdict.reasons[0].text;
    assert!(text.contains("`left` is 2400.0 m above the floor") && text.contains("millimetres"), "{text}");
    // A hall, a mast, a doll's house.
    assert_eq!(judged(|room, _| room.cameras[0].height_m = 12.0).0, Light::Green);
    assert_eq!(judged(|room, _| room.cameras[0].height_m = 40.0).0, Light::Amber);
    let (light, text) = judged(|room, _| room.cameras[0].height_m = 0.002);
    assert!(light == Light::Red && text.contains("2.0 mm"), "{text}");
}

#[test]
fn a_wall_taken_for_the_floor_is_doubted_by_the_lines_of_most_pictures() {
    let lean = |deg: f64, outvoted: f64, cameras: usize| {
        judged(|room, _| {
            for camera in room.cameras.iter_mut().take(cameras) {
                (camera.lean_deg, camera.outvoted) = (Some(deg), outvoted);
            }
        })
    };
    let (light, text) = lean(84.0, 3.0, 2);
    assert!(light == Light::Amber && text.contains("84°") && text.contains("wall"), "{text}");
    assert_eq!(lean(84.0, 3.0, 1).0, Light::Green, "one picture's lines may be a pattern's");
    assert_eq!(lean(84.0, 1.1, 2).0, Light::Green, "as many lines are for the floor");
    assert_eq!(lean(3.0, 3.0, 2).0, Light::Green);
    assert_eq!(judged(|room, _| room.floor_share = 0.01).0, Light::Amber);
}

#[test]
fn captures_that_hardly_moved_and_picks_left_out_are_told() {
    // Pictures that agree outweigh them; where too few places are compared nothing does.
    let alone = |change: fn(&mut Vec<CaptureFigures>)| {
        let with_others = judged(|_, captures| change(captures)).0;
        assert_eq!(with_others, Light::Green);
        judged(|room, captures| {
            room.pairs[0].compared = 5;
            change(captures);
        })
    };
    let (light, text) = alone(|captures| captures[1].parallax_deg = 1.2);
    assert!(light == Light::Amber && text.contains("`right` hardly moved"), "{text}");
    let (light, text) = alone(|captures| captures[0].doubts.push("two motions fit".into()));
    assert!(light == Light::Amber && text == "`left`: two motions fit", "{text}");
    assert_eq!(alone(|captures| captures[0].focal_sigma = Some(0.2)).0, Light::Amber);
    let (light, text) = judged(|room, _| room.pairs[0].left_out = 1);
    assert!(light == Light::Amber && text.contains("1 of 7 picks"), "{text}");
    // Of points that the program proposed to itself some may be chance.
    let proposed = |left_out: usize| {
        judged(move |room, _| (room.are_picks_proposed, room.pairs[0].left_out) = (true, left_out)).0
    };
    assert_eq!([1, 3, 4].map(proposed), [Light::Green, Light::Green, Light::Amber]);
    assert_eq!(judged(|room, _| room.pairs[0].rms_px = 7.0).0, Light::Amber);
}

#[test]
fn the_worst_reason_comes_first() {
    let (mut evidence, mut captures) = (evidence(), captures());
    captures[0].parallax_deg = 1.2;
    evidence.pairs[0].in_the_way = 0.6;
    evidence.pairs[0].compared = 5;
    (evidence.are_picks_proposed, evidence.pairs[0].left_out) = (true, 1);
    let lights: Vec<Light> = judge(&evidence, &captures).reasons.iter().map(|reason| reason.light).collect();
    assert_eq!(lights, [Light::Red, Light::Amber, Light::Green]);
}

#[test]
fn lengths_that_contradict_each_other_are_named() {
    let length = |name: &str, known_m: f64, found_m: f64| LengthResidual {
        name: name.into(),
        known_m,
        found_m,
        sigma_m: 0.004 * known_m,
    };
    let (light, _) = judged(|room, _| room.lengths = vec![length("one", 2.0, 2.6)]);
    assert_eq!(light, Light::Green, "one length cannot contradict itself");
    let (light, _) = judged(|room, _| {
        room.lengths = vec![length("one", 2.0, 2.01), length("other", 4.0, 3.98)];
    });
    assert_eq!(light, Light::Green, "1 % with a standard deviation of 0.6 %");
    let (light, text) =
        judged(|room, _| room.lengths = vec![length("one", 2.0, 2.05), length("other", 4.0, 3.9)]);
    assert!(light == Light::Amber && text.contains("one") && text.contains("5.1 %"), "{text}");
    let (light, text) = judged(|room, _| {
        room.lengths =
            vec![length("one", 2.0, 2.002), length("other", 4.0, 3.995), length("third", 1.0, 1.3)];
    });
    assert!(light == Light::Amber && text.starts_with("third is 1.000 m"), "{text}");
}

#[test]
fn control_points_that_are_off_are_named() {
    let point = |number, off_m: &[f64]| ControlResidual { number, off_m: off_m.to_vec(), sigma_m: 0.01 };
    let (light, _) = judged(|room, _| {
        room.control_points = vec![point(1, &[0.03, -0.02]), point(2, &[-0.03, 0.02, 0.01])];
    });
    assert_eq!(light, Light::Green);
    let (light, text) = judged(|room, _| {
        room.control_points = vec![point(1, &[0.01, 0.0]), point(2, &[0.01, 0.02, -0.2])];
    });
    assert!(
        light == Light::Amber && text.contains("[[control]] 2") && text.contains("height -20.0 cm"),
        "{text}"
    );
}

#[test]
fn pictures_that_look_alike_and_share_no_feature_are_doubted() {
    let (light, text) = judged(|room, _| room.pairs[0].shared_features = Some(0));
    assert!(light == Light::Amber && text.contains("`left`") && text.contains("no feature"), "{text}");
    // Without a search there is as little to bear the picks out; pictures that hardly overlap have no features to share.
    let (light, text) = judged(|room, _| room.pairs[0].shared_features = None);
    assert!(light == Light::Amber && text.contains("`left`") && text.contains("bear them out"), "{text}");
    let apart = |room: &mut RoomEvidence, _: &mut Vec<CaptureFigures>| {
        (room.pairs[0].shared_features, room.pairs[0].compared) = (Some(0), 20);
    };
    assert_eq!(judged(apart).0, Light::Green);
    // Pictures that look different are told as such, once.
    let mut unlike = evidence();
    (unlike.pairs[0].shared_features, unlike.pairs[0].correlation) = (None, 0.1);
    assert_eq!(judge(&unlike, &captures()).reasons.len(), 1);

    // Of three cameras each shares features with one other: nobody stands alone.
    let three = |of_third: Option<usize>| {
        judged(move |room, captures| {
            captures.push(CaptureFigures { name: "third".into(), ..captures[0].clone() });
            room.cameras.push(room.cameras[0].clone());
            let pair =
                |cameras, shared_features| PairEvidence { cameras, shared_features, ..room.pairs[0].clone() };
            room.pairs = vec![pair([0, 1], Some(60)), pair([0, 2], Some(0)), pair([1, 2], of_third)];
        })
    };
    assert_eq!(three(Some(12)).0, Light::Green);
    for of_third in [Some(0), None] {
        let (light, text) = three(of_third);
        assert!(light == Light::Amber && text.contains("`third`"), "{of_third:?}: {text}");
    }
}

#[test]
fn captures_that_contradict_the_picks_are_told() {
    let (light, text) = judged(|room, _| room.adjustment_contradicts_picks = true);
    assert!(light == Light::Amber && text.contains("contradict the picks"), "{text}");
}
