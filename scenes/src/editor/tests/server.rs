//! The editor's server over its socket, and its page in a browser.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;

use approx::assert_relative_eq;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::super::{Server, Session};
use super::browser::{CTRL, Page};
use super::*;
use crate::room::{Room, RoomCamera, Zone, ZoneKind};

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
    Room { cameras, zones: vec![door], walkable, geometry, ..Room::default() }.write(folder.path()).unwrap();
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

/// Draws a zone, names it, drags two of its corners, undoes one, and saves.
#[test]
fn a_zone_drawn_in_a_chromium_is_saved_as_it_was_left() {
    let folder = room();
    let address = served(folder.path());
    let before = scene_text(folder.path());
    let Some(mut page) = Page::open(&format!("http://{address}/")) else { return };
    page.wait_until("document.querySelectorAll('#cameras [data-outline]').length > 0");
    // On the plan, in the list, and in a camera.
    let shown = page.value("document.documentElement.outerHTML");
    let shown = shown.as_str().unwrap();
    for part in [">door &lt;1&gt;</text>", "Kind of zone door", "data-camera=\"Küche links\""] {
        assert!(shown.contains(part), "no `{part}` in:\n{shown}");
    }
    assert!(
        page.value("document.getElementById('unsaved').hidden && document.getElementById('undo').disabled")
            == true
    );

    let plan = room_json(address)["plan"].clone();
    let number = |value: &Value| value.as_f64().unwrap();
    // Place in the window of a place of the floor, metres.
    let at = |page: &mut Page, x: f64, y: f64| -> [f64; 2] {
        let scale = number(&plan["px_per_m"]);
        let u = number(&plan["corner_px"][0]) + (x - number(&plan["low"][0])) * scale;
        let v = number(&plan["corner_px"][1]) + (number(&plan["high"][1]) - y) * scale;
        let place = page.value(&format!(
            "(({{x, y}}) => [x, y])(new DOMPoint({u}, {v}).matrixTransform(document.getElementById('plan').getScreenCTM()))"
        ));
        serde_json::from_value(place).unwrap()
    };
    page.click("#draw");
    page.wait_until("document.getElementById('draw').ariaPressed === 'true'");
    for (x, y) in [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)] {
        let corner = at(&mut page, x, y);
        page.drag(&[corner]);
    }
    page.press("Enter", 0);
    page.wait_until("document.querySelectorAll('#zones input').length === 2 && document.activeElement.matches('#zones input')");
    page.value("document.activeElement.select()");
    page.type_text("gate");

    let corner = |index: usize| format!("#plan [data-corner='{index}']");
    let label = |page: &mut Page, index: usize| -> String {
        let label = page.value(&format!("document.querySelector(\"{}\").ariaLabel", corner(index)));
        label.as_str().unwrap().to_owned()
    };
    let drag = |page: &mut Page, index: usize, x: f64, y: f64| {
        let [from, to] = [page.middle_of(&corner(index)), at(page, x, y)];
        let middle = [0, 1].map(|axis| 0.5 * (from[axis] + to[axis]));
        page.drag(&[from, middle, to]);
    };
    drag(&mut page, 1, 4.0, 1.0);
    let left = label(&mut page, 2);
    drag(&mut page, 2, 4.0, 4.0);
    assert_ne!(label(&mut page, 2), left, "the corner was not moved");
    page.click("#undo");
    assert_eq!(label(&mut page, 2), left);
    assert!(page.value("document.getElementById('unsaved').hidden") == false);
    assert_eq!(scene_text(folder.path()), before, "written before it is saved");
    page.press("s", CTRL);
    page.wait_until("document.getElementById('message').textContent === 'Saved.'");
    assert!(page.value("document.getElementById('unsaved').hidden") == true);

    let after = scene_text(folder.path());
    let added = after.strip_prefix(&before).expect("the zone follows what was there");
    assert!(added.starts_with("\n[[zone]]\nname = \"gate\"\npolygon = "), "{added}");
    let zones = Room::read(folder.path()).unwrap().zones;
    assert_eq!((zones.len(), zones[1].kind), (2, ZoneKind::Both));
    // A pixel of the window is less than 3 cm of this floor.
    for (corner, (x, y)) in zones[1].polygon.0.iter().zip([(1.0, 1.0), (4.0, 1.0), (2.0, 2.0)]) {
        assert!((corner - Point2::new(x, y)).amax() < 0.06, "{corner} is not at {x}, {y}");
    }
}
