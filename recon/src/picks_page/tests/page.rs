//! The page in a browser, driven as a person drives it.

use browser::{CTRL, Page};
use serde_json::json;

use super::PickedProject;
use crate::project::{KnownLength, Project, read_picked};

/// Clicks a pixel of a camera's picture.
fn click(page: &mut Page, camera: &str, [u, v]: [f64; 2]) {
    let selector = json!(format!("svg[data-camera='{camera}']"));
    let place = page.value(&format!(
        "(({{x, y}}) => [x, y])(new DOMPoint({u}, {v}).matrixTransform(document.querySelector({selector}).getScreenCTM()))"
    ));
    let place: [f64; 2] = serde_json::from_value(place).unwrap();
    page.drag(&[place]);
}

#[test]
fn points_and_a_length_clicked_in_a_chromium_are_saved() {
    let project = PickedProject::new();
    let Some(mut page) = Page::open(&format!("http://{}/", project.address)) else { return };
    page.wait_until("document.querySelectorAll('.pane svg[data-camera]').length === 2 && document.getElementById('hint').textContent.includes('both pictures')");
    let step = project.shared.len() / 6;
    for (i, [a, b]) in project.shared.iter().step_by(step).take(6).enumerate() {
        click(&mut page, "cam0", [a.x, a.y]);
        page.wait_until(&format!("document.querySelectorAll('#points li').length === {}", i + 1));
        if i >= 3 {
            // Three points have joined the cameras.
            page.wait_until("document.querySelector('svg[data-camera=cam1] .epipolar') !== null");
        }
        click(&mut page, "cam1", [b.x, b.y]);
        page.wait_until(&format!(
            "document.querySelectorAll('svg[data-camera=cam1] .grip').length === {}",
            i + 1
        ));
        if i >= 2 {
            page.wait_until(&format!(
                "document.querySelectorAll('#points .residual.fits').length === {}",
                i + 1
            ));
        }
    }
    // A length between two of the points; its ends are those picks.
    page.click("#ends");
    let [first, second] = [project.shared[0][0], project.shared[step][0]];
    click(&mut page, "cam0", [first.x + 0.4, first.y]);
    click(&mut page, "cam0", [second.x, second.y + 0.4]);
    page.wait_until("document.activeElement.id === 'metres'");
    page.type_text("1.25");
    page.screenshot("picks-1400.png");
    page.press("s", CTRL);
    page.wait_until("document.getElementById('message').textContent === 'Saved.'");
    assert!(project.text().starts_with("# Two cameras.\n"), "{}", project.text());
    let read = Project::read(&project.project).unwrap();
    assert_eq!(read.points.len(), 6);
    // A pixel of the picture is several of the window.
    for (point, [a, b]) in read.points.iter().zip(project.shared.iter().step_by(step)) {
        assert!(
            (point.pixel(0).unwrap() - a).amax() < 0.5 && (point.pixel(1).unwrap() - b).amax() < 0.5,
            "{point:?}"
        );
    }
    let scales = read_picked(&project.project).unwrap().0.scale;
    let [scale] = &scales[..] else { panic!("{scales:?}") };
    let ends = [0, 1].map(|i| read.points[i].pixel(0).unwrap());
    assert_eq!((scale.camera.as_str(), scale.metres), ("cam0", Some(1.25)));
    assert_eq!([scale.from.unwrap(), scale.to.unwrap()], ends.map(|p| [p.x, p.y]));

    // A camera's height as well: both are saved, and the first can go again.
    page.click("#scale-add");
    page.value(
        "(() => { const kind = document.getElementById('scale-kind'); kind.value = 'height'; \
         kind.dispatchEvent(new Event('change')); return 0; })()",
    );
    page.press("s", CTRL);
    page.wait_until("document.getElementById('message').textContent.includes('is incomplete')");
    page.click("#metres");
    page.type_text("2.5");
    page.screenshot("picks-scales-1400.png");
    page.press("s", CTRL);
    page.wait_until("document.getElementById('message').textContent === 'Saved.'");
    assert_eq!(Project::read(&project.project).unwrap().lengths.len(), 2, "{}", project.text());
    page.click("#scales li:first-child button:last-child");
    page.press("s", CTRL);
    page.wait_until("document.getElementById('message').textContent === 'Saved.' && document.querySelectorAll('#scales li').length === 0");
    let lengths = Project::read(&project.project).unwrap().lengths;
    assert!(matches!(lengths[..], [KnownLength::Height { camera: 0, height_m: 2.5 }]), "{lengths:?}");

    // A removed point whose removal is undone leaves nothing to save.
    page.click("#points li button");
    page.wait_until(
        "document.querySelectorAll('#points li').length === 5 && !document.getElementById('unsaved').hidden",
    );
    page.click("#undo");
    page.wait_until(
        "document.querySelectorAll('#points li').length === 6 && document.getElementById('unsaved').hidden",
    );
}

#[test]
fn proposals_are_taken_by_a_click_and_a_failing_build_is_told_in_a_chromium() {
    let project = PickedProject::new();
    let pairs = project.shared.iter().step_by(project.shared.len() / 4).take(4);
    let proposals =
        pairs.map(|pixels| super::super::state::ProposedPoint::new(["cam0", "cam1"], *pixels, 0.9));
    let mut proposals: Vec<_> = proposals.collect();
    let fourth = proposals.pop();
    project.session.update(|state| state.proposals = proposals);
    let Some(mut page) = Page::open(&format!("http://{}/", project.address)) else { return };
    page.wait_until("document.querySelectorAll('#proposals li').length === 3");
    page.value("pressed = document.querySelector('#proposals li button'), 0");
    project.session.update(|state| state.proposals.extend(fourth));
    page.wait_until("document.querySelectorAll('#proposals li').length === 4");
    assert_eq!(
        page.value("pressed.isConnected"),
        true,
        "a button that is pressed while another proposal arrives"
    );
    page.click("#proposals li button");
    page.wait_until("document.querySelectorAll('#points li').length === 1 && document.querySelectorAll('#proposals li').length === 3");
    page.click("#take-all");
    page.wait_until("document.querySelectorAll('#points .residual.fits').length === 4");
    page.click("#build");
    page.wait_until("document.getElementById('message').textContent.includes('[scale]')");
    assert_eq!(read_picked(&project.project).unwrap().0.points.len(), 4, "saved before it is built");
    page.screenshot("picks-proposals-1400.png");
}
