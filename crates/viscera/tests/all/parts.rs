//! Connected parts of a model: whatever happens to one, another has the bits that it has in a model of its
//! own.

use crate::common::{Random, Run, SNH, STVK, block, material, plain};
use viscera::layout::Layout;
use viscera::material::Material;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::lanes::Instructions;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Clusters, Colors, Count, Integrator, Method,
    SolverSettings, Threads,
};
use viscera::solver::{Inputs, Pin, Solver, StepReport, Tether};
use viscera::state::State;

pub const DT: f64 = 1.0 / 600.0;
pub const STEPS: u32 = 16;
pub const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

/// What happens to a body beside its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    /// Held by a wall, an attachment and, for a while, a tether.
    Quiet,
    /// Nothing holds it.
    Falling,
    /// Vertices are put elsewhere, and grabbed.
    Thrown,
    /// Positions that are no numbers.
    NoNumber,
    /// A force beyond all measure.
    Overflow,
}

#[derive(Clone)]
pub struct Body {
    mesh: TetMesh,
    tissue: Material,
    pub fate: Fate,
}

impl Body {
    pub fn add(&self, builder: &mut ModelBuilder) {
        let body = builder.add_body(&self.mesh, &self.tissue).expect("a body");
        let vertices = builder.body(body).expect("a body").vertices.clone();
        let (first, last) = (vertices.start as u32, vertices.end as u32 - 1);
        if self.fate != Fate::Falling {
            builder.add_spring([first, last], 5.0, None).expect("a spring");
            let anchor = self.mesh.vertices()[self.mesh.vertices().len() - 1];
            builder.add_attachment(last, anchor, 1.0).expect("an attachment");
        }
    }

    /// What acts in a step, and what is done to the positions before it.
    pub fn act<S: Real>(&self, first: u32, step: u32, inputs: &mut Inputs<S>, x: &mut [Vec3<S>]) {
        let rest = self.mesh.vertices();
        let last = rest.len() - 1;
        // Chosen for what it leads to: shares and descents.
        let mut random = Random(11_000 + u64::from(step / 3));
        let mut grabbed = Vec::new();
        match self.fate {
            Fate::Quiet if step < 9 => inputs.tethers.push(Tether {
                vertex: first + last as u32 - 1,
                target: (rest[last - 1] + vec3(0.0, 0.0, 2e-3)).cast(),
                stiffness: S::from_f64(3.0),
            }),
            Fate::Thrown => {
                if step == 2 {
                    x.iter_mut().for_each(|x| *x += random.vector(0.02).cast());
                }
                if (3..12).contains(&step) {
                    grabbed.extend((0..6).map(|_| random.next() as usize % rest.len()));
                }
            }
            Fate::NoNumber if step == 4 => x[last].y = S::from_f64(f64::NAN),
            Fate::NoNumber if step == 8 => x[last / 2].x = S::from_f64(f64::INFINITY),
            Fate::Overflow if step == 5 => {
                let most = if S::EPSILON > 1e-10 { 3e38 } else { 1e308 };
                inputs.forces.push((first + last as u32, vec3(most, -most, 0.0).cast()));
            }
            _ => {}
        }
        for (v, place) in rest.iter().enumerate() {
            let pin = |target: Vec3<f64>| Pin { vertex: first + v as u32, target: target.cast() };
            if grabbed.contains(&v) {
                inputs.pins.push(pin(*place + random.vector(0.2)));
            } else if place.x < 1e-9 && self.fate != Fate::Falling {
                inputs.pins.push(pin(*place));
            }
        }
    }
}

/// Who does the work.
type Workers = (u32, Instructions);

const ONE: Workers = (1, Instructions::Avx2);

/// Positions and velocities, and reports, after each step.
type Track = Vec<(Vec<u64>, StepReport)>;

/// The tracks of some bodies in one model; reports of the explicit method say nothing.
fn run<S: Real>(bodies: &[&Body], settings: &SolverSettings, workers: Workers) -> Vec<Track> {
    let settings = SolverSettings { threads: Threads::Count(workers.0), ..settings.clone() };
    let mut builder = ModelBuilder::new();
    bodies.iter().for_each(|body| body.add(&mut builder));
    let model: Model<S> = builder.build().expect("a model");
    assert_eq!(model.part_count(), bodies.len());
    let mut solver = Solver::new(&model, &settings);
    solver.use_instructions(workers.1);
    let mut state = State::at_rest(&model);
    let mut tracks = vec![Track::new(); bodies.len()];
    for step in 0..STEPS {
        let mut inputs = Inputs { gravity: GRAVITY.cast(), ..Inputs::default() };
        for (body, of) in bodies.iter().zip(&model.bodies) {
            let x = &mut state.positions[of.vertices.clone()];
            body.act(of.vertices.start as u32, step, &mut inputs, x);
        }
        solver.step(&model, &mut state, &inputs, DT).expect("a legal step");
        for (number, of) in model.bodies.iter().enumerate() {
            let x = &state.positions[of.vertices.clone()];
            let v = &state.velocities[of.vertices.clone()];
            let numbers = x.iter().chain(v).flat_map(|x| x.to_array()).map(S::to_f64);
            // What is no number has no bits that mean anything.
            let bits = numbers.map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() }).collect();
            let part = model.part_of(of.vertices.start as u32);
            let report = solver.part_reports().get(part).copied();
            tracks[number].push((bits, report.unwrap_or(NO_REPORT)));
        }
    }
    tracks
}

const NO_REPORT: StepReport =
    StepReport { potential: 0.0, limit: 0.0, noise: 0.0, rejected: false, kept_speed: 1.0 };

/// Reports go by their text: what is no number equals itself there.
fn assert_same(given: &Track, expected: &Track, what: &str) {
    for (step, ((bits, report), (alone, of_alone))) in given.iter().zip(expected).enumerate() {
        let differing = bits.iter().zip(alone).filter(|(a, b)| a != b).count();
        assert_eq!(differing, 0, "step {step}: numbers that differ from those alone; {what}");
        let (report, of_alone) = (format!("{report:?}"), format!("{of_alone:?}"));
        assert_eq!(report, of_alone, "step {step}, {what}");
    }
}

pub fn beam(fate: Fate) -> Body {
    let mesh = block([0.06, 0.02, 0.02], [4, 2, 2], 0.2);
    Body { mesh, tissue: material(SNH, 1e4, 0.45), fate }
}

pub fn neighbour(fate: Fate) -> Body {
    // Other places, other cells, the other law, more compressible.
    let mesh = block([0.05, 0.04, 0.03], [3, 3, 2], 0.1);
    Body { mesh, tissue: material(STVK, 1e4, 0.4), fate }
}

/// A row of tetrahedra: at most four at a vertex, so that few colours will do without copies.
pub fn strip(fate: Fate) -> Body {
    let place = |i: usize| {
        let turn = [vec3(0.0, 0.0, 0.0), vec3(0.0, 0.012, 0.0), vec3(0.0, 0.003, 0.012)][i % 3];
        turn + vec3(0.006 * i as f64, 0.0, 0.0)
    };
    let tets = (0..6).map(|i| [0, 1, 2, 3].map(|corner| i + corner));
    let right_way = |tet: [u32; 4]| {
        let [a, b, c, d] = tet.map(|v| place(v as usize));
        let [b_, c_, d_] = [b - a, c - a, d - a];
        if b_.cross(c_).dot(d_) > 0.0 { tet } else { [tet[1], tet[0], tet[2], tet[3]] }
    };
    let mesh = TetMesh::new((0..9).map(place).collect(), tets.map(right_way).collect(), vec![0; 6]);
    Body { mesh: mesh.expect("a strip").0, tissue: material(SNH, 1e4, 0.4), fate }
}

fn viscous(body: Body) -> Body {
    let tissue = body.tissue.with_viscosity(0.01).expect("legal");
    Body { tissue, ..body }
}

pub fn methods() -> Vec<(&'static str, SolverSettings)> {
    let plain_steps = SolverSettings::xpbd();
    let colored = |colors| SolverSettings { colors, ..SolverSettings::xpbd() };
    let anderson = |anderson_on, anderson_guard| SolverSettings {
        acceleration: Acceleration::Anderson,
        anderson_on,
        anderson_guard,
        iterations: Count::Of(6),
        ..SolverSettings::xpbd()
    };
    // Passes and pairs are chosen by Poisson's ratio: the two bodies have others.
    let quasi_newton = |integrator| SolverSettings {
        method: Method::QuasiNewton,
        integrator,
        ..SolverSettings::xpbd()
    };
    let chebyshev = |chebyshev_delay, chebyshev_damping| SolverSettings {
        acceleration: Acceleration::Chebyshev,
        chebyshev_delay,
        chebyshev_damping,
        iterations: Count::Of(5),
        ..SolverSettings::xpbd()
    };
    vec![
        ("coloured", plain_steps.clone()),
        ("Jacobi", colored(Colors::Limited(1))),
        ("4 colours", colored(Colors::Limited(4))),
        ("5 colours", colored(Colors::Limited(5))),
        ("clusters", SolverSettings { clusters: Clusters::OfTets(50), ..plain_steps.clone() }),
        ("Chebyshev", chebyshev(2, 0.8)),
        ("Chebyshev, 4 colours", {
            SolverSettings { colors: Colors::Limited(4), ..chebyshev(1, 1.0) }
        }),
        ("Anderson", anderson(AndersonOn::Both, AndersonGuard::Residual)),
        ("Anderson by energy", anderson(AndersonOn::Both, AndersonGuard::Energy)),
        ("Anderson on positions", anderson(AndersonOn::Positions, AndersonGuard::Residual)),
        ("Anderson on multipliers", anderson(AndersonOn::Multipliers, AndersonGuard::Residual)),
        ("published", plain(1, 6)),
        ("explicit", SolverSettings { method: Method::Explicit, ..plain_steps.clone() }),
        ("quasi-Newton", quasi_newton(Integrator::Sdirk2)),
        ("quasi-Newton, Euler", quasi_newton(Integrator::ImplicitEuler)),
    ]
}

pub const TROUBLES: [Fate; 3] = [Fate::Thrown, Fate::NoNumber, Fate::Overflow];

/// All bodies in one model, in this order and in the other, beside each of them alone.
fn same_as_alone<S: Real>(bodies: [&Body; 2], name: &str, settings: &SolverSettings) -> [Track; 2] {
    let alone = bodies.map(|body| run::<S>(&[body], settings, ONE).remove(0));
    for order in [[0, 1], [1, 0]] {
        let together = run::<S>(&order.map(|i| bodies[i]), settings, ONE);
        for (i, track) in order.into_iter().zip(&together) {
            let what = format!("{name}, {}, body {i} of {order:?}: {:?}", S::NAME, bodies[i].fate);
            assert_same(track, &alone[i], &what);
        }
    }
    alone
}

fn rejected(track: &Track) -> usize {
    track.iter().filter(|(_, report)| report.rejected).count()
}

/// A quiet body and one in trouble, by one method.
fn assert_trouble_stays<S: Real>((name, settings): &(&str, SolverSettings), fate: Fate) {
    let tracks = same_as_alone::<S>([&beam(Fate::Quiet), &neighbour(fate)], name, settings);
    let [quiet, troubled] = tracks.map(|track| rejected(&track));
    println!("{name}, {fate:?}, {}: {quiet} and {troubled} of {STEPS} taken back", S::NAME);
    if *settings == SolverSettings::xpbd() {
        assert!(quiet == 0 && troubled > 0, "{fate:?}: {quiet} and {troubled} taken back");
    }
}

/// A body of two materials behind one that is of its second: the model numbers materials in another order then, and the
/// body has the bits that it has alone.
#[test]
fn the_order_of_materials_in_a_model_does_not_matter_to_a_part() {
    let mesh = block([0.12, 0.04, 0.04], [8, 3, 3], 0.2);
    let is_far = |tet: &[u32; 4]| tet.iter().all(|&v| mesh.vertices()[v as usize].x > 0.05);
    let regions = mesh.tets().iter().map(|tet| u32::from(is_far(tet))).collect();
    let (mesh, _) = TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), regions)
        .expect("a mesh of two regions");
    let [near, far] = [1e4, 3e4].map(|young| material(SNH, young, 0.45));
    let end = |is_behind: bool| {
        let mut builder = ModelBuilder::new();
        if is_behind {
            builder.add_body(&block([0.02; 3], [2; 3], 0.0), &far).expect("a body");
        }
        let body = builder.add_body(&mesh, &near).expect("a body");
        builder.set_region_material(body, 1, &far).expect("its second region");
        let model: Model<f32> = builder.build().expect("a model");
        let own = model.bodies[body].vertices.clone();
        let mut inputs = Inputs { gravity: GRAVITY.cast(), ..Inputs::default() };
        for (v, x) in own.clone().zip(mesh.vertices()).filter(|(_, x)| x.x < 1e-9) {
            inputs.pins.push(Pin { vertex: v as u32, target: x.cast() });
        }
        let settings = SolverSettings { method: Method::QuasiNewton, ..SolverSettings::xpbd() };
        let mut solver = Solver::new(&model, &settings);
        let mut state = State::at_rest(&model);
        for _ in 0..4 {
            solver.step(&model, &mut state, &inputs, 1.0 / 60.0).expect("a legal step");
        }
        state.positions[own].to_vec()
    };
    assert!(end(false) == end(true));
}

/// Both bodies have the bits of a model of their own, by every method and in either order: the quiet one, and
/// the one in trouble as well.
#[test]
fn a_body_beside_one_in_trouble_has_the_bits_it_has_alone() {
    for (number, method) in methods().iter().enumerate() {
        assert_trouble_stays::<f32>(method, TROUBLES[number % 3]);
    }
    assert_trouble_stays::<f64>(&methods()[0], Fate::Thrown);
}

#[test]
#[ignore = "slow: every method, every trouble, both precisions"]
fn a_body_beside_one_in_trouble_has_the_bits_it_has_alone_at_length() {
    for method in &methods() {
        for fate in TROUBLES {
            assert_trouble_stays::<f32>(method, fate);
            assert_trouble_stays::<f64>(method, fate);
        }
    }
}

/// Other laws, viscosities, colours, copies, fixings.
fn assert_kinds_stay_apart((name, settings): &(&str, SolverSettings)) {
    let bar = beam(Fate::Quiet);
    let same_law = Body { tissue: material(SNH, 3e4, 0.3), ..neighbour(Fate::Thrown) };
    for (name_of_pair, bodies) in [
        ("viscous", [&viscous(bar.clone()), &neighbour(Fate::Thrown)]),
        ("beside viscous", [&bar, &viscous(same_law.clone())]),
        ("viscous beside", [&viscous(bar.clone()), &same_law]),
        ("strip", [&strip(Fate::Quiet), &same_law]),
        ("strip in trouble", [&strip(Fate::Thrown), &bar]),
        ("falling", [&beam(Fate::Falling), &neighbour(Fate::Thrown)]),
    ] {
        same_as_alone::<f32>(bodies, &format!("{name}, {name_of_pair}"), settings);
    }
}

/// What a law, a viscosity, more colours or copies of one body make of the model is not seen by another.
#[test]
fn a_body_beside_another_kind_has_the_bits_it_has_alone() {
    let chosen = [
        "coloured",
        "5 colours",
        "clusters",
        "Chebyshev, 4 colours",
        "Anderson",
        "explicit",
        "quasi-Newton",
    ];
    for method in methods().iter().filter(|(name, _)| chosen.contains(name)) {
        assert_kinds_stay_apart(method);
    }
}

#[test]
#[ignore = "slow: every method"]
fn a_body_beside_another_kind_has_the_bits_it_has_alone_at_length() {
    for method in &methods() {
        assert_kinds_stay_apart(method);
    }
}

/// The strip has no copies where its neighbour has some: the one lies in a split model, and is not.
#[test]
fn a_body_is_split_where_it_would_be_alone() {
    let settings = SolverSettings { colors: Colors::Limited(5), ..SolverSettings::xpbd() };
    let mut builder = ModelBuilder::new();
    strip(Fate::Quiet).add(&mut builder);
    neighbour(Fate::Quiet).add(&mut builder);
    let model = builder.build::<f32>().expect("a model");
    let layout = Layout::new(&model, &settings);
    let most = |body: usize| {
        let vertices = model.bodies[body].vertices.clone();
        vertices.map(|v| layout.copies_of(v as u32).len()).max()
    };
    assert_eq!(most(0), Some(1));
    assert!(most(1) > Some(1));
}

#[test]
fn threads_and_instructions_leave_every_bit_of_bodies_in_trouble() {
    for (name, settings) in methods() {
        let (quiet, troubled) = (beam(Fate::Quiet), viscous(neighbour(Fate::Thrown)));
        let bodies = [&troubled, &quiet];
        let expected = run::<f32>(&bodies, &settings, ONE);
        for workers in [(3, Instructions::Avx2), (1, Instructions::Portable)] {
            let given = run::<f32>(&bodies, &settings, workers);
            for (given, expected) in given.iter().zip(&expected) {
                assert_same(given, expected, &format!("{name}, {workers:?}"));
            }
        }
    }
}

/// How a step that was taken back has ended: at a share of what the sweeps moved from one of the starts, or
/// elsewhere, where descents led.
#[test]
fn a_thrown_body_is_led_back_by_shares_and_by_descents() {
    let settings = SolverSettings::xpbd();
    let body = neighbour(Fate::Thrown);
    let mut builder = ModelBuilder::new();
    body.add(&mut builder);
    let model = builder.build::<f64>().expect("a model");
    let mut run = Run::new(&model, &settings);
    let (mut shares, mut descents) = (0, 0);
    for step in 0..STEPS {
        let mut inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
        body.act(0, step, &mut inputs, &mut run.state.positions);
        let before = run.state.clone();
        let (mut start, mut swept) = (Vec::new(), Vec::new());
        let watch = |iteration: u32, x: &[Vec3<f64>]| {
            if iteration == 0 {
                start = x.to_vec();
            }
            swept = x.to_vec();
        };
        let Run { solver, state, .. } = &mut run;
        solver.step_watched(&model, state, &inputs, DT, watch).expect("a legal step");
        let report = run.solver.last_step().expect("a guarded step");
        if !report.rejected {
            continue;
        }
        let mut previous = before.positions.clone();
        let mut predicted: Vec<_> = (before.positions.iter().zip(&before.velocities))
            .map(|(x, v)| *x + *v * DT + GRAVITY * (DT * DT))
            .collect();
        for pin in &inputs.pins {
            previous[pin.vertex as usize] = pin.target;
            predicted[pin.vertex as usize] = pin.target;
        }
        let is_share = [&previous, &predicted, &start].into_iter().any(|start| {
            [0.5, 0.2, 0.08, 0.032].into_iter().any(|share| {
                let places = start.iter().zip(&swept).map(|(x, swept)| *x + (*swept - *x) * share);
                // Rounding of places of some centimetres.
                places.zip(&run.state.positions).all(|(a, b)| (a - *b).length() < 1e-14)
            })
        });
        shares += u32::from(is_share);
        descents += u32::from(!is_share);
    }
    println!("{shares} steps end at a share, {descents} where descents led");
    assert!(shares > 0 && descents > 0, "{shares} {descents}");
}

/// The report of a step is that of its worst part; a step counts as taken back once, for however many parts.
#[test]
fn the_report_of_a_step_speaks_for_every_part() {
    let settings = SolverSettings::xpbd();
    let bodies = [neighbour(Fate::Thrown), beam(Fate::Quiet), neighbour(Fate::Thrown)];
    let mut builder = ModelBuilder::new();
    bodies.iter().for_each(|body| body.add(&mut builder));
    let model = builder.build::<f64>().expect("a model");
    let mut run = Run::new(&model, &settings);
    assert_eq!((run.solver.last_step(), run.solver.part_reports().len()), (None, 0));
    let mut rejected = 0;
    for step in 0..STEPS {
        let mut inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
        for (body, of) in bodies.iter().zip(&model.bodies) {
            let x = &mut run.state.positions[of.vertices.clone()];
            body.act(of.vertices.start as u32, step, &mut inputs, x);
        }
        run.step(&inputs);
        let (all, parts) = (run.solver.last_step().expect("a step"), run.solver.part_reports());
        assert_eq!(parts.len(), 3);
        let above = |report: &StepReport| report.potential - report.limit - report.noise;
        assert!(parts.iter().all(|part| above(part) <= above(&all)), "{all:?} {parts:?}");
        assert_eq!(all.keeps_limit(), parts.iter().all(StepReport::keeps_limit));
        assert_eq!(all.rejected, parts.iter().any(|part| part.rejected));
        let least = parts.iter().map(|part| part.kept_speed).fold(1.0, f64::min);
        assert_eq!(all.kept_speed, least);
        rejected += u64::from(all.rejected);
    }
    assert!(rejected > 0 && run.solver.rejected_steps() == rejected);
}
