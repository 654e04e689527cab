// Recovered-gradient tetrahedra on a device: the tables that do not move (on_device.rs), and what passes leave to each
// other in `recovery`. Names with `RECOVERED_` are places in the header of these tables.
//
//   of a place n     G_n, D_n or two of them, N_n, three columns each; the fourth numbers: see below
//   of a tetrahedron dE/dFh without the mean pressure, V cof Fh, V/4 (J - 1), V/4 times the changes of J, the floor's factor
//   of an average    sums that a workgroup of clusters leaves

const NOWHERE_PLACE: u32 = 0xffffffffu;
const LANES_OF_PLACE: u32 = 8u;

// Ranges of places, of three columns each. `STRESSES` are the second changes at the end of a step.
const GRADIENTS: u32 = 0u;
const CHANGES: u32 = 3u;
const STRESSES: u32 = 6u;
const STARTS: u32 = 9u;

struct Place {
    vertex: u32,
    // [m^3], and one over it; zero of places that only fill a group up.
    volume: f32,
    inverse_volume: f32,
    // `l` and `mu` [Pa], retardation time [s], `k_n` and `k_c` [Pa].
    local: f32,
    lame_mu: f32,
    viscosity: f32,
    domain: f32,
    cluster: f32,
}

// Where a table begins; the header counts from its own place.
fn recovered_table(word: u32) -> u32 {
    return table[RECOVERED_AT] + recovered_count(word);
}

// A number of the header.
fn recovered_count(word: u32) -> u32 {
    return table[table[RECOVERED_AT] + word];
}

fn recovered_share(word: u32) -> f32 {
    return number(table[RECOVERED_AT] + word);
}

fn place_of_number(n: u32) -> Place {
    let row = recovered_table(RECOVERED_PLACES) + PLACE_WORDS * n;
    return Place(
        table[row],
        number(row + 1u),
        number(row + 2u),
        number(row + 3u),
        number(row + 4u),
        number(row + 5u),
        number(row + 6u),
        number(row + 7u),
    );
}

fn column_at(range: u32, n: u32) -> u32 {
    return range * recovered_count(RECOVERED_COUNT) + n;
}

fn matrix_of(range: u32, n: u32) -> mat3x3f {
    return mat3x3f(
        recovery[column_at(range, n)].xyz,
        recovery[column_at(range + 1u, n)].xyz,
        recovery[column_at(range + 2u, n)].xyz,
    );
}

fn put_matrix(range: u32, n: u32, m: mat3x3f, fourth: vec3f) {
    for (var k = 0u; k < 3u; k++) {
        recovery[column_at(range + k, n)] = vec4f(m[k], fourth[k]);
    }
}

// Of a tetrahedron: what its block and lane of the law's are, and a row of eight lanes in the tables.
fn frame_row(block: u32, lane: u32, row: u32) -> u32 {
    return recovered_table(RECOVERED_FRAMES) + LANES * (FRAME_ROWS * block + row) + lane;
}

fn frame_of(block: u32, lane: u32, shape: mat3x3f) -> RecoveredRestFrame {
    var arms: array<vec3f, 4>;
    for (var a = 1u; a < 4u; a++) {
        let row = 3u * (a - 1u);
        arms[a] = vec3f(
            number(frame_row(block, lane, row)),
            number(frame_row(block, lane, row + 1u)),
            number(frame_row(block, lane, row + 2u)),
        );
    }
    arms[0] = -((arms[1] + arms[2]) + arms[3]);
    var weights: vec4f;
    for (var o = 0u; o < 4u; o++) {
        weights[o] = number(frame_row(block, lane, 9u + o));
    }
    return RecoveredRestFrame(shape_gradients(shape), arms, weights);
}

fn place_of_corner(block: u32, lane: u32, corner: u32) -> u32 {
    return table[frame_row(block, lane, 13u + corner)];
}

fn matrices_of(range: u32, block: u32, lane: u32) -> array<mat3x3f, 4> {
    var all: array<mat3x3f, 4>;
    for (var corner = 0u; corner < 4u; corner++) {
        all[corner] = matrix_of(range, place_of_corner(block, lane, corner));
    }
    return all;
}

// What a tetrahedron leaves.
struct TetState {
    // `h^2 V dE/dFh` [N m s^2] but for the pressure, and `h^2 V cof Fh`.
    stress: mat3x3f,
    area: mat3x3f,
    // `cof F` of the linear tetrahedron times this is the stress of the volume floor.
    floor: f32,
}

fn tet_row(block: u32, lane: u32, row: u32) -> u32 {
    return recovered_count(RECOVERED_TETS_AT) + LANES * (TET_ROWS * block + row) + lane;
}

fn put_tet(block: u32, lane: u32, tet: TetState) {
    for (var k = 0u; k < 3u; k++) {
        recovery[tet_row(block, lane, k)] = vec4f(tet.stress[k], tet.area[0][k]);
    }
    recovery[tet_row(block, lane, 3u)] = vec4f(tet.area[1], tet.area[2].x);
    recovery[tet_row(block, lane, 4u)] = vec4f(tet.area[2].yz, tet.floor, 0.0);
}

// `V/4` times `J - 1` and its changes [m^3].
fn put_volumes(block: u32, lane: u32, volumes: vec3f) {
    recovery[tet_row(block, lane, 5u)] = vec4f(volumes, 0.0);
}

fn volumes_of(block: u32, lane: u32) -> vec3f {
    return recovery[tet_row(block, lane, 5u)].xyz;
}

fn tet_of(block: u32, lane: u32) -> TetState {
    let a = recovery[tet_row(block, lane, 0u)];
    let b = recovery[tet_row(block, lane, 1u)];
    let c = recovery[tet_row(block, lane, 2u)];
    let d = recovery[tet_row(block, lane, 3u)];
    let e = recovery[tet_row(block, lane, 4u)];
    let area = mat3x3f(vec3f(a.w, b.w, c.w), d.xyz, vec3f(d.w, e.xy));
    return TetState(mat3x3f(a.xyz, b.xyz, c.xyz), area, e.z);
}

// Whether a block's tetrahedra are recovered-gradient ones, and its number among these.
fn is_recovered(block: u32) -> bool {
    return law_of(block) == RECOVERED_LAW;
}

fn recovered_block(block: u32) -> u32 {
    return block - recovered_count(RECOVERED_FIRST_BLOCK);
}

var<workgroup> shared_columns: array<array<vec3f, 4>, 64>;

// Sums of the threads that share a place, for the first of them: four vectors at a time.
fn share_columns(given: array<vec3f, 4>, local: u32) -> array<vec3f, 4> {
    workgroupBarrier();
    shared_columns[local] = given;
    for (var half = LANES_OF_PLACE / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if local % LANES_OF_PLACE < half {
            for (var k = 0u; k < 4u; k++) {
                shared_columns[local][k] += shared_columns[local + half][k];
            }
        }
    }
    workgroupBarrier();
    return shared_columns[local - local % LANES_OF_PLACE];
}

fn share_matrix(m: mat3x3f, local: u32) -> mat3x3f {
    let all = share_columns(array<vec3f, 4>(m[0], m[1], m[2], vec3f()), local);
    return mat3x3f(all[0], all[1], all[2]);
}

// Means over clusters: 64 of them a workgroup, four places each.

var<workgroup> shared_means: array<vec3f, 256>;

// `Jh_n - 1` and its changes.
fn mean_of_place(n: u32, of_place: Place) -> vec3f {
    var sum = vec3f();
    let offsets = recovered_table(RECOVERED_TET_OFFSETS) + n;
    let end = table[offsets + 1u];
    for (var i = table[offsets]; i < end; i++) {
        let tet = table[recovered_table(RECOVERED_CORNERS) + i] / 4u;
        sum += volumes_of(tet / LANES, tet % LANES);
    }
    return sum * of_place.inverse_volume;
}

// `Jh_c - 1` and its changes, from the means of its places.
fn mean_of_cluster(cluster: u32, given: vec3f, local: u32) -> vec3f {
    shared_means[local] = given;
    workgroupBarrier();
    let first = local - local % 4u;
    let sum = (shared_means[first] + shared_means[first + 1u]) + (shared_means[first + 2u] + shared_means[first + 3u]);
    return sum * number(recovered_table(RECOVERED_CLUSTER_VOLUMES) + cluster);
}

// The factor of a linear tetrahedron's cofactors in the stress [Pa] of its volume floor.
fn floor_factor(linear: mat3x3f, lame_mu: f32) -> f32 {
    return RECOVERED_FLOOR_STIFFNESS * lame_mu * recovered_below_floor(linear);
}

// What a thread of a workgroup of clusters finds: its place, and the means over that and over its cluster.
struct Means {
    n: u32,
    place: Place,
    of_place: vec3f,
    of_cluster: vec3f,
}

// For all threads of the workgroup at once; places are nowhere where a cluster has fewer.
fn find_means(group: u32, local: u32) -> Means {
    let n = table[recovered_table(RECOVERED_CLUSTER_PLACES) + 256u * group + local];
    var place = Place();
    var mean = vec3f();
    if n != NOWHERE_PLACE {
        place = place_of_number(n);
        mean = mean_of_place(n, place);
    }
    let of_cluster = mean_of_cluster(64u * group + local / 4u, mean * place.volume, local);
    return Means(n, place, mean, of_cluster);
}

// `p_n` [Pa], where the place's gradient has room for it.
fn put_pressure(means: Means) {
    let pressure = means.place.domain * means.of_place.x + means.place.cluster * means.of_cluster.x;
    recovery[column_at(GRADIENTS, means.n)].w = pressure;
}

// Changes [J] of what a place stores along the `k`-th changes, which stand at `range`, in a step of `h` [s]: by its own
// gradient, by its volume, by its cluster's.
fn place_changes(means: Means, range: u32, k: u32, h: f32) -> vec3f {
    let place = means.place;
    let f = matrix_of(GRADIENTS, means.n);
    let d = matrix_of(range, means.n);
    var density = neo_hookean_energy_change(f, d, place.local, place.lame_mu);
    if place.viscosity > 0.0 {
        let since = tissue_change_since(f, green_strain_strain(matrix_of(STARTS, means.n)));
        let rate = place.viscosity / h;
        density += tissue_viscous_energy_change(f, d, since, rate, place.local, place.lame_mu);
    }
    return place.volume * vec3f(
        recovered_share(RECOVERED_PLACE_SHARE) * density,
        bulk_change(place.domain, means.of_place.x, means.of_place[k + 1u]),
        bulk_change(place.cluster, means.of_cluster.x, means.of_cluster[k + 1u]),
    );
}

// Change [Pa] of what a mean volume stores.
fn bulk_change(stiffness: f32, mean: f32, change: f32) -> f32 {
    return stiffness * change * (mean + 0.5 * change);
}
