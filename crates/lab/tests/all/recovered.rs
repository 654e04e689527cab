//! Recovered-gradient tetrahedra: the library's formulas against the reference's definition, and both against what
//! must come out.

use crate::common::{body, build};
use viscera::elements::recovered::{FLOOR_STIFFNESS, VOLUME_FLOOR};
use viscera::layout::{Domains, Smoothing};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::{Block, Splitting};
use viscera::mesh::topology::boundary_surface;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera::settings::{Elements, Method, SolverSettings};
use viscera::solver::recovered::Recovered;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;
use viscera_lab::load_cases::Random;
use viscera_lab::unstructured::shuffled;
use viscera_reference::Reference;
use viscera_reference::contact::Contacts;
use viscera_reference::matrix::Pattern;
use viscera_reference::objective::{Load, Objective, creep_at};
use viscera_reference::problem::Problem;

const SNH: MaterialModel = MaterialModel::StableNeoHookean;
const STVK: MaterialModel = MaterialModel::SaintVenantKirchhoff;
const SMOOTHINGS: [Smoothing; 3] = [Smoothing::RECOVERED, Smoothing::FITTED, Smoothing::AVERAGED];

fn material(young: f64, poisson: f64) -> Material {
    Material::new(SNH, young, poisson, 1000.0).expect("a legal material")
}

/// A bar of boxes of 1 cm whose inner vertices lie anywhere.
fn bar(cells: [usize; 3]) -> TetMesh {
    let size = Vec3::from_f64(cells.map(|c| 0.01 * c as f64));
    let block =
        Block { jitter: 0.6, seed: 1, splitting: Splitting::Six, ..Block::new(size, cells) };
    block.mesh().expect("a legal block")
}

/// The same mesh with regions by the tetrahedra's centroids.
fn with_regions(mesh: &TetMesh, region: impl Fn(usize, Vec3<f64>) -> u32) -> TetMesh {
    let regions = (0..mesh.tets().len()).map(|tet| {
        let [a, b, c, d] = mesh.corners(tet);
        region(tet, (a + b + c + d) * 0.25)
    });
    let regions = regions.collect();
    TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), regions).expect("the same mesh").0
}

/// Of stable neo-Hookean tissue, nearly incompressible and not, a stiff and a soft region, and of the other law.
fn everything() -> Model<f64> {
    let mesh = with_regions(&bar([3, 2, 2]), |_, x| u32::from(x.x > 0.015) + u32::from(x.z > 0.01));
    let mut builder = ModelBuilder::new();
    let body = builder.add_body(&mesh, &material(1e4, 0.3)).expect("a body");
    builder.set_region_material(body, 1, &material(1e5, 0.49)).expect("a region");
    let other = Material::new(STVK, 1e4, 0.4, 1000.0).expect("legal");
    builder.set_region_material(body, 2, &other).expect("a region");
    build(&builder)
}

fn shaken(x: &[Vec3<f64>], size: f64, seed: u64) -> Vec<Vec3<f64>> {
    let mut random = Random(seed);
    x.iter().map(|x| *x + random.vector(size)).collect()
}

fn norm(values: &[Vec3<f64>]) -> f64 {
    values.iter().map(|v| v.length_squared()).sum::<f64>().sqrt()
}

fn distance(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    norm(&a.iter().zip(b).map(|(a, b)| *a - *b).collect::<Vec<_>>())
}

fn dot(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

fn statics(problem: &Problem) -> Objective<'_> {
    let load = Load::Forces(vec![Vec3::ZERO; problem.vertex_count()]);
    Objective {
        problem,
        anchors: &problem.rest_anchors,
        tethers: &[],
        contacts: Contacts::NONE,
        load,
    }
}

/// Energy and gradient of the library's passes.
fn library(model: &Model<f64>, smoothing: Smoothing, x: &[Vec3<f64>]) -> (f64, Vec<Vec3<f64>>) {
    let domains = Domains::new(model, smoothing);
    let mut passes = Recovered::new(&domains);
    passes.evaluate(&domains, &model.materials, x);
    let mut gradient = vec![Vec3::ZERO; x.len()];
    passes.add_gradient(&domains, &model.materials, &mut gradient);
    (passes.energy(&domains, &model.materials), gradient)
}

/// The reference follows unit displacements through the definition; the library has formulas for it. Each rounds some
/// thousand terms.
#[test]
fn the_library_is_the_definition() {
    let model = everything();
    let own = with_law(&model);
    for smoothing in SMOOTHINGS {
        let mut problem = Problem::recovered(&model, smoothing);
        problem.linear.nodes.clear();
        problem.linear.points.clear();
        for size in [1e-5, 1e-3, 8e-3] {
            let x = shaken(&model.rest_positions, size, 2);
            let objective = statics(&problem);
            let expected = objective.elastic_energy(&x);
            let (energy, gradient) = library(&model, smoothing, &x);
            // Strains are displacements over a box, known to the rounding of places over displacements.
            let bound = 64.0 * f64::EPSILON * (1.0 + 0.03 / size);
            assert!((energy / expected - 1.0).abs() < bound, "{energy} {expected}");
            let truth = objective.gradient(&x);
            let error = distance(&gradient, &truth) / norm(&truth);
            println!("{smoothing:?}, {size}: energy {energy:.3e} J, gradient off by {error:.1e}");
            assert!(error < bound, "{error:e} of {bound:e}");
        }
    }
    assert!(own > 50, "tetrahedra of the law: {own}");
}

fn with_law(model: &Model<f64>) -> usize {
    model.tets().filter(|tet| tet.law == SNH).count()
}

/// How far vertices are shaken [m]: from sound tissue to some tetrahedra below the volume floor.
const SIZES: [f64; 2] = [2e-3, 8e-3];

/// Fourth-order differences with `t = 5e-4`: the formula errs by about `t^4`, round-off by `eps/t`.
#[test]
fn gradient_and_second_variation_match_differences() {
    let model = everything();
    let t = 5e-4;
    for (smoothing, size) in SMOOTHINGS.into_iter().flat_map(|of| SIZES.map(|size| (of, size))) {
        let domains = Domains::new(&model, smoothing);
        let x = shaken(&model.rest_positions, size, 3);
        let zero = vec![Vec3::ZERO; x.len()];
        let d = shaken(&zero, 1e-3, 4);
        let at = |s: f64| -> Vec<_> { x.iter().zip(&d).map(|(x, d)| *x + *d * s).collect() };
        let energy = |s: f64| library(&model, smoothing, &at(s)).0;
        let (_, gradient) = library(&model, smoothing, &x);
        let exact = dot(&gradient, &d);
        let slope =
            (8.0 * (energy(t) - energy(-t)) - (energy(2.0 * t) - energy(-2.0 * t))) / (12.0 * t);
        let scale = norm(&gradient) * norm(&d);
        assert!((slope - exact).abs() < 1e-8 * scale, "{slope} {exact} of {scale}");

        let mut passes = Recovered::new(&domains);
        passes.evaluate(&domains, &model.materials, &x);
        let mut along = Recovered::new(&domains);
        along.take_gradients(&domains, &d);
        let variation = passes.variation(&domains, &model.materials, &mut along);
        let gradients =
            [t, -t, 2.0 * t, -2.0 * t].map(|s| dot(&library(&model, smoothing, &at(s)).1, &d));
        let [a, b, c, e] = gradients;
        let second = (8.0 * (a - b) - (c - e)) / (12.0 * t);
        let change = energy(1.0) - energy(0.0);
        println!("first {:e}, second {second:e}, change {change:e}", variation.first);
        assert!((variation.first / exact - 1.0).abs() < 1e-12);
        assert!((variation.second / second - 1.0).abs() < 1e-8, "{} {second}", variation.second);
        assert!((variation.change / change - 1.0).abs() < 1e-11, "{} {change}", variation.change);
    }
}

/// Of the reference in a step of viscous tissue, and the second variation of the library as its Hessian's.
#[test]
fn the_references_hessian_matches_differences() {
    let mut builder = ModelBuilder::new();
    let tissue = material(1e4, 0.45).with_viscosity(0.02).expect("legal");
    builder.add_body(&bar([3, 2, 1]), &tissue).expect("a body");
    let model = build(&builder);
    let problem = Problem::recovered(&model, Smoothing::RECOVERED);
    let start = shaken(&model.rest_positions, 1e-3, 5);
    for size in SIZES {
        let x = shaken(&start, size, 6);
        let d = shaken(&vec![Vec3::ZERO; x.len()], 1e-3, 7);
        let dt = 0.01;
        let creep = creep_at(&problem, &start, dt);
        let shapes = problem.recovered.start(&start, dt);
        let predicted = start.clone();
        let step = Load::Inertia { dt, predicted, creep, start: shapes };
        let objective = Objective { load: step, ..statics(&problem) };
        let t = 1e-3;
        let at = |s: f64| -> Vec<_> { x.iter().zip(&d).map(|(x, d)| *x + *d * s).collect() };
        let value = |s: f64| objective.value(&at(s)).sum;
        let slope =
            (8.0 * (value(t) - value(-t)) - (value(2.0 * t) - value(-2.0 * t))) / (12.0 * t);
        let gradient = objective.gradient(&x);
        let exact = dot(&gradient, &d);
        let scale = norm(&gradient) * norm(&d);
        assert!((slope - exact).abs() < 1e-8 * scale, "{slope} {exact} of {scale}");
        let pattern = Pattern::new(&problem, &vec![false; x.len()]);
        let image = objective.hessian(&x, &pattern, false).multiply(&pattern, &d);
        let gradients = [t, -t, 2.0 * t, -2.0 * t].map(|s| objective.gradient(&at(s)));
        let differences: Vec<_> = (0..x.len())
            .map(|v| {
                let [a, b, c, e] = [0, 1, 2, 3].map(|k: usize| gradients[k][v]);
                ((a - b) * 8.0 - (c - e)) * (1.0 / (12.0 * t))
            })
            .collect();
        let error = distance(&image, &differences) / norm(&image);
        println!("Hessian off by {error:.1e}");
        assert!(error < 1e-8);

        let domains = Domains::new(&model, Smoothing::RECOVERED);
        let (mut passes, mut along) = (Recovered::new(&domains), Recovered::new(&domains));
        passes.evaluate(&domains, &model.materials, &x);
        along.take_gradients(&domains, &d);
        let second = passes.variation(&domains, &model.materials, &mut along).second;
        let image = statics(&problem).hessian(&x, &pattern, false).multiply(&pattern, &d);
        assert!((second / dot(&image, &d) - 1.0).abs() < 1e-12, "{second} {}", dot(&image, &d));
    }
}

/// Single precision has the digits of its places, of which strains of a thousandth leave four.
#[test]
fn single_precision_keeps_its_digits() {
    let mesh = bar([4, 2, 2]);
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &material(1e4, 0.45)).expect("a body");
    let (double, single) = (build(&builder), builder.build::<f32>().expect("a model"));
    for size in [1e-5, 1e-3] {
        let x: Vec<Vec3<f32>> =
            shaken(&double.rest_positions, size, 8).iter().map(|x| x.cast()).collect();
        let wide: Vec<Vec3<f64>> = x.iter().map(|x| x.cast()).collect();
        let (energy, gradient) = library(&double, Smoothing::RECOVERED, &wide);
        let domains = Domains::new(&single, Smoothing::RECOVERED);
        let mut passes = Recovered::new(&domains);
        passes.evaluate(&domains, &single.materials, &x);
        let mut forces = vec![Vec3::ZERO; x.len()];
        passes.add_gradient(&domains, &single.materials, &mut forces);
        let forces: Vec<Vec3<f64>> = forces.iter().map(|f| f.cast()).collect();
        let error = distance(&forces, &gradient) / norm(&gradient);
        let energy_error = (passes.energy(&domains, &single.materials) / energy - 1.0).abs();
        // Places are rounded to eps of the bar, 4 boxes; strains are the displacement over a box.
        let bound = 32.0 * f64::from(f32::EPSILON) * 0.04 / size;
        println!(
            "{size}: gradient off by {error:.1e}, energy by {energy_error:.1e}, of {bound:.1e}"
        );
        assert!(error < bound && energy_error < bound);
    }
}

#[test]
fn forces_and_torques_add_up_to_nothing() {
    let model = everything();
    let x = shaken(&model.rest_positions, 4e-3, 9);
    for smoothing in SMOOTHINGS {
        let (_, gradient) = library(&model, smoothing, &x);
        let size: f64 = gradient.iter().map(|g| g.length()).sum();
        let force = gradient.iter().fold(Vec3::ZERO, |sum, g| sum + *g);
        let torque = x.iter().zip(&gradient).fold(Vec3::ZERO, |sum, (x, g)| sum + x.cross(*g));
        assert!(force.length() < 1e-14 * size, "{force:?} of {size}");
        assert!(torque.length() < 1e-14 * size, "{torque:?} of {size}");
    }
}

/// One deformation everywhere has the energy of the law and of the volume floor, and one tetrahedron is a linear one.
#[test]
fn one_deformation_has_the_energy_of_the_law() {
    for poisson in [0.3, 0.49] {
        let tissue = material(1e4, poisson);
        let mesh = bar([3, 2, 2]);
        let model = body(&mesh, &tissue);
        let mut crushed = 0;
        for seed in 0..8 {
            let mut random = Random(seed);
            let f = Mat3 { columns: [0; 3].map(|_| random.vector(1.5)) };
            let x: Vec<_> = mesh.vertices().iter().map(|x| f * *x).collect();
            let density = viscera::elements::neo_hookean::energy_density(
                &f,
                tissue.lame_lambda(),
                tissue.lame_mu(),
            );
            let below = (f.determinant() - VOLUME_FLOOR).min(0.0);
            let floor = 0.5 * FLOOR_STIFFNESS * tissue.lame_mu() * below * below;
            let expected = mesh.volume() * (density + floor);
            crushed += usize::from(below < 0.0);
            let (energy, _) = library(&model, Smoothing::RECOVERED, &x);
            assert!((energy / expected - 1.0).abs() < 1e-12, "{energy} {expected}");
        }
        assert!((1..8).contains(&crushed), "{crushed}");
        let corners =
            vec![Vec3::ZERO, vec3(0.01, 0.0, 0.0), vec3(0.0, 0.02, 0.0), vec3(0.0, 0.0, 0.01)];
        let single = TetMesh::new(corners, vec![[0, 1, 2, 3]], vec![0]).expect("a tetrahedron").0;
        equals_linear(&body(&single, &tissue));
    }
}

/// Energy and gradient are those of linear tetrahedra.
fn equals_linear(model: &Model<f64>) {
    let x = shaken(&model.rest_positions, 3e-3, 11);
    let linear = Problem::linear(model);
    let (energy, gradient) = library(model, Smoothing::RECOVERED, &x);
    let expected = statics(&linear).elastic_energy(&x);
    assert!((energy / expected - 1.0).abs() < 1e-12, "{energy} {expected}");
    let truth = statics(&linear).gradient(&x);
    assert!(distance(&gradient, &truth) < 1e-11 * norm(&truth));
}

/// At rest with the boundary moved to these places: how far the inside is from them, over the displacement.
fn inside_error(
    mesh: &TetMesh,
    model: &Model<f64>,
    smoothing: Smoothing,
    exact: &[Vec3<f64>],
) -> f64 {
    let boundary = boundary_surface(mesh).mesh_vertices;
    assert!(boundary.len() < mesh.vertices().len(), "nothing is inside");
    let pins = boundary.iter().map(|&vertex| Pin { vertex, target: exact[vertex as usize] });
    let inputs = Inputs { pins: pins.collect(), ..Inputs::default() };
    let start = shaken(exact, 3e-4, 12);
    let solution =
        Reference::recovered(model, smoothing).settle(&start, &inputs).expect("a state of rest");
    assert!(solution.convergence.minimum);
    distance(&solution.positions, exact) / distance(exact, mesh.vertices())
}

/// The patch test, on a jittered and on an unstructured mesh.
#[test]
fn an_affine_boundary_has_an_affine_inside() {
    let f = Mat3::from_columns(vec3(1.2, 0.05, 0.0), vec3(0.0, 0.93, 0.02), vec3(0.03, 0.0, 0.95));
    for mesh in [bar([4, 3, 3]), shuffled(&bar([6, 4, 4]), 1).expect("a mesh")] {
        for poisson in [0.3, 0.49] {
            let exact: Vec<_> = mesh.vertices().iter().map(|x| f * *x).collect();
            for smoothing in SMOOTHINGS {
                let model = body(&mesh, &material(1e4, poisson));
                let error = inside_error(&mesh, &model, smoothing, &exact);
                println!("nu {poisson}: off by {error:.1e}");
                assert!(error < 1e-9, "{error:e}");
            }
        }
    }
}

/// Two layers of which one is ten times as stiff, stretched along x without contraction: the stresses `P_xx` are the
/// same, the strains are not.
#[test]
fn layers_in_series_stretch_by_their_stiffness() {
    for poisson in [0.3, 0.49] {
        let (soft, stiff) = (material(1e4, poisson), material(1e5, poisson));
        let stress = |tissue: &Material, s: f64| {
            let f = Mat3::from_columns(vec3(s, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0));
            let (lambda, mu) = (tissue.lame_lambda(), tissue.lame_mu());
            viscera::elements::neo_hookean::piola(&f, lambda, mu).columns[0].x
        };
        let of_soft = 1.2;
        let (mut low, mut high) = (1.0, of_soft);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            let is_below = stress(&stiff, middle) < stress(&soft, of_soft);
            if is_below { low = middle } else { high = middle }
        }
        // The plane between the layers is one of the boxes', where nothing is jittered.
        let plain =
            Block { splitting: Splitting::Six, ..Block::new(vec3(0.04, 0.03, 0.03), [4, 3, 3]) };
        let mesh = with_regions(&plain.mesh().expect("a block"), |_, x| u32::from(x.x > 0.02));
        let exact: Vec<_> = mesh
            .vertices()
            .iter()
            .map(|x| vec3(of_soft * x.x.min(0.02) + low * (x.x - 0.02).max(0.0), x.y, x.z))
            .collect();
        let mut builder = ModelBuilder::new();
        let number = builder.add_body(&mesh, &soft).expect("a body");
        builder.set_region_material(number, 1, &stiff).expect("a region");
        for smoothing in SMOOTHINGS {
            let error = inside_error(&mesh, &build(&builder), smoothing, &exact);
            println!("nu {poisson}: off by {error:.1e}");
            assert!(error < 1e-9, "{error:e}");
        }
    }
}

/// What is fitted to all quadratic fields does not depend on the axes they are written in, nor on the size.
#[test]
fn fitted_faces_do_not_know_axes_and_units() {
    let mesh = bar([4, 3, 2]);
    let (sin, cos) = (0.6, 0.8);
    let turned: Vec<_> = mesh
        .vertices()
        .iter()
        .map(|x| vec3(cos * x.x - sin * x.y, x.z, -sin * x.x - cos * x.y) * 7.0)
        .collect();
    let tets = mesh.tets().to_vec();
    let turned = TetMesh::new(turned, tets, mesh.regions().to_vec()).expect("the same mesh").0;
    let weights = |mesh: &TetMesh| -> Vec<f64> {
        let domains = Domains::new(&body(mesh, &material(1e4, 0.3)), Smoothing::FITTED);
        domains.frames.iter().flat_map(|frame| frame.face_weights).collect()
    };
    let (before, after) = (weights(&mesh), weights(&turned));
    assert_eq!(mesh.tets(), turned.tets(), "turned, not mirrored");
    let (least, most) = before
        .iter()
        .filter(|w| **w > 0.0)
        .fold((9.0f64, 0.0f64), |(a, b), w| (a.min(*w), b.max(*w)));
    println!("weights of inner faces: {least} to {most}");
    assert!(most > 1.2 * least, "nothing was fitted");
    for (a, b) in before.iter().zip(&after) {
        assert!((a - b).abs() < 1e-10, "{a} {b}");
    }
}

/// Viscous explicit steps come to the rest that the reference finds from the definition, on a mesh of two materials.
#[test]
fn explicit_steps_come_to_the_rest_of_the_definition() {
    let mesh = with_regions(&bar([4, 2, 2]), |_, x| u32::from(x.x > 0.02));
    let viscous = |young, poisson| material(young, poisson).with_viscosity(0.05).expect("legal");
    let mut builder = ModelBuilder::new();
    let body = builder.add_body(&mesh, &viscous(1e4, 0.3)).expect("a body");
    builder.set_region_material(body, 1, &viscous(5e3, 0.45)).expect("a region");
    let model: Model<f64> = build(&builder);
    let at_wall = (0u32..).zip(&model.rest_positions).filter(|(_, x)| x.x < 1e-9);
    let pins = at_wall.map(|(vertex, &target)| Pin { vertex, target }).collect();
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), pins, ..Inputs::default() };
    let (method, elements) = (Method::Explicit, Elements::Recovered);
    let settings = SolverSettings { method, elements, ..SolverSettings::default() };
    let mut solver = Solver::new(&model, &settings);
    let mut state = State::at_rest(&model);
    for _ in 0..180 {
        solver.step(&model, &mut state, &inputs, 1.0 / 60.0).expect("a legal step");
    }
    let mut reference = Reference::recovered(&model, Smoothing::RECOVERED);
    let start = &model.rest_positions;
    let rest = reference.settle(start, &inputs).expect("a state of rest").positions;
    let error = distance(&state.positions, &rest) / distance(&rest, &model.rest_positions);
    let linear = Reference::new(&model).settle(&rest, &inputs).expect("a state of rest").positions;
    let locked = distance(&linear, &rest) / distance(&rest, &model.rest_positions);
    println!("{error:.1e} from the reference, which linear tetrahedra are {locked:.2} from");
    assert!(error < 1e-6 && locked > 0.1, "{error:e}, {locked}");
}
