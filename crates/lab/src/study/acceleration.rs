//! Figure 4: what accelerations converge to.

use anyhow::Result;
use viscera::settings::{AndersonOn, RelaxationForm, SolverSettings};
use viscera_report::percent;

use super::coloring::bar_from_rest;
use super::convergence::{
    COST_AND_DEVICE_CASES, Figure, Followed, Reach, follow_on_both, in_words, judge_device, table,
};
use super::methods::{
    COLORED, JACOBI, NamedSettings, anderson, chebyshev, exact, published, relaxed,
};
use super::{Context, Section, artefact, multipliers};
use crate::load_cases::Size;

pub(super) const SECTION: Section = Section {
    name: "acceleration",
    title: "4. What accelerations converge to",
    cases: |quick, _| case_count(quick),
    run,
};

/// Asked of the iterations of Anderson on both over Jacobi, as a share of plain Jacobi's.
const ASKED: f64 = 0.05;

/// What the claim is about, and what it is compared with.
const ON_BOTH: &str = "Jacobi, Anderson on both";
const COLORED_ON_BOTH: &str = "coloured, Anderson on both";
const EXACT_ON_BOTH: &str = "exact form, Anderson on both";

/// The accelerations of one kind of sweep; `omega` is what it bears.
fn family(name: &str, plain: &SolverSettings, omega: f64) -> Vec<NamedSettings> {
    let method = |what: &str, settings| NamedSettings::new(format!("{name}, {what}"), settings);
    let relax = |form| relaxed(plain.clone(), omega, form);
    let mix = |on| anderson(plain.clone(), on);
    vec![
        NamedSettings::new(name, plain.clone()),
        method(&format!("omega {omega} consistent"), relax(RelaxationForm::Consistent)),
        method(&format!("omega {omega} published"), relax(RelaxationForm::Published)),
        method("Chebyshev measured", chebyshev(plain.clone(), 0.0)),
        method("Anderson on both", mix(AndersonOn::Both)),
        method("Anderson on positions", mix(AndersonOn::Positions)),
        method("Anderson on multipliers", mix(AndersonOn::Multipliers)),
    ]
}

/// Over Jacobi sweeps: the plain ones take the most iterations by far.
fn jacobi_methods(quick: bool) -> Vec<NamedSettings> {
    let mut methods = family("Jacobi", &published(JACOBI), 1.5);
    // Tuned by hand on this scene; nobody knows it beforehand.
    let tuned = chebyshev(published(JACOBI), 0.997);
    methods.insert(4, NamedSettings::new("Jacobi, Chebyshev 0.997", tuned));
    with_iterations(methods, if quick { 300 } else { 3000 })
}

/// Over coloured sweeps, and the exact form of them.
fn colored_methods(quick: bool) -> Vec<NamedSettings> {
    let mut methods = family("coloured", &published(COLORED), 1.2);
    let exact = exact(COLORED);
    let mixed = anderson(exact.clone(), AndersonOn::Both);
    // Before the two that are drawn dashed in colours which come for the second time.
    methods.insert(5, NamedSettings::new("exact form", exact));
    methods.insert(6, NamedSettings::new(EXACT_ON_BOTH, mixed));
    with_iterations(methods, if quick { 100 } else { 1000 })
}

fn with_iterations(methods: Vec<NamedSettings>, iterations: u32) -> Vec<NamedSettings> {
    methods.into_iter().map(|method| method.with_iterations(iterations)).collect()
}

fn case_count(quick: bool) -> usize {
    jacobi_methods(quick).len()
        + colored_methods(quick).len()
        + 2 * COST_AND_DEVICE_CASES
        + artefact::case_count(quick)
        + multipliers::case_count(quick)
}

fn run(context: &mut Context) -> Result<()> {
    introduce(context);
    convergence(context)?;
    artefact::run(context)?;
    multipliers::run(context)
}

fn introduce(context: &mut Context) {
    context.document.paragraph(
        "An acceleration takes the sequence `q_(k+1) = g(q_k)` of sweeps and goes further along it. \
         Over-relaxation takes `omega` times each correction; Chebyshev's method (Wang 2015) adds a share \
         of the last change that follows from the spectral radius of the sweep, measured here as the ratio \
         of successive changes, or given; Anderson's (Peng et al. 2018) takes the affine combination of the \
         last six sweeps (window 5) whose combined change is the smallest. The same step as in section 1; \
         errors are distances from the *true* end of the step, not from where a method comes to rest.",
    );
    context.document.paragraph(
        "The unknowns of XPBD are positions and multipliers, tied by `M (x - xt) = J^T l`. Where both are \
         scaled and mixed with the same weights the tie holds as far as it is linear. The dashed curves do \
         otherwise: published over-relaxation scales positions alone, so that `M (x - xt) = omega J^T l` \
         and the tissue is `omega` times as stiff; Anderson on positions leaves the multipliers behind; \
         Anderson on multipliers makes the tie anew after each accelerated iterate, `x = xt + M^-1 J(x)^T l`. These two \
         have parts of their own below.",
    );
}

fn convergence(context: &mut Context) -> Result<()> {
    let size = if context.quick { Size::Tiny } else { Size::Large };
    let step = bar_from_rest(context, size)?;
    context.document.subheading("Accelerations of published XPBD");
    let mut followed = follow_on_both(context, &step, jacobi_methods(context.quick))?;
    let mut figure = Figure::new("Accelerated Jacobi");
    followed.iter().for_each(|method| figure.add(method));
    figure.show(
        context,
        "acceleration-jacobi",
        [
            "Compare each with plain Jacobi. Chebyshev needs the right radius: after ten sweeps, when rough \
             errors still decay, the measured one is too small. Look where the dashed ones go that do not \
             treat positions and multipliers alike.",
            "The same over passes: an acceleration adds passes to each iteration, for sums over all \
             unknowns.",
        ],
    )?;
    let colored = follow_on_both(context, &step, colored_methods(context.quick))?;
    let mut figure = Figure::new("Accelerated coloured sweeps");
    colored.iter().for_each(|method| figure.add(method));
    figure.show(
        context,
        "acceleration-coloured",
        [
            "Look where published forms bend: that is their own answer. The exact form, with the rebase, \
             has the true one.",
            "The same over passes. Coloured sweeps have many, so that an acceleration's own hardly count.",
        ],
    )?;
    followed.extend(colored);
    context.document.table(&table(&followed, &[1e-1, 1e-2]));
    judge(context, &followed);
    judge_device(context, "figure 4", &followed);
    Ok(())
}

/// The claim about iterations, and its price.
fn judge(context: &mut Context, followed: &[Followed]) {
    let find = |name| followed.iter().find(|method| method.method.name == name);
    let (Some(plain), Some(mixed)) = (followed.first(), find(ON_BOTH)) else { return };
    if let (Some(published), Some(exact)) = (find(COLORED_ON_BOTH), find(EXACT_ON_BOTH)) {
        context.document.paragraph(format!(
            "An acceleration goes where its sweep goes, only faster: after {} iterations Anderson on both \
             ends at an error of {} over published coloured sweeps, at {} over those of the exact form.",
            exact.method.settings.iterations(),
            in_words(published.curve.last()),
            in_words(exact.curve.last())
        ));
    }
    if let Some(sample) = mixed.samples.last() {
        let [device, cpu] = sample.errors.map(in_words);
        context.document.paragraph(format!(
            "Markers are of single precision, by the CPU and by the GPU backend. Anderson's method looks for \
             small differences of large vectors and feels the rounding: over Jacobi sweeps both may part from \
             the line where it wants weights more exact than that; after {} iterations the CPU is at {cpu}, the \
             GPU at {device}. Compare them with the markers on plain sweeps.",
            sample.iterations
        ));
    }
    let [jacobi, anderson] = [plain, mixed].map(|method| Reach::of(&method.curve, 0.1));
    let (share, measured) = match (jacobi, anderson) {
        (Reach::After(jacobi), Reach::After(anderson)) => {
            let share = anderson as f64 / jacobi as f64;
            (share, format!("{} ({anderson} of {jacobi})", percent(share)))
        }
        _ => (f64::INFINITY, format!("{anderson} of {jacobi}")),
    };
    if share.is_finite() {
        let passes = share * mixed.cost.passes as f64 / plain.cost.passes as f64;
        let seconds = share * mixed.cost.seconds / plain.cost.seconds;
        context.document.paragraph(format!(
            "Anderson on both comes to a tenth of the starting error in {} of plain Jacobi's iterations, \
             {} of its passes and {} of its time.",
            percent(share),
            percent(passes),
            percent(seconds)
        ));
    }
    // On the few tetrahedra of a quick run plain Jacobi is not slow enough for the claim.
    if !context.quick {
        context.verdict(
            "Anderson on both over Jacobi, iterations to 1e-1",
            format!("<= {} of plain Jacobi's", percent(ASKED)),
            measured,
            share <= ASKED,
        );
    }
}
