//! Every function that a solver calls, in Rust and in WGSL, as a map from a record of numbers to
//! results. The two texts stand side by side and do the same in the same order.

use viscera::elements::law::{Law, SaintVenantKirchhoff, StableNeoHookean};
use viscera::elements::singular_values::signed_svd;
use viscera::elements::{
    CornerLoad, TetCorrection, attachment, deformation_gradient, green_strain, internal_forces,
    neo_hookean, neo_hookean_pair, neo_hookean_stretch, recovered, shape_gradients, spring,
};
use viscera::material::Compliance;
use viscera::scalar::{Mat3, Scalar, Vec3, vec3};
use viscera::solver::Tissue;

/// Results of one unit each, with their name.
pub type Results<T> = Vec<(&'static str, Vec<T>)>;

/// A map in both languages.
pub struct Twin {
    pub name: &'static str,
    /// Statements that take a record and put the results.
    pub wgsl: String,
    /// The oracle.
    pub double: fn(&[f64]) -> Results<f64>,
    /// The same in single precision.
    pub single: fn(&[f32]) -> Results<f32>,
}

macro_rules! twin {
    ($function:ident, $($wgsl:expr),*) => {
        Twin {
            name: stringify!($function),
            wgsl: [$($wgsl),*].concat(),
            double: $function::<f64>,
            single: $function::<f32>,
        }
    };
}

/// Maps of records of tetrahedra.
pub fn of_tets() -> Vec<Twin> {
    vec![
        twin!(strain_block, TET, STRAIN_BLOCK),
        twin!(volume_pair, TET, VOLUME_PAIR),
        twin!(stretch_block, TET, STRETCH_BLOCK),
        twin!(saint_venant_kirchhoff, TET, "let law = 0u;", TISSUE),
        twin!(stable_neo_hookean, TET, "let law = 1u;", TISSUE),
    ]
}

/// Maps of records of springs and attachments.
pub fn of_springs() -> Vec<Twin> {
    vec![twin!(springs, SPRINGS)]
}

/// Maps of records of recovered-gradient tetrahedra.
pub fn of_recovered() -> Vec<Twin> {
    vec![twin!(recovered_tets, RECOVERED_TETS)]
}

/// What is left of a record.
struct Record<'a, T>(&'a [T]);

impl<T: Scalar> Record<'_, T> {
    fn take(&mut self) -> T {
        let (first, rest) = self.0.split_first().expect("another number");
        self.0 = rest;
        *first
    }

    fn array<const N: usize>(&mut self) -> [T; N] {
        std::array::from_fn(|_| self.take())
    }

    fn vector(&mut self) -> Vec3<T> {
        let [x, y, z] = self.array();
        vec3(x, y, z)
    }

    fn matrix(&mut self) -> Mat3<T> {
        Mat3 { columns: std::array::from_fn(|_| self.vector()) }
    }
}

fn numbers<T: Scalar>(vectors: &[Vec3<T>]) -> Vec<T> {
    vectors.iter().flat_map(|v| v.to_array()).collect()
}

fn impulses<T: Scalar>(loads: &[CornerLoad<T>]) -> Vec<T> {
    loads.iter().flat_map(|load| load.impulse.to_array()).collect()
}

fn bounds<T: Scalar>(loads: &[CornerLoad<T>]) -> Vec<T> {
    loads.iter().map(|load| load.mass_bound).collect()
}

/// A tetrahedron's record.
struct Tet<T> {
    x: [Vec3<T>; 4],
    w: [T; 4],
    shape: Mat3<T>,
    /// Multipliers of the three forms.
    strain: [T; 6],
    pair: [T; 2],
    stretch: [T; 6],
    /// Green strain at the start of the step, and the target of the viscous solve.
    start: [T; 6],
    target: [T; 6],
    lambda: T,
    mu: T,
    compliance: Compliance<T>,
    volume: T,
    step_volume: T,
    viscosity_rate: T,
}

const TET: &str = "
    let x = array<vec3f, 4>(take_vec3(), take_vec3(), take_vec3(), take_vec3());
    let w = array<f32, 4>(take(), take(), take(), take());
    let shape = take_mat3();
    let strain = take_6();
    let pair = take_2();
    let stretch = take_6();
    let start = take_6();
    let target_strain = take_6();
    let lambda = take();
    let mu = take();
    let compliance = Compliance(take(), take(), take());
    let volume = take();
    let step_volume = take();
    let viscosity_rate = take();
    let f = deformation_gradient(x, shape);
";

impl<T: Scalar> Tet<T> {
    fn from(numbers: &[T]) -> Self {
        let mut record = Record(numbers);
        Self {
            x: std::array::from_fn(|_| record.vector()),
            w: record.array(),
            shape: Mat3 { columns: std::array::from_fn(|_| record.vector()) },
            strain: record.array(),
            pair: record.array(),
            stretch: record.array(),
            start: record.array(),
            target: record.array(),
            lambda: record.take(),
            mu: record.take(),
            compliance: Compliance {
                normal: record.take(),
                cross: record.take(),
                shear: record.take(),
            },
            volume: record.take(),
            step_volume: record.take(),
            viscosity_rate: record.take(),
        }
    }
}

fn strain_block<T: Scalar>(numbers_in: &[T]) -> Results<T> {
    let t = Tet::from(numbers_in);
    let f = deformation_gradient(&t.x, &t.shape);
    let c = green_strain::strain(&f);
    let solve =
        |target| green_strain::solve(&t.x, &t.w, &t.shape, &t.strain, target, &t.compliance);
    let (elastic, viscous) = (solve(None), solve(Some(&t.target)));
    let loads = green_strain::corner_loads(&t.x, &t.shape, &t.strain);
    let piola = green_strain::piola(&f, &c, t.lambda, t.mu);
    let rest = green_strain::constitutive_multipliers(&c, t.lambda, t.mu, t.step_volume);
    let forces = internal_forces(&piola, &t.shape, t.volume);
    vec![
        ("deformation_gradient", numbers(&f.columns)),
        ("shape_gradients", numbers(&shape_gradients(&t.shape))),
        ("strain", c.to_vec()),
        ("energy_density", vec![green_strain::energy_density(&c, t.lambda, t.mu)]),
        ("piola", numbers(&piola.columns)),
        ("internal_forces", numbers(&forces)),
        ("constitutive_multipliers", rest.to_vec()),
        ("solve, elastic: multipliers", elastic.multipliers.to_vec()),
        ("solve, elastic: positions", numbers(&elastic.positions)),
        ("solve, viscous: multipliers", viscous.multipliers.to_vec()),
        ("solve, viscous: positions", numbers(&viscous.positions)),
        ("corner_loads: impulses", impulses(&loads)),
        ("corner_loads: bounds", bounds(&loads)),
    ]
}

const STRAIN_BLOCK: &str = "
    let c = green_strain_strain(f);
    let none = array<f32, 6>();
    let elastic = green_strain_solve(x, w, shape, strain, none, compliance);
    let viscous = green_strain_solve(x, w, shape, strain, target_strain, compliance);
    let piola = green_strain_piola(f, c, lambda, mu);
    put_mat3(f);
    put_corners(shape_gradients(shape));
    put_6(c);
    put(green_strain_energy_density(c, lambda, mu));
    put_mat3(piola);
    put_corners(internal_forces(piola, shape, volume));
    put_6(green_strain_constitutive_multipliers(c, lambda, mu, step_volume));
    put_6(elastic.multipliers);
    put_corners(elastic.positions);
    put_6(viscous.multipliers);
    put_corners(viscous.positions);
    put_loads(green_strain_corner_loads(x, shape, strain));
";

fn volume_pair<T: Scalar>(numbers_in: &[T]) -> Results<T> {
    let t = Tet::from(numbers_in);
    let f = deformation_gradient(&t.x, &t.shape);
    let [volume, shear] =
        neo_hookean_pair::constitutive_multipliers(&f, t.lambda, t.mu, t.step_volume);
    let TetCorrection { multipliers, positions } =
        neo_hookean_pair::solve(&t.x, &t.w, &t.shape, &t.pair, t.lambda, t.mu, t.step_volume);
    let loads = neo_hookean_pair::corner_loads(&t.x, &t.shape, &t.pair);
    vec![
        ("volume_change", vec![neo_hookean::volume_change(&f)]),
        ("constitutive_multipliers", vec![volume, shear]),
        ("solve: multipliers", multipliers.to_vec()),
        ("solve: positions", numbers(&positions)),
        ("corner_loads: impulses", impulses(&loads)),
        ("corner_loads: bounds", bounds(&loads)),
    ]
}

const VOLUME_PAIR: &str = "
    let solved = neo_hookean_pair_solve(x, w, shape, pair, lambda, mu, step_volume);
    put(neo_hookean_volume_change(f));
    put_2(neo_hookean_pair_constitutive_multipliers(f, lambda, mu, step_volume));
    put_2(solved.multipliers);
    put_corners(solved.positions);
    put_loads(neo_hookean_pair_corner_loads(x, shape, pair));
";

/// The axes of a decomposition are not unique, so the tests look at what is made of them.
fn stretch_block<T: Scalar>(numbers_in: &[T]) -> Results<T> {
    let t = Tet::from(numbers_in);
    let f = deformation_gradient(&t.x, &t.shape);
    let svd = signed_svd(&f);
    let [a, b, c] = svd.u.columns;
    let [s1, s2, s3] = svd.sigma;
    let again = Mat3::from_columns(a * s1, b * s2, c * s3) * svd.v.transpose();
    let rotation = svd.u * svd.v.transpose();
    let rest = neo_hookean_stretch::constitutive_multipliers(&f, t.lambda, t.mu, t.step_volume);
    let TetCorrection { multipliers, positions } =
        neo_hookean_stretch::solve(&t.x, &t.w, &t.shape, &t.stretch, t.lambda, t.mu, t.step_volume);
    let loads = neo_hookean_stretch::corner_loads(&t.x, &t.shape, &t.stretch);
    vec![
        ("signed_svd: sigma", svd.sigma.to_vec()),
        ("signed_svd: U diag(s) V^T", numbers(&again.columns)),
        ("signed_svd: U V^T", numbers(&rotation.columns)),
        ("signed_svd: U^T U", numbers(&(svd.u.transpose() * svd.u).columns)),
        ("signed_svd: V^T V", numbers(&(svd.v.transpose() * svd.v).columns)),
        ("constitutive_multipliers", rest.to_vec()),
        ("solve: multipliers", multipliers.to_vec()),
        ("solve: positions", numbers(&positions)),
        ("corner_loads: impulses", impulses(&loads)),
        ("corner_loads: bounds", bounds(&loads)),
    ]
}

const STRETCH_BLOCK: &str = "
    let svd = signed_svd(f);
    let u = svd.u;
    let v = svd.v;
    let solved = neo_hookean_stretch_solve(x, w, shape, stretch, lambda, mu, step_volume);
    put_vec3(svd.sigma);
    let scaled = mat3x3f(u[0] * svd.sigma.x, u[1] * svd.sigma.y, u[2] * svd.sigma.z);
    put_mat3(scaled * transpose(v));
    put_mat3(u * transpose(v));
    put_mat3(transpose(u) * u);
    put_mat3(transpose(v) * v);
    put_6(neo_hookean_stretch_constitutive_multipliers(f, lambda, mu, step_volume));
    put_6(solved.multipliers);
    put_corners(solved.positions);
    put_loads(neo_hookean_stretch_corner_loads(x, shape, stretch));
";

fn saint_venant_kirchhoff<T: Scalar>(numbers_in: &[T]) -> Results<T> {
    tissue::<T, SaintVenantKirchhoff>(&Tet::from(numbers_in))
}

fn stable_neo_hookean<T: Scalar>(numbers_in: &[T]) -> Results<T> {
    tissue::<T, StableNeoHookean>(&Tet::from(numbers_in))
}

fn tissue<T: Scalar, L: Law>(t: &Tet<T>) -> Results<T> {
    let f = deformation_gradient(&t.x, &t.shape);
    let model = L::MODEL;
    // Small near the shape at rest, and nowhere else, where most terms of a small change cancel.
    let d = (f - Mat3::IDENTITY).transpose() * T::HALF;
    let Tet { lambda: lame_lambda, mu: lame_mu, viscosity_rate, .. } = *t;
    let tissue = Tissue { model, lame_lambda, lame_mu, viscosity_rate };
    let response = tissue.respond(&f, Some(&t.start));
    let g = shape_gradients(&t.shape);
    vec![
        ("elastic_energy", vec![response.elastic_energy]),
        ("viscous_energy", vec![response.viscous_energy]),
        ("energy change", vec![tissue.energy_change_of::<L>(&f, &d, Some(&t.start))]),
        ("gradient map", numbers(&L::gradient_map(&f).columns)),
        ("elastic piola", numbers(&tissue.respond(&f, None).piola.columns)),
        ("piola", numbers(&response.piola.columns)),
        ("curvature", g.map(|g| tissue.curvature(&f, g)).to_vec()),
    ]
}

const TISSUE: &str = "
    let change = tissue_change_since(f, start);
    let elastic = law_piola(law, f, lambda, mu);
    put(law_energy_density(law, f, lambda, mu));
    put(tissue_viscous_energy(change, viscosity_rate, lambda, mu));
    let d = transpose(f - IDENTITY) * 0.5;
    let viscous = tissue_viscous_energy_change(f, d, change, viscosity_rate, lambda, mu);
    put(law_energy_change(law, f, d, lambda, mu) + viscous);
    put_mat3(law_gradient_map(law, f));
    put_mat3(elastic);
    put_mat3(elastic + tissue_viscous_piola(f, change, viscosity_rate, lambda, mu));
    let g = shape_gradients(shape);
    put(tissue_curvature(law, f, g[0], lambda, mu, viscosity_rate));
    put(tissue_curvature(law, f, g[1], lambda, mu, viscosity_rate));
    put(tissue_curvature(law, f, g[2], lambda, mu, viscosity_rate));
    put(tissue_curvature(law, f, g[3], lambda, mu, viscosity_rate));
";

/// A spring's record; an attachment holds its first end at the second.
fn springs<T: Scalar>(numbers_in: &[T]) -> Results<T> {
    let mut record = Record(numbers_in);
    let x = [record.vector(), record.vector()];
    let (w, held) = (record.array(), record.vector());
    let [rest_length, multiplier, stiffness, compliance] = record.array();
    let (n, length) = spring::direction(&x);
    let (change, positions) = spring::solve(&x, &w, rest_length, multiplier, compliance);
    let loads = spring::corner_loads(&x, multiplier);
    let [x0, anchor] = x;
    let d = [held, x[1] * multiplier];
    let (holds, moves) = attachment::solve(x0, w[0], anchor, held, compliance);
    let held_at_rest = attachment::constitutive_multipliers(x0, anchor, compliance);
    let at_rest = spring::constitutive_multiplier(&x, rest_length, compliance);
    vec![
        ("spring direction", numbers(&[n])),
        ("spring length", vec![length]),
        ("spring energy", vec![spring::energy(&x, rest_length, stiffness)]),
        ("spring energy change", vec![spring::energy_change(&x, &d, rest_length, stiffness)]),
        ("attachment energy change", vec![attachment::energy_change(x0, d[0], anchor, stiffness)]),
        ("element curvature", vec![stiffness, stiffness]),
        ("spring forces", numbers(&spring::forces(&x, rest_length, stiffness))),
        ("spring solve: multiplier", vec![change]),
        ("spring solve: positions", numbers(&positions)),
        ("spring constitutive_multiplier", vec![at_rest]),
        ("spring corner_loads: impulses", impulses(&loads)),
        ("spring corner_loads: bounds", bounds(&loads)),
        ("attachment energy", vec![attachment::energy(x0, anchor, stiffness)]),
        ("attachment force", numbers(&[attachment::force(x0, anchor, stiffness)])),
        ("attachment loads", numbers(&[held])),
        ("attachment solve: multipliers", numbers(&[holds])),
        ("attachment solve: position", numbers(&[moves])),
        ("attachment constitutive_multipliers", numbers(&[held_at_rest])),
    ]
}

const SPRINGS: &str = "
    let x = array<vec3f, 2>(take_vec3(), take_vec3());
    let w = take_2();
    let held = take_vec3();
    let rest_length = take();
    let multiplier = take();
    let stiffness = take();
    let compliance = take();
    let along = spring_direction(x);
    let solved = spring_solve(x, w, rest_length, multiplier, compliance);
    // As the solver asks: through what chooses the kind by its place in the list.
    let four = array<vec3f, 4>(x[0], x[1], vec3f(), vec3f());
    let spring = ElementMoment(vec4f(rest_length, stiffness, 0.0, 0.0), vec3f(), four, 1.0);
    let attachment = ElementMoment(vec4f(stiffness, 0.0, 0.0, 0.0), x[1], four, 1.0);
    let forces = element_forces(0u, spring, four);
    let loads = element_loads(0u, spring, four, vec4f(multiplier, 0.0, 0.0, 0.0), 1.0);
    let holding = element_loads(1u, attachment, four, vec4f(held, 0.0), 1.0);
    let attached = attachment_solve(x[0], w[0], x[1], held, compliance);
    put_vec3(along.n);
    put(along.length);
    put(element_energy(0u, spring, four));
    let d = array<vec3f, 4>(held, x[1] * multiplier, vec3f(), vec3f());
    put(element_energy_change(0u, spring, four, d));
    put(element_energy_change(1u, attachment, four, d));
    put(element_curvature(0u, spring));
    put(element_curvature(1u, attachment));
    put_vec3(forces[0]);
    put_vec3(forces[1]);
    put(solved.multiplier);
    put_vec3(solved.positions[0]);
    put_vec3(solved.positions[1]);
    put(spring_constitutive_multiplier(x, rest_length, compliance));
    put_vec3(loads[0].impulse);
    put_vec3(loads[1].impulse);
    put(loads[0].mass_bound);
    put(loads[1].mass_bound);
    put(element_energy(1u, attachment, four));
    put_vec3(element_forces(1u, attachment, four)[0]);
    put_vec3(holding[0].impulse);
    put_vec3(attached.multipliers);
    put_vec3(attached.position);
    put_vec3(attachment_constitutive_multipliers(x[0], x[1], compliance));
";

fn recovered_tets<T: Scalar>(numbers_in: &[T]) -> Results<T> {
    let mut record = Record(numbers_in);
    let f = record.matrix();
    let gradients = std::array::from_fn(|_| record.matrix());
    let rest = recovered::RestFrame {
        gradients: std::array::from_fn(|_| record.vector()),
        arms: std::array::from_fn(|_| record.vector()),
        face_weights: record.array(),
    };
    let [lambda, mu, pressure] = record.array();
    let shares = recovered::bulk_shares(lambda, mu);
    let bent = recovered::recovered_gradient(&f, &gradients, &rest);
    let share = T::from_f64(1.0 - recovered::VERTEX_SHARE);
    let stress = recovered::tet_stress(&bent, shares.local, mu, share, pressure);
    let stresses = recovered::vertex_stresses(&stress, &rest);
    let change = neo_hookean::volume_change(&bent);
    // To an eighth of the volume, which is below the floor.
    let way = gradients[0] * T::from_f64(-0.5);
    let [first, second, third] = neo_hookean::volume_variation(&f, &way);
    vec![
        ("bulk_shares", vec![shares.local, shares.domain, shares.cluster]),
        ("recovered_gradient", numbers(&bent.columns)),
        ("tet_stress", numbers(&stress.columns)),
        ("vertex_stresses", stresses.iter().flat_map(|n| numbers(&n.columns)).collect()),
        ("bulk_energy", vec![recovered::bulk_energy(change, shares.domain)]),
        ("floor_energy", vec![recovered::floor_energy(&f, mu)]),
        ("floor_piola", numbers(&recovered::floor_piola(&f, mu).columns)),
        ("volume_variation", vec![(first + second) + third]),
        ("floor_energy_change", vec![recovered::floor_energy_change(&f, &way, mu)]),
    ]
}

const RECOVERED_TETS: &str = "
    let f = take_mat3();
    let gradients = array<mat3x3f, 4>(take_mat3(), take_mat3(), take_mat3(), take_mat3());
    let g = array<vec3f, 4>(take_vec3(), take_vec3(), take_vec3(), take_vec3());
    let arms = array<vec3f, 4>(take_vec3(), take_vec3(), take_vec3(), take_vec3());
    let weights = vec4f(take(), take(), take(), take());
    let rest = RecoveredRestFrame(g, arms, weights);
    let lambda = take();
    let mu = take();
    let pressure = take();
    let shares = recovered_bulk_shares(lambda, mu);
    let bent = recovered_gradient(f, gradients, rest);
    let stress = recovered_tet_stress(bent, shares.local, mu, 0.7, pressure);
    let way = gradients[0] * -0.5;
    put(shares.local);
    put(shares.domain);
    put(shares.cluster);
    put_mat3(bent);
    put_mat3(stress);
    put_mat3(recovered_vertex_stress(stress, rest, 0u));
    put_mat3(recovered_vertex_stress(stress, rest, 1u));
    put_mat3(recovered_vertex_stress(stress, rest, 2u));
    put_mat3(recovered_vertex_stress(stress, rest, 3u));
    put(recovered_bulk_energy(neo_hookean_volume_change(bent), shares.domain));
    put(recovered_floor_energy(f, mu));
    put_mat3(recovered_floor_piola(f, mu));
    put(recovered_volume_variation(f, way));
    put(recovered_floor_energy_change(f, way, mu));
";
