//! What recovered-gradient tetrahedra do where nothing is asked of them: organs of few vertices, two materials, Poisson's
//! ratio of .499, and how rough the pressure is.

use std::fmt;

use anyhow::Result;
use viscera::mesh::boundary_surface;
use viscera_report::Table;

use super::cases::{Answers, Row, cases};
use super::claims::LARGE_SAG;
use super::{Context, ELEMENTS, RECOVERED, poissons, signed};
use crate::bending::bodies::{Body, Filling, Shape};
use crate::bending::pressure::roughness;
use crate::bending::{Element, Load};

const SMALL_SAG: Load = Load::SMALL[0];

/// Beyond what is claimed.
const NEARLY_INCOMPRESSIBLE: f64 = 0.499;

const fn row(load: Load, shape: Shape, filling: Filling, across: usize) -> Row {
    Row { load, shape, filling, across }
}

const ORGANS: &[Row] = &[
    row(SMALL_SAG, Shape::Liver, Filling::Lattice, 1),
    row(SMALL_SAG, Shape::Liver, Filling::Split, 1),
];

const MATERIALS: &[Row] = &[
    row(SMALL_SAG, Shape::Layers, Filling::Six, 4),
    row(SMALL_SAG, Shape::Layers, Filling::Relaxed(1), 4),
    row(SMALL_SAG, Shape::Halves, Filling::Six, 4),
    row(SMALL_SAG, Shape::Halves, Filling::Relaxed(1), 4),
];

const NEARLY: &[Row] = &[
    row(LARGE_SAG, Shape::Bar, Filling::Five, 4),
    row(LARGE_SAG, Shape::Bar, Filling::Relaxed(1), 4),
];

const QUICK_MATERIALS: &[Row] = &[row(SMALL_SAG, Shape::Layers, Filling::Six, 2)];
const QUICK_NEARLY: &[Row] = &[row(SMALL_SAG, Shape::Bar, Filling::Five, 2)];

/// Rows with their Poisson's ratios.
fn groups(quick: bool) -> [(&'static [Row], &'static [f64]); 3] {
    match quick {
        true => [(&[], &[]), (QUICK_MATERIALS, &[0.3]), (QUICK_NEARLY, &[NEARLY_INCOMPRESSIBLE])],
        false => [
            (ORGANS, poissons(false)),
            (MATERIALS, poissons(false)),
            (NEARLY, &[NEARLY_INCOMPRESSIBLE]),
        ],
    }
}

/// A bar at rest whose pressure is looked at.
struct Rough {
    row: Row,
    element: Element,
    poisson: f64,
}

impl fmt::Display for Rough {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { row: Row { filling, .. }, element, poisson } = self;
        write!(f, "pressure of {filling}, {element:?}, nu {poisson}")
    }
}

/// Whose pressures are compared.
const OF_PRESSURE: [(&str, Element); 3] =
    [("linear", Element::Linear), ("recovered", RECOVERED), ("ten nodes", Element::Quadratic)];

fn rough_rows(quick: bool) -> &'static [Row] {
    if quick { QUICK_NEARLY } else { NEARLY }
}

fn rough_cases(quick: bool) -> Vec<Rough> {
    let of = |&row: &Row| {
        OF_PRESSURE.iter().flat_map(move |&(_, element)| {
            poissons(quick).iter().map(move |&poisson| Rough { row, element, poisson })
        })
    };
    rough_rows(quick).iter().flat_map(of).collect()
}

pub(super) fn case_count(quick: bool) -> usize {
    let elements = ELEMENTS.map(|(_, element)| element);
    let of = |&(rows, poissons): &(&[Row], &[f64])| cases(rows, poissons, &elements).len();
    groups(quick).iter().map(of).sum::<usize>() + rough_cases(quick).len()
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let words = [
        "A liver of few vertices that is held where its longest axis begins and sags along its shortest, and the \
         same with its tetrahedra split 1:8; its body is that of ten-node tetrahedra on both meshes, extrapolated. \
         Nothing is asked: where nearly all vertices lie on the surface, the gradient at a vertex is an average to one \
         side of it, and a mesh this coarse stays too stiff. The cure is more vertices, by splitting every tetrahedron. \
         Seen and not taken: with more of the energy at vertices, or gradients at the surface fitted quadratically or \
         extrapolated, half of the error or more goes, but bars of sound meshes, which are soft by 2 %, become softer \
         by another 1 to 4 %, and slow modes more; shares that grow towards the surface break the patch test besides; a \
         vertex in the middle of each tetrahedron makes it worse.",
        "Two materials, one of ten times the stiffness of the other: the lower half of the bar, or its clamped half. \
         Vertices where they meet have a gradient for each. Nothing is asked.",
        "Nearly incompressible: nothing is asked beyond .49.",
    ];
    for ((rows, poissons), words) in groups(context.quick).into_iter().zip(words) {
        if !rows.is_empty() {
            context.document.paragraph(words);
            errors(context, rows, poissons)?;
        }
    }
    pressure(context)
}

fn errors(context: &mut Context, rows: &[Row], poissons: &[f64]) -> Result<()> {
    let elements = ELEMENTS.map(|(_, element)| element);
    let answers = Answers::of(context, cases(rows, poissons, &elements))?;
    let mut heads =
        ["load", "body", "mesh", "vertices", "on the surface"].map(str::to_owned).to_vec();
    for (name, _) in ELEMENTS {
        heads.extend(poissons.iter().map(|poisson| format!("{name}, {poisson}")));
    }
    let mut table = Table::new(heads);
    for row in rows {
        let mesh = row.body()?.mesh;
        let mut entries = vec![
            row.load.to_string(),
            row.shape.to_string(),
            row.filling.to_string(),
            mesh.vertices().len().to_string(),
            boundary_surface(&mesh).mesh_vertices.len().to_string(),
        ];
        for element in elements {
            let errors = poissons.iter().map(|&poisson| answers.error(row, element, poisson));
            entries.extend(errors.map(signed));
        }
        table.row(entries);
    }
    context.document.table(&table);
    Ok(())
}

fn pressure(context: &mut Context) -> Result<()> {
    let cases = rough_cases(context.quick);
    let values = context.run_cases(&cases, |Rough { row, element, poisson }| {
        let body: Body = row.body()?;
        roughness(&body, *element, row.load, *poisson)
    })?;
    context.document.paragraph(
        "How rough the pressure is: the root mean square of its jumps between tetrahedra with a common face over the \
         mean of its size. That of ten-node tetrahedra on the same mesh, averaged over each, is what a smooth pressure \
         has there.",
    );
    let mut heads = ["load", "mesh"].map(str::to_owned).to_vec();
    for (name, _) in OF_PRESSURE {
        heads.extend(poissons(context.quick).iter().map(|poisson| format!("{name}, {poisson}")));
    }
    let mut table = Table::new(heads);
    // Cases are in the order of the table.
    let per_row = OF_PRESSURE.len() * poissons(context.quick).len();
    for (row, values) in rough_rows(context.quick).iter().zip(values.chunks(per_row)) {
        let mut entries = vec![row.load.to_string(), row.filling.to_string()];
        entries.extend(values.iter().map(|value| format!("{value:.2}")));
        table.row(entries);
    }
    context.document.table(&table);
    Ok(())
}
