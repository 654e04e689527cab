// The skin where a step begins: places of its points, normals of its triangles, boxes of its tree (contact/tree), and how far samples
// look (pairs/find.rs).
//
//   reach = 2 dh + 2 w, at most 40 dh      w: the way of the fastest vertex beside the mean of all, or of the fastest tool
//
// The tree is that of the shape at rest; boxes are found from the leaves up.

const FARTHEST: f32 = 40.0;
const PREPARERS: u32 = 256u;

var<workgroup> shared_ways: array<vec4f, 256>;

// A thread for each point.
@compute @workgroup_size(64)
fn place_skin(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let point = thread_of(id, groups, 64u);
    if point >= job.count {
        return;
    }
    let row = skin_point_row(point);
    let origin = points[table[row]].xyz;
    var way = vec3f();
    for (var i = 1u; i < 4u; i++) {
        way += (points[table[row + i]].xyz - origin) * number(row + 4u + i);
    }
    loads[skin(SKIN_POINTS_NOW) + point] = vec4f(origin + way, 0.0);
}

fn now_at(triangle: u32, corner: u32) -> vec3f {
    return loads[skin(SKIN_POINTS_NOW) + table[triangle_row(triangle) + corner]].xyz;
}

// A thread for each triangle: its normal, in w whether it has one; nobody meets it yet.
@compute @workgroup_size(64)
fn turn_skin(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let triangle = thread_of(id, groups, 64u);
    if triangle >= job.count {
        return;
    }
    let a = now_at(triangle, 0u);
    let normal = cross(now_at(triangle, 1u) - a, now_at(triangle, 2u) - a);
    let length = length_of(normal);
    let is_some = length > 0.0 && is_finite(length);
    let scale = 1.0 / select(1.0, length, is_some);
    loads[range_at(triangle) - 1u] = vec4f(normal * scale, select(0.0, 1.0, is_some));
    loads[range_at(triangle)] = vec4f();
}

fn node_row(node: u32) -> u32 {
    return skin(SKIN_NODES) + NODE_WORDS * node;
}

fn node_box(node: u32) -> u32 {
    return skin(SKIN_NODES_NOW) + NODE_VECTORS * node;
}

// Nodes at a height over the leaves.
fn level_start(level: u32) -> u32 {
    return table[skin(SKIN_LEVEL_OFFSETS) + level];
}

fn node_of_level(i: u32) -> u32 {
    return table[skin(SKIN_LEVEL_NODES) + i];
}

// A thread for each leaf.
@compute @workgroup_size(64)
fn box_skin(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let leaf = thread_of(id, groups, 64u);
    if leaf >= job.count {
        return;
    }
    let node = node_of_level(leaf);
    let row = node_row(node);
    var low = vec3f(3e38);
    var high = vec3f(-3e38);
    for (var i = table[row + 1u]; i < table[row + 1u] + table[row + 2u]; i++) {
        let triangle = table[skin(SKIN_ORDER) + i];
        for (var corner = 0u; corner < 3u; corner++) {
            let x = now_at(triangle, corner);
            low = min(low, x);
            high = max(high, x);
        }
    }
    loads[node_box(node)] = vec4f(low, 0.0);
    loads[node_box(node) + 1u] = vec4f(high, 0.0);
}

// Where a vertex goes in the step [m].
fn way_of(v: u32) -> vec3f {
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        return vertex_data_of(TARGETS, v).xyz - points[v].xyz;
    }
    return vertex_data_of(VELOCITIES, v).xyz * frame.dt;
}

fn fastest_tool() -> f32 {
    var most = 0.0;
    for (var tool = 0u; tool < tools.count.x; tool++) {
        let turned = length_of(tools.all[tool].turn.xyz) * tools.kinds[tool].bounds.w;
        most = max(most, length_of(tools.all[tool].way.xyz) + turned);
    }
    return most;
}

// Sums, and in w maxima, of all threads.
fn join_ways(given: vec4f, local: u32) -> vec4f {
    workgroupBarrier();
    shared_ways[local] = given;
    workgroupBarrier();
    for (var half = PREPARERS / 2u; half > 0u; half /= 2u) {
        if local < half {
            let a = shared_ways[local];
            let b = shared_ways[local + half];
            shared_ways[local] = vec4f(a.xyz + b.xyz, max(a.w, b.w));
        }
        workgroupBarrier();
    }
    return shared_ways[0];
}

// One workgroup: the boxes of `job.set_first` levels over the leaves, and the reach of a step of `job.count` vertices.
@compute @workgroup_size(256)
fn prepare_skin(@builtin(local_invocation_index) local: u32) {
    for (var level = 1u; level <= job.set_first; level++) {
        for (var i = level_start(level) + local; i < level_start(level + 1u); i += PREPARERS) {
            let node = node_of_level(i);
            let first = node_box(node + 1u);
            let second = node_box(table[node_row(node + 1u)]);
            loads[node_box(node)] = min(loads[first], loads[second]);
            loads[node_box(node) + 1u] = max(loads[first + 1u], loads[second + 1u]);
        }
        storageBarrier();
        workgroupBarrier();
    }
    var sum = vec3f();
    for (var v = local; v < job.count; v += PREPARERS) {
        sum += vertex_data_of(VELOCITIES, v).xyz;
    }
    let mean = join_ways(vec4f(sum, 0.0), local).xyz * (frame.dt / f32(job.count));
    var farthest = 0.0;
    for (var v = local; v < job.count; v += PREPARERS) {
        let way = way_of(v) - mean;
        farthest = max(farthest, dot(way, way));
    }
    let all = join_ways(vec4f(0.0, 0.0, 0.0, farthest), local);
    if local == 0u {
        let thickness = skin_number(SKIN_THICKNESS);
        let fastest = max(sqrt(all.w), fastest_tool());
        let reach = min(2.0 * thickness + 2.0 * fastest, FARTHEST * thickness);
        loads[skin(SKIN_REACH)] = vec4f(reach, 0.0, 0.0, 0.0);
    }
}
