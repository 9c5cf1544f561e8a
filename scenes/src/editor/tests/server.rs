//! The editor's server over its socket.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;

use approx::assert_relative_eq;
use serde_json::{Value, json};
use tempfile::TempDir;

use shell::loopback::Protection;

use super::super::{Server, Session};
use super::saving::saving;
use super::*;
use crate::room::{Room, RoomCamera, Zone, ZoneKind};

/// A room with a comment, three cameras, one of them with a reference image, and a door.
pub(super) fn room() -> TempDir {
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
    Room { cameras, zones: vec![door], walkable, geometry, ..Room::default() }.write(folder.path()).unwrap();
    let film = image::RgbImage::from_fn(200, 200, |x, y| image::Rgb([x as u8, y as u8, 90]));
    film.save(folder.path().join("film.jpg")).unwrap();
    let text = format!("# Measured by hand.\n{}", scene_text(folder.path()));
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    folder
}

pub(super) fn scene_text(dir: &Path) -> String {
    std::fs::read_to_string(dir.join("scene.toml")).unwrap()
}

/// Starts a server that runs until the tests end.
pub(super) fn served(dir: &Path) -> SocketAddr {
    let (server, session) =
        (Server::bind("127.0.0.1", 0, &Protection::default()).unwrap(), Session::open(dir).unwrap());
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
pub(super) fn send(address: SocketAddr, method: &str, path: &str, body: &str) -> (u16, Value) {
    let length = body.len();
    let head = format!(
        "{method} {path} HTTP/1.1\r\nHost: localhost:1\r\nConnection: close\r\n\
         Content-Type: application/json; charset=utf-8\r\nContent-Length: {length}\r\n\r\n"
    );
    let (head, body) = exchange(address, (head + body).as_bytes());
    (status(&head), serde_json::from_slice(&body).unwrap())
}

pub(super) fn room_json(address: SocketAddr) -> Value {
    let (head, body) = get(address, "/room.json");
    assert_eq!(status(&head), 200, "{head}");
    serde_json::from_slice(&body).unwrap()
}

#[test]
fn the_room_is_told_and_shown() {
    let folder = room();
    let address = served(folder.path());
    let told = room_json(address);
    let camera = &told["cameras"][1];
    assert_eq!(json!([camera["name"], camera["width"], camera["height"]]), json!(["Küche links", 200, 200]));
    // The 3-D view's: it stands 1.5 m above the origin and looks along x.
    assert_relative_eq!(camera["center"][2].as_f64().unwrap(), 1.5, epsilon = 1e-9);
    let frustum = camera["frustum"].as_array().unwrap();
    assert!(frustum.len() == 4 && frustum.iter().all(|corner| corner[0].as_f64().unwrap() > 0.2), "{camera}");
    assert!(get(address, "/surfaces").0.contains("application/octet-stream"));
    assert_eq!(told["drawing"]["zones"][0]["name"], "door <1>");
    assert_eq!(told["drawing"]["zones"][0]["kind"], "entry");
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
fn references_that_were_turned_as_they_were_taken_stand_upright() {
    let folder = room();
    // 20 × 10 pixels, white at the left end, with EXIF that says to turn it by 90° clockwise: white is above then.
    let mut bytes = std::io::Cursor::new(Vec::new());
    let film = image::RgbImage::from_fn(20, 10, |x, _| image::Rgb([if x < 8 { 255 } else { 0 }; 3]));
    film.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    let mut bytes = bytes.into_inner();
    let exif = b"\xff\xe1\x00\x22Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    bytes.splice(2..2, exif.iter().copied());
    std::fs::write(folder.path().join("film.jpg"), bytes).unwrap();
    let address = served(folder.path());
    let (head, shown) = get(address, "/camera/film");
    assert!(head.contains("image/jpeg"), "{head}");
    let shown = image::load_from_memory(&shown).unwrap().into_luma8();
    assert_eq!(shown.dimensions(), (10, 20));
    assert!(shown[(5, 2)][0] > 200 && shown[(5, 17)][0] < 50);
}

#[test]
fn other_machines_need_the_token_of_the_link() {
    let folder = room();
    let token = folder.path().join("token");
    std::fs::write(&token, "0123456789abcdef\n").unwrap();
    let protection = Protection { token_file: Some(token), ..Protection::default() };
    let server = Server::bind("0.0.0.0", 0, &protection).unwrap();
    assert!(server.link().ends_with("/?token=0123456789abcdef"), "{}", server.link());
    let open = Server::bind("0.0.0.0", 0, &Protection::default()).unwrap();
    assert!(open.link().contains("/?token="), "{}", open.link());
    let (port, session) = (server.address().port(), Session::open(folder.path()).unwrap());
    std::thread::spawn(move || server.run(session));
    let address: SocketAddr = format!("127.0.0.1:{port}").parse().unwrap();
    assert_eq!(status(&get(address, "/room.json").0), 403);
    assert_eq!(status(&get(address, "/?token=0123456789abcdeg").0), 403);
    let (head, _) = get(address, "/?token=0123456789abcdef");
    assert!(status(&head) == 303 && head.contains(&format!("token_{port}=0123456789abcdef")), "{head}");
    let with_cookie = format!(
        "GET /room.json HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nCookie: token_{port}=0123456789abcdef\r\n\r\n"
    );
    assert_eq!(status(&exchange(address, with_cookie.as_bytes()).0), 200);
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
        ("GET", "/drawing", "PUT"),
        ("POST", "/drawing", "PUT"),
        ("OPTIONS", "/drawing", "PUT"),
        ("DELETE", "/", "GET, HEAD"),
        ("PUT", "/outlines", "POST"),
        ("GET", "/place", "POST"),
    ] {
        let (status, head, _) = ask(&format!(
            "{method} {path} HTTP/1.1\nHost: localhost\nConnection: close\nContent-Length: 0\n\n"
        ));
        assert!(status == 405 && head.contains(&format!("allow: {allow}")), "{method} {path}: {head}");
    }
    let base = room_json(address)["drawing"].clone();
    let none = saving(&base, &json!({ "zones": [], "regions": [], "lines": [], "floor": [] })).to_string();
    for content_type in ["text/plain", "application/x-www-form-urlencoded", "application/json5"] {
        let (status, ..) = ask(&format!(
            "PUT /drawing HTTP/1.1\nHost: localhost\nConnection: close\nContent-Type: {content_type}\n\
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
        r#"{"base":{"zones":[{"name":"a","polygon":[[0,null]]}],"regions":[],"lines":[],"floor":[]}}"#,
    ] {
        let (status, told) = send(address, "PUT", "/drawing", body);
        assert!(status == 400 && !told["error"].as_str().unwrap().contains('\n'), "{body}: {told}");
    }
    let mib = " ".repeat(1 << 20);
    assert_eq!(send(address, "PUT", "/drawing", &mib).0, 400, "a mebibyte is read");
    assert_eq!(send(address, "PUT", "/drawing", &format!("{mib} ")).0, 413);
    let chunked = format!(
        "PUT /drawing HTTP/1.1\nHost: localhost\nConnection: close\nContent-Type: application/json\n\
         Transfer-Encoding: chunked\n\n100001\n{mib} \n0\n\n"
    );
    assert_eq!(ask(&chunked).0, 413);
    let many = json!({ "zones": [{ "polygon": vec![[0.0, 1.0]; 5001] }] });
    assert_eq!(send(address, "POST", "/outlines", &many.to_string()).0, 400);
    assert_eq!(scene_text(folder.path()), before);
}
