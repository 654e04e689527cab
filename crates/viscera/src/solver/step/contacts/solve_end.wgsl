// Contact at the end of a step: what it stores, and what tools have given (solver/step/energy.rs).

fn add_sample_end(sample: u32, is_trial: bool, into: ptr<function, Sums>, more: ptr<function, Sums>) {
    let at = contact_at(sample);
    let used = slots_used(loads[at].w);
    if used == 0u {
        return;
    }
    let row = sample_row(sample);
    var start = vec3f();
    var base = vec3f();
    var ways = array<vec3f, 2>(vec3f(), vec3f());
    for (var i = 0u; i < 4u; i++) {
        let v = table[row + i];
        let weight = number(row + SAMPLE_WEIGHTS + i);
        let before = reference(v);
        start += vertex_data_of(PREVIOUS, v).xyz * weight;
        base += before * weight;
        for (var k = 0u; k < 2u; k++) {
            ways[k] += (place_at(v, k, is_trial) - before) * weight;
        }
    }
    (*more)[END_NEAR - SUMS] += 1.0;
    for (var slot = 0u; slot < used; slot++) {
        let touching = touching_of(at, slot, row);
        let tool = tool_of(touching.marks);
        // Tools move while the tissue stands.
        let lifted = contact_energy(touching, meet(touching, AT_END, start));
        let there = contact_energy(touching, meet(touching, AT_START, start));
        (*more)[END_LIFTED - SUMS] += lifted - there;
        let kept = loads[slot_vectors(at, slot) + 3u].xyz;
        (*more)[END_WORK_BEFORE - SUMS] += work_of(tool, kept, start - origin_of(tool, AT_START));
        let before = meet(touching, AT_END, base);
        for (var k = 0u; k < 2u; k++) {
            let place = base + ways[k];
            let after = meet(touching, AT_END, place);
            let change = contact_change(touching, AT_END, before, after, ways[k]);
            (*into)[END_STORED + k] += change;
            (*into)[END_SIZE + k] += abs(change) + lifted + there;
            let force = felt_of(touching, after).force;
            (*more)[END_WORK_AFTER + k - SUMS] += work_of(tool, force, place - origin_of(tool, AT_END));
        }
    }
}
