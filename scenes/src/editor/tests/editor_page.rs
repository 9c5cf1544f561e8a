//! The editor's page of a room in a browser, and what a person does with it.

use std::net::SocketAddr;
use std::path::PathBuf;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::server::{room, room_json, scene_text, served};
use crate::room::Room;
use browser::{CTRL, Page};

/// The page of a room, with the mapping of its plan.
pub(super) struct EditorPage {
    _folder: TempDir,
    pub(super) dir: PathBuf,
    pub(super) address: SocketAddr,
    pub(super) page: Page,
    plan: Value,
}

impl EditorPage {
    /// Opens the page of the tests' room; `None` where there is no browser.
    pub(super) fn open() -> Option<Self> {
        let folder = room();
        let dir = folder.path().to_owned();
        Self::of_room(folder, dir)
    }

    /// Opens the page of the shipped office.
    pub(super) fn of_office() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let office = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/office/room");
        // A name that the page can show.
        let dir = folder.path().join("office");
        std::fs::create_dir(&dir).unwrap();
        for file in ["scene.toml", "room.ply"] {
            std::fs::copy(std::path::Path::new(office).join(file), dir.join(file)).unwrap();
        }
        Self::of_room(folder, dir)
    }

    pub(super) fn of_room(folder: TempDir, dir: PathBuf) -> Option<Self> {
        let address = served(&dir);
        let mut page = Page::open(&format!("http://{address}/"))?;
        page.wait_until(LOADED);
        Some(Self { plan: room_json(address)["plan"].clone(), _folder: folder, dir, address, page })
    }

    pub(super) fn scene(&self) -> String {
        scene_text(&self.dir)
    }

    pub(super) fn saved(&self) -> Room {
        Room::read(&self.dir).unwrap()
    }

    /// Place in the window of a place of the floor, metres.
    pub(super) fn at(&mut self, x: f64, y: f64) -> [f64; 2] {
        let number = |value: &Value| value.as_f64().unwrap();
        let plan = &self.plan;
        let scale = number(&plan["px_per_m"]);
        let u = number(&plan["corner_px"][0]) + (x - number(&plan["low"][0])) * scale;
        let v = number(&plan["corner_px"][1]) + (number(&plan["high"][1]) - y) * scale;
        self.in_svg("#plan", u, v)
    }

    /// Place in the window of a place in the units of an SVG.
    pub(super) fn in_svg(&mut self, selector: &str, u: f64, v: f64) -> [f64; 2] {
        let place = self.page.value(&format!(
            "(({{x, y}}) => [x, y])(new DOMPoint({u}, {v})\
             .matrixTransform(document.querySelector({}).getScreenCTM()))",
            json!(selector)
        ));
        serde_json::from_value(place).unwrap()
    }

    /// Place in the window of a pixel of a camera's image, scrolled into sight.
    pub(super) fn in_camera(&mut self, name: &str, u: f64, v: f64) -> [f64; 2] {
        let selector = format!("[data-camera='{name}']");
        self.scroll_to(&selector);
        self.in_svg(&selector, u, v)
    }

    pub(super) fn scroll_to(&mut self, selector: &str) {
        let selector = json!(selector);
        self.page.value(&format!("document.querySelector({selector}).scrollIntoView({{ block: 'center' }})"));
    }

    /// Begins to draw by its button, and waits until the page is ready for it.
    pub(super) fn begin(&mut self, kind: &str) {
        self.page.click(&format!("[data-draw='{kind}']"));
        self.page
            .wait_until(&format!("document.querySelector(\"[data-draw='{kind}']\").ariaPressed === 'true'"));
    }

    /// Clicks places of the floor, on the plan.
    pub(super) fn click_places(&mut self, places: &[(f64, f64)]) {
        for (x, y) in places {
            let place = self.at(*x, *y);
            self.page.drag(&[place]);
        }
    }

    /// Closes what is drawn, and gives it a name where the focus is by then.
    pub(super) fn close_and_name(&mut self, name: &str) {
        self.page.press("Enter", 0);
        self.page.wait_until("document.activeElement.matches('#items li > input')");
        self.page.type_text(name);
    }

    /// Drags a corner of the selected item on the plan.
    pub(super) fn drag_corner(&mut self, index: usize, x: f64, y: f64) {
        let corner = format!("#plan [data-corner='{index}']");
        let [from, to] = [self.page.middle_of(&corner), self.at(x, y)];
        let middle = [0, 1].map(|axis| 0.5 * (from[axis] + to[axis]));
        self.page.drag(&[from, middle, to]);
    }

    /// Saves by the keyboard, and waits for what is said about it.
    pub(super) fn save(&mut self, said: &str) {
        self.page.press("s", CTRL);
        self.wait_for_message(said);
    }

    pub(super) fn wait_for_message(&mut self, said: &str) {
        let said = json!(said);
        self.page.wait_until(&format!("document.getElementById('message').textContent.includes({said})"));
    }

    /// Waits until every control and picture lies within the window's width.
    pub(super) fn nothing_is_off_screen(&mut self, width: u32) {
        self.page.wait_until(&format!(
            "innerWidth === {width} && document.documentElement.scrollWidth <= {width} \
             && [...document.querySelectorAll('button, input, select, output, svg[id], svg[data-camera], figure')] \
             .filter((e) => e.checkVisibility()).every((e) => {{ \
             const {{ left, right }} = e.getBoundingClientRect(); return left >= 0 && right <= {width} + 0.5; }})"
        ));
    }

    pub(super) fn is(&mut self, condition: &str) -> bool {
        self.page.value(condition) == true
    }
}

/// The outlines of the room's zone are in the cameras.
pub(super) const LOADED: &str = "document.querySelectorAll('#cameras [data-outline]').length > 0";
