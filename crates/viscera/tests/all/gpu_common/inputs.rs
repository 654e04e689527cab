//! Records of tetrahedra and springs: realistic ones, and the nasty ones.

use viscera::elements::{
    deformation_gradient, edge_matrix, green_strain, neo_hookean_pair, neo_hookean_stretch,
    shape_gradients,
};
use viscera::material::Compliance;
use viscera::mesh::tet_volume;
use viscera::scalar::{Mat3, Vec3, vec3};

use crate::common::{Random, STVK, material};

/// A substep [s].
const DT: f64 = 1.0 / 600.0;

/// Records of numbers, one after the other.
pub struct Records {
    pub numbers: Vec<f32>,
    /// Numbers of a record.
    pub size: usize,
    /// How many of them, the first, are coordinates [m].
    pub coordinates: usize,
}

impl Records {
    fn of_tets(numbers: Vec<f32>) -> Self {
        Self { numbers, size: 59, coordinates: 12 }
    }

    fn of_springs(numbers: Vec<f32>) -> Self {
        Self { numbers, size: 15, coordinates: 6 }
    }

    fn of_recovered(numbers: Vec<f32>) -> Self {
        Self { numbers, size: 76, coordinates: 0 }
    }

    /// One after the other.
    pub fn each(&self) -> std::slice::Chunks<'_, f32> {
        self.numbers.chunks(self.size)
    }
}

/// Corners [m] of a tetrahedron at rest whose edges are about a centimetre; its smallest height is
/// at least a tenth of that.
fn rest_shape(random: &mut Random) -> [Vec3<f64>; 4] {
    loop {
        let mut x: [Vec3<f64>; 4] = std::array::from_fn(|_| random.vector(0.008));
        if tet_volume(x) < 0.0 {
            x.swap(2, 3);
        }
        let gradients = edge_matrix(&x).inverse().norm_squared().sqrt();
        if gradients < 1e3 {
            return x;
        }
    }
}

/// Corners on the axes at a distance that is a power of two: `F` is then exact in single precision.
fn exact_shape() -> [Vec3<f64>; 4] {
    let edge = 1.0 / 128.0;
    [Vec3::ZERO, vec3(edge, 0.0, 0.0), vec3(0.0, edge, 0.0), vec3(0.0, 0.0, edge)]
}

/// What a record of a tetrahedron is made of.
struct Tet {
    rest: [Vec3<f64>; 4],
    x: [Vec3<f64>; 4],
    /// Of each corner, nothing or one over its mass.
    free: [bool; 4],
    /// The multipliers are random multiples, up to this, of those of the deformed state.
    most_multipliers: f64,
}

impl Tet {
    /// Deformed by `f`, somewhere within `reach` [m].
    fn new(random: &mut Random, rest: [Vec3<f64>; 4], f: Mat3<f64>, reach: f64) -> Self {
        let place = random.vector(reach);
        let free = std::array::from_fn(|_| random.uniform(0.0, 1.0) < 0.8);
        Self { rest, x: rest.map(|x| place + f * x), free, most_multipliers: 1.5 }
    }

    fn record(&self, random: &mut Random) -> Vec<f32> {
        let young = 10f64.powf(random.uniform(3.0, 5.0));
        let tissue = material(STVK, young, random.uniform(0.2, 0.49));
        let (lambda, mu) = (tissue.lame_lambda(), tissue.lame_mu());
        let shape = edge_matrix(&self.rest).inverse();
        let volume = tet_volume(self.rest);
        let step_volume = volume * DT * DT;
        let w = self.free.map(|free| if free { 4.0 / (tissue.density() * volume) } else { 0.0 });
        let f = deformation_gradient(&self.x, &shape);
        let c = green_strain::strain(&f);
        let strain = green_strain::constitutive_multipliers(&c, lambda, mu, step_volume);
        let pair = neo_hookean_pair::constitutive_multipliers(&f, lambda, mu, step_volume);
        let stretch = neo_hookean_stretch::constitutive_multipliers(&f, lambda, mu, step_volume);
        let mut most = |value: f64, most| value * random.uniform(0.0, most);
        let strain = strain.map(|l| most(l, self.most_multipliers));
        let pair = pair.map(|l| most(l, self.most_multipliers));
        let stretch = stretch.map(|l| most(l, self.most_multipliers));
        let (start, target) = (c.map(|c| most(c, 1.2)), c.map(|c| most(c, 0.5)));
        let Compliance { normal, cross, shear } = tissue.compliance().scaled(1.0 / step_volume);
        let viscosity_rate = random.uniform(0.0, 0.1) / DT;
        let last = [lambda, mu, normal, cross, shear, volume, step_volume, viscosity_rate];
        let parts: [&[f64]; 9] = [
            &self.x.map(Vec3::to_array).concat(),
            &w,
            &shape.columns.map(Vec3::to_array).concat(),
            &strain,
            &pair,
            &stretch,
            &start,
            &target,
            &last,
        ];
        parts.concat().into_iter().map(|value| value as f32).collect()
    }
}

/// Deformations of every size from 1e-4 to 1/2, some corners fixed, anywhere in an organ. Small
/// strains keep their digits where there is no rotation to lose them in.
pub fn tets(count: usize, rotated: bool) -> Records {
    let mut random = Random(1);
    let record = |_| {
        let size = 10f64.powf(random.uniform(-4.0, -0.3));
        let change = Mat3 { columns: std::array::from_fn(|_| random.vector(size)) };
        let rotation = if rotated { random.rotation() } else { Mat3::IDENTITY };
        let f = rotation * (Mat3::IDENTITY + change);
        let rest = rest_shape(&mut random);
        Tet::new(&mut random, rest, f, 0.1).record(&mut random)
    };
    Records::of_tets((0..count).flat_map(record).collect())
}

fn diagonal(a: f64, b: f64, c: f64) -> Mat3<f64> {
    Mat3::from_columns(vec3(a, 0.0, 0.0), vec3(0.0, b, 0.0), vec3(0.0, 0.0, c))
}

/// Stretches that are flat, inverted, collapsed, huge, equal, or on a threshold of the functions.
const NASTY_STRETCHES: [[f64; 3]; 34] = [
    // At rest, and turned half round.
    [1.0, 1.0, 1.0],
    [-1.0, -1.0, 1.0],
    // Flat, and nearly.
    [1.0, 1.0, 0.0],
    [1.2, 0.7, 1e-3],
    [1.2, 0.7, 1e-6],
    [1.0, 1.0, 1e-7],
    // Inverted.
    [1.0, 1.0, -1.0],
    [-1.0, -1.0, -1.0],
    [1.3, 0.8, -0.7],
    [1.1, 0.9, -1e-4],
    [0.9, 0.5, -0.5],
    [0.2, 0.1, -0.1],
    // Lines.
    [1.0, 0.0, 0.0],
    [2.0, 1e-5, 1e-7],
    [1.0, 1e-7, -1e-7],
    // Points.
    [0.0, 0.0, 0.0],
    [1e-4, 1e-4, 1e-4],
    [1e-7, 1e-7, 1e-7],
    [1e-9, -1e-9, 1e-10],
    [1e-11, 1e-11, 1e-12],
    [1e-16, -1e-17, 1e-18],
    // Huge.
    [10.0, 10.0, 10.0],
    [100.0, 0.1, 0.1],
    [30.0, 20.0, -10.0],
    // Equal or nearly equal stretches.
    [1.1, 1.1, 0.9],
    [1.1, 0.9, 0.9],
    [1.0, 1.0 + 1e-7, 1.0 - 1e-7],
    [0.5, 0.5, 0.5],
    // The least norm and the least singular value with a direction.
    [1e-6, 0.0, 0.0],
    [1.0, 1e-6, 0.0],
    [4.0, 4e-6, 1e-6],
    // The smallest sum of two stretches in a mass bound.
    [1.0, 0.2, 0.1],
    [1.0, 0.15, 0.15],
    [0.5, 0.4, -0.1],
];

/// Every nasty stretch, in exact numbers, rotated, and far from the origin, with and without
/// multipliers and free corners.
pub fn nasty_tets() -> Records {
    let mut random = Random(2);
    let mut records = Vec::new();
    for [a, b, c] in NASTY_STRETCHES {
        for round in 0..16 {
            let f = diagonal(a, b, c);
            let mut tet = if round < 4 {
                Tet::new(&mut random, exact_shape(), f, 0.0)
            } else {
                let (rest, before) = (rest_shape(&mut random), random.rotation());
                let f = random.rotation() * f * before;
                Tet::new(&mut random, rest, f, if round < 10 { 0.0 } else { 1.0 })
            };
            if round % 4 == 1 {
                tet.most_multipliers = 0.0;
            }
            if round % 4 == 2 {
                tet.free = [false; 4];
            }
            records.extend(tet.record(&mut random));
        }
    }
    Records::of_tets(records)
}

/// A record of a spring with these ends; the stiffness is random.
fn spring(random: &mut Random, x: [Vec3<f64>; 2], w: [f64; 2], rest_length: f64) -> Vec<f32> {
    let stiffness = 10f64.powf(random.uniform(0.0, 4.0));
    let squared = stiffness * DT * DT;
    let held = (x[1] - x[0]) * (squared * random.uniform(0.0, 1.5));
    let stretch = (x[1] - x[0]).length() - rest_length;
    let multiplier = -squared * stretch * random.uniform(0.0, 1.5);
    let parts: [&[f64]; 4] = [
        &x.map(Vec3::to_array).concat(),
        &w,
        &held.to_array(),
        &[rest_length, multiplier, stiffness, 1.0 / squared],
    ];
    parts.concat().into_iter().map(|value| value as f32).collect()
}

/// Springs of millimetres to decimetres, stretched by up to a half, some ends fixed.
pub fn springs(count: usize) -> Records {
    let mut random = Random(3);
    let record = |_| {
        let start = random.vector(0.1);
        let edge = random.rotation().columns[0] * 10f64.powf(random.uniform(-3.0, -1.0));
        let rest_length = edge.length() * random.uniform(0.6, 1.5);
        let mut weight = || match random.uniform(0.0, 1.0) {
            share if share < 0.2 => 0.0,
            _ => 10f64.powf(random.uniform(2.0, 5.0)),
        };
        let w = [weight(), weight()];
        spring(&mut random, [start, start + edge], w, rest_length)
    };
    Records::of_springs((0..count).flat_map(record).collect())
}

/// Coincident ends, and distances around the shortest with a direction; no mass free, no length at
/// rest.
pub fn nasty_springs() -> Records {
    let mut random = Random(4);
    let mut records = Vec::new();
    for length in [0.0, 1e-20, 1e-13, 1e-12, 1.1e-12, 1e-11, 1e-9, 1e-6, 1.0, 100.0] {
        for w in [[0.0, 0.0], [1e3, 0.0], [1e2, 1e5]] {
            for rest_length in [0.0, 1e-12, 0.01] {
                let along_axis = vec3(length, 0.0, 0.0);
                let slanted = random.rotation() * along_axis;
                let away = random.vector(0.1);
                for ends in
                    [[Vec3::ZERO, along_axis], [Vec3::ZERO, slanted], [away, away + slanted]]
                {
                    records.extend(spring(&mut random, ends, w, rest_length));
                }
            }
        }
    }
    Records::of_springs(records)
}

/// A record of a recovered-gradient tetrahedron: deformed by `f`, its corners' gradients by that and a bend.
fn recovered(random: &mut Random, rest: [Vec3<f64>; 4], f: Mat3<f64>, bend: f64) -> Vec<f32> {
    let tissue = material(STVK, 10f64.powf(random.uniform(3.0, 5.0)), random.uniform(0.2, 0.49));
    let (lambda, mu) = (tissue.lame_lambda(), tissue.lame_mu());
    let centroid = (rest[0] + rest[1] + rest[2] + rest[3]) * 0.25;
    let mut numbers: Vec<f64> = f.columns.map(Vec3::to_array).concat();
    for _ in 0..4 {
        let other = Mat3 { columns: std::array::from_fn(|_| random.vector(bend)) };
        numbers.extend((f + other).columns.map(Vec3::to_array).concat());
    }
    let gradients = shape_gradients(&edge_matrix(&rest).inverse());
    numbers.extend(gradients.map(Vec3::to_array).concat());
    numbers.extend(rest.map(|x| (x - centroid).to_array()).concat());
    // Faces within the body, and at its surface.
    let inner = 0.375 * 0.9;
    numbers.extend([0; 4].map(|_| if random.uniform(0.0, 1.0) < 0.7 { inner } else { 0.0 }));
    numbers.extend([lambda, mu, random.uniform(-0.1, 0.1) * lambda]);
    numbers.into_iter().map(|value| value as f32).collect()
}

/// Deformations of every size from 1e-4 to 1/2, bent by as much.
pub fn recovered_tets(count: usize) -> Records {
    let mut random = Random(6);
    let record = |_| {
        let size = 10f64.powf(random.uniform(-4.0, -0.3));
        let change = Mat3 { columns: std::array::from_fn(|_| random.vector(size)) };
        let f = random.rotation() * (Mat3::IDENTITY + change);
        let rest = rest_shape(&mut random);
        recovered(&mut random, rest, f, size)
    };
    Records::of_recovered((0..count).flat_map(record).collect())
}

/// Every nasty stretch, straight and bent.
pub fn nasty_recovered_tets() -> Records {
    let mut random = Random(7);
    let mut records = Vec::new();
    for [a, b, c] in NASTY_STRETCHES {
        for bend in [0.0, 1e-7, 1e-3, 1.0, 10.0] {
            let (rest, before) = (rest_shape(&mut random), random.rotation());
            let f = random.rotation() * diagonal(a, b, c) * before;
            records.extend(recovered(&mut random, rest, f, bend));
            records.extend(recovered(&mut random, exact_shape(), diagonal(a, b, c), bend));
        }
    }
    Records::of_recovered(records)
}
