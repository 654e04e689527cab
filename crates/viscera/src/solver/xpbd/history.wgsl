// The warm-start reset: multipliers from positions alone (solver/xpbd/history.rs).
//
//   l_j = -C_j(x)/a~_j
//
// `unknowns` holds positions and, from `job.first` on, multipliers: bound one by one they would be
// more buffers than every device binds.

// By its bits: a compiler may take it that there are only finite numbers.
fn is_finite_number(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

// Whether a part's multipliers are to be taken anew.
fn is_repaired(part: u32) -> bool {
    return job.mode != 0u || atomicLoad(&control.parts[part].is_broken) != 0u;
}

// The stress of a tetrahedron too large for the number format is unknown.
fn store_multiplier(place: u32, l: f32) {
    unknowns[job.first + place] = select(0.0, l, is_finite_number(l));
}

fn position(v: u32) -> vec3f {
    return vec3f(unknowns[4u * v], unknowns[4u * v + 1u], unknowns[4u * v + 2u]);
}
