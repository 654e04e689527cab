//! What pictures are made of, whichever renderer draws them, as plain data: in software here, on the graphics
//! processor in `viscera-render`.

use viscera::scalar::Vec3;

use crate::color::Color;

/// What a surface is coloured with; `V` holds the values, as a slice or on a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Paint<V> {
    /// Wet tissue of one colour everywhere.
    Flat(Color),
    /// Colours of [`crate::map_color`] for one value per vertex.
    Values(V),
}

/// Small spheres: vertices that are held or pulled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Markers<'a> {
    /// Centres [m], shape [marker_count].
    pub positions: &'a [Vec3<f64>],
    /// Radius [m].
    pub radius: f64,
    /// Colour, usually [`Color::FIXED`] or [`Color::PULLED`].
    pub color: Color,
    /// How strongly a marker behind tissue shines through, 0 (not at all) to 1.
    pub see_through: f32,
}

/// A solid arrow: the direction of a pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow {
    /// Where it begins [m].
    pub from: Vec3<f64>,
    /// Where it points to [m].
    pub to: Vec3<f64>,
    /// Radius of its shaft [m].
    pub radius: f64,
    /// Its colour.
    pub color: Color,
}

/// What lies behind: from one colour above to another below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Background {
    /// At the upper edge.
    pub top: Color,
    /// At the lower edge.
    pub bottom: Color,
}

impl Default for Background {
    /// A very soft gradient, lighter above.
    fn default() -> Self {
        let [top, bottom] = [[252, 252, 253], [232, 236, 241]].map(Color::from_srgb);
        Self { top, bottom }
    }
}
