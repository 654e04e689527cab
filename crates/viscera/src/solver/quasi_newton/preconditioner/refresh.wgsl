// The preconditioner where tissue has turned and stretched to (preconditioner/mod.rs), in three dispatches.
//
//   turns    R, A and 1 + eta/he of every group, from F = sum_j x_j b_j^T at x + tau v
//   blocks   D = (m + he^2 k) I + he^2 sum_groups (1 + eta/he) (t I + A B A^T), inverted; pairs of dense nodes
//            contact adds sum_v w_v^2 K_v to a node that vertices hang on with weights w_v, `K_v` of vertices where the tissue around
//            moves alike; coarser ones the same of the finest level's, K_f = sum_v w_v K_v
//   invert   the dense levels: the sweep operator on the lower triangle
//
// A turn is 20 numbers: `R` and `A` by columns, the factor, nothing.

// A turn [rad] below which a rotation is near enough, and turns at most.
const NEAR: f32 = 1e-4;
const MOST_TURNS: u32 = 20u;

// The step [s] of a part's solves, of which some differ where there are tools.
fn step_of(part: u32) -> f32 {
    return frame.dt * multilevel[levels[LEVELS_STEPS] + part];
}

// The part of a vertex or an ordinary node.
fn part_of_item(item: u32) -> u32 {
    let vertices = levels[LEVELS_VERTICES];
    if item < vertices {
        return part_with(PART_VERTICES_END, item);
    }
    return levels[levels[LEVELS_NODE_PARTS] + item - vertices];
}

fn turn_at(group: u32) -> u32 {
    return levels[LEVELS_TURNS] + TURN_NUMBERS * group;
}

fn matrix_at(at: u32) -> mat3x3f {
    return mat3x3f(vector_at(at), vector_at(at + 3u), vector_at(at + 6u));
}

// Adds up nine numbers of the threads that share something; the first of them has the sum.
fn share_sums(given: array<f32, 9>, local: u32) -> array<f32, 9> {
    var sums = given;
    for (var half = SHARING / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        shared_rows[local] = sums;
        workgroupBarrier();
        for (var k = 0u; k < 9u; k++) {
            sums[k] += shared_rows[(local + half) % 64u][k];
        }
    }
    return sums;
}

fn unit(v: vec3f, otherwise: vec3f) -> vec3f {
    let squared = dot(v, v);
    let is_some = squared > 1e-24 && squared < 1e24;
    return select(otherwise, v * inverseSqrt(select(1.0, squared, is_some)), is_some);
}

var<workgroup> answer: u32;

// The first thread's answer, for all threads.
fn workgroup_is(yes: bool, local: u32) -> bool {
    if local == 0u {
        answer = select(0u, 1u, yes);
    }
    return workgroupUniformLoad(&answer) != 0u;
}

// The rotation nearest to the first two columns of `f`.
fn first_rotation(f: mat3x3f) -> mat3x3f {
    let a = unit(f[0], vec3f(1.0, 0.0, 0.0));
    let axis = select(vec3f(0.0, 1.0, 0.0), vec3f(1.0, 0.0, 0.0), abs(a.x) < 0.6);
    let across = unit(axis - a * dot(a, axis), axis);
    let b = unit(f[1] - a * dot(a, f[1]), across);
    return mat3x3f(a, b, cross(a, b));
}

// Mueller, Bender, Chentanez, Macklin, "A robust method to extract the rotational part of deformations", MIG 2016.
fn rotation_of(f: mat3x3f) -> mat3x3f {
    var r = first_rotation(f);
    for (var i = 0u; i < MOST_TURNS; i++) {
        let turn = cross(r[0], f[0]) + cross(r[1], f[1]) + cross(r[2], f[2]);
        let along = dot(r[0], f[0]) + dot(r[1], f[1]) + dot(r[2], f[2]);
        let w = turn * (1.0 / (abs(along) + 1e-30));
        let angle = sqrt(dot(w, w));
        // Also where a number is none.
        if !(angle > NEAR && angle < 1e6) {
            break;
        }
        let axis = w * (1.0 / angle);
        let c = cos(angle);
        let s = sin(angle);
        for (var k = 0u; k < 3u; k++) {
            r[k] = r[k] * c + cross(axis, r[k]) * s + axis * (dot(axis, r[k]) * (1.0 - c));
        }
    }
    // What rounding has made of it.
    return first_rotation(r);
}

// Contact of a vertex or a node of the finest level: `at` of its own block, then of all around it.
fn contact_numbers(thing: u32) -> u32 {
    return levels[LEVELS_CONTACT] + CONTACT_NUMBERS * thing;
}

fn contact_of(source: u32) -> u32 {
    let is_vertex = (source & OF_VERTEX) != 0u;
    return contact_numbers(select(levels[LEVELS_VERTICES] + source, source & ~OF_VERTEX, is_vertex)) + 6u;
}

// What vertices give to a node of the finest level.
fn spread_contact(node: u32, is_one: bool, local: u32) {
    var own: array<f32, 9>;
    var whole: array<f32, 9>;
    let offsets = levels[LEVELS_CHILD_OFFSETS] + node;
    for (var i = levels[offsets] + local % SHARING; is_one && i < levels[offsets + 1u]; i += SHARING) {
        let at = levels[LEVELS_CHILDREN] + 2u * i;
        let weight = levels_number(at + 1u);
        let block = contact_of(levels[at]);
        for (var k = 0u; k < 6u; k++) {
            own[k] += weight * weight * multilevel[block + k];
            whole[k] += weight * multilevel[block + k];
        }
    }
    own = share_sums(own, local);
    whole = share_sums(whole, local);
    if is_one && local % SHARING == 0u {
        let into = contact_numbers(levels[LEVELS_VERTICES] + node);
        for (var k = 0u; k < 6u; k++) {
            multilevel[into + k] = own[k];
            multilevel[into + 6u + k] = whole[k];
        }
    }
}

// Of a vertex or an ordinary node, into sums as `add_shares` has them.
fn add_contact(item: u32, local: u32, sums: ptr<function, array<f32, 9>>) {
    let vertices = levels[LEVELS_VERTICES];
    if item < vertices + levels[LEVELS_FINE] {
        for (var k = 0u; k < 6u && local % SHARING == 0u; k++) {
            (*sums)[k] += multilevel[contact_numbers(item) + k];
        }
        return;
    }
    let offsets = levels[LEVELS_CHILD_OFFSETS] + item - vertices;
    for (var i = levels[offsets] + local % SHARING; i < levels[offsets + 1u]; i += SHARING) {
        let at = levels[LEVELS_CHILDREN] + 2u * i;
        let weight = levels_number(at + 1u);
        let block = contact_of(levels[at]);
        for (var k = 0u; k < 6u; k++) {
            (*sums)[k] += weight * weight * multilevel[block + k];
        }
    }
}

// The weight of a source in a node that gets its corrections.
fn weight_in(source: u32, node: u32) -> f32 {
    let is_vertex = (source & OF_VERTEX) != 0u;
    let rows = select(levels[LEVELS_UP_OFFSETS] + source, levels[LEVELS_PARENT_OFFSETS] + (source & ~OF_VERTEX), is_vertex);
    let entries = select(levels[LEVELS_UPS], levels[LEVELS_PARENTS], is_vertex);
    for (var i = levels[rows]; i < levels[rows + 1u]; i++) {
        if levels[entries + 2u * i] == node {
            return levels_number(entries + 2u * i + 1u);
        }
    }
    return 0.0;
}

// Of a pair of dense nodes, by columns.
fn add_contact_of_pair(row: u32, local: u32, sums: ptr<function, array<f32, 9>>) {
    let first = levels[row + 6u];
    let a = first + (levels[row + 1u] >> 16u);
    let b = first + (levels[row + 1u] & 0xffffu);
    let offsets = levels[LEVELS_CHILD_OFFSETS] + a;
    for (var i = levels[offsets] + local % SHARING; i < levels[offsets + 1u]; i += SHARING) {
        let at = levels[LEVELS_CHILDREN] + 2u * i;
        let block = contact_of(levels[at]);
        let trace = multilevel[block] + multilevel[block + 1u] + multilevel[block + 2u];
        if trace == 0.0 {
            continue;
        }
        let weight = levels_number(at + 1u) * weight_in(levels[at], b);
        let d = vector_at(block) * weight;
        let m = vector_at(block + 3u) * weight;
        (*sums)[0] += d.x;
        (*sums)[1] += m.z;
        (*sums)[2] += m.y;
        (*sums)[3] += m.z;
        (*sums)[4] += d.y;
        (*sums)[5] += m.x;
        (*sums)[6] += m.y;
        (*sums)[7] += m.x;
        (*sums)[8] += d.z;
    }
}

// Groups of tetrahedra, eight threads each; behind them nodes of the finest level, where there is contact.
@compute @workgroup_size(64)
fn turn_groups(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let first_group = (workgroup.x + workgroup.y * groups.x) * SHARED;
    let count = levels[LEVELS_GROUPS];
    // Nodes begin with a workgroup of their own.
    let first_node = (count + SHARED - 1u) / SHARED * SHARED;
    let group = first_group + local / SHARING;
    if workgroup_is(first_group >= first_node, local) {
        let node = group - first_node;
        let is_node = node < levels[LEVELS_FINE];
        spread_contact(min(node, levels[LEVELS_FINE] - 1u), is_node, local);
        return;
    }
    let is_one = group < count;
    let row = levels[LEVELS_GROUP_ROWS] + GROUP_WORDS * min(group, count - 1u);
    let first = levels[row + 4u];
    let end = select(first, levels[row + 5u], is_one);
    let stride = table[STRIDE_AT];
    let entries = levels[LEVELS_GROUP_ENTRIES];
    let he = step_of(levels[row + 6u]);
    // To the end of the step where that is all of the solve.
    let ahead = frame.dt * select(0.5, 1.0, he == frame.dt);
    // From one of its vertices: the gradients add up to nothing, and a place far away would drown them.
    let origin = vertex_data[PREVIOUS * stride + levels[entries + GROUP_ENTRY_WORDS * first]].xyz;
    var sums: array<f32, 9>;
    for (var i = first + local % SHARING; i < end; i += SHARING) {
        let at = entries + GROUP_ENTRY_WORDS * i;
        let v = levels[at];
        let moved = vertex_data[QN_START_VELOCITIES * stride + v].xyz * ahead;
        let x = vertex_data[PREVIOUS * stride + v].xyz - origin + moved;
        for (var column = 0u; column < 3u; column++) {
            let b = levels_number(at + 1u + column);
            sums[3u * column] += x.x * b;
            sums[3u * column + 1u] += x.y * b;
            sums[3u * column + 2u] += x.z * b;
        }
    }
    let all = share_sums(sums, local);
    if !is_one || local % SHARING != 0u {
        return;
    }
    let f = mat3x3f(
        vec3f(all[0], all[1], all[2]),
        vec3f(all[3], all[4], all[5]),
        vec3f(all[6], all[7], all[8]),
    );
    let r = rotation_of(f);
    var map = law_gradient_map(levels[row], f);
    if !is_finite(norm_squared(map)) {
        map = r;
    }
    let at = turn_at(group);
    for (var k = 0u; k < 3u; k++) {
        put_vector(at + 3u * k, r[k]);
        put_vector(at + 9u + 3u * k, map[k]);
    }
    multilevel[at + 18u] = 1.0 + levels_number(row + 1u) / he;
}

// `t I + A B A^T` of the shares of a vertex or node, times the factor of each group: xx, yy, zz, yz, xz, xy.
fn add_shares(item: u32, local: u32) -> array<f32, 9> {
    var sums: array<f32, 9>;
    let offsets = levels[LEVELS_SHARE_OFFSETS] + item;
    let end = levels[offsets + 1u];
    for (var i = levels[offsets] + local % SHARING; i < end; i += SHARING) {
        let share = levels[LEVELS_SHARES] + SHARE_WORDS * i;
        let at = turn_at(levels[share]);
        let map = matrix_at(at + 9u);
        let stiffer = multilevel[at + 18u];
        let direct = vec3f(levels_number(share + 2u), levels_number(share + 3u), levels_number(share + 4u));
        let mixed = vec3f(levels_number(share + 5u), levels_number(share + 6u), levels_number(share + 7u));
        let b = mat3x3f(
            vec3f(direct.x, mixed.z, mixed.y),
            vec3f(mixed.z, direct.y, mixed.x),
            vec3f(mixed.y, mixed.x, direct.z),
        );
        let whole = map * b * transpose(map);
        let trace = levels_number(share + 1u);
        sums[0] += stiffer * (trace + whole[0].x);
        sums[1] += stiffer * (trace + whole[1].y);
        sums[2] += stiffer * (trace + whole[2].z);
        sums[3] += stiffer * whole[1].z;
        sums[4] += stiffer * whole[0].z;
        sums[5] += stiffer * whole[0].y;
    }
    return sums;
}

// `mu (t I + R B^T R^T) + lambda A B A^T` of the entries of a pair of dense nodes, by columns.
fn add_entries(row: u32, local: u32) -> array<f32, 9> {
    var sums: array<f32, 9>;
    let end = levels[row + 5u];
    for (var i = levels[row + 4u] + local % SHARING; i < end; i += SHARING) {
        let entry = levels[LEVELS_ENTRIES] + ENTRY_WORDS * i;
        let group = levels[entry];
        let lame = levels[LEVELS_GROUP_ROWS] + GROUP_WORDS * group + 2u;
        let at = turn_at(group);
        let r = matrix_at(at);
        let map = matrix_at(at + 9u);
        let stiffer = multilevel[at + 18u];
        let mu = levels_number(lame) * stiffer;
        let lambda = levels_number(lame + 1u) * stiffer;
        var b: mat3x3f;
        for (var k = 0u; k < 3u; k++) {
            let column = entry + 1u + 3u * k;
            b[k] = vec3f(levels_number(column), levels_number(column + 1u), levels_number(column + 2u));
        }
        let shear = r * transpose(b) * transpose(r);
        let volume = map * b * transpose(map);
        let trace = mu * (b[0].x + b[1].y + b[2].z);
        for (var k = 0u; k < 3u; k++) {
            let column = shear[k] * mu + volume[k] * lambda;
            sums[3u * k] += column.x;
            sums[3u * k + 1u] += column.y;
            sums[3u * k + 2u] += column.z;
            sums[4u * k] += trace;
        }
    }
    return sums;
}

// The inverse of a symmetric positive definite matrix; zero of one that is not.
fn put_inverse(item: u32, given: array<f32, 9>, squared: f32, diagonal: f32) {
    let d = vec3f(given[0], given[1], given[2]) * squared + vec3f(diagonal);
    let m = vec3f(given[3], given[4], given[5]) * squared;
    let size = d.x + d.y + d.z;
    let a = d * (1.0 / size);
    let b = m * (1.0 / size);
    let cx = a.y * a.z - b.x * b.x;
    let cy = b.y * b.x - b.z * a.z;
    let cz = b.z * b.x - b.y * a.y;
    let determinant = a.x * cx + b.z * cy + b.y * cz;
    let at = inverse_at(item);
    var scale = 0.0;
    if determinant > 0.0 && is_finite(determinant) && size > 0.0 && is_finite(size) {
        scale = 1.0 / (determinant * size);
    }
    multilevel[at] = cx * scale;
    multilevel[at + 1u] = (a.x * a.z - b.y * b.y) * scale;
    multilevel[at + 2u] = (a.x * a.y - b.z * b.z) * scale;
    multilevel[at + 3u] = (b.z * b.y - a.x * b.x) * scale;
    multilevel[at + 4u] = cz * scale;
    multilevel[at + 5u] = cy * scale;
}

// Vertices, ordinary nodes and pairs of dense ones, eight threads each.
@compute @workgroup_size(64)
fn sum_blocks(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thing = (workgroup.x + workgroup.y * groups.x) * SHARED + local / SHARING;
    let vertices = levels[LEVELS_VERTICES];
    let items = vertices + levels[LEVELS_ORDINARY];
    let row = levels[LEVELS_PAIR_ROWS] + PAIR_WORDS * (thing - items);
    var sums: array<f32, 9>;
    let touches = levels[LEVELS_CONTACT] != 0u;
    if thing < items {
        sums = add_shares(thing, local);
        if touches {
            add_contact(thing, local, &sums);
        }
    } else if thing < job.count {
        sums = add_entries(row, local);
        if touches {
            add_contact_of_pair(row, local, &sums);
        }
    }
    let all = share_sums(sums, local);
    if thing >= job.count || local % SHARING != 0u {
        return;
    }
    var he = 0.0;
    if thing >= items {
        he = step_of(levels[row + 7u]);
    } else {
        he = step_of(part_of_item(thing));
    }
    let squared = he * he;
    if thing >= items {
        let stiffness = levels_number(row + 3u) * squared;
        put_pair(row, all, squared, levels_number(row + 2u) + stiffness);
        return;
    }
    let stiffness = levels_number(levels[LEVELS_STIFFNESSES] + thing) * squared;
    if thing >= vertices {
        let mass = levels_number(levels[LEVELS_MASSES] + thing - vertices);
        put_inverse(thing, all, squared, mass + stiffness);
        return;
    }
    // With what springs at single vertices add to their inertia. Pinned ones have no block.
    let inertia = vertex_data[PREDICTED * table[STRIDE_AT] + thing].w;
    let is_free = vertex_data[EXTERNAL_FORCES * table[STRIDE_AT] + thing].w != 0.0;
    // A part that is solved as a whole has no shares.
    let offsets = levels[LEVELS_SHARE_OFFSETS] + thing;
    if is_free && levels[offsets] != levels[offsets + 1u] {
        put_inverse(thing, all, squared, inertia + stiffness);
    } else {
        for (var k = 0u; k < 6u; k++) {
            multilevel[inverse_at(thing) + k] = 0.0;
        }
    }
}

fn put_pair(row: u32, sums: array<f32, 9>, squared: f32, diagonal: f32) {
    let matrix = levels[LEVELS_DENSE] + levels[row];
    let a = levels[row + 1u] >> 16u;
    let b = levels[row + 1u] & 0xffffu;
    for (var j = 0u; j < 3u; j++) {
        for (var i = 0u; i < 3u; i++) {
            let on_diagonal = select(0.0, diagonal, i == j);
            if 3u * b + j <= 3u * a + i {
                multilevel[matrix + packed(3u * a + i, 3u * b + j)] =
                    sums[3u * j + i] * squared + on_diagonal;
            }
        }
    }
}
