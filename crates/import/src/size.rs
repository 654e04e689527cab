//! How fine bodies are filled, and what that costs.
//!
//! ```text
//! tetrahedra:         n = 12 V/(0.8 s^3)    s: the lattice's spacing; those at the surface are cut, and smaller
//! lattice vertices:   m = 2 B/s^3           B: the box around a body
//! ```

use crate::ImportError;

/// Tetrahedra of a cube of the lattice, and the share that bodies have of those that their volume would hold.
const OF_A_CUBE: f64 = 12.0;
const INSIDE: f64 = 0.8;

/// More tetrahedra than this, all bodies together, take minutes to be made and gigabytes to be simulated.
const MOST_TETS: f64 = 4e6;

/// A lattice of labels is asked so many times: some 10 s.
pub const MOST_OF_LABELS: f64 = 4e7;
/// One of a surface, where the winding number takes longer.
pub const MOST_OF_SURFACES: f64 = 4e6;

/// How fine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fineness {
    /// Longest edges inside [m].
    Edge(f64),
    /// About so many tetrahedra in all bodies together.
    Count(usize),
}

impl Default for Fineness {
    /// As many tetrahedra as run in real time.
    fn default() -> Self {
        Self::Count(20_000)
    }
}

impl Fineness {
    /// The length of a lattice's cubes [m] for bodies of these volumes [m^3].
    pub fn spacing(self, volume: f64) -> f64 {
        match self {
            Self::Edge(edge) => edge,
            Self::Count(count) => spacing_of(volume, count.max(1) as f64),
        }
    }

    /// [`Fineness::spacing`], or why that would take too long, with the nearest value that does not. `largest_box` is that of
    /// one body [m^3], `most` the most vertices of a lattice.
    pub fn affordable(
        self,
        file: &str,
        volume: f64,
        largest_box: f64,
        most: f64,
    ) -> Result<f64, ImportError> {
        let spacing = self.spacing(volume);
        let finest = finest(volume, largest_box, most);
        if spacing >= finest {
            return Ok(spacing);
        }
        let (asked, nearest) = match self {
            Self::Edge(edge) => {
                let nearest = up(1e3 * finest);
                (format!("--edge \"{} mm\"", 1e3 * edge), format!("--edge \"{nearest} mm\""))
            }
            Self::Count(count) => {
                let nearest = down(tets_of(volume, finest));
                (format!("--count {count}"), format!("--count {nearest}"))
            }
        };
        let tets = tets_of(volume, spacing);
        Err(ImportError::TooFine { file: file.into(), asked, tets, nearest })
    }
}

/// The shortest edges [m] that bodies of a volume [m^3] in all, of which one has the largest box [m^3], are filled with.
pub fn finest(volume: f64, largest_box: f64, most: f64) -> f64 {
    spacing_of(volume, MOST_TETS).max(libm::cbrt(2.0 * largest_box / most))
}

/// About so many tetrahedra fill a volume [m^3].
pub fn tets_of(volume: f64, spacing: f64) -> f64 {
    OF_A_CUBE * volume / (INSIDE * spacing * spacing * spacing)
}

/// The spacing [m] of about so many tetrahedra.
pub fn spacing_of(volume: f64, tets: f64) -> f64 {
    libm::cbrt(OF_A_CUBE * volume / (INSIDE * tets))
}

/// To two digits, upwards.
fn up(value: f64) -> f64 {
    let unit = libm::pow(10.0, libm::log10(value).floor() - 1.0);
    let rounded = (value / unit).ceil() * unit;
    // Without the dust of binary fractions.
    format!("{rounded:.6}").parse().unwrap_or(rounded)
}

/// To two digits, downwards.
fn down(value: f64) -> u64 {
    let unit = libm::pow(10.0, libm::log10(value).floor() - 1.0).max(1.0);
    ((value / unit).floor() * unit) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_take_too_long_is_refused_with_a_value_that_does_not() {
        let (volume, largest_box) = (1.5e-3, 4e-3);
        for asked in [Fineness::Edge(1e-5), Fineness::Count(usize::MAX)] {
            let refused = asked.affordable("a.nii", volume, largest_box, MOST_OF_LABELS);
            let message = refused.expect_err("too fine").to_string();
            let nearest = message.rsplit("take ").next().expect("a value");
            let value = nearest.trim_start_matches(|c: char| !c.is_ascii_digit());
            let value = value.trim_end_matches("mm\"").trim();
            let nearest = match asked {
                Fineness::Edge(_) => Fineness::Edge(1e-3 * value.parse::<f64>().expect("mm")),
                Fineness::Count(_) => Fineness::Count(value.parse().expect("a count")),
            };
            let spacing = nearest.affordable("a.nii", volume, largest_box, MOST_OF_LABELS);
            let tets = tets_of(volume, spacing.expect("it fits"));
            assert!((0.7 * MOST_TETS..=MOST_TETS).contains(&tets), "{message}: {tets}");
        }
        assert!(Fineness::default().affordable("a", volume, largest_box, MOST_OF_LABELS).is_ok());
        // A thin body in a large box is limited by its lattice.
        let edge = Fineness::Edge(1e-3).affordable("a", 1e-5, 0.1, MOST_OF_LABELS);
        assert!(edge.expect_err("too many").to_string().contains("take --edge \"1.8 mm\""));
    }
}
