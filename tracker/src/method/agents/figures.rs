//! Figures of agents and agencies over time, from the packets of all stations (Nakazawa et al., figures 10 to 12).
//!
//! Each person has the colour of the target in all figures; agents that track alone are grey.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

use image::RgbImage;
use mot::chart::{self, Axis, Chart, HEIGHT_PX, Series, WIDTH_PX};
use nalgebra::Point2;
use shell::canvas::{Canvas, Color, TextStyle};

use super::{AgentId, Packet, StationId, TargetId};
use crate::Result;

/// Maximum number of reports that are kept; the oldest are dropped first.
const MOST_REPORTS: usize = 1_000_000;
/// Time without a report after which an agent's line is interrupted, seconds.
const BREAK_S: f64 = 1.0;
/// Maximum number of stations with a panel; further ones are not drawn.
const MOST_STATIONS: usize = 16;
/// Maximum number of targets in a panel's legend.
const MOST_NAMED: usize = 8;
/// Maximum number of agents with a strip; further ones are not drawn, because the strips would be unreadable.
const MOST_STRIPS: usize = 400;

const STRIP_WIDTH_PX: f64 = 1200.0;
const STRIP_HEIGHT_PX: f64 = 18.0;
const STRIP_LEFT_PX: f64 = 150.0;
const STRIP_TOP_PX: f64 = 46.0;
const STRIP_FOOT_PX: f64 = 28.0;

/// Reports of all stations over time.
#[derive(Debug, Clone, Default)]
pub struct AgencyRecord {
    seen: VecDeque<Seen>,
}

/// One report.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    time_s: f64,
    agent: AgentId,
    target: TargetId,
    place: [f32; 2],
    confidence: f32,
}

/// Uninterrupted period in which one agent tracks one target.
#[derive(Debug, Clone, PartialEq)]
struct Stretch {
    agent: AgentId,
    target: TargetId,
    seen: Vec<Seen>,
}

impl AgencyRecord {
    /// Adds the reports of a packet, whose time is on the clock of the figures.
    pub fn extend(&mut self, packet: &Packet) {
        let seen = packet.reports.iter().map(|report| Seen {
            time_s: packet.time_s,
            agent: report.agent,
            target: report.target,
            place: [report.position.x as f32, report.position.y as f32],
            confidence: report.confidence as f32,
        });
        self.seen.extend(seen);
        let surplus = self.seen.len().saturating_sub(MOST_REPORTS);
        self.seen.drain(..surplus);
    }

    /// Writes `positions.png`, `confidences.png` and `agencies.png` into a folder; nothing is written without reports.
    /// `names` are those of the stations' cameras, by number.
    ///
    /// # Errors
    /// An error that names the file that could not be written.
    pub fn write(&self, folder: &Path, names: &[String]) -> Result<()> {
        let (Some(begin_s), Some(end_s)) = (self.time(f64::min), self.time(f64::max)) else { return Ok(()) };
        let stretches = self.stretches(begin_s);
        let times = Axis::fitting("s", [end_s - begin_s].into_iter(), [0.0, 0.0]);
        let positions = panels(&stretches, names, |station, own| positions(&stretches, station, own));
        chart::save(&positions, &folder.join("positions.png"))?;
        let confidences = panels(&stretches, names, |station, own| confidences(&times, station, own));
        chart::save(&confidences, &folder.join("confidences.png"))?;
        Ok(chart::save(&strips(&stretches, &times, names), &folder.join("agencies.png"))?)
    }

    fn time(&self, choose: fn(f64, f64) -> f64) -> Option<f64> {
        self.seen.iter().map(|seen| seen.time_s).reduce(choose)
    }

    /// The stretches of all agents, by agent and time; times since `begin_s`.
    fn stretches(&self, begin_s: f64) -> Vec<Stretch> {
        let mut agents: BTreeMap<AgentId, Vec<Seen>> = BTreeMap::new();
        for seen in &self.seen {
            agents.entry(seen.agent).or_default().push(Seen { time_s: seen.time_s - begin_s, ..*seen });
        }
        let mut stretches = Vec::new();
        for (agent, mut seen) in agents {
            seen.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
            let is_one = |a: &Seen, b: &Seen| a.target == b.target && b.time_s - a.time_s <= BREAK_S;
            let parts = seen.chunk_by(is_one);
            stretches.extend(parts.map(|part| Stretch {
                agent,
                target: part[0].target,
                seen: part.to_vec(),
            }));
        }
        stretches
    }
}

/// Picture with one chart per station, one below the other.
fn panels(stretches: &[Stretch], names: &[String], chart: impl Fn(&str, &[&Stretch]) -> Chart) -> RgbImage {
    let mut stations: BTreeMap<StationId, Vec<&Stretch>> = BTreeMap::new();
    for stretch in stretches {
        stations.entry(stretch.agent.station).or_default().push(stretch);
    }
    let count = stations.len().min(MOST_STATIONS) as u32;
    let mut canvas = Canvas::new(WIDTH_PX, HEIGHT_PX * count.max(1), Color::PAPER);
    for (row, (station, own)) in stations.iter().take(MOST_STATIONS).enumerate() {
        let panel = chart(&name(names, *station), own).draw();
        canvas.blit(&panel, 0, row as i64 * i64::from(HEIGHT_PX));
    }
    canvas.into_image()
}

/// Chart of the measured places of one station's agents, in the scale of all stations.
fn positions(all: &[Stretch], station: &str, own: &[&Stretch]) -> Chart {
    let range = |axis: usize| {
        let places = all.iter().flat_map(|stretch| &stretch.seen).map(|seen| f64::from(seen.place[axis]));
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |r, v| [r[0].min(v), r[1].max(v)])
    };
    let [x, y] = [range(0), range(1)];
    // One metre is as long across as up.
    let height = (y[1] - y[0] + 1.0).max((x[1] - x[0] + 1.0) / Chart::aspect());
    let around = |[low, high]: [f64; 2], size: f64| {
        let middle = f64::midpoint(low, high);
        [middle - size / 2.0, middle + size / 2.0]
    };
    Chart {
        title: format!("{station}: measured places"),
        x: Axis::new("x, m", around(x, height * Chart::aspect())),
        y: Axis::new("y, m", around(y, height)),
        series: series(own, |seen| seen.place.map(f64::from)),
    }
}

/// Chart of the confidences of one station's agents over time.
fn confidences(times: &Axis, station: &str, own: &[&Stretch]) -> Chart {
    Chart {
        title: format!("{station}: confidences of its agents"),
        x: times.clone(),
        y: Axis::new("confidence", [0.0, 1.0]),
        series: series(own, |seen| [seen.time_s, f64::from(seen.confidence)]),
    }
}

/// One line per stretch; each of the first few targets is named once.
fn series(stretches: &[&Stretch], point: impl Fn(&Seen) -> [f64; 2]) -> Vec<Series> {
    let mut named: Vec<TargetId> = Vec::new();
    let line = |stretch: &&Stretch| {
        let is_news = !named.contains(&stretch.target) && named.len() < MOST_NAMED;
        if is_news {
            named.push(stretch.target);
        }
        Series {
            name: if is_news { label(stretch.target) } else { String::new() },
            points: stretch.seen.iter().map(&point).collect(),
            is_line: true,
            color: Some(color(stretch.target)),
        }
    };
    stretches.iter().map(line).collect()
}

/// One strip per agent, in the colour of its target: agents of one colour form an agency.
fn strips(stretches: &[Stretch], times: &Axis, names: &[String]) -> RgbImage {
    let agents: Vec<&[Stretch]> = stretches.chunk_by(|a, b| a.agent == b.agent).take(MOST_STRIPS).collect();
    let bottom = STRIP_TOP_PX + STRIP_HEIGHT_PX * agents.len() as f64;
    let mut canvas = Canvas::new(STRIP_WIDTH_PX as u32, (bottom + STRIP_FOOT_PX) as u32, Color::PAPER);
    let text = TextStyle::new(14.0).color(Color::INK);
    let title = "agencies: a strip an agent, a colour a person; agents that track alone are grey";
    canvas.text(Point2::new(12.0, 12.0), title, &text.bold().anchor(0.0, 0.0));
    let width = STRIP_WIDTH_PX - STRIP_LEFT_PX - 12.0;
    let at = |time_s: f64| STRIP_LEFT_PX + time_s / times.range[1].max(1e-9) * width;
    for (row, agent) in agents.iter().enumerate() {
        let top = STRIP_TOP_PX + STRIP_HEIGHT_PX * row as f64;
        let low = top + STRIP_HEIGHT_PX - 4.0;
        for stretch in *agent {
            let (Some(first), Some(last)) = (stretch.seen.first(), stretch.seen.last()) else { continue };
            let (left, right) = (at(first.time_s), at(last.time_s).max(at(first.time_s) + 1.0));
            let corners = [[left, top], [right, top], [right, low], [left, low]];
            canvas.fill_polygon(&corners.map(|[x, y]| Point2::new(x, y)), color(stretch.target));
            if right - left > 40.0 {
                let middle = Point2::new(f64::midpoint(left, right), f64::midpoint(top, low));
                let on = TextStyle::new(11.0).color(color(stretch.target).text_on()).anchor(0.5, 0.5);
                canvas.text(middle, &label(stretch.target), &on);
            }
        }
        let AgentId { station, number } = agent[0].agent;
        let middle = Point2::new(STRIP_LEFT_PX - 10.0, top + STRIP_HEIGHT_PX / 2.0 - 2.0);
        canvas.text(middle, &format!("{} {number}", name(names, station)), &text.anchor(1.0, 0.5));
    }
    for time_s in times.ticks() {
        let x = at(time_s);
        canvas.text(Point2::new(x, bottom + 2.0), &format!("{time_s}"), &text.anchor(0.5, 0.0));
    }
    canvas.text(Point2::new(STRIP_LEFT_PX - 10.0, bottom + 2.0), "s", &text.anchor(1.0, 0.0));
    canvas.into_image()
}

fn name(names: &[String], station: StationId) -> String {
    let known = names.get(usize::from(station.0)).filter(|name| !name.is_empty());
    known.cloned().unwrap_or_else(|| format!("station {}", station.0))
}

fn label(target: TargetId) -> String {
    if target == TargetId::ALONE { "alone".to_owned() } else { format!("person {}", target.0) }
}

fn color(target: TargetId) -> Color {
    if target == TargetId::ALONE { Color::PAPER.mix(Color::INK, 0.3) } else { Color::of_id(target.0) }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::super::Report;
    use super::*;

    /// Record of two stations whose agents track a walking person 1; the second station's agent tracks alone from 4 to
    /// 6 s, and reports nothing from 8 to 10 s.
    fn record() -> AgencyRecord {
        let mut record = AgencyRecord::default();
        for i in 0..120_u32 {
            let at_s = f64::from(i) / 10.0;
            for station in [0, 1].map(StationId) {
                let is_alone = station.0 == 1 && (4.0..6.0).contains(&at_s);
                let report = Report {
                    agent: AgentId { station, number: 5 },
                    target: if is_alone { TargetId::ALONE } else { TargetId(1) },
                    position: Point2::new(at_s, 2.0),
                    covariance: Matrix2::identity(),
                    velocity: Vector2::zeros(),
                    height_m: 1.7,
                    looks: None,
                    confidence: if is_alone { 0.2 } else { 0.8 },
                    is_crowded: false,
                };
                let is_away = station.0 == 1 && (8.0..10.0).contains(&at_s);
                let reports = if is_away { vec![] } else { vec![report] };
                record.extend(&Packet { station, time_s: 1.7e9 + at_s, reports, ..Packet::default() });
            }
        }
        record
    }

    #[test]
    fn a_change_of_target_or_a_gap_begins_a_new_stretch() {
        let stretches = record().stretches(1.7e9);
        let found: Vec<(u8, u32, f64)> =
            stretches.iter().map(|s| (s.agent.station.0, s.target.0, s.seen[0].time_s.round())).collect();
        assert_eq!(found, [(0, 1, 0.0), (1, 1, 0.0), (1, 0, 4.0), (1, 1, 6.0), (1, 1, 10.0)]);
    }

    #[test]
    fn figures_show_each_agent_in_the_colour_of_its_person() {
        let folder = tempfile::tempdir().unwrap();
        let record = record();
        record.write(folder.path(), &["front".to_owned()]).unwrap();
        let read = |name: &str| image::open(folder.path().join(name)).unwrap().into_rgb8();
        let strips = read("agencies.png");
        let at = |row: u32, time_s: f64| {
            let x = STRIP_LEFT_PX + time_s / 12.0 * (STRIP_WIDTH_PX - STRIP_LEFT_PX - 12.0);
            *strips.get_pixel(x as u32, STRIP_TOP_PX as u32 + row * STRIP_HEIGHT_PX as u32 + 2)
        };
        let rgb = |color: Color| image::Rgb([color.r, color.g, color.b]);
        let (person, alone, nobody) =
            (rgb(color(TargetId(1))), rgb(color(TargetId::ALONE)), rgb(Color::PAPER));
        for (row, time_s, expected) in [
            (0, 5.0, person),
            (0, 9.0, person),
            (1, 3.0, person),
            (1, 5.0, alone),
            (1, 9.0, nobody),
            (1, 11.0, person),
        ] {
            assert_eq!(at(row, time_s), expected, "{row} {time_s}");
        }
        for name in ["positions.png", "confidences.png"] {
            let panels = read(name);
            assert_eq!((panels.width(), panels.height()), (WIDTH_PX, 2 * HEIGHT_PX));
            let has = |color, row: u32| {
                (row * HEIGHT_PX + 60..(row + 1) * HEIGHT_PX)
                    .any(|y| (0..WIDTH_PX).any(|x| *panels.get_pixel(x, y) == color))
            };
            assert!(has(person, 0) && has(person, 1) && has(alone, 1) && !has(alone, 0), "{name}");
        }
    }

    #[test]
    fn an_empty_record_writes_nothing_and_the_oldest_reports_are_dropped() {
        let folder = tempfile::tempdir().unwrap();
        AgencyRecord::default().write(folder.path(), &[]).unwrap();
        assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none());
        let mut record = record();
        let one = record.seen[0];
        record.seen.extend(std::iter::repeat_n(one, MOST_REPORTS));
        record.extend(&Packet::default());
        assert_eq!((record.seen.len(), record.seen[0]), (MOST_REPORTS, one));
    }
}
