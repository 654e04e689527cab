// The potential of all pieces at once; `job.mode` says what is asked of them: the energies of the reference and
// the other starts; motion for the energy limit; nothing where the iterate has passed already. Or, where a
// step was rejected, where it ends then: places are written, and what is there is summed.

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
    let is_spared = ((job.mode & UNLESS_GOOD) != 0u && control.parts[part].guard.is_good != 0u)
        || ((job.mode & IF_REJECTED) != 0u && control.parts[part].guard.was_rejected == 0u);
    if agree(is_spared, local) {
        return;
    }
    let are_vertices = table[row + PIECE_ARE_VERTICES] != 0u;
    var sum_groups = 1u;
    if (job.mode & WITH_MOTION) != 0u {
        sum_groups = select(select(1u, 2u, has_samples()), SUMS / 8u, are_vertices);
    }
    // Whatever is long is called at one place.
    for (var is_found = (job.mode & IF_REJECTED) == 0u; ; is_found = true) {
        var sums: Sums;
        if is_found {
            add_piece(row, job.mode, local, &sums);
        } else {
            add_lengths(part, local, &sums);
        }
        let maxima = select(0u, 1u << SUM_REACH, is_found);
        reduce(sums, select(LINE_SUMS / 8u, sum_groups, is_found), maxima, local);
        if is_found {
            break;
        }
        if local == 0u {
            let descends = control.parts[part].guard.descends != 0u;
            found_line = select(control.parts[part].guard.share, pick_length().length, descends);
        }
        line = workgroupUniformLoad(&found_line);
        tested_at = LINE;
        if are_vertices {
            for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
                points[v] = vec4f(place(LINE, v), points[v].w);
            }
        }
    }
    if local < 8u * sum_groups {
        partial_sums[SUMS * piece + local] = totals[local];
    }
}
