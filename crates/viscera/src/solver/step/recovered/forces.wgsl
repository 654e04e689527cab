// Forces of recovered-gradient tetrahedra (mod.rs) in every method, once their gradients and pressures are known.
//
//   gather_stresses   N_n = sum_t S_t : dFh_t/dG_n + V_n alpha P(G_n), and what n's tetrahedra do to its own vertex
//   recovered_force   f_i = of its places - sum_n N_n b_ni
//
// `recovered_acts` and `recovered_dt` are the method's: whether a part takes part, and the time h that forces act for.

// `h^2 V_n alpha P(G_n)`.
fn place_stress(n: u32, h: f32) -> mat3x3f {
    let of_place = place_of_number(n);
    let f = matrix_of(GRADIENTS, n);
    var piola = neo_hookean_piola(f, of_place.local, of_place.lame_mu);
    if of_place.viscosity > 0.0 {
        let since = tissue_change_since(f, green_strain_strain(matrix_of(STARTS, n)));
        let rate = of_place.viscosity / h;
        piola += tissue_viscous_piola(f, since, rate, of_place.local, of_place.lame_mu);
    }
    let scale = of_place.volume * recovered_share(RECOVERED_PLACE_SHARE) * h * h;
    return piola * scale;
}

// What a tetrahedron does to the gradient of a corner's place, and to the corner.
fn add_corner(entry: u32, sums: ptr<function, array<vec3f, 4>>) {
    let corner = entry % 4u;
    let at = entry / 4u / LANES;
    let lane = (entry / 4u) % LANES;
    let block = at + recovered_count(RECOVERED_FIRST_BLOCK);
    let shape = shape_of(block, lane);
    let rest = frame_of(at, lane, shape);
    var pressures: vec4f;
    for (var i = 0u; i < 4u; i++) {
        pressures[i] = recovery[column_at(GRADIENTS, place_of_corner(at, lane, i))].w;
    }
    let pressure = ((pressures.x + pressures.y) + (pressures.z + pressures.w)) * 0.25;
    let tet = tet_of(at, lane);
    let stress = tet.stress + tet.area * pressure;
    let of_place = recovered_vertex_stress(stress, rest, corner);
    var g = rest.gradients;
    var force = -(stress * g[corner]);
    if tet.floor != 0.0 {
        let vertices = vertices_of(block, lane);
        var y: array<vec3f, 4>;
        for (var i = 0u; i < 4u; i++) {
            y[i] = points[vertices[i]].xyz;
        }
        force -= (cofactor(deformation_gradient(y, shape)) * g[corner]) * tet.floor;
    }
    (*sums)[0] += of_place[0];
    (*sums)[1] += of_place[1];
    (*sums)[2] += of_place[2];
    (*sums)[3] += force;
}

@compute @workgroup_size(64)
fn gather_stresses(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    if group >= job.count {
        return;
    }
    let part = table[recovered_table(RECOVERED_GROUP_PARTS) + group];
    if agree(!recovered_acts(part), local) {
        return;
    }
    let n = 8u * group + local / LANES_OF_PLACE;
    var sums = array<vec3f, 4>();
    let offsets = recovered_table(RECOVERED_TET_OFFSETS) + n;
    let end = table[offsets + 1u];
    for (var i = table[offsets] + local % LANES_OF_PLACE; i < end; i += LANES_OF_PLACE) {
        add_corner(table[recovered_table(RECOVERED_CORNERS) + i], &sums);
    }
    sums = share_columns(sums, local);
    if local % LANES_OF_PLACE == 0u {
        let stress = mat3x3f(sums[0], sums[1], sums[2]) + place_stress(n, recovered_dt(part));
        put_matrix(STRESSES, n, stress, sums[3]);
    }
}

// Forces [N] on a vertex times h^2.
fn recovered_force(v: u32) -> vec3f {
    var force = vec3f();
    let offsets = recovered_table(RECOVERED_VERTEX_OFFSETS) + v;
    let end = table[offsets + 1u];
    for (var i = table[offsets]; i < end; i++) {
        let row = recovered_table(RECOVERED_VERTEX_RINGS) + 4u * i;
        let n = table[row] & ~OWN_PLACE;
        let b = vec3f(number(row + 1u), number(row + 2u), number(row + 3u));
        let x = recovery[column_at(STRESSES, n)];
        let y = recovery[column_at(STRESSES + 1u, n)];
        let z = recovery[column_at(STRESSES + 2u, n)];
        force -= mat3x3f(x.xyz, y.xyz, z.xyz) * b;
        if (table[row] & OWN_PLACE) != 0u {
            force += vec3f(x.w, y.w, z.w);
        }
    }
    return force;
}
