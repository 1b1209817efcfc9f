//! How the values of arguments are read. An error says what is expected.

use std::ops::Range;
use std::time::Duration;

use mt_partition::CacheMode;

use crate::experiment::compare::Loading;
use crate::experiment::store::Backend;
use construction::simplify::LEAST_MEMORY;
use selection::budget::WorkCap;
use selection::refine::Strategy;

pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("a number above 0 is expected".to_owned()),
    }
}

/// Frames a second, so many that their time can be told from none.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    match positive(text) {
        Ok(rate @ ..=1e6) => Ok(rate),
        _ => Err("a number above 0, at most 1000000, is expected".to_owned()),
    }
}

/// A number of bytes, or of units of 2^10, 2^20 or 2^30 bytes with the letter K, M or G.
pub(super) fn size(text: &str) -> Result<u64, String> {
    match parse_size::Config::new().with_binary().parse_size(text) {
        Ok(bytes @ 1..) => Ok(bytes),
        _ => Err("a size such as 256M, 1G or a number of bytes is expected".to_owned()),
    }
}

/// Memory to build within.
pub(super) fn memory(text: &str) -> Result<u64, String> {
    match size(text)? {
        bytes @ LEAST_MEMORY.. => Ok(bytes),
        _ => Err(format!("at least {}K is expected", LEAST_MEMORY >> 10)),
    }
}

pub(super) fn strategy(text: &str) -> Result<Strategy, String> {
    Strategy::ALL
        .into_iter()
        .find(|s| s.name() == text)
        .ok_or_else(|| format!("one of {} is expected", Strategy::ALL.map(Strategy::name).join(", ")))
}

/// `A..B`, either of which may be missing.
pub(super) fn frames(text: &str) -> Result<Range<usize>, String> {
    let expected = || "frames A..B with A less than B are expected".to_owned();
    let (a, b) = text.split_once("..").ok_or_else(expected)?;
    let bound = |text: &str, default| if text.is_empty() { Ok(default) } else { text.parse() };
    let range = bound(a, 0).map_err(|_| expected())?..bound(b, usize::MAX).map_err(|_| expected())?;
    if range.is_empty() { Err(expected()) } else { Ok(range) }
}

/// A number with a unit such as s, ms or us. Times can be added up: none is longer than some thirty years.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    match humantime::parse_duration(text) {
        Ok(time) if !time.is_zero() && time.as_secs() < 1_000_000_000 => Ok(time),
        _ => Err("a time such as 5ms, 0.01s or 500us is expected".to_owned()),
    }
}

pub(super) fn backend(text: &str) -> Result<Backend, String> {
    let names = || format!("one of {} is expected", Backend::ALL.map(Backend::name).join(", "));
    Backend::ALL.into_iter().find(|b| b.name() == text).ok_or_else(names)
}

pub(super) fn prefetch(text: &str) -> Result<Loading, String> {
    let names = || format!("one of {} is expected", Loading::ALL.map(Loading::name).join(", "));
    Loading::ALL.into_iter().find(|prefetch| prefetch.name() == text).ok_or_else(names)
}

pub(super) fn cache(text: &str) -> Result<CacheMode, String> {
    let names = || format!("one of {} is expected", CacheMode::ALL.map(CacheMode::name).join(", "));
    CacheMode::ALL.into_iter().find(|mode| mode.name() == text).ok_or_else(names)
}

/// A number of changes, or a time.
pub(super) fn work_cap(text: &str) -> Result<WorkCap, String> {
    let expected = |_| "a number of changes, or a time such as 200us, is expected".to_owned();
    match text.parse() {
        Ok(changes) => Ok(WorkCap::Changes(changes)),
        Err(_) => duration(text).map(WorkCap::Time).map_err(expected),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_documented() {
        assert_eq!(size("4096"), Ok(4096));
        assert_eq!((size("64K"), size("256M"), size("1G")), (Ok(64 << 10), Ok(256 << 20), Ok(1 << 30)));
        for wrong in ["", "0", "M", "-1", "+3K", "0.1", "99999999999G", "64Q"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
        assert_eq!((memory("64K"), memory("1")), (Ok(64 << 10), Err("at least 64K is expected".to_owned())));
        assert_eq!(frames("3..7"), Ok(3..7));
        assert_eq!(frames("..7"), Ok(0..7));
        assert!(frames("7..3").is_err());
        assert!(frames("3").is_err());
        assert_eq!(duration("5ms"), Ok(Duration::from_millis(5)));
        assert_eq!(duration("0.5s"), Ok(Duration::from_millis(500)));
        for wrong in ["", "5", "ms", "0s", "-1s", "inf", "5sms", "1000000000s", "99999999999999999999s"] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
        assert_eq!(work_cap("100"), Ok(WorkCap::Changes(100)));
        assert_eq!(work_cap("200us"), Ok(WorkCap::Time(Duration::from_micros(200))));
        assert!(work_cap("-1").is_err());
        assert_eq!(backend("meta-node"), Ok(Backend::MetaNode));
        assert_eq!(cache("p-cc"), Ok(CacheMode::PCc));
        assert!(positive("NaN").is_err());
        assert_eq!((rate("0.1"), rate("1e6"), rate("1e300").is_err()), (Ok(0.1), Ok(1e6), true));
        assert_eq!(strategy("event"), Ok(Strategy::Event));
        assert!(strategy("best").is_err());
    }
}
