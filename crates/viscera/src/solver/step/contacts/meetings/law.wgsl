// What a sample and the triangle that it meets feel of each other (contact/pair.rs), in single precision.
//
//   d = nu.(p - q) + shift,  E = A psi(d) + E_f(u),  u = (I - nu nu^T)(p - q + u_n - (p_n - q_n));   tie: E = K/2 |p - q - r|^2

// The constants of a meeting in a step; rows of its sample and its triangle.
struct Meeting {
    sample: u32,
    triangle: u32,
    weights: vec3f,
    shift: f32,
    normal: vec3f,
    stiffness: f32,
    offset: vec3f,
    limit: f32,
    is_tie: bool,
}

// Of one that is in force.
fn meeting_of(meeting: u32) -> Meeting {
    let at = meeting_at(meeting);
    let a = loads[at + 1u];
    let b = loads[at + 2u];
    let c = loads[at + 3u];
    let triangle = triangle_row(u32(loads[at].w) - 1u);
    let is_tie = meeting >= skin(SKIN_SAMPLE_COUNT);
    return Meeting(skin_sample_row(meeting), triangle, a.xyz, a.w, b.xyz, b.w, c.xyz, c.w, is_tie);
}

fn bearing_of(met: Meeting, i: u32) -> Bearing {
    return bearing(met.sample, met.triangle, met.weights, i);
}

fn distance_of(met: Meeting, away: vec3f) -> f32 {
    return dot(met.normal, away) + met.shift;
}

fn slip_of(met: Meeting, away: vec3f) -> vec3f {
    let whole = away + met.offset;
    return whole - met.normal * dot(met.normal, whole);
}

// The way from the triangle's point to the sample is `away` [m].
fn meeting_felt(met: Meeting, away: vec3f) -> Felt {
    if met.is_tie {
        return Felt((met.offset - away) * met.stiffness, 0.0);
    }
    let thickness = skin_number(SKIN_THICKNESS);
    let gap = max(thickness - distance_of(met, away), 0.0);
    let deep = max(gap - 0.5 * thickness, 0.0);
    let pressed = met.stiffness * (gap + (SECOND_STAGE - 1.0) * deep);
    var felt = Felt(met.normal * pressed, pressed);
    if met.limit > 0.0 {
        let slip = slip_of(met, away);
        let length = length_of(slip);
        let gives_way = met.stiffness * length > met.limit;
        let drag = select(met.stiffness, met.limit / select(1.0, length, gives_way), gives_way);
        felt.force -= slip * drag;
    }
    return felt;
}

// The change of the energy [J] on a way [m] of the sample as the triangle's point sees it.
fn meeting_change(met: Meeting, away: vec3f, way: vec3f) -> f32 {
    if met.is_tie {
        return 0.5 * met.stiffness * dot(way, (away - met.offset) * 2.0 + way);
    }
    let thickness = skin_number(SKIN_THICKNESS);
    let along = dot(met.normal, way);
    let gap = thickness - distance_of(met, away);
    let half = 0.5 * thickness;
    let later = gap - along;
    var change = met.stiffness * half_square_change(gap, later, -along);
    change += (SECOND_STAGE - 1.0) * met.stiffness * half_square_change(gap - half, later - half, -along);
    if met.limit > 0.0 {
        let across = way - met.normal * along;
        let slip = slip_of(met, away);
        change += drag_change(met.stiffness, met.limit, slip, slip + across, across);
    }
    return change;
}

// Energy of contact [J] without that of friction.
fn meeting_squeezed(met: Meeting, away: vec3f) -> f32 {
    if met.is_tie {
        return 0.0;
    }
    let thickness = skin_number(SKIN_THICKNESS);
    let gap = max(thickness - distance_of(met, away), 0.0);
    let deep = max(gap - 0.5 * thickness, 0.0);
    return 0.5 * met.stiffness * (gap * gap + (SECOND_STAGE - 1.0) * deep * deep);
}
