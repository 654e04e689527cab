// A few colours: a sweep reads and writes copies of vertices, which `points` holds.

fn read_places(block: u32, lane: u32) -> array<u32, 4> {
    return indices_of(block, lane);
}

fn write_places(block: u32, lane: u32) -> array<u32, 4> {
    return indices_of(block, lane);
}

fn read_place(vertex: u32, copy: u32) -> u32 {
    return copy;
}

fn write_place(vertex: u32, copy: u32) -> u32 {
    return copy;
}

fn read_point(place: u32) -> vec4f {
    return points[place];
}

fn write_point(place: u32, point: vec4f) {
    points[place] = point;
}
