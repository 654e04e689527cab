// The start of a new history: multipliers from positions alone (solver/xpbd/history.rs).
//
//   l_j = -C_j(x)/a~_j
//
// `unknowns` holds positions and, from `job.first` on, multipliers: bound one by one they would be
// more buffers than every device binds.

// By its bits: a compiler may take it that there are only finite numbers.
fn is_finite_number(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

// What one part has broken is no other's.
@compute @workgroup_size(256)
fn find_broken(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let span = span_of(workgroup, groups);
    if span.groups == 0u {
        return;
    }
    for (var j = span.group * 256u + local; j < span.length; j += span.groups * 256u) {
        let i = number_at(span.part, j);
        if i != NOWHERE && i >= job.first && !is_finite_number(unknowns[i]) {
            atomicOr(&control.parts[span.part].is_broken, 1u);
        }
    }
}

// Whether a part's multipliers are to be taken anew.
fn is_repaired(part: u32) -> bool {
    return job.mode != 0u || atomicLoad(&control.parts[part].is_broken) != 0u;
}

// Of a tetrahedron too large for the number format nothing can be told.
fn store_multiplier(place: u32, l: f32) {
    unknowns[job.first + place] = select(0.0, l, is_finite_number(l));
}

// Takes all multipliers of a part from the positions, where one was found broken (mode 0) or whatever they
// are (mode 1). Tetrahedra come first, then springs, then attachments.
@compute @workgroup_size(64)
fn repair_multipliers(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let before_attachments = job.tet_count + job.spring_count;
    let stride = 64u * groups.x * groups.y;
    for (var i = thread_of(id, groups, 64u); i < job.count; i += stride) {
        if i < job.tet_count {
            if is_repaired(table[table[BLOCK_PARTS_AT] + i / LANES]) {
                repair_tet(i / LANES, i % LANES);
            }
        } else if i < before_attachments {
            if is_repaired(springs[i - job.tet_count].part) {
                repair_spring(springs[i - job.tet_count]);
            }
        } else if is_repaired(attachments[i - before_attachments].part) {
            repair_attachment(i - before_attachments);
        }
    }
}

fn place_in_set(offset: u32, count: u32, block: u32, p: u32, lane: u32) -> u32 {
    return offset + LANES * (count * block + p) + lane;
}

fn position(v: u32) -> vec3f {
    return vec3f(unknowns[4u * v], unknowns[4u * v + 1u], unknowns[4u * v + 2u]);
}

// The set of Saint Venant-Kirchhoff tetrahedra comes first, its multipliers as well; `job.set_first` is
// the first block of the neo-Hookean ones, and the offsets are those of their multipliers.
fn repair_tet(block: u32, lane: u32) {
    let is_neo = block >= job.set_first;
    let in_set = select(block, block - job.set_first, is_neo);
    let is_viscous = (job.is_viscous & select(1u, 2u, is_neo)) != 0u;
    let kind = tets[block].material[lane];
    let counts = kind != FILLING;
    let material = law_of(select(0u, kind, counts));
    let volume = select(0.0, tets[block].rest_volume[lane], counts);
    let vertices = vertices_of(block, lane);
    let x = array<vec3f, 4>(
        position(vertices[0]),
        position(vertices[1]),
        position(vertices[2]),
        position(vertices[3]),
    );
    let shape = shape_of(block, lane);
    let f = deformation_gradient(x, shape);
    let lambda = material.lame_lambda;
    let mu = material.lame_mu;
    let step_volume = volume * frame.squared_dt;
    if is_neo {
        let l = form_constitutive(x, shape, material, step_volume);
        for (var p = 0u; p < MULTIPLIER_COUNT; p++) {
            let place = place_in_set(job.multiplier_offset, MULTIPLIER_COUNT, in_set, p, lane);
            store_multiplier(place, select(0.0, l[p], counts));
        }
    } else {
        let strain = green_strain_strain(f);
        let l = green_strain_constitutive_multipliers(strain, lambda, mu, step_volume);
        for (var p = 0u; p < 6u; p++) {
            store_multiplier(place_in_set(0u, 6u, in_set, p, lane), select(0.0, l[p], counts));
        }
    }
    if is_viscous {
        // Kelvin-Voigt: V eta dt takes the place of V dt^2.
        let change = tissue_change_since(f, start_strain_of(block, lane));
        let scale = volume * material.viscosity * frame.dt;
        let l = green_strain_constitutive_multipliers(change, lambda, mu, scale);
        let offset = select(6u * LANES * job.set_first, job.viscous_offset, is_neo);
        for (var p = 0u; p < 6u; p++) {
            store_multiplier(place_in_set(offset, 6u, in_set, p, lane), select(0.0, l[p], counts));
        }
    }
}

fn repair_spring(spring: Spring) {
    let x = array<vec3f, 2>(position(spring.vertices[0]), position(spring.vertices[1]));
    let compliance_tilde = 1.0 / (spring.stiffness * frame.squared_dt);
    let l = spring_constitutive_multiplier(x, spring.rest_length, compliance_tilde);
    store_multiplier(spring.multiplier, l);
}

fn repair_attachment(i: u32) {
    let attachment = attachments[i];
    let compliance_tilde = 1.0 / (attachment.stiffness * frame.squared_dt);
    let x = position(attachment.vertex);
    let l = attachment_constitutive_multipliers(x, anchors[i].xyz, compliance_tilde);
    store_multiplier(attachment.multiplier, l.x);
    store_multiplier(attachment.multiplier + 1u, l.y);
    store_multiplier(attachment.multiplier + 2u, l.z);
}
