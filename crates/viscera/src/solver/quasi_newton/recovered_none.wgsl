// For models without recovered-gradient tetrahedra, in the place of recovered.wgsl and recovered_end.wgsl.

fn evaluate_recovered(block: u32, lane: u32) -> f32 {
    return 0.0;
}

fn recovered_ends(block: u32, lane: u32, is_trial: bool) -> vec2f {
    return vec2f();
}

fn add_averages(part: u32, local: u32, into: ptr<function, Sums>) {
}
