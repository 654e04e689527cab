// Tissue that meets tissue, as it lies on the device (meetings/mod.rs); names with `SKIN_` are places in the skin's row.
//
// A meeting has `MEETING_VECTORS` vectors behind the loads, of samples by their places, then of ties:
//   its force on the sample times he^2, the triangle's number plus one where it is in force;   weights of the triangle's point,
//   what distances are longer by [m];   normal from there to the sample, stiffness [N/m];   of contact `u_n - (p_n - q_n)` [m] and the
//   limit of friction [N], of a tie `r`;   kept of the last step: slip in terms of the triangle's edges, normal force [N],
//   energy [J];   twice the curvature of its energy [N/m] as xx, yy, zz, yz;   xz, xy, and the triangle plus one that it was kept on

fn has_skin() -> bool {
    return table[SKIN_AT] != 0u;
}

fn skin(field: u32) -> u32 {
    return table[table[SKIN_AT] + field];
}

fn skin_number(field: u32) -> f32 {
    return bitcast<f32>(skin(field));
}

fn meeting_at(meeting: u32) -> u32 {
    return skin(SKIN_MEETINGS) + MEETING_VECTORS * meeting;
}

fn tie_row(tie: u32) -> u32 {
    return skin(SKIN_TIES) + TIE_WORDS * tie;
}

// The sample of a meeting.
fn skin_sample_row(meeting: u32) -> u32 {
    var place = meeting;
    if meeting >= skin(SKIN_SAMPLE_COUNT) {
        place = table[tie_row(meeting - skin(SKIN_SAMPLE_COUNT))];
    }
    return skin(SKIN_SAMPLES) + SKIN_SAMPLE_WORDS * place;
}

fn skin_point_row(point: u32) -> u32 {
    return skin(SKIN_POINTS) + POINT_WORDS * point;
}

fn triangle_row(triangle: u32) -> u32 {
    return skin(SKIN_TRIANGLES) + TRIANGLE_WORDS * triangle;
}

// Behind the normal of a triangle: from which place of the sorted list on it is met, and to which.
fn range_at(triangle: u32) -> u32 {
    return skin(SKIN_TRIANGLES_NOW) + TRIANGLE_VECTORS * triangle + 1u;
}

// A vertex that a meeting hangs on, with its weight in the way from the triangle's point to the sample.
struct Bearing {
    vertex: u32,
    weight: f32,
}

const BEARINGS: u32 = 16u;

// One of the `BEARINGS` of the sample and the triangle in these rows; `weights` of the triangle's point.
fn bearing(sample: u32, triangle: u32, weights: vec3f, i: u32) -> Bearing {
    if i < 4u {
        return Bearing(table[sample + i], number(sample + 4u + i));
    }
    let corner = (i - 4u) / 4u;
    let point = skin_point_row(table[triangle + corner]) + i % 4u;
    return Bearing(table[point], -weights[corner] * number(point + 4u));
}

// On a vertex, times he^2: what its samples feel, less what the samples feel that meet its triangles.
fn meeting_force(v: u32) -> vec3f {
    if !has_skin() {
        return vec3f();
    }
    var sum = vec3f();
    let own = skin(SKIN_OWN_OFFSETS) + v;
    for (var i = table[own]; i < table[own + 1u]; i++) {
        let entry = skin(SKIN_OWN_ENTRIES) + 2u * i;
        sum += loads[meeting_at(table[entry])].xyz * number(entry + 1u);
    }
    let reactions = skin(SKIN_REACTION_OFFSETS) + v;
    for (var i = table[reactions]; i < table[reactions + 1u]; i++) {
        let entry = skin(SKIN_REACTION_ENTRIES) + 2u * i;
        let corner = table[entry] % 4u;
        let range = loads[range_at(table[entry] / 4u)];
        for (var k = u32(range.x); k < u32(range.y); k++) {
            let at = meeting_at(u32(loads[skin(SKIN_SORTED) + k].y));
            sum -= loads[at].xyz * (loads[at + 1u][corner] * number(entry + 1u));
        }
    }
    return sum;
}
