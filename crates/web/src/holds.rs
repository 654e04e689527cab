//! Hands: what each holds, and the plane in which it is led.

use viscera::scalar::Vec3;
use viscera_render::Orbit;
use viscera_stage::{HoldId, Lens, meet_plane};

/// One hand.
#[derive(Clone, Copy, Debug)]
pub struct Hand {
    /// The caller's number.
    pub id: HoldId,
    /// The run whose picture it was laid on.
    pub run: usize,
    /// Where the tissue was taken [m]: the plane goes through it.
    pub taken: Vec3<f64>,
}

impl Hand {
    /// The way [m] from where it was taken to a place of the screen, in the plane parallel to the picture; nothing where the
    /// place is beyond the horizon.
    pub fn way_to(&self, lens: &Lens, place: [f64; 2]) -> Option<Vec3<f64>> {
        let orbit: &Orbit = &lens.orbit;
        let [_, _, normal] = orbit.axes();
        let point = meet_plane(orbit.position(), lens.ray(place), self.taken, normal)?;
        Some(point - self.taken)
    }
}
