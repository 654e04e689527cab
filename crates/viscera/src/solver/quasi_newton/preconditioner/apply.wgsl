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

var<workgroup> right: array<f32, 96>;

// 32 coarser nodes a workgroup, from `job.first` on; then a workgroup for each dense level: `job.set_first` is the first.
@compute @workgroup_size(256)
fn correct_coarse(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let number = workgroup.x + workgroup.y * groups.x;
    let is_dense = number >= job.set_first;
    let part = select(0u, min(number - job.set_first, job.count - 1u), is_dense);
    let row = levels[LEVELS_PART_ROWS] + LEVEL_PART_WORDS * part;
    let place = local / SHARING;
    var node = job.first + 32u * number + place;
    var has_node = node < levels[LEVELS_ORDINARY];
    if is_dense {
        node = levels[row] + place;
        has_node = place < levels[row + 1u] && number - job.set_first < job.count;
    }
    var sum = vec3f();
    if has_node {
        sum = add_children(node, local);
    }
    sum = share_sum(sum, local, 256u);
    let is_first = local % SHARING == 0u;
    if is_first {
        // Every place is written, whatever is there of the level.
        right[3u * place] = sum.x;
        right[3u * place + 1u] = sum.y;
        right[3u * place + 2u] = sum.z;
    }
    workgroupBarrier();
    if !has_node || !is_first {
        return;
    }
    if !is_dense {
        put_vector(correction_at(node), inverse_times(levels[LEVELS_VERTICES] + node, sum));
        return;
    }
    let matrix = levels[LEVELS_DENSE] + levels[row + 2u];
    let n = 3u * levels[row + 1u];
    var correction = vec3f();
    for (var k = 0u; k < 3u; k++) {
        let i = 3u * place + k;
        var product = 0.0;
        for (var j = 0u; j < n; j++) {
            product += multilevel[matrix + packed(max(i, j), min(i, j))] * right[j];
        }
        correction[k] = product;
    }
    put_vector(correction_at(node), correction);
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
