//! Coarse meshes against the continuum: how stiff a body is that is meshed with linear tetrahedra, with averaged ones
//! and with recovered-gradient ones. The truth is that of quadratic tetrahedra, extrapolated to no mesh at all; all
//! states of rest are the reference's, so that nothing here is a solver's.
//!
//! Locking: a linear tetrahedron that must keep its shape to bend stores energy that the body does not have, the more
//! the less its volume may change (Hughes, "The Finite Element Method", 2000, chapter 4).

use std::fmt;

use anyhow::Result;
use viscera::layout::Smoothing;

use super::{Context, Section};
use crate::bending::{Element, Filling, Load, extrapolated, response};
use viscera_report::{Axis, Plot, Series, Table, percent};

pub(super) const SECTION: Section = Section {
    name: "locking",
    title: "Coarse meshes against the continuum",
    cases: |quick, _| cases(quick).len(),
    run,
};

/// The tetrahedra that are compared, with their names.
const ELEMENTS: [(&str, Element); 4] = [
    ("linear", Element::Linear),
    ("averaged", Element::Smooth(Smoothing::AVERAGED)),
    ("recovered", Element::Smooth(Smoothing::RECOVERED)),
    ("fitted", Element::Smooth(Smoothing::FITTED)),
];

/// A bar that sinks by a third of its length.
const LARGE_SAG: Load = Load::Sag(1.0);

/// By most of a right angle.
const LARGE_TWIST: Load = Load::Twist(1.5);

/// What is asked of recovered-gradient tetrahedra on a mesh: the largest error for each Poisson ratio.
#[derive(Clone, Copy, Debug)]
struct Claim {
    load: Load,
    filling: Filling,
    across: usize,
    limits: &'static [f64],
}

impl Claim {
    const fn new(load: Load, filling: Filling, across: usize, limits: &'static [f64]) -> Self {
        Self { load, filling, across, limits }
    }
}

/// As asked where the mesh is like that of the claim's source, 4 % elsewhere.
const CLAIMS: &[Claim] = &[
    Claim::new(LARGE_SAG, Filling::Relaxed(1), 4, &[0.03, 0.02, 0.02]),
    Claim::new(LARGE_SAG, Filling::Five, 4, &[0.03, 0.02, 0.02]),
    Claim::new(LARGE_SAG, Filling::Five, 2, &[0.03, 0.02, 0.04]),
    Claim::new(LARGE_SAG, Filling::Relaxed(1), 2, &[0.03, 0.02, 0.04]),
    Claim::new(LARGE_SAG, Filling::Relaxed(2), 4, &[0.04; 3]),
    Claim::new(LARGE_SAG, Filling::Six, 4, &[0.04; 3]),
    Claim::new(LARGE_SAG, Filling::Jittered, 4, &[0.04; 3]),
    Claim::new(LARGE_SAG, Filling::Shuffled(1), 4, &[0.04; 3]),
    Claim::new(LARGE_SAG, Filling::Shuffled(2), 4, &[0.04; 3]),
    Claim::new(Load::SMALL[1], Filling::Relaxed(1), 4, &[0.04; 3]),
    Claim::new(Load::SMALL[1], Filling::Five, 4, &[0.04; 3]),
    Claim::new(LARGE_TWIST, Filling::Relaxed(1), 4, &[0.04; 3]),
    Claim::new(LARGE_TWIST, Filling::Five, 4, &[0.04; 3]),
    Claim::new(Load::SMALL[2], Filling::Relaxed(1), 4, &[0.04; 3]),
    Claim::new(Load::SMALL[2], Filling::Five, 4, &[0.04; 3]),
];

/// Small loads on small meshes.
const QUICK_CLAIMS: &[Claim] = &[
    Claim::new(Load::SMALL[0], Filling::Five, 2, &[0.05; 2]),
    Claim::new(Load::SMALL[0], Filling::Relaxed(1), 3, &[0.05; 2]),
];

fn claims(quick: bool) -> &'static [Claim] {
    if quick { QUICK_CLAIMS } else { CLAIMS }
}

fn poissons(quick: bool) -> &'static [f64] {
    if quick { &[0.3, 0.49] } else { &[0.3, 0.45, 0.49] }
}

/// Across the meshes of the truth. Bending is known to a few thousandths on the coarser pair.
fn truth_cells(load: Load, quick: bool) -> [usize; 2] {
    match load {
        Load::Sag(_) | Load::Twist(_) if !quick => [4, 6],
        _ => [2, 4],
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Case {
    load: Load,
    filling: Filling,
    across: usize,
    element: Element,
    poisson: f64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { load, filling, across, element, poisson } = self;
        write!(f, "{load}, nu {poisson}, {filling}, {across} across, {element:?}")
    }
}

/// Truths first: they take longest.
fn cases(quick: bool) -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    let mut add = |case: Case| {
        if !cases.contains(&case) {
            cases.push(case);
        }
    };
    for claim in claims(quick) {
        for across in truth_cells(claim.load, quick).into_iter().rev() {
            for &poisson in poissons(quick) {
                let (load, element) = (claim.load, Element::Quadratic);
                add(Case { load, filling: Filling::Five, across, element, poisson });
            }
        }
    }
    for &Claim { load, filling, across, .. } in claims(quick) {
        for &poisson in poissons(quick) {
            for (_, element) in ELEMENTS {
                add(Case { load, filling, across, element, poisson });
            }
        }
    }
    cases
}

fn answer(case: &Case) -> Result<f64> {
    let Case { load, filling, across, element, poisson } = *case;
    response(&load.mesh(filling, across)?, element, load, poisson)
}

struct Answers<'a> {
    cases: &'a [Case],
    values: &'a [f64],
    quick: bool,
}

impl Answers<'_> {
    fn value(&self, case: Case) -> f64 {
        let place = self.cases.iter().position(|known| *known == case);
        place.map_or(f64::NAN, |place| self.values[place])
    }

    fn truth(&self, load: Load, poisson: f64) -> f64 {
        let cells = truth_cells(load, self.quick);
        let element = Element::Quadratic;
        let of =
            |across| self.value(Case { load, filling: Filling::Five, across, element, poisson });
        extrapolated(cells, cells.map(of))
    }

    /// How much more than the body itself the mesh gives, of itself.
    fn error(&self, claim: &Claim, element: Element, poisson: f64) -> f64 {
        let Claim { load, filling, across, .. } = *claim;
        let value = self.value(Case { load, filling, across, element, poisson });
        value / self.truth(load, poisson) - 1.0
    }
}

fn run(context: &mut Context) -> Result<()> {
    let quick = context.quick;
    let cases = cases(quick);
    let values = context.run_cases(&cases, answer)?;
    let answers = Answers { cases: &cases, values: &values, quick };
    context.document.paragraph(
        "How much more a mesh gives than the body that it stands for: negative is too stiff. The body is that of \
         ten-node tetrahedra on two meshes, extrapolated; all answers are the reference's, by Newton's method. \
         `averaged` has most of its energy at vertices, `recovered` is the recovered-gradient tetrahedron, `fitted` the same with its bend fitted to quadratic fields face by face. Columns are \
         Poisson ratios. Bar and block: 80 x 20 x 20 mm and 60 x 60 x 30 mm, E 50 kPa, stable neo-Hookean.",
    );
    table(context, &answers)?;
    plot(context, &answers)?;
    verdicts(context, &answers);
    Ok(())
}

fn signed(fraction: f64) -> String {
    format!("{:+.1} %", 100.0 * fraction)
}

fn table(context: &mut Context, answers: &Answers<'_>) -> Result<()> {
    let mut heads = vec!["load".to_owned(), "mesh".to_owned(), "vertices".to_owned()];
    for (name, _) in ELEMENTS {
        heads.extend(poissons(context.quick).iter().map(|poisson| format!("{name}, {poisson}")));
    }
    let mut table = Table::new(heads);
    for claim in claims(context.quick) {
        let vertices = claim.load.mesh(claim.filling, claim.across)?.vertices().len();
        let mut row = vec![
            claim.load.to_string(),
            format!("{}, {} across", claim.filling, claim.across),
            vertices.to_string(),
        ];
        for (_, element) in ELEMENTS {
            let errors = poissons(context.quick).iter();
            row.extend(errors.map(|&poisson| signed(answers.error(claim, element, poisson))));
        }
        table.row(row);
    }
    context.document.table(&table);
    let mut truths = Table::new(["load", "nu", "the body gives"]);
    for (at, claim) in claims(context.quick).iter().enumerate() {
        if claims(context.quick)[..at].iter().any(|before| before.load == claim.load) {
            continue;
        }
        for &poisson in poissons(context.quick) {
            let truth = answers.truth(claim.load, poisson);
            let text = match claim.load {
                Load::Twist(_) => format!("{truth:.4} rad/(N m)"),
                _ => format!("{:.5} mm", 1e3 * truth),
            };
            truths.row([claim.load.to_string(), poisson.to_string(), text]);
        }
    }
    context.document.paragraph(
        "The truths: how far the free end or the pressed face moves, how far a torque turns.",
    );
    context.document.table(&truths);
    Ok(())
}

fn plot(context: &mut Context, answers: &Answers<'_>) -> Result<()> {
    let mut plot = Plot::new(
        "Error of all meshes against the Poisson ratio",
        Axis::linear("Poisson ratio"),
        Axis::linear("gives too much, percent of the body's"),
    );
    for (name, element) in ELEMENTS {
        let mut points = Vec::new();
        for &poisson in poissons(context.quick) {
            for claim in claims(context.quick) {
                points.push([poisson, 100.0 * answers.error(claim, element, poisson)]);
            }
        }
        plot.series(Series::new(name, points).with_style(viscera_report::Style::Markers));
    }
    plot.reference(0.0, "the body");
    let see = "Each mark is one mesh under one load: linear tetrahedra are the stiffer the less volume may change; \
               recovered ones stay at the body's.";
    context.plot("locking-errors", &plot, see)
}

fn verdicts(context: &mut Context, answers: &Answers<'_>) {
    for claim in claims(context.quick) {
        let errors: Vec<f64> = poissons(context.quick)
            .iter()
            .map(|&poisson| answers.error(claim, ELEMENTS[2].1, poisson))
            .collect();
        let limits = claim.limits.iter().map(|limit| percent(*limit));
        let within = |(error, limit): (&f64, &f64)| error.abs() < *limit;
        context.verdict(
            format!(
                "{}, {}, {} across, nu {:?}",
                claim.load,
                claim.filling,
                claim.across,
                poissons(context.quick)
            ),
            format!("within {}", limits.collect::<Vec<_>>().join(", ")),
            errors.iter().map(|error| signed(*error)).collect::<Vec<_>>().join(", "),
            errors.iter().zip(claim.limits).all(within),
        );
    }
}
