//! Outlines against closed forms, the server over its socket, and the page in a browser.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::Command;

use approx::assert_relative_eq;
use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Translation3};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::outline::{ImageOutline, OutlineDrawer};
use super::{Server, Session};
use crate::geometry::{Geometry, Mesh};
use crate::polygon::Polygon;
use crate::raycast::RayScene;
use crate::room::{Room, RoomCamera, Zone, ZoneKind};
use crate::view::look_at;
use crate::visibility::floor_under;

/// Focal length and principal point of the cameras below.
const F: f64 = 100.0;
const C: f64 = 99.5;

fn intrinsics() -> Intrinsics {
    let pinhole = Intrinsics::from_horizontal_fov(200, 200, 90.0);
    Intrinsics { fx: F, fy: F, cx: C, cy: C, ..pinhole }
}

/// Camera above the origin that looks down, its image's axes along the world's.
fn looking_down(height_m: f64) -> Camera {
    let rotation = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);
    posed(intrinsics(), &rotation, Point3::new(0.0, 0.0, height_m))
}

/// Level camera above the origin that looks along the world's x: a floor place (x, y) is at u = C − F y / x, v = C + F
/// h / x.
fn looking_ahead(height_m: f64) -> Camera {
    let rotation = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    posed(intrinsics(), &rotation, Point3::new(0.0, 0.0, height_m))
}

fn posed(intrinsics: Intrinsics, rotation: &Matrix3<f64>, eye: Point3<f64>) -> Camera {
    let translation = Translation3::from(-(rotation * eye.coords));
    let rotation = calib::rotation::from_matrix(rotation).unwrap();
    Camera { intrinsics, camera_from_world: Isometry3::from_parts(translation, rotation) }
}

/// A distorting lens, looking down into a room.
fn bent() -> Camera {
    let mut camera = looking_ahead(1.0);
    camera.intrinsics.distortion = [-0.25, 0.08, 0.002, -0.001, -0.01].into();
    camera.camera_from_world = look_at(&Point3::new(0.5, -1.0, 2.6), &Point3::new(4.0, 1.0, 0.0));
    camera
}

fn polygon(corners: &[(f64, f64)]) -> Polygon {
    Polygon(corners.iter().map(|(x, y)| Point2::new(*x, *y)).collect())
}

/// A box on the floor.
fn push_box(mesh: &mut Mesh, low: Vec3, high: Vec3) {
    let first = mesh.vertices.len() as u32;
    let corner = |i: u32| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
    mesh.vertices.extend((0..8).map(corner));
    mesh.colors.extend([[150; 3]; 8]);
    for q in [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]] {
        mesh.triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]].map(|t| t.map(|i: u32| first + i)));
    }
}

fn scene(boxes: &[(Vec3, Vec3)]) -> Geometry {
    let mut mesh = Mesh::default();
    // The floor, a little uneven, as reconstructed ones are.
    push_box(&mut mesh, Vec3::new(-9.0, -9.0, -0.1), Vec3::new(9.0, 9.0, 0.04));
    for (low, high) in boxes {
        push_box(&mut mesh, *low, *high);
    }
    Geometry::Mesh(mesh)
}

fn length(lines: &[Vec<Point2<f64>>]) -> f64 {
    lines.iter().flat_map(|line| line.windows(2)).map(|pair| (pair[1] - pair[0]).norm()).sum()
}

#[test]
fn a_square_below_a_pinhole_is_a_square() {
    // Half a metre around the origin, seen from two: 25 px around the image's middle.
    let square = polygon(&[(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]);
    let camera = looking_down(2.0);
    let ImageOutline { corners, visible, hidden } = OutlineDrawer::new(&camera, None).outline(&square, true);
    let expected = [(-25.0, 25.0), (25.0, 25.0), (25.0, -25.0), (-25.0, -25.0)];
    for (corner, (u, v)) in corners.iter().zip(expected) {
        assert_relative_eq!(corner.unwrap(), Point2::new(C + u, C + v), epsilon = 1e-9);
    }
    assert!(hidden.is_empty());
    assert_eq!(visible.len(), 1, "one line all around");
    assert_relative_eq!(length(&visible), 4.0 * 50.0, epsilon = 1e-6);
    for p in visible.iter().flatten() {
        assert_relative_eq!((p - Point2::new(C, C)).amax(), 25.0, epsilon = 1e-9);
    }
    // An open line leaves out the edge from the last corner to the first.
    let open = OutlineDrawer::new(&camera, None).outline(&square, false);
    assert_relative_eq!(length(&open.visible), 3.0 * 50.0, epsilon = 1e-6);
    for few in 0..3 {
        let few = Polygon(square.0[..few].to_vec());
        assert_eq!(OutlineDrawer::new(&camera, None).outline(&few, false).corners.len(), few.0.len());
    }
}

#[test]
fn a_bent_lens_bends_the_edges() {
    let zone = polygon(&[(2.0, -0.5), (4.5, -1.0), (5.0, 2.0), (3.0, 1.5)]);
    let camera = bent();
    let outline = OutlineDrawer::new(&camera, None).outline(&zone, true);
    for (corner, place) in outline.corners.iter().zip(&zone.0) {
        let expected = camera.project(&Point3::new(place.x, place.y, 0.0)).unwrap();
        assert_relative_eq!(corner.unwrap(), expected, epsilon = 1e-9);
    }
    // Points along each edge, projected by calib, lie on the line, and the line has no other points.
    let along: Vec<Point2<f64>> = zone
        .edges()
        .flat_map(|(a, b)| (0..4000).map(move |i| a + (b - a) * (f64::from(i) / 4000.0)))
        .map(|p| camera.project(&Point3::new(p.x, p.y, 0.0)).unwrap())
        .collect();
    let points: Vec<_> = outline.visible.iter().flatten().collect();
    assert!(points.iter().all(|p| along.iter().any(|q| (*p - q).norm() < 0.05)));
    assert!(along.iter().all(|q| points.iter().any(|p| (*p - q).norm() < 3.0)));
    let bends = outline.visible[0].windows(3).filter(|w| (w[1] - w[0]).perp(&(w[2] - w[1])).abs() > 1e-6);
    assert!(bends.count() > 10, "the edges are straight");
}

#[test]
fn outlines_behind_the_camera_are_cut_off() {
    let camera = looking_ahead(1.5);
    let around = polygon(&[(-5.0, -2.0), (5.0, -2.0), (5.0, 2.0), (-5.0, 2.0)]);
    let outline = OutlineDrawer::new(&camera, None).outline(&around, true);
    let at = |x: f64, y: f64| Point2::new(C - F * y / x, C + F * 1.5 / x);
    assert_eq!(outline.corners[0], None);
    assert_relative_eq!(outline.corners[2].unwrap(), at(5.0, 2.0), epsilon = 1e-9);
    let points: Vec<_> = outline.visible.iter().flatten().collect();
    // Either on the far edge, or on a side's image, which is a ray from the middle: Δu / Δv = ∓2 / 1.5.
    for p in &points {
        let (du, dv) = (p.x - C, p.y - C);
        let is_far = (dv - 30.0).abs() < 1e-6 && du.abs() < 40.0 + 1e-6;
        assert!(is_far || ((du.abs() / dv - 2.0 / 1.5).abs() < 1e-6 && dv > 30.0 - 1e-6), "{p}");
    }
    // The sides are followed to the image's rim.
    assert!(points.iter().any(|p| p.x < 0.0) && points.iter().any(|p| p.x > 199.0));
    assert!(points.iter().all(|p| p.coords.amax() < 1000.0));
    // Wholly behind; across, both ends far outside.
    let behind = polygon(&[(-5.0, -2.0), (-1.0, -2.0), (-1.0, 2.0)]);
    assert!(OutlineDrawer::new(&camera, None).outline(&behind, true).visible.is_empty());
    let across = polygon(&[(3.0, -1e4), (3.0, 1e4)]);
    let line = OutlineDrawer::new(&camera, None).outline(&across, false).visible;
    assert!(line.iter().flatten().all(|p| (p.y - (C + 50.0)).abs() < 1e-6));
    assert!(length(&line) > 200.0, "the middle of a long edge is lost");
}

#[test]
fn beyond_the_fold_of_a_lens_nothing_is_drawn() {
    let mut camera = looking_down(1.0);
    camera.intrinsics.distortion.k1 = -0.3;
    // The fold is at a radius of √(1/0.9) = 1.054 m on the floor, where the image ends 70.3 px from its middle.
    let far = polygon(&[(0.0, -20.0), (0.0, 20.0), (-20.0, 0.9)]);
    let outline = OutlineDrawer::new(&camera, None).outline(&far, true);
    assert_eq!(outline.corners, [None, None, None]);
    let fold_px = F * (1.0_f64 / 0.9).sqrt() * 2.0 / 3.0;
    let radii: Vec<f64> = outline.visible.iter().flatten().map(|p| (p - Point2::new(C, C)).norm()).collect();
    let furthest = radii.iter().copied().fold(0.0, f64::max);
    assert!(furthest <= fold_px + 1e-6 && furthest > fold_px - 0.01, "{furthest}, not {fold_px}");
    let vertical = outline.visible.iter().find(|line| line.iter().all(|p| (p.x - C).abs() < 1e-6)).unwrap();
    assert_relative_eq!(length(std::slice::from_ref(vertical)), 2.0 * fold_px, epsilon = 1e-3);
}

#[test]
fn edges_behind_a_box_are_hidden_and_the_others_not() {
    // A cube of a metre, 3 m ahead. At 1.5 m the eye sees over it only what is beyond 9 m, so of an edge 5 m ahead it
    // hides what lies within 0.5 m · 5/3 of the axis.
    let geometry = scene(&[(Vec3::new(3.0, -0.5, 0.0), Vec3::new(4.0, 0.5, 1.0))]);
    let scene = RayScene::new(&geometry).unwrap();
    let camera = looking_ahead(1.5);
    let edge = polygon(&[(5.0, -2.5), (5.0, 2.5)]);
    let outline = OutlineDrawer::new(&camera, Some(&scene)).outline(&edge, false);
    assert_eq!((outline.visible.len(), outline.hidden.len()), (2, 1));
    let reach = F * 0.5 / 3.0;
    let (first, last) = (outline.hidden[0][0], outline.hidden[0].last().unwrap());
    for (p, u) in [(first, C + reach), (*last, C - reach)] {
        assert!((p.x - u).abs() <= 3.0, "{p} is not at {u}");
    }
    assert_relative_eq!(length(&outline.visible) + length(&outline.hidden), F * 5.0 / 5.0, epsilon = 1e-6);
    // Nothing hides the floor before the box, rough as it is.
    let near = polygon(&[(2.0, -1.0), (2.0, 1.0)]);
    assert!(OutlineDrawer::new(&camera, Some(&scene)).outline(&near, false).hidden.is_empty());
}

#[test]
fn a_pixel_finds_the_floor_that_it_shows() {
    let camera = bent();
    let mut found = 0;
    for i in 0..400 {
        let place = Point2::new(1.5 + 0.3 * f64::from(i % 20), -3.0 + 0.3 * f64::from(i / 20));
        let Some(pixel) = camera.project(&Point3::new(place.x, place.y, 0.0)) else { continue };
        if camera.intrinsics.contains(&pixel) {
            assert_relative_eq!(floor_under(&camera, &pixel).unwrap(), place, epsilon = 1e-6);
            found += 1;
        }
    }
    assert!(found > 100);
    // By hand: 45° down from 1.5 m. The horizon, a pixel above it, and one just below it show no floor.
    let level = looking_ahead(1.5);
    let ahead = floor_under(&level, &Point2::new(C, C + F)).unwrap();
    assert_relative_eq!(ahead, Point2::new(1.5, 0.0), epsilon = 1e-9);
    for v in [C, C - 30.0, C + 1e-4] {
        assert_eq!(floor_under(&level, &Point2::new(C, v)), None);
    }
}

/// A room with a comment, three cameras, one of them with a reference image, and a door.
fn room() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let camera = |name: &str, camera: Camera| RoomCamera { name: name.into(), camera, reference: None };
    let mut cameras = vec![
        camera("down", looking_down(2.0)),
        camera("Küche links", looking_ahead(1.5)),
        camera("film", looking_down(2.0)),
    ];
    cameras[2].reference = Some("film.jpg".into());
    let door = Zone {
        name: "door <1>".into(),
        polygon: polygon(&[(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)]),
        kind: ZoneKind::Entry,
    };
    let geometry = Some(scene(&[(Vec3::new(3.0, -0.5, 0.0), Vec3::new(4.0, 0.5, 1.0))]));
    let walkable = Some(vec![polygon(&[(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)])]);
    Room { cameras, zones: vec![door], walkable, geometry }.write(folder.path()).unwrap();
    let film = image::RgbImage::from_fn(200, 200, |x, y| image::Rgb([x as u8, y as u8, 90]));
    film.save(folder.path().join("film.jpg")).unwrap();
    let text = format!("# Measured by hand.\n{}", scene_text(folder.path()));
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    folder
}

fn scene_text(dir: &Path) -> String {
    std::fs::read_to_string(dir.join("scene.toml")).unwrap()
}

/// Starts a server that runs until the tests end.
fn served(dir: &Path) -> SocketAddr {
    let (server, session) = (Server::bind("127.0.0.1", 0).unwrap(), Session::open(dir).unwrap());
    let address = server.address();
    std::thread::spawn(move || server.run(session));
    address
}

/// Head and body of the answer to a request, whose bytes are sent as given.
fn exchange(address: SocketAddr, request: &[u8]) -> (String, Vec<u8>) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(request).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    (String::from_utf8(answer[..end].to_vec()).unwrap(), answer[end + 4..].to_vec())
}

fn status(head: &str) -> u16 {
    head[9..12].parse().unwrap()
}

fn get(address: SocketAddr, path: &str) -> (String, Vec<u8>) {
    exchange(
        address,
        format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").as_bytes(),
    )
}

/// Status and JSON of the answer.
fn send(address: SocketAddr, method: &str, path: &str, body: &str) -> (u16, Value) {
    let length = body.len();
    let head = format!(
        "{method} {path} HTTP/1.1\r\nHost: localhost:1\r\nConnection: close\r\n\
         Content-Type: application/json; charset=utf-8\r\nContent-Length: {length}\r\n\r\n"
    );
    let (head, body) = exchange(address, (head + body).as_bytes());
    (status(&head), serde_json::from_slice(&body).unwrap())
}

fn room_json(address: SocketAddr) -> Value {
    let (head, body) = get(address, "/room.json");
    assert_eq!(status(&head), 200, "{head}");
    serde_json::from_slice(&body).unwrap()
}

#[test]
fn the_room_is_told_and_shown() {
    let folder = room();
    let address = served(folder.path());
    let told = room_json(address);
    assert_eq!(told["cameras"][1], json!({ "name": "Küche links", "width": 200, "height": 200 }));
    assert_eq!(told["zones"][0]["name"], "door <1>");
    assert_eq!(told["zones"][0]["kind"], "entry");
    let (head, plan) = get(address, "/plan.png?1");
    assert!(head.contains("image/png") && head.contains("no-store") && head.contains("default-src 'none'"));
    let plan = image::load_from_memory(&plan).unwrap().into_rgb8();
    assert_eq!(json!([plan.width(), plan.height()]), json!([told["plan"]["width"], told["plan"]["height"]]));
    // The server does not draw the zone: its middle is as grey as the floor beside it.
    let number = |value: &Value| value.as_f64().unwrap();
    let mapping = &told["plan"];
    let at = |x: f64, y: f64| {
        let u = number(&mapping["corner_px"][0])
            + (x - number(&mapping["low"][0])) * number(&mapping["px_per_m"]);
        let v = number(&mapping["corner_px"][1])
            + (number(&mapping["high"][1]) - y) * number(&mapping["px_per_m"]);
        *plan.get_pixel(u.round() as u32, v.round() as u32)
    };
    assert_eq!(at(-2.3, -2.3), at(-2.7, -2.3));
    assert_eq!(at(0.27, 0.31), at(-2.3, -2.3));
    // A reference image is sent unchanged; without one the room is rendered: the box is 3 to 4 m ahead.
    assert_eq!(get(address, "/camera/film").1, std::fs::read(folder.path().join("film.jpg")).unwrap());
    let (head, rendered) = get(address, "/camera/K%C3%BCche%20links");
    assert!(head.contains("image/png"), "{head}");
    let rendered = image::load_from_memory(&rendered).unwrap().into_rgb8();
    assert_eq!(rendered.dimensions(), (200, 200));
    assert!(rendered.get_pixel(99, 130) != rendered.get_pixel(60, 130), "no box");
}

#[test]
fn a_camera_that_nothing_is_known_of_is_grey() {
    let folder = room();
    let empty = Room { geometry: None, ..Room::read(folder.path()).unwrap() };
    let empty_dir = tempfile::tempdir().unwrap();
    empty.write(empty_dir.path()).unwrap();
    std::fs::write(empty_dir.path().join("film.jpg"), "no picture").unwrap();
    let address = served(empty_dir.path());
    let picture = image::load_from_memory(&get(address, "/camera/film").1).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (200, 200));
    assert!(picture.pixels().all(|pixel| pixel.0 == [128; 3]));
}

#[test]
fn outlines_and_places_are_answered() {
    let folder = room();
    let address = served(folder.path());
    let asked = json!({ "zones": [
        { "polygon": [[5.0, -2.5], [5.0, 2.5]], "closed": false },
        { "polygon": [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5]] },
    ]});
    let (status, told) = send(address, "POST", "/outlines", &asked.to_string());
    assert_eq!(status, 200, "{told}");
    assert_eq!(told[1]["camera"], "Küche links");
    assert_eq!(told[1]["outlines"][0]["hidden"].as_array().unwrap().len(), 1);
    let corner = &told[0]["outlines"][1]["corners"][1];
    assert_relative_eq!(corner[0].as_f64().unwrap(), C + 25.0, epsilon = 1e-9);
    assert_relative_eq!(corner[1].as_f64().unwrap(), C + 25.0, epsilon = 1e-9);

    let (_, place) = send(address, "POST", "/place", &json!({ "floor": [5.0, 0.0] }).to_string());
    assert_eq!(place["floor"], json!([5.0, 0.0]));
    assert_eq!(place["cameras"][1]["hidden"], true);
    assert_relative_eq!(place["cameras"][1]["pixel"][1].as_f64().unwrap(), C + 30.0, epsilon = 1e-9);
    let pixel = json!({ "camera": "down", "pixel": [C + 25.0, C] });
    let (_, place) = send(address, "POST", "/place", &pixel.to_string());
    assert_relative_eq!(place["floor"][0].as_f64().unwrap(), 0.5, epsilon = 1e-9);
    assert_eq!(place["cameras"][0]["hidden"], false);
    let sky = json!({ "camera": "Küche links", "pixel": [C, 10.0] });
    let (_, place) = send(address, "POST", "/place", &sky.to_string());
    assert_eq!(place, json!({ "floor": null, "cameras": [] }));
    let (status, told) = send(address, "POST", "/place", r#"{"camera":"up","pixel":[1,2]}"#);
    assert!(status == 404 && told["error"].as_str().unwrap().contains("`down`"), "{told}");
}

#[test]
fn saving_changes_the_zones_and_nothing_else() {
    let folder = room();
    let address = served(folder.path());
    let before = scene_text(folder.path());
    let told = room_json(address);
    let (mut zones, version) = (told["zones"].clone(), told["version"].clone());
    zones[0]["polygon"][2] = json!([0.75, 0.5]);
    let put = |zones: &Value, version: &Value| {
        send(address, "PUT", "/zones", &json!({ "zones": zones, "version": version }).to_string())
    };
    let (status, first) = put(&zones, &version);
    assert_eq!((status, &first["warnings"]), (200, &json!([])), "{first}");
    let after = scene_text(folder.path());
    assert!(after != before && after.starts_with("# Measured by hand.\n"));
    assert_eq!(after.replace("[0.75, 0.5]", "[0.5, 0.5]"), before);
    // The second follows the first, with a zone that nobody can stand in; the old version is stale by then.
    let far = json!({ "name": "far", "kind": "exit", "polygon": [[20.0, 0.0], [21.0, 0.0], [21.0, 1.0]] });
    zones.as_array_mut().unwrap().push(far);
    let (status, second) = put(&zones, &first["version"]);
    assert_eq!(status, 200, "{second}");
    let warning = second["warnings"][0].as_str().unwrap();
    assert!(warning.contains("`far`") && warning.contains("nobody can stand"), "{warning}");
    assert_eq!(Room::read(folder.path()).unwrap().zones[1].kind, ZoneKind::Exit);
    assert_eq!(room_json(address)["zones"], zones);
    let saved = scene_text(folder.path());
    let (status, stale) = put(&json!([]), &first["version"]);
    assert_eq!(status, 409, "{stale}");
    assert!(stale["error"].as_str().unwrap().contains("load it again"), "{stale}");
    // Not simple: named, and nothing is written.
    zones[0]["polygon"] = json!([[0, 0], [1, 1], [1, 0], [0, 2]]);
    let (status, refused) = put(&zones, &second["version"]);
    assert_eq!(status, 422, "{refused}");
    let line = refused["error"].as_str().unwrap();
    assert!(line.contains("`door <1>`") && line.contains("meets itself"), "{line}");
    assert_eq!(scene_text(folder.path()), saved);
}

#[test]
fn changes_by_other_programs_appear_when_the_page_reloads() {
    let folder = room();
    let address = served(folder.path());
    let version = room_json(address)["version"].clone();
    let by_hand = scene_text(folder.path()).replace("door <1>", "gate").replace("film\"", "tape\"");
    std::fs::write(folder.path().join("scene.toml"), by_hand).unwrap();
    let stale = json!({ "zones": [], "version": version });
    assert_eq!(send(address, "PUT", "/zones", &stale.to_string()).0, 409);
    let told = room_json(address);
    assert!(
        told["version"] != version
            && told["zones"][0]["name"] == "gate"
            && told["cameras"][2]["name"] == "tape"
    );
    let fresh = json!({ "zones": [], "version": told["version"] });
    assert_eq!(send(address, "PUT", "/zones", &fresh.to_string()).0, 200);
}

#[test]
fn requests_that_are_not_the_pages_are_refused() {
    let folder = room();
    let address = served(folder.path());
    let before = scene_text(folder.path());
    let ask = |request: &str| {
        let (head, body) = exchange(address, request.replace('\n', "\r\n").as_bytes());
        (status(&head), head, String::from_utf8(body).unwrap())
    };
    for (host, expected) in [
        ("127.0.0.1", 200),
        ("LocalHost:8080", 200),
        ("[::1]:8080", 200),
        ("example.org", 403),
        ("127.0.0.1.example.org", 403),
        ("localhost.example.org:8080", 403),
        ("", 403),
    ] {
        let (status, ..) = ask(&format!("GET /room.json HTTP/1.1\nHost: {host}\nConnection: close\n\n"));
        assert_eq!(status, expected, "{host}");
    }
    assert_eq!(ask("GET /room.json HTTP/1.0\n\n").0, 403, "no host");
    for path in [
        "/scene.toml",
        "/camera/../scene.toml",
        "/camera/%2e%2e",
        "/camera/%zz",
        "/film.jpg",
        "//",
        "/camera/",
    ] {
        assert_eq!(status(&get(address, path).0), 404, "{path}");
    }
    for (method, path, allow) in [
        ("GET", "/zones", "PUT"),
        ("POST", "/zones", "PUT"),
        ("OPTIONS", "/zones", "PUT"),
        ("DELETE", "/", "GET, HEAD"),
        ("PUT", "/outlines", "POST"),
        ("GET", "/place", "POST"),
    ] {
        let (status, head, _) = ask(&format!(
            "{method} {path} HTTP/1.1\nHost: localhost\nConnection: close\nContent-Length: 0\n\n"
        ));
        assert!(status == 405 && head.contains(&format!("allow: {allow}")), "{method} {path}: {head}");
    }
    let version = room_json(address)["version"].clone();
    let none = json!({ "zones": [], "version": version }).to_string();
    for content_type in ["text/plain", "application/x-www-form-urlencoded", "application/json5"] {
        let (status, ..) = ask(&format!(
            "PUT /zones HTTP/1.1\nHost: localhost\nConnection: close\nContent-Type: {content_type}\n\
             Content-Length: {}\n\n{none}",
            none.len()
        ));
        assert_eq!(status, 415, "{content_type}");
    }
    for body in [
        "",
        "{",
        "[]",
        "{\"zones\": []}",
        "\u{0}",
        r#"{"zones":[{"name":"a","polygon":[[0,null]]}],"version":""}"#,
    ] {
        let (status, told) = send(address, "PUT", "/zones", body);
        assert!(status == 400 && !told["error"].as_str().unwrap().contains('\n'), "{body}: {told}");
    }
    let mib = " ".repeat(1 << 20);
    assert_eq!(send(address, "PUT", "/zones", &mib).0, 400, "a mebibyte is read");
    assert_eq!(send(address, "PUT", "/zones", &format!("{mib} ")).0, 413);
    let chunked = format!(
        "PUT /zones HTTP/1.1\nHost: localhost\nConnection: close\nContent-Type: application/json\n\
         Transfer-Encoding: chunked\n\n100001\n{mib} \n0\n\n"
    );
    assert_eq!(ask(&chunked).0, 413);
    let many = json!({ "zones": [{ "polygon": vec![[0.0, 1.0]; 5001] }] });
    assert_eq!(send(address, "POST", "/outlines", &many.to_string()).0, 400);
    assert_eq!(scene_text(folder.path()), before);
}

#[test]
fn a_chromium_shows_the_zones() {
    let folder = room();
    let address = served(folder.path());
    let profile = tempfile::tempdir().unwrap();
    let mut browser = Command::new("chromium");
    browser
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args(["--virtual-time-budget=5000", "--dump-dom", &format!("http://{address}/")]);
    let Ok(output) = browser.output() else {
        eprintln!("skipped: there is no chromium here (apt-get install chromium)");
        return;
    };
    let dom = String::from_utf8_lossy(&output.stdout);
    let said = String::from_utf8_lossy(&output.stderr);
    // On the plan, in the list, and in a camera.
    for part in
        [">door &lt;1&gt;</text>", "Kind of zone door", "data-outline=\"door", "data-camera=\"Küche links\""]
    {
        assert!(dom.contains(part), "no `{part}` in:\n{dom}\n{said}");
    }
    assert!(dom.contains("id=\"unsaved\" hidden"), "{dom}");
}
