//! Tests of the page in a browser, of its token and of its certificate.

use std::io::{Read, Write};
use std::net::TcpStream;

use browser::Page;
use calib::{Camera, Intrinsics};
use nalgebra::Isometry3;
use scenes::polygon::Polygon;
use scenes::room::{Room, RoomCamera, Zone, ZoneKind};
use shell::loopback::{AccessToken, Listener};

use super::tests::{LOOPBACK, PORT_OPTION, exchange, get, painted};
use super::*;
use crate::PersonEstimate;
use crate::foreground::Verdict;

/// A hall with a door and a camera, as the page is told of it.
fn hall() -> (Room, RoomPage) {
    let mut room = Room { cameras: vec![], ..Room::default() };
    let camera = Camera {
        intrinsics: Intrinsics::from_horizontal_fov(64, 48, 70.0),
        camera_from_world: Isometry3::translation(0.0, 0.0, 3.0),
    };
    room.cameras.push(RoomCamera { name: "b <2>".into(), camera, reference: None });
    let polygon = Polygon::rectangle([-2.0, -1.0].into(), [2.0, 1.0].into());
    room.zones.push(Zone { name: "door".into(), polygon: polygon.clone(), kind: ZoneKind::Both });
    room.walkable = Some(vec![polygon]);
    let folder = tempfile::tempdir().unwrap();
    let page = RoomPage::new(&room, folder.path(), "my <room>", &["b <2>".into()]).unwrap();
    (room, page)
}

fn hall_server(listener: Listener) -> (Server, LiveFeed) {
    let (room, page) = hall();
    let screens = Screens::new("my <room>".into(), std::iter::once("b <2>"));
    let server = Server::start(listener, screens, page, vec!["b <2>".into()]).unwrap();
    let feed = server.feed(&room, None).unwrap();
    (server, feed)
}

fn frame(number: u32, people: &[PersonEstimate]) -> FeedInput<'_> {
    let time_s = f64::from(number) / 10.0;
    FeedInput { frame: number, time_s, people, verdicts: &[Verdict::Usable], utc_s: None, left_out: 0 }
}

#[test]
fn a_browser_shows_people_events_pictures_and_pauses() {
    let (mut server, mut feed) = hall_server(Server::bind(LOOPBACK, Some(0), PORT_OPTION).unwrap());
    server.screens().show([painted(0, 7)]);
    for number in 1..=20 {
        feed.put(frame(number, &[PersonEstimate::standing(4, f64::from(number) / 50.0, 0.0)]));
    }
    let Some(mut page) = Page::open(server.link()) else { return };
    let text = |id: &str, text: &str| format!("document.getElementById('{id}').textContent === '{text}'");
    page.wait_until(&text("frame", "20"));
    page.wait_until("document.querySelector('figure img').src.endsWith('/camera/0.jpg?2')");
    page.wait_until(&text("title", "my <room>"));
    page.wait_until("document.querySelector('#plan .person').dataset.id === '4'");
    page.wait_until("document.querySelector('#events li span').textContent.includes('door')");
    page.wait_until("document.querySelector('#places tbody td:nth-child(2)').textContent === '1'");
    page.click("#tab-space");
    let labels =
        "[...document.querySelectorAll('#space .labels span')].map((label) => label.textContent).join()";
    page.wait_until(&format!("{labels} === 'b <2>,4'"));
    page.screenshot("live-space.png");
    page.click("#tab-plan");
    // Paused, the page keeps its frame while the run goes on, and steps back and forth.
    page.click("#pause");
    for number in 21..=25 {
        feed.put(frame(number, &[]));
    }
    page.wait_until("document.getElementById('moment').max === '19' || document.getElementById('behind').value !== 'live'");
    page.click("#back");
    page.wait_until(&text("frame", "19"));
    page.click("#forth");
    page.wait_until(&text("frame", "20"));
    page.click("#pause");
    page.wait_until(&text("frame", "25"));
    page.wait_until("document.querySelectorAll('#plan .person').length === 0");
    drop(feed);
    server.announce_end();
    page.wait_until(&text("said", "The run has ended"));
}

#[test]
fn only_a_browser_that_opened_the_link_gets_the_page() {
    let token = AccessToken::chosen("0123456789abcdef").unwrap();
    let listener = Server::bind(LOOPBACK, Some(0), PORT_OPTION).unwrap().with_token(token);
    let (server, _feed) = hall_server(listener);
    let address = server.address();
    for path in ["/", "/moment", "/frames", "/room.json", "/plan.jpg", "/?token=0123456789abcdeg"] {
        assert!(get(address, path).0.starts_with("HTTP/1.1 403"), "{path}");
    }
    let (head, _) = get(address, "/?token=0123456789abcdef");
    let head = head.to_lowercase();
    let cookie = format!("token_{}=0123456789abcdef", address.port());
    assert!(head.starts_with("http/1.1 303") && head.contains("location: /\r\n"), "{head}");
    assert!(head.contains(&format!("set-cookie: {cookie}; path=/; httponly; samesite=lax")), "{head}");
    let with = |lines: &str| {
        let request = format!("GET /room.json HTTP/1.1\nHost: {address}\nConnection: close\n{lines}\n\n");
        exchange(address, &request).0[9..12].to_owned()
    };
    assert_eq!(with(&format!("Cookie: a=b; {cookie}")), "200");
    assert_eq!(with(&format!("Cookie: {cookie}0")), "403");
    assert_eq!(with(&format!("Cookie: {cookie}\nOrigin: http://{address}")), "200");
    assert_eq!(with(&format!("Cookie: {cookie}\nOrigin: http://example.org")), "403");
    // Other machines need a token in any case.
    let open = Server::bind("0.0.0.0", Some(0), PORT_OPTION).unwrap();
    let refused =
        Server::start(open, Screens::new(String::new(), std::iter::empty()), RoomPage::default(), vec![]);
    assert!(refused.unwrap_err().to_string().contains("needs a token"));
    let Some(mut page) = Page::open(server.link()) else { return };
    page.wait_until("document.getElementById('title')?.textContent === 'my <room>'");
    assert_eq!(page.value("location.pathname + location.search"), "/");
}

#[test]
fn a_certificate_encrypts_the_page() {
    let own = rcgen::generate_simple_self_signed(vec!["localhost".into()]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (certificate, key) = (folder.path().join("cert.pem"), folder.path().join("key.pem"));
    std::fs::write(&certificate, own.cert.pem()).unwrap();
    std::fs::write(&key, own.signing_key.serialize_pem()).unwrap();
    let bind = || Server::bind(LOOPBACK, Some(0), PORT_OPTION).unwrap();
    let wrong = bind().with_tls(&key, &key).unwrap_err().to_string();
    assert!(wrong.contains("key.pem") && wrong.contains("holds no certificate"), "{wrong}");
    let (server, _feed) = hall_server(bind().with_tls(&certificate, &key).unwrap());
    assert!(server.link().starts_with("https://"));
    let mut roots = rustls::RootCertStore::empty();
    roots.add(own.cert.der().clone()).unwrap();
    let provider = std::sync::Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let client = rustls::ClientConnection::new(config.into(), "localhost".try_into().unwrap()).unwrap();
    let mut stream = rustls::StreamOwned::new(client, TcpStream::connect(server.address()).unwrap());
    // A client that never finishes its handshake keeps nobody waiting.
    let _silent = TcpStream::connect(server.address()).unwrap();
    stream.write_all(b"GET /room.json HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    // The server may close without a farewell of TLS.
    let _ = stream.read_to_string(&mut answer);
    assert!(answer.starts_with("HTTP/1.1 200") && answer.contains("my <room>"), "{answer}");
}
