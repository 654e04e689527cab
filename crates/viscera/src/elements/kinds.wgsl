// The functions of every kind of element that is no tetrahedron, with the kind's name before them;
// twin of `kinds.rs`. `element_energy` and the others, which choose the kind, are made from its list.

// The data of an element beside positions: its constants, where its anchor is at the end of the step [m], where
// its vertices were at the start of it [m], and the step [s].
struct ElementMoment {
    constants: vec4f,
    anchor: vec3f,
    start: array<vec3f, 4>,
    dt: f32,
}

// The changes by one solve: multipliers [J s^2/m] and positions [m].
struct ElementCorrection {
    multipliers: vec4f,
    positions: array<vec3f, 4>,
}

// Of a kind that is no constraint of XPBD: forces that act between sweeps.
fn loads_of_forces(forces: array<vec3f, 4>, curvature: f32, squared: f32) -> array<CornerLoad, 4> {
    return array<CornerLoad, 4>(
        CornerLoad(forces[0] * squared, curvature * squared),
        CornerLoad(forces[1] * squared, curvature * squared),
        CornerLoad(forces[2] * squared, curvature * squared),
        CornerLoad(forces[3] * squared, curvature * squared),
    );
}
