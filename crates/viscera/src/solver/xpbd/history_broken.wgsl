// Parts with a multiplier that is NaN (history.wgsl): the multipliers of other parts stay.
@compute @workgroup_size(256)
fn find_broken(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let span = span_of(workgroup, groups);
    if span.groups == 0u {
        return;
    }
    var run = Run();
    for (var j = span.group * 256u + local; j < span.length; j += span.groups * 256u) {
        let i = number_at(&run, span.part, j);
        if i != NOWHERE && i >= job.first && !is_finite_number(unknowns[i]) {
            atomicOr(&control.parts[span.part].is_broken, 1u);
        }
    }
}
