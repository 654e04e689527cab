// Chebyshev and Anderson on q = (x, l) (solver/xpbd/acceleration.rs), with Anderson's least-squares problem in
// successive differences,
//
//   g = argmin |R_k - sum_j g_j dR_j|,   q_(k+1) = G_k - sum_j g_j dG_j,   dR_j = R_(j+1) - R_j
//
// which spans the same space as differences to the newest: then the products of old differences with
// each other need not be summed again, and their small values do not suffer from single precision.

// In single precision the residuals themselves carry round-off of that size.
const REGULARISATION: f32 = 1e-6;

@compute @workgroup_size(256)
fn remember_iterate(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread_of(id, groups, 256u);
    if i < job.count {
        iterate[i] = unknowns[i];
    }
}

// Threads that add up one product, and a workgroup's: a product is a column of what they read.
const ADDERS: u32 = 12u;

// The products of this sweep, those of all differences with each other, and what solves them: here and not in a
// thread's own memory, which lies as far away as storage where it is indexed at run time.
var<workgroup> products: array<f32, PRODUCTS>;
var<workgroup> gram: array<f32, 100>;
var<workgroup> factor: array<f32, 100>;
var<workgroup> scale: array<f32, 10>;
var<workgroup> right: array<f32, 10>;

// The small least-squares problem, a workgroup for each of `job.count` parts. `job.mode`: whether a residual
// that has grown drops the history.
@compute @workgroup_size(256)
fn anderson_weights(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let part = workgroup.x + workgroup.y * groups.x;
    if part >= job.count {
        return;
    }
    let first = first_group(part);
    let end = table[part_row(part) + PART_GROUPS_END];
    let adder = local / PRODUCTS;
    var sum = 0.0;
    if adder < ADDERS {
        for (var piece = first + adder; piece < end; piece += ADDERS) {
            sum += partial_sums[PRODUCTS * piece + local % PRODUCTS];
        }
    }
    shared_sums[local] = sum;
    if local < 100u {
        gram[local] = control.parts[part].gram[local];
    }
    workgroupBarrier();
    if local < PRODUCTS {
        var total = 0.0;
        for (var t = 0u; t < ADDERS; t++) {
            total += shared_sums[PRODUCTS * t + local];
        }
        products[local] = total;
    }
    workgroupBarrier();
    if local != 0u {
        return;
    }
    // One thread from here on: at most ten unknowns are fewer operations than barriers between threads would cost.
    let window = job.set_first;
    // The same `n` as `anderson_push` has found: it wrote the newest difference to the slot `newest` before this. The
    // ring is filled from slot 0, so slots in use are 0..n whatever their age; weights do not care for order.
    let has_difference = control.parts[part].sweeps > 0u;
    let newest = control.parts[part].next;
    var n = select(0u, min(control.parts[part].differences + 1u, window), has_difference);
    // Only products with the newest difference are new: its row and column. Those of old differences stay.
    for (var j = 0u; j < n; j++) {
        let product = products[11u + j];
        gram[LARGEST_WINDOW * newest + j] = product;
        gram[LARGEST_WINDOW * j + newest] = product;
        control.parts[part].gram[LARGEST_WINDOW * newest + j] = product;
        control.parts[part].gram[LARGEST_WINDOW * j + newest] = product;
    }
    // As on the CPU: this sweep is taken as it is. `sweeps` 1 and not 0, because its residual and mapped iterate are
    // kept (behind the window), and the next sweep's difference is to them.
    if job.mode != 0u && products[0] > control.parts[part].last_norm {
        control.parts[part].sweeps = 1u;
        control.parts[part].next = 0u;
        n = 0u;
    } else {
        control.parts[part].sweeps += 1u;
        control.parts[part].next = select(newest, (newest + 1u) % window, has_difference);
    }
    control.parts[part].differences = n;
    control.parts[part].last_norm = products[0];
    least_squares(n);
    for (var j = 0u; j < LARGEST_WINDOW; j++) {
        control.parts[part].shares[j] = select(0.0, right[j] * scale[j], j < n);
    }
}

// Solves gram g = right, the products with the residual, with columns scaled to unit length and a small multiple of
// the identity added, by Cholesky; leaves g / scale in `right`. Columns without length get no share.
fn least_squares(n: u32) {
    for (var j = 0u; j < n; j++) {
        // Rows are ten long, so 11 j is on the diagonal.
        let length = gram[11u * j];
        scale[j] = select(0.0, inverseSqrt(length), length > 0.0);
        right[j] = products[1u + j] * scale[j];
    }
    for (var j = 0u; j < n; j++) {
        for (var k = 0u; k <= j; k++) {
            factor[10u * j + k] = gram[10u * j + k] * (scale[j] * scale[k]);
        }
        factor[11u * j] += select(1.0, REGULARISATION, scale[j] > 0.0);
    }
    for (var j = 0u; j < n; j++) {
        for (var k = 0u; k <= j; k++) {
            var value = factor[10u * j + k];
            for (var i = 0u; i < k; i++) {
                value -= factor[10u * j + i] * factor[10u * k + i];
            }
            if k < j {
                factor[10u * j + k] = value / factor[11u * k];
            } else {
                factor[11u * j] = sqrt(max(value, REGULARISATION));
            }
        }
    }
    for (var j = 0u; j < n; j++) {
        var value = right[j];
        for (var k = 0u; k < j; k++) {
            value -= factor[10u * j + k] * right[k];
        }
        right[j] = value / factor[11u * j];
    }
    for (var step = 0u; step < n; step++) {
        let j = n - 1u - step;
        var value = right[j];
        for (var k = j + 1u; k < n; k++) {
            value -= factor[10u * k + j] * right[k];
        }
        right[j] = value / factor[11u * j];
    }
}

// q = G_k - sum_j g_j dG_j, of positions (mode bit 0) and multipliers (mode bit 1); with mode bit 2 the
// result is remembered as the next iterate.
@compute @workgroup_size(256)
fn anderson_mix(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let span = span_of(workgroup, groups);
    if span.groups == 0u {
        return;
    }
    var run = Run();
    for (var j = span.group * 256u + local; j < span.length; j += span.groups * 256u) {
        let i = number_at(&run, span.part, j);
        if counts(i) {
            mix_number(span.part, i);
        }
    }
}

fn mix_number(part: u32, i: u32) {
    var q = mapped[job.set_first * job.count + i];
    let bit = select(1u, 2u, i >= job.first);
    if (job.mode & bit) != 0u {
        for (var j = 0u; j < control.parts[part].differences; j++) {
            q -= control.parts[part].shares[j] * mapped[j * job.count + i];
        }
        unknowns[i] = q;
    }
    if (job.mode & 4u) != 0u {
        iterate[i] = q;
    }
}

// Squared norm of what the sweep changed, in pieces.
@compute @workgroup_size(128)
fn chebyshev_change(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let span = span_of(workgroup, groups);
    if span.groups == 0u {
        return;
    }
    var sum = 0.0;
    var run = Run();
    for (var j = span.group * THREADS + local; j < span.length; j += span.groups * THREADS) {
        let i = number_at(&run, span.part, j);
        if counts(i) {
            let change = unknowns[i] - iterate[i];
            sum += weight_of(i) * change * change;
        }
    }
    shared_sums[local] = sum;
    workgroupBarrier();
    if local == 0u {
        var total = 0.0;
        for (var t = 0u; t < THREADS; t++) {
            total += shared_sums[t];
        }
        partial_sums[first_group(span.part) + span.group] = total;
    }
}

// Measured radii are kept below this: at 1 the weights no longer contract.
const LARGEST_RADIUS: f32 = 0.9999;

// omega = 1 for k < S, then 2/(2 - rho^2), then 4/(4 - rho^2 omega), a workgroup for each of `job.count`
// parts. `job.first`: the delay S, `job.mode`: whether the radius is measured.
@compute @workgroup_size(128)
fn chebyshev_weight(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let part = workgroup.x + workgroup.y * groups.x;
    if part >= job.count {
        return;
    }
    let end = table[part_row(part) + PART_GROUPS_END];
    var sum = 0.0;
    for (var piece = first_group(part) + local; piece < end; piece += THREADS) {
        sum += partial_sums[piece];
    }
    shared_sums[local] = sum;
    workgroupBarrier();
    if local != 0u {
        return;
    }
    var total = 0.0;
    for (var t = 0u; t < THREADS; t++) {
        total += shared_sums[t];
    }
    let change = sqrt(total);
    let k = control.parts[part].iteration;
    control.parts[part].iteration = k + 1u;
    if k < job.first {
        if job.mode != 0u && control.parts[part].last_change > 0.0 {
            control.parts[part].radius = min(change / control.parts[part].last_change, LARGEST_RADIUS);
        }
        control.parts[part].last_change = change;
        control.parts[part].omega = 1.0;
    } else {
        let squared = control.parts[part].radius * control.parts[part].radius;
        let first = 2.0 / (2.0 - squared);
        control.parts[part].omega = select(4.0 / (4.0 - squared * control.parts[part].omega), first, k == job.first);
    }
}

// q_(k+1) = omega (gamma (g(q_k) - q_k) + q_k - q_(k-1)) + q_(k-1), remembered as the next iterate.
@compute @workgroup_size(256)
fn chebyshev_mix(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let span = span_of(workgroup, groups);
    if span.groups == 0u {
        return;
    }
    let omega = control.parts[span.part].omega;
    var run = Run();
    for (var j = span.group * 256u + local; j < span.length; j += span.groups * 256u) {
        let i = number_at(&run, span.part, j);
        if counts(i) {
            extrapolate_number(i, omega);
        }
    }
}

fn extrapolate_number(i: u32, omega: f32) {
    let q = iterate[i];
    let before = older[i];
    let gamma = frame.chebyshev_damping;
    var next = unknowns[i];
    if omega != 1.0 {
        next = omega * (gamma * (next - q) + q - before) + before;
    } else if gamma != 1.0 {
        // There need not be anything before the first iterate.
        next = gamma * (next - q) + q;
    }
    unknowns[i] = next;
    older[i] = q;
    iterate[i] = next;
}
