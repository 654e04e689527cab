// Elements that are no tetrahedra, as they stand in the table: names with `ELEMENT_` are places in a row
// (layout.rs). Anchors, and where vertices were at the start of the step, stand in the vertex data.

fn element_row(i: u32) -> u32 {
    return table[ELEMENTS_AT] + ELEMENT_WORDS * i;
}

// Four words of it.
fn four_of(at: u32) -> array<u32, 4> {
    return array<u32, 4>(table[at], table[at + 1u], table[at + 2u], table[at + 3u]);
}

fn before_step(v: u32) -> vec3f {
    return vertex_data[PREVIOUS * table[STRIDE_AT] + v].xyz;
}

fn before_steps(v: array<u32, 4>) -> array<vec3f, 4> {
    return array<vec3f, 4>(before_step(v[0]), before_step(v[1]), before_step(v[2]), before_step(v[3]));
}

// The data of an element in a step of `dt` [s] that its vertices began at `start` [m].
fn moment_of(row: u32, start: array<vec3f, 4>, dt: f32) -> ElementMoment {
    let at = row + ELEMENT_CONSTANTS;
    let constants = vec4f(number(at), number(at + 1u), number(at + 2u), number(at + 3u));
    let anchor = vertex_data[table[ANCHORS_AT] + table[row + ELEMENT_ANCHOR]].xyz;
    return ElementMoment(constants, anchor, start, dt);
}
