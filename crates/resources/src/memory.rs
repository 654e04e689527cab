//! Memory: amounts (`"8 GB"`), what a simulation needs, what the machine has free, and a refusal before the two meet.

use anyhow::{Result, bail};
use std::fmt;
use std::str::FromStr;
use sysinfo::{MemoryRefreshKind, System};
use viscera::settings::{
    Acceleration, Clusters, Colors, Elements, Method, Precision, SolverSettings,
};
use viscera::units::format_number;

/// Units, powers of a thousand.
const UNITS: [(&str, f64); 5] = [("B", 1.0), ("kB", 1e3), ("MB", 1e6), ("GB", 1e9), ("TB", 1e12)];

/// An amount of memory [B].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory(pub u64);

impl FromStr for Memory {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let help = || "write a number and a unit (B, kB, MB, GB, TB), for example \"8 GB\"".into();
        let text = text.trim();
        let end = text.find(|c: char| c.is_ascii_alphabetic()).ok_or_else(help)?;
        let (number, symbol) = text.split_at(end);
        let unit = UNITS.iter().find(|(unit, _)| unit.eq_ignore_ascii_case(symbol));
        match (number.trim().parse::<f64>(), unit) {
            (Ok(number), Some((_, size))) if number > 0.0 && number * size < u64::MAX as f64 => {
                Ok(Self((number * size).round() as u64))
            }
            _ => Err(help()),
        }
    }
}

impl fmt::Display for Memory {
    /// Three digits, in the unit in which that reads best.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.0 as f64;
        let fitting = UNITS.iter().rfind(|(_, size)| bytes >= *size);
        let (unit, size) = fitting.copied().unwrap_or(UNITS[0]);
        let amount = bytes / size;
        let decimals = if amount < 10.0 { 10.0 } else { 1.0 };
        write!(f, "{} {unit}", format_number((amount * decimals).round() / decimals))
    }
}

/// What a mesh and the making of its model take at their peak, model included [B per tetrahedron]:
/// 228 by VmHWM on a bar of 300,000 tetrahedra. Too small, and a machine starts to swap or ends the
/// program; too large, and it is not used in full.
const BUILDING: f64 = 240.0;

/// What `viscera run` takes beside model, state and solver: meshes, surfaces, a frame as VTU [B per tetrahedron]; 390 on a
/// bar of 300,000, 225 on one of a million, likewise; pictures take 60 MB besides, however large the mesh.
const RUNNING: f64 = 490.0;

/// What model, state and solver keep, at most [B per tetrahedron]; without viscosity. Measured 130 to
/// 160 on bars from 10,000 tetrahedra on.
const KEPT: f64 = 170.0;
/// Copies of four corners, their loads, their numbers.
const COPIES: f64 = 150.0;
/// Numbers of the copies where pieces of the explicit method's pass meet. Measured 15 to 22 on bars.
const PIECES: f64 = 30.0;
/// Frames and rings of recovered-gradient tetrahedra, and what passes over them keep. Measured 265 to 315 on bars.
const RECOVERED: f64 = 350.0;
/// Of the quasi-Newton method: pairs, vectors and the levels of its preconditioner. Measured 310 to 620 more than XPBD
/// on bars from 1,000 to 100,000 tetrahedra, the most where the coarsest level is largest.
const LEVELS: f64 = 650.0;
/// Two iterates and the weights of multipliers.
const ITERATES: f64 = 90.0;
/// Six multipliers and a vertex's share in one entry of Anderson's two histories.
const HISTORY: f64 = 2.0 * 7.0 * 4.0;

/// A tetrahedron's lane in a block of eight, and how many tetrahedra a cluster has to have for as many lanes to stay empty as
/// it fills: 0.16 of them do in clusters of 512, at most seven of eight.
const LANE: f64 = 130.0;
const EMPTY: f64 = 100.0;

/// What model, state and solver keep at most [B per tetrahedron].
pub fn kept(settings: &SolverSettings) -> f64 {
    let mut kept = KEPT;
    if settings.colors != Colors::Unlimited {
        kept += COPIES;
    }
    if settings.method == Method::Explicit {
        kept += PIECES;
    }
    if settings.foreseen().of_solver().elements == Elements::Recovered {
        kept += RECOVERED;
    }
    if let Clusters::OfTets(size) = settings.clusters {
        kept += LANE * (EMPTY / f64::from(size)).min(7.0);
    }
    if settings.acceleration != Acceleration::None {
        kept += ITERATES;
    }
    if matches!(settings.foreseen().method, Method::Auto | Method::QuasiNewton) {
        kept += LEVELS;
    }
    if settings.acceleration == Acceleration::Anderson {
        kept += HISTORY * f64::from(settings.anderson_window + 1);
    }
    match settings.precision {
        Precision::F32 => kept,
        Precision::F64 => 2.0 * kept,
    }
}

/// What `viscera run` takes for so many tetrahedra.
pub fn of_run(tets: usize, settings: &SolverSettings) -> Memory {
    Memory(((RUNNING + kept(settings)) * tets as f64) as u64)
}

/// What `viscera bench` takes, which has two solvers and states at a time.
pub fn of_bench(tets: usize, settings: &SolverSettings) -> Memory {
    Memory(((BUILDING + 2.0 * kept(settings)) * tets as f64) as u64)
}

/// What this process may still take; nothing where the system does not say.
pub fn free() -> Option<Memory> {
    let mut system = System::new().ok()?;
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    let machine = system.available_memory();
    // A container may allow less than the machine has. What it uses as a cache can be had.
    let container = system.cgroup_limits().map(|c| c.total_memory.saturating_sub(c.rss));
    let free = container.map_or(machine, |container| machine.min(container));
    (free > 0).then_some(Memory(free))
}

/// Refuses what does not fit: in what `--memory` allows, else in what is free.
pub fn check(what: &str, needed: Memory, allowed: Option<Memory>, cure: &str) -> Result<()> {
    let (room, how) = match (allowed, free()) {
        (Some(allowed), _) => (allowed, "allowed"),
        (None, Some(free)) => (free, "free"),
        (None, None) => return Ok(()),
    };
    if needed.0 <= room.0 {
        return Ok(());
    }
    // A little more than needed, so that the advice holds.
    let enough = Memory(needed.0.saturating_add(needed.0 / 10));
    bail!(
        "{what} needs about {needed} of memory, and {room} are {how}; {cure}, or try all the same \
         with --memory \"{enough}\""
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_read_and_printed() {
        for (text, bytes, printed) in [
            ("8 GB", 8_000_000_000, "8 GB"),
            ("1.5gb", 1_500_000_000, "1.5 GB"),
            ("250 kB", 250_000, "250 kB"),
            ("12 B", 12, "12 B"),
        ] {
            assert_eq!(text.parse(), Ok(Memory(bytes)), "{text}");
            assert_eq!(Memory(bytes).to_string(), printed);
        }
    }

    #[test]
    fn what_is_no_amount_is_refused_with_an_example() {
        for text in ["", "8", "GB", "-1 GB", "0 GB", "nan GB", "1e300 GB", "8 Gb/s", "8 mm"] {
            let error = text.parse::<Memory>().expect_err(text);
            assert!(error.contains("8 GB"), "{error}");
        }
    }
}
