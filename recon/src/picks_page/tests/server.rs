//! The server's answers.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};

use serde_json::{Value, json};

use super::PickedProject;

/// Status and body of the answer to a request; a body that is sent is JSON.
pub(super) fn ask(address: SocketAddr, method: &str, path: &str, body: Option<&Value>) -> (u16, Vec<u8>) {
    let body = body.map(Value::to_string);
    let head = body.as_ref().map_or(String::new(), |body| {
        format!("Content-Type: application/json\r\nContent-Length: {}\r\n", body.len())
    });
    let mut stream = TcpStream::connect(address).unwrap();
    let request = format!("{method} {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n{head}\r\n");
    stream.write_all((request + body.as_deref().unwrap_or_default()).as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    let head = String::from_utf8(answer[..end].to_vec()).unwrap();
    assert!(head.contains("default-src 'none'"), "{head}");
    (head[9..12].parse().unwrap(), answer[end + 4..].to_vec())
}

fn told(address: SocketAddr, method: &str, path: &str, body: Option<&Value>) -> (u16, Value) {
    let (status, body) = ask(address, method, path, body);
    (status, serde_json::from_slice(&body).unwrap())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn picks_are_saved_with_what_the_file_had() {
    let page = PickedProject::new();
    let before = page.text();
    let (status, project) = told(page.address, "GET", "/project.json", None);
    assert_eq!((status, &project["cameras"]), (200, &json!(["cam0", "cam1"])));
    let point = json!({ "number": null, "picks": { "cam0": [10.0, 20.5], "cam1": [30.0, 40.0] } });
    let scale = json!({ "camera": "cam1", "height": 2.4 });
    let save = json!({ "version": project["version"], "picked": { "points": [point], "scale": [scale] } });
    let (status, saved) = told(page.address, "PUT", "/project", Some(&save));
    assert_eq!((status, &saved["picked"]["points"][0]["number"]), (200, &json!(1)));
    let added = page.text();
    let added = added.strip_prefix(&before).expect("what was there stays");
    assert_eq!(
        added,
        "\n[[point]]\ncam0 = [10.0, 20.5]\ncam1 = [30.0, 40.0]\n\n[scale]\ncamera = \"cam1\"\nheight = 2.4\n"
    );

    // The file has changed since that version.
    let (status, error) = told(page.address, "PUT", "/project", Some(&save));
    assert!(status == 409 && error["error"].as_str().unwrap().contains("load it again"), "{error}");
    let outside = json!({ "number": 1, "picks": { "cam0": [10.0, 20.5], "cam1": [160.0, 40.0] } });
    let save = json!({ "version": saved["version"], "picked": { "points": [outside], "scale": [] } });
    let (status, error) = told(page.address, "PUT", "/project", Some(&save));
    assert!(status == 422 && error["error"].as_str().unwrap().contains("point 1, cam1"), "{error}");
}

#[test]
fn residuals_show_the_pick_that_is_off_and_the_epipolar_line_meets_the_right_place() {
    let page = PickedProject::new();
    assert!(page.shared.len() > 12, "{}", page.shared.len());
    let spread: Vec<_> = page.shared.iter().step_by(page.shared.len() / 8).collect();
    let picks = |index: usize, off: f64| {
        let [a, b] = spread[index];
        json!({ "cam0": [a.x, a.y], "cam1": [b.x + off, b.y] })
    };
    let points: Vec<Value> = (0..8).map(|i| picks(i, if i == 3 { 25.0 } else { 0.0 })).collect();
    let (status, reply) = told(page.address, "POST", "/residuals", Some(&json!({ "points": points })));
    let pair = &reply["pairs"][0];
    assert!(status == 200 && pair["problem"].is_null() && pair["points"] == 8, "{reply}");
    for misfit in pair["misfits"].as_array().unwrap() {
        let is_off = misfit["point"] == 3;
        assert_eq!(misfit["left_out"], is_off, "{misfit}");
        assert!(if is_off { number(&misfit["px"]) > 6.0 } else { number(&misfit["px"]) < 2.0 }, "{misfit}");
    }
    // Lines in both directions, and the place that the depth gives.
    for ([from, onto], side) in [(["cam0", "cam1"], 0), (["cam1", "cam0"], 1)] {
        let place = page.shared[5];
        let (asked, expected) = (place[side], place[1 - side]);
        let asked = json!({ "camera": from, "pixel": [asked.x, asked.y], "other": onto });
        let (status, line) = told(page.address, "POST", "/epipolar", Some(&asked));
        assert_eq!(status, 200, "{line}");
        let at = |p: &Value| nalgebra::Point2::new(number(&p[0]), number(&p[1]));
        let off = (at(&line["guess"]) - expected).norm();
        let points: Vec<_> = line["line"].as_array().unwrap().iter().map(at).collect();
        let distance = points
            .windows(2)
            .map(|ends| {
                let along = ends[1] - ends[0];
                let share = ((expected - ends[0]).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
                (ends[0] + along * share - expected).norm()
            })
            .fold(f64::INFINITY, f64::min);
        assert!(off < 3.0 && distance < 1.5, "{from}: {off} {distance}");
    }
    // Two points join nothing, and forget what three did.
    let (_, reply) = told(page.address, "POST", "/residuals", Some(&json!({ "points": points[..2] })));
    assert!(reply["pairs"][0]["misfits"].as_array().unwrap().is_empty(), "{reply}");
    let asked = json!({ "camera": "cam0", "pixel": [50.0, 50.0], "other": "cam1" });
    let (_, line) = told(page.address, "POST", "/epipolar", Some(&asked));
    assert_eq!(line, json!({ "line": [], "guess": null }));
    assert_eq!(page.cameras.len(), 2);
}

#[test]
fn what_is_not_there_or_not_asked_by_the_page_is_refused() {
    let page = PickedProject::new();
    let status = |method: &str, path: &str, body: Option<&Value>| ask(page.address, method, path, body).0;
    assert_eq!(status("GET", "/", None), 200);
    let (ok, picture) = ask(page.address, "GET", "/reference/cam1", None);
    let picture = image::load_from_memory(&picture).unwrap();
    assert_eq!((ok, picture.width(), picture.height()), (200, super::WIDTH, super::HEIGHT));
    for path in
        ["/reference/cam2", "/built/plan", "/built/preview/cam0", "/room.toml", "/reference/..%2froom.toml"]
    {
        assert_eq!(status("GET", path, None), 404, "{path}");
    }
    for path in ["/build", "/zones", "/residuals", "/project"] {
        assert_eq!(status("GET", path, None), 405, "{path}");
    }
    assert_eq!(status("POST", "/build", None), 415);
    assert_eq!(status("POST", "/zones", Some(&json!({}))), 404, "no room yet");
    // Neither picks nor a scale: told before the captures are looked at.
    let (code, error) = told(page.address, "POST", "/build", Some(&json!({})));
    assert!(code == 422 && error["error"].as_str().unwrap().contains("[scale]"), "{error}");
    assert_eq!(status("POST", "/residuals", Some(&json!({ "points": [{ "cam0": [1] }] }))), 400);
    page.session.update(|state| state.views = None);
    assert_eq!(status("POST", "/residuals", Some(&json!({ "points": [] }))), 409, "not yet");
}
