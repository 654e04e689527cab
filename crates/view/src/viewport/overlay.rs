//! What is written over a picture: the legend of its colours, forces in newtons, its title.

use eframe::egui::{
    Align2, Color32, CornerRadius, FontId, Mesh, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2,
};
use viscera::scalar::Vec3;
use viscera::units::Dimension;
use viscera_picture::{Color, ColorScale, map_color};

use super::lens::Lens;
use crate::engine::{Coloring, RunSnapshot, Setup, Snapshot, inverted};
use crate::holds::Holds;

/// A colour of the renderer's as the window has it.
pub fn on_screen(color: Color) -> Color32 {
    let [r, g, b] = color.to_srgb();
    Color32::from_rgb(r, g, b)
}

/// Which values the colours stand for. Its upper end is a round number, and calm: it grows with the values,
/// and shrinks only where they have become much smaller. A few extreme values of strain and stress do not take the
/// scale: they are beyond its end, and the legend says how large they are.
#[derive(Clone, Debug, Default)]
pub struct Legend {
    coloring: Coloring,
    /// SI; nothing where there are no values.
    high: Option<f32>,
    /// The largest value, SI.
    largest: f32,
    /// Whether there are places without a value: around inverted tetrahedra.
    has_gaps: bool,
}

/// The share of the coloured vertices that the scale holds. A stress concentration is at fewer than one in a
/// hundred; those of displacement are no outliers.
fn share_held(coloring: Coloring) -> f64 {
    match coloring {
        Coloring::Plain | Coloring::Displacement => 1.0,
        Coloring::Strain | Coloring::Stress => 0.99,
    }
}

/// Values may fall to this share of the scale before it shrinks. Larger makes the colours of a swinging
/// body flicker.
const LOWEST: f32 = 0.2;

/// The least that colours tell apart: a tenth of a millimetre, a thousandth, a pascal. Round-off would show
/// as colours otherwise.
fn least(coloring: Coloring) -> f32 {
    match coloring {
        Coloring::Plain | Coloring::Stress => 1.0,
        Coloring::Displacement => 1e-4,
        Coloring::Strain => 1e-3,
    }
}

/// Width of a legend with the margin beside it [points].
const WIDTH: f32 = 136.0;

impl Legend {
    /// Follows the values of a frame.
    pub fn follow(&mut self, coloring: Coloring, values: impl Iterator<Item = f32>) {
        if coloring != self.coloring {
            *self = Self { coloring, ..Self::default() };
        }
        let (mut known, gaps): (Vec<f32>, Vec<f32>) = values.partition(|value| value.is_finite());
        self.has_gaps = !gaps.is_empty();
        let held = (share_held(coloring) * known.len() as f64).ceil() as usize;
        let Some(last) = held.checked_sub(1) else {
            self.high = None;
            return;
        };
        let (_, end, beyond) = known.select_nth_unstable_by(last, f32::total_cmp);
        self.largest = beyond.iter().copied().fold(*end, f32::max);
        let end = end.max(least(coloring));
        let fits = self.high.is_some_and(|high| end <= high && end >= LOWEST * high);
        if !fits {
            self.high = Some(round_up(end));
        }
    }

    /// What the colours do not show, in words: a value beyond the scale, and places without one.
    pub fn remarks(&self) -> Vec<String> {
        let beyond = self.high.is_some_and(|high| self.largest > high);
        let three_digits = |value: f32| format!("{value:.2e}").parse().unwrap_or(value);
        let beyond = beyond.then(|| format!("largest {}", self.text(three_digits(self.largest))));
        let gaps = self.has_gaps.then(|| "grey: inverted".to_owned());
        beyond.into_iter().chain(gaps).collect()
    }

    /// The values of the first and the last colour; nothing for plain tissue.
    pub fn range(&self) -> Option<[f32; 2]> {
        self.high.map(|high| [0.0, high])
    }

    /// A value as the legend writes it.
    fn text(&self, value: f32) -> String {
        let value = f64::from(value);
        match self.coloring {
            Coloring::Plain => String::new(),
            Coloring::Displacement => Dimension::Length.format(value),
            Coloring::Strain => format!("{} %", viscera::units::format_number(100.0 * value)),
            Coloring::Stress => Dimension::Pressure.format(value),
        }
    }

    /// The same for a picture without the window: numbers in a unit that the title names.
    pub fn scale(&self) -> Option<ColorScale> {
        let high = f64::from(self.high?);
        let (unit, factor) = match self.coloring {
            Coloring::Plain => return None,
            Coloring::Displacement => ("mm", 1e3),
            Coloring::Strain => ("%", 100.0),
            Coloring::Stress if high < 1e3 => ("Pa", 1.0),
            Coloring::Stress => ("kPa", 1e-3),
        };
        ColorScale::new(format!("{} [{unit}]", self.title()), 0.0, factor * high).ok()
    }

    fn title(&self) -> &'static str {
        match self.coloring {
            Coloring::Plain => "",
            Coloring::Displacement => "displacement",
            Coloring::Strain => "largest strain",
            Coloring::Stress => "von Mises stress",
        }
    }

    /// How much of the right edge it takes [points].
    pub fn width(&self) -> f32 {
        if self.high.is_some() { WIDTH } else { 0.0 }
    }

    /// Writes it into the right upper corner.
    pub fn paint(&self, painter: &Painter, area: Rect) {
        let Some(high) = self.high else { return };
        const SIZE: [f32; 2] = [14.0, 150.0];
        let corner = area.right_top() + vec2(-92.0, 36.0);
        let bar = Rect::from_min_size(corner, SIZE.into());
        const LINE: f32 = 15.0;
        let remarks = self.remarks();
        let below = 14.0 + LINE * remarks.len() as f32;
        let back =
            Rect::from_min_max(area.right_top() + vec2(-WIDTH, 8.0), bar.max + vec2(70.0, below));
        painter.rect_filled(back, CornerRadius::same(6), Color32::from_white_alpha(190));
        let mut mesh = Mesh::default();
        const STEPS: u32 = 48;
        for step in 0..=STEPS {
            let share = step as f32 / STEPS as f32;
            let y = bar.bottom() - share * bar.height();
            let color = on_screen(map_color(share));
            mesh.colored_vertex(pos2(bar.left(), y), color);
            mesh.colored_vertex(pos2(bar.right(), y), color);
            if step > 0 {
                let v = 2 * step;
                mesh.add_triangle(v - 2, v - 1, v);
                mesh.add_triangle(v - 1, v, v + 1);
            }
        }
        painter.add(Shape::mesh(mesh));
        let font = FontId::proportional(12.0);
        let ink = Color32::from_rgb(30, 34, 42);
        let above = pos2(back.center().x, back.top() + 13.0);
        painter.text(above, Align2::CENTER_CENTER, self.title(), font.clone(), ink);
        for share in [0.0, 0.5, 1.0] {
            let y = bar.bottom() - share * bar.height();
            painter.line_segment(
                [pos2(bar.right(), y), pos2(bar.right() + 4.0, y)],
                Stroke::new(1.0, ink),
            );
            let place = pos2(bar.right() + 7.0, y);
            painter.text(place, Align2::LEFT_CENTER, self.text(share * high), font.clone(), ink);
        }
        for (number, remark) in remarks.iter().enumerate() {
            let y = bar.bottom() + 20.0 + LINE * number as f32;
            let place = pos2(back.center().x, y);
            painter.text(place, Align2::CENTER_CENTER, remark, font.clone(), ink);
        }
    }
}

/// The next larger of 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8 times a power of ten.
fn round_up(value: f32) -> f32 {
    let power = 10f64.powf(f64::from(value).log10().floor());
    let steps = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let step = steps.into_iter().find(|step| f64::from(value) <= step * power * (1.0 + 1e-6));
    (step.unwrap_or(10.0) * power) as f32
}

/// A force as it is written everywhere: "1.25 N".
pub fn newtons(force: f64) -> String {
    match force {
        force if force < 0.1 => format!("{:.1} mN", 1e3 * force),
        force if force < 100.0 => format!("{force:.2} N"),
        force => format!("{force:.0} N"),
    }
}

/// The force of each hold, beside where it pulls to.
pub fn forces(painter: &Painter, lens: &Lens, run: &RunSnapshot, holds: &Holds) {
    for hold in &run.held {
        if holds.list().iter().all(|held| held.id != hold.id) {
            continue;
        }
        let (Some(place), Some(target)) = (lens.place(hold.place), lens.place(hold.target)) else {
            continue;
        };
        let way = target - place;
        let side =
            if way.x < 0.0 { (Align2::RIGHT_CENTER, -12.0) } else { (Align2::LEFT_CENTER, 12.0) };
        label(painter, target + vec2(side.1, -10.0), side.0, &newtons(hold.force.length()), 15.0);
    }
}

/// Names and forces of what the scene itself moves and pulls.
pub fn scene_patches(painter: &Painter, lens: &Lens, run: &RunSnapshot) {
    for patch in &run.measures.scene_patches {
        let mut middle = Vec3::ZERO;
        for &v in &patch.vertices {
            let place = run.positions.get(v as usize).map(|x| x.cast::<f64>()).unwrap_or_default();
            middle += place * (1.0 / patch.vertices.len() as f64);
        }
        let Some(place) = lens.place(middle).filter(|_| patch.force.length() > 0.0) else {
            continue;
        };
        let text = format!("{} {}", patch.name, newtons(patch.force.length()));
        painter.circle_filled(place, 3.5, on_screen(Color::PULLED));
        label(painter, place + vec2(10.0, 12.0), Align2::LEFT_CENTER, &text, 13.0);
    }
}

/// Time, forces and what else there is to say, as a picture without the window says them.
pub fn caption(snapshot: &Snapshot, run: &RunSnapshot, remarks: &[String]) -> String {
    let mut text = format!("t = {:.2} s", snapshot.time);
    for hold in &run.held {
        text.push_str(&format!("   pull {}", newtons(hold.force.length())));
    }
    for patch in run.measures.scene_patches.iter().filter(|patch| patch.force.length() > 0.0) {
        text.push_str(&format!("   {} {}", patch.name, newtons(patch.force.length())));
    }
    for remark in inverted(run).iter().chain(remarks) {
        text.push_str(&format!("   {remark}"));
    }
    text
}

/// How far a simulation is from the reference, and the second one from the first: lines of text.
pub fn distances(snapshot: &Snapshot, setup: &Setup, number: usize) -> Vec<String> {
    let (Some(run), ghost) = (snapshot.runs.get(number), snapshot.ghost(setup)) else {
        return Vec::new();
    };
    let first = snapshot.runs.first().filter(|_| number > 0);
    let to = |other: Option<&RunSnapshot>, name: &str| {
        let distance = millimetres(run.distance(other?));
        Some(format!("at most {distance} from {name}"))
    };
    let lines = [to(ghost, "the reference, the ghost"), to(first, "A")];
    lines.into_iter().flatten().collect()
}

/// A small distance [m] as it is written everywhere: "0.25 mm".
fn millimetres(distance: f64) -> String {
    match 1e3 * distance {
        0.0 => "0 mm".to_owned(),
        distance if distance < 0.01 => format!("{:.2} µm", 1e3 * distance),
        distance if distance < 10.0 => format!("{distance:.2} mm"),
        distance => format!("{distance:.0} mm"),
    }
}

/// Names a picture, where it has a name, with lines of small letters below.
pub fn title(painter: &Painter, area: Rect, text: &str, lines: &[String]) {
    let mut place = area.left_top() + vec2(14.0, 20.0);
    if !text.is_empty() {
        label(painter, place, Align2::LEFT_CENTER, text, 20.0);
        place.y += 26.0;
    }
    for line in lines {
        label(painter, place, Align2::LEFT_CENTER, line, 13.0);
        place.y += 20.0;
    }
}

/// Dark letters on a light ground, which stand out from tissue and from the background.
fn label(painter: &Painter, place: Pos2, anchor: Align2, text: &str, size: f32) {
    let ink = Color32::from_rgb(24, 28, 36);
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(size), ink);
    let rect = anchor.anchor_size(place, galley.size());
    // A label at the edge is pushed inside: half a number is worse than one beside its place.
    let area = painter.clip_rect().shrink(8.0);
    let inside = rect.min.max(area.min).min(area.max - rect.size());
    let rect = Rect::from_min_size(inside, rect.size());
    painter.rect_filled(
        rect.expand2(vec2(5.0, 2.0)),
        CornerRadius::same(4),
        Color32::from_white_alpha(205),
    );
    painter.galley(rect.min, galley, ink);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_ends_at_a_round_number_and_stays_calm() {
        assert_eq!([0.011, 0.1, 730.0, 9.5].map(round_up), [0.012, 0.1, 800.0, 10.0]);
        let mut legend = Legend::default();
        let mut after = |largest: f32| {
            legend.follow(Coloring::Displacement, [0.0, largest, f32::NAN].into_iter());
            legend.range().map(|range| range[1])
        };
        assert_eq!(after(0.011), Some(0.012));
        assert_eq!(after(0.004), Some(0.012));
        assert_eq!(after(0.013), Some(0.015));
        assert_eq!(after(0.002), Some(0.002));
        assert_eq!(after(1e-9), Some(1e-4));
    }

    #[test]
    fn a_few_extreme_values_do_not_take_the_scale() {
        let mut legend = Legend::default();
        // Stress of 1 to 5 kPa at a thousand vertices; four beside an inverted tetrahedron, and its own without.
        let many = (0..1000).map(|k| 1e3 + 4.0 * k as f32);
        let few = [2e7, 3e8, 1.2345e9, 5e7, f32::NAN, f32::NAN, f32::INFINITY];
        legend.follow(Coloring::Stress, many.clone().chain(few));
        assert_eq!(legend.range(), Some([0.0, 5e3]));
        assert_eq!(legend.remarks(), ["largest 1.23 GPa", "grey: inverted"]);
        legend.follow(Coloring::Stress, many);
        assert_eq!((legend.range(), legend.remarks().len()), (Some([0.0, 5e3]), 0));
        // All displacements are meant.
        legend.follow(Coloring::Displacement, (0..1000).map(|k| if k == 7 { 0.03 } else { 1e-3 }));
        assert_eq!(legend.range(), Some([0.0, 0.03]));
        // Of few values none is left out.
        legend.follow(Coloring::Strain, [0.1, 0.2, 0.9].into_iter());
        assert_eq!(legend.range(), Some([0.0, 1.0]));
        legend.follow(Coloring::Strain, [f32::NAN].into_iter());
        assert_eq!(legend.range(), None);
    }

    #[test]
    fn forces_are_read_at_a_glance() {
        assert_eq!([0.0123, 1.254, 120.4].map(newtons), ["12.3 mN", "1.25 N", "120 N"]);
        let distances = [0.0, 1.5e-6, 8.3e-4, 0.032].map(millimetres);
        assert_eq!(distances, ["0 mm", "1.50 µm", "0.83 mm", "32 mm"]);
    }
}
