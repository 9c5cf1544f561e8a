//! The verdict as lines of text below a preview.

use nalgebra::Point2;
use shell::canvas::{Canvas, Color, TextStyle};

use crate::verdict::{Light, Verdict};

/// Height of a line, pixels, …
const LINE_PX: u32 = 19;
/// … size of its letters, and its indent.
const LETTERS_PX: f32 = 12.5;
const INDENT_PX: f64 = 26.0;
/// Radius of the coloured dot before a reason.
const DOT_PX: f64 = 5.0;
/// Most reasons that are written; report.json has them all.
const MOST_REASONS: usize = 5;

/// Lines of a verdict, wrapped to a width; the first of each reason has its colour.
pub(super) struct VerdictBand(Vec<(Option<Light>, String)>);

impl VerdictBand {
    /// Lines for a picture of this width, pixels.
    pub(super) fn new(verdict: &Verdict, width: u32) -> Self {
        let head = (verdict.light, format!("verdict: {}", verdict.light.word()));
        let reasons = verdict.reasons.iter().map(|reason| (reason.light, reason.text.clone()));
        let room_px = width as f32 - INDENT_PX as f32;
        let wrapped = |(light, text): (Light, String)| {
            let lines = wrap(&text, room_px);
            lines.into_iter().enumerate().map(move |(i, line)| ((i == 0).then_some(light), line))
        };
        Self(std::iter::once(head).chain(reasons.take(MOST_REASONS)).flat_map(wrapped).collect())
    }

    /// Height, pixels.
    pub(super) fn height(&self) -> u32 {
        LINE_PX * self.0.len() as u32
    }

    /// Draws the lines from the row `top` on.
    pub(super) fn draw(&self, canvas: &mut Canvas, top: u32) {
        let style = TextStyle::new(LETTERS_PX).anchor(0.0, 0.5);
        for (i, (light, text)) in self.0.iter().enumerate() {
            let middle = f64::from(top) + (i as f64 + 0.5) * f64::from(LINE_PX);
            if let Some(light) = light {
                canvas.fill_circle(Point2::new(0.5 * INDENT_PX, middle), DOT_PX, color(*light));
            }
            canvas.text(Point2::new(INDENT_PX, middle), text, &style);
        }
    }
}

fn color(light: Light) -> Color {
    match light {
        Light::Green => Color::rgb(46, 139, 87),
        Light::Amber => Color::rgb(217, 138, 0),
        Light::Red => Color::rgb(198, 40, 40),
    }
}

/// Words in lines of at most a width; a longer word has a line of its own.
fn wrap(text: &str, width_px: f32) -> Vec<String> {
    let style = TextStyle::new(LETTERS_PX);
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if style.size(&format!("{line} {word}"))[0] <= width_px => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::Reason;

    #[test]
    fn reasons_are_wrapped_to_the_picture_and_marked_once() {
        let text =
            "three picks fit whatever they are and prove nothing: pick two or three points more".to_owned();
        let reason = Reason { light: Light::Amber, text: text.clone() };
        let verdict = Verdict { light: Light::Amber, reasons: vec![reason; 9] };
        let narrow = VerdictBand::new(&verdict, 240);
        let marks = narrow.0.iter().filter(|(light, _)| light.is_some()).count();
        assert_eq!((marks, narrow.0[0].1.as_str()), (1 + MOST_REASONS, "verdict: amber"));
        let style = TextStyle::new(LETTERS_PX);
        assert!(narrow.0.iter().all(|(_, line)| style.size(line)[0] <= 240.0 - INDENT_PX as f32));
        let second = narrow.0.iter().skip(2).position(|(light, _)| light.is_some()).unwrap() + 2;
        let words: Vec<&str> = narrow.0[1..second].iter().map(|(_, line)| line.as_str()).collect();
        assert_eq!(words.join(" "), text);
        let mut canvas = Canvas::new(240, 20 + narrow.height(), Color::PAPER);
        narrow.draw(&mut canvas, 20);
        let picture = canvas.into_image();
        assert_eq!(picture.get_pixel(13, 29).0, [217, 138, 0], "the first line's dot");
        assert!(picture.rows().take(20).flatten().all(|p| p.0 == [250, 249, 246]));
    }
}
