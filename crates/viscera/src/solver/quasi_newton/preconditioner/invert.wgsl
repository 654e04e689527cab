// The inverses of the dense levels, a workgroup each: the sweep operator (Goodnight, "A tutorial on the SWEEP operator", The
// American Statistician 33(3), 1979) on the lower triangle, pivot by pivot:
//
//   p = a_kk,  b = a_k. ;   a_ij -= b_i b_j/p,   a_ik = b_i/p,   a_kk = -1/p;   at the end a = -A^-1

// A pivot below this share of its diagonal entry belongs to a direction that the others can do as well: it is left out.
const SMALLEST_PIVOT: f32 = 1e-5;

var<workgroup> triangle: array<f32, 3828>;
var<workgroup> column: array<f32, 87>;
var<workgroup> is_left_out: array<u32, 87>;

// The row of an entry of the triangle, whatever the rounding of the root.
fn row_of(i: u32) -> u32 {
    var r = u32((sqrt(8.0 * f32(i) + 1.0) - 1.0) * 0.5);
    r = select(r, r - 1u, packed(r, 0u) > i);
    return select(r, r + 1u, packed(r + 1u, 0u) <= i);
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
    for (var i = local; i < size; i += 256u) {
        triangle[i] = multilevel[matrix + i];
    }
    workgroupBarrier();
    // The diagonal as it was.
    var smallest = 0.0;
    if local < n {
        smallest = SMALLEST_PIVOT * triangle[packed(local, local)];
    }
    for (var k = 0u; k < n; k++) {
        let p = triangle[packed(k, k)];
        if local < n {
            column[local] = triangle[packed(max(local, k), min(local, k))];
        }
        if local == k {
            is_left_out[k] = select(1u, 0u, p > smallest && is_finite(p));
        }
        workgroupBarrier();
        if is_left_out[k] == 0u {
            let inverse = 1.0 / p;
            for (var i = local; i < size; i += 256u) {
                let r = row_of(i);
                let c = i - packed(r, 0u);
                if r != k && c != k {
                    triangle[i] -= column[r] * column[c] * inverse;
                } else if r != c {
                    triangle[i] = column[select(r, c, r == k)] * inverse;
                } else {
                    triangle[i] = -inverse;
                }
            }
        }
        workgroupBarrier();
    }
    for (var i = local; i < size; i += 256u) {
        let r = row_of(i);
        let is_out = is_left_out[r] + is_left_out[i - packed(r, 0u)] != 0u;
        multilevel[matrix + i] = select(-triangle[i], 0.0, is_out);
    }
}
