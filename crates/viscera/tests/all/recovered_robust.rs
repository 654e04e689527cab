//! Recovered-gradient tetrahedra, by both methods that have them, on meshes that are hard on them: thin, torn, of many
//! materials. On each the body comes to rest, where forces are in balance and both methods put it; and let go it gains
//! no energy. What is no mesh, or no material, is refused with one error.

use crate::common::{Random, SNH, block, material};
use viscera::layout::{Domains, Smoothing};
use viscera::material::Material;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Elements, Method, SolverSettings};
use viscera::solver::recovered::Recovered;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const METHODS: [Method; 2] = [Method::QuasiNewton, Method::Explicit];
const YOUNG: f64 = 2e4;
const FRAME: f64 = 1.0 / 60.0;

/// A mesh whose region `i` is of material `i`.
struct Hard {
    name: &'static str,
    mesh: TetMesh,
    materials: Vec<Material>,
}

impl Hard {
    fn new(name: &'static str, mesh: TetMesh, poissons: &[f64]) -> Self {
        let materials = poissons.iter().map(|&poisson| material(SNH, YOUNG, poisson)).collect();
        Self { name, mesh, materials }
    }

    /// The same with a retardation time [s].
    fn viscous(&self, time: f64) -> Self {
        let of = |material: &Material| material.with_viscosity(time).expect("legal");
        Self {
            name: self.name,
            mesh: self.mesh.clone(),
            materials: self.materials.iter().map(of).collect(),
        }
    }

    fn model<S: Real>(&self) -> Model<S> {
        let mut builder = ModelBuilder::new();
        let body = builder.add_body(&self.mesh, &self.materials[0]).expect("a body");
        for (region, material) in (1..).zip(&self.materials[1..]) {
            let count = builder.set_region_material(body, region, material).expect("a region");
            assert!(count > 0, "{}: nothing is of region {region}", self.name);
        }
        builder.build().expect("a model")
    }

    /// Held where `x = 0`.
    fn wall<S: Real>(&self) -> Inputs<S> {
        let at_wall = (0u32..).zip(self.mesh.vertices()).filter(|(_, x)| x.x < 1e-9);
        let pins = at_wall.map(|(vertex, x)| Pin { vertex, target: x.cast() }).collect();
        Inputs { pins, ..Inputs::default() }
    }
}

fn solver<S: Real>(model: &Model<S>, method: Method) -> Solver<S> {
    let settings =
        SolverSettings { method, elements: Elements::Recovered, ..SolverSettings::default() };
    Solver::new(model, &settings)
}

/// Where a body hangs [m], in double precision. After each step some of the motion is taken out, which leaves the fast
/// motion of explicit steps, and viscosity takes that.
fn hangs(hard: &Hard, method: Method) -> Vec<Vec3<f64>> {
    let model = hard.viscous(3e-4).model::<f64>();
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..hard.wall() };
    let mut state = State::at_rest(&model);
    let mut solver = solver(&model, method);
    for _ in 0..140 {
        solver.step(&model, &mut state, &inputs, FRAME).expect("a legal step");
        assert!(state.is_finite(), "{}, {method}", hard.name);
        state.velocities.iter_mut().for_each(|v| *v = *v * 0.7);
    }
    // What the definition says, and not the solver.
    let domains = Domains::new(&model, Smoothing::RECOVERED);
    let mut passes = Recovered::new(&domains);
    passes.evaluate(&domains, &model.materials, &state.positions);
    let mut forces = vec![Vec3::ZERO; model.vertex_count()];
    passes.add_gradient(&domains, &model.materials, &mut forces);
    let (mut unbalanced, mut load) = (0.0f64, 0.0);
    for (v, force) in forces.iter().enumerate() {
        let weight = inputs.gravity * model.masses[v];
        load += weight.length_squared();
        if model.rest_positions[v].x > 1e-9 {
            unbalanced += (weight - *force).length_squared();
        }
    }
    let share = (unbalanced / load).sqrt();
    println!("{}, {method}: {share:.1e} of the weight is unbalanced", hard.name);
    assert!(share < 1e-5, "{}, {method}: {share:e}", hard.name);
    state.positions
}

/// The most energy at the end of a step over that at the start, of a body that is thrown at its wall, in the precision
/// of the product; forces are the definition's.
fn gain(hard: &Hard, method: Method) -> f64 {
    let (model, exact) = (hard.model::<f32>(), hard.model::<f64>());
    let (mut state, mut random) = (State::at_rest(&model), Random(3));
    for v in &mut state.velocities {
        *v = random.vector(0.5).cast();
    }
    let wall = hard.wall();
    for pin in &wall.pins {
        state.velocities[pin.vertex as usize] = Vec3::ZERO;
    }
    let domains = Domains::new(&exact, Smoothing::RECOVERED);
    let mut elastic = Recovered::new(&domains);
    let mut energy = |state: &State<f32>| {
        assert!(state.is_finite(), "{}, {method}", hard.name);
        let places: Vec<Vec3<f64>> = state.positions.iter().map(|x| x.cast()).collect();
        elastic.evaluate(&domains, &exact.materials, &places);
        let terms = state.velocities.iter().zip(&exact.masses);
        let kinetic: f64 = terms.map(|(v, m)| 0.5 * m * v.cast::<f64>().length_squared()).sum();
        kinetic + elastic.energy(&domains, &exact.materials)
    };
    let had = energy(&state);
    let mut solver = solver(&model, method);
    let mut most = 0.0f64;
    for _ in 0..30 {
        solver.step(&model, &mut state, &wall, FRAME).expect("a legal step");
        most = most.max(energy(&state));
    }
    most / had
}

/// Comes to rest where the other method does, sags, and gains nothing.
fn check(hard: &Hard) {
    let [a, b] = METHODS.map(|method| hangs(hard, method));
    let rest = hard.mesh.vertices();
    let sum = |pairs: &mut dyn Iterator<Item = (&Vec3<f64>, &Vec3<f64>)>| -> f64 {
        pairs.map(|(a, b)| (*a - *b).length_squared()).sum::<f64>().sqrt()
    };
    let (apart, moved) = (sum(&mut a.iter().zip(&b)), sum(&mut a.iter().zip(rest)));
    println!("{}: methods differ by {:.1e} of the sag", hard.name, apart / moved);
    assert!(apart < 1e-4 * moved, "{}: {apart} of {moved} m", hard.name);
    // What hangs at one side of a wall ends below where it was, by less than it is long.
    let low = a.iter().zip(rest).map(|(x, rest)| rest.z - x.z).fold(0.0, f64::max);
    assert!((1e-5..0.06).contains(&low), "{}: {low} m", hard.name);
    for method in METHODS {
        let gain = gain(hard, method);
        println!("{}, {method}: {gain} of the energy", hard.name);
        // Rounding of strains: places over a cell.
        assert!(gain < 1.0 + 64.0 * f64::from(f32::EPSILON), "{}, {method}: {gain}", hard.name);
    }
}

fn bar() -> TetMesh {
    block([0.04, 0.02, 0.02], [4, 2, 2], 0.1)
}

/// The same vertices and tetrahedra in other regions.
fn with_regions(mesh: &TetMesh, region: impl Fn(usize) -> u32) -> TetMesh {
    let regions = (0..mesh.tets().len()).map(region).collect();
    TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), regions).expect("the same mesh").0
}

#[test]
fn the_stiffest_volume_that_can_be_asked_for_hangs() {
    let error = Material::new(SNH, YOUNG, 0.4999, 1000.0).expect_err("beyond the largest ratio");
    let text = error.to_string();
    assert!(text.contains("0.4999") && text.contains("at most 0.499"), "{text}");
    check(&Hard::new("nu 0.499", bar(), &[0.499]));
}

#[test]
fn a_sheet_one_tetrahedron_thick_moves_soundly() {
    check(&Hard::new("a sheet", block([0.04, 0.03, 0.01], [4, 3, 1], 0.0), &[0.45]));
}

#[test]
fn a_region_of_one_tetrahedron_moves_soundly() {
    let mesh = bar();
    for tet in [0, mesh.tets().len() / 2] {
        let hard =
            Hard::new("one of another", with_regions(&mesh, |t| u32::from(t == tet)), &[0.45, 0.1]);
        check(&hard);
    }
}

/// A tetrahedron on one face alone: nothing but itself is known of its fourth vertex.
#[test]
fn a_vertex_of_one_tetrahedron_moves_soundly() {
    let mesh = bar();
    let surface = viscera::mesh::boundary_surface(&mesh);
    let face =
        surface.surface.triangles.iter().find(|face| {
            face.iter().all(|&v| surface.surface.vertices[v as usize].x > 0.04 - 1e-9)
        });
    let [a, b, c] = face.expect("a face at the end").map(|v| surface.mesh_vertices[v as usize]);
    let middle = [a, b, c].iter().fold(Vec3::ZERO, |sum, &v| sum + mesh.vertices()[v as usize]);
    let apex = middle * (1.0 / 3.0) + vec3(0.008, 0.0, 0.0);
    let (mut vertices, mut tets) = (mesh.vertices().to_vec(), mesh.tets().to_vec());
    tets.push([a, b, c, vertices.len() as u32]);
    vertices.push(apex);
    let regions = vec![0; tets.len()];
    let mesh = TetMesh::new(vertices, tets, regions).expect("a bar with a tip").0;
    check(&Hard::new("a tip", mesh, &[0.45]));
}

/// Every tetrahedron of its own material: no face has the same on both sides.
#[test]
fn interfaces_on_every_face_move_soundly() {
    let mesh = block([0.03, 0.02, 0.01], [3, 2, 1], 0.0);
    let poissons: Vec<f64> = (0..mesh.tets().len()).map(|t| 0.3 + 0.005 * t as f64).collect();
    check(&Hard::new("interfaces", with_regions(&mesh, |t| t as u32), &poissons));
}

/// The same tetrahedron twice is refused and named; bodies that lie upon each other know nothing of each other.
#[test]
fn tetrahedra_that_are_there_twice_are_refused() {
    let mesh = bar();
    let twice = [mesh.tets(), &mesh.tets()[7..8]].concat();
    let regions = vec![0; twice.len()];
    let refused = TetMesh::new(mesh.vertices().to_vec(), twice, regions);
    let text = refused.expect_err("a tetrahedron twice").to_string();
    let number = mesh.tets().len().to_string();
    assert!(text.contains(&number) && text.contains('7') && text.lines().count() == 1, "{text}");

    let mut builder = ModelBuilder::new();
    for _ in 0..2 {
        builder.add_body(&mesh, &material(SNH, YOUNG, 0.45)).expect("a body");
    }
    let model = builder.build::<f64>().expect("a model");
    let count = mesh.vertices().len();
    let wall = (0u32..).zip(&model.rest_positions).filter(|(_, x)| x.x < 1e-9);
    let pins = wall.map(|(vertex, &target)| Pin { vertex, target }).collect();
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), pins, ..Inputs::default() };
    for method in METHODS {
        let mut state = State::at_rest(&model);
        let mut solver = solver(&model, method);
        for _ in 0..10 {
            solver.step(&model, &mut state, &inputs, FRAME).expect("a legal step");
        }
        let (first, second) = state.positions.split_at(count);
        assert!(first == second && first != &model.rest_positions[..count], "{method}");
    }
}

/// A layer one box thin that hangs on a block by its own edge, free all around.
#[test]
fn a_flap_of_one_layer_moves_soundly() {
    let whole = block([0.04, 0.02, 0.02], [4, 2, 2], 0.0);
    let is_kept = |tet: &usize| {
        let x = whole.corners(*tet).iter().fold(Vec3::ZERO, |sum, x| sum + *x) * 0.25;
        x.x < 0.02 || x.z > 0.01
    };
    let kept = (0..whole.tets().len()).filter(is_kept);
    let tets: Vec<[u32; 4]> = kept.map(|tet| whole.tets()[tet]).collect();
    let regions = vec![0; tets.len()];
    let mesh = TetMesh::new(whole.vertices().to_vec(), tets, regions).expect("a flap").0;
    check(&Hard::new("a flap", mesh, &[0.49]));
}
