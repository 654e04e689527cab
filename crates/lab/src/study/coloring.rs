//! Figure 1: convergence with and without colours.

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::Colors;

use super::convergence::{
    COST_AND_DEVICE_CASES, Figure, Followed, Reach, follow_on_both, judge_device, table,
};
use super::methods::{COLORED, JACOBI, NamedSettings, published};
use super::step::MeasuredStep;
use super::{Context, Section, device};
use crate::load_cases::Size;

pub(super) const SECTION: Section = Section {
    name: "coloring",
    title: "1. Convergence with and without colours",
    cases: |quick, _| case_count(quick),
    run,
};

/// The stiff bar at the moment at which gravity sets in: all of published XPBD comes near its end.
pub(super) fn bar_from_rest(context: &Context, size: Size) -> Result<MeasuredStep> {
    let tissue = context.changes.tissue(MaterialModel::SaintVenantKirchhoff, 1e5, 0.45)?;
    MeasuredStep::new(context.changes.load_case("cantilever", size, tissue)?, 0)
}

/// From one colour to as many as it takes, with fewer iterations where fewer suffice.
fn methods(quick: bool) -> Vec<NamedSettings> {
    let method = |name: &str, colors, iterations| {
        let iterations = if quick { iterations / 20 } else { iterations };
        NamedSettings::new(name, published(colors)).with_iterations(iterations)
    };
    vec![
        method("Jacobi (1 colour)", JACOBI, 6000),
        method("2 colours", Colors::Limited(2), 6000),
        method("4 colours", Colors::Limited(4), 4000),
        method("8 colours", Colors::Limited(8), 4000),
        method("16 colours", Colors::Limited(16), 4000),
        method("coloured (no limit)", COLORED, 4000),
    ]
}

fn case_count(quick: bool) -> usize {
    methods(quick).len() + COST_AND_DEVICE_CASES
}

fn run(context: &mut Context) -> Result<()> {
    let size = if context.quick { Size::Tiny } else { Size::Large };
    let step = bar_from_rest(context, size)?;
    introduce(context, &step);
    let followed = follow_on_both(context, &step, methods(context.quick))?;
    let mut figure = Figure::new("Published XPBD");
    followed.iter().for_each(|method| figure.add(method));
    figure.show(
        context,
        "coloring",
        [
            "Compare curves from one colour to all: neighbours that see each other's results within an \
             iteration need fewer of them. Where a curve bends level, the iteration comes to an answer of \
             its own.",
            "The same curves over the passes that have to wait for each other, which is what a parallel \
             machine pays for: look whether they still keep apart, or whether a further colour costs as \
             much as it gains.",
        ],
    )?;
    context.document.table(&table(&followed, &[1e-1, 1e-2]));
    conclude(context, &followed);
    judge_device(context, "figure 1", &followed);
    Ok(())
}

fn introduce(context: &mut Context, step: &MeasuredStep) {
    context.document.paragraph(format!(
        "A step of implicit Euler minimises `Phi(x) = 1/2 |x - xt|_M^2 + h^2 Psi(x)`, where \
         `xt = x + h v + h^2 g` is where the vertices would go by inertia and `Psi` is the elastic \
         energy. An iterative solver starts at `xt`; what is measured after each of its iterations is \
         `|x - x*|_M / |xt - x*|_M`, the distance from the minimum `x*`, which Newton's method gives to \
         round-off, in the norm of the masses. The scene: {}, Green strain; gravity sets in, and one \
         step of 1/60 s is made. All methods here are XPBD as published (Macklin et al. 2016), with the \
         six strains of a tetrahedron as one block: multipliers start from zero in every step.",
        step.load_case
    ));
    context.document.paragraph(
        "Tetrahedra that share a vertex must not be solved at the same time. Colouring sorts them into \
         groups that share none, one pass each: Gauss-Seidel, in which later groups see what earlier \
         ones did. With fewer colours than that takes, vertices are copied (clique separation, \
         Fratarcangeli and Pellacini 2015), a vertex of k copies gives each k times its inverse mass, \
         and after the sweep they are averaged; with one colour every tetrahedron has copies of its own: \
         Jacobi. A pass is a round over the mesh that has to wait for the one before: a dispatch of the \
         GPU backend. Milliseconds are of one thread in single precision on the machine that made this.",
    );
}

/// What the numbers say, in words that hold for any of them.
fn conclude(context: &mut Context, followed: &[Followed]) {
    let [first, .., last] = followed else { return };
    let (jacobi, colored) = (Reach::of(&first.curve, 0.1), Reach::of(&last.curve, 0.1));
    let passes: Vec<usize> = followed
        .iter()
        .filter_map(|method| Some(method.curve.first_below(0.1)? * method.cost.passes))
        .collect();
    if let (Some(fewest), Some(most)) = (passes.iter().min(), passes.iter().max()) {
        context.document.paragraph(format!(
            "{} of {} come to a tenth of the starting error, after {fewest} to {most} passes.",
            passes.len(),
            followed.len()
        ));
    }
    context.document.paragraph(format!(
        "Iterations to a tenth of the starting error: Jacobi {jacobi}, of {} passes each; coloured sweeps \
         {colored}, of {}. Percentages are shares of Jacobi's. Iterations alone flatter colours, \
         passes alone flatter copies, and milliseconds are of a processor that does not care for \
         passes: that is why the three stand side by side. {}; markers are errors after 1, 2, 5, 10, ... \
         iterations in single precision, lines are of double precision.",
        first.cost.passes,
        last.cost.passes,
        device::describe()
    ));
    let ends: Vec<String> = followed
        .iter()
        .map(|Followed { method, curve, .. }| format!("{} {:.4}", method.name, curve.least()))
        .collect();
    context.document.paragraph(format!(
        "The smallest errors are {}. With more iterations those that still fall come to stand as well, \
         because a fixed point of published XPBD satisfies `C + a~ l = 0` but not `M (x - xt) = J(x)^T l`: `x` is the sum \
         of `M^-1 J(x_k)^T dl_k` with the gradients of all the places it came through. What it comes to \
         depends on the path, and so on the colours; section 4 shows it, and what to do about it.",
        ends.join(", ")
    ));
}
