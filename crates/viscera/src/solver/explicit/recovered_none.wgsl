// For models without recovered-gradient tetrahedra, in the place of recovered.wgsl.

fn tet_gradient(block: u32, lane: u32, f: mat3x3f, shape: mat3x3f) -> mat3x3f {
    return f;
}

fn load_recovered(block: u32, lane: u32) {
}
