//! The editor's page in a browser, driven as a person drives it.

use super::editor_page::{EditorPage, LOADED};
use super::server::room_json;
use super::*;
use crate::room::{Zone, ZoneKind};
use browser::CTRL;

/// A pixel of the window is less than 3 cm of this floor.
fn assert_near(corners: &[Point2<f64>], expected: &[(f64, f64)], tolerance_m: f64) {
    assert_eq!(corners.len(), expected.len(), "{corners:?}");
    for (corner, (x, y)) in corners.iter().zip(expected) {
        assert!((corner - Point2::new(*x, *y)).amax() < tolerance_m, "{corner} is not at {x}, {y}");
    }
}

/// Draws a zone, names it, drags two of its corners, undoes one, and saves.
#[test]
fn a_zone_drawn_in_a_chromium_is_saved_as_it_was_left() {
    let Some(mut editor) = EditorPage::open() else { return };
    let before = editor.scene();
    // On the plan, in the list, and in a camera.
    let shown = editor.page.value("document.documentElement.outerHTML");
    let shown = shown.as_str().unwrap();
    for part in [">door &lt;1&gt;</text>", "Kind of zone door", "data-camera=\"Küche links\""] {
        assert!(shown.contains(part), "no `{part}` in:\n{shown}");
    }
    assert!(
        editor.is("document.getElementById('unsaved').hidden && document.getElementById('undo').disabled")
    );
    editor.begin("zone");
    editor.click_places(&[(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)]);
    editor.close_and_name("gate");
    editor.drag_corner(1, 4.0, 1.0);
    let label = "document.querySelector(\"#plan [data-corner='2']\").ariaLabel";
    let left = editor.page.value(label);
    editor.drag_corner(2, 4.0, 4.0);
    assert_ne!(editor.page.value(label), left, "the corner was not moved");
    editor.page.click("#undo");
    assert_eq!(editor.page.value(label), left);
    assert!(editor.is("!document.getElementById('unsaved').hidden"));
    assert_eq!(editor.scene(), before, "written before it is saved");
    editor.page.screenshot("editor-1400.png");
    editor.save("Saved.");
    assert!(editor.is("document.getElementById('unsaved').hidden"));

    let after = editor.scene();
    let added = after.strip_prefix(&before).expect("the zone follows what was there");
    assert!(added.starts_with("\n[[zone]]\nname = \"gate\"\npolygon = "), "{added}");
    let zones = editor.saved().zones;
    assert_eq!((zones.len(), zones[1].kind), (2, ZoneKind::Both));
    assert_near(&zones[1].polygon.0, &[(1.0, 1.0), (4.0, 1.0), (2.0, 2.0)], 0.06);
}

#[test]
fn a_region_a_line_and_floor_drawn_in_a_chromium_are_saved() {
    let Some(mut editor) = EditorPage::open() else { return };
    editor.begin("region");
    editor.click_places(&[(-4.0, -4.0), (-2.0, -4.0), (-2.0, -2.0), (-4.0, -2.0)]);
    editor.close_and_name("till");
    editor.page.click("#regions .property input");
    editor.page.type_text("12.5");
    editor.page.press("Enter", 0);
    // A line ends where it is clicked twice; its name is selected then.
    editor.begin("line");
    editor.click_places(&[(-4.0, 2.0)]);
    let end = editor.at(-1.0, 2.0);
    editor.page.drag(&[end]);
    editor.page.drag(&[end]);
    editor.page.wait_until("document.activeElement.matches('#lines li > input')");
    editor.page.type_text("way in");
    editor.page.click("#lines .property button");
    // The first corner closes the floor.
    editor.begin("floor");
    editor.click_places(&[(5.5, -2.0), (7.0, -2.0), (7.0, 2.0), (5.5, -2.0)]);
    editor.page.wait_until("document.querySelectorAll('#floor li').length === 2");
    editor.page.screenshot("kinds-1400.png");
    editor.save("Saved.");
    let room = editor.saved();
    assert_eq!((room.regions[0].name.as_str(), room.regions[0].dwell_s), ("till", Some(12.5)));
    let expected = [(-4.0, -4.0), (-2.0, -4.0), (-2.0, -2.0), (-4.0, -2.0)];
    assert_near(&room.regions[0].polygon.0, &expected, 0.06);
    // Turned round: from right to left now.
    assert_eq!(room.lines[0].name, "way in");
    assert_near(&room.lines[0].points, &[(-1.0, 2.0), (-4.0, 2.0)], 0.06);
    let floor = room.walkable.unwrap();
    assert_near(&floor[1].0, &[(5.5, -2.0), (7.0, -2.0), (7.0, 2.0)], 0.06);
    // Duplicated by the keyboard, dragged as a whole, undone and done again, and removed.
    editor.page.press("Escape", 0);
    let line = editor.at(-3.3, 2.0);
    editor.page.drag(&[line]);
    editor.page.press("d", 0);
    editor.page.wait_until("document.querySelectorAll('#lines li').length === 2");
    editor.page.press("Escape", 0);
    let [from, to] = [editor.at(-3.3, 1.7), editor.at(-3.3, -1.3)];
    editor.page.drag(&[from, to]);
    editor.page.press("z", CTRL);
    editor.page.press("y", CTRL);
    editor.save("Saved.");
    let lines = editor.saved().lines;
    assert_near(&lines[1].points, &[(-0.7, -1.3), (-3.7, -1.3)], 0.06);
    editor.page.press("Delete", 0);
    editor.save("Saved.");
    assert_eq!(editor.saved().lines.len(), 1);
}

#[test]
fn numbers_typed_in_a_chromium_are_saved_to_the_millimetre() {
    let Some(mut editor) = EditorPage::open() else { return };
    let middle = editor.at(0.1, 0.4);
    editor.page.drag(&[middle]);
    editor.page.wait_until("!document.getElementById('numbers').hidden");
    let type_into = |editor: &mut EditorPage, row: usize, column: usize, text: &str| {
        let input = format!("#numbers tr:nth-child({row}) td:nth-child({column}) input");
        editor.page.click(&input);
        editor.page.value("document.activeElement.select()");
        editor.page.type_text(text);
        editor.page.press("Enter", 0);
    };
    type_into(&mut editor, 3, 2, "1.234");
    type_into(&mut editor, 3, 3, "0.75");
    // The length of the edge from there to the next corner.
    let length = editor.page.value("document.querySelector('#numbers tbody tr:nth-child(3) output').value");
    assert_eq!(length, "1.26 m");
    editor.save("Saved.");
    assert_near(
        &editor.saved().zones[0].polygon.0,
        &[(0.0, 0.0), (0.5, 0.0), (1.234, 0.75), (0.0, 0.5)],
        1e-9,
    );
    editor.page.click("#numbers tr:nth-child(4) button");
    editor.save("Saved.");
    assert_near(&editor.saved().zones[0].polygon.0, &[(0.0, 0.0), (0.5, 0.0), (1.234, 0.75)], 1e-9);
    // No zone has two corners.
    assert!(editor.is("document.querySelector('#numbers tr:nth-child(1) button').disabled"));
}

#[test]
fn a_distance_is_measured_in_a_chromium_and_corners_snap_to_walls() {
    let Some(mut editor) = EditorPage::open() else { return };
    // A box stands there: x from 3 to 4 m, y from −0.5 to 0.5 m. Its corners are 1 m apart.
    editor.page.press("m", 0);
    editor.page.wait_until("document.querySelectorAll('#plan .wall').length >= 4");
    editor.click_places(&[(3.03, -0.53), (3.03, 0.47)]);
    editor.page.wait_until("document.querySelector('#plan text:last-of-type').textContent === '1.00 m'");
    editor.page.wait_until(
        "[...document.querySelectorAll('#cameras text')].some((t) => t.textContent === '1.00 m')",
    );
    editor.page.screenshot("measure-1400.png");
    editor.page.press("Escape", 0);
    editor.page.wait_until("document.querySelectorAll('#plan .draft').length === 0");
    assert!(editor.is("document.getElementById('unsaved').hidden"), "measuring changes nothing");
    // Corners near to the wall lie on it, or on its end; others stay.
    editor.begin("region");
    editor.click_places(&[(2.97, -0.52), (2.97, 0.2), (1.8, 0.2)]);
    editor.close_and_name("shelf");
    editor.save("Saved.");
    let polygon = editor.saved().regions[0].polygon.clone();
    assert_near(&polygon.0[..1], &[(3.0, -0.5)], 0.01);
    assert!((polygon.0[1].x - 3.0).abs() < 0.01, "{polygon:?}");
    assert_near(&polygon.0[1..], &[(3.0, 0.2), (1.8, 0.2)], 0.06);
}

/// Saves twice at once; then another program changes what the page changes, and something else.
#[test]
fn what_others_change_meanwhile_is_merged_in_a_chromium_and_conflicts_are_told() {
    let Some(mut editor) = EditorPage::open() else { return };
    let outside = |editor: &EditorPage, from: &str, to: &str| {
        let text = editor.scene();
        assert!(text.contains(from), "no {from} in {text}");
        std::fs::write(editor.dir.join("scene.toml"), text.replace(from, to)).unwrap();
    };
    let set_kind = |editor: &mut EditorPage, kind: &str| {
        editor.page.value(&format!(
            "(({{ style: _ }}, select) => {{ select.value = '{kind}'; select.dispatchEvent(new Event('change')); }})\
             (document.body, document.querySelector('#zones select'))"
        ));
    };
    set_kind(&mut editor, "exit");
    editor.page.press("s", CTRL);
    set_kind(&mut editor, "both");
    editor.page.press("s", CTRL);
    editor.page.wait_until("document.getElementById('unsaved').hidden");
    editor.wait_for_message("Saved.");
    assert_eq!(editor.saved().zones[0].kind, ZoneKind::Both, "the second save was lost");
    assert!(editor.is("document.getElementById('again').hidden"));

    // Another name outside, another kind here: both.
    outside(&editor, "name = \"door <1>\"", "name = \"north\" # by hand");
    set_kind(&mut editor, "exit");
    editor.save("Saved, together with what was changed");
    editor.page.wait_until("document.querySelector('#zones li > input').value === 'north'");
    assert_eq!(editor.saved().zones[0].kind, ZoneKind::Exit);
    assert!(editor.scene().contains("# by hand"));

    // Another kind on both sides: told; loaded again, it is theirs.
    outside(&editor, "kind = \"exit\"", "kind = \"entry\"");
    set_kind(&mut editor, "both");
    editor.save("changed both here and in the file");
    editor.page.screenshot("conflict-1400.png");
    editor.page.click("#again");
    editor.page.wait_until("document.querySelector('#zones select').value === 'entry'");
    assert!(editor.is("document.getElementById('unsaved').hidden"));

    // And saved over it, it is the page's.
    outside(&editor, "kind = \"entry\"", "kind = \"exit\"");
    set_kind(&mut editor, "both");
    editor.save("changed both here and in the file");
    editor.page.click("#overwrite");
    editor.wait_for_message("Saved.");
    assert_eq!(editor.saved().zones[0].kind, ZoneKind::Both);
    // A new zone outside is there when the page is loaded again.
    let mut room = editor.saved();
    let polygon = polygon(&[(2.0, 2.0), (3.0, 2.0), (3.0, 3.0)]);
    room.zones.push(Zone { name: "south".into(), polygon, kind: ZoneKind::Both });
    room.write(&editor.dir).unwrap();
    editor.page.value("location.reload()");
    editor.page.wait_until("document.querySelectorAll('#zones li').length === 2");
    assert_eq!(room_json(editor.address)["drawing"]["zones"][1]["name"], "south");
}

/// Draws and drags in the image of the camera that looks down from 2 m: a pixel is 2 cm.
#[test]
fn what_is_drawn_in_a_cameras_image_in_a_chromium_is_on_the_floor_below() {
    let Some(mut editor) = EditorPage::open() else { return };
    editor.begin("region");
    for (u, v) in [(-60.0, 60.0), (-20.0, 60.0), (-20.0, 20.0)] {
        let place = editor.in_camera("down", C + u, C + v);
        editor.page.drag(&[place]);
    }
    // The second click of a double click closes; the answer about the first may still be on its way.
    let last = editor.in_camera("down", C - 60.0, C + 20.0);
    editor.page.drag(&[last]);
    editor.page.drag(&[last]);
    editor.page.wait_until("document.activeElement.matches('#regions li > input')");
    editor.page.type_text("rug");
    editor.page.press("Enter", 0);
    editor.page.wait_until("document.querySelectorAll(\"[data-camera='down'] [data-corner]\").length === 4");
    // A corner, and then the whole by its edge. Both end where the pointer ended, however late the answers are.
    let corner = "[data-camera='down'] [data-corner='1']";
    let to = editor.in_camera("down", C - 10.0, C + 70.0);
    let from = editor.page.middle_of(corner);
    editor.page.drag(&[from, to]);
    editor.save("Saved.");
    let region = |editor: &EditorPage| editor.saved().regions[0].polygon.0.clone();
    assert_near(&region(&editor), &[(-1.2, -1.2), (-0.2, -1.4), (-0.4, -0.4), (-1.2, -0.4)], 0.03);
    let [from, to] = [(-60.0, 40.0), (-40.0, 10.0)].map(|(u, v)| editor.in_camera("down", C + u, C + v));
    editor.page.drag(&[from, to]);
    editor.save("Saved.");
    assert_near(&region(&editor), &[(-0.8, -0.6), (0.2, -0.8), (0.0, 0.2), (-0.8, 0.2)], 0.05);
    editor.page.click("#undo");
    editor.save("Saved.");
    assert_near(&region(&editor), &[(-1.2, -1.2), (-0.2, -1.4), (-0.4, -0.4), (-1.2, -0.4)], 0.03);
}

#[test]
fn a_telephones_chromium_shows_all_and_draws_by_fingers() {
    let Some(mut editor) = EditorPage::open() else { return };
    editor.page.become_telephone(390, 844);
    editor.page.wait_until("innerWidth === 390 && matchMedia('(pointer: coarse)').matches");
    editor.page.wait_until(LOADED);
    // Nothing is off the screen: neither now, nor with numbers, nor with a message.
    editor.nothing_is_off_screen(390);
    editor.page.screenshot("telephone-1.png");
    let tap = |editor: &mut EditorPage, selector: &str| {
        editor.scroll_to(selector);
        let middle = editor.page.middle_of(selector);
        editor.page.touch(&[middle]);
    };
    // In a camera's image, by fingers.
    tap(&mut editor, "[data-draw='line']");
    editor.page.wait_until("document.querySelector(\"[data-draw='line']\").ariaPressed === 'true'");
    for (i, (u, v)) in [(-70.0, 50.0), (40.0, 50.0)].into_iter().enumerate() {
        let place = editor.in_camera("down", C + u, C + v);
        editor.page.touch(&[place]);
        // The draft's corners are round: as many as there are places by now.
        editor
            .page
            .wait_until(&format!("document.querySelectorAll('#plan circle.corner').length === {}", i + 1));
    }
    tap(&mut editor, "#done");
    editor.page.wait_until("document.querySelectorAll('#lines li').length === 1");
    editor.page.wait_until("document.activeElement.matches('#lines li > input')");
    editor.page.wait_until("document.querySelectorAll(\"[data-camera='down'] [data-corner]\").length === 2");
    editor.nothing_is_off_screen(390);
    editor.scroll_to("#numbers");
    editor.page.screenshot("telephone-2.png");
    let to = editor.in_camera("down", C + 60.0, C + 80.0);
    let from = editor.page.middle_of("[data-camera='down'] [data-corner='1']");
    let middle = [0, 1].map(|axis| 0.5 * (from[axis] + to[axis]));
    editor.page.touch(&[from, middle, to]);
    editor.page.wait_until("document.querySelector('#numbers tbody tr:nth-child(2) input').value > 1.15");
    editor.scroll_to("[data-camera='down']");
    editor.page.screenshot("telephone-3.png");
    tap(&mut editor, "#save");
    editor.wait_for_message("Saved.");
    editor.nothing_is_off_screen(390);
    assert_near(&editor.saved().lines[0].points, &[(-1.4, -1.0), (1.2, -1.6)], 0.05);
}

/// The shipped office with something of each kind, in a window of a desk's width and in a narrow one.
#[test]
fn the_offices_page_in_a_chromium_fits_windows_of_every_width() {
    let Some(mut editor) = EditorPage::of_office() else { return };
    editor.begin("region");
    editor.click_places(&[(3.05, 1.0), (4.7, 1.0), (4.7, 2.1), (3.05, 2.1)]);
    editor.close_and_name("counter");
    editor.begin("line");
    editor.click_places(&[(1.2, 2.6), (1.2, 4.6)]);
    editor.close_and_name("gate");
    editor.save("Saved.");
    for (width, height) in [(1100, 800), (961, 800), (820, 900), (390, 844)] {
        editor.page.resize(width, height);
        editor.nothing_is_off_screen(width);
        let loaded = "[...document.querySelectorAll('.frame img')].every((image) => image.complete && image.naturalWidth > 0)";
        editor.page.wait_until(loaded);
        editor.page.value("document.activeElement.blur()");
        editor.page.screenshot(&format!("office-{width}.png"));
    }
    let room = editor.saved();
    assert_eq!((room.regions[0].name.as_str(), room.lines[0].name.as_str()), ("counter", "gate"));
}
