//! Where the samples of a GeoTIFF are: OGC 19-008r4, "OGC GeoTIFF standard", 2019, and GDAL's own tags.

use container::DegreeMap;

use super::hgt::METRES_PER_DEGREE;
use super::raster::Location;

/// The tags, empty where there are none.
#[derive(Debug, Default)]
pub(super) struct GeoTags {
    /// Spacing of columns and rows.
    pub pixel_scale: Vec<f64>,
    /// Column, row, 0, x, y, z of a point; perhaps of several.
    pub tie_points: Vec<f64>,
    /// A matrix of four rows that makes x, y, z, 1 of column, row, 0, 1.
    pub transformation: Vec<f64>,
    /// For each key its number, where its value is, how many there are, and the value or its place.
    pub keys: Vec<u16>,
    pub doubles: Vec<f64>,
    pub ascii: String,
    /// GDAL's, in XML.
    pub metadata: String,
}

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const CITATION: u16 = 1026;
const GEODETIC_SYSTEM: u16 = 2048;
const GEODETIC_CITATION: u16 = 2049;
const ANGULAR_UNITS: u16 = 2054;
const PROJECTED_SYSTEM: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_SYSTEM: u16 = 4096;
const VERTICAL_UNITS: u16 = 4099;

const MODEL_GEOGRAPHIC: u16 = 2;
const SAMPLES_ARE_POINTS: u16 = 2;
const USER_DEFINED: u16 = 32767;
const ASCII_PARAMETERS: u16 = 34737;
const DOUBLE_PARAMETERS: u16 = 34736;

const METRE: u16 = 9001;
const FOOT: u16 = 9002;
const US_SURVEY_FOOT: u16 = 9003;

/// Where the samples of a map of so many columns and rows are, in metres, or what is not known of it.
#[expect(clippy::disallowed_methods, reason = "input, before there is anything to select")]
pub(super) fn locate(tags: &GeoTags, size: [u32; 2]) -> Result<Location, String> {
    let is_geographic = match tags.code(MODEL_TYPE) {
        Some(model) => model == MODEL_GEOGRAPHIC,
        None => tags.code(GEODETIC_SYSTEM).is_some() && tags.code(PROJECTED_SYSTEM).is_none(),
    };
    let system = if is_geographic { GEODETIC_SYSTEM } else { PROJECTED_SYSTEM };
    let citation = if is_geographic { GEODETIC_CITATION } else { PROJECTED_CITATION };
    let coordinate_system = match tags.code(system) {
        Some(code @ 1..USER_DEFINED) => format!("EPSG:{code}"),
        _ => tags.text(citation).or_else(|| tags.text(CITATION)).unwrap_or_default(),
    };
    let heights = tags.heights()?;
    let mut location = Location { steps: tags.steps(), heights, coordinate_system, degrees: None };
    let Some(steps) = &mut location.steps else { return Ok(location) };
    if !is_geographic {
        let unit = tags.linear_unit()?;
        steps.as_flattened_mut().iter_mut().for_each(|step| *step *= unit);
        return Ok(location);
    }
    let unit = tags.angular_unit()?;
    let middle = tags.middle(size).map(|middle| middle.map(|x| x * unit));
    let latitude = middle.map_or(0.0, |[_, latitude]| latitude);
    let narrowing = latitude.to_radians().cos();
    if latitude.abs() >= 90.0 || latitude.is_nan() {
        return Err(format!("the middle of the map is at a latitude of {latitude} degrees"));
    }
    if let Some([longitude, _]) = middle.filter(|[longitude, _]| !longitude.is_finite()) {
        return Err(format!("the middle of the map is at a longitude of {longitude} degrees"));
    }
    for step in steps {
        *step = [step[0] * unit * METRES_PER_DEGREE * narrowing, step[1] * unit * METRES_PER_DEGREE];
    }
    location.degrees = middle.map(|[longitude, latitude]| DegreeMap {
        longitude: (longitude + 180.0).rem_euclid(360.0) - 180.0,
        latitude,
        metres_per_degree: [METRES_PER_DEGREE * narrowing, METRES_PER_DEGREE],
    });
    Ok(location)
}

impl GeoTags {
    /// The entry of a key: where its value is, how many there are, and the value or its place.
    fn key(&self, number: u16) -> Option<[u16; 3]> {
        // The first entry is a header.
        let mut entries = self.keys.chunks_exact(4).skip(1);
        entries.find(|entry| entry[0] == number).map(|entry| [entry[1], entry[2], entry[3]])
    }

    /// The value of a key that is a number.
    fn code(&self, key: u16) -> Option<u16> {
        self.key(key).filter(|entry| entry[0] == 0).map(|entry| entry[2])
    }

    fn double(&self, key: u16) -> Option<f64> {
        let [_, _, at] = self.key(key).filter(|entry| entry[0] == DOUBLE_PARAMETERS)?;
        self.doubles.get(usize::from(at)).copied()
    }

    fn text(&self, key: u16) -> Option<String> {
        let [_, count, at] = self.key(key).filter(|entry| entry[0] == ASCII_PARAMETERS)?;
        let text = self.ascii.get(usize::from(at)..)?;
        let text = text.get(..usize::from(count)).unwrap_or(text);
        // Texts end with a bar.
        let text = text.trim_end_matches('\0').trim_end_matches('|').trim();
        Some(text.split_whitespace().collect::<Vec<_>>().join(" ")).filter(|text| !text.is_empty())
    }

    /// From column to column and from row to row, in the unit of the map.
    fn steps(&self) -> Option<[[f64; 2]; 2]> {
        let scaled = match self.pixel_scale[..] {
            // Some write that rows run to the south twice.
            [x, y, ..] => Some([[x.abs(), 0.0], [0.0, -y.abs()]]),
            _ => None,
        };
        let transformed = match self.transformation[..] {
            [xc, xr, _, _, yc, yr, ..] => Some([[xc, yc], [xr, yr]]),
            _ => None,
        };
        let is_right = |[[xc, yc], [xr, yr]]: &[[f64; 2]; 2]| {
            let area = xc * yr - xr * yc;
            area.is_finite() && area != 0.0
        };
        scaled.filter(is_right).or(transformed.filter(is_right))
    }

    /// The middle, in the unit of the map.
    fn middle(&self, size: [u32; 2]) -> Option<[f64; 2]> {
        let points = self.code(RASTER_TYPE) == Some(SAMPLES_ARE_POINTS);
        let [column, row] = size.map(|count| f64::from(count - u32::from(points)) / 2.0);
        match (&self.pixel_scale[..], &self.tie_points[..], &self.transformation[..]) {
            ([x, y, ..], [at_column, at_row, _, at_x, at_y, ..], _) if *x != 0.0 && *y != 0.0 => {
                Some([at_x + (column - at_column) * x.abs(), at_y - (row - at_row) * y.abs()])
            }
            (_, _, [xc, xr, _, x, yc, yr, _, y, ..]) => {
                Some([xc * column + xr * row + x, yc * column + yr * row + y])
            }
            _ => None,
        }
    }

    /// Metres in the horizontal unit of a projected system.
    fn linear_unit(&self) -> Result<f64, String> {
        match self.code(LINEAR_UNITS) {
            Some(USER_DEFINED) => {
                let size = self.double(LINEAR_UNIT_SIZE).filter(|size| *size > 0.0 && size.is_finite());
                size.ok_or_else(|| "a unit of length without a size".to_owned())
            }
            Some(0) | None => {
                // Names of systems in feet say so in the end.
                let name = self.text(PROJECTED_CITATION).or_else(|| self.text(CITATION)).unwrap_or_default();
                Ok(match name {
                    name if name.contains("(ftUS)") => metres(US_SURVEY_FOOT),
                    name if name.contains("(ft)") => metres(FOOT),
                    _ => None,
                }
                .unwrap_or(1.0))
            }
            Some(code) => metres(code).ok_or_else(|| format!("unit of length EPSG:{code}")),
        }
    }

    /// Degrees in the unit of longitude and latitude.
    fn angular_unit(&self) -> Result<f64, String> {
        match self.code(ANGULAR_UNITS) {
            None | Some(0 | USER_DEFINED | 9102 | 9122) => Ok(1.0),
            Some(9101) => Ok(1_f64.to_degrees()),
            Some(9103) => Ok(1.0 / 60.0),
            Some(9104) => Ok(1.0 / 3600.0),
            Some(9105 | 9106) => Ok(0.9),
            Some(code) => Err(format!("unit of angle EPSG:{code}")),
        }
    }

    /// Factor and offset that make metres of samples, unless nothing is said.
    fn heights(&self) -> Result<Option<[f64; 2]>, String> {
        let unit = match (self.code(VERTICAL_UNITS), self.code(VERTICAL_SYSTEM)) {
            (Some(code @ 1..USER_DEFINED), _) => {
                Some(metres(code).ok_or_else(|| format!("unit of height EPSG:{code}"))?)
            }
            // The levels of North America that are measured in feet.
            (_, Some(5702 | 6358 | 6360)) => metres(US_SURVEY_FOOT),
            (_, Some(6359 | 8228)) => metres(FOOT),
            _ => match metadata_item(&self.metadata, "unittype") {
                Some(name) => Some(metres_by_name(name).ok_or_else(|| format!("unit of height {name:?}"))?),
                None => None,
            },
        };
        let number = |role| match metadata_item(&self.metadata, role) {
            None => Ok(None),
            Some(text) => match text.parse() {
                Ok(number) if f64::is_finite(number) => Ok(Some(number)),
                _ => Err(format!("{role} {text:?} of heights")),
            },
        };
        let (scale, offset) = (number("scale")?, number("offset")?);
        if unit.is_none() && scale.is_none() && offset.is_none() {
            return Ok(None);
        }
        let unit = unit.unwrap_or(1.0);
        Ok(Some([scale.unwrap_or(1.0) * unit, offset.unwrap_or(0.0) * unit]))
    }
}

/// Metres in a unit of length by its number in the EPSG registry.
fn metres(code: u16) -> Option<f64> {
    Some(match code {
        METRE => 1.0,
        FOOT => 0.3048,
        US_SURVEY_FOOT => 12.0 / 39.37,
        9005 => 0.304_797_265_4,
        9014 => 1.8288,
        9030 => 1852.0,
        9036 => 1000.0,
        9093 => 1609.344,
        9096 => 0.9144,
        1025 => 0.001,
        1033 => 0.01,
        _ => return None,
    })
}

/// Metres in a unit of length as GDAL names it.
fn metres_by_name(name: &str) -> Option<f64> {
    let code = match name.to_ascii_lowercase().as_str() {
        "" | "m" | "metre" | "metres" | "meter" | "meters" => METRE,
        "ft" | "foot" | "feet" | "international foot" | "international feet" => FOOT,
        "us-ft" | "ftus" | "us_survey_foot" | "us survey foot" | "us survey feet" | "sfoot" | "sft"
        | "u.s. survey foot" | "foot_us" => US_SURVEY_FOOT,
        "km" | "kilometre" | "kilometer" => 9036,
        "cm" | "centimetre" | "centimeter" => 1033,
        "mm" | "millimetre" | "millimeter" => 1025,
        _ => return None,
    };
    metres(code)
}

/// The text of an item with a role in `<GDALMetadata>`, if it is for the first channel or all of them.
fn metadata_item<'t>(xml: &'t str, role: &str) -> Option<&'t str> {
    xml.split("<Item").skip(1).find_map(|item| {
        let (attributes, rest) = item.split_once('>')?;
        let attribute = |name: &str| {
            let (_, value) = attributes.split_once(&format!(" {name}="))?;
            let quote = value.chars().next().filter(|c| ['"', '\''].contains(c))?;
            value[1..].split(quote).next()
        };
        let is_meant = attribute("role") == Some(role) && attribute("sample").is_none_or(|s| s == "0");
        is_meant.then(|| rest.split('<').next().unwrap_or("").trim())
    })
}
