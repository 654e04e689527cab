// Chebyshev and Anderson on q = (x, l) (solver/acceleration.rs), with Anderson's least-squares problem in
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

@compute @workgroup_size(1)
fn start_acceleration() {
    atomicStore(&control.is_broken, 0u);
    control.sweeps = 0u;
    control.next = 0u;
    control.differences = 0u;
    control.last_norm = 3e38;
    control.iteration = 0u;
    control.omega = 1.0;
    control.radius = job.parameter;
    control.last_change = 0.0;
}

// The small least-squares problem. `job.count`: how many sums of pieces there are, `job.mode`: whether a
// residual that has grown starts a new history.
@compute @workgroup_size(128)
fn anderson_weights(@builtin(local_invocation_index) local: u32) {
    // Six threads for each sum.
    let product = local / 6u;
    var sum = 0.0;
    if product < PRODUCTS {
        for (var piece = local % 6u; piece < job.count; piece += 6u) {
            sum += partial_sums[PRODUCTS * piece + product];
        }
    }
    shared_sums[local] = sum;
    workgroupBarrier();
    if local != 0u {
        return;
    }
    var products: array<f32, 21>;
    for (var k = 0u; k < PRODUCTS; k++) {
        var total = 0.0;
        for (var t = 0u; t < 6u; t++) {
            total += shared_sums[6u * k + t];
        }
        products[k] = total;
    }
    let window = job.set_first;
    let has_difference = control.sweeps > 0u;
    let newest = control.next;
    var n = select(0u, min(control.differences + 1u, window), has_difference);
    for (var j = 0u; j < n; j++) {
        control.gram[LARGEST_WINDOW * newest + j] = products[11u + j];
        control.gram[LARGEST_WINDOW * j + newest] = products[11u + j];
    }
    control.sweeps += 1u;
    control.differences = n;
    if has_difference {
        control.next = (newest + 1u) % window;
    }
    if job.mode != 0u && products[0] > control.last_norm {
        control.differences = 0u;
        control.next = 0u;
        control.sweeps = 1u;
        n = 0u;
    }
    control.last_norm = products[0];
    least_squares(products, n);
}

// Solves gram g = right with columns scaled to unit length and a small multiple of the identity added, by
// Cholesky. Columns without length get no share.
fn least_squares(products: array<f32, 21>, n: u32) {
    var all = products;
    var scale: array<f32, 10>;
    var a: array<f32, 100>;
    var b: array<f32, 10>;
    for (var j = 0u; j < n; j++) {
        let length = control.gram[11u * j];
        scale[j] = select(0.0, inverseSqrt(length), length > 0.0);
        b[j] = all[1u + j] * scale[j];
    }
    for (var j = 0u; j < n; j++) {
        for (var k = 0u; k <= j; k++) {
            a[10u * j + k] = control.gram[10u * j + k] * (scale[j] * scale[k]);
        }
        a[11u * j] += select(1.0, REGULARISATION, scale[j] > 0.0);
    }
    for (var j = 0u; j < n; j++) {
        for (var k = 0u; k <= j; k++) {
            var value = a[10u * j + k];
            for (var i = 0u; i < k; i++) {
                value -= a[10u * j + i] * a[10u * k + i];
            }
            if k < j {
                a[10u * j + k] = value / a[11u * k];
            } else {
                a[11u * j] = sqrt(max(value, REGULARISATION));
            }
        }
    }
    for (var j = 0u; j < n; j++) {
        for (var k = 0u; k < j; k++) {
            b[j] -= a[10u * j + k] * b[k];
        }
        b[j] /= a[11u * j];
    }
    for (var step = 0u; step < n; step++) {
        let j = n - 1u - step;
        for (var k = j + 1u; k < n; k++) {
            b[j] -= a[10u * k + j] * b[k];
        }
        b[j] /= a[11u * j];
    }
    for (var j = 0u; j < LARGEST_WINDOW; j++) {
        control.shares[j] = select(0.0, b[j] * scale[j], j < n);
    }
}

// q = G_k - sum_j g_j dG_j, of positions (mode bit 0) and multipliers (mode bit 1); with mode bit 2 the
// result is remembered as the next iterate.
@compute @workgroup_size(256)
fn anderson_mix(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread_of(id, groups, 256u);
    if i >= job.count || !counts(i) {
        return;
    }
    var q = mapped[job.set_first * job.count + i];
    let bit = select(1u, 2u, i >= job.first);
    if (job.mode & bit) != 0u {
        for (var j = 0u; j < control.differences; j++) {
            q -= control.shares[j] * mapped[j * job.count + i];
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
) {
    var sum = 0.0;
    for (var i = workgroup.x * THREADS + local; i < job.count; i += job.mode * THREADS) {
        if counts(i) {
            let change = unknowns[i] - iterate[i];
            sum += weights[i] * change * change;
        }
    }
    shared_sums[local] = sum;
    workgroupBarrier();
    if local == 0u {
        var total = 0.0;
        for (var t = 0u; t < THREADS; t++) {
            total += shared_sums[t];
        }
        partial_sums[workgroup.x] = total;
    }
}

// Measured radii are kept below this: at 1 the weights no longer contract.
const LARGEST_RADIUS: f32 = 0.9999;

// omega = 1 for k < S, then 2/(2 - rho^2), then 4/(4 - rho^2 omega). `job.count`: sums, `job.first`: the
// delay S, `job.mode`: whether the radius is measured.
@compute @workgroup_size(128)
fn chebyshev_weight(@builtin(local_invocation_index) local: u32) {
    var sum = 0.0;
    for (var piece = local; piece < job.count; piece += THREADS) {
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
    let k = control.iteration;
    control.iteration = k + 1u;
    if k < job.first {
        if job.mode != 0u && control.last_change > 0.0 {
            control.radius = min(change / control.last_change, LARGEST_RADIUS);
        }
        control.last_change = change;
        control.omega = 1.0;
    } else {
        let squared = control.radius * control.radius;
        let first = 2.0 / (2.0 - squared);
        control.omega = select(4.0 / (4.0 - squared * control.omega), first, k == job.first);
    }
}

// q_(k+1) = omega (gamma (g(q_k) - q_k) + q_k - q_(k-1)) + q_(k-1), remembered as the next iterate.
@compute @workgroup_size(256)
fn chebyshev_mix(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread_of(id, groups, 256u);
    if i >= job.count || !counts(i) {
        return;
    }
    let q = iterate[i];
    let before = older[i];
    let omega = control.omega;
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
