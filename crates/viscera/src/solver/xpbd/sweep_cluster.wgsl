// One colour of clusters in a sweep (layout/clusters.rs): a workgroup for each cluster. Clusters of one colour share no
// vertex, so that workgroups do not meet; nor do tetrahedra of one colour in a cluster, so that threads do not meet
// between two barriers.
//
//   for each colour of the cluster: [J M^-1 J^T + a~] dl = -C - a~ l,   x += M^-1 J^T dl,   l += dl

// Positions of the cluster's vertices [m], with their inverse masses [1/kg].
var<workgroup> cluster_points: array<vec4f, CLUSTER_VERTICES>;

// Corners by their numbers in the cluster, two in a word.
fn read_places(block: u32, lane: u32) -> array<u32, 4> {
    let row = table[CLUSTER_CORNERS_AT] + 2u * LANES * block + lane;
    let near = table[row];
    let far = table[row + LANES];
    return array<u32, 4>(near & 0xffffu, near >> 16u, far & 0xffffu, far >> 16u);
}

fn write_places(block: u32, lane: u32) -> array<u32, 4> {
    return read_places(block, lane);
}

fn read_point(place: u32) -> vec4f {
    return cluster_points[place];
}

fn write_point(place: u32, point: vec4f) {
    cluster_points[place] = point;
}

@compute @workgroup_size(64)
fn solve_clusters(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let place = workgroup.x + groups.x * workgroup.y;
    if place >= job.count {
        return;
    }
    let row = table[CLUSTERS_AT] + CLUSTER_WORDS * (job.first + place);
    let vertices = table[CLUSTER_VERTICES_AT] + table[row + CLUSTER_FIRST_VERTEX];
    let vertex_count = table[row + CLUSTER_VERTEX_COUNT];
    for (var i = local; i < vertex_count; i += 64u) {
        cluster_points[i] = points[table[vertices + i]];
    }
    workgroupBarrier();
    let starts = table[CLUSTER_STARTS_AT] + table[row + CLUSTER_FIRST_START];
    let colors = table[row + CLUSTER_COLORS];
    for (var color = 0u; color < colors; color++) {
        let end = LANES * table[starts + color + 1u];
        for (var lane = LANES * table[starts + color] + local; lane < end; lane += 64u) {
            solve_tet(lane / LANES, lane % LANES);
        }
        workgroupBarrier();
    }
    for (var i = local; i < vertex_count; i += 64u) {
        points[table[vertices + i]] = cluster_points[i];
    }
}
