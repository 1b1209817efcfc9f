//! Lines through points, both axes logarithmic: how something grows.

use plotters::prelude::*;

use super::axis::Axis;
use super::frame::{border, frame, palette, picture};
use super::sheet::{FINE, Plot, PlotError};

/// One line through points.
#[derive(Clone, Debug)]
pub struct Line<'a> {
    /// Its name in the legend.
    pub name: &'a str,
    /// From left to right.
    pub points: Vec<(f64, f64)>,
    /// See [`Series::colour`](crate::experiment::plot::Series::colour).
    pub colour: usize,
}

/// Draws lines through points, both axes logarithmic: how something grows. Nothing is drawn over frames, and there is no
/// median. Points that are not positive are left out.
///
/// # Errors
/// As [`curves`](crate::experiment::plot::curves).
pub fn lines(plot: &Plot, lines: &[Line]) -> Result<String, PlotError> {
    let names: Vec<(&str, usize)> = lines.iter().map(|line| (line.name, line.colour)).collect();
    picture(plot, &names, |canvas, top, bottom| {
        let coordinates = |f: fn(&(f64, f64)) -> f64| -> Vec<Vec<f64>> {
            lines.iter().map(|line| line.points.iter().map(f).collect()).collect()
        };
        let (xs, ys) = (coordinates(|p| p.0), coordinates(|p| p.1));
        let axis =
            |values: &[Vec<f64>]| Axis::values(&values.iter().map(|v| &v[..]).collect::<Vec<_>>(), true);
        let (x, y) = (axis(&xs), axis(&ys));
        let area = frame(canvas, plot, &x, &y, top, bottom)?;
        for line in lines {
            let places: Vec<(f64, f64)> = line.points.iter().map(|p| (x.place(p.0), y.place(p.1))).collect();
            let places: Vec<_> = places.into_iter().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
            let stroke = palette(line.colour).stroke_width(2 * FINE as u32);
            for &at in &places {
                area.draw(&Circle::new(at, 4 * FINE, palette(line.colour).filled()))?;
            }
            area.draw(&PathElement::new(places, stroke))?;
        }
        border(canvas, top, bottom)
    })
}
