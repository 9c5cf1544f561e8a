use nalgebra::{Matrix2, Rotation2};
use proptest::prelude::*;

use super::*;
use crate::method::agents::{Colour, Looks};

fn looks() -> impl Strategy<Value = Option<Looks>> {
    let colour = (0.0..=360.0_f32, 0.0..=1.0_f32, 0.0..=1.0_f32);
    let colour = colour.prop_map(|(hue_deg, saturation, value)| Colour { hue_deg, saturation, value });
    proptest::option::of(proptest::array::uniform3(colour).prop_map(|colours| Looks { colours }))
}

fn position() -> impl Strategy<Value = Point2<f64>> {
    let near = (-60.0..60.0, -60.0..60.0);
    let anywhere = (-FARTHEST_M..FARTHEST_M, -FARTHEST_M..FARTHEST_M);
    prop_oneof![near, anywhere].prop_map(|(x, y)| Point2::new(x, y))
}

fn covariance() -> impl Strategy<Value = Matrix2<f64>> {
    (0.001..20.0, 0.001..20.0, 0.0..7.0).prop_map(|(a, b, angle): (f64, f64, f64)| {
        let turn = *Rotation2::new(angle).matrix();
        turn * Matrix2::new(a * a, 0.0, 0.0, b * b) * turn.transpose()
    })
}

fn reports(station: StationId) -> impl Strategy<Value = Vec<Report>> {
    let velocity = (-99.0..99.0, -99.0..99.0);
    let rest = (velocity, 0.0..65.0, looks(), 0.0..=1.0, any::<bool>());
    let report = (any::<u32>(), any::<u32>(), position(), covariance(), rest).prop_map(
        move |(number, target, position, covariance, (velocity, height_m, looks, confidence, is_crowded))| {
            Report {
                agent: AgentId { station, number },
                target: TargetId(target),
                position,
                covariance,
                velocity: Vector2::new(velocity.0, velocity.1),
                height_m,
                looks,
                confidence,
                is_crowded,
            }
        },
    );
    proptest::collection::vec(report, 0..=MOST_REPORTS).prop_map(|mut reports| {
        // Random targets hardly ever coincide; the check is tested elsewhere.
        reports.dedup_by_key(|report| report.target);
        reports
    })
}

fn messages(station: StationId) -> impl Strategy<Value = Vec<MediatorMessage>> {
    let request = (any::<u32>(), any::<u32>(), position(), looks()).prop_map(
        move |(number, candidate, position, looks)| MediatorMessage::Request {
            agent: AgentId { station, number },
            candidate: TargetId(candidate),
            position,
            looks,
        },
    );
    let answer = (any::<u8>(), any::<u32>(), any::<u32>(), any::<bool>()).prop_map(
        |(station, number, candidate, is_granted)| MediatorMessage::Answer {
            agent: AgentId { station: StationId(station), number },
            candidate: TargetId(candidate),
            is_granted,
        },
    );
    proptest::collection::vec(prop_oneof![request, answer], 0..=MOST_MESSAGES)
}

/// A packet and the time of its sending.
fn sent() -> impl Strategy<Value = (Packet, f64)> {
    any::<u8>().prop_map(StationId).prop_flat_map(|station| {
        let head = (any::<u32>(), any::<u32>(), -1e5..2e9, -1700.0..1700.0_f64, any::<(u32, bool)>());
        (head, reports(station), messages(station)).prop_map(
            move |((life, sequence, time_s, delay_s, (greatest, is_blind)), reports, messages)| {
                let greatest = TargetId(greatest);
                let packet =
                    Packet { station, life, sequence, time_s, greatest, is_blind, reports, messages };
                (packet, time_s + delay_s)
            },
        )
    })
}

fn check_place(read: Point2<f64>, truth: Point2<f64>) -> Result<(), TestCaseError> {
    prop_assert!((read - truth).amax() <= 0.000_500_1);
    Ok(())
}

fn check_looks(read: Option<Looks>, truth: Option<Looks>) -> Result<(), TestCaseError> {
    prop_assert_eq!(read.is_some(), truth.is_some());
    let colours = |looks: Option<Looks>| looks.map_or([Colour::default(); 3], |looks| looks.colours);
    for (read, truth) in colours(read).iter().zip(colours(truth)) {
        let turn = (read.hue_deg - truth.hue_deg).rem_euclid(360.0);
        prop_assert!(turn.min(360.0 - turn) <= 0.704, "{turn}");
        prop_assert!((read.saturation - truth.saturation).abs() <= 0.001_97);
        prop_assert!((read.value - truth.value).abs() <= 0.001_97);
    }
    Ok(())
}

fn check_report(read: &Report, truth: &Report) -> Result<(), TestCaseError> {
    prop_assert_eq!((read.agent, read.target), (truth.agent, truth.target));
    prop_assert_eq!(read.is_crowded, truth.is_crowded);
    check_place(read.position, truth.position)?;
    check_looks(read.looks, truth.looks)?;
    prop_assert!((read.velocity - truth.velocity).amax() <= 0.005_01);
    prop_assert!((read.height_m - truth.height_m).abs() <= 0.000_501);
    prop_assert!((read.confidence - truth.confidence).abs() <= 1e-5);
    // Half a step of the deviations and of the direction: for a long ellipse the direction counts most.
    let longest = truth.covariance.symmetric_eigenvalues().max().sqrt();
    let allowed = 2.0 * longest * 0.000_6 + longest * longest * (std::f64::consts::PI / 512.0) * 1.01;
    prop_assert!((read.covariance - truth.covariance).amax() <= allowed);
    prop_assert!(read.covariance.cholesky().is_some() && read.covariance == read.covariance.transpose());
    Ok(())
}

proptest! {
    #[test]
    fn packets_return_within_the_stated_steps((packet, sent_s) in sent()) {
        let bytes = encode(&packet, sent_s)?;
        prop_assert!(bytes.len() <= LONGEST_PACKET);
        let (read, read_sent_s) = decode(&bytes)?;
        let head = |p: &Packet| (p.station, p.life, p.sequence, p.time_s.to_bits(), p.greatest, p.is_blind);
        prop_assert_eq!(head(&read), head(&packet));
        // A time since 1970 has steps of a quarter of a microsecond.
        prop_assert!((read_sent_s - sent_s).abs() < 1e-6, "{} {}", read_sent_s, sent_s);
        prop_assert_eq!((read.reports.len(), read.messages.len()), (packet.reports.len(), packet.messages.len()));
        for (read, truth) in read.reports.iter().zip(&packet.reports) {
            check_report(read, truth)?;
        }
        for (read, truth) in read.messages.iter().zip(&packet.messages) {
            match (*read, *truth) {
                (
                    MediatorMessage::Request { agent, candidate, position, looks },
                    MediatorMessage::Request { agent: a, candidate: c, position: p, looks: l },
                ) => {
                    prop_assert_eq!((agent, candidate), (a, c));
                    check_place(position, p)?;
                    check_looks(looks, l)?;
                }
                (read, truth) => prop_assert_eq!(read, truth),
            }
        }
    }

    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = decode(&bytes);
        let mut of_this_version = bytes;
        if let Some(first) = of_this_version.first_mut() {
            *first = PACKET_VERSION;
        }
        let _ = decode(&of_this_version);
    }

    #[test]
    fn damaged_packets_are_refused_or_within_the_limits(
        (packet, sent_s) in sent(), at in any::<proptest::sample::Index>(), value in any::<u8>(), cut in any::<proptest::sample::Index>(),
    ) {
        let mut bytes = encode(&packet, sent_s)?;
        let cut_off = &bytes[..cut.index(bytes.len())];
        prop_assert!(decode(cut_off).is_err());
        let at = at.index(bytes.len());
        bytes[at] = value;
        if let Ok((read, sent_s)) = decode(&bytes) {
            prop_assert!(read.reports.len() <= MOST_REPORTS && read.messages.len() <= MOST_MESSAGES);
            prop_assert!(sent_s.is_finite());
            // Every decoded packet can be encoded again.
            prop_assert!(encode(&read, sent_s).is_ok());
        }
        bytes.push(value);
        prop_assert!(decode(&bytes).is_err() || bytes.len() < 40);
    }
}

fn report(target: u32) -> Report {
    Report {
        agent: AgentId { station: StationId(2), number: 130 + target },
        target: TargetId(target),
        position: Point2::new(3.214, -11.5),
        covariance: Matrix2::new(0.09, 0.01, 0.01, 0.16),
        velocity: Vector2::new(0.9, -1.1),
        height_m: 1.74,
        looks: Some(Looks::default()),
        confidence: 0.93,
        is_crowded: false,
    }
}

fn packet(reports: Vec<Report>) -> Packet {
    let (station, life) = (StationId(2), 0xdead_beef);
    Packet {
        station,
        life,
        sequence: 9000,
        time_s: 1.7e9,
        greatest: TargetId(7),
        reports,
        ..Packet::default()
    }
}

#[test]
fn a_report_costs_about_36_bytes() {
    let length =
        |people: u32| encode(&packet((1..=people).map(report).collect()), 1.7e9 + 0.1).unwrap().len();
    let (empty, three) = (length(0), length(3));
    assert_eq!((empty, (three - empty) / 3), (23, 31));
}

#[test]
fn undecodable_packets_are_not_encoded() {
    let line = |packet: &Packet| encode(packet, 1.7e9).unwrap_err().to_string();
    let with = |change: &dyn Fn(&mut Report)| {
        let mut report = report(1);
        change(&mut report);
        packet(vec![report])
    };
    let too_many = packet((0..=MOST_REPORTS as u32).map(report).collect());
    for (packet, problem) in [
        (too_many, "more than 64"),
        (packet(vec![report(3), report(4), report(3)]), "two reports are of one target"),
        (with(&|r| r.agent.station = StationId(3)), "of another station"),
        (with(&|r| r.position.x = f64::NAN), "a place is too far away"),
        (with(&|r| r.position.y = 2.0 * FARTHEST_M), "a place is too far away"),
        (with(&|r| r.covariance[(0, 1)] = f64::INFINITY), "a covariance is not finite"),
        (with(&|r| r.velocity.y = f64::NAN), "a velocity is not a number"),
        (with(&|r| r.height_m = f64::NAN), "a quantity is not a number"),
        (with(&|r| r.confidence = f64::NAN), "a confidence is not a number"),
        (Packet { time_s: f64::NAN, ..packet(vec![]) }, "the capture time"),
        (Packet { time_s: -1e9, ..packet(vec![]) }, "the capture time"),
    ] {
        assert!(line(&packet).contains(problem), "{packet:?}: {}", line(&packet));
    }
    // Agents that track alone have no target: there may be many.
    assert!(encode(&packet(vec![report(0), report(0)]), 1.7e9).is_ok());
}

#[test]
fn values_beyond_the_limits_are_encoded_as_the_limits() {
    let odd = Report {
        covariance: Matrix2::new(1e9, 0.0, 0.0, 0.0),
        velocity: Vector2::new(-1e9, 0.0),
        confidence: 1.5,
        height_m: -2.0,
        ..report(1)
    };
    let (read, _) = decode(&encode(&packet(vec![odd]), 1.7e9).unwrap()).unwrap();
    let read = read.reports[0];
    assert!((read.covariance[(0, 0)] - 65.535_f64.powi(2)).abs() < 1e-6);
    assert!((read.covariance[(1, 1)] - 1e-6).abs() < 1e-9);
    assert_eq!((read.velocity.x, read.confidence, read.height_m), (-100.0, 1.0, 0.0));
}

#[test]
fn refusals_name_their_reason() {
    let good = encode(&packet(vec![report(1)]), 1.7e9).unwrap();
    let with = |at: usize, value: u8| {
        let mut bytes = good.clone();
        bytes[at] = value;
        decode(&bytes).unwrap_err().to_string()
    };
    assert_eq!(with(0, 2), "the packet has another version");
    assert_eq!(with(19, 65), "the packet has more than 64 reports or messages");
    assert_eq!(decode(&good[..20]).unwrap_err().to_string(), "the message is cut off");
    assert_eq!(
        decode(&[&good[..], &[0]].concat()).unwrap_err().to_string(),
        "bytes follow the message's end"
    );
    assert_eq!(decode(&[1; LONGEST_PACKET + 1]).unwrap_err().to_string(), "the packet is longer than 6 KiB");
}
