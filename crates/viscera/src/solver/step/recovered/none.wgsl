// For models without recovered-gradient tetrahedra, in the place of tables.wgsl and forces.wgsl.

fn is_recovered(block: u32) -> bool {
    return false;
}

fn recovered_force(v: u32) -> vec3f {
    return vec3f();
}
