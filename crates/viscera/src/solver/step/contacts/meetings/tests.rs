use crate::contact::{Skin, TissueContact};
use crate::material::{Material, MaterialModel};
use crate::mesh::embed::Embedding;
use crate::mesh::{TetMesh, shapes};
use crate::model::{Model, ModelBuilder};
use crate::scalar::{Vec3, vec3};
use crate::settings::{Count, Elements, Method, SolverSettings};
use crate::solver::gpu::{Adapter, GpuSolver};
use crate::solver::{Inputs, Meetings, Solver};
use crate::state::State;

/// Two organs whose fine surfaces hang on coarse tetrahedra, one above the other.
fn model() -> Model<f32> {
    let liver = shapes::liver(0.04, 1.0).expect("a liver");
    let heights = liver.tets.vertices().iter().map(|x| x.z);
    let [low, high] = [heights.clone().fold(f64::MAX, f64::min), heights.fold(f64::MIN, f64::max)];
    let tissue = Material::new(MaterialModel::StableNeoHookean, 8e3, 0.4, 1050.0).expect("legal");
    let mut builder = ModelBuilder::new();
    let mut skin = Skin::default();
    let (mut first_vertex, mut first_tet) = (0, 0);
    for (number, share) in [(0, 0.0), (1, 0.86)] {
        let shift = vec3(3e-3, -2e-3, high - low) * share;
        let moved = |all: &[Vec3<f64>]| all.iter().map(|x| *x + shift).collect::<Vec<_>>();
        let (tets, regions) = (liver.tets.tets().to_vec(), liver.tets.regions().to_vec());
        let mesh = TetMesh::new(moved(liver.tets.vertices()), tets, regions).expect("a mesh").0;
        builder.add_body(&mesh, &tissue).expect("a body");
        let mut surface = liver.surface.clone();
        surface.vertices = moved(&surface.vertices);
        let embedding = Embedding::new(&mesh, &surface).expect("a surface");
        let first = (first_vertex, first_tet);
        skin.add_embedded(number, (&surface, &embedding), first, builder.positions());
        first_vertex += mesh.vertices().len() as u32;
        first_tet += mesh.tets().len() as u32;
    }
    let contact = TissueContact { itself: true, ..TissueContact::default() };
    builder.set_skin(skin, &contact);
    builder.build().expect("a model")
}

/// Points of fine surfaces hang on four vertices, and triangles on twelve: what is found, and what follows from it, is the
/// processor's.
#[test]
fn fine_surfaces_meet_as_on_the_processor() {
    let model = model();
    let (method, elements) = (Method::QuasiNewton, Elements::Plain);
    let iterations = Count::Of(24);
    let settings = SolverSettings { method, elements, iterations, ..SolverSettings::default() };
    let device = Adapter::find(None).and_then(|adapter| adapter.open());
    let device = device.unwrap_or_else(|error| panic!("{error}"));
    let mut state = State::at_rest(&model);
    let first = model.bodies[1].vertices.start;
    for (v, velocity) in state.velocities.iter_mut().enumerate() {
        *velocity = vec3(0.0, 0.01, if v < first { 0.15 } else { -0.15 });
    }
    let (mut cpu, mut gpu) = (
        Solver::new(&model, &settings),
        GpuSolver::new(&device, &model, &settings).expect("a model that fits"),
    );
    gpu.write(&model, &state).expect("a state");
    let (inputs, dt) = (Inputs::default(), 1.0 / 120.0);
    let mut here = state.clone();
    let mut most = 0;
    for step in 0..6 {
        let start = here.clone();
        gpu.step(&model, &inputs, dt).expect("a step");
        gpu.read_frame(&model, &mut here).expect("a device");
        cpu.step(&model, &mut state, &inputs, dt).expect("a step");
        if step == 0 {
            let mut meetings = Meetings::new(&model, &settings);
            meetings.meet(&start, dt);
            let (found, wanted) = (gpu.found(&model, &start).expect("a device"), meetings.found());
            println!("{} of {} found", found.len(), wanted.len());
            assert_eq!(found.len(), wanted.len());
            for (found, wanted) in found.iter().zip(&wanted) {
                assert_eq!(found.sample, wanted.sample);
                let [a, b] = [found, wanted].map(|one| Vec3::<f64>::from_f64(one.away).length());
                assert!((a - b).abs() < 1e-7, "{found:?} {wanted:?}");
                let softer = (found.stiffness - wanted.stiffness).abs();
                assert!(softer < 1e-3 * wanted.stiffness + 1e-3, "{found:?} {wanted:?}");
            }
        }
        let kept = gpu.contact(&model, &here).expect("a device").pairs;
        most = most.max(kept.len());
        let apart = here.positions.iter().zip(&state.positions).map(|(a, b)| (*a - *b).length());
        let apart = apart.fold(0.0, f32::max);
        println!("{step}: {apart:e} m apart, {} and {}", kept.len(), state.contact.pairs.len());
        // What meets first is stiff and light: solves that stop end a little apart, of 1.25 mm that a step moves.
        assert!(apart < 2e-5, "{step}: {apart:e}");
        assert!(kept.len().abs_diff(state.contact.pairs.len()) <= 1 + kept.len() / 20);
    }
    assert!(most > 3, "{most}");
}
