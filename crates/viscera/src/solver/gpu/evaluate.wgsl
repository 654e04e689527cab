// The potential of all pieces at once; `job.mode` says what is asked of them.
@compute @workgroup_size(256)
fn evaluate(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let piece = workgroup.x + workgroup.y * groups.x;
    if piece >= job.count {
        return;
    }
    let is_spared = (job.mode & UNLESS_GOOD) != 0u && control.is_good != 0u
        || (job.mode & IF_REJECTED) != 0u && control.was_rejected == 0u;
    if agree(is_spared, local) {
        return;
    }
    sum_piece(piece, job.mode, local);
}
