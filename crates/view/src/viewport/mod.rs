//! The tissue in the window: looking around it, pressing on it, pulling it.

mod leading;
mod lens;
mod overlay;
mod picture;
mod pressing;

pub use lens::Lens;
pub use overlay::on_screen;
pub use picture::{Gpu, Picture};
use pressing::Pressed;

use eframe::egui::{self, PointerButton, Pos2, Rect, Sense, Ui, vec2};
use std::sync::Arc;
use viscera::scalar::Vec3;
use viscera_picture::{BodyColor, HALF_OPENING, Image, ImageSize, Overlay, ViewDirection};
use viscera_render::Orbit;
use viscera_stage::{
    Coloring, ForceScale, HandId, Legend, PictureContents, RunSurface, Surroundings, meet_plane,
};

use crate::engine::{Command, Setup, Snapshot};
use crate::hands::Hands;
use crate::holds::Holds;
use crate::preferences::Preferences;

/// A press so near to where something is held takes that up again [points].
const NEAR: f32 = 14.0;

/// Angle that the view turns by for a drag across its height [degrees].
const TURN: f64 = 200.0;

/// One picture for each solver, all with one camera.
pub struct Viewport {
    gpu: Gpu,
    setup: Option<Arc<Setup>>,
    orbit: Orbit,
    extent: f64,
    /// The middle of things at rest [m].
    middle: Vec3<f64>,
    /// Of the tissue now, along z [m].
    highest: f64,
    surfaces: Vec<RunSurface>,
    pictures: Vec<Picture>,
    fixed: Vec<u32>,
    /// Names and colours of bodies.
    bodies: Vec<BodyColor>,
    legend: Legend,
    force_scale: ForceScale,
    /// What each picture was seen through last.
    lenses: Vec<Lens>,
    /// What the pictures show.
    drawn: Option<DrawnInputs>,
    /// What the mouse asked for and cannot have.
    told: Option<String>,
    /// The left button went down, and where tissue was then is not known yet.
    pressed: Option<Pressed>,
}

/// What pictures are drawn from: two equal ones give the same pictures.
#[derive(Clone, PartialEq)]
struct DrawnInputs {
    snapshot: (u64, u64),
    orbit: Orbit,
    sizes: Vec<ImageSize>,
    coloring: Coloring,
    range: Option<[f32; 2]>,
    marks: [bool; 3],
    holds: usize,
    in_hand: Option<HandId>,
}

impl Viewport {
    /// An empty one.
    pub fn new(gpu: Gpu) -> Self {
        Self {
            gpu,
            setup: None,
            orbit: Orbit::framing(&[]),
            extent: 0.1,
            middle: Vec3::ZERO,
            highest: 0.0,
            surfaces: Vec::new(),
            pictures: Vec::new(),
            fixed: Vec::new(),
            bodies: Vec::new(),
            legend: Legend::default(),
            force_scale: ForceScale::default(),
            lenses: Vec::new(),
            drawn: None,
            told: None,
            pressed: None,
        }
    }

    /// Takes up simulations that were built. The camera stays where it is for the same bodies.
    pub fn enter(&mut self, setup: &Arc<Setup>) -> Result<(), String> {
        let rest = |setup: &Setup| setup.assembly.builder.positions().to_vec();
        let known = self.setup.as_ref().is_some_and(|old| rest(old) == rest(setup));
        self.surfaces = (0..setup.run_count)
            .map(|_| RunSurface::new(&self.gpu.device, &setup.assembly))
            .collect::<Result<_, _>>()?;
        self.setup = Some(Arc::clone(setup));
        self.fixed = setup.assembly.fixings.iter().flat_map(|p| p.vertices.clone()).collect();
        self.bodies = BodyColor::of(&setup.assembly);
        self.drawn = None;
        if !known {
            self.fit_view();
        }
        Ok(())
    }

    /// Looks at everything from where the scene wants to be seen.
    pub fn fit_view(&mut self) {
        let Some(setup) = &self.setup else { return };
        let rest = setup.assembly.builder.positions();
        self.orbit = Orbit::framing(rest);
        self.extent = 2.0 * self.orbit.distance * HALF_OPENING;
        self.middle = self.orbit.target;
        let direction = ViewDirection::from_vector(setup.scene.output.view_from);
        (self.orbit.azimuth, self.orbit.elevation) = (direction.azimuth, direction.elevation);
    }

    /// Why nothing can be drawn any more, where the device was lost.
    pub fn lost(&self) -> Option<String> {
        self.gpu.failure()
    }

    /// What the first picture was seen through last.
    pub fn lens(&self) -> Option<&Lens> {
        self.lenses.first()
    }

    /// The camera.
    pub fn orbit(&self) -> &Orbit {
        &self.orbit
    }

    /// How many pictures there are side by side.
    fn shown_runs(&self) -> usize {
        self.setup.as_ref().map_or(0, |setup| setup.run_count - usize::from(setup.has_ghost))
    }

    /// Takes over a new snapshot.
    pub fn place(&mut self, snapshot: &Snapshot) -> Result<(), String> {
        if self.setup.as_ref().is_none_or(|setup| setup.generation != snapshot.generation) {
            return Ok(());
        }
        let assembly = self.setup.as_ref().map(|setup| Arc::clone(&setup.assembly));
        for (surface, run) in self.surfaces.iter_mut().zip(&snapshot.runs) {
            assembly.iter().try_for_each(|assembly| surface.place(run, assembly))?;
        }
        if snapshot.number == 0 {
            self.force_scale = ForceScale::default();
        }
        snapshot.runs.iter().for_each(|run| self.force_scale.follow(&run.tools));
        let heights = snapshot.runs.iter().flat_map(|run| &run.positions).map(|x| x.z);
        let highest = heights.filter(|z| z.is_finite()).reduce(f32::max);
        self.highest = highest.map_or(self.middle.z, f64::from);
        let shown = snapshot.runs.iter().take(self.shown_runs());
        // The scale follows the frames that are read, several times a second.
        if shown.clone().all(|run| run.unread == 0) {
            let values = shown.flat_map(|run| run.values.iter().copied());
            self.legend.follow(snapshot.coloring, values);
        }
        Ok(())
    }

    /// Shows everything, and says what the mouse asks for.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        snapshot: Option<&Snapshot>,
        hands: &mut Hands,
        preferences: &Preferences,
    ) -> (Vec<Command>, Option<String>) {
        let area = ui.available_rect_before_wrap();
        let count = self.shown_runs().max(1);
        let mut commands = Vec::new();
        let width = (area.width() - 2.0 * (count as f32 - 1.0)) / count as f32;
        let rects: Vec<Rect> = (0..count)
            .map(|i| {
                let left = area.left() + i as f32 * (width + 2.0);
                Rect::from_min_size(egui::pos2(left, area.top()), vec2(width, area.height()))
            })
            .collect();
        let names = named(&self.bodies, preferences.coloring);
        let taken = overlay::legend_width(&self.legend, names, ui.painter());
        self.lenses = rects.iter().map(|rect| Lens::new(&self.orbit, *rect, taken)).collect();
        for (number, rect) in rects.iter().enumerate() {
            let id = ui.scope_id().with(("viewport", number));
            let response = ui.interact(*rect, id, Sense::drag());
            let label = if count > 1 { ["view A", "view B"][number.min(1)] } else { "view" };
            response.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::Canvas, ui.is_enabled(), label)
            });
            let lens = self.lenses[number];
            if let Some(snapshot) = snapshot {
                self.handle(
                    ui,
                    &response,
                    &lens,
                    number,
                    snapshot,
                    hands,
                    preferences,
                    &mut commands,
                );
            }
        }
        // The mouse may have turned the view.
        self.lenses = rects.iter().map(|rect| Lens::new(&self.orbit, *rect, taken)).collect();
        let drawn = snapshot.map(|snapshot| self.draw(ui, snapshot, hands, preferences));
        for (number, lens) in self.lenses.iter().enumerate() {
            self.paint(ui, lens, number, snapshot, &hands.holds, preferences);
        }
        (commands, drawn.and_then(Result::err).or(self.told.take()))
    }

    /// What the mouse does in one of the pictures.
    #[expect(clippy::too_many_arguments, reason = "the window's state, lent for one event")]
    fn handle(
        &mut self,
        ui: &Ui,
        response: &egui::Response,
        lens: &Lens,
        run: usize,
        snapshot: &Snapshot,
        hands: &mut Hands,
        preferences: &Preferences,
        commands: &mut Vec<Command>,
    ) {
        // A slow window hears of a button and of keys that went with it in one frame: what counts is what was
        // down, and where the pointer was, at that moment.
        let (modifiers, pressed_at) = ui.input(|input| {
            let of_button = |event: &egui::Event| match event {
                egui::Event::PointerButton { modifiers, .. } => Some(*modifiers),
                _ => None,
            };
            let last = input.events.iter().rev().find_map(of_button);
            (last.unwrap_or(input.modifiers), input.pointer.press_origin())
        });
        if let Some(pointer) = response.interact_pointer_pos() {
            if response.drag_started_by(PointerButton::Primary) {
                let at = pressed_at.unwrap_or(pointer);
                self.pressed = Some(Pressed { run, at, only_tools: modifiers.command });
            }
            // It is answered as soon as the window knows where tissue is, at once in most cases.
            if let Some(Pressed { at, only_tools, .. }) = self.pressed.filter(|p| p.run == run) {
                if snapshot.runs.get(run).is_some_and(|run| run.unread == 0) {
                    self.pressed = None;
                    let grip = (!only_tools).then_some(&preferences.grip);
                    self.press(lens, run, snapshot, at, hands, grip, commands);
                } else {
                    commands.push(Command::Look);
                }
            }
            if hands.instruments.dragged().is_some() {
                self.lead(ui, lens, (pointer, response.drag_delta()), modifiers, hands, commands);
            } else if let Some(plane) = hands.holds.drag_plane() {
                let [_, _, normal] = self.orbit.axes();
                let (from, direction) = (lens.orbit().position(), lens.ray(pointer));
                if response.drag_delta() != vec2(0.0, 0.0)
                    && let Some(point) = meet_plane(from, direction, plane, normal)
                {
                    commands.extend(hands.holds.lead(point));
                }
            } else if response.dragged() && self.pressed.is_none() {
                self.look_around(response, lens, modifiers);
            }
        }
        if response.drag_stopped() {
            self.pressed = None;
            hands.instruments.drop_dragged();
            commands.extend(hands.holds.release(preferences.grip.keep || modifiers.shift));
        }
        if response.contains_pointer() && hands.instruments.dragged().is_none() {
            let (scroll, pinch) =
                ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
            self.orbit.zoom(f64::from((-0.0015 * scroll).exp() / pinch));
        }
    }

    /// Where instruments are led.
    pub fn surroundings(&self) -> Surroundings {
        let Self { orbit, middle, extent, .. } = *self;
        let top = Vec3 { z: self.highest, ..middle };
        Surroundings { orbit, middle, top, extent }
    }

    /// The pointer leads the instrument that it drags.
    fn lead(
        &mut self,
        ui: &Ui,
        lens: &Lens,
        moved: (Pos2, egui::Vec2),
        modifiers: egui::Modifiers,
        hands: &mut Hands,
        commands: &mut Vec<Command>,
    ) {
        let Some(held) = hands.instruments.dragged() else { return };
        let scroll = ui.input(|input| input.smooth_scroll_delta.y);
        let nudge = leading::nudge(held, lens, moved, scroll, modifiers, self.extent);
        let hand = held.id;
        match hands.instruments.nudge(hand, &nudge, &self.surroundings()) {
            Ok(acts) => commands.extend(acts.into_iter().map(Command::Tool)),
            Err(told) => self.told = Some(told),
        }
    }

    fn look_around(&mut self, response: &egui::Response, lens: &Lens, modifiers: egui::Modifiers) {
        let moved = response.drag_delta();
        let height = f64::from(lens.rect.height().max(1.0));
        let [x, y] = [f64::from(moved.x) / height, f64::from(moved.y) / height];
        if modifiers.command || modifiers.shift {
            self.orbit.pan(x, -y);
        } else {
            self.orbit.turn(-TURN * x, TURN * y);
        }
    }

    /// Draws what has changed since it was last drawn.
    fn draw(
        &mut self,
        ui: &Ui,
        snapshot: &Snapshot,
        hands: &Hands,
        preferences: &Preferences,
    ) -> Result<(), String> {
        let Some(setup) = &self.setup else { return Ok(()) };
        if snapshot.generation != setup.generation {
            return Ok(());
        }
        let scale = ui.pixels_per_point();
        let sizes: Vec<ImageSize> = self
            .lenses
            .iter()
            .filter_map(|lens| {
                let side = |points: f32| ((points * scale).round() as u32).clamp(16, 4096);
                ImageSize::new(side(lens.rect.width()), side(lens.rect.height())).ok()
            })
            .collect();
        let wanted = DrawnInputs {
            snapshot: (snapshot.generation, snapshot.number),
            orbit: self.lenses.first().map_or(self.orbit, |lens| *lens.orbit()),
            sizes: sizes.clone(),
            coloring: snapshot.coloring,
            range: self.legend.range(),
            marks: [preferences.wireframe, preferences.shadow, preferences.fixings],
            holds: hands.holds.list().len(),
            in_hand: hands.instruments.active().map(|held| held.id),
        };
        if self.drawn.as_ref() == Some(&wanted) {
            return Ok(());
        }
        while self.pictures.len() < sizes.len() {
            self.pictures.push(Picture::default());
        }
        let ghost = setup.has_ghost.then(|| self.surfaces.last()).flatten();
        for (number, size) in sizes.iter().enumerate() {
            let (Some(surface), Some(run)) = (self.surfaces.get(number), snapshot.runs.get(number))
            else {
                continue;
            };
            let at = |&v: &u32| run.positions.get(v as usize).map(|x| x.cast::<f64>());
            let fixed: Vec<Vec3<f64>> = match preferences.fixings {
                true => self.fixed.iter().filter_map(at).collect(),
                false => Vec::new(),
            };
            let (picked, targets): (Vec<_>, Vec<_>) =
                run.held.iter().map(|hold| (hold.place, hold.target)).unzip();
            let contents = PictureContents {
                orbit: *self.lenses[number].orbit(),
                surface,
                ghost,
                range: self.legend.range(),
                bodies: named(&self.bodies, snapshot.coloring),
                wireframe: preferences.wireframe,
                shadow: preferences.shadow,
                fixed: &fixed,
                picked: &picked,
                targets: &targets,
                tools: &run.tools,
                in_hand: wanted.in_hand,
                force_scale: self.force_scale.metres_per_newton(self.extent),
                extent: self.extent,
            };
            self.pictures[number].draw(&self.gpu, *size, &contents)?;
        }
        self.drawn = Some(wanted);
        Ok(())
    }

    fn paint(
        &self,
        ui: &Ui,
        lens: &Lens,
        number: usize,
        snapshot: Option<&Snapshot>,
        holds: &Holds,
        preferences: &Preferences,
    ) {
        let painter = ui.painter_at(lens.rect);
        let Some((texture, snapshot)) =
            self.pictures.get(number).and_then(Picture::texture).zip(snapshot)
        else {
            painter.rect_filled(lens.rect, 0.0, ui.visuals().extreme_bg_color);
            return;
        };
        let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
        painter.image(texture, lens.rect, whole, egui::Color32::WHITE);
        let Some(run) = snapshot.runs.get(number) else { return };
        overlay::scene_patches(&painter, lens, run);
        overlay::forces(&painter, lens, run, holds);
        let scale = self.force_scale.metres_per_newton(self.extent);
        overlay::tools(&painter, lens, run, scale);
        match preferences.coloring {
            Coloring::Plain => {}
            Coloring::Bodies => overlay::paint_names(&self.bodies, &painter, lens.rect),
            _ => overlay::paint_legend(&self.legend, &painter, lens.rect),
        }
        let name = if self.shown_runs() > 1 { ["A", "B"][number.min(1)] } else { "" };
        overlay::title(&painter, lens.rect, name, &self.distances(snapshot, number));
    }

    fn distances(&self, snapshot: &Snapshot, number: usize) -> Vec<String> {
        let setup = self.setup.as_ref();
        setup.map_or_else(Vec::new, |setup| overlay::distances(snapshot, setup, number))
    }

    /// The pictures as they are shown, with scale, time and forces written on them; waits for them.
    pub fn images(&self, snapshot: &Snapshot) -> Result<Vec<Image>, String> {
        let scale = self.legend.scale();
        let names = named(&self.bodies, snapshot.coloring).iter();
        let names: Vec<_> = names.map(|body| (body.name.clone(), body.color)).collect();
        let title = self.setup.as_ref().map_or("", |setup| &setup.scene.title);
        let shown = self.pictures.iter().take(self.shown_runs());
        let mut images = Vec::new();
        for (number, (picture, run)) in shown.zip(&snapshot.runs).enumerate() {
            let mut image = picture.read()?;
            let height = image.size().height();
            let lens = self.lenses.get(number);
            let mut remarks = self.legend.remarks();
            remarks.extend(self.distances(snapshot, number));
            let side = if self.shown_runs() > 1 { [": A", ": B"][number.min(1)] } else { "" };
            let overlay = Overlay {
                title: &format!("{title}{side}"),
                caption: &overlay::caption(snapshot, run, &remarks),
                color_scale: scale.as_ref(),
                legend: &names,
                pixels_per_meter: lens.map(|lens| lens.orbit().pixels_per_meter(height)),
            };
            overlay.draw(&mut image);
            images.push(image);
        }
        Ok(images)
    }
}

/// Bodies, where colours tell them apart.
fn named(bodies: &[BodyColor], coloring: Coloring) -> &[BodyColor] {
    if coloring == Coloring::Bodies { bodies } else { &[] }
}
