// The potential of all pieces at once; `job.mode` says what is asked of them: the energies of the reference and
// the other starts; motion for the energy limit; nothing where the iterate has passed already. Or, where a
// step was taken back, where it ends then: places are written, and what is there is summed.

var<workgroup> found_line: f32;

@compute @workgroup_size(256)
fn evaluate(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let piece = workgroup.x + workgroup.y * groups.x;
    if piece >= job.count {
        return;
    }
    let row = piece_row(piece);
    let part = table[row + PIECE_PART];
    let is_spared = (job.mode & UNLESS_GOOD) != 0u && control.parts[part].is_good != 0u
        || (job.mode & IF_REJECTED) != 0u && control.parts[part].was_rejected == 0u;
    if agree(is_spared, local) {
        return;
    }
    if (job.mode & IF_REJECTED) != 0u {
        var lengths: Sums;
        add_lengths(part, local, &lengths);
        reduce(lengths, LINE_SUMS / 8u, 0u, local);
        if local == 0u {
            let descends = control.parts[part].descends != 0u;
            found_line = select(control.parts[part].share, pick_length().length, descends);
        }
        line = workgroupUniformLoad(&found_line);
        tested_at = LINE;
        if table[row + PIECE_ARE_VERTICES] != 0u {
            for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
                points[v] = vec4f(place(LINE, v), points[v].w);
            }
        }
    }
    sum_piece(piece, job.mode, local);
}
