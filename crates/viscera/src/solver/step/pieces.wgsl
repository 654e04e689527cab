// Sums over pieces: 512 elements, or vertices, of one connected part. A piece is summed by one workgroup, pieces by every
// workgroup that needs their sum, always in the same order.

const THREADS: u32 = 256u;
const EPSILON: f32 = 1.1920929e-7;

alias Sums = array<f32, SUMS>;

var<workgroup> shared_sums: array<f32, 2048>;
var<workgroup> totals: Sums;
var<workgroup> decision: u32;

// Sums over the workgroup, eight at a time, into `totals`; maxima where `maxima` has a bit.
fn reduce(given: Sums, groups: u32, maxima: u32, local: u32) {
    var values = given;
    for (var group = 0u; group < groups; group++) {
        workgroupBarrier();
        for (var k = 0u; k < 8u; k++) {
            shared_sums[THREADS * k + local] = values[8u * group + k];
        }
        workgroupBarrier();
        for (var half = THREADS / 2u; half > 0u; half /= 2u) {
            if local < half {
                for (var k = 0u; k < 8u; k++) {
                    let at = THREADS * k + local;
                    let a = shared_sums[at];
                    let b = shared_sums[at + half];
                    let is_maximum = (maxima & (1u << (8u * group + k))) != 0u;
                    shared_sums[at] = select(a + b, max(a, b), is_maximum);
                }
            }
            workgroupBarrier();
        }
        if local < 8u {
            totals[8u * group + local] = shared_sums[THREADS * local];
        }
    }
    workgroupBarrier();
}

// The first thread's answer, for all threads.
fn agree(yes: bool, local: u32) -> bool {
    if local == 0u {
        decision = select(0u, 1u, yes);
    }
    return workgroupUniformLoad(&decision) != 0u;
}

// The vertices of an element, as often as it takes to fill four places.
fn corners_of(element: u32) -> array<u32, 4> {
    let tet_lanes = table[TET_LANES_AT];
    if element < tet_lanes {
        return vertices_of(element / LANES, element % LANES);
    }
    return four_of(element_row(element - tet_lanes) + ELEMENT_VERTICES);
}

fn first_vertex_of(part: u32) -> u32 {
    return table[piece_row(table[part_row(part) + PART_VERTEX_PIECES]) + PIECE_FIRST];
}

// An element of a piece.
fn member(i: u32) -> u32 {
    return table[table[MEMBERS_AT] + i];
}

// Pieces of a part, elements before vertices, and which of all the `i`-th is.
fn piece_count(part: u32) -> u32 {
    let row = part_row(part);
    let elements = table[row + PART_ELEMENT_PIECES_END] - table[row + PART_ELEMENT_PIECES];
    return elements + table[row + PART_VERTEX_PIECES_END] - table[row + PART_VERTEX_PIECES];
}

fn piece_at(part: u32, i: u32) -> u32 {
    let row = part_row(part);
    let first = table[row + PART_ELEMENT_PIECES];
    let elements = table[row + PART_ELEMENT_PIECES_END] - first;
    return select(first + i, table[row + PART_VERTEX_PIECES] + i - elements, i >= elements);
}
