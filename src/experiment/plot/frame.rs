//! What surrounds the curves: title, legend, axes and grid.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::sheet::{BOTTOM, FINE, LEFT, Plot, PlotError, RIGHT, SIZE, TOP};

/// Height of a row of the legend.
const LEGEND_ROW: i32 = 22;
/// Length of the line that stands for a curve in the legend, and the room around it.
const SWATCH: i32 = 26;
const GAP: i32 = 8;

const TEXT: RGBColor = RGBColor(0x33, 0x3b, 0x47);
const FRAME: RGBColor = RGBColor(0x8b, 0x93, 0x9f);
const GRID: RGBColor = RGBColor(0xe4, 0xe7, 0xec);
const PALETTE: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x20, 0x20, 0x20),
];

pub(super) type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// A picture with a title and a legend, and what `draw` puts between the two lines that it is given.
pub(super) fn picture(
    plot: &Plot,
    names: &[(&str, usize)],
    draw: impl FnOnce(&Canvas, i32, i32) -> Drawn,
) -> Result<String, PlotError> {
    let legend = Legend::new(names);
    let (width, height) = (SIZE.0, SIZE.1 + legend.rows * LEGEND_ROW);
    let mut svg = String::new();
    let draw = |svg: &mut String| {
        let size = ((width * FINE) as u32, (height * FINE) as u32);
        let canvas = SVGBackend::with_string(svg, size).into_drawing_area();
        canvas.fill(&WHITE)?;
        canvas.draw(&text(plot.title, (LEFT, 24), 16.0, (HPos::Left, VPos::Center), FontTransform::None))?;
        legend.draw(&canvas, names)?;
        draw(&canvas, TOP + legend.rows * LEGEND_ROW, height - BOTTOM)?;
        canvas.present()
    };
    draw(&mut svg).map_err(|source| PlotError { title: plot.title.to_owned(), source })?;
    // The canvas stays as fine as it was drawn, the picture gets its size.
    let fine = format!("width=\"{}\" height=\"{}\"", width * FINE, height * FINE);
    Ok(svg.replacen(&fine, &format!("width=\"{width}\" height=\"{height}\""), 1))
}

/// What is drawn in the coordinates of the axes.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws axes and grid between the lines `top` and `bottom` of the picture.
pub(super) fn frame<'a>(
    canvas: &Canvas<'a>,
    plot: &Plot,
    x: &Axis,
    y: &Axis,
    top: i32,
    bottom: i32,
) -> Result<Area<'a>, DrawingAreaErrorKind<std::io::Error>> {
    let (left, right) = (LEFT, SIZE.0 - RIGHT);
    let area = canvas.clone().apply_coord_spec(Cartesian2d::<RangedCoordf64, RangedCoordf64>::new(
        x.ends[0]..x.ends[1],
        y.ends[0]..y.ends[1],
        (left * FINE..right * FINE, bottom * FINE..top * FINE),
    ));
    let grid = GRID.stroke_width(FINE as u32);
    for (at, label) in &x.ticks {
        area.draw(&PathElement::new([(*at, y.ends[0]), (*at, y.ends[1])], grid))?;
        let below = (pixel(&area, (*at, y.ends[0])).0, bottom + 8);
        canvas.draw(&text(label, below, 12.0, (HPos::Center, VPos::Top), FontTransform::None))?;
    }
    for (at, label) in &y.ticks {
        area.draw(&PathElement::new([(x.ends[0], *at), (x.ends[1], *at)], grid))?;
        let beside = (left - 8, pixel(&area, (x.ends[0], *at)).1);
        canvas.draw(&text(label, beside, 12.0, (HPos::Right, VPos::Center), FontTransform::None))?;
    }
    let middle = (left + right) / 2;
    let center = (HPos::Center, VPos::Center);
    canvas.draw(&text(plot.x_label, (middle, bottom + 40), 13.0, center, FontTransform::None))?;
    let middle = (top + bottom) / 2;
    canvas.draw(&text(plot.y_label, (20, middle), 13.0, center, FontTransform::Rotate270))?;
    Ok(area)
}

pub(super) fn pixel(area: &Area, at: (f64, f64)) -> (i32, i32) {
    let (x, y) = area.map_coordinate(&at);
    (x / FINE, y / FINE)
}

/// The lines of the axes, over everything.
pub(super) fn border(canvas: &Canvas, top: i32, bottom: i32) -> Drawn {
    let (left, right) = (LEFT, SIZE.0 - RIGHT);
    let corners = [(left, top), (left, bottom), (right, bottom)].map(|(x, y)| (x * FINE, y * FINE));
    canvas.draw(&PathElement::new(corners, FRAME.stroke_width(FINE as u32)))
}

pub(super) fn palette(colour: usize) -> RGBColor {
    PALETTE[colour % PALETTE.len()]
}

/// Text of `size` CSS pixels, anchored at a place in the picture.
pub(super) fn text<'a>(
    content: &'a str,
    (x, y): (i32, i32),
    size: f64,
    (h, v): (HPos, VPos),
    turned: FontTransform,
) -> Text<'a, (i32, i32), &'a str> {
    // The backend writes font sizes divided by this.
    const BACKEND_SCALE: f64 = 1.24;
    let font = ("sans-serif", size * BACKEND_SCALE * f64::from(FINE)).into_font().transform(turned);
    Text::new(content, (x * FINE, y * FINE), font.color(&TEXT).pos(Pos::new(h, v)))
}

/// Where the names of the curves stand: in rows below the title.
pub(super) struct Legend {
    /// Left end and row of each series' entry.
    places: Vec<(i32, i32)>,
    rows: i32,
}

impl Legend {
    fn new(names: &[(&str, usize)]) -> Self {
        let (mut x, mut row) = (LEFT, 0);
        let mut places = Vec::new();
        for (name, _) in names {
            // There are no font metrics; this is a wide estimate for a size of 13.
            let width = SWATCH + 3 * GAP + (7.6 * name.chars().count().min(1000) as f64) as i32;
            if x + width > SIZE.0 - RIGHT && x > LEFT {
                (x, row) = (LEFT, row + 1);
            }
            places.push((x, row));
            x += width;
        }
        Self { places, rows: row + 1 }
    }

    fn draw(&self, canvas: &Canvas, names: &[(&str, usize)]) -> Drawn {
        for (&(name, colour), &(x, row)) in names.iter().zip(&self.places) {
            let y = TOP + row * LEGEND_ROW + LEGEND_ROW / 2 - 2;
            let line = [(x * FINE, y * FINE), ((x + SWATCH) * FINE, y * FINE)];
            canvas.draw(&PathElement::new(line, palette(colour).stroke_width(3 * FINE as u32)))?;
            let beside = (x + SWATCH + GAP, y);
            canvas.draw(&text(name, beside, 13.0, (HPos::Left, VPos::Center), FontTransform::None))?;
        }
        Ok(())
    }
}
