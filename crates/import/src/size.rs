//! How fine a body is filled.

/// Edges of lattices that people ask for are at least this long [m]: finer than any scan.
const SHORTEST: f64 = 0.2e-3;

/// Tetrahedra of a cube of the lattice.
const OF_A_CUBE: f64 = 12.0;

/// How fine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fineness {
    /// Longest edges inside [m].
    Edge(f64),
    /// About so many tetrahedra in all bodies together.
    Count(usize),
}

impl Fineness {
    /// The length of a lattice's cubes [m] for bodies of these volumes [m^3].
    pub fn spacing(self, volume: f64) -> f64 {
        match self {
            Self::Edge(edge) => edge,
            Self::Count(count) => {
                // Those at the surface are cut, and smaller.
                let of_inside = 0.8 * count.max(1) as f64;
                libm::cbrt(OF_A_CUBE * volume / of_inside).max(SHORTEST)
            }
        }
    }
}
