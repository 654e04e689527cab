//! What is written over a picture: the legend of its colours, forces in newtons, its title.

use eframe::egui::{
    Align2, Color32, CornerRadius, FontId, Mesh, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2,
};
use viscera::scalar::Vec3;
use viscera_picture::{BodyColor, Color, map_color};
use viscera_stage::{
    Legend, RunSnapshot, ToolSnapshot, arrow_end, inverted, millimetres, newton_millimetres,
    newtons,
};

use super::lens::Lens;
use crate::engine::{Setup, Snapshot};
use crate::holds::Holds;

/// A colour of the renderer's as the window has it.
pub fn on_screen(color: Color) -> Color32 {
    let [r, g, b] = color.to_srgb();
    Color32::from_rgb(r, g, b)
}

/// Width of a legend with the margin beside it [points].
const WIDTH: f32 = 136.0;

/// What a legend takes of the right edge of a picture [points].
pub fn legend_width(legend: &Legend, names: &[BodyColor], painter: &Painter) -> f32 {
    match (legend.range(), names) {
        (_, []) => legend.range().map_or(0.0, |_| WIDTH),
        _ => names_width(names, painter) + 2.0 * BESIDE,
    }
}

/// Of a list of names: what lies around it, the height of a line, the side of a patch of colour [points].
const BESIDE: f32 = 8.0;
const NAME_LINE: f32 = 18.0;
const PATCH: f32 = 11.0;

/// Letters of a name that are shown; the end of a longer one is left out.
const LONGEST_NAME: usize = 24;

/// A name in words, if need be shortened.
fn in_words(name: &str) -> String {
    let name = name.replace('_', " ");
    match name.chars().count() {
        count if count > LONGEST_NAME => {
            name.chars().take(LONGEST_NAME - 1).chain("…".chars()).collect()
        }
        _ => name,
    }
}

/// Of the list with its patches of colour, without what lies around it.
fn names_width(names: &[BodyColor], painter: &Painter) -> f32 {
    let width = |body: &BodyColor| {
        let font = FontId::proportional(12.0);
        painter.layout_no_wrap(in_words(&body.name), font, Color32::BLACK).size().x
    };
    PATCH + 6.0 + names.iter().map(width).fold(64.0, f32::max)
}

/// The names that fit into a height [points], and how many are left out.
fn fitting(count: usize, height: f32) -> (usize, usize) {
    let lines = ((height / NAME_LINE).floor().max(2.0)) as usize;
    // The last line says how many there are besides.
    let shown = if count <= lines { count } else { lines - 1 };
    (shown, count - shown)
}

/// Writes the names of bodies into the right upper corner, each behind a patch of its colour.
pub fn paint_names(bodies: &[BodyColor], painter: &Painter, area: Rect) {
    let (shown, left_out) = fitting(bodies.len(), area.height() - 4.0 * BESIDE);
    let lines = shown + usize::from(left_out > 0);
    let size = vec2(names_width(bodies, painter), NAME_LINE * lines as f32);
    let corner = area.right_top() + vec2(-BESIDE, BESIDE);
    let back = Rect::from_min_max(
        corner - vec2(size.x + 2.0 * BESIDE, 0.0),
        corner + vec2(0.0, size.y + BESIDE),
    );
    painter.rect_filled(back, CornerRadius::same(6), Color32::from_white_alpha(190));
    let font = FontId::proportional(12.0);
    let ink = Color32::from_rgb(30, 34, 42);
    let left = back.left() + BESIDE;
    let middle = |line: usize| back.top() + 0.5 * BESIDE + NAME_LINE * (line as f32 + 0.5);
    for (line, body) in bodies.iter().take(shown).enumerate() {
        let place = pos2(left + 0.5 * PATCH, middle(line));
        let patch = Rect::from_center_size(place, vec2(PATCH, PATCH));
        painter.rect_filled(patch, CornerRadius::same(2), on_screen(body.color));
        let place = pos2(left + PATCH + 6.0, middle(line));
        painter.text(place, Align2::LEFT_CENTER, in_words(&body.name), font.clone(), ink);
    }
    if left_out > 0 {
        let place = pos2(left, middle(shown));
        painter.text(place, Align2::LEFT_CENTER, format!("and {left_out} more"), font, ink);
    }
}

/// Writes a legend into the right upper corner.
pub fn paint_legend(legend: &Legend, painter: &Painter, area: Rect) {
    let Some([_, high]) = legend.range() else { return };
    const SIZE: [f32; 2] = [14.0, 150.0];
    let corner = area.right_top() + vec2(-92.0, 36.0);
    let bar = Rect::from_min_size(corner, SIZE.into());
    const LINE: f32 = 15.0;
    let remarks = legend.remarks();
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
    painter.text(above, Align2::CENTER_CENTER, legend.title(), font.clone(), ink);
    for share in [0.0, 0.5, 1.0] {
        let y = bar.bottom() - share * bar.height();
        painter.line_segment(
            [pos2(bar.right(), y), pos2(bar.right() + 4.0, y)],
            Stroke::new(1.0, ink),
        );
        let place = pos2(bar.right() + 7.0, y);
        painter.text(place, Align2::LEFT_CENTER, legend.text(share * high), font.clone(), ink);
    }
    for (number, remark) in remarks.iter().enumerate() {
        let y = bar.bottom() + 20.0 + LINE * number as f32;
        let place = pos2(back.center().x, y);
        painter.text(place, Align2::CENTER_CENTER, remark, font.clone(), ink);
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

/// The force on the tissue of each tool, beside its arrow, with a bar of what it may be off by; its torque below.
pub fn tools(painter: &Painter, lens: &Lens, run: &RunSnapshot, metres_per_newton: f64) {
    for tool in run.tools.iter().filter(|tool| tool.met.touches > 0) {
        let end = arrow_end(tool, metres_per_newton);
        let places = lens.place(tool.pose.translation).zip(lens.place(end));
        let Some((from, to)) = places.filter(|(a, b)| a.is_finite() && b.is_finite()) else {
            continue;
        };
        error_bar(painter, lens, tool, metres_per_newton);
        let side =
            if to.x < from.x { (Align2::RIGHT_CENTER, -12.0) } else { (Align2::LEFT_CENTER, 12.0) };
        let text = format!("{} {}", tool.met.name, tool.force_text());
        let place = label(painter, to + vec2(side.1, 0.0), side.0, &text, 15.0);
        let mut remarks = newton_millimetres(tool.torque());
        if tool.is_locked() {
            remarks.push_str(", locked");
        }
        if tool.met.has_jumped {
            remarks.push_str(", was put elsewhere");
        }
        label(painter, place.left_bottom() + vec2(0.0, 12.0), Align2::LEFT_CENTER, &remarks, 12.0);
    }
}

/// Along the arrow, from the force less its error to the force and its error.
fn error_bar(painter: &Painter, lens: &Lens, tool: &ToolSnapshot, metres_per_newton: f64) {
    let (Some(error), force) = (tool.met.error, tool.force()) else { return };
    let at = |force_there: f64| {
        let along = -Vec3::from_f64(tool.met.force) * (force_there / force * metres_per_newton);
        lens.place(tool.pose.translation + along).filter(|place| place.is_finite())
    };
    let (Some(low), Some(high)) = (at((force - error).max(0.0)), at(force + error)) else { return };
    let across = (high - low).normalized().rot90() * 5.0;
    let stroke = Stroke::new(1.5, Color32::from_rgb(24, 28, 36));
    painter.line_segment([low, high], stroke);
    for end in [low, high] {
        painter.line_segment([end - across, end + across], stroke);
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
    for tool in run.tools.iter().filter(|tool| tool.met.touches > 0) {
        text.push_str(&format!("   {} {}", tool.met.name, tool.force_text()));
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

/// Dark letters on a light ground, which stand out from tissue and from the background. Returns where they are.
fn label(painter: &Painter, place: Pos2, anchor: Align2, text: &str, size: f32) -> Rect {
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
    rect
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_do_not_fit_are_counted() {
        assert_eq!(fitting(3, 200.0), (3, 0));
        assert_eq!(fitting(11, 11.0 * NAME_LINE), (11, 0));
        assert_eq!(fitting(12, 11.0 * NAME_LINE), (10, 2));
        assert_eq!(fitting(5, 1.0), (1, 4));
        assert_eq!(in_words("kidney_left"), "kidney left");
        assert_eq!(in_words(&"long_".repeat(9)).chars().count(), LONGEST_NAME);
    }
}
