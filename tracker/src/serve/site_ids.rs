//! Site-wide ids of the people of several rooms: whoever walks through a shared door keeps theirs.

use std::collections::BTreeMap;

use serde::Serialize;

use super::door_matcher::{DoorMatcher, DoorOptions, Looks, Passage};
use crate::TrackId;
use crate::events::{Event, EventKind};

/// Time after a disappearance until which it may be taken back, seconds.
const REMEMBERED_S: f64 = 60.0;

/// A person in one room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PersonKey {
    /// Number of the room.
    pub room: usize,
    /// The room's id.
    pub id: TrackId,
}

/// A zone that is one side of a door.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DoorSide {
    /// Number of the room.
    pub room: usize,
    /// Name of the zone.
    pub zone: String,
}

/// A door that two rooms share.
#[derive(Debug, Clone, PartialEq)]
pub struct Door {
    /// Its two sides.
    pub sides: [DoorSide; 2],
    /// Times of its passages.
    pub options: DoorOptions,
}

/// A row of the site's `people.jsonl`: from now on the person of a room is this one of the site.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SitePerson<'a> {
    /// Time of the appearance, seconds since 1970.
    pub t: f64,
    /// Id in the site.
    pub site_id: u32,
    /// Name of the room.
    pub room: &'a str,
    /// Id in the room.
    pub id: TrackId,
}

/// Ids of all people of a site.
#[derive(Debug, Clone)]
pub struct SiteIds {
    doors: Vec<Door>,
    /// Passages of each door, from its first side to its second, and back.
    matchers: Vec<[DoorMatcher<PersonKey>; 2]>,
    people: BTreeMap<PersonKey, Resident>,
    next_id: u32,
}

#[derive(Debug, Clone, Default)]
struct Resident {
    appeared_s: f64,
    /// `None` while it is not decided whether they came through a door.
    site_id: Option<u32>,
    looks: Looks,
    /// Time of the report of the disappearance, seconds.
    gone_s: Option<f64>,
    /// The person as whom somebody else came into another room, if this one has really gone.
    went_on_as: Option<PersonKey>,
}

/// A decided id.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Named {
    /// The person.
    pub person: PersonKey,
    /// Id in the site.
    pub site_id: u32,
    /// Time of the appearance, seconds since 1970.
    pub appeared_s: f64,
}

impl SiteIds {
    /// Ids from `next_id` on, of rooms with these doors.
    pub fn new(doors: Vec<Door>, next_id: u32) -> Self {
        let matchers = doors.iter().map(|door| [(); 2].map(|()| DoorMatcher::new(door.options))).collect();
        Self { doors, matchers, people: BTreeMap::new(), next_id }
    }

    /// Id of a person, if it is decided.
    pub fn of(&self, person: PersonKey) -> Option<u32> {
        self.people.get(&person)?.site_id
    }

    /// Whether a person's id is still to be decided.
    pub fn is_pending(&self, person: PersonKey) -> bool {
        self.people.get(&person).is_some_and(|resident| resident.site_id.is_none())
    }

    /// Everybody of a room is gone, for the program that followed them has ended.
    pub fn lose_room(&mut self, room: usize, now_s: f64) {
        for (_, resident) in self.people.iter_mut().filter(|(person, _)| person.room == room) {
            resident.gone_s.get_or_insert(now_s);
        }
    }

    /// Takes the present height of a person, metres.
    pub fn see(&mut self, person: PersonKey, height_m: f64) {
        if let Some(resident) = self.people.get_mut(&person) {
            resident.looks.height_m = Some(height_m);
        }
    }

    /// Takes an event of a room, which happened at `time_s` and is reported at `now_s`, both seconds since 1970. Returns
    /// the ids that are decided by it.
    pub fn take(&mut self, room: usize, event: &Event, time_s: f64, now_s: f64) -> Vec<Named> {
        let Some(id) = event.id else { return Vec::new() };
        let (person, zone) = (PersonKey { room, id }, event.place.as_deref());
        match (event.kind, event.revoked) {
            (EventKind::Appear, _) => self.appear(person, zone, time_s),
            (EventKind::Disappear, _) => {
                self.disappear(person, zone, time_s, now_s);
                Vec::new()
            }
            (EventKind::Revoke, Some(EventKind::Disappear)) => self.stay(person),
            _ => Vec::new(),
        }
    }

    /// Decides who came through doors, as far as that is known at a time, seconds since 1970.
    pub fn advance(&mut self, now_s: f64) -> Vec<Named> {
        let mut named = Vec::new();
        for door in 0..self.doors.len() {
            for direction in 0..2 {
                let people = &self.people;
                let looks = |person| people.get(&person).map(|p| p.looks.clone()).unwrap_or_default();
                let passages = self.matchers[door][direction].decide(now_s, looks);
                for Passage { arrived, departed } in passages {
                    named.extend(self.name(arrived, departed));
                }
            }
        }
        self.people.retain(|_, resident| resident.gone_s.is_none_or(|gone_s| now_s - gone_s < REMEMBERED_S));
        named
    }

    fn appear(&mut self, person: PersonKey, zone: Option<&str>, time_s: f64) -> Vec<Named> {
        self.people.insert(person, Resident { appeared_s: time_s, ..Resident::default() });
        let mut is_pending = false;
        for (door, direction) in self.entered(person.room, zone) {
            self.matchers[door][direction].arrive(person, time_s);
            is_pending = true;
        }
        if is_pending { Vec::new() } else { self.name(person, None).into_iter().collect() }
    }

    fn disappear(&mut self, person: PersonKey, zone: Option<&str>, time_s: f64, now_s: f64) {
        let Some(resident) = self.people.get_mut(&person) else { return };
        resident.gone_s = Some(now_s);
        // A departure through this side of the door can only match an arrival at the other side: the other direction.
        for (door, direction) in self.entered(person.room, zone) {
            self.matchers[door][1 - direction].depart(person, time_s);
        }
    }

    /// Somebody had not gone. If they were taken for somebody in another room, that one gets an id of their own.
    fn stay(&mut self, person: PersonKey) -> Vec<Named> {
        for matchers in &mut self.matchers {
            for matcher in matchers {
                matcher.revoke(person);
            }
        }
        let Some(resident) = self.people.get_mut(&person) else { return Vec::new() };
        resident.gone_s = None;
        let Some(other) = resident.went_on_as.take() else { return Vec::new() };
        let Some(other_resident) = self.people.get_mut(&other) else { return Vec::new() };
        other_resident.site_id = None;
        self.name(other, None).into_iter().collect()
    }

    /// Doors with this side, each with the direction of those who come in there.
    fn entered(&self, room: usize, zone: Option<&str>) -> Vec<(usize, usize)> {
        let Some(zone) = zone else { return Vec::new() };
        let is_side = |side: &DoorSide| side.room == room && side.zone == zone;
        let of_door = |(door, Door { sides, .. }): (usize, &Door)| {
            // From the first side to the second is direction 0.
            let directions = [is_side(&sides[1]).then_some(0), is_side(&sides[0]).then_some(1)];
            directions.into_iter().flatten().map(move |direction| (door, direction)).collect::<Vec<_>>()
        };
        self.doors.iter().enumerate().flat_map(of_door).collect()
    }

    /// Gives a person the id of the one who departed, or a new one; `None` where another door has decided already.
    fn name(&mut self, person: PersonKey, departed: Option<PersonKey>) -> Option<Named> {
        let is_undecided = self.matchers.iter().flatten().any(|matcher| matcher.awaits(person));
        let resident = self.people.get(&person).filter(|resident| resident.site_id.is_none())?;
        let appeared_s = resident.appeared_s;
        let earlier = departed.and_then(|departed| self.people.get_mut(&departed));
        let inherited = earlier.and_then(|earlier| {
            earlier.went_on_as = Some(person);
            earlier.site_id
        });
        if inherited.is_none() && is_undecided {
            // Another door leads here from another room.
            return None;
        }
        let site_id = inherited.unwrap_or_else(|| {
            self.next_id = self.next_id.saturating_add(1);
            self.next_id - 1
        });
        self.people.get_mut(&person)?.site_id = Some(site_id);
        Some(Named { person, site_id, appeared_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doors() -> Vec<Door> {
        let side = |room, zone: &str| DoorSide { room, zone: zone.into() };
        let options = DoorOptions { plausible_s: [0.0, 4.0] };
        vec![Door { sides: [side(0, "east"), side(1, "door")], options }]
    }

    fn event(kind: EventKind, id: u32, zone: Option<&str>) -> Event {
        let text = format!("{{\"time\":0.0,\"frame\":1,\"kind\":\"appear\",\"where\":null,\"id\":{id}}}");
        Event { kind, place: zone.map(str::to_owned), ..serde_json::from_str(&text).unwrap() }
    }

    fn person(room: usize, id: u32) -> PersonKey {
        PersonKey { room, id: TrackId(id) }
    }

    fn ids(named: &[Named]) -> Vec<(usize, u32, u32)> {
        named.iter().map(|n| (n.person.room, n.person.id.0, n.site_id)).collect()
    }

    #[test]
    fn who_walks_to_and_fro_keeps_one_id_and_others_get_their_own() {
        use EventKind::{Appear, Disappear};
        let mut site = SiteIds::new(doors(), 1);
        let take = |site: &mut SiteIds, room, event: &Event, time_s: f64| {
            let mut named = site.take(room, event, time_s, time_s);
            named.extend(site.advance(time_s + 10.0));
            ids(&named)
        };
        assert_eq!(take(&mut site, 0, &event(Appear, 4, None), 100.0), [(0, 4, 1)]);
        assert_eq!(take(&mut site, 0, &event(Disappear, 4, Some("east")), 150.0), []);
        assert_eq!(take(&mut site, 1, &event(Appear, 9, Some("door")), 152.0), [(1, 9, 1)]);
        // A stranger at the same door, long after.
        assert_eq!(take(&mut site, 1, &event(Appear, 10, Some("door")), 200.0), [(1, 10, 2)]);
        assert_eq!(take(&mut site, 1, &event(Disappear, 9, Some("door")), 300.0), []);
        assert_eq!(take(&mut site, 0, &event(Appear, 5, Some("east")), 301.0), [(0, 5, 1)]);
        // Through another zone nobody comes from the other room.
        assert_eq!(take(&mut site, 1, &event(Disappear, 10, Some("street")), 400.0), []);
        assert_eq!(take(&mut site, 0, &event(Appear, 6, Some("east")), 401.0), [(0, 6, 3)]);
        // Out and in again through the same side is no passage.
        assert_eq!(take(&mut site, 0, &event(Disappear, 6, Some("east")), 500.0), []);
        assert_eq!(take(&mut site, 0, &event(Appear, 7, Some("east")), 501.0), [(0, 7, 4)]);
    }

    #[test]
    fn somebody_who_had_not_gone_keeps_their_id_and_the_other_gets_a_new_one() {
        let mut site = SiteIds::new(doors(), 7);
        site.take(0, &event(EventKind::Appear, 1, None), 100.0, 100.0);
        site.take(0, &event(EventKind::Disappear, 1, Some("east")), 110.0, 112.0);
        site.take(1, &event(EventKind::Appear, 1, Some("door")), 111.0, 111.5);
        assert!(site.is_pending(person(1, 1)));
        assert_eq!(ids(&site.advance(120.0)), [(1, 1, 7)]);
        let back = event(EventKind::Disappear, 1, Some("east")).revocation();
        assert_eq!(ids(&site.take(0, &back, 110.0, 125.0)), [(1, 1, 8)]);
        assert_eq!((site.of(person(0, 1)), site.of(person(1, 1))), (Some(7), Some(8)));
        // Before the decision, too.
        site.take(0, &event(EventKind::Disappear, 1, Some("east")), 200.0, 202.0);
        site.take(0, &back, 200.0, 202.5);
        site.take(1, &event(EventKind::Appear, 2, Some("door")), 201.0, 201.5);
        assert_eq!(ids(&site.advance(220.0)), [(1, 2, 9)]);
        // The memory does not grow with those who have gone.
        site.take(1, &event(EventKind::Disappear, 2, None), 230.0, 232.0);
        site.advance(1000.0);
        assert_eq!(site.people.len(), 2);
    }
}
