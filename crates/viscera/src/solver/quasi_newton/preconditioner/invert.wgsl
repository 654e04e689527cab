// The inverses of the dense levels, a workgroup each: the sweep operator (Goodnight, "A tutorial on the SWEEP operator", The
// American Statistician 33(3), 1979) on the lower triangle, some pivots at a time, so that the triangle is read and written a
// few dozen times and not once for each of up to 192 pivots:
//
//   K: pivots at hand, C = A_.K, P = A_KK^-1;   A_ij -= C_i P C_j^T,   A_iK = C_i P,   A_KK = -P;   at the end A = -A^-1

// A pivot below this share of its diagonal entry belongs to a direction that the others can do as well: it is left out.
const SMALLEST_PIVOT: f32 = 1e-5;

// Unknowns at most, and pivots at a time.
const MOST_UNKNOWNS: u32 = 3u * MOST_DENSE;
const PIVOTS: u32 = 6u;

var<workgroup> panel: array<array<f32, PIVOTS>, MOST_UNKNOWNS>;
var<workgroup> product: array<array<f32, PIVOTS>, MOST_UNKNOWNS>;
// The block of the pivots, and what is left of its entries at least.
var<workgroup> pivots: array<array<f32, PIVOTS>, PIVOTS>;
var<workgroup> smallest: array<f32, MOST_UNKNOWNS>;
var<workgroup> is_left_out: array<u32, MOST_UNKNOWNS>;

// The row of an entry of the triangle, whatever the rounding of the root.
fn row_of(i: u32) -> u32 {
    var r = u32((sqrt(8.0 * f32(i) + 1.0) - 1.0) * 0.5);
    r = select(r, r - 1u, packed(r, 0u) > i);
    return select(r, r + 1u, packed(r + 1u, 0u) <= i);
}

// Sweeps the block of the pivots from `first` on; what is left out becomes zero.
fn sweep_pivots(first: u32, count: u32) {
    for (var k = 0u; k < count; k++) {
        let p = pivots[k][k];
        let is_out = !(p > smallest[first + k] && is_finite(p));
        is_left_out[first + k] = select(0u, 1u, is_out);
        if is_out {
            continue;
        }
        let inverse = 1.0 / p;
        let column = pivots[k];
        for (var i = 0u; i < count; i++) {
            for (var j = 0u; j < count; j++) {
                if i != k && j != k {
                    pivots[i][j] -= column[i] * column[j] * inverse;
                }
            }
        }
        for (var i = 0u; i < count; i++) {
            pivots[i][k] = column[i] * inverse;
            pivots[k][i] = column[i] * inverse;
        }
        pivots[k][k] = -inverse;
    }
    for (var i = 0u; i < PIVOTS; i++) {
        for (var j = 0u; j < PIVOTS; j++) {
            let is_one = i < count && j < count;
            let is_out = is_left_out[min(first + i, MOST_UNKNOWNS - 1u)] + is_left_out[min(first + j, MOST_UNKNOWNS - 1u)];
            if !is_one || is_out != 0u {
                pivots[i][j] = 0.0;
            }
        }
    }
}

@compute @workgroup_size(256)
fn invert_dense(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let part = workgroup.x + workgroup.y * groups.x;
    let row = levels[LEVELS_PART_ROWS] + LEVEL_PART_WORDS * min(part, job.count - 1u);
    let n = select(0u, 3u * levels[row + 1u], part < job.count);
    let matrix = levels[LEVELS_DENSE] + levels[row + 2u];
    let size = n * (n + 1u) / 2u;
    if local < MOST_UNKNOWNS {
        is_left_out[local] = 0u;
        // The diagonal as it was.
        smallest[local] = 0.0;
        if local < n {
            smallest[local] = SMALLEST_PIVOT * multilevel[matrix + packed(local, local)];
        }
    }
    workgroupBarrier();
    for (var first = 0u; first < MOST_UNKNOWNS; first += PIVOTS) {
        let count = min(PIVOTS, n - min(first, n));
        if local < n {
            for (var q = 0u; q < PIVOTS; q++) {
                var entry = 0.0;
                if q < count {
                    let k = first + q;
                    entry = multilevel[matrix + packed(max(local, k), min(local, k))];
                }
                panel[local][q] = entry;
                if local >= first && local < first + count {
                    pivots[local - first][q] = entry;
                }
            }
        }
        workgroupBarrier();
        if local == 0u {
            sweep_pivots(first, count);
        }
        workgroupBarrier();
        if local < n {
            for (var q = 0u; q < PIVOTS; q++) {
                var sum = 0.0;
                for (var k = 0u; k < PIVOTS; k++) {
                    // Swept, the block is minus its inverse.
                    sum -= panel[local][k] * pivots[k][q];
                }
                product[local][q] = sum;
            }
        }
        workgroupBarrier();
        for (var i = local; i < size && count > 0u; i += 256u) {
            let r = row_of(i);
            let c = i - packed(r, 0u);
            let is_row = r >= first && r < first + count;
            let is_column = c >= first && c < first + count;
            if is_row && is_column {
                multilevel[matrix + i] = pivots[r - first][c - first];
            } else if is_row {
                multilevel[matrix + i] = product[c][r - first];
            } else if is_column {
                multilevel[matrix + i] = product[r][c - first];
            } else {
                var sum = multilevel[matrix + i];
                for (var q = 0u; q < PIVOTS; q++) {
                    sum -= product[r][q] * panel[c][q];
                }
                multilevel[matrix + i] = sum;
            }
        }
        storageBarrier();
        workgroupBarrier();
    }
    for (var i = local; i < size; i += 256u) {
        let r = row_of(i);
        let is_out = is_left_out[r] + is_left_out[i - packed(r, 0u)] != 0u;
        multilevel[matrix + i] = select(-multilevel[matrix + i], 0.0, is_out);
    }
}
