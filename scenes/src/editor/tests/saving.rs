//! Drawings saved over the editor's socket.

use std::net::SocketAddr;

use serde_json::{Value, json};

use super::server::{room, room_json, scene_text, send, served};
use crate::room::{Room, ZoneKind};

/// Question that saves a drawing as the edited form of another. Items of both lists belong together by their place.
pub(super) fn saving(base: &Value, drawing: &Value) -> Value {
    let mut edited = drawing.clone();
    for list in ["zones", "regions", "lines"] {
        let count = base[list].as_array().unwrap().len();
        let items = drawing[list].as_array().unwrap().iter().enumerate();
        let with_origin = |(i, item)| json!({ "item": item, "origin": (i < count).then_some(i) });
        edited[list] = items.map(with_origin).collect();
    }
    json!({ "base": base, "edited": edited })
}

fn save(address: SocketAddr, base: &Value, drawing: &Value) -> (u16, Value) {
    send(address, "PUT", "/drawing", &saving(base, drawing).to_string())
}

#[test]
fn saving_changes_the_drawing_and_nothing_else() {
    let folder = room();
    let address = served(folder.path());
    let before = scene_text(folder.path());
    let base = room_json(address)["drawing"].clone();
    let mut drawing = base.clone();
    drawing["zones"][0]["polygon"][2] = json!([0.75, 0.5]);
    let (status, first) = save(address, &base, &drawing);
    assert_eq!((status, &first["warnings"], &first["merged"]), (200, &json!([]), &json!(false)), "{first}");
    let after = scene_text(folder.path());
    assert!(after != before && after.starts_with("# Measured by hand.\n"));
    assert_eq!(after.replace("[0.75, 0.5]", "[0.5, 0.5]"), before);
    // Regions and lines, and a zone that nobody can stand in.
    let base = drawing.clone();
    drawing["zones"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "name": "far", "kind": "exit", "polygon": [[20.0, 0.0], [21.0, 0.0], [21.0, 1.0]] }));
    drawing["regions"] =
        json!([{ "name": "till", "polygon": [[1.0, 0.0], [2.0, 0.0], [2.0, 1.0]], "dwell_s": 4.5 }]);
    drawing["lines"] = json!([{ "name": "gate", "points": [[-4.0, 1.0], [-3.0, 1.0]] },
        { "name": "off", "points": [[14.0, 1.0], [15.0, 1.0]] }]);
    let (status, second) = save(address, &base, &drawing);
    assert_eq!(status, 200, "{second}");
    assert_eq!(
        second["warnings"],
        json!([
            "zone `far`: nobody can stand in it; move it, or mend [floor]",
            "line `off`: nobody can cross it; move it, or mend [floor]"
        ])
    );
    let room = Room::read(folder.path()).unwrap();
    assert_eq!(
        (room.zones[1].kind, room.regions[0].dwell_s, room.lines.len()),
        (ZoneKind::Exit, Some(4.5), 2)
    );
    assert_eq!(room_json(address)["drawing"], drawing);
    assert_eq!(room_json(address)["version"], second["version"]);
    // Not simple: named, and nothing is written.
    let (base, saved) = (drawing.clone(), scene_text(folder.path()));
    drawing["zones"][0]["polygon"] = json!([[0, 0], [1, 1], [1, 0], [0, 2]]);
    let (status, refused) = save(address, &base, &drawing);
    assert_eq!(status, 422, "{refused}");
    let line = refused["error"].as_str().unwrap();
    assert!(line.contains("`door <1>`") && line.contains("meets itself"), "{line}");
    assert_eq!(scene_text(folder.path()), saved);
}

/// The warnings are about the floor that the tracker has: drawn, or derived from the geometry, in which zones are floor.
#[test]
fn warnings_are_about_the_floor_that_the_tracker_has() {
    let folder = room();
    let derived = Room { walkable: None, ..Room::read(folder.path()).unwrap() };
    derived.write(folder.path()).unwrap();
    let address = served(folder.path());
    let told = room_json(address);
    assert_eq!((&told["drawing"]["floor"], &told["has_geometry"]), (&json!([]), &json!(true)));
    let inside_the_box = json!([[3.2, -0.3], [3.8, -0.3], [3.8, 0.3]]);
    let base = told["drawing"].clone();
    let mut drawing = base.clone();
    drawing["regions"] = json!([{ "name": "box", "polygon": inside_the_box }]);
    let (_, reply) = save(address, &base, &drawing);
    assert_eq!(reply["warnings"].as_array().unwrap().len(), 1, "{reply}");
    // The tracker lets people stand in every zone, and so in the region below it.
    let base = drawing.clone();
    let zone = json!({ "name": "lift", "kind": "both", "polygon": [[3.1, -0.4], [3.9, -0.4], [3.9, 0.4], [3.1, 0.4]] });
    drawing["zones"].as_array_mut().unwrap().push(zone);
    let (_, reply) = save(address, &base, &drawing);
    assert_eq!(reply["warnings"], json!([]), "{reply}");
    let base = drawing.clone();
    drawing["floor"] = json!([[[-5, -5], [0, -5], [0, 5], [-5, 5]]]);
    let (_, reply) = save(address, &base, &drawing);
    assert_eq!(reply["warnings"].as_array().unwrap().len(), 3, "{reply}");
    let map = crate::walkable::WalkableMap::of_room(&Room::read(folder.path()).unwrap()).unwrap();
    assert!(!map.contains(1.0, 0.0) && map.contains(-1.0, 0.0));
}

#[test]
fn changes_by_other_programs_are_merged_and_conflicts_are_told() {
    let folder = room();
    let address = served(folder.path());
    let base = room_json(address)["drawing"].clone();
    let by_hand = scene_text(folder.path()).replace("door <1>", "gate").replace("film\"", "tape\"");
    std::fs::write(folder.path().join("scene.toml"), by_hand).unwrap();
    let mut drawing = base.clone();
    drawing["zones"][0]["kind"] = json!("exit");
    let (status, reply) = save(address, &base, &drawing);
    assert_eq!((status, &reply["merged"]), (200, &json!(true)), "{reply}");
    let told = room_json(address);
    let zone = &told["drawing"]["zones"][0];
    assert_eq!((&zone["name"], &zone["kind"]), (&json!("gate"), &json!("exit")));
    assert_eq!(told["cameras"][2]["name"], "tape");
    // Another name here as well: told, and nothing is written until it is said which.
    let before = scene_text(folder.path());
    drawing["zones"][0]["name"] = json!("way in");
    let (status, told) = save(address, &base, &drawing);
    assert_eq!(status, 409, "{told}");
    let line = told["error"].as_str().unwrap();
    assert!(line.contains("zone `door <1>`: renamed both here and in the file"), "{line}");
    assert_eq!(scene_text(folder.path()), before);
    let mut question = saving(&base, &drawing);
    question["on_conflict"] = json!("overwrite");
    assert_eq!(send(address, "PUT", "/drawing", &question.to_string()).0, 200);
    assert_eq!(Room::read(folder.path()).unwrap().zones[0].name, "way in");
}
