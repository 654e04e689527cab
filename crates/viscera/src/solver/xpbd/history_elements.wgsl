// As history_tets.wgsl, of elements that are no tetrahedra.
@compute @workgroup_size(64)
fn repair_elements(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let stride = 64u * groups.x * groups.y;
    for (var i = thread_of(id, groups, 64u); i < job.count; i += stride) {
        let row = element_row(i);
        if is_repaired(table[row + ELEMENT_PART]) {
            repair_element(row);
        }
    }
}

fn repair_element(row: u32) {
    let kind = table[row + ELEMENT_KIND];
    let vertices = four_of(row + ELEMENT_VERTICES);
    let x = array<vec3f, 4>(
        position(vertices[0]),
        position(vertices[1]),
        position(vertices[2]),
        position(vertices[3]),
    );
    // In a new history the element has long been where it is.
    var start = x;
    if job.mode == 0u {
        start = before_steps(vertices);
    }
    let moment = moment_of(row, start, frame.dt);
    let l = element_constitutive(kind, moment, x, frame.squared_dt);
    for (var p = 0u; p < element_multipliers(kind); p++) {
        store_multiplier(table[row + ELEMENT_MULTIPLIER] + p, l[p]);
    }
}
