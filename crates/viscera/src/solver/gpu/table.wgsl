// Constants of the model but the tetrahedra, as words, and where everything stands in them: names with `_AT`
// are places in the header, `PART_` and `PIECE_` in a row; all come from the host (layout.rs, parts.rs).

fn number(word: u32) -> f32 {
    return bitcast<f32>(table[word]);
}

// By its bits: compilers may take it for granted that numbers are finite.
fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

// Of a connected part.
fn part_row(part: u32) -> u32 {
    return table[PARTS_AT] + PART_WORDS * part;
}

// The first part whose word at `field`, which ascends from part to part, is above a value.
fn part_with(field: u32, value: u32) -> u32 {
    var low = 0u;
    var high = table[PART_COUNT_AT] - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if value < table[part_row(middle) + field] {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// Of a piece of elements or vertices.
fn piece_row(piece: u32) -> u32 {
    return table[PIECES_AT] + PIECE_WORDS * piece;
}

// The law of a block of tetrahedra, by its number among the laws, whose blocks stand one after the other.
fn law_of(block: u32) -> u32 {
    var law = 0u;
    while law + 1u < LAW_COUNT && block >= table[LAW_ENDS_AT + law] {
        law++;
    }
    return law;
}

fn tissue_of(kind: u32) -> TissueConstants {
    let row = table[MATERIALS_AT] + MATERIAL_WORDS * kind;
    return TissueConstants(
        number(row + MATERIAL_LAMBDA),
        number(row + MATERIAL_MU),
        number(row + MATERIAL_VISCOSITY),
    );
}

// What a range of the vertex data holds of a vertex.
fn vertex_data_of(range: u32, v: u32) -> vec4f {
    return vertex_data[range * table[STRIDE_AT] + v];
}

// Where the step begins, with its pins moved.
fn start_of(v: u32) -> vec3f {
    let is_pinned = vertex_data_of(EXTERNAL_FORCES, v).w == 0.0;
    return select(vertex_data_of(PREVIOUS, v).xyz, vertex_data_of(TARGETS, v).xyz, is_pinned);
}

// Sum of what acts on a vertex, in the order of its places.
fn gather(v: u32) -> vec4f {
    let row = table[OFFSETS_AT] + v;
    var sum = vec4f();
    let end = table[row + 1u];
    for (var slot = table[row]; slot < end; slot++) {
        sum += loads[slot];
    }
    return sum;
}
