//! Draws a plot as SVG.
//!
//! From top to bottom: title, legend, the framed area with the data, the label of the horizontal
//! axis, notes. The legend has rows of its own, so that it never covers data. Widths of texts are
//! estimated, because the reader's fonts are unknown; the estimate is of a wide font.

use super::axis::{Axis, Span};
use super::plot::{Plot, Series, Style};
use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Drawing units per unit of the page: the backend knows whole units only.
const FINENESS: i32 = 2;
/// Width of the picture [drawing units].
const WIDTH: i32 = 1600;
/// Height of the framed area [drawing units].
const FRAME_HEIGHT: i32 = 740;
const MARGIN: i32 = 28;
const TITLE_SIZE: i32 = 38;
const LABEL_SIZE: i32 = 32;
const TICK_SIZE: i32 = 28;
const NOTE_SIZE: i32 = 25;
/// Line heights as a multiple of the letters' size.
const LEADING: f64 = 1.35;
/// Length of a legend's sample of a line [drawing units].
const SAMPLE: i32 = 76;
const MARKER: i32 = 9;
const LINE_WIDTH: u32 = 4;

const TEXT_COLOR: RGBColor = RGBColor(34, 34, 34);
const FRAME_COLOR: RGBColor = RGBColor(120, 120, 120);
const GRID_COLOR: RGBColor = RGBColor(216, 216, 216);
const FINE_GRID_COLOR: RGBColor = RGBColor(240, 240, 240);
const REFERENCE_COLOR: RGBColor = RGBColor(90, 90, 90);

/// The palette of Okabe and Ito, told apart with every kind of colour vision, without its yellow,
/// which fades on white.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Point = (i32, i32);

pub(super) fn draw(plot: &Plot) -> Result<String> {
    let layout = Layout::new(plot);
    let size = (WIDTH, layout.height);
    let mut svg = String::new();
    let area =
        SVGBackend::with_string(&mut svg, (size.0 as u32, size.1 as u32)).into_drawing_area();
    // What fails in writing to memory is a fault of the program, not of the data.
    layout
        .draw(plot, &area)
        .and_then(|()| area.present().map_err(|error| anyhow!("{error}")))
        .map_err(|error| anyhow!("cannot draw `{}`: {error}", plot.title))?;
    drop(area);
    let fine = format!("width=\"{}\" height=\"{}\" viewBox", size.0, size.1);
    let page = (size.0 / FINENESS, size.1 / FINENESS);
    let shown = format!("width=\"{}\" height=\"{}\" viewBox", page.0, page.1);
    Ok(svg.replacen(&fine, &shown, 1))
}

struct Layout {
    title: Vec<String>,
    legend: Vec<Entry>,
    notes: Vec<String>,
    x: Span,
    y: Span,
    /// Edges of the framed area [drawing units].
    left: i32,
    right: i32,
    top: i32,
    bottom: i32,
    /// Of the picture [drawing units].
    height: i32,
}

/// A name in the legend, and where its sample begins.
struct Entry {
    name: String,
    at: Point,
}

impl Layout {
    fn new(plot: &Plot) -> Self {
        let shown = || {
            let points = plot.series.iter().flat_map(|series| &series.points);
            points.copied().filter(|point| plot.shows(*point))
        };
        let reference = plot.reference.iter().map(|(value, _)| *value);
        let reference = reference.filter(|value| plot.y.shows(*value));
        let x = plot.x.span(shown().map(|point| point[0]));
        let y = plot.y.span(shown().map(|point| point[1]).chain(reference));

        let labels = y.ticks.iter().filter_map(|tick| tick.label.as_deref());
        let widest = labels.map(|label| text_width(label, TICK_SIZE)).max().unwrap_or(0);
        let left = MARGIN + line_height(LABEL_SIZE) + 12 + widest + 16;
        let right = WIDTH - 2 * MARGIN;

        let title = wrap(&plot.title, TITLE_SIZE, WIDTH - 2 * MARGIN);
        let below_title = MARGIN + title.len() as i32 * line_height(TITLE_SIZE) + 6;
        let (legend, below_legend) = place_legend(plot, left, right, below_title);
        let top = below_legend + 14;
        let bottom = top + FRAME_HEIGHT;
        let below_axis = bottom + 14 + line_height(TICK_SIZE) + 6 + line_height(LABEL_SIZE) + 4;
        let notes: Vec<String> =
            notes(plot).iter().flat_map(|note| wrap(note, NOTE_SIZE, right - left)).collect();
        let height = below_axis + notes.len() as i32 * line_height(NOTE_SIZE) + MARGIN / 2;
        // An odd height would end between two units of the page.
        let height = height + height % FINENESS;
        Self { title, legend, notes, x, y, left, right, top, bottom, height }
    }

    fn place_x(&self, share: f64) -> i32 {
        self.left + (share * f64::from(self.right - self.left)).round() as i32
    }

    fn place_y(&self, share: f64) -> i32 {
        self.bottom - (share * f64::from(self.bottom - self.top)).round() as i32
    }

    fn place(&self, point: [f64; 2]) -> Point {
        (self.place_x(self.x.share(point[0])), self.place_y(self.y.share(point[1])))
    }

    fn draw(&self, plot: &Plot, area: &Area) -> Result<()> {
        area.fill(&WHITE).map_err(|error| anyhow!("{error}"))?;
        self.draw_grid(area)?;
        self.draw_labels(plot, area)?;
        if let Some((value, _)) = plot.reference.as_ref().filter(|(value, _)| plot.y.shows(*value))
        {
            let y = self.place_y(self.y.share(*value));
            dashed(area, &[(self.left, y), (self.right, y)], REFERENCE_COLOR, 3)?;
        }
        for (index, series) in plot.series.iter().enumerate() {
            // A line does not bridge a point that is left out.
            for run in series.points.split(|point| !plot.shows(*point)) {
                let places: Vec<Point> = run.iter().map(|point| self.place(*point)).collect();
                draw_series(area, index, series.style, &places)?;
            }
        }
        self.draw_legend(plot, area)
    }

    fn draw_grid(&self, area: &Area) -> Result<()> {
        // The fine lines first, so that none crosses a strong one.
        for labelled in [false, true] {
            let color = if labelled { GRID_COLOR } else { FINE_GRID_COLOR };
            for tick in self.x.ticks.iter().filter(|tick| tick.label.is_some() == labelled) {
                let x = self.place_x(self.x.tick_share(tick));
                path(area, &[(x, self.top), (x, self.bottom)], color, 2)?;
            }
            for tick in self.y.ticks.iter().filter(|tick| tick.label.is_some() == labelled) {
                let y = self.place_y(self.y.tick_share(tick));
                path(area, &[(self.left, y), (self.right, y)], color, 2)?;
            }
        }
        let corners = [
            (self.left, self.top),
            (self.right, self.top),
            (self.right, self.bottom),
            (self.left, self.bottom),
            (self.left, self.top),
        ];
        path(area, &corners, FRAME_COLOR, 2)
    }

    fn draw_labels(&self, plot: &Plot, area: &Area) -> Result<()> {
        for (line, title) in self.title.iter().enumerate() {
            let y = MARGIN + line as i32 * line_height(TITLE_SIZE);
            let style = letters(TITLE_SIZE, HPos::Left, VPos::Top);
            let bold = TextStyle { font: style.font.style(FontStyle::Bold), ..style };
            text(area, title, (MARGIN, y), bold)?;
        }
        for tick in &self.x.ticks {
            let Some(label) = &tick.label else { continue };
            let at = (self.place_x(self.x.tick_share(tick)), self.bottom + 14);
            text(area, label, at, letters(TICK_SIZE, HPos::Center, VPos::Top))?;
        }
        for tick in &self.y.ticks {
            let Some(label) = &tick.label else { continue };
            let at = (self.left - 16, self.place_y(self.y.tick_share(tick)));
            text(area, label, at, letters(TICK_SIZE, HPos::Right, VPos::Center))?;
        }
        let below_ticks = self.bottom + 14 + line_height(TICK_SIZE) + 6;
        let at = ((self.left + self.right) / 2, below_ticks);
        text(area, &plot.x.label, at, letters(LABEL_SIZE, HPos::Center, VPos::Top))?;
        let upright = letters(LABEL_SIZE, HPos::Center, VPos::Top);
        let upright =
            TextStyle { font: upright.font.transform(FontTransform::Rotate270), ..upright };
        text(area, &plot.y.label, (MARGIN, (self.top + self.bottom) / 2), upright)?;
        for (line, note) in self.notes.iter().enumerate() {
            let y =
                below_ticks + line_height(LABEL_SIZE) + 4 + line as i32 * line_height(NOTE_SIZE);
            text(area, note, (self.left, y), letters(NOTE_SIZE, HPos::Left, VPos::Top))?;
        }
        Ok(())
    }

    fn draw_legend(&self, plot: &Plot, area: &Area) -> Result<()> {
        for (index, entry) in self.legend.iter().enumerate() {
            let (x, y) = entry.at;
            let y = y + line_height(TICK_SIZE) / 2;
            match plot.series.get(index) {
                Some(series) => {
                    let marker = [(x + SAMPLE / 2, y)];
                    if series.style.has_line() {
                        let bare =
                            if series.style == Style::Dashed { Style::Dashed } else { Style::Line };
                        draw_series(area, index, bare, &[(x, y), (x + SAMPLE, y)])?;
                    }
                    if series.style.has_markers() {
                        draw_series(area, index, Style::Markers, &marker)?;
                    }
                }
                None => dashed(area, &[(x, y), (x + SAMPLE, y)], REFERENCE_COLOR, 3)?,
            }
            let style = letters(TICK_SIZE, HPos::Left, VPos::Center);
            text(area, &entry.name, (x + SAMPLE + 14, y), style)?;
        }
        Ok(())
    }
}

/// Entries in rows, and where the rows end. A single series without a name needs no legend: the
/// title names it.
fn place_legend(plot: &Plot, left: i32, right: i32, top: i32) -> (Vec<Entry>, i32) {
    let reference = plot.reference.iter().map(|(_, name)| name);
    let names: Vec<&String> =
        plot.series.iter().map(|series| &series.name).chain(reference).collect();
    if names.len() < 2 && names.first().is_none_or(|name| name.is_empty()) {
        return (Vec::new(), top);
    }
    // Columns of one width are read more easily than a ragged row.
    let widest = names.iter().map(|name| text_width(name, TICK_SIZE)).max().unwrap_or(0);
    let column = SAMPLE + 14 + widest + 40;
    let columns = ((right - left + 40) / column).clamp(1, 4) as usize;
    let entries = names.into_iter().enumerate().map(|(index, name)| Entry {
        name: name.clone(),
        at: (
            left + (index % columns) as i32 * column,
            top + (index / columns) as i32 * line_height(TICK_SIZE),
        ),
    });
    let entries: Vec<Entry> = entries.collect();
    let rows = entries.len().div_ceil(columns) as i32;
    (entries, top + rows * line_height(TICK_SIZE))
}

/// What the picture cannot show by itself.
fn notes(plot: &Plot) -> Vec<String> {
    let mut notes = Vec::new();
    let mut shown = false;
    for Series { name, points, .. } in &plot.series {
        let count = points.iter().filter(|point| !plot.shows(**point)).count();
        shown |= count < points.len();
        if count > 0 {
            let reasons: Vec<&str> = [&plot.x, &plot.y]
                .into_iter()
                .zip([0, 1])
                .flat_map(|(axis, at)| points.iter().filter_map(move |p| reason(axis, p[at])))
                .collect();
            let reason = if reasons.iter().all(|r| *r == reasons[0]) { reasons[0] } else { MIXED };
            let (points, are) = if count == 1 { ("point", "is") } else { ("points", "are") };
            notes.push(format!("Not drawn: {count} {points} of “{name}” that {are} {reason}."));
        }
    }
    if !shown {
        notes.push("There are no points to draw.".into());
    }
    notes
}

const MIXED: &str = "not finite, or not above zero on a logarithmic axis";

/// Why a value has no place on an axis.
fn reason(axis: &Axis, value: f64) -> Option<&'static str> {
    match axis.shows(value) {
        true => None,
        false if value == 0.0 => Some("exactly zero, which has no logarithm"),
        false if value.is_finite() && value < 0.0 => Some("below zero, which has no logarithm"),
        false => Some("not finite"),
    }
}

fn draw_series(area: &Area, index: usize, style: Style, places: &[Point]) -> Result<()> {
    let color = PALETTE[index % PALETTE.len()];
    match style {
        Style::Dashed => dashed(area, places, color, LINE_WIDTH)?,
        Style::Line | Style::MarkedLine => path(area, places, color, LINE_WIDTH)?,
        Style::Markers => {}
    }
    if style.has_markers() {
        for place in places {
            draw_marker(area, index, *place, color)?;
        }
    }
    Ok(())
}

/// Shapes and colours come round after different counts, so that 35 series differ.
fn draw_marker(area: &Area, index: usize, (x, y): Point, color: RGBColor) -> Result<()> {
    let r = MARKER;
    let fill = color.filled();
    let polygon = |corners: &[Point]| Polygon::new(corners.to_vec(), fill);
    let drawn = match index % 5 {
        0 => area.draw(&Circle::new((x, y), r, fill)),
        1 => area.draw(&Rectangle::new([(x - r + 1, y - r + 1), (x + r - 1, y + r - 1)], fill)),
        2 => area.draw(&polygon(&[(x, y - r - 2), (x + r + 1, y + r - 2), (x - r - 1, y + r - 2)])),
        3 => area.draw(&polygon(&[(x, y - r - 3), (x + r + 3, y), (x, y + r + 3), (x - r - 3, y)])),
        _ => area.draw(&polygon(&[(x, y + r + 2), (x + r + 1, y - r + 2), (x - r - 1, y - r + 2)])),
    };
    drawn.map_err(|error| anyhow!("{error}"))
}

fn path(area: &Area, places: &[Point], color: RGBColor, width: u32) -> Result<()> {
    if places.len() < 2 {
        return Ok(());
    }
    let path = PathElement::new(places.to_vec(), color.stroke_width(width));
    area.draw(&path).map_err(|error| anyhow!("{error}"))
}

fn dashed(area: &Area, places: &[Point], color: RGBColor, width: u32) -> Result<()> {
    if places.len() < 2 {
        return Ok(());
    }
    let path = DashedPathElement::new(places.iter().copied(), 14, 9, color.stroke_width(width));
    area.draw(&path).map_err(|error| anyhow!("{error}"))
}

fn text(area: &Area, words: &str, at: Point, style: TextStyle) -> Result<()> {
    let text = Text::new(words.to_owned(), at, style);
    area.draw(&text).map_err(|error| anyhow!("{error}"))
}

fn letters(size: i32, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    // The backend divides by 1.24 what it writes as the size.
    let font = FontDesc::new(FontFamily::SansSerif, 1.24 * f64::from(size), FontStyle::Normal);
    TextStyle::from(font).color(&TEXT_COLOR).pos(Pos::new(horizontal, vertical))
}

fn line_height(size: i32) -> i32 {
    (f64::from(size) * LEADING).round() as i32
}

/// An estimate for a wide font without serifs.
fn text_width(text: &str, size: i32) -> i32 {
    (0.6 * f64::from(size) * text.chars().count() as f64).ceil() as i32
}

fn wrap(text: &str, size: i32, width: i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(line, size) + text_width(word, size) + size / 2 <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
