// Enters G = g(q) and R = G - q into Anderson's history (acceleration.wgsl). What G is says one of the
// files mapped_*.wgsl.
//
// `job.first`: where multipliers begin in a vector, `job.count` its length, `job.set_first` the window.
@compute @workgroup_size(128)
fn anderson_push(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let span = span_of(workgroup, groups);
    if span.groups == 0u {
        return;
    }
    let length = job.count;
    let window = job.set_first;
    let next = control.parts[span.part].next;
    let has_difference = control.parts[span.part].sweeps > 0u;
    let differences = select(0u, min(control.parts[span.part].differences + 1u, window), has_difference);
    var sums: array<f32, 21>;
    var run = Run();
    for (var j = span.group * THREADS + local; j < span.length; j += span.groups * THREADS) {
        let i = number_at(&run, span.part, j);
        if !counts(i) {
            continue;
        }
        let g = mapped_value(i);
        let r = g - iterate[i];
        let weight = weight_of(i);
        sums[0] += weight * r * r;
        if has_difference {
            let difference = r - residuals[window * length + i];
            residuals[next * length + i] = difference;
            mapped[next * length + i] = g - mapped[window * length + i];
            // To a constant, so that compilers unroll it: `sums` stays in registers.
            for (var d = 0u; d < LARGEST_WINDOW; d++) {
                if d < differences {
                    var other = difference;
                    if d != next {
                        other = residuals[d * length + i];
                    }
                    sums[1u + d] += weight * r * other;
                    sums[11u + d] += weight * difference * other;
                }
            }
        }
        residuals[window * length + i] = r;
        mapped[window * length + i] = g;
    }
    for (var k = 0u; k < PRODUCTS; k++) {
        shared_sums[k * SUM_STRIDE + local] = sums[k];
    }
    workgroupBarrier();
    if local < PRODUCTS {
        var sum = 0.0;
        for (var t = 0u; t < THREADS; t++) {
            sum += shared_sums[local * SUM_STRIDE + t];
        }
        partial_sums[PRODUCTS * (first_group(span.part) + span.group) + local] = sum;
    }
}
