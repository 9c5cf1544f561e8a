//! Figures as a text table and as JSON.

use serde_json::{Map, Value as Json, json};

use super::{Evaluation, FigureValue, MetricFigure, TrackMetric, Unit};
use crate::eval::scenario::Space;

impl MetricFigure {
    /// Value with its unit, as in the table; an en dash where there is none.
    pub fn text(&self) -> String {
        match self.value {
            FigureValue::Count(Some(count)) => format!("{count}"),
            FigureValue::Real(Some(value), Unit::Percent) => format!("{value:.2} %"),
            FigureValue::Real(Some(value), Unit::Metres) => format!("{value:.4} m"),
            FigureValue::Real(Some(value), Unit::Pixels) => format!("{value:.2} px"),
            FigureValue::Real(Some(value), Unit::None) => format!("{value:.4}"),
            FigureValue::Count(None) | FigureValue::Real(None, _) => "–".into(),
        }
    }

    /// Key in JSON: the name itself if it is an acronym, otherwise with underscores and unit.
    pub fn key(&self) -> String {
        let name = self.name.replace(' ', "_");
        if name.chars().next().is_some_and(char::is_uppercase) && !name.contains('_') {
            return name;
        }
        let unit = match self.value {
            FigureValue::Real(_, Unit::Metres) => "_m",
            FigureValue::Real(_, Unit::Pixels) => "_px",
            _ => "",
        };
        name.to_lowercase() + unit
    }
}

impl Evaluation {
    /// Text table with a line a figure: name, value with unit, meaning.
    pub fn table(&self) -> String {
        let figures = self.figures();
        let width = |text: &dyn Fn(&MetricFigure) -> String| {
            figures.iter().map(|f| text(f).chars().count()).max().unwrap_or(0)
        };
        let (name, value) = (width(&|f| f.name.to_owned()), width(&MetricFigure::text));
        let mut lines = vec![self.headline()];
        for figure in &figures {
            lines.push(format!("{:name$}  {:>value$}  {}", figure.name, figure.text(), figure.meaning));
        }
        lines.join("\n") + "\n"
    }

    /// One line about the compared files.
    pub fn headline(&self) -> String {
        let s = &self.scenario;
        let matched_on = match s.space {
            Space::Floor => format!("matched on floor distance up to {} m", s.gate),
            Space::Image => format!("matched on box overlap (IoU) from {}", s.gate),
        };
        let (people, tracks) = if s.has_identities {
            (format!("{} people, ", s.people), format!("{} tracks, ", s.tracks))
        } else {
            ("no identities, ".to_owned(), String::new())
        };
        let protocol = self.protocol.text();
        format!(
            "truth: {people}{} rows; tracks: {tracks}{} rows; {matched_on}{protocol}",
            s.truth_rows, s.track_rows
        )
    }

    /// One flat object; percentages as in the table (0 to 100), `null` where a figure is undefined.
    pub fn json(&self) -> Json {
        let s = &self.scenario;
        let mut object = Map::new();
        object.insert("space".into(), json!(s.space));
        object.insert("gate".into(), json!(s.gate));
        object.insert("protocol".into(), json!(self.protocol.protocol.to_string()));
        object.insert("identities".into(), json!(s.has_identities));
        object.insert("people".into(), json!(s.people));
        object.insert("tracks".into(), json!(s.tracks));
        object.insert("truth_rows".into(), json!(s.truth_rows));
        object.insert("track_rows".into(), json!(s.track_rows));
        if let Some(alignment) = &self.alignment {
            object.insert("alignment_cameras".into(), json!(alignment.cameras));
            object.insert("alignment_rms_m".into(), json!(alignment.center_rms_m));
        }
        insert_figures(&mut object, &self.figures());
        object.insert("reliability".into(), self.existence.json());
        object.insert("motmetrics".into(), figures_json(&self.lasting.figures()));
        Json::Object(object)
    }
}

/// Adds figures under their keys.
pub(super) fn insert_figures(object: &mut Map<String, Json>, figures: &[MetricFigure]) {
    for figure in figures {
        let value = match figure.value {
            FigureValue::Count(count) => json!(count),
            FigureValue::Real(value, _) => json!(value),
        };
        object.insert(figure.key(), value);
    }
}

/// Figures as an object of their own.
pub(super) fn figures_json(figures: &[MetricFigure]) -> Json {
    let mut object = Map::new();
    insert_figures(&mut object, figures);
    Json::Object(object)
}
