// The end of a step: what meetings keep (contact/pair.rs, `keep`), and ties that tear.
//
//   u *= min(1, mu min(N, N_new)/(K |u|)),  N = N_new;   nothing is kept where N_new = 0

fn end_contact(meeting: u32, met: Meeting, away: vec3f) {
    let at = meeting_at(meeting);
    let pressed = meeting_felt(met, away).pressed;
    if !(pressed > 0.0) {
        return;
    }
    var kept = vec2f();
    let triangle = u32(loads[at].w);
    if met.limit > 0.0 {
        let slip = slip_of(met, away);
        let elastic = met.stiffness * length_of(slip);
        let most = min(met.limit, skin_number(SKIN_FRICTION) * pressed);
        let gives_way = elastic > most;
        let share = select(1.0, most / select(1.0, elastic, gives_way), gives_way);
        let a = place_of_point(triangle - 1u, 0u);
        let ab = place_of_point(triangle - 1u, 1u) - a;
        kept = in_edges(slip * share, ab, place_of_point(triangle - 1u, 2u) - a);
    }
    loads[at + 4u] = vec4f(kept, pressed, meeting_squeezed(met, away));
    loads[at + 6u].z = f32(triangle);
}

// Where a corner of a triangle is now [m].
fn place_of_point(triangle: u32, corner: u32) -> vec3f {
    let row = skin_point_row(table[triangle_row(triangle) + corner]);
    let origin = points[table[row]].xyz;
    var way = vec3f();
    for (var i = 1u; i < 4u; i++) {
        way += (points[table[row + i]].xyz - origin) * number(row + 4u + i);
    }
    return origin + way;
}

@compute @workgroup_size(64)
fn end_meetings(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let meeting = thread_of(id, groups, 64u);
    if meeting >= job.count {
        return;
    }
    let at = meeting_at(meeting);
    loads[at + 4u] = vec4f();
    loads[at + 6u].z = 0.0;
    if loads[at].w == 0.0 {
        return;
    }
    let met = meeting_of(meeting);
    let origin = points[table[met.sample]].xyz;
    var away = vec3f();
    for (var i = 0u; i < BEARINGS; i++) {
        let one = bearing_of(met, i);
        if one.weight != 0.0 {
            away += (points[one.vertex].xyz - origin) * one.weight;
        }
    }
    if !met.is_tie {
        end_contact(meeting, met, away);
        return;
    }
    let tie = meeting - skin(SKIN_SAMPLE_COUNT);
    if length_of(meeting_felt(met, away).force) > number(tie_row(tie) + 9u) {
        loads[skin(SKIN_TORN) + tie] = vec4f(1.0, 0.0, 0.0, 0.0);
    }
}
