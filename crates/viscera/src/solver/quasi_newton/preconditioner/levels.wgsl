// The tables of the preconditioner (tables.rs): names with `LEVELS_` are places in the header.

// Threads that share a node, a pair or a group, and how many of these a workgroup works on.
const SHARING: u32 = 8u;
const SHARED: u32 = 8u;

var<workgroup> shared_rows: array<array<f32, 9>, 64>;

fn levels_number(word: u32) -> f32 {
    return bitcast<f32>(levels[word]);
}

fn inverse_at(item: u32) -> u32 {
    return levels[LEVELS_INVERSES] + 6u * item;
}

fn residual_at(node: u32) -> u32 {
    return levels[LEVELS_RESIDUALS] + 4u * node;
}

fn correction_at(node: u32) -> u32 {
    return levels[LEVELS_CORRECTIONS] + 4u * node;
}

fn vector_at(at: u32) -> vec3f {
    return vec3f(multilevel[at], multilevel[at + 1u], multilevel[at + 2u]);
}

fn put_vector(at: u32, value: vec3f) {
    multilevel[at] = value.x;
    multilevel[at + 1u] = value.y;
    multilevel[at + 2u] = value.z;
}

// `D^-1 v` of a vertex or an ordinary node, `D` symmetric: xx, yy, zz, yz, xz, xy.
fn inverse_times(item: u32, v: vec3f) -> vec3f {
    let at = inverse_at(item);
    let direct = vec3f(multilevel[at], multilevel[at + 1u], multilevel[at + 2u]);
    let mixed = vec3f(multilevel[at + 3u], multilevel[at + 4u], multilevel[at + 5u]);
    return vec3f(
        direct.x * v.x + mixed.z * v.y + mixed.y * v.z,
        mixed.z * v.x + direct.y * v.y + mixed.x * v.z,
        mixed.y * v.x + mixed.x * v.y + direct.z * v.z,
    );
}

// Where node `i` of a part's dense level has its numbers in the packed lower triangle.
fn packed(row: u32, column: u32) -> u32 {
    return row * (row + 1u) / 2u + column;
}
