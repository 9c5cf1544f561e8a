//! Place of a room on Earth: WGS 84 from the room's metres.
//!
//! The floor is the plane that touches the ellipsoid at the room's origin, with its axes turned from east and north by the
//! heading. A point of it goes to Earth-centred coordinates, and from there to latitude and longitude: exact but for the
//! plane's rise above the ellipsoid, 1 mm at 100 m.

use nalgebra::{Point2, Vector3};
use serde::{Deserialize, Serialize};

/// Semi-major axis of the WGS 84 ellipsoid, metres…
const A_M: f64 = 6_378_137.0;
/// …and its flattening.
const F: f64 = 1.0 / 298.257_223_563;
/// Square of its eccentricity.
const E2: f64 = F * (2.0 - F);
/// Largest latitude: near the poles east and north turn within a room.
const LARGEST_LATITUDE_DEG: f64 = 89.9;

/// Place of a room's origin on Earth, and the direction of its axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Geo {
    /// Latitude of the origin, degrees, north positive.
    pub latitude: f64,
    /// Longitude of the origin, degrees, east positive.
    pub longitude: f64,
    /// Direction of the x axis, degrees clockwise from true north: in a reconstructed room where the first
    /// camera looks, unless control points give the axes.
    pub heading: f64,
}

impl Geo {
    /// Defect for which the place is unusable.
    pub(super) fn defect(&self) -> Option<String> {
        let within = |value: f64, most: f64| value.abs() <= most;
        if !within(self.latitude, LARGEST_LATITUDE_DEG) {
            let problem = "give degrees from -89.9 to 89.9, north positive";
            return Some(format!("latitude is {}; {problem}", self.latitude));
        }
        if !within(self.longitude, 180.0) {
            return Some(format!(
                "longitude is {}; give degrees from -180 to 180, east positive",
                self.longitude
            ));
        }
        if !within(self.heading, 360.0) {
            let problem = "give the direction of the room's x axis, degrees clockwise from north";
            return Some(format!("heading is {}; {problem}", self.heading));
        }
        None
    }

    /// Longitude and latitude of a place on the floor, degrees, in the order of `GeoJSON`.
    pub fn longitude_latitude(&self, place: &Point2<f64>) -> [f64; 2] {
        let (sin_heading, cos_heading) = self.heading.to_radians().sin_cos();
        // The y axis is 90° counter-clockwise from the x axis, seen from above.
        let east = place.x * sin_heading - place.y * cos_heading;
        let north = place.x * cos_heading + place.y * sin_heading;
        let (latitude, longitude) = (self.latitude.to_radians(), self.longitude.to_radians());
        let (sin_lat, cos_lat) = latitude.sin_cos();
        let (sin_lon, cos_lon) = longitude.sin_cos();
        let normal_m = A_M / (1.0 - E2 * sin_lat * sin_lat).sqrt();
        let origin = Vector3::new(
            normal_m * cos_lat * cos_lon,
            normal_m * cos_lat * sin_lon,
            normal_m * (1.0 - E2) * sin_lat,
        );
        let east_axis = Vector3::new(-sin_lon, cos_lon, 0.0);
        let north_axis = Vector3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat);
        geodetic_deg(&(origin + east_axis * east + north_axis * north))
    }
}

/// Longitude and latitude of a point near the ellipsoid, degrees (Bowring 1976; one step is exact to 1e-12 rad there).
fn geodetic_deg(point: &Vector3<f64>) -> [f64; 2] {
    let minor_m = A_M * (1.0 - F);
    let from_axis_m = point.x.hypot(point.y);
    let (sin, cos) = (point.z * A_M).atan2(from_axis_m * minor_m).sin_cos();
    let second_e2 = E2 / (1.0 - E2);
    let latitude = (point.z + second_e2 * minor_m * sin.powi(3)).atan2(from_axis_m - E2 * A_M * cos.powi(3));
    [point.y.atan2(point.x).to_degrees(), latitude.to_degrees()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Length of the geodesic between two places, metres, and its direction at the first, degrees clockwise from north:
    /// Vincenty's inverse solution (Survey Review 23, 1975, equations 11 to 21).
    fn vincenty([lon1, lat1]: [f64; 2], [lon2, lat2]: [f64; 2]) -> (f64, f64) {
        let b = A_M * (1.0 - F);
        let reduced = |lat: f64| ((1.0 - F) * lat.to_radians().tan()).atan();
        let (u1, u2) = (reduced(lat1), reduced(lat2));
        let difference = (lon2 - lon1).to_radians();
        let mut lambda = difference;
        for _ in 0..100 {
            let (sin_l, cos_l) = lambda.sin_cos();
            let cross = u1.cos() * u2.sin() - u1.sin() * u2.cos() * cos_l;
            let sin_sigma = (u2.cos() * sin_l).hypot(cross);
            let cos_sigma = u1.sin() * u2.sin() + u1.cos() * u2.cos() * cos_l;
            let sigma = sin_sigma.atan2(cos_sigma);
            let sin_alpha = u1.cos() * u2.cos() * sin_l / sin_sigma;
            let cos2_alpha = 1.0 - sin_alpha * sin_alpha;
            let cos_2m =
                if cos2_alpha > 1e-12 { cos_sigma - 2.0 * u1.sin() * u2.sin() / cos2_alpha } else { 0.0 };
            let c = F / 16.0 * cos2_alpha * (4.0 + F * (4.0 - 3.0 * cos2_alpha));
            let inner = cos_2m + c * cos_sigma * (2.0 * cos_2m * cos_2m - 1.0);
            let next = difference + (1.0 - c) * F * sin_alpha * (sigma + c * sin_sigma * inner);
            if (next - lambda).abs() < 1e-15 {
                let u_squared = cos2_alpha * (A_M * A_M - b * b) / (b * b);
                let a_term = 1.0
                    + u_squared / 16384.0
                        * (4096.0 + u_squared * (-768.0 + u_squared * (320.0 - 175.0 * u_squared)));
                let b_term = u_squared / 1024.0
                    * (256.0 + u_squared * (-128.0 + u_squared * (74.0 - 47.0 * u_squared)));
                let cubic = b_term / 6.0
                    * cos_2m
                    * (4.0 * sin_sigma * sin_sigma - 3.0)
                    * (4.0 * cos_2m * cos_2m - 3.0);
                let correction = b_term
                    * sin_sigma
                    * (cos_2m + b_term / 4.0 * (cos_sigma * (2.0 * cos_2m * cos_2m - 1.0) - cubic));
                let azimuth = (u2.cos() * sin_l).atan2(cross).to_degrees();
                return (b * a_term * (sigma - correction), azimuth);
            }
            lambda = next;
        }
        panic!("Vincenty's iteration does not converge");
    }

    #[test]
    fn the_reference_solution_gives_a_published_distance() {
        // Flinders Peak to Buninyon, Geoscience Australia's test line: 54 972.271 m, 306° 52′ 05.37″ (GRS 80, whose
        // flattening differs in the ninth digit).
        let flinders = [144.424_867_89, -37.951_033_416_7];
        let buninyon = [143.926_495_53, -37.652_821_138_9];
        let (distance_m, azimuth_deg) = vincenty(flinders, buninyon);
        assert!((distance_m - 54_972.271).abs() < 2e-3, "{distance_m}");
        assert!((azimuth_deg + 360.0 - 306.868_158).abs() < 1e-5, "{azimuth_deg}");
    }

    #[test]
    fn axes_point_where_the_heading_says() {
        let at = |heading: f64, x: f64, y: f64| {
            let geo = Geo { latitude: 52.0, longitude: 13.0, heading };
            let [longitude, latitude] = geo.longitude_latitude(&Point2::new(x, y));
            [longitude - 13.0, latitude - 52.0]
        };
        let [east, north] = at(0.0, 10.0, 0.0);
        assert!(east.abs() < 1e-12 && north > 8e-5, "x is north: {east} {north}");
        let [east, north] = at(0.0, 0.0, 10.0);
        assert!(east < -1e-4 && north.abs() < 1e-9, "then y is west: {east} {north}");
        let [east, north] = at(90.0, 10.0, 0.0);
        assert!(east > 1e-4 && north.abs() < 1e-9, "x is east: {east} {north}");
    }

    proptest! {
        /// Distances and directions of the room are those of the geodesic on the ellipsoid.
        #[test]
        fn metres_stay_metres(
            latitude in -80.0..80.0_f64,
            longitude in -179.9..179.9_f64,
            heading in -360.0..360.0_f64,
            distance_m in 1.0..100.0_f64,
            direction_deg in 0.0..360.0_f64,
        ) {
            let geo = Geo { latitude, longitude, heading };
            let (sin, cos) = direction_deg.to_radians().sin_cos();
            let place = geo.longitude_latitude(&Point2::new(distance_m * cos, distance_m * sin));
            let (found_m, azimuth_deg) = vincenty([longitude, latitude], place);
            // An angle in double precision is 1e-9 m at the Equator, and 1e-14 of 180° 2e-8 m.
            prop_assert!((found_m - distance_m).abs() < 1e-6 * distance_m, "{} for {}", found_m, distance_m);
            // Counter-clockwise from the x axis.
            let turned = (azimuth_deg - (heading - direction_deg)).rem_euclid(360.0);
            prop_assert!(turned.min(360.0 - turned) < 1e-4, "{}", turned);
            let back = geo.longitude_latitude(&Point2::origin());
            prop_assert!((back[0] - longitude).abs() < 1e-12 && (back[1] - latitude).abs() < 1e-12);
        }
    }

    #[test]
    fn unusable_places_are_named_with_the_mend() {
        let good = Geo { latitude: -33.9, longitude: 151.2, heading: 370.0 - 360.0 };
        assert_eq!(good.defect(), None);
        for (bad, words) in [
            (Geo { latitude: 90.0, ..good }, "latitude is 90"),
            (Geo { latitude: f64::NAN, ..good }, "latitude is NaN"),
            (Geo { longitude: 181.0, ..good }, "longitude is 181"),
            (Geo { heading: f64::INFINITY, ..good }, "clockwise from north"),
        ] {
            assert!(bad.defect().unwrap().contains(words), "{bad:?}");
        }
    }
}
