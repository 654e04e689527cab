//! The XPBD family: what each member converges to, and how fast.
//!
//! Measured step (the cantilever of a stiff bar from rest, one step of 1/60 s), error
//! `|x - x*|_M / |x_0 - x*|_M` with `x_0` the inertial prediction. `x*` is the converged iterate of
//! Gauss-Seidel for plain XPBD, and the zero of the force balance for the rebase.

use crate::common::{Run, SNH, STVK, block, exact, material, plain, single_body};
use viscera::elements::{deformation_gradient, green_strain};
use viscera::material::MaterialModel;
use viscera::mesh::TetMesh;
use viscera::model::Model;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Colors, Count, NeoHookean, RelaxationForm,
    SolverSettings, Start,
};
use viscera::solver::acceleration::Anderson;
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const FRAME: f64 = 1.0 / 60.0;
const JACOBI: Colors = Colors::Limited(1);
const ANY: Colors = Colors::Unlimited;

/// One step of a bar that is held at one end and starts to fall.
struct Cantilever {
    mesh: TetMesh,
    young: f64,
    inputs: Inputs<f64>,
}

impl Cantilever {
    fn new(cells: [usize; 3], young: f64, gravity: f64) -> Self {
        let mesh = block([0.2, 0.05, 0.05], cells, 0.2);
        let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -gravity), ..Inputs::default() };
        for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
            inputs.pins.push(Pin { vertex: v as u32, target: *x });
        }
        Self { mesh, young, inputs }
    }

    fn model(&self, tissue: MaterialModel) -> Model<f64> {
        single_body(&self.mesh, &material(tissue, self.young, 0.45))
    }

    /// The state after one step of a frame from rest, and the solver's force balance.
    fn step(&self, settings: &SolverSettings) -> (State<f64>, ForceBalance) {
        let model = self.model(STVK);
        let (mut state, mut balance) = (State::at_rest(&model), ForceBalance::default());
        let mut solver = Solver::new(&model, settings);
        solver.step(&model, &mut state, &self.inputs, FRAME).expect("a legal step");
        solver.force_balance(&model, &state, &self.inputs, &mut balance).expect("a balance");
        (state, balance)
    }

    fn solve(&self, settings: &SolverSettings) -> Vec<Vec3<f64>> {
        self.step(settings).0.positions
    }

    /// `|a - b|_M` [m kg^(1/2)].
    fn distance(&self, a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
        let masses = self.model(STVK).masses;
        let squares =
            a.iter().zip(b).zip(&masses).map(|((a, b), m)| m * (*a - *b).length_squared());
        squares.sum::<f64>().sqrt()
    }

    /// The inertial prediction, pins where they are held.
    fn predicted(&self) -> Vec<Vec3<f64>> {
        let fall = self.inputs.gravity * (FRAME * FRAME);
        let is_held = |x: &Vec3<f64>| x.x < 1e-9;
        self.mesh.vertices().iter().map(|x| if is_held(x) { *x } else { *x + fall }).collect()
    }

    /// Root of the volume-weighted mean of `|E|^2`.
    fn strain(&self, x: &[Vec3<f64>]) -> f64 {
        let model = self.model(STVK);
        let (mut sum, mut volume) = (0.0, 0.0);
        for tet in model.tets() {
            let corners = tet.vertices.map(|v| x[v as usize]);
            let f = deformation_gradient(&corners, &tet.inverse_rest_shape);
            let strain = green_strain::symmetric(&green_strain::strain(&f));
            // Shear stands doubled off the diagonal.
            let c = strain.columns;
            let diagonal = c[0].x * c[0].x + c[1].y * c[1].y + c[2].z * c[2].z;
            let shear = strain.norm_squared() - diagonal;
            sum += tet.rest_volume * (diagonal + 0.25 * shear);
            volume += tet.rest_volume;
        }
        (sum / volume).sqrt()
    }

    /// Sweeps after which the error falls below a tolerance: an iteration count `k` whose error is
    /// below it while that of `k - 1` is not. Found by doubling and bisection; where the error is
    /// not monotone, an earlier one may exist, so that the count is an upper bound.
    fn sweeps(
        &self,
        settings: &SolverSettings,
        reference: &[Vec3<f64>],
        tolerance: f64,
        most: u32,
    ) -> Option<u32> {
        let start = self.distance(&self.predicted(), reference);
        let is_there = |iterations: u32| {
            let x = self
                .solve(&SolverSettings { iterations: Count::Of(iterations), ..settings.clone() });
            self.distance(&x, reference) < tolerance * start
        };
        let mut high = 1;
        while !is_there(high) {
            if high >= most {
                return None;
            }
            high = (2 * high).min(most);
        }
        let mut low = high / 2;
        while high - low > 1 {
            let middle = (low + high) / 2;
            if is_there(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(high)
    }
}

fn anderson(window: u32, on: AndersonOn, settings: SolverSettings) -> SolverSettings {
    let acceleration = Acceleration::Anderson;
    SolverSettings { acceleration, anderson_window: window, anderson_on: on, ..settings }
}

fn chebyshev(radius: f64, settings: SolverSettings) -> SolverSettings {
    let acceleration = Acceleration::Chebyshev;
    SolverSettings { acceleration, chebyshev_radius: radius, ..settings }
}

/// The stiff bar: 540 tetrahedra.
fn stiff() -> Cantilever {
    Cantilever::new([10, 3, 3], 1e5, 9.81)
}

/// Over-relaxation, Chebyshev and Anderson in their order, counted in Jacobi sweeps to 1e-1.
#[test]
fn accelerations_save_sweeps() {
    let bar = stiff();
    let reference = bar.solve(&SolverSettings { colors: ANY, ..plain(1, 2000) });
    let earlier = bar.solve(&SolverSettings { colors: ANY, ..plain(1, 1000) });
    let start = bar.distance(&bar.predicted(), &reference);
    let unsettled = bar.distance(&earlier, &reference) / start;
    println!("{} tets; the reference still moves by {unsettled:.0e}", bar.mesh.tets().len());
    // A tenth of the tolerance to which sweeps are counted.
    assert!(unsettled < 1e-2, "the reference is not converged: {unsettled:e}");

    let jacobi = SolverSettings { colors: JACOBI, ..plain(1, 1) };
    let relaxed = |omega| SolverSettings { relaxation: omega, ..jacobi.clone() };
    let colored = |colors| SolverSettings { colors, ..jacobi.clone() };
    let mixed = |window, colors| anderson(window, AndersonOn::Both, colored(colors));
    let sweeps = [
        ("jacobi", jacobi.clone()),
        ("jacobi, omega 1.5", relaxed(1.5)),
        ("jacobi, chebyshev measured", chebyshev(0.0, jacobi.clone())),
        ("jacobi, chebyshev 0.99", chebyshev(0.99, jacobi.clone())),
        ("jacobi, anderson 1", mixed(1, JACOBI)),
        ("jacobi, anderson 5", mixed(5, JACOBI)),
        ("4 colors", colored(Colors::Limited(4))),
        ("4 colors, anderson 5", mixed(5, Colors::Limited(4))),
        ("gauss-seidel", colored(ANY)),
        ("gauss-seidel, anderson 5", mixed(5, ANY)),
    ]
    .map(|(name, settings)| {
        let count = bar.sweeps(&settings, &reference, 0.1, 1500);
        (name, count.unwrap_or_else(|| panic!("{name}: not within 1500 sweeps")))
    });
    for (name, count) in sweeps {
        let share = 100.0 * f64::from(count) / f64::from(sweeps[0].1);
        println!("{name:28} {count:4} sweeps to 1e-1: {share:5.1} % of jacobi");
    }
    let [jacobi, relaxed, measured, given, _, anderson, ..] = sweeps.map(|(_, count)| count);
    assert!(relaxed < jacobi, "over-relaxation");
    assert!(measured < relaxed && given < measured, "chebyshev: the slowest mode leaves 0.99");
    assert!(anderson <= jacobi / 10, "anderson");
}

/// Mixing positions without multipliers pushes the positions on as if more force had been applied
/// than the multipliers account for, and the body settles too stiff.
#[test]
fn anderson_on_positions_alone_stiffens_the_tissue() {
    let bar = stiff();
    let reference = bar.solve(&SolverSettings { colors: ANY, ..plain(1, 2000) });
    let jacobi = SolverSettings { colors: JACOBI, ..plain(1, 1) };
    let strain = bar.strain(&reference);
    let share = |on, iterations| {
        let settings =
            SolverSettings { iterations: Count::Of(iterations), ..anderson(5, on, jacobi.clone()) };
        bar.strain(&bar.solve(&settings)) / strain
    };
    for iterations in [100, 400] {
        let [positions, both] =
            [AndersonOn::Positions, AndersonOn::Both].map(|on| share(on, iterations));
        println!("{iterations} sweeps: strain {positions:.3} of the converged; both {both:.3}");
        assert!(positions < 0.95, "on positions alone: {positions}");
        // Where both are mixed, only path dependence is left: a few percent here.
        assert!((both - 1.0).abs() < 0.05, "on both: {both}");
    }
}

/// In a linear body `M (x - xt) = J^T l` holds for the consistent form, and with `omega J^T l` for
/// the published one: it solves another material, `omega` times as stiff.
#[test]
fn the_published_over_relaxation_multiplies_the_stiffness() {
    let omega = 1.5;
    // Strains, and with them all that is not linear, are this much below those under weight.
    let lightness = 1e-5;
    let soft = Cantilever::new([6, 2, 2], 1e4, 9.81 * lightness);
    let stiff = Cantilever::new([6, 2, 2], omega * 1e4, 9.81 * lightness);
    let settings = SolverSettings { colors: JACOBI, ..plain(1, 4000) };
    let relaxed =
        |form| SolverSettings { relaxation: omega, relaxation_form: form, ..settings.clone() };
    let plain_answer = soft.solve(&settings);
    let consistent = soft.solve(&relaxed(RelaxationForm::Consistent));
    let published = soft.solve(&relaxed(RelaxationForm::Published));
    let stiffer = stiff.solve(&settings);
    let size = soft.distance(&soft.predicted(), &plain_answer);
    let [same, other, claim] = [
        soft.distance(&consistent, &plain_answer) / size,
        soft.distance(&published, &plain_answer) / size,
        soft.distance(&published, &stiffer) / size,
    ];
    println!("from omega 1: consistent {same:.1e}, published {other:.1e}");
    println!("published, from a body {omega} times as stiff: {claim:.1e}");
    // Strains below 1e-6 leave path differences of their size.
    assert!(same < 1e-4, "the consistent form changed the answer by {same:e}");
    assert!(claim < 1e-4, "the published form is off by {claim:e}");
    assert!(other > 100.0 * same.max(claim), "{other:e}");
}

/// With the rebase the order of the constraints is no longer part of the answer.
#[test]
fn the_rebase_makes_the_answer_independent_of_colors() {
    let bar = Cantilever::new([6, 2, 2], 1e4, 9.81);
    let all = [ANY, Colors::Limited(4), JACOBI];
    let solve = |settings: SolverSettings| {
        all.map(|colors| bar.step(&SolverSettings { colors, ..settings.clone() }))
    };
    let rebase = solve(exact(3000));
    let plain_answers = solve(plain(1, 3000));
    let size = bar.distance(&bar.predicted(), &rebase[0].0.positions);
    for (i, colors) in all.into_iter().enumerate() {
        let from_first = |answers: &[(State<f64>, ForceBalance); 3]| {
            bar.distance(&answers[i].0.positions, &answers[0].0.positions) / size
        };
        let (exact, path) = (from_first(&rebase), from_first(&plain_answers));
        let residual = rebase[i].1.relative_residual();
        println!(
            "{colors:?}: {exact:.1e} from unlimited with the rebase, whose residual is \
             {residual:.1e}; plain {path:.1e}, {:.1e} from the exact answer",
            bar.distance(&plain_answers[i].0.positions, &rebase[0].0.positions) / size
        );
        assert!(residual < 1e-6, "{colors:?}: forces do not balance: {residual:e}");
        assert!(exact < 1e-6, "{colors:?}: {exact:e}");
        if i > 0 {
            assert!(path > 1e-4, "{colors:?}: plain XPBD should depend on the path: {path:e}");
        }
    }
}

/// Height of the tip of a settled cantilever [m], the mean over its end.
fn settled_tip(run: &mut Run<'_, f64>, bar: &Cantilever, frames: u32) -> f64 {
    for _ in 0..frames {
        run.frame(&bar.inputs, 0.8);
    }
    let end = bar.mesh.vertices().iter().zip(&run.state.positions);
    let drops: Vec<f64> =
        end.filter(|(rest, _)| rest.x > 0.2 - 1e-9).map(|(rest, x)| x.z - rest.z).collect();
    drops.iter().sum::<f64>() / drops.len() as f64
}

/// Frames until the tip moves by less than 1e-8 of its drop per frame for ten frames, and its drop.
fn settle(run: &mut Run<'_, f64>, bar: &Cantilever) -> (u32, f64) {
    let (mut tip, mut quiet, mut frames) = (0.0, 0, 0);
    while quiet < 10 && frames < 6000 {
        let last = std::mem::replace(&mut tip, settled_tip(run, bar, 1));
        quiet = if (tip - last).abs() < 1e-8 * tip.abs() { quiet + 1 } else { 0 };
        frames += 1;
    }
    (frames, tip)
}

/// How fast a body settles may depend on substeps and iterations; where, may not.
#[test]
fn stiffness_does_not_depend_on_substeps_or_iterations() {
    let bar = Cantilever::new([4, 1, 1], 1e5, 9.81);
    for tissue in [STVK, SNH] {
        let model = bar.model(tissue);
        let mut tips = Vec::new();
        for (substeps, iterations) in [(4, 5), (1, 20), (1, 2), (10, 2)] {
            let settings = SolverSettings {
                substeps: Count::Of(substeps),
                iterations: Count::Of(iterations),
                ..SolverSettings::xpbd()
            };
            let mut run = Run::new(&model, &settings);
            let (frames, tip) = settle(&mut run, &bar);
            println!("{tissue:?} {substeps} x {iterations}: tip {tip:.9} m after {frames} frames");
            tips.push(tip);
        }
        for tip in &tips {
            assert!((tip / tips[0] - 1.0).abs() < 1e-4, "{tissue:?}: {tips:?}");
        }
    }
}

/// Stiff, nearly incompressible tissue at four substeps of five sweeps: unguarded sweeps throw it
/// about; the guard takes back what raises the incremental potential, keeps the multipliers and limits
/// the energy, so that it comes to the rest of a large budget. A guard that froze the body would fail.
#[test]
fn the_step_guard_settles_stiff_tissue_where_a_large_budget_does() {
    // In cells of 20 mm as hard for a sweep as 50 kPa in cells of 6 mm.
    let bar = Cantilever::new([8, 3, 3], 5e5, 9.81);
    let tissue = material(SNH, 5e5, 0.49);
    let rest = |settings: SolverSettings| {
        let model = single_body(&bar.mesh, &tissue);
        let mut run = Run::new(&model, &settings);
        let tip = settled_tip(&mut run, &bar, 180);
        (tip, run.solver.rejected_steps() as f64 / f64::from(180 * settings.substeps()))
    };
    let few = SolverSettings { substeps: Count::Of(4), ..exact(5) };
    let ((truth, _), (guarded, rejected)) = (rest(exact(20)), rest(few.clone()));
    let (free, _) = rest(SolverSettings { step_guard: false, ..few });
    println!(
        "4 x 5 sweeps a frame come to {:.6} of the rest of 20, {:.0} % of steps taken back; unguarded to \
         {:.2}",
        guarded / truth,
        100.0 * rejected,
        free / truth
    );
    // One fixed point, from which 180 frames leave less than this of the damped motion.
    assert!((guarded / truth - 1.0).abs() < 1e-3, "{guarded} against {truth}");
    assert!(rejected < 0.5, "the guard holds the body: {rejected}");
    let differs = free.is_nan() || (free / truth - 1.0).abs() > 1e-2;
    assert!(differs, "the guard makes no difference");
}

/// Multipliers are forces times the squared step. A settled body needs the same forces for a step
/// half as long, so that it stays where it is; without the factor 1/4 it would be torn up.
#[test]
fn a_settled_body_stays_settled_when_the_step_is_halved() {
    let bar = Cantilever::new([6, 2, 2], 1e5, 9.81);
    for tissue in [STVK, SNH] {
        let model = bar.model(tissue);
        let mut run = Run::new(&model, &exact(20));
        let (_, tip) = settle(&mut run, &bar);
        let settled = run.state.clone();
        let step = |dt: f64, rescaled: bool| {
            let mut state = settled.clone();
            if !rescaled {
                state.multiplier_dt = dt;
            }
            // The guard would take a torn step back.
            let settings = SolverSettings { step_guard: false, ..exact(20) };
            let mut solver = Solver::new(&model, &settings);
            solver.step(&model, &mut state, &bar.inputs, dt).expect("a legal step");
            let pairs = state.positions.iter().zip(&settled.positions);
            pairs.fold(0.0f64, |worst, (a, b)| worst.max((*a - *b).length())) / tip.abs()
        };
        let (same, half) = (step(FRAME, true), step(0.5 * FRAME, true));
        let torn = step(0.5 * FRAME, false);
        println!(
            "{tissue:?}: moves {same:.0e} of the tip's drop, halved {half:.0e}; not rescaled {torn:.0e}"
        );
        // Half a step corrects no more of what is left than a whole one, to a few roundings of
        // positions. Forces four times too large do more.
        let round_off = 64.0 * f64::EPSILON * 0.2 / tip.abs();
        assert!(half < 2.0 * same + round_off, "{tissue:?}: {half:e} against {same:e}");
        assert!(torn > 100.0 * half, "{tissue:?}: the rescaling makes no difference");
    }
}

/// A residual that grows says that the history misleads: with the guard it is dropped, and the next
/// iterate is the plain sweep.
#[test]
fn the_residual_guard_restarts_the_history() {
    for guard in [false, true] {
        let mut history = Anderson::<f64>::new(3, 1);
        history.start();
        for (mapped, residual) in [(1.0, 0.5), (1.25, 0.25), (2.0, 0.75)] {
            let (g, r) = history.push();
            (g[0], r[0]) = (mapped, residual);
            let (weights, count) = history.mixing_weights(&[1.0], guard);
            let mut mixed = [0.0];
            history.mix(&weights[..count], 0, &mut mixed);
            let [mixed] = mixed;
            if residual == 0.75 {
                assert_eq!(count, if guard { 0 } else { 2 });
                assert_eq!(mixed == 2.0, guard, "{mixed}");
            }
        }
    }

    // In a step it acts where strong deformation makes the residual grow: here Jacobi sweeps with
    // the rebase, on a bar that is pulled to one and a half times its length at once.
    let mut bar = Cantilever::new([6, 2, 2], 1e4, 9.81);
    for (v, x) in bar.mesh.vertices().iter().enumerate().filter(|(_, x)| x.x > 0.2 - 1e-9) {
        let target = *x + vec3(0.1, 0.0, 0.05);
        bar.inputs.pins.push(Pin { vertex: v as u32, target });
    }
    let step = |anderson_guard| {
        let settings = anderson(5, AndersonOn::Both, exact(60));
        bar.step(&SolverSettings { colors: JACOBI, anderson_guard, ..settings })
    };
    let ((with, guarded), (without, unguarded)) =
        (step(AndersonGuard::Residual), step(AndersonGuard::None));
    let residuals = [guarded, unguarded].map(|balance| balance.relative_residual());
    println!("unbalanced forces with the guard {:.1e}, without {:.1e}", residuals[0], residuals[1]);
    assert_ne!(with.positions, without.positions, "the guard never acted");
}

fn every_setting() -> Vec<SolverSettings> {
    let mut all = Vec::new();
    for (rebase, keep_multipliers) in [(true, true), (true, false), (false, true), (false, false)] {
        for start in [Start::Auto, Start::Predicted, Start::Inertial, Start::Previous] {
            for relaxation_form in [RelaxationForm::Consistent, RelaxationForm::Published] {
                let relaxation = if rebase { 1.0 } else { 1.3 };
                let base = SolverSettings {
                    rebase,
                    keep_multipliers,
                    start,
                    relaxation,
                    relaxation_form,
                    substeps: Count::Of(2),
                    iterations: Count::Of(8),
                    chebyshev_delay: 2,
                    chebyshev_damping: 0.8,
                    ..SolverSettings::xpbd()
                };
                for on in [AndersonOn::Positions, AndersonOn::Multipliers, AndersonOn::Both] {
                    all.push(anderson(3, on, base.clone()));
                }
                all.push(chebyshev(0.0, base.clone()));
                all.push(chebyshev(0.9, base.clone()));
                all.push(base);
            }
        }
    }
    all
}

/// Cells are an eighth of a metre, so that single precision computes `F = I` exactly; Green strain
/// and Biot stress are then zero to the bit. (The neo-Hookean pair balances two stresses of size mu
/// and keeps rest to round-off only.)
#[test]
fn a_body_at_rest_without_load_stays_to_the_bit() {
    fn check<S: Real>() {
        let mesh = block([0.25, 0.25, 0.125], [2, 2, 1], 0.0);
        for (colors, tissue) in
            [ANY, Colors::Limited(4), JACOBI].into_iter().flat_map(|c| [(c, STVK), (c, SNH)])
        {
            let neo_hookean = NeoHookean::Stretch;
            let tissue = material(tissue, 1e4, 0.4).with_viscosity(0.1).expect("legal");
            for settings in every_setting() {
                let settings = SolverSettings { colors, neo_hookean, ..settings };
                let model = single_body::<S>(&mesh, &tissue);
                let mut run = Run::new(&model, &settings);
                for _ in 0..2 {
                    run.frame(&Inputs::default(), 1.0);
                }
                assert_eq!(run.state.positions, model.rest_positions, "{} {settings:?}", S::NAME);
                assert!(run.state.velocities.iter().all(|v| *v == Vec3::ZERO), "{settings:?}");
            }
        }
    }
    check::<f32>();
    check::<f64>();
}
