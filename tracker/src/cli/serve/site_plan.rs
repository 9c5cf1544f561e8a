//! The plan of a site: rooms with their arguments, doors, retention; checked as a whole before anything starts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Parser;
use scenes::room::Room;

use super::arguments::{arguments, named};
use super::site_file::{DoorTable, Options, Retention, RoomTable, SiteFile};
use crate::Error;
use crate::cli::run_arguments::RunArgs;
use crate::cli::{Arguments, Command, flags};
use crate::serve::{Door, DoorOptions, DoorSide};

/// Name of the folder of the site's own files, which no room may have.
const SITE: &str = "site";

/// Rooms, outputs and options of a service, checked.
#[derive(Debug, Clone)]
pub(super) struct SitePlan {
    /// Folder of all results.
    pub(super) out: PathBuf,
    /// Rooms in the order of the file.
    pub(super) rooms: Vec<RoomPlan>,
    pub(super) doors: Vec<Door>,
    pub(super) retention: Retention,
}

/// A room of a service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct RoomPlan {
    pub(super) name: String,
    /// Folder of its results.
    pub(super) out: PathBuf,
    /// Arguments of `tracker`, without the name of the program.
    pub(super) arguments: Vec<String>,
}

/// The options of `tracker run` in a list of arguments.
pub(super) fn run_options(arguments: &[String]) -> Result<RunArgs, String> {
    let program = std::iter::once("tracker").chain(arguments.iter().map(String::as_str));
    match Arguments::try_parse_from(program).map_err(|e| in_one_line(&e))?.command {
        Command::Run(args) => Ok(*args),
        _ => Err("the arguments are not those of `tracker run`".into()),
    }
}

impl SitePlan {
    /// Reads a site's file and checks it with its rooms.
    ///
    /// # Errors
    /// Names file, table, key and mend.
    pub(super) fn read(file: &Path) -> anyhow::Result<Self> {
        let table: SiteFile = calib::files::read_toml(file)?;
        let plan = Self::of_file(&table).map_err(|problem| Error::content(file, problem.0, problem.1))?;
        plan.check_rooms(&table.door).with_context(|| file.display().to_string())?;
        Ok(plan)
    }

    /// The plan of a file's content, without a look at the rooms. The error is place and problem.
    fn of_file(file: &SiteFile) -> Result<Self, (String, String)> {
        if file.room.is_empty() {
            return Err((
                "[[room]]".into(),
                "there is none; add one with `name`, `path` and `cameras`".into(),
            ));
        }
        let mut rooms: Vec<RoomPlan> = Vec::new();
        for (i, table) in file.room.iter().enumerate() {
            let place = format!("[[room]] {} \"{}\"", i + 1, table.name);
            let plan = room_plan(file, i, table).map_err(|problem| (place.clone(), problem))?;
            if rooms.iter().any(|other| other.name == plan.name) {
                return Err((place, "`name`: another room has the same; give each its own".into()));
            }
            if let Some(other) = rooms.iter().find(|other| other.out == plan.out) {
                return Err((
                    place,
                    format!("`out`: room `{}` writes there, too; give another folder", other.name),
                ));
            }
            rooms.push(plan);
        }
        let mut doors = Vec::new();
        for (i, table) in file.door.iter().enumerate() {
            let place = format!("[[door]] {}", i + 1);
            doors.push(door(&rooms, table).map_err(|problem| (place, problem))?);
        }
        for (key, days) in [("days", file.retention.days), ("film_days", file.retention.film_days)] {
            if days == Some(0) {
                let problem = format!("`{key}`: is 0; give 1 or more, or leave it out to keep everything");
                return Err(("[retention]".into(), problem));
            }
        }
        Ok(Self { out: file.out.clone(), rooms, doors, retention: file.retention })
    }

    /// Reads the rooms: cameras and zones that the file names must be there.
    fn check_rooms(&self, doors: &[DoorTable]) -> anyhow::Result<()> {
        let mut read = BTreeMap::new();
        for (i, plan) in self.rooms.iter().enumerate() {
            let place = || format!("[[room]] {} \"{}\"", i + 1, plan.name);
            let args = run_options(&plan.arguments).map_err(anyhow::Error::msg).with_context(place)?;
            args.check().map_err(flags::named).with_context(place)?;
            let room = Room::read(&args.room).with_context(place)?;
            for camera in args.video.iter().chain(&args.masks).chain(&args.detections) {
                room.camera(&camera.name).with_context(place)?;
            }
            if args.video.is_empty() && args.masks.is_empty() && args.detections.is_empty() && !args.gathers()
            {
                bail!("{}: `cameras`: there is none; give each camera's stream or file", place());
            }
            read.insert(plan.name.as_str(), (args, room));
        }
        for (i, table) in doors.iter().enumerate() {
            for (name, zone) in table.rooms.iter().zip(&table.zones) {
                let Some((args, room)) = read.get(name.as_str()) else { continue };
                let place = format!("[[door]] {}: `zones`", i + 1);
                if !room.zones.iter().any(|known| known.name == *zone) {
                    let zones: Vec<String> = room.zones.iter().map(|z| format!("`{}`", z.name)).collect();
                    let there = if zones.is_empty() { "no zone".into() } else { zones.join(", ") };
                    bail!("{place}: room `{name}` has no zone `{zone}`; there is {there}");
                }
                if !args.events.are_on(room) {
                    bail!("{place}: room `{name}` writes no events; leave out `events = \"off\"`");
                }
            }
        }
        Ok(())
    }

    /// Folder of the site's own files.
    pub(super) fn site_out(&self) -> PathBuf {
        self.out.join(SITE)
    }

    /// The plan in words.
    pub(super) fn summary(&self) -> String {
        let each = self.rooms.iter().map(|room| format!("room {}: {}\n", room.name, room.out.display()));
        each.chain([format!("{} doors\n", self.doors.len())]).collect()
    }
}

/// A room's arguments. The error is `key: problem; mend`.
fn room_plan(file: &SiteFile, number: usize, table: &RoomTable) -> Result<RoomPlan, String> {
    let is_name = !table.name.is_empty()
        && !table.name.starts_with('.')
        && table.name != SITE
        && !table.name.contains(|c: char| c.is_control() || "/\\+#".contains(c));
    if !is_name {
        return Err(format!("`name`: names a folder; give a word without / \\ + #, and not `{SITE}`"));
    }
    let out = table.out.clone().unwrap_or_else(|| file.out.join(&table.name));
    let mut options: Options = file.run.clone();
    for (key, value) in &file.mqtt {
        let flag = if key == "url" { "mqtt".to_owned() } else { format!("mqtt-{key}") };
        options.insert(flag, value.clone());
    }
    if !file.mqtt.is_empty() {
        if !file.mqtt.contains_key("url") {
            return Err(
                "[mqtt]: `url` is missing; give the broker, as in \"mqtt://localhost:1883/shop\"".into()
            );
        }
        options.insert("mqtt-room".into(), table.name.clone().into());
    }
    let port = |first: u16| -> Result<u16, String> {
        let step = if first == 0 { 0 } else { number as u16 };
        first
            .checked_add(step)
            .ok_or_else(|| format!("port {first} leaves none for this room; give a lower one"))
    };
    if let Some(page) = file.page {
        options.insert("view".into(), true.into());
        options.insert("view-port".into(), i64::from(port(page.port)?).into());
    }
    if let Some(metrics) = file.metrics {
        let mut address = metrics.address;
        address.set_port(port(address.port())?);
        options.insert("metrics".into(), address.to_string().into());
    }
    options.extend(table.options.clone());
    let path = |path: &Path, key: &str| {
        path.to_str().map(str::to_owned).ok_or_else(|| format!("`{key}`: is no UTF-8; rename it"))
    };
    let mut all = vec!["run".to_owned(), format!("--out={}", path(&out, "out")?)];
    for (name, value) in &table.cameras {
        let camera = named(name, value).map_err(|problem| format!("`cameras.{name}`: {problem}"))?;
        all.push(format!("--video={camera}"));
    }
    all.extend(arguments(&options)?);
    // After `--`, a folder's name may begin with a hyphen.
    all.extend(["--".to_owned(), path(&table.path, "path")?]);
    run_options(&all)?;
    Ok(RoomPlan { name: table.name.clone(), out, arguments: all })
}

fn door(rooms: &[RoomPlan], table: &DoorTable) -> Result<Door, String> {
    let side = |i: usize| {
        let name = &table.rooms[i];
        let room = rooms.iter().position(|room| room.name == *name).ok_or_else(|| {
            let names: Vec<String> = rooms.iter().map(|room| format!("`{}`", room.name)).collect();
            format!("`rooms`: there is no room `{name}`; there are {}", names.join(", "))
        })?;
        Ok::<_, String>(DoorSide { room, zone: table.zones[i].clone() })
    };
    let sides = [side(0)?, side(1)?];
    if sides[0] == sides[1] {
        return Err("`zones`: both sides are the same zone; name the zone of the other room".into());
    }
    let [low_s, high_s] = table.seconds;
    // A day: longer times match everybody with everybody.
    if !(low_s.is_finite() && high_s.is_finite() && low_s <= high_s && low_s >= -60.0 && high_s <= 3600.0) {
        return Err(format!(
            "`seconds`: [{low_s}, {high_s}] is no range of passage times; give the shortest and the longest, as in [0.0, 4.0]"
        ));
    }
    Ok(Door { sides, options: DoorOptions { plausible_s: table.seconds } })
}

/// The message of an error of the command line's parser, on one line and without its advice.
fn in_one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage") && !line.starts_with("For more"));
    let words: Vec<&str> = lines.filter(|line| !line.is_empty()).collect();
    words.join(" ").trim_start_matches("error: ").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<SitePlan, String> {
        let file: SiteFile = toml::from_str(text).map_err(|e| e.to_string())?;
        SitePlan::of_file(&file).map_err(|(place, problem)| format!("{place}: {problem}"))
    }

    const ROOM: &str =
        "out = \"o\"\n[[room]]\nname = \"a\"\npath = \"rooms/a\"\ncameras = { c = \"c.mp4\" }\n";

    #[test]
    fn the_example_is_a_plan_whose_rooms_inherit_and_replace() {
        let plan = of(super::super::EXAMPLE).unwrap();
        let names: Vec<&str> = plan.rooms.iter().map(|room| room.name.as_str()).collect();
        assert_eq!((names, plan.doors.len()), (vec!["hall", "office"], 1));
        assert_eq!((plan.retention.days, plan.retention.film_days), (Some(30), Some(3)));
        let office = &plan.rooms[1];
        assert_eq!(office.out, Path::new("out/office"));
        for argument in [
            "--video=right=0",
            "--counts-every=300",
            "--mqtt=mqtt://localhost:1883/shop",
            "--mqtt-room=office",
            "--mqtt-discovery",
            "--view-port=8082",
            "--metrics=127.0.0.1:9465",
            "--most-people=8",
            "--background=left=empty-left.mp4",
            "rooms/office",
        ] {
            assert!(
                office.arguments.iter().any(|given| given == argument),
                "{argument}: {:?}",
                office.arguments
            );
        }
        let replaced = of(&(ROOM.to_owned() + "seed = 3\n[run]\nseed = 2\n")).unwrap();
        assert!(replaced.rooms[0].arguments.contains(&"--seed=3".to_owned()));
    }

    #[test]
    fn defects_are_named_with_table_key_and_mend() {
        let with = |more: &str| ROOM.to_owned() + more;
        let other = "[[room]]\nname = \"b\"\npath = \"rooms/b\"\n";
        let door = |more: &str| with(&format!("{other}[[door]]\n{more}"));
        for (text, words) in [
            ("out = \"o\"".to_owned(), ["[[room]]", "add one"]),
            (with("[[room]]\nname = \"a\"\npath = \"x\"\n"), ["[[room]] 2 \"a\"", "`name`"]),
            (with("[[room]]\nname = \"b\"\npath = \"x\"\nout = \"o/a\"\n"), ["[[room]] 2 \"b\"", "`out`"]),
            (with("[[room]]\nname = \"a/b\"\npath = \"x\"\n"), ["[[room]] 2", "folder"]),
            (with("[[room]]\nname = \"site\"\npath = \"x\"\n"), ["[[room]] 2", "`site`"]),
            (with("latency = \"slow\"\n"), ["[[room]] 1 \"a\"", "--latency"]),
            (with("most_people = 3\n"), ["[[room]] 1 \"a\"", "`most-people` meant"]),
            (with("method = \"guess\"\n"), ["[[room]] 1 \"a\"", "guess"]),
            (with("[mqtt]\ndiscovery = true\n"), ["[mqtt]", "`url` is missing"]),
            (with("[mqtt]\nurl = \"http://x\"\n"), ["--mqtt", "mqtt://host"]),
            (with("[page]\nport = 65535\n[[room]]\nname = \"b\"\npath = \"b\"\n"), ["[[room]] 2", "lower"]),
            (with("[retention]\ndays = 0\n"), ["[retention]", "`days`"]),
            (with("[retention]\nday = 3\n"), ["unknown field `day`", "expected"]),
            (with("[garden]\n"), ["unknown field `garden`", "expected"]),
            (
                door("rooms = [\"a\", \"c\"]\nzones = [\"x\", \"y\"]\nseconds = [0, 1]\n"),
                ["[[door]] 1", "`a`, `b`"],
            ),
            (
                door("rooms = [\"a\", \"a\"]\nzones = [\"x\", \"x\"]\nseconds = [0, 1]\n"),
                ["[[door]] 1", "same zone"],
            ),
            (
                door("rooms = [\"a\", \"b\"]\nzones = [\"x\", \"y\"]\nseconds = [4, 1]\n"),
                ["[[door]] 1", "`seconds`"],
            ),
        ] {
            let line = of(&text).unwrap_err();
            assert!(words.iter().all(|word| line.contains(word)), "{words:?}: {line}");
        }
    }
}
