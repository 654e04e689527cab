//! The camera, and what colours and grounds show.

use viscera::scalar::Vec3;
use viscera_picture::{HALF_OPENING, ViewDirection};
use viscera_render::Orbit;
use viscera_stage::{Area, Coloring, Lens};

use crate::session::Session;

/// Angle that the view turns by for a drag across its height [degrees].
const TURN: f64 = 200.0;

impl Session {
    /// Turns the view for a drag [pixels].
    pub fn turn(&mut self, dx: f64, dy: f64) {
        let height = f64::from(self.size[1].max(1));
        self.orbit.turn(-TURN * dx / height, TURN * dy / height);
    }

    /// Moves what is looked at with a drag [pixels].
    pub fn pan(&mut self, dx: f64, dy: f64) {
        let height = f64::from(self.size[1].max(1));
        self.orbit.pan(dx / height, -dy / height);
    }

    /// Goes nearer (a factor below 1) or farther.
    pub fn zoom(&mut self, factor: f64) {
        self.orbit.zoom(factor);
    }

    /// Looks at everything from where the scene wants to be seen.
    pub fn home(&mut self) {
        let Some(loaded) = &self.loaded else { return };
        self.orbit = Orbit::framing(loaded.assembly.builder.positions());
        self.extent = 2.0 * self.orbit.distance * HALF_OPENING;
        self.middle = self.orbit.target;
        let direction = ViewDirection::from_vector(loaded.scene.output.view_from);
        (self.orbit.azimuth, self.orbit.elevation) = (direction.azimuth, direction.elevation);
    }

    /// The size of the picture [pixels].
    pub fn resize(&mut self, width: u32, height: u32) {
        self.size = [width, height].map(|side| side.clamp(1, 8192));
    }

    /// What colours show.
    pub fn color(&mut self, kind: &str) -> Result<(), String> {
        self.coloring = match kind {
            "tissue" => Coloring::Plain,
            "displacement" => Coloring::Displacement,
            "strain" => Coloring::Strain,
            "stress" => Coloring::Stress,
            "contact" => Coloring::Pressure,
            other => {
                return Err(format!(
                    "colours show tissue, displacement, strain, stress or contact, not `{other}`"
                ));
            }
        };
        self.look()
    }

    /// The scale of the colours: the upper end and its text; nothing for plain tissue.
    pub fn legend(&self) -> Option<(String, f32, String)> {
        let [_, high] = self.legend.range()?;
        Some((self.legend.title().to_owned(), high, self.legend.text(high)))
    }

    /// Whether the triangles' edges are drawn.
    pub fn show_wireframe(&mut self, on: bool) {
        self.wireframe = on;
    }

    /// Whether the ground behind is dark.
    pub fn set_dark(&mut self, dark: bool) {
        self.dark = dark;
    }

    /// From where [m] and in which direction the viewer looks through a place [pixels].
    pub fn ray(&self, place: [f64; 2]) -> (Vec3<f64>, Vec3<f64>) {
        let lenses = self.lenses();
        let lens = lenses.iter().find(|lens| lens.area.contains(place)).or(lenses.first());
        lens.map_or_else(Default::default, |lens| (lens.orbit.position(), lens.ray(place)))
    }

    /// Where a point [m] is seen in the picture of a simulation [pixels]; nothing where it is behind the viewer.
    pub fn seen(&self, run: usize, point: Vec3<f64>) -> Option<[f64; 2]> {
        self.lenses().get(run)?.place(point)
    }

    /// The part of the picture, and the camera, of each simulation: beside each other where it is wide, else one above the
    /// other.
    pub(crate) fn lenses(&self) -> Vec<Lens> {
        let [width, height] = self.size.map(f64::from);
        let count = self.runs.len().max(1);
        let share = 1.0 / count as f64;
        let area = |number: usize| match width >= height {
            true => {
                Area { left: number as f64 * share * width, top: 0.0, width: share * width, height }
            }
            false => Area {
                left: 0.0,
                top: number as f64 * share * height,
                width,
                height: share * height,
            },
        };
        (0..count).map(|number| Lens::new(&self.orbit, area(number), 0.0)).collect()
    }
}
