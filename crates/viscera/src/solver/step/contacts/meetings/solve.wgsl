// Meetings in a solve: members of pieces behind the samples that tools touch.

// The change [J] of a meeting's energy on the way to the trial; leaves its force there, times he^2.
fn evaluate_meeting(meeting: u32) -> f32 {
    let at = meeting_at(meeting);
    let mark = loads[at].w;
    if mark == 0.0 {
        return 0.0;
    }
    let met = meeting_of(meeting);
    // Weights add up to nothing, and places far from the origin would drown the way.
    let origin = vertex_data_of(QN_BASE, table[met.sample]).xyz;
    var away = vec3f();
    var way = vec3f();
    for (var i = 0u; i < BEARINGS; i++) {
        let one = bearing_of(met, i);
        if one.weight != 0.0 {
            let before = vertex_data_of(QN_BASE, one.vertex).xyz;
            away += (before - origin) * one.weight;
            way += (points[one.vertex].xyz - before) * one.weight;
        }
    }
    let h = solve_dt();
    loads[at] = vec4f(meeting_felt(met, away + way).force * (h * h), mark);
    return meeting_change(met, away, way);
}
