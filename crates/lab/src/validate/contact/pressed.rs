//! Tissue on tissue at rest: blocks that are pressed together, beside the reference on the plane between them, and columns
//! beside springs in a row.

use std::fmt;

use anyhow::Result;
use viscera::contact::ContactLaw;
use viscera::settings::Method;
use viscera_report::{Table, percent};

use super::super::methods::{floored_percent, worse};
use super::Context;
use crate::contact_cases::{Held, Pressed, Together, Way};

const WAYS: [Way; 4] = [
    Way::of(Method::Xpbd),
    Way::of(Method::QuasiNewton),
    Way::of(Method::QuasiNewton).in_single(),
    Way::of(Method::Explicit),
];

/// Asked of force and shape: surfaces that are tilted by up to a tenth at a rim are nearer to each other than to their images, by
/// half of its square.
const FORCE: f64 = 5e-3;
const SHAPE: f64 = 5e-3;
/// Asked of the two holders' forces beside each other.
const BALANCE: f64 = 1e-4;
/// Asked of columns: faces of four by four squares have rims, where edges are shorter or longer than in the middle.
const COLUMNS: f64 = 2e-2;
/// Below this an error is round-off, whose digits differ from machine to machine.
const FLOOR: f64 = 1e-8;

/// Of columns, beyond the touch [m]; contact as stiff as usual, and soft.
const WAY: f64 = 2e-4;
const STIFFNESSES: [f64; 2] = [10.0, 0.5];

#[derive(Clone, Copy, Debug)]
enum Case {
    /// Cells along the height, how it is held, by how much the blocks are pressed together [mm].
    Mirrored(usize, Held, u32),
    /// Stiffness of the contact.
    Columns(f64),
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mirrored(_, Held::Back, depth) => write!(f, "blocks, {depth} mm"),
            Self::Mirrored(_, Held::Middle, depth) => {
                write!(f, "blocks held by their middles, {depth} mm")
            }
            Self::Columns(stiffness) => write!(f, "columns, {stiffness} E/h"),
        }
    }
}

fn cases(quick: bool) -> Vec<Case> {
    let cells = if quick { 3 } else { 5 };
    let depths: &[u32] = if quick { &[4] } else { &[2, 4, 6] };
    let of =
        |&depth: &u32| [Held::Back, Held::Middle].map(|held| Case::Mirrored(cells, held, depth));
    depths.iter().flat_map(of).chain(STIFFNESSES.map(Case::Columns)).collect()
}

pub(super) fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

struct Answer {
    /// [N].
    true_force: f64,
    /// Of each way, with the error of the shape where that is known.
    library: Vec<(Together, Option<f64>)>,
}

fn answer(case: &Case) -> Result<Answer> {
    match *case {
        Case::Mirrored(cells, held, depth) => {
            let pressed = Pressed::mirrored(cells, held, 1e4, 1e-3 * f64::from(depth))?;
            let truth = pressed.truth()?;
            let solve = |way: &Way| -> Result<_> {
                let ours = pressed.settle(way)?;
                let shape = pressed.shape_error(&truth, &ours);
                Ok((ours, Some(shape)))
            };
            let library = WAYS.iter().map(solve).collect::<Result<_>>()?;
            Ok(Answer { true_force: truth.forces[0], library })
        }
        Case::Columns(stiffness) => {
            let law = ContactLaw { stiffness, friction: 0.0, ..ContactLaw::default() };
            let pressed = Pressed::columns(law, WAY)?;
            let solve = |way: &Way| Ok((pressed.settle(way)?, None));
            let library = WAYS.iter().map(solve).collect::<Result<_>>()?;
            Ok(Answer { true_force: Pressed::closed_form(&law, WAY), library })
        }
    }
}

/// Of the lower holder's force, relative; and of both beside each other.
fn force_errors(ours: &Together, true_force: f64) -> [f64; 2] {
    let [lower, upper] = ours.forces;
    [(lower / true_force - 1.0).abs(), (upper / lower - 1.0).abs()]
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    context.document.subheading("Tissue on tissue");
    context.document.paragraph(format!(
        "Two blocks of 30 x 30 x 15 mm, E 10 kPa, nu 0.45, viscosity 10 ms, mirror images of each other, are pressed together by their \
         backs, or by the middles of their backs, with the usual law of contact. A block that meets its image is at rest as it is \
         on a rigid plane between the two, with half of the thickness: so the truth is the Newton reference's, which knows \
         tools but no pairs. Columns of 20 x 20 mm, 20 and 12 mm high, of 10 and 20 kPa and without Poisson's ratio, are \
         springs in a row with the two foundations: `F/A = w/(L_1/E_1 + L_2/E_2 + 1/k_1 + 1/k_2)`, {} mm beyond \
         the touch. `balance` is what the forces of the two holders differ by; errors of the shape are over how far the \
         block is pressed in.",
        1e3 * WAY
    ));
    let heads = ["what", "force, truth", "method", "force, library"];
    let mut table = Table::new(heads.into_iter().chain(["force", "balance", "shape", "rejected"]));
    for (case, answer) in cases.iter().zip(&answers) {
        for (way, (ours, shape)) in WAYS.iter().zip(&answer.library) {
            let [error, balance] = force_errors(ours, answer.true_force);
            table.row([
                case.to_string(),
                format!("{:.4} N", answer.true_force),
                way.to_string(),
                format!("{:.4} N", ours.forces[0]),
                floored_percent(error, FLOOR),
                floored_percent(balance, FLOOR),
                shape.map_or("-".to_owned(), |shape| floored_percent(shape, FLOOR)),
                percent(ours.rejected),
            ]);
        }
    }
    context.document.table(&table);
    for (number, way) in WAYS.iter().enumerate() {
        let (mut force, mut shape, mut balance, mut columns) = (0.0, 0.0, 0.0, 0.0);
        for (case, Answer { true_force, library }) in cases.iter().zip(&answers) {
            let (ours, shape_error) = &library[number];
            let [error, off] = force_errors(ours, *true_force);
            balance = worse(balance, off);
            match case {
                Case::Mirrored(..) => force = worse(force, error),
                Case::Columns(_) => columns = worse(columns, error),
            }
            shape = shape_error.map_or(shape, |error| worse(shape, error));
        }
        for (what, error, limit) in [
            ("blocks pressed together, largest error of the force", force, FORCE),
            ("blocks pressed together, largest error of the shape", shape, SHAPE),
            ("tissue on tissue, forces of the two holders", balance, BALANCE),
            ("columns pressed together, largest error of the force", columns, COLUMNS),
        ] {
            let measured = floored_percent(error, FLOOR);
            let limit_text = format!("< {}", percent(limit));
            context.verdict(format!("{what}, {way}"), limit_text, measured, error < limit);
        }
    }
    Ok(())
}
