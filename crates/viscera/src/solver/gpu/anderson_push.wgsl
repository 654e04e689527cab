// Enters G = g(q) and R = G - q into Anderson's history (acceleration.wgsl). What G is says one of the
// files mapped_*.wgsl.
//
// `job.first`: where multipliers begin in a vector,
// `job.count` its length, `job.set_first` the window, `job.mode` the number of workgroups.
@compute @workgroup_size(128)
fn anderson_push(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
) {
    let length = job.count;
    let window = job.set_first;
    let next = control.next;
    let has_difference = control.sweeps > 0u;
    let differences = select(0u, min(control.differences + 1u, window), has_difference);
    var sums: array<f32, 21>;
    for (var i = workgroup.x * THREADS + local; i < length; i += job.mode * THREADS) {
        if !counts(i) {
            continue;
        }
        let g = mapped_value(i);
        let r = g - iterate[i];
        let weight = weights[i];
        sums[0] += weight * r * r;
        if has_difference {
            let difference = r - residuals[window * length + i];
            residuals[next * length + i] = difference;
            mapped[next * length + i] = g - mapped[window * length + i];
            for (var j = 0u; j < differences; j++) {
                var other = difference;
                if j != next {
                    other = residuals[j * length + i];
                }
                sums[1u + j] += weight * r * other;
                sums[11u + j] += weight * difference * other;
            }
        }
        residuals[window * length + i] = r;
        mapped[window * length + i] = g;
    }
    for (var k = 0u; k < PRODUCTS; k++) {
        shared_sums[k * THREADS + local] = sums[k];
    }
    workgroupBarrier();
    if local < PRODUCTS {
        var sum = 0.0;
        for (var t = 0u; t < THREADS; t++) {
            sum += shared_sums[local * THREADS + t];
        }
        partial_sums[PRODUCTS * workgroup.x + local] = sum;
    }
}
