//! The room in 3-D on the editor's page, in a browser.

use image::RgbImage;

use super::editor_page::{EditorPage, LOADED};
use super::server::room;

/// Colour of the rim of the first zone on the page, with the panel behind it.
const ZONE: [u8; 3] = [25, 146, 151];
/// Difference of levels up to which a pixel has that colour.
const NEAR: u8 = 24;

impl EditorPage {
    /// Shows the room in 3-D, with its surfaces if it has any, and without what lies over it: labels have the colours of what
    /// they name, and the button has the zone's.
    fn open_space(&mut self, labels: usize, has_surfaces: bool) {
        self.page.click("#in-space");
        self.page
            .wait_until(&format!("document.querySelectorAll('#space .labels span').length === {labels}"));
        if has_surfaces {
            self.page.wait_until("document.querySelector('#space canvas').dataset.discs > 0");
        }
        self.page.value("document.querySelector('#space .labels').hidden = true");
        self.page.value("document.getElementById('in-space').style.visibility = 'hidden'");
    }

    /// The 3-D view as it is on the screen, once two frames of it have been shown.
    fn space(&mut self) -> RgbImage {
        self.page.value("window.shown = 0; requestAnimationFrame(() => requestAnimationFrame(() => { window.shown = 1; }));");
        self.page.wait_until("window.shown === 1");
        let rect = self.page.value(
            "(({x, y, width, height}) => [x, y, width, height])\
             (document.querySelector('#space canvas').getBoundingClientRect())",
        );
        let [x, y, width, height]: [f64; 4] = serde_json::from_value(rect).unwrap();
        let window = image::load_from_memory(&self.page.picture()).unwrap().into_rgb8();
        let [x, y, width, height] =
            [x.ceil(), y.ceil(), width.floor(), height.floor()].map(|size| size as u32);
        image::imageops::crop_imm(&window, x, y, width, height.min(window.height() - y)).to_image()
    }

    /// Types a number into the table of corners.
    fn type_corner(&mut self, row: usize, column: usize, text: &str) {
        self.page.click(&format!("#numbers tr:nth-child({row}) td:nth-child({column}) input"));
        self.page.value("document.activeElement.select()");
        self.page.type_text(text);
        self.page.press("Enter", 0);
    }
}

/// Middle of the pixels of the zone, from the picture's middle to the right; `None` where fewer than 20 show it.
fn zone_offset_px(picture: &RgbImage) -> Option<f64> {
    let is_zone = |pixel: &image::Rgb<u8>| (0..3).all(|c| pixel[c].abs_diff(ZONE[c]) <= NEAR);
    let columns: Vec<f64> =
        picture.enumerate_pixels().filter(|(.., p)| is_zone(p)).map(|(x, ..)| f64::from(x)).collect();
    (columns.len() >= 20)
        .then(|| columns.iter().sum::<f64>() / columns.len() as f64 - 0.5 * f64::from(picture.width()))
}

fn changed_share(a: &RgbImage, b: &RgbImage) -> f64 {
    let changed = a.pixels().zip(b.pixels()).filter(|(a, b)| (0..3).any(|c| a[c].abs_diff(b[c]) > 16));
    changed.count() as f64 / f64::from(a.width() * a.height())
}

#[test]
fn a_zone_moves_in_the_3_d_view_of_a_chromium_as_it_is_edited() {
    let Some(mut editor) = EditorPage::open() else { return };
    let middle = editor.at(0.25, 0.25);
    editor.page.drag(&[middle]);
    editor.open_space(4, true);
    assert!(editor.is("!document.getElementById('plan').checkVisibility()"));
    let before = editor.space();
    let before_px = zone_offset_px(&before).expect("the zone is in sight");
    // By two metres along x, which points to the right.
    for (row, x) in [(1, "2"), (2, "2.5"), (3, "2.5"), (4, "2")] {
        editor.type_corner(row, 2, x);
    }
    let moved_px = zone_offset_px(&editor.space()).expect("the zone is in sight");
    assert!(moved_px > before_px + 40.0, "{before_px} → {moved_px}");
    editor.page.screenshot("space-1400.png");
    // Half a turn about the middle of the room: what was on the right is on the left.
    let [x, y] = editor.page.middle_of("#space canvas");
    let half_turn_px = std::f64::consts::PI / 0.007;
    editor.page.drag(&[[x - 0.5 * half_turn_px, y], [x, y], [x + 0.5 * half_turn_px, y]]);
    let turned = editor.space();
    let turned_px = zone_offset_px(&turned).expect("the zone is in sight");
    assert!(changed_share(&before, &turned) > 0.001 && turned_px < -40.0, "{moved_px} → {turned_px}");
    // Undone there, too, and back on the plan.
    for _ in 0..4 {
        editor.page.click("#undo");
    }
    let undone_px = zone_offset_px(&editor.space()).expect("the zone is in sight");
    assert!((undone_px + before_px).abs() < 0.5 * (undone_px - turned_px).abs(), "{undone_px}");
    editor.page.press("Escape", 0);
    editor.page.value("document.activeElement.blur()");
    editor.page.press("3", 0);
    editor.page.wait_until("document.getElementById('plan').checkVisibility()");
    assert!(editor.is("!document.getElementById('space').checkVisibility()"));
}

#[test]
fn the_3_d_view_of_the_office_fits_a_telephones_chromium_and_turns_by_a_finger() {
    let Some(mut editor) = EditorPage::of_office() else { return };
    editor.open_space(4, true);
    let desk = editor.space();
    editor.page.value("document.querySelector('#space .labels').hidden = false");
    editor.page.value("document.getElementById('in-space').style.visibility = ''");
    editor.page.screenshot("space-office-1400.png");
    // The surfaces fill the room.
    let ground = *desk.get_pixel(2, desk.height() - 3);
    assert!(
        desk.pixels().filter(|pixel| **pixel != ground).count() > (desk.width() * desk.height() / 8) as usize
    );

    editor.page.become_telephone(390, 844);
    editor.page.wait_until("innerWidth === 390 && matchMedia('(pointer: coarse)').matches");
    editor.page.wait_until(LOADED);
    let button = editor.page.middle_of("#in-space");
    editor.page.touch(&[button]);
    editor.page.wait_until("document.querySelectorAll('#space .labels span').length > 2");
    editor.nothing_is_off_screen(390);
    let before = editor.page.value("document.querySelector('#space .labels').innerHTML");
    let [x, y] = editor.page.middle_of("#space canvas");
    editor.page.touch(&[[x - 80.0, y], [x, y + 10.0], [x + 80.0, y + 10.0]]);
    editor.space();
    assert_ne!(editor.page.value("document.querySelector('#space .labels').innerHTML"), before);
    editor.page.screenshot("space-office-390.png");
    // The page itself stands still under the finger.
    assert!(editor.is("scrollX === 0 && scrollY === 0"));
}

#[test]
fn a_room_without_geometry_is_shown_in_3_d_in_a_chromium() {
    let folder = room();
    let scene = folder.path().join("scene.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    let without: Vec<&str> = text.lines().filter(|line| !line.starts_with("geometry")).collect();
    std::fs::write(&scene, without.join("\n")).unwrap();
    let dir = folder.path().to_owned();
    let Some(mut editor) = EditorPage::of_room(folder, dir) else { return };
    editor.open_space(4, false);
    assert!(zone_offset_px(&editor.space()).is_some());
}
