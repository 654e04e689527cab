//! The memory of XPBD beside the data of a step.

use super::acceleration::Chebyshev;
use super::iterates::{Iterate, Mixing};
use crate::layout::Layout;
use crate::scalar::Real;
use crate::scalar::lanes::Point;
use crate::settings::{Acceleration, AndersonOn, SolverSettings};

/// Memory of XPBD: copies of split vertices, and iterates for the acceleration.
#[derive(Clone, Debug)]
pub struct Memory<S> {
    /// Points of the copies; empty where nothing is split.
    pub copies: Vec<Point<S>>,
    /// Iterate before the sweep, and the one before that.
    pub iterate: [Iterate<S>; 2],
    /// The diagonal of `a~` of every multiplier; empty but for Chebyshev.
    pub multiplier_weights: Vec<S>,
    /// Of each part, where it is in use.
    pub chebyshev: Vec<Chebyshev>,
    /// Of each part, where Anderson is in use.
    pub mixings: Vec<Mixing<S>>,
    /// Positions of a part that Anderson has mixed [m].
    pub mixed: Vec<S>,
}

impl<S: Real> Memory<S> {
    /// Memory for the steps of a model.
    pub fn new(layout: &Layout<S>, settings: &SolverSettings) -> Self {
        let [chebyshev, anderson] = [Acceleration::Chebyshev, Acceleration::Anderson]
            .map(|acceleration| settings.acceleration == acceleration);
        let points =
            |wanted: bool| vec![Point::default(); if wanted { layout.vertex_count() } else { 0 }];
        let iterate = |wanted: bool| Iterate {
            positions: points(wanted),
            multipliers: vec![S::ZERO; if wanted { layout.multiplier_count } else { 0 }],
        };
        let window = settings.anderson_window as usize;
        let parts = |wanted: bool| if wanted { &layout.parts[..] } else { &[] };
        let largest = parts(anderson).iter().map(|part| part.vertices.len()).max().unwrap_or(0);
        Self {
            copies: vec![Point::default(); if layout.is_split() { layout.copy_count() } else { 0 }],
            iterate: [iterate(chebyshev || anderson), iterate(chebyshev)],
            multiplier_weights: vec![S::ZERO; if chebyshev { layout.multiplier_count } else { 0 }],
            chebyshev: vec![Chebyshev::default(); parts(chebyshev).len()],
            mixings: parts(anderson).iter().map(|part| Mixing::new(part, window)).collect(),
            mixed: vec![S::ZERO; 3 * largest],
        }
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.copies[..])
            + self.iterate.iter().map(|i| size_of_val(&i.positions[..])).sum::<usize>()
            + self.iterate.iter().map(|i| size_of_val(&i.multipliers[..])).sum::<usize>()
            + size_of_val(&self.multiplier_weights[..])
            + size_of_val(&self.chebyshev[..])
            + self.mixings.iter().map(|m| size_of_val(m) + m.bytes()).sum::<usize>()
            + size_of_val(&self.mixed[..])
    }
}

/// Whether stages put loads on copies.
pub fn needs_loads(settings: &SolverSettings) -> bool {
    settings.rebase
        || (settings.acceleration == Acceleration::Anderson
            && settings.anderson_on == AndersonOn::Multipliers)
}
