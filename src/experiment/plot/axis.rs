//! Ranges and ticks of the axes, and what is made of a series before it is drawn.
//!
//! By hand for now, as the page of the report is: both will be made anew together.

/// Parts of a thousand of a series' values that may lie above the axis (and below, if it is logarithmic).
const CLIPPED: usize = 2;
/// Ticks on an axis, at most.
const MOST_TICKS: f64 = 8.0;

/// An axis in its own coordinates: numbers of frames, values, or logarithms of values.
pub(super) struct Axis {
    pub(super) ends: [f64; 2],
    /// Where they are, and what they say.
    pub(super) ticks: Vec<(f64, String)>,
    logarithmic: bool,
}

impl Axis {
    /// `count` frames from `first` on.
    pub(super) fn frames(first: usize, count: usize) -> Self {
        let ends = [first as f64, (first + count.max(2) - 1) as f64];
        let step = nice_step(ends[1] - ends[0]).max(1.0);
        Self { ends, ticks: even_ticks(ends, step), logarithmic: false }
    }

    /// The values of some series, save the most extreme ones of each.
    pub(super) fn values(series: &[&[f64]], logarithmic: bool) -> Self {
        let shown = |v: f64| v.is_finite() && (!logarithmic || v > 0.0);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for values in series {
            let mut sorted: Vec<f64> = values.iter().copied().filter(|&v| shown(v)).collect();
            sorted.sort_unstable_by(f64::total_cmp);
            let clipped = sorted.len() * CLIPPED / 1000;
            if let (Some(lo), Some(hi)) = (sorted.get(clipped), sorted.iter().rev().nth(clipped)) {
                range = [range[0].min(*lo), range[1].max(*hi)];
            }
        }
        if range[0] > range[1] {
            range = [1.0, 1.0];
        }
        if logarithmic { Self::logarithmic(range) } else { Self::linear(range) }
    }

    /// From 0, or below if there are values below, to a little above the highest.
    fn linear([lo, hi]: [f64; 2]) -> Self {
        let (lo, hi) = (lo.min(0.0), hi.max(0.0));
        let span = if hi > lo { hi - lo } else { 1.0 };
        let ends = [if lo < 0.0 { lo - 0.06 * span } else { 0.0 }, lo + 1.06 * span];
        Self { ends, ticks: even_ticks(ends, nice_step(ends[1] - ends[0])), logarithmic: false }
    }

    /// By decimal logarithms, over at least an eighth of a decade.
    fn logarithmic(range: [f64; 2]) -> Self {
        let [lo, hi] = range.map(f64::log10);
        let pad = (0.05 * (hi - lo)).max(0.0625);
        let ends = [lo - pad, hi + pad];
        // All of 1, 2 and 5 in each decade, then 1 alone, then every second, third, … power.
        let decades = (ends[0].floor() as i32..=ends[1].floor() as i32).collect::<Vec<_>>();
        let ticks_of = |digits: &[f64], every: usize| {
            let powers = decades.iter().copied().filter(|p| p.rem_euclid(every as i32) == 0);
            let ticks = powers.flat_map(|power| digits.iter().map(move |digit| digit * 10f64.powi(power)));
            ticks
                .map(|value| (value.log10(), label(value, value)))
                .filter(|&(at, _)| (ends[0]..=ends[1]).contains(&at))
                .collect::<Vec<_>>()
        };
        let fine = ticks_of(&[1.0, 2.0, 5.0], 1);
        let ticks = match fine.len() {
            0..3 => even_ticks(
                ends.map(|end| 10f64.powf(end)),
                nice_step(10f64.powf(ends[1]) - 10f64.powf(ends[0])),
            )
            .into_iter()
            .filter_map(|(value, label)| (value > 0.0).then(|| (value.log10(), label)))
            .collect(),
            _ if fine.len() as f64 <= 1.5 * MOST_TICKS => fine,
            _ => ticks_of(&[1.0], decades.len().div_ceil(MOST_TICKS as usize)),
        };
        Self { ends, ticks, logarithmic: true }
    }

    /// The coordinate of a value; not finite if it has none.
    pub(super) fn place(&self, value: f64) -> f64 {
        match self.logarithmic {
            true if value > 0.0 => value.log10(),
            true => f64::NAN,
            false => value,
        }
    }
}

/// The least step of the form 1, 2 or 5 times a power of ten that takes at most [`MOST_TICKS`] to go `span` far.
fn nice_step(span: f64) -> f64 {
    let least = span / MOST_TICKS;
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0].map(|digit| digit * power).into_iter().find(|&step| step >= least).unwrap_or(10.0 * power)
}

/// The multiples of `step` between two ends. None for a step so small, or a range so odd, that they would not end.
fn even_ticks([lo, hi]: [f64; 2], step: f64) -> Vec<(f64, String)> {
    let (first, last) = ((lo / step).ceil(), (hi / step).floor());
    let count = last - first + 1.0;
    if !(0.0..1000.0).contains(&count) {
        return Vec::new();
    }
    (0..count as u32)
        .map(|i| {
            let at = (first + f64::from(i)) * step;
            (at, label(at, step))
        })
        .collect()
}

/// A number with the decimals that a step of this size needs; in scientific notation where that would be long.
fn label(value: f64, step: f64) -> String {
    // A step like 0.2 may come out a little smaller than it should be.
    let decimals = -(step * 1.000_001).abs().log10().floor();
    match decimals {
        _ if value == 0.0 => "0".to_owned(),
        ..-6.0 => format!("{value:e}"),
        ..=0.0 => format!("{value:.0}"),
        0.0..=6.0 => format!("{value:.*}", decimals as usize),
        _ => format!("{value:.1e}"),
    }
}

/// The stretches of a series without gaps (values that are not finite), as frames and values. If there are more than
/// `points` values in each of the `columns`, only the lowest and the highest of each column are kept, in their order.
pub(super) fn outline(values: &[f64], columns: usize, points: usize) -> Vec<Vec<(usize, f64)>> {
    let width = values.len().div_ceil(columns.max(1));
    let frames: Vec<(usize, f64)> = values.iter().copied().enumerate().collect();
    frames
        .split(|(_, value)| !value.is_finite())
        .filter(|stretch| !stretch.is_empty())
        .map(|stretch| {
            if width <= points {
                return stretch.to_vec();
            }
            stretch
                .chunk_by(|a, b| a.0 / width == b.0 / width)
                .flat_map(|column| {
                    let by_value = |a: &&(usize, f64), b: &&(usize, f64)| a.1.total_cmp(&b.1);
                    let extremes = [column.iter().min_by(by_value), column.iter().max_by(by_value)];
                    let mut kept: Vec<(usize, f64)> = extremes.into_iter().flatten().copied().collect();
                    kept.sort_unstable_by_key(|&(frame, _)| frame);
                    kept.dedup();
                    kept
                })
                .collect()
        })
        .collect()
}

/// For each value, the median of those at most half a window away. Gaps stay gaps, and do not count.
pub(super) fn moving_median(values: &[f64], window: usize) -> Vec<f64> {
    let reach = window / 2;
    let mut near = Vec::new();
    (0..values.len())
        .map(|i| {
            if !values[i].is_finite() {
                return f64::NAN;
            }
            let around = &values[i.saturating_sub(reach)..values.len().min(i.saturating_add(reach + 1))];
            near.clear();
            near.extend(around.iter().copied().filter(|v| v.is_finite()));
            let middle = near.len() / 2;
            *near.select_nth_unstable_by(middle, f64::total_cmp).1
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(labels(&Axis::frames(0, 600)), ["0", "100", "200", "300", "400", "500"]);
        assert_eq!(labels(&Axis::frames(7, 3)), ["7", "8", "9"]);
        assert_eq!(labels(&Axis::frames(7, 0)), ["7", "8"]);
        assert_eq!(
            labels(&Axis::values(&[&[0.3, 0.7]], false)),
            ["0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7"]
        );
        assert_eq!(
            labels(&Axis::values(&[&[4e-5]], false)),
            ["0", "0.00001", "0.00002", "0.00003", "0.00004"]
        );
        assert_eq!(labels(&Axis::values(&[&[-1.0, 1.0]], false)), ["-1.0", "-0.5", "0", "0.5", "1.0"]);
    }

    #[test]
    fn logarithmic_ticks_thin_out_over_many_decades() {
        assert_eq!(labels(&Axis::values(&[&[0.3, 7.0]], true)), ["0.5", "1", "2", "5"]);
        assert_eq!(
            labels(&Axis::values(&[&[1e-3, 1e3]], true)),
            ["0.001", "0.01", "0.1", "1", "10", "100", "1000"]
        );
        assert!(Axis::values(&[&[1e-30, 1e30]], true).ticks.len() <= 10);
        let narrow = Axis::values(&[&[2.1, 2.4]], true);
        assert!(narrow.ticks.len() >= 3, "{:?}", labels(&narrow));
    }

    #[test]
    fn values_without_a_range_get_one() {
        for values in [&[][..], &[f64::NAN], &[0.0], &[5.0], &[f64::INFINITY]] {
            for logarithmic in [false, true] {
                let axis = Axis::values(&[values], logarithmic);
                assert!(axis.ends[0] < axis.ends[1] && axis.ends[1].is_finite(), "{values:?}");
            }
        }
    }

    #[test]
    fn an_outline_keeps_peaks_and_gaps() {
        let values = [1.0, 9.0, 2.0, 0.0, f64::NAN, 3.0, 4.0, 5.0];
        assert_eq!(outline(&values, 8, 2)[0].len(), 4);
        assert_eq!(outline(&values, 2, 2), [vec![(1, 9.0), (3, 0.0)], vec![(5, 3.0), (7, 5.0)]]);
    }

    #[test]
    fn a_median_ignores_spikes_and_gaps() {
        let values = [1.0, 1.0, 50.0, 2.0, f64::NAN, 3.0];
        let median = moving_median(&values, 3);
        assert_eq!(median[..4], [1.0, 1.0, 2.0, 50.0]);
        assert!(median[4].is_nan());
        assert_eq!(median[5], 3.0);
        assert_eq!(moving_median(&[1.0, 2.0, 3.0], usize::MAX), [2.0; 3]);
    }
}
