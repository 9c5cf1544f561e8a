//! Passage of a person through the exit zones, which tells on which side of a door the person is.

use nalgebra::Vector2;

/// Distance between the places of entering and leaving a zone from which on the person went through it, metres.
const THROUGH_M: f64 = 0.5;
/// Time in sight after which a person beyond a zone is somewhere in the room after all, seconds.
const SEEN_S: f64 = 5.0;

/// State of a person's passage through zones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Passage {
    /// In the room.
    Room,
    /// In a zone, entered at this place from the room.
    LeavingZone(Vector2<f64>),
    /// In a zone, entered at this place from beyond it, or appeared there.
    ReturningZone(Vector2<f64>),
    /// Beyond a zone, in sight for so long since, seconds.
    Beyond(f64),
}

impl Passage {
    /// Passage of a person who appeared at a place.
    pub(super) fn new(place: Vector2<f64>, is_in_zone: bool) -> Self {
        if is_in_zone { Self::ReturningZone(place) } else { Self::Room }
    }

    /// Updates the passage of a person in sight, who is at this place `dt_s` seconds later.
    pub(super) fn follow(&mut self, place: Vector2<f64>, is_in_zone: bool, dt_s: f64) {
        let is_through = |entered: Vector2<f64>| (place - entered).norm() >= THROUGH_M;
        *self = match (*self, is_in_zone) {
            (Self::Room, true) => Self::LeavingZone(place),
            (Self::Beyond(_), true) => Self::ReturningZone(place),
            (Self::LeavingZone(entered), false) if is_through(entered) => Self::Beyond(0.0),
            (Self::ReturningZone(entered), false) if !is_through(entered) => Self::Beyond(0.0),
            (Self::LeavingZone(_) | Self::ReturningZone(_), false) => Self::Room,
            (Self::Beyond(seen_s), false) if seen_s + dt_s > SEEN_S => Self::Room,
            (Self::Beyond(seen_s), false) => Self::Beyond(seen_s + dt_s),
            (same, _) => same,
        };
    }

    /// Whether the person went through a zone, or is on the way.
    pub(super) fn is_leaving(self) -> bool {
        matches!(self, Self::LeavingZone(_) | Self::Beyond(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Follows a way along x through the zone from 5 to 6, in steps of 0.1 s.
    fn along(start_x_m: f64, way_m: &[f64]) -> Passage {
        let is_in_zone = |x_m: f64| (5.0..6.0).contains(&x_m);
        let mut passage = Passage::new(Vector2::new(start_x_m, 1.0), is_in_zone(start_x_m));
        for x_m in way_m {
            passage.follow(Vector2::new(*x_m, 1.0), is_in_zone(*x_m), 0.1);
        }
        passage
    }

    #[test]
    fn crossing_a_zone_from_the_room_leads_beyond_it() {
        assert!(along(4.0, &[4.5, 5.1, 5.6, 5.9, 6.2, 7.0]).is_leaving());
        // The person steps back over the zone's border for a moment.
        assert!(along(4.0, &[4.5, 5.1, 5.6, 6.1, 5.9, 6.2, 7.0]).is_leaving());
    }

    #[test]
    fn turning_in_a_zone_or_coming_in_through_it_leads_into_the_room() {
        assert_eq!(along(4.0, &[4.5, 5.1, 5.6, 5.2, 4.9]), Passage::Room);
        assert_eq!(along(5.9, &[5.5, 5.1, 4.9]), Passage::Room);
        assert_eq!(along(5.9, &[6.1, 5.8, 5.5, 5.1, 4.9]), Passage::Room);
        assert_eq!(along(4.0, &[5.1, 5.9, 6.5, 5.9, 5.1, 4.0]), Passage::Room);
    }

    #[test]
    fn a_person_who_is_seen_long_enough_beyond_a_zone_is_in_the_room() {
        let way: Vec<f64> = [5.1, 5.9].into_iter().chain(std::iter::repeat_n(6.5, 60)).collect();
        assert_eq!(along(4.0, &way), Passage::Room);
    }
}
