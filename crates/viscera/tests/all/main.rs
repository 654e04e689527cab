//! All integration tests of the library: one program, so that it is linked once, opens one graphics device,
//! and compiles its kernels once.

mod common;
mod gpu_common;

mod allocation;
mod allocation_threads;
mod at_rest;
mod automatic;
mod coloring;
mod contact;
mod determinism;
mod element_solves;
mod elements;
mod embed;
mod energy;
mod energy_changes;
mod example;
mod explicit;
mod explicit_limit;
mod explicit_robust;
mod forces;
mod free_fall;
mod gpu;
mod gpu_explicit;
mod gpu_guard;
mod gpu_history;
mod gpu_parts;
mod gpu_shaders;
mod gpu_simulation;
mod gpu_surface;
mod gpu_timing;
mod hands;
mod history;
mod imports;
mod iterates;
mod lanes;
mod live;
mod measures;
mod mesh;
mod mesh_damage;
mod mesh_formats;
mod mesh_fuzz;
mod mesh_hostile;
mod mesh_io;
mod mesh_tools;
mod mesh_writers;
mod named_patches;
mod parts;
mod physics;
mod pins;
mod quasi_newton;
mod quasi_newton_robust;
mod readme;
mod record;
mod recovered;
mod recovered_robust;
mod saved;
mod scene_errors;
mod scene_files;
mod scene_keys;
mod shapes;
mod springs;
mod stress;
mod tethers;
mod tetrahedralize;
mod tidy;
mod tiers;
mod tool_errors;
mod tool_force_error;
mod tools;
mod twins;
mod worlds;
mod xpbd_family;

/// Counts what tests ask the system's allocator for.
#[global_allocator]
static ALLOCATOR: common::counting::Counting = common::counting::Counting;
