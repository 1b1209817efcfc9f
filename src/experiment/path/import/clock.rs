//! Times of any unit, as exactly as they are written.

use std::path::Path as FilePath;

use super::error::{ImportError, Warning};
use crate::experiment::path::PathError;
use crate::experiment::path::format::Line;
use crate::experiment::path::shown::{beginning, few};

/// A reading of a clock. Nanoseconds since 1970 have more digits than an f64.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    whole: i128,
    /// The rest of it, with the same sign.
    part: f64,
}

/// The clock of a trajectory. Units are counted as so many to a second.
pub(super) struct Clock<'a> {
    at: Line<'a>,
    first: Reading,
    first_text: &'a str,
    latest: Reading,
    /// Differences to the first reading, in the clock's unit.
    elapsed: Vec<f64>,
    /// Whether all readings are written without a point.
    whole: bool,
}

/// A second clock stands below this until the year 5138.
const LARGEST_SECONDS: f64 = 1e11;
/// Clocks of other units, where nothing says theirs, are those that count from 1970 and stand in the years 1973 to 2286.
const EPOCH: [f64; 2] = [1e8, 1e10];
/// The year 2000: beyond it hardly a clock that counts from when a machine was started is taken for one from 1970.
const RECENT: f64 = 9.4e8;
/// Seconds between samples: least where the header says the unit, most of a clock that might be another, and most of one
/// that stands beyond 2000.
const CLOSEST: f64 = 1e-6;
const CLOSE: f64 = 10.0;
const FAR: f64 = 3600.0;
/// Seconds between samples from which clocks of seconds are in doubt: where positions on earth are recorded, which is
/// done ten times a second at most, and elsewhere. Beyond the last no whole numbers are taken for seconds.
const DOUBTFUL_ON_EARTH: f64 = 100.0;
const DOUBTFUL: f64 = 10.0;
const ABSURD: f64 = 1e4;

impl<'a> Clock<'a> {
    /// Starts with the first time of a file.
    pub fn new(at: Line<'a>, text: &'a str) -> Result<Self, PathError> {
        let first = reading(at, text)?;
        Ok(Self { at, first, first_text: text, latest: first, elapsed: vec![0.0], whole: is_whole(text) })
    }

    /// The next time, which must be later.
    pub fn read(&mut self, at: Line, text: &str) -> Result<(), PathError> {
        let now = reading(at, text)?;
        let elapsed = difference(now, self.first);
        if self.elapsed.last().is_some_and(|&last| elapsed <= last) {
            let (file, line) = (at.file.to_owned(), at.line);
            return Err(PathError::Time { file, line, time: value(now), previous: value(self.latest) });
        }
        self.latest = now;
        self.elapsed.push(elapsed);
        self.whole &= is_whole(text);
        Ok(())
    }

    /// The first time, and those since, in seconds. `said` is the unit of the header, if it has one; `on_earth`
    /// says that positions are in degrees.
    pub fn seconds(
        mut self,
        file: &FilePath,
        said: Option<f64>,
        on_earth: bool,
        warn: &mut dyn FnMut(Warning),
    ) -> Result<(f64, Vec<f64>), ImportError> {
        let step = median_step(&self.elapsed);
        let largest = value(self.first).abs().max(value(self.latest).abs());
        let unclear = |reason: String| ImportError::Clock {
            file: file.to_owned(),
            line: self.at.line,
            value: beginning(self.first_text),
            reason,
        };
        const ASK: &str = "a header can say the unit, as in `# t[ms] x y z`";
        let unit = match said {
            Some(unit) if largest / unit >= LARGEST_SECONDS => {
                return Err(unclear(format!(
                    "can not be in the unit of the header: no clock stands at {:e} s",
                    largest / unit
                )));
            }
            Some(unit) if step / unit < CLOSEST => {
                let step = step / unit;
                return Err(unclear(format!(
                    "can not be in the unit of the header, with {step:e} s from sample to sample"
                )));
            }
            Some(unit) => unit,
            None if largest < LARGEST_SECONDS => {
                if self.whole && step >= ABSURD {
                    return Err(unclear(format!(
                        "can not be in seconds, with {} from sample to sample: {ASK}",
                        few(step)
                    )));
                }
                if step >= if on_earth { DOUBTFUL_ON_EARTH } else { DOUBTFUL } {
                    warn(Warning::Seconds { file: file.to_owned(), step });
                }
                1.0
            }
            None => {
                let stands = |unit: &f64| {
                    let [now, step] = [largest / unit, step / unit];
                    (EPOCH[0]..EPOCH[1]).contains(&now) && step <= if now > RECENT { FAR } else { CLOSE }
                };
                [1e3, 1e6, 1e9].into_iter().find(stands).ok_or_else(|| {
                    unclear(format!(
                        "is too large for seconds, and no time since 1970 in ms, us or ns with {} from sample to sample: {ASK}",
                        few(step)
                    ))
                })?
            }
        };
        for elapsed in &mut self.elapsed {
            *elapsed /= unit;
        }
        Ok((value(self.first) / unit, self.elapsed))
    }
}

fn reading(at: Line, text: &str) -> Result<Reading, PathError> {
    let number = at.number(text)?;
    let (whole, part) = text.split_once('.').unwrap_or((text, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let exact = whole.parse::<i128>().ok().filter(|_| digits(part)).and_then(|whole| {
        let part: f64 = format!("0.{part}0").parse().ok()?;
        Some(Reading { whole, part: if text.starts_with('-') { -part } else { part } })
    });
    // A number beyond all integers is no time, which its size tells later.
    Ok(exact.unwrap_or(Reading { whole: number.trunc() as i128, part: number.fract() }))
}

fn is_whole(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}

fn difference(a: Reading, b: Reading) -> f64 {
    a.whole.saturating_sub(b.whole) as f64 + (a.part - b.part)
}

fn value(reading: Reading) -> f64 {
    reading.whole as f64 + reading.part
}

fn median_step(elapsed: &[f64]) -> f64 {
    let mut steps: Vec<f64> = elapsed.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(times: &[&str], said: Option<f64>) -> (Result<(f64, Vec<f64>), String>, usize) {
        let file = FilePath::new("t");
        let at = Line { file, line: 1 };
        let mut clock = Clock::new(at, times[0]).unwrap();
        for time in &times[1..] {
            clock.read(at, time).unwrap();
        }
        let mut warnings = 0;
        let found =
            clock.seconds(file, said, false, &mut |_| warnings += 1).map_err(|error| error.to_string());
        (found, warnings)
    }

    #[test]
    fn units_are_told_by_size() {
        for (times, start) in [
            (["1403636579763", "1403636579863"], 1_403_636_579.763),
            (["1403636579763555", "1403636579863555"], 1_403_636_579.763_555),
            (["1403636579763555584", "1403636579863555584"], 1_403_636_579.763_555_6),
            (["1403636579.763555584", "1403636579.863555584"], 1_403_636_579.763_555_6),
            (["1.4e9", "1400000000.1"], 1.4e9),
            (["-0.05", "0.05"], -0.05),
            (["0", "0.1"], 0.0),
        ] {
            let (found, warnings) = seconds(&times, None);
            let (first, elapsed) = found.unwrap();
            assert!((first - start).abs() < 1e-6 && warnings == 0, "{times:?}: {first}");
            assert!((elapsed[1] - 0.1).abs() < 1e-15, "{times:?}: {elapsed:?}");
        }
        assert_eq!(seconds(&["5", "5.25"], Some(1e3)).0.unwrap(), (0.005, vec![0.0, 0.000_25]));
    }

    #[test]
    fn what_can_not_be_told_is_said() {
        for (times, said, reason) in [
            (["0", "100000000"], None, "t:1: the time 0 can not be in seconds, with 100000000 from"),
            (
                ["50000000000000", "50000000000100"],
                None,
                "t:1: the time 50000000000000 is too large for seconds",
            ),
            (["1e30", "2e30"], None, "too large"),
            (["1403636579.7", "1403636579.8"], Some(1e9), "1e-10 s from sample to sample"),
            (["1403636579763", "1403636579863"], Some(1.0), "can not be in the unit of the header"),
            // Three weeks of microseconds, or a day in 2029 with a sample each half hour?
            (["500000000000000", "500000100000000"], None, "no time since 1970"),
        ] {
            let error = seconds(&times, said).0.unwrap_err();
            assert!(error.contains(reason), "{times:?}: {error}");
        }
        assert_eq!(seconds(&["0", "33"], None).1, 1);
        assert_eq!(seconds(&["0", "33"], Some(1.0)).1, 0);
    }
}
