// One colour: every copy has one constraint, so that a sweep reads vertices and writes copies; nothing
// needs to be split before.

fn read_places(block: u32, lane: u32) -> array<u32, 4> {
    return vertices_of(block, lane);
}

fn write_places(block: u32, lane: u32) -> array<u32, 4> {
    return indices_of(block, lane);
}

fn read_place(vertex: u32, copy: u32) -> u32 {
    return vertex;
}

fn write_place(vertex: u32, copy: u32) -> u32 {
    return copy;
}

fn read_point(place: u32) -> vec4f {
    return points[place];
}

fn write_point(place: u32, point: vec4f) {
    copies[place] = point;
}
