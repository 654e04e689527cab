//! Pictures without a device, and what pictures show on either way.

use viscera::contact::Tool;
use viscera::scalar::Vec3;
use viscera_picture::{
    Arrow, Background, Camera, Color, Drawing, Image, ImageSize, Markers, Paint, Surface,
    ViewDirection,
};
use viscera_stage::{Area, RunSnapshot, force_arrows};

use crate::session::Session;

/// Radii of marks as shares of the size of things.
pub(crate) const FIXED: f64 = 0.005;
pub(crate) const PICKED: f64 = 0.009;
pub(crate) const SHAFT: f64 = 0.0045;

/// The ground behind tissue on a dark page.
pub(crate) fn background(dark: bool) -> Background {
    if !dark {
        return Background::default();
    }
    let [top, bottom] = [[30, 34, 41], [14, 16, 20]].map(Color::from_srgb);
    Background { top, bottom }
}

/// Vertices [m] that fixings hold, as they are now.
pub(crate) fn fixed(session: &Session, snapshot: &RunSnapshot) -> Vec<Vec3<f64>> {
    let vertices = session.loaded.iter().flat_map(|loaded| &loaded.fixed);
    let places = vertices.filter_map(|&v| snapshot.positions.get(v as usize));
    places.map(|place| place.cast()).collect()
}

impl Session {
    /// The picture in red, green, blue and opacity, drawn without a device.
    pub fn pixels(&self) -> Vec<u8> {
        let [width, height] = self.size.map(|side| side as usize);
        let mut pixels = vec![255; 4 * width * height];
        for (number, lens) in self.lenses().iter().enumerate() {
            if let Some(image) = self.image(number) {
                put(&image, lens.area, width, &mut pixels);
            }
        }
        pixels
    }

    /// The picture of one simulation; nothing where it has no room.
    fn image(&self, number: usize) -> Option<Image> {
        let (loaded, state) = (self.loaded.as_ref()?, self.runs.get(number)?);
        let lens = self.lenses().into_iter().nth(number)?;
        let size = ImageSize::new(lens.area.width as u32, lens.area.height as u32).ok()?;
        let snapshot = &state.snapshot;
        let mut surface = Vec::new();
        loaded.surfaces(&snapshot.positions, &mut surface);
        let positions: Vec<Vec3<f64>> = surface.iter().map(|x| x.cast()).collect();
        let triangles = loaded.triangles();
        let color_scale = self.legend.scale().filter(|_| !snapshot.values.is_empty());
        // The scale counts in its own unit.
        let factor = match (&color_scale, self.legend.range()) {
            (Some(scale), Some([_, high])) => scale.range()[1] / f64::from(high),
            _ => 1.0,
        };
        let values: Vec<f64> = snapshot.values.iter().map(|v| factor * f64::from(*v)).collect();
        let paint = match color_scale {
            Some(_) => Paint::Values(values.as_slice()),
            None => Paint::Flat(Color::TISSUE),
        };
        let (fixed, picked): (Vec<_>, Vec<_>) =
            (fixed(self, snapshot), snapshot.held.iter().map(|hold| hold.place).collect());
        let balls = |positions, share: f64, color| Markers {
            positions,
            radius: share * self.extent,
            color,
            see_through: 0.0,
        };
        let arrows = snapshot.held.iter().map(|hold| Arrow {
            from: hold.place,
            to: hold.target,
            radius: SHAFT * self.extent,
            color: Color::PULLED,
        });
        // Shorter ones are hidden by the point they begin at.
        let is_long = |arrow: &Arrow| (arrow.to - arrow.from).length() > PICKED * self.extent;
        let tools: Vec<Tool> =
            snapshot.tools.iter().flat_map(|tool| tool.parts.iter().cloned()).collect();
        let scale = self.force_scale.metres_per_newton(self.extent);
        let forces = force_arrows(&snapshot.tools, &lens.orbit, scale, SHAFT * self.extent);
        let drawing = Drawing {
            surfaces: vec![Surface { positions: &positions, triangles: &triangles, paint }],
            markers: vec![
                balls(&fixed, FIXED, Color::FIXED),
                balls(&picked, PICKED, Color::PULLED),
            ],
            tools: &tools,
            arrows: arrows.filter(is_long).chain(forces).collect(),
            color_scale,
            background: background(self.dark),
            ..Drawing::default()
        };
        let orbit = lens.orbit;
        let direction = ViewDirection { azimuth: orbit.azimuth, elevation: orbit.elevation };
        let camera = Camera::at(orbit.target, direction, orbit.distance, size);
        drawing.draw(&camera).ok().map(|drawn| drawn.image)
    }
}

/// Copies an image to its place among pixels of a picture so wide.
fn put(image: &Image, area: Area, width: usize, pixels: &mut [u8]) {
    let [left, top] = [area.left as usize, area.top as usize];
    let row = image.size().width() as usize;
    for (y, line) in image.pixels().chunks(row).enumerate() {
        let first = 4 * ((top + y) * width + left);
        let places = pixels.get_mut(first..).unwrap_or_default().chunks_mut(4);
        for (place, [r, g, b]) in places.zip(line) {
            place.copy_from_slice(&[*r, *g, *b, 255]);
        }
    }
}
