//! The quasi-Newton method under rough treatment: the same bits whoever does the work, no energy from nowhere,
//! nothing that is no number.

use crate::common::counting::requests_of;
use crate::common::potential::Outside;
use crate::common::{Random, SNH, STVK, block, material, single_body};
use viscera::material::Material;
use viscera::measure::measure_tets;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::lanes::Instructions::{self, Avx2, Portable};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Integrator, Method, SolverSettings, Threads};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);
const BOTH: [Integrator; 2] = [Integrator::Sdirk2, Integrator::ImplicitEuler];
const FRAME: f64 = 1.0 / 60.0;

fn settings(integrator: Integrator) -> SolverSettings {
    SolverSettings { method: Method::QuasiNewton, integrator, ..SolverSettings::xpbd() }
}

/// Three bodies in two parts, springs and attachments between two of them, some viscous.
fn bodies<S: Real>(viscosity: f64) -> Model<S> {
    let mesh = block([0.06, 0.03, 0.03], [5, 4, 4], 0.1);
    let mut builder = ModelBuilder::new();
    let viscous = material(SNH, 1e4, 0.4).with_viscosity(viscosity).expect("legal");
    for tissue in [material(STVK, 2e4, 0.3), viscous, material(SNH, 3e4, 0.45)] {
        builder.add_body(&mesh, &tissue).expect("a body");
    }
    let half = mesh.vertices().len() as u32;
    for v in (0..half).step_by(3) {
        builder.add_spring([v, half + v], 40.0, Some(0.01)).expect("a spring");
        builder.add_attachment(v, mesh.vertices()[v as usize], 30.0).expect("an attachment");
    }
    builder.build().expect("a model")
}

/// All of the state, what was learned included, after steps with jumps.
fn thrown<S: Real>(
    model: &Model<S>,
    integrator: Integrator,
    (threads, instructions): (u32, Instructions),
) -> (State<S>, u64) {
    let settings = SolverSettings { threads: Threads::Count(threads), ..settings(integrator) };
    let mut solver = Solver::new(model, &settings);
    solver.use_instructions(instructions);
    let mut state = State::at_rest(model);
    for step in 0..12 {
        let mut inputs = Inputs { gravity: GRAVITY.cast(), ..Inputs::default() };
        let jump = if (4..7).contains(&step) { 0.06 } else { 0.0 };
        for v in (0..model.vertex_count()).step_by(11) {
            let away = vec3(jump, 2e-4 * f64::from(step), -jump);
            let target = model.rest_positions[v] + away.cast();
            inputs.pins.push(Pin { vertex: v as u32, target });
        }
        solver.step(model, &mut state, &inputs, FRAME).expect("a legal step");
    }
    assert!(state.is_finite() && state.positions != model.rest_positions);
    (state, solver.rejected_steps())
}

fn same_bits<S: Real>(others: &[(u32, Instructions)]) {
    for integrator in BOTH {
        for viscosity in [0.0, 0.02] {
            let model = bodies::<S>(viscosity);
            let expected = thrown(&model, integrator, (1, Avx2));
            println!("{integrator:?}, {}, {viscosity} s: {} taken again", S::NAME, expected.1);
            for &workers in others {
                let given = thrown(&model, integrator, workers);
                // Every number of a state counts; none of them is NaN.
                assert!(given == expected, "{integrator:?}, {viscosity} s, {workers:?}");
            }
        }
    }
}

#[test]
fn threads_and_instructions_leave_every_bit_of_what_moves_and_of_what_is_learned() {
    same_bits::<f32>(&[(3, Portable)]);
}

#[test]
#[ignore = "slow: both precisions, more threads"]
fn threads_and_instructions_leave_every_bit_of_what_moves_and_of_what_is_learned_at_length() {
    let others = [(3, Avx2), (8, Avx2), (1, Portable), (8, Portable)];
    same_bits::<f32>(&others);
    same_bits::<f64>(&others);
}

const YOUNG: f64 = 1e4;
const LENGTH: f64 = 0.06;

/// A body that is handled roughly; its energy is computed outside of the solver.
struct Handled<'a, S> {
    mesh: &'a TetMesh,
    model: Model<S>,
    solver: Solver<S>,
    state: State<S>,
    outside: Outside<'a>,
    /// The most that a step has gained beyond what it was given, of what it had [J/J].
    gained: f64,
}

impl<'a, S: Real> Handled<'a, S> {
    fn new(mesh: &'a TetMesh, poisson: f64, integrator: Integrator) -> Self {
        let tissue: Material = material(SNH, YOUNG, poisson);
        let model = single_body::<S>(mesh, &tissue);
        let outside = Outside::new::<S>(mesh, YOUNG, poisson, 1000.0);
        let solver = Solver::new(&model, &settings(integrator));
        Self { mesh, solver, state: State::at_rest(&model), model, outside, gained: 0.0 }
    }

    /// The wall at `x = 0`, and vertices that are put elsewhere.
    fn pins(&self, grabbed: &[(u32, Vec3<f64>)]) -> Inputs<S> {
        let mut inputs = Inputs::default();
        for (v, x) in (0..).zip(self.mesh.vertices()) {
            let place = grabbed.iter().find(|(vertex, _)| *vertex == v);
            let target = place.map(|(_, target)| *target).or((x.x < 1e-9).then_some(*x));
            inputs.pins.extend(target.map(|target| Pin { vertex: v, target: target.cast() }));
        }
        inputs
    }

    /// A frame; nothing but pins gives energy, and they by where they are put.
    fn frame(&mut self, inputs: &Inputs<S>, what: &str) {
        let before = self.state.clone();
        self.solver.step(&self.model, &mut self.state, inputs, FRAME).expect("a legal step");
        assert!(self.state.is_finite(), "{what}: not finite");
        let [mut before, mut after] = [before, self.state.clone()];
        for pin in &inputs.pins {
            before.positions[pin.vertex as usize] = pin.target;
            before.velocities[pin.vertex as usize] = Vec3::ZERO;
            after.velocities[pin.vertex as usize] = Vec3::ZERO;
        }
        let [had, has] = [&before, &after].map(|state| self.outside.mechanical(state, FRAME));
        let beyond = has.value - had.value;
        self.gained = self.gained.max(beyond / had.value.max(1e-12));
        assert!(
            !has.is_above(had),
            "{what}: {:e} J of {:e} J, {beyond:e} J more, rounding {:e} J",
            has.value,
            had.value,
            had.noise + has.noise
        );
    }

    fn inverted(&self) -> usize {
        let mut tets = Vec::new();
        measure_tets(&self.model, &self.state.positions, &mut tets);
        tets.iter().filter(|tet| tet.is_inverted()).count()
    }
}

fn bar() -> TetMesh {
    block([LENGTH, 0.02, 0.02], [6, 2, 2], 0.2)
}

/// Up to seven vertices jump by up to a body length, twice, and are let go; or all vertices are put anywhere. The
/// share of tetrahedra that is inside out a second later is a thousandth at most.
fn handled<S: Real>(seeds: std::ops::Range<u64>, scrambles: bool) {
    let mesh = bar();
    let (mut rejected, mut inverted, mut gained) = (0, Vec::new(), 0.0f64);
    let mut bodies = 0;
    for seed in seeds {
        for (poisson, integrator) in [(0.3, BOTH[0]), (0.45, BOTH[0]), (0.3, BOTH[1])] {
            let what = format!("seed {seed}, nu {poisson}, {integrator:?}, {}", S::NAME);
            let mut body = Handled::<S>::new(&mesh, poisson, integrator);
            let mut random = Random(seed);
            if scrambles {
                let size = random.uniform(0.1, 1.0) * LENGTH;
                for (x, rest) in body.state.positions.iter_mut().zip(mesh.vertices()) {
                    *x = (*rest + random.vector(size)).cast();
                }
            }
            let count = if scrambles { 0 } else { 2 + random.next() as usize % 6 };
            let vertices: Vec<u32> =
                (0..count).map(|_| random.next() as u32 % mesh.vertices().len() as u32).collect();
            for _ in 0..if scrambles { 0 } else { 2 } {
                let jump = |&v: &u32| {
                    let way = random.vector(1.0);
                    let way = way * (random.uniform(0.0, LENGTH) / way.length());
                    (v, mesh.vertices()[v as usize] + way)
                };
                let grabbed: Vec<_> = vertices.iter().map(jump).collect();
                let inputs = body.pins(&grabbed);
                for _ in 0..5 {
                    body.frame(&inputs, &what);
                }
            }
            let inputs = body.pins(&[]);
            for _ in 0..60 {
                body.frame(&inputs, &what);
            }
            bodies += 1;
            rejected += body.solver.rejected_steps();
            gained = gained.max(body.gained);
            if body.inverted() > 0 {
                inverted.push((seed, poisson, integrator, body.inverted()));
            }
        }
    }
    println!(
        "{rejected} taken again, gained {gained:e}, of {}: inverted {inverted:?}",
        mesh.tets().len()
    );
    // Of all bodies together: the law has minima with a tetrahedron inside out, where a body may stay.
    let sum: usize = inverted.iter().map(|last| last.3).sum();
    assert!(sum * 1000 <= bodies * mesh.tets().len(), "{inverted:?} of {bodies} bodies");
}

#[test]
fn violent_grabs_make_no_energy() {
    handled::<f32>(0..2, false);
    // Forces overflow in a trial.
    handled::<f32>(28..29, false);
}

#[test]
#[ignore = "slow: many seeds in both precisions"]
fn violent_grabs_make_no_energy_at_length() {
    handled::<f32>(0..200, false);
    handled::<f64>(200..220, false);
}

#[test]
fn scrambled_starts_make_no_energy() {
    handled::<f32>(0..2, true);
}

#[test]
#[ignore = "slow: many seeds in both precisions"]
fn scrambled_starts_make_no_energy_at_length() {
    handled::<f32>(0..200, true);
    handled::<f64>(200..220, true);
}

/// What makes a case hard.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hard {
    /// A tetrahedron a ten-thousandth as high as it is wide.
    Sliver,
    /// Everything flies at 10 km/s.
    Fast,
    /// A second at once.
    LongStep,
    /// A microsecond.
    ShortStep,
    /// From a microsecond to a second, at random.
    ChangingSteps,
    /// Up and down.
    FlippingGravity,
    /// By a body's length and back.
    JumpingPin,
    /// Of another stiffness, by a new solver, in mid-run.
    OtherStiffness,
    /// Forces of a million newtons.
    HugeForce,
    /// All vertices in one place.
    Collapsed,
}

const HARD: [Hard; 10] = [
    Hard::Sliver,
    Hard::Fast,
    Hard::LongStep,
    Hard::ShortStep,
    Hard::ChangingSteps,
    Hard::FlippingGravity,
    Hard::JumpingPin,
    Hard::OtherStiffness,
    Hard::HugeForce,
    Hard::Collapsed,
];

fn treat<S: Real>(hard: Hard, law: viscera::material::MaterialModel, integrator: Integrator) {
    let mut mesh = block([LENGTH, 0.02, 0.02], [4, 1, 1], 0.0);
    if hard == Hard::Sliver {
        let squeeze = |x: &Vec3<f64>| if x.x > 0.059 { vec3(0.045 + 1e-6, x.y, x.z) } else { *x };
        let vertices = mesh.vertices().iter().map(squeeze).collect();
        mesh = TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec())
            .expect("slivers")
            .0;
    }
    let model = |young| single_body::<S>(&mesh, &material(law, young, 0.45));
    let (soft, stiff) = (model(1e3), model(1e6));
    let [mut solver, mut other] =
        [&soft, &stiff].map(|model| Solver::new(model, &settings(integrator)));
    let mut state = State::at_rest(&soft);
    let mut random = Random(9);
    if hard == Hard::Fast {
        state.velocities.fill(vec3(6e3, -8e3, 0.0).cast());
    }
    if hard == Hard::Collapsed {
        state.positions.fill(vec3(0.01, 0.01, 0.01).cast());
    }
    for step in 0..30 {
        let mut inputs = Inputs { gravity: GRAVITY.cast(), ..Inputs::default() };
        for (v, x) in (0..).zip(mesh.vertices()).filter(|(_, x)| x.x < 1e-9 && hard != Hard::Fast) {
            inputs.pins.push(Pin { vertex: v, target: x.cast() });
        }
        let last = mesh.vertices().len() as u32 - 1;
        let odd = step % 2 == 1;
        let mut dt = FRAME;
        match hard {
            Hard::LongStep => dt = 1.0,
            Hard::ShortStep => dt = 1e-6,
            Hard::ChangingSteps => dt = libm::pow(10.0, random.uniform(-6.0, 0.0)),
            Hard::FlippingGravity if odd => inputs.gravity = -inputs.gravity,
            Hard::JumpingPin => {
                let away = if odd { LENGTH } else { 0.0 };
                let target = mesh.vertices()[last as usize] + vec3(0.0, away, 0.0);
                inputs.pins.push(Pin { vertex: last, target: target.cast() });
            }
            Hard::HugeForce => inputs.forces.push((last, vec3(1e6, 0.0, 0.0).cast())),
            _ => {}
        }
        let result = if hard == Hard::OtherStiffness && step % 10 >= 5 {
            other.step(&stiff, &mut state, &inputs, dt)
        } else {
            solver.step(&soft, &mut state, &inputs, dt)
        };
        let what = format!("{hard:?}, {law:?}, {integrator:?}, {}, step {step}", S::NAME);
        result.unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(state.is_finite(), "{what}: not finite");
        let reach = state.positions.iter().map(|x| x.length().to_f64()).fold(0.0, f64::max);
        // The farthest that flight, fall or a force leads.
        let far = match hard {
            Hard::Fast => 1e4,
            Hard::HugeForce => f64::INFINITY,
            _ => 10.0,
        };
        assert!(reach < far, "{what}: {reach} m away");
    }
}

#[test]
fn hard_inputs_leave_numbers() {
    for hard in HARD {
        for law in [STVK, SNH] {
            for integrator in BOTH {
                treat::<f32>(hard, law, integrator);
                treat::<f64>(hard, law, integrator);
            }
        }
    }
}

/// After the first step, with the same vertices pinned and the same step, and where nothing is viscous in any case: jumps,
/// steps that are taken again, other loads.
/// An energy beyond single precision is reported as not finite; double precision holds it.
#[test]
fn energies_beyond_numbers_are_told() {
    let mesh = block([LENGTH, 0.02, 0.02], [4, 1, 1], 0.0);
    let tissue = material(viscera::material::MaterialModel::StableNeoHookean, 1e4, 0.45);
    fn report<S: Real>(mesh: &TetMesh, tissue: &Material) -> (bool, bool) {
        let model = single_body::<S>(mesh, tissue);
        let mut solver = Solver::new(&model, &settings(Integrator::Sdirk2));
        let mut state = State::at_rest(&model);
        for x in &mut state.positions {
            *x = *x * S::from_f64(1e18);
        }
        assert!(solver.part_reports().is_empty());
        solver.step(&model, &mut state, &Inputs::default(), FRAME).expect("a legal step");
        let report = solver.last_step().expect("a step that was judged");
        (report.potential.is_finite(), report.keeps_limit())
    }
    assert_eq!(report::<f32>(&mesh, &tissue), (false, false));
    assert_eq!(report::<f64>(&mesh, &tissue), (true, true));
}

#[test]
fn steps_after_the_first_allocate_nothing() {
    for integrator in BOTH {
        for viscosity in [0.0, 0.02] {
            let model = bodies::<f32>(viscosity);
            let mut solver = Solver::new(&model, &settings(integrator));
            let mut state = State::at_rest(&model);
            let mut inputs = Inputs { gravity: GRAVITY.cast(), ..Inputs::default() };
            for (v, x) in (0..).zip(&model.rest_positions).step_by(11) {
                inputs.pins.push(Pin { vertex: v, target: *x });
            }
            inputs.anchors = model.rest_anchors.clone();
            inputs.forces.push((1, vec3(0.0, 0.0, 0.0)));
            solver.step(&model, &mut state, &inputs, FRAME).expect("a legal step");
            let requests = requests_of(|| {
                for step in 0..10 {
                    let jump = if viscosity == 0.0 && step == 3 { 0.06 } else { 1e-4 };
                    inputs.pins.iter_mut().for_each(|pin| pin.target.y += jump);
                    inputs.anchors.iter_mut().for_each(|x| x.z -= 1e-4);
                    inputs.forces[0].1.x += 1e-3;
                    solver.step(&model, &mut state, &inputs, FRAME).expect("a legal step");
                }
            });
            let again = solver.rejected_steps();
            println!("{integrator:?}, {viscosity} s: {requests} requests, {again} taken again");
            assert_eq!(requests, 0, "{integrator:?}, {viscosity} s");
        }
    }
}
