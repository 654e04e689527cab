// A fine surface that follows tetrahedra (mesh/embed.rs), and its normals (mesh/normals.rs):
//
//   x = x_0 + sum_(i=1..3) w_i (x_i - x_0)
//   n ~ sum_t (b_t - x) x (c_t - x)        triangles t = (x, b_t, c_t) around the vertex
//
// Two dispatches: a vertex's normal needs the places of its neighbours.

struct Bound {
    corners: vec4u,
    // Of each corner; the first follows from the others.
    weights: vec4f,
}

// As drawn: 32 bytes a vertex.
struct Vertex {
    // [m], and 1.
    position: vec4f,
    // Of unit length, or zero where triangles cancel; and 0.
    normal: vec4f,
}

// Positions of the tetrahedra's vertices [m].
@group(0) @binding(0) var<storage, read> points: array<vec4f>;
@group(0) @binding(1) var<storage, read> bounds: array<Bound>;
// Where the triangles around each vertex begin, one more at the end; and the two other corners of each.
@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> others: array<vec2u>;
@group(0) @binding(4) var<storage, read_write> vertices: array<Vertex>;

fn vertex_of(id: vec3u, groups: vec3u) -> u32 {
    return id.x + id.y * groups.x * 64u;
}

@compute @workgroup_size(64)
fn embed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let v = vertex_of(id, groups);
    if v >= arrayLength(&bounds) {
        return;
    }
    let bound = bounds[v];
    // Relative to the first corner: exact far from the origin.
    let origin = points[bound.corners.x].xyz;
    let offset = (points[bound.corners.y].xyz - origin) * bound.weights.y
        + (points[bound.corners.z].xyz - origin) * bound.weights.z
        + (points[bound.corners.w].xyz - origin) * bound.weights.w;
    vertices[v].position = vec4f(origin + offset, 1.0);
}

@compute @workgroup_size(64)
fn smooth_normals(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = vertex_of(id, groups);
    if v >= arrayLength(&bounds) {
        return;
    }
    let x = vertices[v].position.xyz;
    // As long as twice the area: the weight.
    var sum = vec3f();
    let end = offsets[v + 1u];
    for (var t = offsets[v]; t < end; t++) {
        let pair = others[t];
        sum += cross(vertices[pair.x].position.xyz - x, vertices[pair.y].position.xyz - x);
    }
    // Scaled first: squares of areas of a square micrometre are below the smallest number.
    let largest = max(max(abs(sum.x), abs(sum.y)), abs(sum.z));
    var normal = vec3f();
    if largest > 0.0 {
        let scaled = sum / largest;
        normal = scaled * inverseSqrt(dot(scaled, scaled));
    }
    vertices[v].normal = vec4f(normal, 0.0);
}
