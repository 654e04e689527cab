// Values at the vertices of a surface that follows tetrahedra: between vertices of these as they are, or how far it has moved.

struct Bound {
    corners: vec4u,
    weights: vec4f,
}

struct Vertex {
    position: vec4f,
    normal: vec4f,
}

// Positions of the tetrahedra's vertices [m], in w their values.
@group(0) @binding(0) var<storage, read> points: array<vec4f>;
@group(0) @binding(1) var<storage, read> bounds: array<Bound>;
// Places of the surface, now and at rest [m].
@group(0) @binding(4) var<storage, read_write> vertices: array<Vertex>;
@group(0) @binding(5) var<storage, read> rest: array<vec4f>;
// A value, and one where it is none.
@group(0) @binding(6) var<storage, read_write> values: array<vec2f>;

// As in values.wgsl; larger values than the second count as that.
const NO_VALUE: f32 = 3e38;
const LARGEST: f32 = 1e30;

@compute @workgroup_size(64)
fn spread_values(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let v = id.x + id.y * groups.x * 64u;
    if v >= arrayLength(&bounds) {
        return;
    }
    let bound = bounds[v];
    var value = 0.0;
    var is_known = true;
    for (var i = 0u; i < 4u; i++) {
        // A corner that does not count may have no value.
        if bound.weights[i] != 0.0 {
            let own = points[bound.corners[i]].w;
            is_known = is_known && own < NO_VALUE;
            value += bound.weights[i] * min(own, LARGEST);
        }
    }
    values[v] = select(vec2f(0.0, 1.0), vec2f(clamp(value, -LARGEST, LARGEST), 0.0), is_known);
}

@compute @workgroup_size(64)
fn measure_displacements(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let v = id.x + id.y * groups.x * 64u;
    if v >= arrayLength(&bounds) {
        return;
    }
    let moved = vertices[v].position.xyz - rest[v].xyz;
    values[v] = vec2f(sqrt(dot(moved, moved)), 0.0);
}
