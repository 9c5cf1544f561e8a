//! Helpers for tests of sessions on the loopback.

use std::net::TcpListener;

use zenoh::{Session, Wait};

/// Free address of the loopback: no process listens there.
pub(super) fn free_address() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    format!("127.0.0.1:{}", listener.local_addr().unwrap().port())
}

/// Session of an unknown peer that may do everything that Zenoh allows.
pub(super) fn stranger(address: &str) -> Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("connect/endpoints", format!("[\"tcp/{address}\"]")),
        ("listen/endpoints", "[]".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}
