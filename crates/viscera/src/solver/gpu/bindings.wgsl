// Everything that kernels share: records, storage, constants of a step.
//
// Storage has one number for each buffer in all kernels (`Slot` in slots.rs); a kernel's layout holds
// those that it names, eight at most. Vertices are in the solver's numbering, tetrahedra in blocks of
// eight of one colour, component by component, as on the CPU (layout/tets.rs): eight neighbouring
// threads load one piece of 32 bytes.

// The constants of eight tetrahedra.
struct TetBlock {
    vertices: array<array<u32, 8>, 4>,
    // Dm^-1 [1/m] by columns.
    inverse_rest_shape: array<array<f32, 8>, 9>,
    // [m^3]
    rest_volume: array<f32, 8>,
    material: array<u32, 8>,
}

// Load and hold of one vertex in this step.
struct Update {
    vertex: u32,
    is_pinned: u32,
    // External force [N].
    force: array<f32, 3>,
    // Where a pinned vertex is at the end of the step, or where springs pull it to [m].
    place: array<f32, 3>,
    // Of soft position constraints [N/m].
    stiffness: f32,
    // Mass, and what springs make of it [kg]; see solver/step/tethers.rs.
    inertia: f32,
}

// One dispatch.
struct Job {
    // The first block, element or vertex.
    first: u32,
    // How many threads have work.
    count: u32,
    // The first block of the set of tetrahedra.
    set_first: u32,
    // Where the set's elastic and viscous multipliers begin.
    multiplier_offset: u32,
    viscous_offset: u32,
    is_viscous: u32,
    // The use of a kernel that has several; see there.
    mode: u32,
    // A number that only the kernel understands.
    parameter: f32,
    // Of a kernel that does all elements: threads of tetrahedra; the others follow.
    tet_count: u32,
}

// Constants of a step.
struct Frame {
    // Acceleration of gravity [m/s^2].
    gravity: vec3f,
    // The step [s], its square, and one over it.
    dt: f32,
    squared_dt: f32,
    inverse_dt: f32,
    // The factor for multipliers of the last step.
    rescale: f32,
    relaxation_multipliers: f32,
    relaxation_positions: f32,
    update_count: u32,
    // Connected parts.
    part_count: u32,
    chebyshev_damping: f32,
}

@group(0) @binding(0) var<storage, read> tets: array<TetBlock>;
@group(0) @binding(1) var<storage, read> materials: array<Material>;
// Per block and corner: copies in a sweep, places of loads elsewhere.
@group(0) @binding(2) var<storage, read> corner_indices: array<array<array<u32, 8>, 4>>;
// Where the copies, or the loads, of each vertex begin; one more at the end.
@group(0) @binding(3) var<storage, read> offsets: array<u32>;
// Positions [m], with the inverse mass of a vertex's copies in a sweep [1/kg].
@group(0) @binding(4) var<storage, read_write> points: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> copies: array<vec4f>;
// [J s^2]
@group(0) @binding(6) var<storage, read_write> multipliers: array<f32>;
// The load of each constraint on each of its corners: impulse [N s^2] and bound [kg].
@group(0) @binding(7) var<storage, read_write> loads: array<vec4f>;
// [m/s]
@group(0) @binding(8) var<storage, read_write> velocities: array<vec4f>;
// Positions at the start of the step [m]; w: how many copies a vertex has.
@group(0) @binding(9) var<storage, read_write> previous: array<vec4f>;
// Inertial prediction xt [m]; w: mass [kg].
@group(0) @binding(10) var<storage, read_write> predicted: array<vec4f>;
// External force [N] without gravity; w: inverse mass [1/kg], zero where pinned.
@group(0) @binding(11) var<storage, read_write> external_forces: array<vec4f>;
// Where pinned vertices are at the end of the step [m], and where tethers of others pull to, with their stiffness in
// w [N/m].
@group(0) @binding(12) var<storage, read_write> targets: array<vec4f>;
@group(0) @binding(13) var<storage, read> updates: array<Update>;
// Green strain at the start of the step, per block and component, where tissue is viscous.
@group(0) @binding(14) var<storage, read_write> start_strain: array<array<f32, 8>>;
// Positions and multipliers as one long vector; four numbers a vertex, of which the last does not count.
@group(0) @binding(15) var<storage, read_write> unknowns: array<f32>;
// The same before the last sweep, and before the one before it.
@group(0) @binding(16) var<storage, read_write> iterate: array<f32>;
@group(0) @binding(17) var<storage, read_write> older: array<f32>;
// Anderson's history: differences of residuals and of mapped iterates, window vectors each, and the
// last residual and mapped iterate behind them.
@group(0) @binding(19) var<storage, read_write> residuals: array<f32>;
@group(0) @binding(20) var<storage, read_write> mapped: array<f32>;
// Sums of pieces.
@group(0) @binding(21) var<storage, read_write> partial_sums: array<f32>;
@group(0) @binding(22) var<storage, read_write> control: Control;
// Where the guard's step can start from [m]: three ranges of the vertex data.
@group(0) @binding(24) var<storage, read_write> starts: array<vec4f>;
// All that belongs to vertices, range by range; see potential.wgsl.
@group(0) @binding(25) var<storage, read_write> vertex_data: array<vec4f>;
// All constants but the tetrahedra, and the weights of the norm, as words; see table.wgsl.
@group(0) @binding(26) var<storage, read> table: array<u32>;
// Of the quasi-Newton method: tables and numbers of its preconditioner (preconditioner/tables.rs), pairs, and where the solve
// of each part stands.
@group(0) @binding(29) var<storage, read> levels: array<u32>;
@group(0) @binding(30) var<storage, read_write> multilevel: array<f32>;
@group(0) @binding(31) var<storage, read_write> pairs: array<vec4f>;
@group(0) @binding(32) var<storage, read_write> progress: array<PartProgress>;
// What passes over recovered-gradient tetrahedra leave to each other (step/recovered/tables.wgsl).
@group(0) @binding(33) var<storage, read_write> recovery: array<vec4f>;
// Of pictures: positions of a frame [m], in w what is shown of vertices; a value of each tetrahedron, by block and lane, or a number
// of each vertex; where the tetrahedra around each vertex begin, one more at the end, and these.
@group(0) @binding(37) var<storage, read_write> frame_points: array<vec4f>;
@group(0) @binding(38) var<storage, read_write> measured: array<f32>;
@group(0) @binding(39) var<storage, read> around: array<u32>;

@group(1) @binding(0) var<uniform> job: Job;
@group(1) @binding(1) var<uniform> frame: Frame;

fn thread_of(id: vec3u, groups: vec3u, size: u32) -> u32 {
    return id.x + id.y * groups.x * size;
}

fn shape_of(block: u32, lane: u32) -> mat3x3f {
    return mat3x3f(
        vec3f(
            tets[block].inverse_rest_shape[0][lane],
            tets[block].inverse_rest_shape[1][lane],
            tets[block].inverse_rest_shape[2][lane],
        ),
        vec3f(
            tets[block].inverse_rest_shape[3][lane],
            tets[block].inverse_rest_shape[4][lane],
            tets[block].inverse_rest_shape[5][lane],
        ),
        vec3f(
            tets[block].inverse_rest_shape[6][lane],
            tets[block].inverse_rest_shape[7][lane],
            tets[block].inverse_rest_shape[8][lane],
        ),
    );
}

fn vertices_of(block: u32, lane: u32) -> array<u32, 4> {
    return array<u32, 4>(
        tets[block].vertices[0][lane],
        tets[block].vertices[1][lane],
        tets[block].vertices[2][lane],
        tets[block].vertices[3][lane],
    );
}

fn indices_of(block: u32, lane: u32) -> array<u32, 4> {
    return array<u32, 4>(
        corner_indices[block][0][lane],
        corner_indices[block][1][lane],
        corner_indices[block][2][lane],
        corner_indices[block][3][lane],
    );
}

// Where multiplier `p` of `count` stands.
fn place_of(offset: u32, count: u32, block: u32, p: u32, lane: u32) -> u32 {
    return offset + LANES * (count * (block - job.set_first) + p) + lane;
}

fn start_strain_of(block: u32, lane: u32) -> array<f32, 6> {
    return array<f32, 6>(
        start_strain[6u * block][lane],
        start_strain[6u * block + 1u][lane],
        start_strain[6u * block + 2u][lane],
        start_strain[6u * block + 3u][lane],
        start_strain[6u * block + 4u][lane],
        start_strain[6u * block + 5u][lane],
    );
}
