//! `recon picks` where there is nothing to propose: one clear line, exit status 2, nothing written.

use std::fs;

use synthetic::RoomOptions;
use tests::data::program;

use crate::refusal::refused;

#[test]
fn cameras_of_two_rooms_are_told_apart_by_name_and_nothing_is_written() {
    let scratch = tempfile::tempdir().unwrap();
    let folder = scratch.path();
    for seed in [4, 5] {
        let room = RoomOptions { seed, image_px: [256, 192], ..RoomOptions::default() }.build().unwrap();
        tests::project::write(&folder.join(seed.to_string()), &room, 16).unwrap();
    }
    // Neither points nor a scale: picks are proposed before them.
    let camera = |name: &str, capture: &str| {
        format!("[[camera]]\nname = \"{name}\"\ncapture = \"{capture}\"\nintrinsics = \"{capture}.toml\"\n")
    };
    let project = camera("kitchen", "4/cam0") + &camera("hall", "5/cam0");
    fs::write(folder.join("room.toml"), project).unwrap();
    let picks = |arguments: &[&str]| {
        program("recon").current_dir(folder).arg("picks").args(arguments).output().unwrap()
    };
    let arguments = ["room.toml", "--out", "picks.toml", "--room", "room", "--quality", "draft"];
    let output = picks(&arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(errors.len() == 1 && errors[0].contains("room.toml") && errors[0].contains("by hand"), "{said}");
    assert!(said.contains("kitchen and hall: nothing that both show"), "{said}");
    assert!(!folder.join("picks.toml").exists() && !folder.join("picks.png").exists());

    // The results of the captures are cached.
    let again = picks(&arguments);
    assert!(String::from_utf8_lossy(&again.stderr).contains("hall: depth kept from before"));

    fs::write(folder.join("one.toml"), camera("kitchen", "4/cam0")).unwrap();
    refused(&picks(&["one.toml", "--out", "picks.toml"]), &["one.toml", "one camera"]);
    refused(&picks(&["room.toml", "--out", "picks.png"]), &["picks.png", "--picture"]);
    refused(&picks(&["gone.toml", "--out", "picks.toml"]), &["gone.toml"]);
}
