//! What the name of a column says.

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Time,
    /// Also to the east, to the north, and up.
    X,
    Y,
    Z,
    Latitude,
    Longitude,
    /// Above some sea, where it is not called z.
    Height,
    Qx,
    Qy,
    Qz,
    Qw,
    /// Roll, pitch or yaw.
    Attitude,
}

impl Role {
    /// Which factor a unit has, to seconds, metres or degrees. `None` for what is no such unit.
    pub fn factor(self, unit: &str) -> Option<f64> {
        Some(match (self, unit) {
            (_, "") => 1.0,
            (Self::Time, "s" | "sec" | "secs" | "second" | "seconds") => 1.0,
            (Self::Time, "ms" | "msec" | "msecs" | "millis" | "millisecond" | "milliseconds") => 1e3,
            (
                Self::Time,
                "us" | "µs" | "μs" | "usec" | "usecs" | "micros" | "microsecond" | "microseconds",
            ) => 1e6,
            (Self::Time, "ns" | "nsec" | "nsecs" | "nanos" | "nanosecond" | "nanoseconds") => 1e9,
            (Self::X | Self::Y | Self::Z | Self::Height, unit) => match unit {
                "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
                "mm" => 1e-3,
                "cm" => 1e-2,
                "km" => 1e3,
                "ft" | "feet" => 0.3048,
                _ => return None,
            },
            (Self::Latitude | Self::Longitude, "deg" | "degs" | "degree" | "degrees" | "°") => 1.0,
            (Self::Latitude | Self::Longitude, "rad" | "radian" | "radians") => 180.0 / std::f64::consts::PI,
            (Self::Qx | Self::Qy | Self::Qz | Self::Qw | Self::Attitude, _) => 1.0,
            _ => return None,
        })
    }
}

/// A column's name, taken apart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Name {
    pub text: String,
    pub role: Option<Role>,
    /// Of several names with a role the one of lowest rank has it: 0 for plain ones.
    pub rank: u8,
    /// As it is written behind the name: in brackets, or as its last part.
    pub unit: String,
}

/// What says that an axis is of something else than the place or the rotation.
const OTHER: &str = "a acc accel acceleration agl angular b bias cov covariance d delta dev dir direction err error \
    forward ground gyro home linear look lookat mag omega rate ref rel relative scale setpoint sigma \
    speed std stddev takeoff target twist v var variance vel velocity";
const ROTATION: &str = "q quat quaternion orientation ori orient rot rotation att attitude";
const PLACE: &str = "t p pos position trans translation loc location point coord eye";
/// What says nothing.
const FRAME: &str = "pose camera cam enu local utm world odom map body base robot";
const CLOCK: &str = "t time timestamp timestamps times stamp";
const CLOCK_TOO: &str =
    "clock elapsed epoch field gps header posix ros system unix utc since start of day sensor image frame";
const HEIGHT: &str = "alt altitude height hgt ele elev elevation";
const UNITS: &str = "s sec secs seconds ms msec millis milliseconds us usec micros microseconds ns nsec nanos nanoseconds \
    m meters metres mm cm km ft feet deg degrees rad radians";

fn listed(list: &str, word: &str) -> bool {
    list.split(' ').any(|listed| listed == word)
}

impl Name {
    /// `text` is the name with its unit in brackets, if any.
    pub fn new(text: &str) -> Self {
        let (name, bracket) = text.split_once(['[', '(']).unwrap_or((text, ""));
        let mut words = words(name);
        let mut unit = bracket.trim_end_matches([']', ')']).trim().to_lowercase();
        if words.len() > 1 && unit.is_empty() && words.last().is_some_and(|word| listed(UNITS, word)) {
            unit = words.pop().unwrap_or_default();
        }
        // What stands in round brackets may also be a remark, such as `(MSL)` or `(UTC)`; a time in minutes has none.
        let role = role(&words);
        let remark = text.contains('(')
            && role.is_none_or(|(role, _)| {
                role.factor(&unit).is_none() && (role != Role::Time || listed(CLOCK_TOO, &unit))
            });
        if matches!(unit.as_str(), "-" | "1") || remark {
            unit.clear();
        }
        // A column that is called by its unit.
        if let [word] = words.as_slice()
            && role.is_none()
            && word != "s"
            && Role::Time.factor(word).is_some()
        {
            return Self { text: text.to_owned(), role: Some(Role::Time), rank: 1, unit: word.clone() };
        }
        let (role, rank) = role.map_or((None, 0), |(role, rank)| (Some(role), rank));
        Self { text: text.to_owned(), role, rank, unit }
    }
}

/// `pose.positionX` is `pose position x`.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut lower = false;
    for c in name.chars() {
        if (!c.is_alphanumeric() || (lower && c.is_uppercase()))
            && words.last().is_some_and(|w| !w.is_empty())
        {
            words.push(String::new());
        }
        lower = c.is_lowercase();
        if let (true, Some(word)) = (c.is_alphanumeric(), words.last_mut()) {
            word.extend(c.to_lowercase());
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

fn role(words: &[String]) -> Option<(Role, u8)> {
    let any = |list| words.iter().any(|word| listed(list, word));
    let [.., last] = words else { return None };
    let last = last.as_str();
    let plain = u8::from(words.len() > 1);
    if words.iter().all(|word| listed(CLOCK, word) || listed(CLOCK_TOO, word)) {
        let said = any(CLOCK) || any("epoch elapsed clock");
        return said.then_some((Role::Time, plain));
    }
    if any("roll pitch yaw") && !any(OTHER) {
        return Some((Role::Attitude, plain));
    }
    if any(OTHER) {
        return None;
    }
    if any("lat latitude") || last.ends_with("latitude") {
        return Some((Role::Latitude, plain));
    }
    if any("lon lng long longitude") || last.ends_with("longitude") {
        return Some((Role::Longitude, plain));
    }
    if any(HEIGHT) || last.ends_with("altitude") {
        return Some((Role::Height, plain));
    }
    match last {
        "east" | "easting" => return Some((Role::X, plain)),
        "north" | "northing" => return Some((Role::Y, plain)),
        "up" => return Some((Role::Z, plain)),
        _ => {}
    }
    axis(words)
}

/// `x`, `tx`, `pos_x`, `x_pos`, `qx`, `q_RS_x`, `pose.orientation.x`.
fn axis(words: &[String]) -> Option<(Role, u8)> {
    let is_axis = |word: &str| matches!(word, "x" | "y" | "z" | "w");
    let [first, .., last] = words else {
        let word = words.first()?.as_str();
        if is_axis(word) {
            return of_axis(word, false).map(|role| (role, 0));
        }
        let at = word.char_indices().next_back()?.0;
        let (prefix, axis) = word.split_at(at);
        let rotation = listed(ROTATION, prefix);
        return (rotation || listed(PLACE, prefix))
            .then(|| of_axis(axis, rotation))
            .flatten()
            .map(|role| (role, 0));
    };
    let (axis, rest) = match (is_axis(last), is_axis(first)) {
        (true, _) => (last.as_str(), &words[..words.len() - 1]),
        (false, true) => (first.as_str(), &words[1..]),
        // `field.pose.qx` and the like.
        _ => {
            return axis(std::slice::from_ref(last))
                .filter(|(role, _)| *role != Role::Time)
                .map(|(role, _)| (role, 1));
        }
    };
    let any = |list| rest.iter().any(|word| listed(list, word));
    let rotation = any(ROTATION);
    let known = rotation || any(PLACE) || rest.iter().all(|word| listed(FRAME, word));
    known.then(|| of_axis(axis, rotation)).flatten().map(|role| (role, u8::from(rest.len() > 1)))
}

fn of_axis(axis: &str, rotation: bool) -> Option<Role> {
    Some(match (axis, rotation) {
        ("x", false) => Role::X,
        ("y", false) => Role::Y,
        ("z", false) => Role::Z,
        ("x", true) => Role::Qx,
        ("y", true) => Role::Qy,
        ("z", true) => Role::Qz,
        ("w", true) => Role::Qw,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_loggers_are_known() {
        let cases: &[(&[&str], Option<Role>, &str)] = &[
            (
                &["t", "time", "Time", "TIMESTAMP", "stamp", "time_stamp", "field.header.stamp", "unixTime"],
                Some(Role::Time),
                "",
            ),
            (
                &["timestamp[ns]", "timestamp (ns)", "t_ns", "time_ns", "ns", "timestampNs"],
                Some(Role::Time),
                "ns",
            ),
            (
                &[
                    "x",
                    "tx",
                    "px",
                    "pos_x",
                    "posX",
                    "x_pos",
                    "position.x",
                    "p_RS_R_x",
                    "field.pose.pose.position.x",
                    "east",
                    "Easting",
                ],
                Some(Role::X),
                "",
            ),
            (&["x[m]", "p_RS_R_x [m]", "east_m", "pos_x_m"], Some(Role::X), "m"),
            (
                &[
                    "qw",
                    "q_w",
                    "QW",
                    "quat_w",
                    "q_RS_w",
                    "rot_w",
                    "orientation.w",
                    "q_w []",
                    "quatW",
                    "qw [-]",
                ],
                Some(Role::Qw),
                "",
            ),
            (&["lat", "Latitude", "gps_lat", "LATITUDE (N)", "GPSLatitude"], Some(Role::Latitude), ""),
            (&["lat_deg", "latitude [deg]"], Some(Role::Latitude), "deg"),
            (&["lon", "lng", "long", "Longitude"], Some(Role::Longitude), ""),
            (&["alt", "altitude", "height", "ele", "alt_gps"], Some(Role::Height), ""),
            (&["alt_gps_m", "altitude(m)"], Some(Role::Height), "m"),
            (&["roll", "Yaw"], Some(Role::Attitude), ""),
            (
                &[
                    "v_RS_R_x [m s^-1]",
                    "b_w_RS_S_x [rad s^-1]",
                    "b_a_RS_S_z [m s^-2]",
                    "vx",
                    "linear_acceleration.x",
                    "w",
                    "seq",
                    "target_x",
                    "index",
                    "s",
                    "pos_std_x",
                    "frame_id",
                    "relative_altitude",
                    "",
                ],
                None,
                "",
            ),
        ];
        for (names, role, unit) in cases {
            for text in *names {
                let name = Name::new(text);
                assert_eq!(name.role, *role, "{text}");
                assert!(role.is_none() || name.unit == *unit, "{text}: {name:?}");
            }
        }
    }
}
