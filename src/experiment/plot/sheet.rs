//! What all plots have in common: their sizes, and what they say about themselves.

use plotters::prelude::DrawingAreaErrorKind;

/// Size of the picture in CSS pixels, without the rows of the legend beyond the first.
pub(super) const SIZE: (i32, i32) = (960, 440);
/// Left, right and bottom margins, and the one at the top above the legend.
pub(super) const LEFT: i32 = 76;
pub(super) const RIGHT: i32 = 24;
pub(super) const BOTTOM: i32 = 58;
pub(super) const TOP: i32 = 40;
/// The backend's coordinates are integers; it draws on a canvas that is larger by this factor, for the picture to be
/// scaled down again by whoever shows it.
pub(super) const FINE: i32 = 5;
/// What a plot says about itself, and how it is drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plot<'a> {
    /// Heading.
    pub title: &'a str,
    /// What is counted to the right.
    pub x_label: &'a str,
    /// What is measured upwards, with its unit.
    pub y_label: &'a str,
    /// Number of the frame to which the first value of each series belongs.
    pub first_frame: usize,
    /// Whether values are drawn by their logarithms. Values that are not positive are then left out.
    pub logarithmic: bool,
    /// Frames in the window of a moving median, drawn over the then faint curve itself; below 2, none is drawn.
    pub median_window: usize,
}

/// A plot could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("plot {title:?}: {source}")]
pub struct PlotError {
    pub(super) title: String,
    pub(super) source: DrawingAreaErrorKind<std::io::Error>,
}
