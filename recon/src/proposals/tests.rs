//! Proposals on rendered rooms with ground truth: the true position of a proposed point in the other image.

use super::*;
use crate::surface::rendered::Rendering;
use calib::Camera;
use nalgebra::{Isometry3, Point3, Vector3};
use scenes::geometry::{vec3_from_point, vec3_from_vector};
use scenes::raycast::RayScene;
use synthetic::{RoomOptions, SyntheticRoom};

fn room(seed: u64) -> SyntheticRoom {
    RoomOptions { seed, image_px: [480, 360], ..RoomOptions::default() }.build().unwrap()
}

/// Surface as of a camera's capture: stereo with noise and holes in a unit of its own, and a picture with sensor noise.
fn surface(room: &SyntheticRoom, camera: &Camera, seed: u64) -> Surface {
    let unit_m = 0.6 + 0.3 * seed as f64;
    Rendering { unit_m, noise: 0.005, holes: 0.2, seed }.filmed(room, camera)
}

/// Distance of a proposal's second pixel from the true projection of the first one's point; `None` where it is hidden.
fn miss_px(scene: &RayScene, [a, b]: [&Camera; 2], proposal: &Proposal) -> Option<f64> {
    let ray = a.camera_from_world.rotation.inverse() * a.intrinsics.unproject(&proposal.pixels[0])?;
    let hit = scene.cast(vec3_from_point(&a.center()), vec3_from_vector(&ray))?;
    let place: Point3<f64> = a.center() + ray * f64::from(hit.distance);
    Some((b.project(&place)? - proposal.pixels[1]).norm())
}

/// The camera moved to another place in the room.
fn aside(camera: &Camera) -> Camera {
    let step = Isometry3::new(Vector3::new(-0.3, 0.0, -0.9), Vector3::new(0.05, 0.25, 0.0));
    Camera { intrinsics: camera.intrinsics.clone(), camera_from_world: step * camera.camera_from_world }
}

fn only(surfaces: [&Surface; 2]) -> Option<Correspondence> {
    propose(&surfaces, &ProposalOptions::default()).unwrap().pop().unwrap().found
}

#[test]
fn proposals_are_the_same_place_from_beside_and_from_the_opposite_wall() {
    let mut misses = Vec::new();
    for seed in 1..=4 {
        let room = room(seed);
        let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
        let [a, b] = [0, 1].map(|i| &room.room.cameras[i].camera);
        let here = surface(&room, a, seed);
        for other in [b, &aside(a)] {
            let there = surface(&room, other, seed + 1);
            let found = only([&here, &there]).unwrap();
            assert!((5..=12).contains(&found.proposals.len()), "seed {seed}: {found:?}");
            misses.extend(found.proposals.iter().filter_map(|p| miss_px(&scene, [a, other], p)));

            // The similarity is that of the two cameras, and reveals an error of a pick.
            let true_pose = a.camera_from_world * other.camera_from_world.inverse();
            let turn = found.first_from_second.isometry.rotation.angle_to(&true_pose.rotation);
            assert!(turn.to_degrees() < 1.0, "seed {seed}: {}°", turn.to_degrees());
            let [p, q] = found.proposals[0].pixels;
            let slipped = q + nalgebra::Vector2::new(40.0, 0.0);
            let [right, wrong] = [q, slipped].map(|q| found.miss_px([&here, &there], [p, q]).unwrap());
            assert!(right < 5.0 && wrong > 15.0, "seed {seed}: {right} px, {wrong} px");
        }
    }
    misses.sort_by(f64::total_cmp);
    assert!(misses.len() >= 60 && misses[misses.len() / 2] < 0.6, "{misses:?}");
    let wrong = misses.iter().filter(|m| **m > 3.0).count();
    assert!(50 * wrong <= misses.len(), "{wrong} of {}: {misses:?}", misses.len());
}

#[test]
fn surfaces_and_pictures_bear_out_the_truth_alone() {
    let options = ProposalOptions::default();
    let room = room(2);
    let [a, b] = [0, 1].map(|i| &room.room.cameras[i].camera);
    let surfaces = [surface(&room, a, 1), surface(&room, b, 2)];
    let seen =
        surfaces.each_ref().map(|s| ComparedView { surface: s, intensity: Intensity::new(&s.picture) });
    // Units: 0.9 m and 1.2 m.
    let relative = a.camera_from_world * b.camera_from_world.inverse();
    let truth =
        Similarity3::from_parts((relative.translation.vector / 0.9).into(), relative.rotation, 1.2 / 0.9);
    let told = evidence::of([&seen[0], &seen[1]], &truth);
    assert!(told.in_the_way < 0.1 && told.correlation > 0.5 && told.compared > 200, "{told:?}");

    // As if both cameras stood in the same corner: the room's shape fits, its pictures do not.
    let corner = evidence::of([&seen[0], &seen[1]], &Similarity3::from_scaling(1.2 / 0.9));
    assert!(corner.correlation < options.least_correlation && corner.compared > 100, "{corner:?}");
    // Moved along its viewing direction, one camera's wall stands before the other's surfaces.
    let step = Similarity3::new(Vector3::new(0.0, 0.0, -2.0), Vector3::zeros(), 1.0);
    let behind = evidence::of([&seen[0], &seen[1]], &(step * truth));
    assert!(behind.in_the_way > options.most_in_the_way, "{behind:?}");
}

#[test]
fn exact_matches_are_not_moved() {
    let room = room(1);
    let surface = surface(&room, &room.room.cameras[0].camera, 1);
    let seen = ComparedView { surface: &surface, intensity: Intensity::new(&surface.picture) };
    let start = Similarity3::identity();
    let (found, matches) = guided::matches([&seen, &seen], &start, 2.0, &ProposalOptions::default()).unwrap();
    assert!(
        matches.len() > 100 && matches.iter().all(|m| (m.pixels[0] - m.pixels[1]).norm() < 1e-3),
        "{}",
        matches.len()
    );
    approx::assert_relative_eq!(found, start, epsilon = 1e-6);
}

#[test]
fn cameras_of_different_rooms_have_nothing_in_common() {
    let rooms = [1, 2, 3].map(room);
    let surfaces = rooms.each_ref().map(|room| surface(room, &room.room.cameras[0].camera, 1));
    let [a, b, c] = &surfaces;
    let pairs = propose(&[a, b, c], &ProposalOptions::default()).unwrap();
    assert_eq!(pairs.iter().map(|p| p.cameras).collect::<Vec<_>>(), [[0, 1], [0, 2], [1, 2]]);
    for pair in pairs {
        assert_eq!(pair.found, None);
    }
}

#[test]
fn blank_views_give_no_proposals() {
    let room = room(1);
    let seen = surface(&room, &room.room.cameras[0].camera, 1);
    let mut blank = seen.clone();
    blank.picture.fill(90);
    let mut unmeasured = seen.clone();
    unmeasured.depth.fill(0.0);
    for other in [&blank, &unmeasured] {
        assert_eq!(only([&seen, other]), None);
        assert_eq!(only([other, other]), None);
    }
    assert_eq!(propose(&[&seen], &ProposalOptions::default()).unwrap(), []);
    assert_eq!(propose(&[], &ProposalOptions::default()).unwrap(), []);
}
