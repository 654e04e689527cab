// The constraints of one tetrahedron in a sweep (solver/xpbd/sweep.rs). What is read and written, vertices, copies or
// the vertices of a cluster, says one of the files sweep_*.wgsl.
//
//   [J M^-1 J^T + a~] dl = -C - a~ l,   dx = M^-1 J^T dl
//
// dl and dx over-relaxed, added to l and x.
fn solve_tet(block: u32, lane: u32) {
    let kind = tets[block].material[lane];
    if kind == FILLING {
        return;
    }
    let material = materials[kind];
    let rest_volume = tets[block].rest_volume[lane];
    let shape = shape_of(block, lane);
    let places = read_places(block, lane);
    var x: array<vec3f, 4>;
    var w: array<f32, 4>;
    for (var i = 0u; i < 4u; i++) {
        let point = read_point(places[i]);
        x[i] = point.xyz;
        w[i] = point.w;
    }
    var l: Multipliers;
    for (var p = 0u; p < MULTIPLIER_COUNT; p++) {
        l[p] = multipliers[place_of(job.multiplier_offset, MULTIPLIER_COUNT, block, p, lane)];
    }
    let change = form_solve(x, w, shape, l, material, rest_volume * frame.squared_dt);
    for (var p = 0u; p < MULTIPLIER_COUNT; p++) {
        multipliers[place_of(job.multiplier_offset, MULTIPLIER_COUNT, block, p, lane)] =
            l[p] + frame.relaxation_multipliers * change.multipliers[p];
    }
    for (var i = 0u; i < 4u; i++) {
        x[i] += change.positions[i] * frame.relaxation_positions;
    }
    if job.is_viscous != 0u && material.viscosity > 0.0 {
        // Kelvin-Voigt as an energy: a~ = D^-1/(V eta dt).
        let scale = 1.0 / (rest_volume * material.viscosity * frame.dt);
        var l: array<f32, 6>;
        for (var p = 0u; p < 6u; p++) {
            l[p] = multipliers[place_of(job.viscous_offset, 6u, block, p, lane)];
        }
        let compliance = compliance_scaled(material.compliance, scale);
        let start = start_strain_of(block, lane);
        let change = green_strain_solve(x, w, shape, l, start, compliance);
        for (var p = 0u; p < 6u; p++) {
            multipliers[place_of(job.viscous_offset, 6u, block, p, lane)] =
                l[p] + frame.relaxation_multipliers * change.multipliers[p];
        }
        for (var i = 0u; i < 4u; i++) {
            x[i] += change.positions[i] * frame.relaxation_positions;
        }
    }
    let written = write_places(block, lane);
    for (var i = 0u; i < 4u; i++) {
        write_point(written[i], vec4f(x[i], w[i]));
    }
}
