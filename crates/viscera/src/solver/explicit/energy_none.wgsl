// For models without recovered-gradient tetrahedra, in the place of energy_recovered.wgsl.

fn stored_in_recovered(block: u32, lane: u32, x: array<vec3f, 4>, way: array<vec3f, 4>) -> f32 {
    return 0.0;
}

fn add_averaged_energies(part: u32, local: u32, into: ptr<function, Sums>) {
}
