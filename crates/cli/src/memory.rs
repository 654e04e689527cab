//! Memory: what a simulation will take, what the machine has, and a refusal before both meet.

use anyhow::{Result, bail};
use sysinfo::{MemoryRefreshKind, System};
use viscera::settings::{Acceleration, Colors, Precision, SolverSettings};
use viscera_report::Memory;

/// What a mesh and the making of its model take at their peak, model included [B per tetrahedron]:
/// 228 by VmHWM on a bar of 300,000 tetrahedra. Too small, and a machine starts to swap or ends the
/// program; too large, and it is not used in full.
const BUILDING: f64 = 240.0;

/// What `viscera run` takes beside model, state and solver: meshes, surfaces, measures, a frame as VTU
/// [B per tetrahedron]; 464 to 481 on a bar of 300,000, likewise.
const RUNNING: f64 = 490.0;

/// What model, state and solver keep, at most [B per tetrahedron]; without viscosity. Measured 102 to
/// 137 on bars from 10,000 tetrahedra on.
const KEPT: f64 = 150.0;
/// Copies of four corners, their loads, their numbers.
const COPIES: f64 = 150.0;
/// Two iterates and the weights of multipliers.
const ITERATES: f64 = 90.0;
/// Six multipliers and a vertex's share in one entry of Anderson's two histories.
const HISTORY: f64 = 2.0 * 7.0 * 4.0;

/// What model, state and solver keep at most [B per tetrahedron].
pub fn kept(settings: &SolverSettings) -> f64 {
    let mut kept = KEPT;
    if settings.colors != Colors::Unlimited {
        kept += COPIES;
    }
    if settings.acceleration != Acceleration::None {
        kept += ITERATES;
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
