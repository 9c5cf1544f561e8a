//! Tests of members of the mesh on the loopback.

use std::time::{Duration, Instant, SystemTime};

use zenoh::Wait;

use super::super::super::{Endpoints, keys};
use super::super::{Membership, Mesh, OwnClock, Refusal};
use super::*;
use crate::source::utc_s;
use crate::wire::test_loopback::{free_address, stranger};

/// Number of times that two stations dial each other.
const DIALS: u32 = 5;
/// Bound of every wait.
const BOUND: Duration = Duration::from_secs(20);

fn endpoints(listen: Option<&str>, connect: &[&str]) -> Endpoints {
    Endpoints {
        listen: listen.iter().map(|address| address.parse().unwrap()).collect(),
        connect: connect.iter().map(|address| address.parse().unwrap()).collect(),
        ..Endpoints::default()
    }
}

fn membership(station: u8, hears: &[u8]) -> Membership {
    Membership {
        room: Some(ROOM),
        cameras: CAMERAS.map(str::to_owned).to_vec(),
        station: Some(StationId(station)),
        hears: hears.iter().copied().map(StationId).collect(),
        clock: OwnClock::default(),
    }
}

fn listener() -> Membership {
    Membership {
        room: None,
        cameras: Vec::new(),
        station: None,
        hears: Vec::new(),
        clock: OwnClock::default(),
    }
}

/// Packet of a station that was taken just now.
fn now(station: u8, sequence: u32) -> Packet {
    packet(station, 0, sequence, utc_s(SystemTime::now()) - 0.02)
}

/// Publishes packets of a station, 50 a second, until the condition holds for the packets that a member has received;
/// returns the time that it took.
fn until(
    sender: &mut Mesh,
    station: u8,
    sequence: &mut u32,
    hearer: &Mesh,
    mut holds: impl FnMut(&[Packet]) -> bool,
) -> Duration {
    let begun = Instant::now();
    loop {
        *sequence += 1;
        sender.publish(&now(station, *sequence)).unwrap();
        if holds(&hearer.wait_received(Duration::from_millis(20))) {
            return begun.elapsed();
        }
        assert!(begun.elapsed() < BOUND, "{hearer:?}");
    }
}

#[test]
fn stations_hear_those_whose_views_overlap_and_a_listener_hears_all() {
    let [first, second, third] = [free_address(), free_address(), free_address()];
    // Stations 0 and 1 see the same, and 1 and 2; all three are linked.
    let mut meshes = [
        Mesh::open(&membership(0, &[1]), &endpoints(Some(&first), &[])).unwrap(),
        Mesh::open(&membership(1, &[0, 2]), &endpoints(Some(&second), &[&first])).unwrap(),
        Mesh::open(&membership(2, &[1]), &endpoints(Some(&third), &[&first, &second])).unwrap(),
    ];
    let watch = Mesh::open(&listener(), &endpoints(None, &[&first, &second, &third])).unwrap();
    let line = meshes[0].publish(&now(2, 1)).unwrap_err().to_string();
    assert_eq!(line, "station `cam0`: the packet is of station 2, this is 0");
    let mut heard: [Vec<Packet>; 4] = Default::default();
    let begun = Instant::now();
    for sequence in 1.. {
        for (station, mesh) in meshes.iter_mut().enumerate() {
            mesh.publish(&now(station as u8, sequence)).unwrap();
        }
        std::thread::sleep(Duration::from_millis(10));
        for (all, mesh) in heard.iter_mut().zip(meshes.iter().chain([&watch])) {
            all.extend(mesh.heard());
        }
        if heard.iter().all(|heard| heard.len() > 300) {
            break;
        }
        assert!(begun.elapsed() < BOUND, "{:?}", heard.map(|h| h.len()));
    }
    let senders = |heard: &[Packet]| {
        let mut senders: Vec<u8> = heard.iter().map(|packet| packet.station.0).collect();
        senders.sort_unstable();
        senders.dedup();
        senders
    };
    assert_eq!(heard.each_ref().map(|h| senders(h)), [vec![1], vec![0, 2], vec![1], vec![0, 1, 2]]);
    for heard in &heard {
        for station in 0..3 {
            let own: Vec<u32> = heard.iter().filter(|p| p.station.0 == station).map(|p| p.sequence).collect();
            assert!(own.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
    let lives: std::collections::BTreeSet<u32> = heard[3].iter().map(|packet| packet.life).collect();
    assert_eq!(lives.len(), 3);
    assert_eq!(watch.names().len(), 3);
    let counts = meshes[1].counts();
    assert!(counts.refused.is_empty() && counts.sent_bytes < 80 * counts.sent, "{counts:?}");
}

#[test]
fn a_restarted_station_is_heard_within_a_second() {
    let address = free_address();
    let hearer = Mesh::open(&membership(0, &[1]), &endpoints(Some(&address), &[])).unwrap();
    let mut sequence = 0;
    let mut latest_life = None;
    for _ in 0..3 {
        let mut sender = Mesh::open(&membership(1, &[0]), &endpoints(None, &[&address])).unwrap();
        let mut life = None;
        let took = until(&mut sender, 1, &mut sequence, &hearer, |heard| {
            life = heard.last().map(|packet| packet.life).filter(|life| Some(*life) != latest_life);
            life.is_some()
        });
        println!("heard after {took:?}");
        latest_life = life;
        sequence = 0;
    }
}

#[test]
fn two_stations_that_dial_each_other_are_linked() {
    for trial in 0..DIALS {
        let addresses = [free_address(), free_address()];
        let open = |station: u8| {
            let [own, other] = [usize::from(station), usize::from(1 - station)].map(|i| addresses[i].clone());
            std::thread::spawn(move || {
                Mesh::open(&membership(station, &[1 - station]), &endpoints(Some(&own), &[&other])).unwrap()
            })
        };
        let opened = [open(0), open(1)];
        let mut meshes = opened.map(|opened| opened.join().unwrap());
        let begun = Instant::now();
        let mut has_heard = [false; 2];
        for sequence in 1.. {
            for (station, mesh) in meshes.iter_mut().enumerate() {
                mesh.publish(&now(station as u8, sequence)).unwrap();
            }
            std::thread::sleep(Duration::from_millis(20));
            for (has_heard, mesh) in has_heard.iter_mut().zip(&meshes) {
                *has_heard |= !mesh.heard().is_empty();
            }
            if has_heard == [true; 2] {
                break;
            }
            assert!(begun.elapsed() < BOUND, "trial {trial}: {has_heard:?}");
        }
        println!("linked after {:?}", begun.elapsed());
    }
}

#[test]
fn a_hostile_peer_is_counted_and_the_rest_goes_on() {
    let address = free_address();
    let hearer = Mesh::open(&membership(0, &[1, 2]), &endpoints(Some(&address), &[])).unwrap();
    let mut sender = Mesh::open(&membership(1, &[0]), &endpoints(None, &[&address])).unwrap();
    let (mut sequence, mut latest) = (0, None);
    until(&mut sender, 1, &mut sequence, &hearer, |heard| {
        latest = heard.last().cloned();
        latest.is_some()
    });
    let latest = latest.unwrap();
    let hostile = stranger(&address);
    let sent_s = utc_s(SystemTime::now());
    let replayed = super::super::super::packet::encode(&latest, sent_s).unwrap();
    let mut version = replayed.clone();
    version[0] = 77;
    let _tokens = ["9/ff/cam1/1", "1/x/cam1/1", "1/x/%zz/1"]
        .map(|rest| hostile.liveliness().declare_token(format!("roomtrack/agents/{rest}")).wait().unwrap());
    for bytes in [&b"nonsense"[..], &[1; 9000], &vec![1; 50_000], &replayed, &version, &[]] {
        hostile.put(keys::packets(Some(ROOM), Some("cam1")), bytes).wait().unwrap();
    }
    // Larger than the network's code lets through.
    hostile.put(keys::packets(Some(ROOM), Some("cam1")), vec![1; 8 << 20]).wait().unwrap();
    let begun = Instant::now();
    loop {
        until(&mut sender, 1, &mut sequence, &hearer, |heard| !heard.is_empty());
        let refused = hearer.counts().refused;
        let count = |refusal: Refusal| refused.get(&refusal).copied().unwrap_or(0);
        let counted =
            [Refusal::Oversized, Refusal::Replayed, Refusal::Version, Refusal::Malformed].map(count);
        if counted == [2, 1, 3, 1] && count(Refusal::Room) == 1 {
            break;
        }
        assert!(begun.elapsed() < BOUND, "{refused:?}");
    }
    let took = until(&mut sender, 1, &mut sequence, &hearer, |heard| !heard.is_empty());
    assert!(took < Duration::from_secs(1), "{took:?}");
}

#[test]
fn a_member_that_only_listens_sends_nothing() {
    let mut watch = Mesh::open(&listener(), &endpoints(Some(&free_address()), &[])).unwrap();
    assert_eq!(watch.publish(&now(0, 1)).unwrap_err().to_string(), "station: this member only listens");
    assert!(watch.wait_received(Duration::from_millis(10)).is_empty());
    let line =
        Mesh::open(&membership(9, &[]), &endpoints(Some(&free_address()), &[])).unwrap_err().to_string();
    assert_eq!(line, "room: there is no camera number 9");
}
