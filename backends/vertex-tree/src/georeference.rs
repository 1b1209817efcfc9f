//! Where a mesh lies in the world.

/// Places the 32-bit positions of a mesh in world coordinates, which are f64.
///
/// Files, trees and the engine's arithmetic are relative to [`origin`](Self::origin); cameras, paths and whatever is
/// written for others speak world coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Georeference {
    /// World coordinates of a vertex are this plus its position. All 0 where 32 bits hold the world coordinates exactly.
    pub origin: [f64; 3],
    /// Name of the coordinate system of the world coordinates as the input gives it, as in `EPSG:25832`; empty where nobody
    /// says.
    pub coordinate_system: String,
    /// Where heights over longitudes and latitudes have been laid on a plane, how.
    pub degrees: Option<DegreeMap>,
    /// What 32 bits have cost.
    pub rounding: Rounding,
}

/// How far the 32-bit positions lie from the coordinates of the input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rounding {
    /// The largest difference of a coordinate, in world units; 0 where nothing was rounded.
    pub largest_move: f64,
    /// The median length of the edges of triangles, in world units, within a hundredth of it; 0 where nothing was rounded or
    /// there is no edge.
    pub median_edge: f64,
}

impl Rounding {
    /// The largest move as a share of the median edge; `None` where nothing was rounded.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        (self.largest_move > 0.0).then(|| self.largest_move / self.median_edge)
    }
}

/// An equirectangular map of degrees to metres, x to the east and y to the north:
/// `x = (longitude - self.longitude) * metres_per_degree[0]`, `y = (latitude - self.latitude) * metres_per_degree[1]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DegreeMap {
    /// East longitude, in degrees, of world coordinate x = 0. Longitudes are taken within 180 degrees of it.
    pub longitude: f64,
    /// North latitude, in degrees, of world coordinate y = 0.
    pub latitude: f64,
    /// Metres a degree of longitude and of latitude.
    pub metres_per_degree: [f64; 2],
}

impl Georeference {
    /// No coordinate of an origin, or of a camera, is larger: the squares of their sums are finite.
    pub const FARTHEST: f64 = 1e150;

    /// The world coordinates of a position.
    #[must_use]
    pub fn world(&self, position: [f32; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| self.origin[axis] + f64::from(position[axis]))
    }

    /// World coordinates relative to the origin, as the engine computes with them.
    #[must_use]
    pub fn local(&self, world: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| world[axis] - self.origin[axis])
    }

    /// What there is to say about it, as name and value: nothing where it is the default.
    #[must_use]
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        if *self == Self::default() {
            return Vec::new();
        }
        let [x, y, z] = self.origin;
        let mut facts = vec![("origin", format!("{x} {y} {z}"))];
        if !self.coordinate_system.is_empty() {
            facts.push(("coordinate system", self.coordinate_system.clone()));
        }
        if let Some(DegreeMap { longitude, latitude, metres_per_degree: [a, b] }) = self.degrees {
            facts.push(("degrees", format!("from {longitude} {latitude}, {a} {b} metres each")));
        }
        if self.rounding != Rounding::default() {
            facts.push(("largest move", self.rounding.largest_move.to_string()));
            if let Some(share) = self.rounding.share() {
                facts.push(("of the median edge", format!("{share:.1e}")));
            }
            facts.push(("median edge", self.rounding.median_edge.to_string()));
        }
        facts
    }
}
