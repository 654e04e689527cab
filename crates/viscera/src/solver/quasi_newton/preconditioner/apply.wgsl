// `M g` (preconditioner/mod.rs) of the gradient at the trial, down to the corrections of all nodes; vertices add theirs
// up in direction.wgsl.
//
//   restrict   r_1 = P_1^T g
//   coarse     r_l = (P_l ... P_2)^T r_1 of all other levels at once, c_l = D_l^-1 r_l, dense levels c = H^-1 r
//   correct    c_1 = D_1^-1 r_1 + sum_(l > 1) P_2 ... P_l c_l

fn source_value(source: u32) -> vec3f {
    if (source & OF_VERTEX) != 0u {
        return vertex_data[QN_TRIAL_GRADIENT * table[STRIDE_AT] + (source & ~OF_VERTEX)].xyz;
    }
    return vector_at(residual_at(source));
}

// What a thread adds up of those that share a node.
fn add_children(node: u32, local: u32) -> vec3f {
    var sum = vec3f();
    let offsets = levels[LEVELS_CHILD_OFFSETS] + node;
    let end = levels[offsets + 1u];
    for (var i = levels[offsets] + local % SHARING; i < end; i += SHARING) {
        let at = levels[LEVELS_CHILDREN] + 2u * i;
        sum += source_value(levels[at]) * levels_number(at + 1u);
    }
    return sum;
}

var<workgroup> shared_vectors: array<vec3f, 256>;

// The sum of the threads that share something, for the first of them.
fn share_sum(given: vec3f, local: u32, threads: u32) -> vec3f {
    var sum = given;
    for (var half = SHARING / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        shared_vectors[local] = sum;
        workgroupBarrier();
        sum += shared_vectors[(local + half) % threads];
    }
    return sum;
}

@compute @workgroup_size(64)
fn restrict_gradient(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let node = (workgroup.x + workgroup.y * groups.x) * SHARED + local / SHARING;
    var sum = vec3f();
    if node < job.count {
        sum = add_children(node, local);
    }
    sum = share_sum(sum, local, 64u);
    if node < job.count && local % SHARING == 0u {
        put_vector(residual_at(node), sum);
    }
}

var<workgroup> right: array<f32, 192>;

// Of 32 nodes from one on, into `right` from its place on; `end`: where they end.
fn add_residuals(first: u32, end: u32, into: u32, local: u32) -> vec3f {
    let place = local / SHARING;
    var sum = vec3f();
    if first + place < end {
        sum = add_children(first + place, local);
    }
    sum = share_sum(sum, local, 256u);
    if local % SHARING == 0u {
        // Every place is written, whatever is there of the level.
        for (var k = 0u; k < 3u; k++) {
            right[3u * (into + place) + k] = sum[k];
        }
    }
    return sum;
}

// 32 coarser nodes a workgroup, from `job.first` on; then a workgroup for each dense level: `job.set_first` is the first.
@compute @workgroup_size(256)
fn correct_coarse(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let number = workgroup.x + workgroup.y * groups.x;
    if number < job.set_first {
        let first = job.first + 32u * number;
        let sum = add_residuals(first, levels[LEVELS_ORDINARY], 0u, local);
        let node = first + local / SHARING;
        if node < levels[LEVELS_ORDINARY] && local % SHARING == 0u {
            put_vector(correction_at(node), inverse_times(levels[LEVELS_VERTICES] + node, sum));
        }
        return;
    }
    let part = number - job.set_first;
    let row = levels[LEVELS_PART_ROWS] + LEVEL_PART_WORDS * min(part, job.count - 1u);
    let first = levels[row];
    let end = first + select(0u, levels[row + 1u], part < job.count);
    for (var nodes = 0u; nodes < MOST_DENSE; nodes += 32u) {
        add_residuals(first + nodes, end, nodes, local);
    }
    workgroupBarrier();
    let n = 3u * (end - first);
    if local >= n {
        return;
    }
    let matrix = levels[LEVELS_DENSE] + levels[row + 2u];
    var sum = 0.0;
    for (var j = 0u; j < n; j++) {
        sum += multilevel[matrix + packed(max(local, j), min(local, j))] * right[j];
    }
    multilevel[correction_at(first + local / 3u) + local % 3u] = sum;
}

@compute @workgroup_size(64)
fn correct_fine(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let node = thread_of(id, groups, 64u);
    if node >= job.count {
        return;
    }
    var sum = inverse_times(levels[LEVELS_VERTICES] + node, vector_at(residual_at(node)));
    let offsets = levels[LEVELS_UP_OFFSETS] + node;
    let end = levels[offsets + 1u];
    for (var i = levels[offsets]; i < end; i++) {
        let at = levels[LEVELS_UPS] + 2u * i;
        sum += vector_at(correction_at(levels[at])) * levels_number(at + 1u);
    }
    put_vector(correction_at(node), sum);
}
