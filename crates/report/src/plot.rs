//! What a plot shows, as plain data.

use super::axis::Axis;
use super::chart;
use anyhow::Result;

/// How the points of a series are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// A line.
    Line,
    /// A dashed line.
    Dashed,
    /// A marker at every point.
    Markers,
    /// A line with a marker at every point.
    #[default]
    MarkedLine,
}

impl Style {
    pub(super) fn has_line(self) -> bool {
        self != Self::Markers
    }

    pub(super) fn has_markers(self) -> bool {
        matches!(self, Self::Markers | Self::MarkedLine)
    }
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    /// As the legend calls it.
    pub name: String,
    /// Values along both axes, in the axes' units, in the order in which a line joins them.
    pub points: Vec<[f64; 2]>,
    /// How they are drawn.
    pub style: Style,
}

impl Series {
    /// A line with markers.
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let points = points.into_iter().collect();
        Self { name: name.into(), points, style: Style::default() }
    }

    /// Drawn in another style.
    pub fn with_style(self, style: Style) -> Self {
        Self { style, ..self }
    }
}

/// Series over two axes.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Written above.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// In the order of the legend; later ones are drawn over earlier ones.
    pub series: Vec<Series>,
    /// A horizontal line at a value, and its name in the legend.
    pub reference: Option<(f64, String)>,
}

impl Plot {
    /// A plot without series.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, series: Vec::new(), reference: None }
    }

    /// Adds a series.
    pub fn series(&mut self, series: Series) -> &mut Self {
        self.series.push(series);
        self
    }

    /// Draws a dashed horizontal line at a value.
    pub fn reference(&mut self, value: f64, name: impl Into<String>) -> &mut Self {
        self.reference = Some((value, name.into()));
        self
    }

    /// The plot as SVG. Points without a place on the axes are left out, and the plot says so.
    pub fn to_svg(&self) -> Result<String> {
        chart::draw(self)
    }

    /// The place of a point, if it has one on these axes.
    pub(super) fn shows(&self, point: [f64; 2]) -> bool {
        self.x.shows(point[0]) && self.y.shows(point[1])
    }
}
