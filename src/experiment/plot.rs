//! Curves over the frames of a walkthrough, as one SVG picture.
//!
//! The colours are those of Okabe & Ito (2002), which can be told apart with any kind of colour vision. Text is left
//! to the viewer's sans-serif font.

// Plots are off the selection path.
#![expect(clippy::disallowed_methods, reason = "off the selection path")]

mod axis;
mod frame;
mod lines;
mod sheet;

use plotters::prelude::*;

use axis::{Axis, moving_median, outline};
use frame::{Canvas, Drawn, border, frame, palette, picture, pixel};
pub use lines::{Line, lines};
use sheet::{FINE, LEFT, RIGHT, SIZE};
pub use sheet::{Plot, PlotError};

/// Points of a curve for each pixel of the plot's width, at most: the highest and the lowest of the frames there.
const POINTS: usize = 2;

/// One curve.
#[derive(Clone, Copy, Debug)]
pub struct Series<'a> {
    /// Its name in the legend.
    pub name: &'a str,
    /// A value for each frame. Where one is not finite, the curve has a gap.
    pub values: &'a [f64],
    /// Which of the seven colours it gets, counted modulo their number.
    pub colour: usize,
}

/// Draws the curves, as the text of an SVG file.
///
/// The range of values is that of 99.8 % of each series, so that a single spike does not flatten everything; where
/// a curve leaves it, a small triangle at the upper edge says so.
///
/// # Errors
/// What the drawing library says; it has no reason to fail.
pub fn curves(plot: &Plot, series: &[Series]) -> Result<String, PlotError> {
    let names: Vec<(&str, usize)> = series.iter().map(|s| (s.name, s.colour)).collect();
    picture(plot, &names, |canvas, top, bottom| draw_curves(canvas, plot, series, top, bottom))
}

/// Puts pictures below each other, as one.
#[must_use]
pub fn stack(pictures: &[String]) -> String {
    // Each starts with the size that it was given.
    let height = |svg: &String| -> i32 {
        svg.split_once("height=\"")
            .and_then(|(_, rest)| rest.split('"').next()?.parse().ok())
            .unwrap_or(SIZE.1)
    };
    let total: i32 = pictures.iter().map(height).sum();
    let mut stacked = format!(
        "<svg width=\"{0}\" height=\"{total}\" viewBox=\"0 0 {0} {total}\" xmlns=\"http://www.w3.org/2000/svg\">\n",
        SIZE.0
    );
    let mut y = 0;
    for picture in pictures {
        stacked.push_str(&picture.replacen("<svg ", &format!("<svg y=\"{y}\" "), 1));
        y += height(picture);
    }
    stacked.push_str("</svg>\n");
    stacked
}

/// A picture of small print, to be put below others: the command that made them.
#[must_use]
pub fn small_print(text: &str) -> String {
    let escaped = |line: String| line.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    // A line takes so many characters at most.
    let characters: Vec<char> = text.chars().collect();
    let lines: Vec<String> = characters.chunks(140).map(|line| escaped(line.iter().collect())).collect();
    let height = 12 + 14 * lines.len();
    let mut svg = format!(
        "<svg width=\"{0}\" height=\"{height}\" viewBox=\"0 0 {0} {height}\" xmlns=\"http://www.w3.org/2000/svg\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n",
        SIZE.0
    );
    for (line, y) in lines.iter().zip((12..).step_by(14)) {
        svg += &format!(
            "<text x=\"{LEFT}\" y=\"{y}\" font-family=\"monospace\" font-size=\"10\" fill=\"#6B7280\">{line}</text>\n"
        );
    }
    svg + "</svg>\n"
}

/// Draws axes, grid and curves between the lines `top` and `bottom` of the picture.
fn draw_curves(canvas: &Canvas, plot: &Plot, series: &[Series], top: i32, bottom: i32) -> Drawn {
    let frames = series.iter().map(|s| s.values.len()).max().unwrap_or(0);
    let x = Axis::frames(plot.first_frame, frames);
    let values: Vec<&[f64]> = series.iter().map(|s| s.values).collect();
    let y = Axis::values(&values, plot.logarithmic);
    let area = frame(canvas, plot, &x, &y, top, bottom)?;

    let columns = (SIZE.0 - RIGHT - LEFT) as usize;
    let curve = |values: &[f64], style: ShapeStyle| -> Drawn {
        for points in outline(values, columns, POINTS) {
            let at = |&(frame, value): &(usize, f64)| {
                ((plot.first_frame + frame) as f64, y.place(value).min(y.ends[1]).max(y.ends[0]))
            };
            area.draw(&PathElement::new(points.iter().map(at).collect::<Vec<_>>(), style))?;
        }
        Ok(())
    };
    let smooth = plot.median_window > 1;
    for s in series {
        let raw = if smooth { colour(s).mix(0.28) } else { colour(s).mix(1.0) };
        curve(&finite_places(s.values, &y), raw.stroke_width(FINE as u32))?;
    }
    for s in series.iter().filter(|_| smooth) {
        let median = moving_median(&finite_places(s.values, &y), plot.median_window);
        curve(&median, colour(s).stroke_width(2 * FINE as u32))?;
    }
    for s in series {
        let mut free_from = i32::MIN;
        for (frame, &value) in s.values.iter().enumerate() {
            let (x, _) = pixel(&area, ((plot.first_frame + frame) as f64, y.ends[1]));
            if value.is_finite() && y.place(value) > y.ends[1] && x >= free_from {
                let triangle =
                    [(x - 4, top + 7), (x + 4, top + 7), (x, top)].map(|(x, y)| (x * FINE, y * FINE));
                canvas.draw(&Polygon::new(triangle, colour(s).filled()))?;
                free_from = x + 9;
            }
        }
    }
    border(canvas, top, bottom)
}

/// The values with gaps, as NaN, where there is no place on the axis.
fn finite_places(values: &[f64], y: &Axis) -> Vec<f64> {
    values.iter().map(|&v| if y.place(v).is_finite() { v } else { f64::NAN }).collect()
}

fn colour(series: &Series) -> RGBColor {
    palette(series.colour)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLOT: Plot = Plot {
        title: "Selection",
        x_label: "frame",
        y_label: "time (ms)",
        first_frame: 100,
        logarithmic: false,
        median_window: 0,
    };

    fn series(values: &[f64]) -> Series<'_> {
        Series { name: "top-down <1>", values, colour: 0 }
    }

    fn count(svg: &str, what: &str) -> usize {
        svg.matches(what).count()
    }

    #[test]
    fn a_plot_says_what_it_shows() {
        let svg = curves(&PLOT, &[series(&[1.0, 3.0, 2.0])]).unwrap();
        assert!(svg.starts_with("<svg width=\"960\" height=\"462\" viewBox=\"0 0 4800 2310\""));
        for expected in ["Selection", "frame", "time (ms)", "top-down &lt;1&gt;", ">\n100\n<", ">\n102\n<"] {
            assert!(svg.contains(expected), "{expected} is missing");
        }
        assert_eq!(svg, curves(&PLOT, &[series(&[1.0, 3.0, 2.0])]).unwrap());
    }

    /// One swatch in the legend, and a line for each stretch without a gap.
    #[test]
    fn what_is_not_finite_is_a_gap() {
        let lines = |values: &[f64]| {
            let svg = curves(&PLOT, &[series(values)]).unwrap();
            count(&svg, "stroke=\"#0072B2\"") - 1
        };
        assert_eq!(lines(&[1.0, 2.0, 3.0, 4.0]), 1);
        assert_eq!(lines(&[1.0, 2.0, f64::NAN, 3.0, 4.0]), 2);
        assert_eq!(lines(&[f64::INFINITY, f64::NAN]), 0);
        assert_eq!(lines(&[]), 0);
    }

    #[test]
    fn a_spike_is_clipped_and_marked() {
        let mut values: Vec<f64> = (0..1000).map(|i| 1.0 + f64::from(i % 7)).collect();
        assert_eq!(count(&curves(&PLOT, &[series(&values)]).unwrap(), "<polygon"), 0);
        values[500] = 1e6;
        let svg = curves(&PLOT, &[series(&values)]).unwrap();
        assert_eq!(count(&svg, "<polygon"), 1);
        assert!(svg.contains(">\n7\n<") && !svg.contains(">\n10000"), "the axis is that of the other values");
    }

    #[test]
    fn a_median_is_drawn_over_each_curve() {
        let values = [1.0, 2.0, 3.0, 4.0];
        let svg = curves(&Plot { median_window: 3, ..PLOT }, &[series(&values)]).unwrap();
        assert_eq!(count(&svg, "stroke=\"#0072B2\""), 3, "swatch, curve and median");
        assert_eq!(count(&svg, "opacity=\"0.28\" stroke=\"#0072B2\""), 1);
    }

    #[test]
    fn logarithms_leave_out_what_is_not_positive() {
        let plot = Plot { logarithmic: true, ..PLOT };
        let svg = curves(&plot, &[series(&[0.1, 1.0, 0.0, 10.0, 100.0])]).unwrap();
        assert_eq!(count(&svg, "stroke=\"#0072B2\""), 3);
        for expected in [">\n0.1\n<", ">\n1\n<", ">\n10\n<", ">\n100\n<"] {
            assert!(svg.contains(expected), "{expected} is missing");
        }
    }

    #[test]
    fn a_long_legend_takes_more_rows() {
        let many = vec![Series { name: "in-memory, event-published", values: &[1.0, 2.0], colour: 9 }; 7];
        let svg = curves(&PLOT, &many).unwrap();
        assert!(svg.starts_with("<svg width=\"960\" height=\"506\""), "three rows of legend: {}", &svg[..40]);
    }
}
