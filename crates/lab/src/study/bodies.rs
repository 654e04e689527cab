//! Figures 2 and 3: a bar whose end is jerked round within one step, after 40 iterations of each method.

use anyhow::{Context as _, Result};
use viscera::material::MaterialModel;
use viscera::scalar::Vec3;
use viscera::settings::{AndersonOn, Colors, Count, RelaxationForm, SolverSettings};
use viscera::state::State;

use super::convergence::in_data;
use super::device;
use super::methods::{COLORED, JACOBI, NamedSettings, anderson, chebyshev, published, relaxed};
use super::panels::{self, Panel};
use super::step::{Cost, MeasuredStep};
use super::{Context, Section};
use crate::load_cases::{LoadCase, Size};
use viscera_reference::Reference;
use viscera_report::{Table, percent, si};

pub(super) const COLORS: Section = Section {
    name: "bodies",
    title: "2. The same body with and without colours",
    cases: |_, _| colors().len(),
    run: run_colors,
};

pub(super) const ACCELERATIONS: Section = Section {
    name: "accelerated-bodies",
    title: "3. The same body with each acceleration",
    cases: |_, _| accelerations(JACOBI).len() + accelerations(COLORED).len(),
    run: run_accelerations,
};

const ITERATIONS: u32 = 40;
/// [Pa].
const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.45;
/// Frames of the usual twist that are done in one: half of it.
const HURRIED: u32 = 2;
/// Over-relaxation of one colour, and of many.
const OMEGA: [f64; 2] = [1.8, 1.2];
/// The name of the method that has its own truth.
const SMALL_STEPS: &str = "40 small steps";

fn colors() -> Vec<NamedSettings> {
    let limited = |count| published(Colors::Limited(count));
    vec![
        NamedSettings::new("Jacobi", published(JACOBI)),
        NamedSettings::new("clique, 4 colours", limited(4)),
        NamedSettings::new("clique, 8 colours", limited(8)),
        NamedSettings::new("coloured", published(COLORED)),
    ]
}

fn accelerations(order: Colors) -> Vec<NamedSettings> {
    let plain = published(order);
    let omega = if order == JACOBI { OMEGA[0] } else { OMEGA[1] };
    let relaxed = |form| relaxed(plain.clone(), omega, form);
    vec![
        NamedSettings::new("plain", plain.clone()),
        NamedSettings::new("over-relaxed, published", relaxed(RelaxationForm::Published)),
        NamedSettings::new("over-relaxed, consistent", relaxed(RelaxationForm::Consistent)),
        NamedSettings::new("Chebyshev", chebyshev(plain.clone(), 0.0)),
        NamedSettings::new("Anderson", anderson(plain.clone(), AndersonOn::Both)),
        NamedSettings::new(
            SMALL_STEPS,
            SolverSettings { substeps: Count::Of(ITERATIONS), ..plain.clone() },
        ),
    ]
}

/// All have as many sweeps: small steps have one each.
fn scheduled(mut method: NamedSettings) -> NamedSettings {
    method.settings.iterations = Count::Of(ITERATIONS / method.settings.substeps());
    method
}

fn step(context: &Context) -> Result<MeasuredStep> {
    let size = if context.quick { Size::Tiny } else { Size::Large };
    let tissue = context.changes.tissue(MaterialModel::SaintVenantKirchhoff, YOUNG, POISSON)?;
    let load_case = context.changes.load_case("twist", size, tissue)?;
    MeasuredStep::new(LoadCase { path_frames: HURRIED, ..load_case }, 0)
}

/// The exact end [m] of a frame of so many small steps.
fn exact_small_steps(step: &MeasuredStep, count: u32) -> Result<Vec<Vec3<f64>>> {
    let model = step.load_case.model::<f64>()?;
    let mut reference = Reference::new(&model);
    let mut state = State::at_rest(&model);
    for small in 1..=count {
        let inputs = step.load_case.inputs(f64::from(small) / f64::from(count));
        reference
            .step(&mut state, &inputs, step.dt / f64::from(count))
            .with_context(|| format!("the reference of small step {small}"))?;
    }
    Ok(state.positions)
}

/// What became of a body.
struct Body {
    method: NamedSettings,
    double: Vec<Vec3<f64>>,
    /// In single precision by the CPU, and by the GPU where there is one.
    single: Vec<Vec3<f64>>,
    device: Option<Vec<Vec3<f64>>>,
}

fn bodies(
    context: &Context,
    step: &MeasuredStep,
    methods: Vec<NamedSettings>,
) -> Result<Vec<Body>> {
    let ends = context.run_cases(&methods, |method| {
        Ok((step.end::<f64>(&method.settings)?, step.end::<f32>(&method.settings)?))
    })?;
    let mut bodies = Vec::new();
    for (method, (double, single)) in methods.into_iter().zip(ends) {
        let end = |device| device::end(device, step, &method.settings);
        let device = device::device().map(end).transpose()?;
        bodies.push(Body { method, double, single, device });
    }
    Ok(bodies)
}

/// Draws the bodies and writes their tables; the exact end of small steps stands in for theirs.
fn show(
    context: &mut Context,
    name: &str,
    step: &MeasuredStep,
    bodies: &[Body],
    small: &[Vec3<f64>],
    see: &str,
) -> Result<()> {
    let mut table = Table::new([
        "method",
        "iterations",
        "passes",
        "ms",
        "error",
        "strain ratio",
        "GPU: error",
        "GPU from CPU",
        "rounding",
    ]);
    let mut data =
        Table::new(["method", "iterations", "passes", "error", "strain_ratio", "gpu_error"]);
    let mut panels = Vec::new();
    for Body { method, double, single, device } in bodies {
        let Cost { passes, seconds } = step.frame_cost(&method.settings)?;
        let truth = if method.name == SMALL_STEPS { small } else { &step.exact };
        let error = step.distance(double, truth);
        let strain = step.strain_over(double, truth)?;
        let of_device =
            |other: &[Vec3<f64>]| device.as_ref().map(|there| step.distance(there, other));
        let or_none = |value: Option<f64>| value.map_or("-".to_owned(), percent);
        table.row([
            method.name.clone(),
            ITERATIONS.to_string(),
            passes.to_string(),
            format!("{:.1}", 1e3 * seconds),
            percent(error),
            format!("{strain:.3}"),
            or_none(of_device(truth)),
            or_none(of_device(single)),
            percent(step.distance(single, double)),
        ]);
        data.row([
            method.name.clone(),
            ITERATIONS.to_string(),
            passes.to_string(),
            in_data(error),
            format!("{strain:.6}"),
            of_device(truth).map_or(String::new(), in_data),
        ]);
        let caption = format!("{ITERATIONS} iterations, {passes} passes, error {}", percent(error));
        panels.push(Panel {
            title: method.name.clone(),
            caption,
            positions: double.clone(),
            truth: truth.to_vec(),
        });
    }
    let image = panels::draw(&step.load_case, &panels, if panels.len() > 4 { 3 } else { 2 })?;
    let words =
        format!("{} bars after one step, each with the true one as an outline", panels.len());
    let see = format!(
        "{see} The thin outline is the true end of the step, colours tell the distance from it."
    );
    context.picture(name, &words, &image, &see)?;
    context.document.table(&table);
    context.document.data(name, "All numbers", &data)?;
    judge(context, name, step, bodies);
    Ok(())
}

/// Devices agree to round-off: two results in single precision, each with errors of its own, differ by at
/// most the sum of them; where a method magnifies round-off the two take different ways.
fn judge(context: &mut Context, name: &str, step: &MeasuredStep, bodies: &[Body]) {
    let mut worst = 0.0f64;
    for Body { double, single, device, .. } in bodies {
        let Some(there) = device else { return };
        let ratio = step.distance(there, double) / step.distance(single, double);
        // Where a result is no number, so is the ratio, and it must not count as small.
        worst = worst.max(if ratio.is_finite() { ratio } else { f64::INFINITY });
    }
    context.verdict(
        format!("{name}: GPU's distance from double precision over the CPU's"),
        "at most 2",
        format!("{worst:.2}"),
        worst <= 2.0,
    );
}

fn introduce(context: &mut Context, step: &MeasuredStep) {
    let load_case = &step.load_case;
    let moved = load_case.driven.iter().map(|&v| {
        let x = load_case.mesh.vertices()[v as usize];
        (load_case.path.at(x, 1.0 / f64::from(HURRIED)) - x).length()
    });
    context.document.paragraph(format!(
        "A bar of {} tetrahedra, Green strain (Saint Venant-Kirchhoff), E = {}, nu = {}, is held at its left \
         end and at rest; within one step of 1/60 s its right end is turned by 30 degrees and pulled, so \
         that its corners move by {}. Every method has {ITERATIONS} iterations, and multipliers from zero, \
         as published. *Error*: distance from the exact end of the step over that of the inertial \
         prediction, both in the norm of the masses. *Strain ratio*: root mean square Green strain over \
         the true one. *Passes*: passes over the mesh that must wait for each other, which is what an \
         iteration costs on a GPU, with those around the iterations; *ms*: the whole frame on one thread of the \
         processor. *GPU from CPU*: distance of the two \
         in single precision; *rounding*: of the CPU in single precision from double. {}",
        load_case.mesh.tets().len(),
        si(load_case.tissue.young(), "Pa"),
        load_case.tissue.poisson(),
        si(moved.fold(0.0, f64::max), "m"),
        device::describe(),
    ));
}

fn run_colors(context: &mut Context) -> Result<()> {
    let step = step(context)?;
    introduce(context, &step);
    let methods = colors().into_iter().map(scheduled).collect();
    let bodies = bodies(context, &step, methods)?;
    let see = "Look how far the pull has come into the bar: its ends know of each other only through the \
               sweeps between them, and vertices that are split into many copies move by the mean of what \
               their copies want.";
    show(context, "bodies-colors", &step, &bodies, &step.exact, see)?;
    context.document.paragraph(
        "Colours make an iteration worth more, and cost more passes where all tetrahedra could be done at \
         once. Section 1 has whole curves, over both.",
    );
    Ok(())
}

fn run_accelerations(context: &mut Context) -> Result<()> {
    let step = step(context)?;
    introduce(context, &step);
    context.document.paragraph(format!(
        "*Over-relaxed*: by {} with one colour and {} with many. The published form scales the displacement \
         and not the multiplier, which changes the stiffness it converges to by as much; the consistent one \
         scales both. *Chebyshev*: Wang 2015, with the spectral radius measured in the first ten iterations. \
         *Anderson*: window 5, on positions and multipliers. *Small steps*: the frame in {ITERATIONS} steps of \
         one iteration each, as many sweeps; the rival of every acceleration (Macklin et al. 2019). On a processor they cost the same; on a GPU every step adds the passes around its iteration. They \
         solve another problem: the end is turned gradually, waves run through the bar, and little motion \
         is lost to damping. Their outline and their error are those of the exact solution of the same \
         small steps, and so is their strain ratio.",
        OMEGA[0], OMEGA[1]
    ));
    let small = exact_small_steps(&step, ITERATIONS)?;
    let jacobi = "Compare how far the pull has come with that of the plain sweeps: over-relaxation and \
                  Chebyshev hurry each sweep, Anderson goes along all of them at once.";
    let colored = "Where the pull has come through the whole bar, what is left is the error of the method: \
                   of a stiffness that over-relaxation has changed, or of the path that has led there.";
    for (order, name, title, see) in [
        (JACOBI, "bodies-jacobi", "One colour (Jacobi)", jacobi),
        (COLORED, "bodies-colored", "All colours", colored),
    ] {
        context.document.subheading(title);
        let methods = accelerations(order).into_iter().map(scheduled).collect();
        let bodies = bodies(context, &step, methods)?;
        show(context, name, &step, &bodies, &small, see)?;
    }
    Ok(())
}
