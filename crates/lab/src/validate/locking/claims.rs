//! What is asked of recovered-gradient tetrahedra: bending at large sag within 4 %, of shapes with corners and of tapered
//! ones within 5 %, torsion within 6 %, a pressed block within 4 %.

use anyhow::Result;
use viscera::mesh::quality::shape_quality;
use viscera_report::{Axis, Plot, Series, Style, Table, percent};

use super::cases::{Answers, Case, Row, cases};
use super::{Context, ELEMENTS, RECOVERED, list, poissons, signed};
use crate::bending::Load;
use crate::bending::bodies::{Filling, Shape};

/// A body that sinks by a third of its length.
pub(super) const LARGE_SAG: Load = Load::Sag(1.0);

/// By most of a right angle.
const LARGE_TWIST: Load = Load::Twist(1.5);

const SMALL_SAG: Load = Load::SMALL[0];
const SMALL_TWIST: Load = Load::SMALL[1];
const SMALL_PRESS: Load = Load::SMALL[2];

/// What is asked of recovered-gradient tetrahedra on a mesh: the largest error for each Poisson ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Claim {
    row: Row,
    limits: &'static [f64],
}

impl Claim {
    const fn bar(load: Load, filling: Filling, across: usize, limits: &'static [f64]) -> Self {
        Self { row: Row { load, shape: Shape::Bar, filling, across }, limits }
    }

    const fn of(load: Load, shape: Shape, filling: Filling, limits: &'static [f64]) -> Self {
        Self { row: Row { load, shape, filling, across: 4 }, limits }
    }
}

/// As asked where the mesh is like that of the claim's source; in bending 4 % elsewhere.
const CLAIMS: &[Claim] = &[
    Claim::bar(LARGE_SAG, Filling::Relaxed(1), 4, &[0.03, 0.02, 0.02]),
    Claim::bar(LARGE_SAG, Filling::Five, 4, &[0.03, 0.02, 0.02]),
    Claim::bar(LARGE_SAG, Filling::Five, 2, &[0.03, 0.02, 0.04]),
    Claim::bar(LARGE_SAG, Filling::Relaxed(1), 2, &[0.03, 0.02, 0.04]),
    Claim::bar(LARGE_SAG, Filling::Relaxed(2), 4, &[0.04; 3]),
    Claim::bar(LARGE_SAG, Filling::Six, 4, &[0.04; 3]),
    Claim::bar(LARGE_SAG, Filling::Jittered, 4, &[0.04; 3]),
    Claim::bar(LARGE_SAG, Filling::Shuffled(1), 4, &[0.04; 3]),
    Claim::bar(LARGE_SAG, Filling::Shuffled(2), 4, &[0.04; 3]),
    Claim::bar(LARGE_SAG, Filling::Delaunay(1), 4, &[0.04; 3]),
    Claim::of(LARGE_SAG, Shape::Stuffed, Filling::Lattice, &[0.04; 3]),
    Claim::of(LARGE_SAG, Shape::Angle, Filling::Five, &[0.05; 3]),
    Claim::of(LARGE_SAG, Shape::Angle, Filling::Relaxed(1), &[0.05; 3]),
    Claim::of(LARGE_SAG, Shape::Tapered, Filling::Five, &[0.05; 3]),
    Claim::of(LARGE_SAG, Shape::Tapered, Filling::Relaxed(1), &[0.05; 3]),
    Claim::of(LARGE_SAG, Shape::Tapered, Filling::Delaunay(1), &[0.05; 3]),
    Claim::bar(SMALL_TWIST, Filling::Relaxed(1), 4, &[0.06; 3]),
    Claim::bar(SMALL_TWIST, Filling::Five, 4, &[0.06; 3]),
    Claim::bar(LARGE_TWIST, Filling::Relaxed(1), 4, &[0.06; 3]),
    Claim::bar(LARGE_TWIST, Filling::Five, 4, &[0.06; 3]),
    Claim::of(SMALL_PRESS, Shape::Block, Filling::Relaxed(1), &[0.04; 3]),
    Claim::of(SMALL_PRESS, Shape::Block, Filling::Five, &[0.04; 3]),
];

/// Small loads on small meshes.
const QUICK_CLAIMS: &[Claim] = &[
    Claim::bar(SMALL_SAG, Filling::Five, 2, &[0.05; 2]),
    Claim::bar(SMALL_SAG, Filling::Relaxed(1), 4, &[0.04; 2]),
];

fn claims(quick: bool) -> &'static [Claim] {
    if quick { QUICK_CLAIMS } else { CLAIMS }
}

fn rows(quick: bool) -> Vec<Row> {
    claims(quick).iter().map(|claim| claim.row).collect()
}

fn all_cases(quick: bool) -> Vec<Case> {
    cases(&rows(quick), poissons(quick), &ELEMENTS.map(|(_, element)| element))
}

pub(super) fn case_count(quick: bool) -> usize {
    all_cases(quick).len()
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let answers = Answers::of(context, all_cases(context.quick))?;
    table(context, &answers)?;
    truths(context, &answers);
    plot(context, &answers)?;
    verdicts(context, &answers);
    Ok(())
}

fn table(context: &mut Context, answers: &Answers) -> Result<()> {
    let heads = ["load", "body", "mesh", "vertices", "worst shape"];
    let mut heads = heads.map(str::to_owned).to_vec();
    for (name, _) in ELEMENTS {
        heads.extend(poissons(context.quick).iter().map(|poisson| format!("{name}, {poisson}")));
    }
    let mut table = Table::new(heads);
    for Claim { row, .. } in claims(context.quick) {
        let mesh = row.body()?.mesh;
        let qualities = (0..mesh.tets().len()).map(|tet| shape_quality(mesh.corners(tet)));
        let mut entries = vec![
            row.load.to_string(),
            row.shape.to_string(),
            format!("{}, {} across", row.filling, row.across),
            mesh.vertices().len().to_string(),
            format!("{:.3}", qualities.fold(1.0, f64::min)),
        ];
        for (_, element) in ELEMENTS {
            let errors = poissons(context.quick).iter();
            entries.extend(errors.map(|&poisson| signed(answers.error(row, element, poisson))));
        }
        table.row(entries);
    }
    context.document.table(&table);
    Ok(())
}

fn truths(context: &mut Context, answers: &Answers) {
    context.document.paragraph(
        "The truths: how far the free end or the pressed face moves, how far a torque turns; what extrapolation has \
         added to the finest mesh; and the order of the error by the cells' size, which is taken to be 2 at clamped \
         edges and found from three meshes where a corner points inwards. The stuffed bar's edges are cut off: its \
         body is that of its own mesh, the truth that of the mesh and of the mesh split 1:8, and all of them are held \
         over half a spacing of the lattice. Shape is 1 of a regular tetrahedron and 0 of a flat one.",
    );
    let mut table =
        Table::new(["load", "body", "nu", "the body gives", "extrapolation adds", "order"]);
    let rows = rows(context.quick);
    for (at, row) in rows.iter().enumerate() {
        if rows[..at].iter().any(|before| before.is_of(row)) {
            continue;
        }
        for &poisson in poissons(context.quick) {
            let truth = answers.truth(row, poisson);
            let text = match row.load {
                Load::Twist(_) => format!("{:.4} rad/(N m)", truth.value),
                _ => format!("{:.5} mm", 1e3 * truth.value),
            };
            let (load, shape) = (row.load.to_string(), row.shape.to_string());
            let (error, order) = (percent(truth.error), format!("{:.1}", truth.order));
            table.row([load, shape, poisson.to_string(), text, error, order]);
        }
    }
    context.document.table(&table);
}

fn plot(context: &mut Context, answers: &Answers) -> Result<()> {
    let mut plot = Plot::new(
        "Error of all meshes against the Poisson ratio",
        Axis::linear("Poisson ratio"),
        Axis::linear("gives too much, percent of the body's"),
    );
    for (name, element) in ELEMENTS {
        let mut points = Vec::new();
        for &poisson in poissons(context.quick) {
            for claim in claims(context.quick) {
                points.push([poisson, 100.0 * answers.error(&claim.row, element, poisson)]);
            }
        }
        plot.series(Series::new(name, points).with_style(Style::Markers));
    }
    plot.reference(0.0, "the body");
    let see = "Each mark is one mesh under one load: linear tetrahedra are the stiffer the less volume may change; \
               recovered ones stay at the body's.";
    context.plot("locking-errors", &plot, see)
}

fn verdicts(context: &mut Context, answers: &Answers) {
    for claim in claims(context.quick) {
        let errors: Vec<f64> = poissons(context.quick)
            .iter()
            .map(|&poisson| answers.error(&claim.row, RECOVERED, poisson))
            .collect();
        let within = |(error, limit): (&f64, &f64)| error.abs() < *limit;
        let Claim { row: Row { load, shape, filling, across }, limits } = claim;
        context.verdict(
            format!(
                "{load} of a {shape}, {filling}, {across} across, nu {}",
                list(poissons(context.quick).iter().map(f64::to_string))
            ),
            format!("within {}", list(limits.iter().map(|limit| percent(*limit)))),
            list(errors.iter().map(|error| signed(*error))),
            errors.iter().zip(*limits).all(within),
        );
    }
}
