//! Degrees on the earth into metres on a plane.

use std::f64::consts::PI;

use container::DegreeMap;
use glam::DVec3;

use super::error::ImportError;
use crate::experiment::path::format::Line;

/// Metres of the radius of a sphere with the earth's volume.
const EARTH_RADIUS: f64 = 6_371_008.8;

/// Where latitudes and longitudes come to lie.
pub(super) enum Plane {
    /// On one that touches the first sample. A trajectory goes on where it crosses 180 degrees of longitude.
    AtFirst(Option<Start>),
    /// Where a mesh lies; longitudes are taken within 180 degrees of its map's.
    OfMesh(DegreeMap),
}

#[derive(Clone, Copy)]
pub(super) struct Start {
    latitude: f64,
    /// Of the sample before.
    longitude: f64,
    /// Of the first sample.
    from: f64,
    /// Degrees to add to longitudes: once around for each time that 180 degrees were crossed.
    turned: f64,
}

impl Plane {
    /// x to the east, y to the north, and the height as it is, in metres.
    pub fn position(
        &mut self,
        at: Line,
        [latitude, longitude, height]: [f64; 3],
    ) -> Result<DVec3, ImportError> {
        for (name, value, limit) in [("latitude", latitude, 90.0), ("longitude", longitude, 360.0)] {
            if value.abs() > limit {
                return Err(ImportError::Degrees { file: at.file.to_owned(), line: at.line, name, value });
            }
        }
        Ok(match self {
            Self::AtFirst(start) => {
                let from = longitude;
                let start = start.get_or_insert(Start { latitude, longitude, from, turned: 0.0 });
                let step = longitude - start.longitude;
                start.turned -= turn(step);
                start.longitude = longitude;
                let metres = EARTH_RADIUS * PI / 180.0;
                let east = longitude + start.turned - start.from;
                let x = east * metres * libm::cos(start.latitude.to_radians());
                DVec3::new(x, (latitude - start.latitude) * metres, height)
            }
            Self::OfMesh(map) => {
                let [x, y] = map.metres_per_degree;
                let east = short_way(longitude - map.longitude);
                DVec3::new(east * x, (latitude - map.latitude) * y, height)
            }
        })
    }
}

/// The whole turns in a difference of longitudes, so that the rest is at most half of one; in degrees.
fn turn(degrees: f64) -> f64 {
    if degrees.abs() <= 180.0 { 0.0 } else { 360.0 * (degrees / 360.0).round() }
}

/// A difference of longitudes the shorter way around.
fn short_way(degrees: f64) -> f64 {
    degrees - turn(degrees)
}

#[cfg(test)]
mod tests {
    use std::path::Path as FilePath;

    use super::*;

    #[test]
    fn longitudes_go_on_across_180() {
        let at = Line { file: FilePath::new("t"), line: 7 };
        for there in [
            [179.5, -179.5, -178.5, -179.5, 179.0],
            [-179.5, 179.5, 178.5, 179.5, -179.0],
            [359.5, 0.5, 1.5, 0.5, 359.0],
        ] {
            let mut plane = Plane::AtFirst(None);
            let east = if there[0] > 0.0 { 1.0 } else { -1.0 };
            for (longitude, degrees) in there.into_iter().zip([0.0, 1.0, 2.0, 1.0, -0.5]) {
                let position = plane.position(at, [0.0, longitude, 5.0]).unwrap();
                assert!((position.x / (EARTH_RADIUS * PI / 180.0) - east * degrees).abs() < 1e-9);
            }
        }
        let map = DegreeMap { longitude: -179.0, latitude: 51.0, metres_per_degree: [10.0, 20.0] };
        let position = Plane::OfMesh(map).position(at, [52.0, 179.0, 3.0]).unwrap();
        assert_eq!(position, DVec3::new(-20.0, 20.0, 3.0));
        let error = Plane::AtFirst(None).position(at, [91.0, 0.0, 0.0]).unwrap_err();
        assert_eq!(error.to_string(), "t:7: 91.0 is no latitude in degrees");
    }
}
