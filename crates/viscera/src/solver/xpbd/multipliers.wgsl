// Multipliers at the start of a step: forces times the squared step, so that another step rescales them;
// a factor of zero forgets them, whatever they are.
@compute @workgroup_size(256)
fn rescale_multipliers(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread_of(id, groups, 256u);
    if i >= job.count {
        return;
    }
    if frame.rescale == 0.0 {
        multipliers[i] = 0.0;
    } else {
        multipliers[i] *= frame.rescale;
    }
}
