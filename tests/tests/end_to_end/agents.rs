//! Stations that track together, each in a process of its own, with failures of one: the others go on.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use scenes::room::Room;
use tests::live::agents::{FIRST_FRAME, INSIDE, StationPair, ids, restart};
use tests::live::office::{self, pendulum_period};
use tests::live::rows::LiveRow;
use tracker::wire::Fingerprint;
use zenoh::{Session, Wait};

/// Asserts that a station never gave one id to two people in a row.
fn assert_no_duplicates(rows: &[LiveRow]) {
    for row in rows {
        assert_eq!(ids(row).len(), row.people.len(), "{row:?}");
    }
}

/// Asserts that a station knew only these people under their old ids, nearly always all of them, and lost none of them for good.
fn assert_kept(rows: &[BTreeSet<u32>], people: &BTreeSet<u32>) {
    let whole = rows.iter().filter(|row| *row == people).count();
    let is_kept = rows.iter().all(|row| row.is_subset(people));
    let are_back = people.iter().all(|id| rows.iter().rev().take(15).any(|row| row.contains(id)));
    assert!(
        is_kept && are_back && 5 * whole >= 4 * rows.len(),
        "{people:?}, in {} rows: {rows:?}",
        rows.len()
    );
}

#[test]
fn a_killed_and_a_stalled_station_come_back_and_the_other_keeps_its_ids() {
    let mut pair = StationPair::start(FIRST_FRAME).unwrap();
    let found = restart(&mut pair, Duration::from_secs(2)).unwrap();
    println!("back after {} s", found.back_s);
    assert!(found.meanwhile.len() > 10 && found.back_s < 5.0, "{found:?}");
    assert_kept(&found.meanwhile, &found.before);

    // The restarted station films everybody to and fro once; then it stands still for 5 s with its connections open.
    pair.pass(1, pendulum_period(INSIDE)).unwrap();
    assert_eq!(pair.agreement(3).unwrap(), found.before);
    let stalled = Instant::now();
    pair.station(1).unwrap().signal("STOP").unwrap();
    pair.pass(0, Duration::from_secs(5)).unwrap();
    pair.station(1).unwrap().signal("CONT").unwrap();
    let people = pair.agreement(3).unwrap();
    assert_eq!(people, found.before);
    let rows = pair.station(0).unwrap().rows();
    let since: Vec<BTreeSet<u32>> = rows.iter().filter(|row| row.found > stalled).map(ids).collect();
    assert!(since.len() > 30);
    assert_kept(&since, &people);
    for camera in [0, 1] {
        assert_no_duplicates(&pair.station(camera).unwrap().rows());
    }
}

/// Waits until a station logs this offset of another's clock, to 0.1 s: the time that packets need is in the estimate.
fn wait_for_clock(pair: &mut StationPair, at: usize, of: &str, offset_s: f64) {
    let begin = format!("{of} has a clock that is ");
    let logged_s = |line: &str| line.split_once(&begin)?.1.split_once(" s ")?.0.parse::<f64>().ok();
    pair.wait_for_line(at, &format!("{begin}{offset_s}"), |line| {
        logged_s(line).is_some_and(|logged_s| (logged_s - offset_s).abs() <= 0.1)
    })
    .unwrap();
}

/// Session of an unknown Zenoh peer with all permissions.
fn stranger(addresses: &[SocketAddr]) -> Session {
    let mut config = zenoh::Config::default();
    let connect: Vec<String> = addresses.iter().map(|address| format!("\"tcp/{address}\"")).collect();
    for (key, value) in [
        ("connect/endpoints", format!("[{}]", connect.join(","))),
        ("listen/endpoints", "[]".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}

#[test]
fn nonsense_is_told_once_and_wrong_clocks_are_corrected_or_left_out() {
    let mut pair = StationPair::start(FIRST_FRAME).unwrap();
    let people = pair.agreement_on_all().unwrap();
    let hostile = stranger(&pair.addresses);
    let key = format!("roomtrack/1/{}/agents/cam1", Fingerprint::of(&Room::read(&office::room()).unwrap()));
    let overheard = hostile.declare_subscriber(&key).wait().unwrap();
    let packet =
        overheard.recv_timeout(Duration::from_secs(20)).unwrap().unwrap().payload().to_bytes().to_vec();
    drop(overheard);
    let version = [&[99], &packet[1..]].concat();
    let camera = [&packet[..1], &[7], &packet[2..]].concat();
    for _ in 0..50 {
        for bytes in
            [&packet[..], &version, &camera, &packet[..packet.len() / 2], &[1; 7000], b"", &vec![1; 200_000]]
        {
            hostile.put(&key, bytes).wait().unwrap();
        }
    }
    let lines =
        ["sends packets again", "version 99 of the packets", "number 7", "cannot be read", "7000 bytes"];
    for line in lines {
        pair.line(0, line).unwrap();
    }
    let _token = hostile.liveliness().declare_token("roomtrack/agents/99/ff/cam1/1").wait().unwrap();
    pair.pass(0, Duration::from_secs(2)).unwrap();
    let log = pair.station(0).unwrap().log();
    for line in lines {
        assert_eq!(log.iter().filter(|told| told.contains(line)).count(), 1, "{line}: {log:#?}");
    }
    assert_eq!(pair.agreement(3).unwrap(), people);

    // The same station with a clock half a second ahead is corrected…
    pair.kill(1);
    pair.begin(1, &["--clock-shift", "0.5"]).unwrap();
    wait_for_clock(&mut pair, 0, "`cam1`", 0.5);
    assert_eq!(pair.agreement(3).unwrap(), people);
    // …and with one an hour ahead left out: the other goes on alone.
    pair.kill(1);
    pair.begin(1, &["--clock-shift", "3600"]).unwrap();
    wait_for_clock(&mut pair, 0, "`cam1`", 3600.0);
    wait_for_clock(&mut pair, 1, "`cam0`", 3600.0);
    pair.pass(0, Duration::from_secs(1)).unwrap();
    let rows = pair.station(0).unwrap().rows();
    let last: Vec<BTreeSet<u32>> = rows.iter().rev().take(10).map(ids).collect();
    assert_kept(&last, &people);
    assert_no_duplicates(&rows);
}

#[test]
fn a_network_that_is_cut_and_healed_leaves_each_person_one_id() {
    let mut pair = StationPair::start(FIRST_FRAME).unwrap();
    // The cut comes when one person is inside; two come in while it lasts, and get ids from both stations.
    let first = pair.agreement(1).unwrap();
    pair.network.cut();
    for camera in [0, 1] {
        let until = Instant::now() + Duration::from_secs(20);
        let know_three = pair.station(camera).unwrap().wait_for(until, has_three).unwrap();
        assert!(know_three, "{:?}", pair.people(camera));
    }
    let apart = [pair.people(0).unwrap(), pair.people(1).unwrap()];
    pair.network.heal();
    let people = pair.agreement(3).unwrap();
    println!("{first:?}, apart {apart:?}, together {people:?}");
    assert!(people.is_superset(&first), "{first:?}, {people:?}");
    pair.pass(0, Duration::from_secs(2)).unwrap();
    assert_eq!(pair.agreement(3).unwrap(), people);
    for camera in [0, 1] {
        assert_no_duplicates(&pair.station(camera).unwrap().rows());
    }
}

fn has_three(rows: &[LiveRow]) -> bool {
    rows.len() > 10 && rows[rows.len() - 10..].iter().map(ids).all(|people: BTreeSet<u32>| people.len() == 3)
}

#[test]
fn options_that_do_not_fit_are_told_in_one_line() {
    let room = office::room().display().to_string();
    let video = office::video("cam0").display().to_string();
    let station = ["station", &room, "--camera", "cam0", "--video", &video, "--method", "agents"];
    let cases: [(&[&str], &str); 4] = [
        (&["--listen", "127.0.0.1:0"], "--method agents: give --out DIR"),
        (&["--out", "out"], "--listen: there is no endpoint"),
        (&["--out", "out", "--connect", "127.0.0.1:1", "--pictures"], "cannot be used with"),
        (&["--out", "out", "--connect", "127.0.0.1:1", "--steps", "1"], "--steps 1: give 2 to"),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (further, problem) in cases {
        let output = tests::data::program("tracker")
            .current_dir(folder.path())
            .args(station)
            .args(further)
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(problem), "{told}");
    }
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none());
}
