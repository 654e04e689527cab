//! Memory: what a simulation will take, what the machine has, and a refusal before both meet.

use anyhow::{Result, bail};
use sysinfo::{MemoryRefreshKind, System};
use viscera::settings::{Acceleration, Precision, SolverSettings};
use viscera_report::Memory;

/// What a mesh takes while it is made and checked [B per tetrahedron]. PLACEHOLDER
pub const MESH: f64 = 300.0;

/// What building model, state and solver takes at its peak, and keeps [B per tetrahedron]. PLACEHOLDER
const SIMULATION: f64 = 900.0;

/// What model, state and solver of `tets` tetrahedra take at most, their mesh not counted.
pub fn of_simulation(tets: usize, settings: &SolverSettings) -> Memory {
    let wide = settings.precision == Precision::F64;
    let mut each = SIMULATION * if wide { 1.6 } else { 1.0 };
    if settings.acceleration == Acceleration::Anderson {
        // Two histories of up to six multipliers and a vertex's share.
        let number = if wide { 8.0 } else { 4.0 };
        each += 2.0 * f64::from(settings.anderson_window) * 8.0 * number;
    }
    Memory((each * tets as f64) as u64)
}

/// Two solvers and states of one model.
pub fn of_pair(tets: usize, settings: &SolverSettings) -> Memory {
    Memory(2 * of_simulation(tets, settings).0)
}

/// What a mesh of so many tetrahedra takes at most while it is made.
pub fn of_mesh(tets: usize) -> Memory {
    Memory((MESH * tets as f64) as u64)
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
pub fn check(what: &str, needed: Memory, allowed: Option<Memory>) -> Result<()> {
    let (room, whose) = match allowed {
        Some(allowed) => (allowed, "--memory allows"),
        None => match free() {
            Some(free) => (free, "this machine has free"),
            None => return Ok(()),
        },
    };
    if needed.0 <= room.0 {
        return Ok(());
    }
    bail!(
        "{what} needs about {needed} of memory, and {whose} {room}: use fewer tetrahedra or a larger \
         machine, or try all the same with --memory \"{}\"",
        // Printed with three digits, it must not come out below what is needed.
        Memory(needed.0 + needed.0 / 10)
    )
}

/// The most memory that this process has resident, from a moment on; Linux tells.
pub struct Peak {
    /// Resident at that moment [B].
    before: u64,
}

impl Peak {
    /// From now on.
    pub fn start() -> Option<Self> {
        // 5 resets the peak; see proc_pid_clear_refs(5).
        std::fs::write("/proc/self/clear_refs", "5").ok()?;
        Some(Self { before: status("VmRSS:")? })
    }

    /// How much more it was than at the start [B].
    pub fn bytes(self) -> Option<u64> {
        Some(status("VmHWM:")?.saturating_sub(self.before))
    }
}

/// A line of /proc/self/status in kB, as bytes.
fn status(key: &str) -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| 1024 * kilobytes)
}
