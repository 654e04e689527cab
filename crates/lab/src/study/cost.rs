//! Section 7: what it costs to come to a tenth, a hundredth, a thousandth of the starting error.

use anyhow::Result;
use std::fmt;
use viscera::material::MaterialModel;
use viscera::settings::{AndersonOn, Colors, RelaxationForm, SolverSettings};
use viscera_report::{Table, si};

use super::convergence::{COST_CASES, Followed, Reach, follow, level_name, table};
use super::methods::{
    COLORED, JACOBI, NamedSettings, anderson, chebyshev, exact, law, published, relaxed,
};
use super::step::MeasuredStep;
use super::{Context, Section};
use crate::load_cases::{FRAME_RATE, GRAVITY, Size};
use crate::sections::Changes;

pub(super) const SECTION: Section =
    Section { name: "cost", title: "7. Iterations, passes and time", cases: case_count, run };

const LEVELS: [f64; 3] = [1e-1, 1e-2, 1e-3];

/// A step that all methods are measured on.
#[derive(Clone, Copy)]
struct CostProblem {
    /// In words, and in names of files.
    words: &'static str,
    load_case: &'static str,
    size: Size,
    /// Young's modulus [Pa] where the user wants no other.
    young: f64,
    /// Frames before the step.
    history: u32,
    law: MaterialModel,
    /// Iterations of plain Jacobi, and of the others.
    iterations: [u32; 2],
}

impl fmt::Display for CostProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "truth of the {}", self.words)
    }
}

const CANTILEVER: CostProblem = CostProblem {
    words: "cantilever from rest, E = 100 kPa",
    load_case: "cantilever",
    size: Size::Large,
    young: 1e5,
    history: 0,
    law: MaterialModel::SaintVenantKirchhoff,
    iterations: [6000, 2000],
};
const TWIST: CostProblem = CostProblem {
    words: "twist in motion, E = 10 kPa",
    load_case: "twist",
    size: Size::Large,
    young: 1e4,
    history: 11,
    law: MaterialModel::SaintVenantKirchhoff,
    iterations: [2000, 1000],
};
/// Finer than the way the bar falls in a step, of both tissues: some sweeps leave Green strain inverted.
const HUGE: CostProblem = CostProblem { size: Size::Huge, iterations: [2000, 600], ..CANTILEVER };
const HUGE_NEO_HOOKEAN: CostProblem = CostProblem { law: MaterialModel::StableNeoHookean, ..HUGE };

fn cost_problems(quick: bool, changes: &Changes) -> Vec<CostProblem> {
    let tiny = |case| CostProblem { size: Size::Tiny, iterations: [200, 100], ..case };
    match (quick, has_fine_mesh(quick, changes)) {
        (true, _) => vec![tiny(CANTILEVER), tiny(TWIST)],
        (false, true) => vec![CANTILEVER, TWIST, HUGE, HUGE_NEO_HOOKEAN],
        (false, false) => vec![CANTILEVER, TWIST],
    }
}

/// A mesh of the user's has one size.
fn has_fine_mesh(quick: bool, changes: &Changes) -> bool {
    !quick && changes.mesh.is_none()
}

/// Plain Jacobi is the first, which the others are compared with.
fn methods(iterations: [u32; 2]) -> Vec<NamedSettings> {
    let few = Colors::Limited(4);
    let both = |settings| anderson(settings, AndersonOn::Both);
    let named: Vec<(&str, SolverSettings)> = vec![
        ("Jacobi", published(JACOBI)),
        ("Jacobi, omega 1.5", relaxed(published(JACOBI), 1.5, RelaxationForm::Consistent)),
        ("Jacobi, Chebyshev 0.997", chebyshev(published(JACOBI), 0.997)),
        ("Jacobi, Anderson on both", both(published(JACOBI))),
        ("4 colours", published(few)),
        ("4 colours, Anderson on both", both(published(few))),
        ("coloured", published(COLORED)),
        ("coloured, Chebyshev measured", chebyshev(published(COLORED), 0.0)),
        ("coloured, Anderson on both", both(published(COLORED))),
        ("coloured, Anderson on positions", anderson(published(COLORED), AndersonOn::Positions)),
        (
            "coloured, Anderson on multipliers",
            anderson(published(COLORED), AndersonOn::Multipliers),
        ),
        ("exact, Jacobi, Anderson", both(exact(JACOBI))),
        ("exact, 4 colours, Anderson", both(exact(few))),
        ("exact, coloured", exact(COLORED)),
        ("exact, coloured, Anderson", both(exact(COLORED))),
    ];
    let counts = [iterations[0]].into_iter().chain(std::iter::repeat(iterations[1]));
    let method =
        |((name, settings), count)| NamedSettings::new(name, settings).with_iterations(count);
    named.into_iter().zip(counts).map(method).collect()
}

fn case_count(quick: bool, changes: &Changes) -> usize {
    let methods = |case: &CostProblem| methods(case.iterations).len() + COST_CASES;
    cost_problems(quick, changes).iter().map(|case| 1 + methods(case)).sum()
}

fn run(context: &mut Context) -> Result<()> {
    context.document.paragraph(
        "Errors as in sections 1 and 4, of one step of 1/60 s with nu = 0.45; levels are \
         shares of the error of the inertial prediction. \
         Percentages are shares of plain Jacobi's iterations and passes; '<' where Jacobi was not there \
         after all its iterations. 'above N': N iterations were not enough. 'stops at p': its error has come \
         to stand at p, the median of its last fifth: published XPBD at an answer of its own, others among \
         crumpled tetrahedra. \
         'diverges': its error grew beyond ten. Passes count the dispatches of an iteration on a GPU, one \
         after the other; milliseconds are of one thread in single precision, on the machine that made this.",
    );
    if has_fine_mesh(context.quick, context.changes) {
        let fall = -GRAVITY.z / (FRAME_RATE * FRAME_RATE);
        context.document.paragraph(format!(
            "The last column is the root mean square of strain over the true one. Far above 1 some \
             tetrahedra are crumpled or turned over, and the method is on its way to another stationary \
             point, or to none. That happens on the fine mesh, in double precision too: the way of free fall \
             in one step, {}, is most of a cell's edge there, so that beside the wall the first sweeps begin \
             far outside of what is linear. No guard acts within these curves: the step guard of the exact \
             form judges the end of a step, after the last iteration.",
            si(fall, "m")
        ));
    }
    let mut data = Table::new(["scene", "method", "level", "iterations", "passes per iteration"]);
    let cases = cost_problems(context.quick, context.changes);
    for case in &cases {
        measure(context, case, &mut data)?;
    }
    context.document.data("cost", "All tables but for milliseconds", &data)
}

fn measure(context: &mut Context, case: &CostProblem, data: &mut Table) -> Result<()> {
    let tissue = context.changes.tissue(case.law, case.young, 0.45)?;
    let load_case = context.changes.load_case(case.load_case, case.size, tissue)?;
    let name = format!("{load_case}, {}", law(case.law));
    let steps =
        context.run_cases(&[*case], |_| MeasuredStep::new(load_case.clone(), case.history))?;
    let methods = methods(case.iterations);
    let mut followed = Vec::new();
    for step in &steps {
        followed = follow(context, step, methods.clone())?;
    }
    context.document.subheading(&name);
    context.document.table(&table(&followed, &LEVELS));
    for Followed { method, curve, cost, .. } in &followed {
        for level in LEVELS {
            let reach = Reach::of(curve, level).to_string();
            let passes = cost.passes.to_string();
            data.row([&name, &method.name, &level_name(level), &reach, &passes]);
        }
    }
    conclude(context, &followed);
    Ok(())
}

/// Who comes first by each count.
fn conclude(context: &mut Context, followed: &[Followed]) {
    let mut words = Vec::new();
    for level in LEVELS {
        let arrived: Vec<(&Followed, f64)> = followed
            .iter()
            .filter_map(|method| match Reach::of(&method.curve, level) {
                Reach::After(count) => Some((method, count as f64)),
                _ => None,
            })
            .collect();
        let first = |unit: fn(&Followed) -> f64| {
            let work = |(method, count): &(&Followed, f64)| count * unit(method);
            let least = arrived.iter().min_by(|a, b| work(a).total_cmp(&work(b)));
            least.map_or("nobody", |(method, _)| method.method.name.as_str())
        };
        if arrived.is_empty() {
            words.push(format!("to {} nobody came", level_name(level)));
        } else {
            words.push(format!(
                "to {} {} of {} came, with the fewest iterations '{}', the fewest passes '{}', the \
                 fewest milliseconds '{}'",
                level_name(level),
                arrived.len(),
                followed.len(),
                first(|_| 1.0),
                first(|method| method.cost.passes as f64),
                first(|method| method.cost.seconds),
            ));
        }
    }
    let mut text = words.join("; ");
    if let Some(letter) = text.get_mut(..1) {
        letter.make_ascii_uppercase();
    }
    context.document.paragraph(format!("{text}."));
}
