// Values of tissue that pictures show (measure/tissue.rs, contact/pressure.rs):
//
//   strain     s_1 - 1 = 2 e/(1 + sqrt(1 + 2 e)),   e the largest eigenvalue of the Green strain
//   stress     sqrt(3/2 dev(sigma) : dev(sigma)),   sigma = P F^T/J
//   at a vertex the mean of the tetrahedra around it by their volumes; none beside an inverted one
//
// Eigenvalue: Smith, "Eigenvalues of a symmetric 3 x 3 matrix", CACM 1961.

// Larger than every value: there is none.
const NO_VALUE: f32 = 3e38;

// Of a Jacobian, which stress is divided by, at least.
const SMALLEST_RATIO: f32 = 1e-6;

fn largest_eigenvalue(e: mat3x3f) -> f32 {
    let mean = (e[0].x + e[1].y + e[2].z) / 3.0;
    let b = e - mat3x3f(mean, 0.0, 0.0, 0.0, mean, 0.0, 0.0, 0.0, mean);
    let spread = sqrt((dot(b[0], b[0]) + dot(b[1], b[1]) + dot(b[2], b[2])) / 6.0);
    if !(spread > 0.0) {
        return mean;
    }
    // Scaled before it is multiplied: cubes of small strains are below the smallest number.
    let c = b * (1.0 / spread);
    let angle = acos(clamp(0.5 * determinant(c), -1.0, 1.0)) / 3.0;
    return mean + 2.0 * spread * cos(angle);
}

fn strain_of(f: mat3x3f) -> f32 {
    var c = green_strain_strain(f);
    for (var p = 3u; p < 6u; p++) {
        c[p] *= 0.5;
    }
    let e = largest_eigenvalue(green_strain_symmetric(c));
    return 2.0 * e / (1.0 + sqrt(max(1.0 + 2.0 * e, 0.0)));
}

fn stress_of(f: mat3x3f, piola: mat3x3f, ratio: f32) -> f32 {
    let sigma = piola * transpose(f) * (1.0 / max(ratio, SMALLEST_RATIO));
    let mean = (sigma[0].x + sigma[1].y + sigma[2].z) / 3.0;
    let d = sigma - mat3x3f(mean, 0.0, 0.0, 0.0, mean, 0.0, 0.0, 0.0, mean);
    return sqrt(1.5 * (dot(d[0], d[0]) + dot(d[1], d[1]) + dot(d[2], d[2])));
}

// `job.mode`: 1 for stress.
@compute @workgroup_size(64)
fn measure_tets(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let block = thread / LANES;
    let lane = thread % LANES;
    let kind = tets[block].material[lane];
    if kind == FILLING {
        return;
    }
    let vertices = vertices_of(block, lane);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = frame_points[vertices[i]].xyz;
    }
    let f = deformation_gradient(x, shape_of(block, lane));
    let ratio = determinant(f);
    var value = NO_VALUE;
    if ratio > 0.0 {
        if job.mode == 1u {
            let material = tissue_of(kind);
            let piola = law_piola(law_of(block), f, material.lame_lambda, material.lame_mu);
            value = stress_of(f, piola, ratio);
        } else {
            value = strain_of(f);
        }
    }
    measured[thread] = value;
}

@compute @workgroup_size(64)
fn average_tets(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count {
        return;
    }
    var sum = 0.0;
    var volume = 0.0;
    var is_known = true;
    for (var i = around[v]; i < around[v + 1u]; i++) {
        let tet = around[i];
        let own = tets[tet / LANES].rest_volume[tet % LANES];
        let value = measured[tet];
        if value >= NO_VALUE {
            is_known = false;
        } else {
            sum += value * own;
        }
        volume += own;
    }
    let mean = sum / select(1.0, volume, volume > 0.0);
    frame_points[v].w = select(NO_VALUE, mean, is_known);
}
