// One colour of a sweep (solver/xpbd/sweep.rs). Constraints of one colour share no copy, so that threads do
// not meet; see sweep_tet.wgsl.
@compute @workgroup_size(64)
fn solve(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread < job.count {
        solve_tet(job.first + thread / LANES, thread % LANES);
    }
}
