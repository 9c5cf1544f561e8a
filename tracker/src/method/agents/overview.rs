//! Current agents and targets of all stations, as lines for a terminal.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::{AgentId, Packet, Report, StationId, TargetId};

/// Time without a packet after which a station is silent, seconds.
const SILENCE_S: f64 = 2.0;
/// Time without a report after which an agent no longer sees its person, seconds: it may miss a frame or two.
const GONE_S: f64 = 1.0;
/// Maximum number of people in the table; further ones are left out.
const MOST_ROWS: usize = 40;

/// Latest state of all stations, from their packets.
#[derive(Debug, Clone, Default)]
pub struct Overview {
    stations: BTreeMap<StationId, StationState>,
}

/// Latest state of one station.
#[derive(Debug, Clone, Default)]
struct StationState {
    name: String,
    /// Time of the last packet, seconds.
    time_s: f64,
    is_silent: bool,
    is_blind: bool,
    /// Latest report of each agent, and its time in seconds.
    agents: BTreeMap<AgentId, (Report, f64)>,
}

impl Overview {
    /// Updates the state of a station, whose camera has this name, with a packet. Returns a line for each change.
    pub fn extend(&mut self, packet: &Packet, camera: &str) -> Vec<String> {
        let mut lines = Vec::new();
        let is_new = !self.stations.contains_key(&packet.station);
        let station = self.stations.entry(packet.station).or_default();
        camera.clone_into(&mut station.name);
        if is_new || std::mem::take(&mut station.is_silent) {
            lines.push(format!("{camera} is heard"));
        }
        if std::mem::replace(&mut station.is_blind, packet.is_blind) != packet.is_blind {
            let state = if packet.is_blind { "sees nothing that can be used" } else { "sees again" };
            lines.push(format!("{camera} {state}"));
        }
        station.time_s = packet.time_s;
        for report in &packet.reports {
            let name = format!("{camera} agent {}", report.agent.number);
            let before = station.agents.insert(report.agent, (*report, packet.time_s));
            match before.map(|(before, _)| before.target) {
                Some(before) if before == report.target => {}
                None if report.target == TargetId::ALONE => lines.push(format!("{name} tracks alone")),
                None => lines.push(format!("{name} tracks person {}", report.target.0)),
                Some(before) if report.target == TargetId::ALONE => {
                    lines.push(format!("{name} leaves person {}, and tracks alone", before.0));
                }
                Some(_) => lines.push(format!("{name} tracks person {} now", report.target.0)),
            }
        }
        for (agent, (before, _)) in
            station.agents.extract_if(.., |_, (_, seen_s)| packet.time_s - *seen_s > GONE_S)
        {
            let whom = match before.target {
                TargetId::ALONE => "whom it tracked alone".to_owned(),
                target => format!("person {}", target.0),
            };
            lines.push(format!("{camera} agent {} no longer sees {whom}", agent.number));
        }
        lines
    }

    /// Advances the time. Returns a line for each station that has become silent.
    pub fn pass(&mut self, now_s: f64) -> Vec<String> {
        let mut lines = Vec::new();
        for station in self.stations.values_mut().filter(|station| !station.is_silent) {
            if now_s - station.time_s > SILENCE_S {
                (station.is_silent, station.is_blind) = (true, false);
                station.agents.clear();
                lines.push(format!("{} is silent", station.name));
            }
        }
        lines
    }

    /// Table with a row per person and a column per station: confidence and place, in metres, of the agent that tracks
    /// the person. Empty when all stations are silent.
    pub fn table(&self) -> String {
        let active: Vec<&StationState> =
            self.stations.values().filter(|station| !station.is_silent).collect();
        if active.is_empty() {
            return String::new();
        }
        let mut people: Vec<TargetId> = active
            .iter()
            .flat_map(|station| station.agents.values())
            .map(|(report, _)| report.target)
            .collect();
        people.sort_unstable();
        people.dedup();
        // Writing to a string cannot fail.
        let mut table = format!("{:<10}", "person");
        for station in &active {
            let _ = write!(table, " {:>20}", station.name.chars().take(20).collect::<String>());
        }
        for target in people.iter().filter(|target| **target != TargetId::ALONE).take(MOST_ROWS) {
            let _ = write!(table, "\n{:<10}", target.0);
            for station in &active {
                let _ = write!(table, " {:>20}", cell(station, *target));
            }
        }
        if people.contains(&TargetId::ALONE) {
            let _ = write!(table, "\n{:<10}", "alone");
            for station in &active {
                let count =
                    station.agents.values().filter(|(report, _)| report.target == TargetId::ALONE).count();
                let _ = write!(table, " {:>20}", if count == 0 { String::new() } else { count.to_string() });
            }
        }
        table.lines().flat_map(|line| [line.trim_end(), "\n"]).collect()
    }
}

/// Cell of the table, such as `0.97 at 1.2 3.4`; empty when no agent of the station tracks the target.
fn cell(station: &StationState, target: TargetId) -> String {
    let report = station.agents.values().find(|(report, _)| report.target == target);
    report.map_or(String::new(), |(report, _)| {
        format!("{:.2} at {:.1} {:.1}", report.confidence, report.position.x, report.position.y)
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Point2, Vector2};

    use super::*;

    fn packet(station: u8, time_s: f64, agents: &[(u32, u32)]) -> Packet {
        let station = StationId(station);
        let report = |(number, target): &(u32, u32)| Report {
            agent: AgentId { station, number: *number },
            target: TargetId(*target),
            position: Point2::new(1.25, -2.0),
            covariance: Matrix2::identity(),
            velocity: Vector2::zeros(),
            height_m: 1.7,
            looks: None,
            confidence: 0.9,
            is_crowded: false,
        };
        Packet { station, time_s, reports: agents.iter().map(report).collect(), ..Packet::default() }
    }

    #[test]
    fn every_change_is_one_line() {
        let mut overview = Overview::default();
        for (time_s, agents, expected) in [
            (1.0, &[(1, 0)][..], &["front is heard", "front agent 1 tracks alone"][..]),
            (1.1, &[(1, 0)], &[]),
            (1.2, &[(1, 7), (2, 8)], &["front agent 1 tracks person 7 now", "front agent 2 tracks person 8"]),
            (1.3, &[], &[]),
            (
                1.4,
                &[(1, 0), (2, 9)],
                &["front agent 1 leaves person 7, and tracks alone", "front agent 2 tracks person 9 now"],
            ),
            (2.3, &[(2, 9)], &[]),
            (2.5, &[(2, 9)], &["front agent 1 no longer sees whom it tracked alone"]),
            (3.6, &[], &["front agent 2 no longer sees person 9"]),
        ] {
            assert_eq!(overview.extend(&packet(0, time_s, agents), "front"), expected, "{time_s}");
        }
        let blind = Packet { is_blind: true, ..packet(0, 4.0, &[]) };
        assert_eq!(overview.extend(&blind, "front"), ["front sees nothing that can be used"]);
        assert!(overview.pass(5.9).is_empty());
        assert_eq!(overview.pass(6.1), ["front is silent"]);
        assert!(overview.pass(7.0).is_empty() && overview.table().is_empty());
        assert_eq!(overview.extend(&packet(0, 8.0, &[]), "front"), ["front is heard"]);
    }

    #[test]
    fn the_table_has_a_row_a_person_and_a_column_a_station() {
        let mut overview = Overview::default();
        overview.extend(&packet(0, 1.0, &[(1, 7), (2, 0), (3, 0)]), "front");
        overview.extend(&packet(1, 1.0, &[(4, 9), (5, 7)]), "back");
        let expected = "\
person                    front                 back
7              0.90 at 1.2 -2.0     0.90 at 1.2 -2.0
9                                   0.90 at 1.2 -2.0
alone                         2
";
        assert_eq!(overview.table(), expected);
    }
}
