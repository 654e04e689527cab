// What meetings are to a vertex as a step begins.

struct Blocks {
    own: array<f32, 6>,
    whole: array<f32, 6>,
    may_touch: bool,
}

fn add_meeting_block(at: u32, share: f32, weight: f32, blocks: ptr<function, Blocks>) {
    let a = loads[at + 5u];
    let b = loads[at + 6u];
    let block = array<f32, 6>(a.x, a.y, a.z, a.w, b.x, b.y);
    for (var k = 0u; k < 6u; k++) {
        (*blocks).own[k] += share * weight * weight * block[k];
        (*blocks).whole[k] += share * weight * block[k];
    }
    (*blocks).may_touch = true;
}

// Adds what meetings give to a vertex, `C` of one twice its curvature (pairs/mod.rs, `each_block`):
//   sum b^2 C of its samples and sum beta w^2 C of the points of triangles that are met;   the same with b and beta w
// where a corner of a triangle that hangs on one vertex alone counts beta^2 C.
fn add_meetings(v: u32, blocks: ptr<function, Blocks>) {
    if !has_skin() {
        return;
    }
    let own = skin(SKIN_OWN_OFFSETS) + v;
    for (var i = table[own]; i < table[own + 1u]; i++) {
        let entry = skin(SKIN_OWN_ENTRIES) + 2u * i;
        let at = meeting_at(table[entry]);
        if loads[at].w != 0.0 {
            add_meeting_block(at, 1.0, abs(number(entry + 1u)), blocks);
        }
    }
    let reactions = skin(SKIN_REACTION_OFFSETS) + v;
    for (var i = table[reactions]; i < table[reactions + 1u]; i++) {
        let entry = skin(SKIN_REACTION_ENTRIES) + 2u * i;
        let corner = table[entry] % 4u;
        let weight = abs(number(entry + 1u));
        let range = loads[range_at(table[entry] / 4u)];
        for (var k = u32(range.x); k < u32(range.y); k++) {
            let at = meeting_at(u32(loads[skin(SKIN_SORTED) + k].y));
            let beta = loads[at + 1u][corner];
            if weight == 1.0 {
                add_meeting_block(at, 1.0, beta, blocks);
            } else {
                add_meeting_block(at, beta, weight, blocks);
            }
        }
    }
}
