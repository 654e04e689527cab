// Elements that are no tetrahedra in a sweep, one colour at a time (solver/xpbd/sweep.rs); see sweep.wgsl.

@compute @workgroup_size(64)
fn solve_elements(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let row = element_row(job.first + thread);
    let kind = table[row + ELEMENT_KIND];
    let vertices = four_of(row + ELEMENT_VERTICES);
    let copies_of_element = four_of(row + ELEMENT_COPIES);
    var x: array<vec3f, 4>;
    var w: array<f32, 4>;
    for (var i = 0u; i < 4u; i++) {
        let point = read_point(read_place(vertices[i], copies_of_element[i]));
        x[i] = point.xyz;
        w[i] = point.w;
    }
    let first = table[row + ELEMENT_MULTIPLIER];
    let count = element_multipliers(kind);
    var l: vec4f;
    for (var p = 0u; p < count; p++) {
        l[p] = multipliers[first + p];
    }
    let moment = moment_of(row, before_steps(vertices), frame.dt);
    let change = element_solve(kind, moment, x, w, l, frame.squared_dt);
    l += frame.relaxation_multipliers * change.multipliers;
    for (var p = 0u; p < count; p++) {
        multipliers[first + p] = l[p];
    }
    var moves = change.positions;
    for (var i = 0u; i < element_corners(kind); i++) {
        let to = vec4f(x[i] + moves[i] * frame.relaxation_positions, w[i]);
        write_point(write_place(vertices[i], copies_of_element[i]), to);
    }
}
