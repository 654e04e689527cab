//! Between places in the window and points in the world.

use eframe::egui::{Pos2, Rect, pos2};
use viscera::scalar::Vec3;
use viscera_render::Orbit;
use viscera_stage::Area;

/// A camera and the part of the window that shows what it sees.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Where in the window [points].
    pub rect: Rect,
    eye: viscera_stage::Lens,
}

impl Lens {
    /// What a camera sees in a part of the window whose right edge, so wide [points], is taken by something else:
    /// what is framed stays out of it.
    pub fn new(orbit: &Orbit, rect: Rect, taken: f32) -> Self {
        let [left, top] = [rect.left(), rect.top()].map(f64::from);
        let [width, height] = [rect.width(), rect.height()].map(f64::from);
        let area = Area { left, top, width, height };
        Self { rect, eye: viscera_stage::Lens::new(orbit, area, f64::from(taken)) }
    }

    /// What the viewer sees, without the window.
    pub fn eye(&self) -> &viscera_stage::Lens {
        &self.eye
    }

    /// Where the viewer is.
    pub fn orbit(&self) -> &Orbit {
        &self.eye.orbit
    }

    /// The direction, of length 1, in which a place of the window lies.
    pub fn ray(&self, place: Pos2) -> Vec3<f64> {
        self.eye.ray([f64::from(place.x), f64::from(place.y)])
    }

    /// Where a point [m] is seen; nothing where it lies behind the viewer.
    pub fn place(&self, point: Vec3<f64>) -> Option<Pos2> {
        self.eye.place(point).map(|[x, y]| pos2(x as f32, y as f32))
    }
}
