// Meetings at the end of a step: what they store, and what they have gained as they were found anew (solver/step/energy.rs).

fn add_meeting_end(meeting: u32, is_trial: bool, into: ptr<function, Sums>, more: ptr<function, Sums>) {
    let at = meeting_at(meeting);
    if meeting < skin(SKIN_SAMPLE_COUNT) {
        (*more)[END_GAINED - SUMS] -= loads[at + 4u].w;
    }
    if loads[at].w == 0.0 {
        return;
    }
    let met = meeting_of(meeting);
    let first = table[met.sample];
    let origin = vertex_data_of(PREVIOUS, first).xyz;
    var start = vec3f();
    var base = vec3f();
    var ways = array<vec3f, 2>(vec3f(), vec3f());
    for (var i = 0u; i < BEARINGS; i++) {
        let one = bearing_of(met, i);
        if one.weight == 0.0 {
            continue;
        }
        let before = reference(one.vertex);
        start += (vertex_data_of(PREVIOUS, one.vertex).xyz - origin) * one.weight;
        base += (before - origin) * one.weight;
        for (var k = 0u; k < 2u; k++) {
            ways[k] += (place_at(one.vertex, k, is_trial) - before) * one.weight;
        }
    }
    let begun = meeting_squeezed(met, start);
    (*more)[END_GAINED - SUMS] += begun;
    for (var k = 0u; k < 2u; k++) {
        let change = meeting_change(met, base, ways[k]);
        (*into)[END_STORED + k] += change;
        (*into)[END_SIZE + k] += abs(change) + begun;
    }
}
