//! A rigid ball on a layer of tissue that is bonded to a rigid base.
//!
//! ```text
//! F = 4/3 E/(1 - nu^2) sqrt(R) d^1.5 (1 + c1 X + c2 X^2 + c3 X^3 + c4 X^4),   X = sqrt(R d)/H
//! c1 = -2 a/pi,  c2 = 4 a^2/pi^2,  c3 = -8/pi^3 (a^3 + 4 pi^2/15 b),  c4 = 16 a/pi^4 (a^3 + 3 pi^2/5 b)
//! a = -(1.2876 - 1.4678 nu + 1.3442 nu^2)/(1 - nu),  b = (0.6387 - 1.0277 nu + 1.5164 nu^2)/(1 - nu)
//! ```
//!
//! Hertz 1881, and the finite depth `H` after Dimitriadis, Horkay, Maresca, Kachar, Chadwick, "Determination of
//! elastic moduli of thin layers of soft material using the atomic force microscope", Biophysical Journal 82 (2002)
//! 2798, for a bonded layer, `X` up to 1 and `d` up to a tenth of `H`. Here `X` is 0.2 and `d` a hundredth of `H`;
//! the last term is then below 0.1 %.
//!
//! The contact is nearly rigid: a thickness of a two-hundredth of the depth, by which the ball is smaller and higher,
//! and a foundation that gives by less than a thousandth of the depth. Meshes are graded, fine under the ball, and
//! all alike but for their number of cells; a mesh of linear tetrahedra errs by the square of its edges.

use std::f64::consts::PI;
use std::fmt;

use anyhow::Result;
use viscera::contact::ContactLaw;
use viscera::material::MaterialModel;
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::Block;
use viscera::scalar::{Vec3, vec3};
use viscera_report::{Axis, Plot, Series, Style, Table, percent};

use super::Context;
use crate::contact_cases::{Pressing, Sampling, select};
use crate::load_cases::{NEAR, tissue};

const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.3;
/// Of the circle in which a half-space would touch [m].
const CONTACT: f64 = 4e-3;
/// Of the ball [m]: twenty times larger, so that strains are small and the ball is nearly a paraboloid.
const RADIUS: f64 = 20.0 * CONTACT;
/// By which the ball goes down [m].
const DEPTH: f64 = CONTACT * CONTACT / RADIUS;
/// Of the layer [m].
const HEIGHT: f64 = 5.0 * CONTACT;
/// Half of the layer's edge [m]: what is left of a bonded layer's answer at twice its height is small.
const HALF_WIDTH: f64 = 10.0 * CONTACT;
/// Cells along the radius of contact give these many along half the width and the height.
const CELLS: [usize; 2] = [4, 3];
const THICKNESS: f64 = 1e-6;
const STIFFNESS: f64 = 1e3;
/// Asked of the value that meshes lead to.
const LIMIT: f64 = 0.03;

#[derive(Clone, Copy, Debug)]
struct Case {
    /// Edges along the radius of contact.
    edges: usize,
    /// Whether the layer's sides are held, too: how much its finite width matters.
    held: bool,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sides = if self.held { ", sides held" } else { "" };
        write!(f, "Hertz, {} edges{sides}", self.edges)
    }
}

fn cases(quick: bool) -> Vec<Case> {
    let edges: &[usize] = if quick { &[2, 3, 4] } else { &[2, 3, 4, 5] };
    let mut cases: Vec<_> = edges.iter().map(|&edges| Case { edges, held: false }).collect();
    cases.push(Case { edges: 2, held: true });
    cases
}

pub(super) fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

/// `1, c1, c2, c3, c4`.
fn terms(nu: f64) -> [f64; 5] {
    let a = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
    let b = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu);
    let (cube, square) = (a * a * a, PI * PI);
    [
        1.0,
        -2.0 * a / PI,
        4.0 * a * a / square,
        -8.0 / (PI * square) * (cube + 4.0 * square / 15.0 * b),
        16.0 * a / (square * square) * (cube + 3.0 * square / 5.0 * b),
    ]
}

/// The force [N] of the closed form.
fn closed_form() -> f64 {
    let share = (RADIUS * DEPTH).sqrt() / HEIGHT;
    let of_depth = terms(POISSON).iter().rev().fold(0.0, |sum, term| sum * share + term);
    let modulus = YOUNG / (1.0 - POISSON * POISSON);
    4.0 / 3.0 * modulus * RADIUS.sqrt() * DEPTH * DEPTH.sqrt() * of_depth
}

/// Distances [m] from the middle of contact: `a sinh(i y/k)/sinh(y)` with `k` cells along `a`, so that `n` cells end at
/// `extent` [m].
fn graded(k: usize, n: usize, extent: f64) -> impl Fn(f64) -> f64 {
    let ratio = n as f64 / k as f64;
    let (mut low, mut high) = (1e-6, 5.0);
    for _ in 0..100 {
        let y = 0.5 * (low + high);
        let end = CONTACT * libm::sinh(ratio * y) / libm::sinh(y);
        if end < extent { low = y } else { high = y }
    }
    move |i| CONTACT * libm::sinh(i * low / k as f64) / libm::sinh(low)
}

fn mesh(edges: usize) -> Result<TetMesh> {
    let [across, down] = CELLS.map(|cells| cells * edges);
    let cells = [2 * across, 2 * across, down];
    let grid = Block::new(Vec3::from_f64(cells.map(|n| n as f64)), cells).mesh()?;
    let (side, depth) = (graded(edges, across, HALF_WIDTH), graded(edges, down, HEIGHT));
    let place = |x: &Vec3<f64>| {
        let [x, y] = [x.x, x.y].map(|x| x - across as f64).map(|i| i.signum() * side(i.abs()));
        (x, y)
    };
    let vertices = grid.vertices().iter().map(|at| {
        let (x, y) = place(at);
        vec3(x, y, -depth(down as f64 - at.z))
    });
    Ok(TetMesh::new(vertices.collect(), grid.tets().to_vec(), grid.regions().to_vec())?.0)
}

struct Answer {
    tets: usize,
    force: f64,
}

fn answer(case: &Case) -> Result<Answer> {
    let mesh = mesh(case.edges)?;
    let is_side = |x: f64| case.held && x.abs() > HALF_WIDTH - NEAR;
    let pressing = Pressing {
        fixed: select(&mesh, |x| x.z < NEAR - HEIGHT || is_side(x.x) || is_side(x.y)),
        tissue: tissue(MaterialModel::StableNeoHookean, YOUNG, POISSON)?,
        gravity: Vec3::ZERO,
        samples: Sampling::Cut(1),
        radius: RADIUS - THICKNESS,
        law: ContactLaw { stiffness: STIFFNESS, thickness: THICKNESS, friction: 0.0 },
        over: Vec3::ZERO,
        depth: DEPTH - THICKNESS,
        mesh,
    };
    let rest = pressing.truth_from(pressing.mesh.vertices(), 1)?;
    Ok(Answer { tets: pressing.mesh.tets().len(), force: rest.force() })
}

/// Of values whose error goes with the square of `h`: least squares of `f + c h^2` at `h` = 1/edges.
fn extrapolated(values: &[(usize, f64)]) -> f64 {
    let count = values.len() as f64;
    let square = |edges: usize| 1.0 / (edges * edges) as f64;
    let mean = |of: &dyn Fn(&(usize, f64)) -> f64| values.iter().map(of).sum::<f64>() / count;
    let (middle, force) = (mean(&|v| square(v.0)), mean(&|v| v.1));
    let covariance = mean(&|v| (square(v.0) - middle) * (v.1 - force));
    let variance = mean(&|v| (square(v.0) - middle) * (square(v.0) - middle));
    force - covariance / variance * middle
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    let exact = closed_form();
    context.document.subheading("Hertz");
    context.document.paragraph(format!(
        "A rigid ball of {:.0} mm goes {:.1} mm deep into a layer of {:.0} mm, E 10 kPa, nu {POISSON}, bonded to \
         its base, without friction. The closed form is Hertz's with the finite depth after Dimitriadis et al. \
         (2002): {exact:.5} N. The layer is {:.0} mm wide; held sides bound what that matters from above, free \
         ones from below. States of rest are the reference's, with a nearly rigid contact.",
        1e3 * RADIUS,
        1e3 * DEPTH,
        1e3 * HEIGHT,
        2e3 * HALF_WIDTH,
    ));
    let mut table =
        Table::new(["edges in the contact radius", "tetrahedra", "sides", "force", "error"]);
    let mut errors = Vec::new();
    let mut values = Vec::new();
    for (case, Answer { tets, force }) in cases.iter().zip(&answers) {
        let error = force / exact - 1.0;
        table.row([
            case.edges.to_string(),
            tets.to_string(),
            if case.held { "held" } else { "free" }.to_owned(),
            format!("{force:.5} N"),
            percent(error),
        ]);
        if !case.held {
            values.push((case.edges, *force));
            errors.push(error.abs());
        }
    }
    let limit = extrapolated(&values);
    let error = limit / exact - 1.0;
    table.row(["extrapolated", "", "free", &format!("{limit:.5} N"), &percent(error)]);
    context.document.table(&table);
    let mut plot = Plot::new(
        "Ball on a layer: force on finer meshes",
        Axis::linear("1/edges^2"),
        Axis::linear("force over the closed form"),
    );
    let at = |&(edges, force): &(usize, f64)| [1.0 / (edges * edges) as f64, force / exact];
    let points = std::iter::once([0.0, limit / exact]).chain(values.iter().rev().map(at));
    plot.series(Series::new("reference", points).with_style(Style::Markers));
    plot.reference(1.0, "Dimitriadis et al. 2002");
    context.document.figure("contact-hertz", &plot)?;
    context.verdict(
        "ball on a layer, force against Hertz and Dimitriadis, extrapolated",
        format!("< {}", percent(LIMIT)),
        percent(error.abs()),
        error.abs() < LIMIT,
    );
    let falls = errors.windows(2).all(|pair| pair[1] < pair[0]);
    let listed: Vec<_> = errors.iter().map(|&error| percent(error)).collect();
    context.verdict(
        "ball on a layer, errors with finer meshes",
        "falling",
        listed.join(", "),
        falls,
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Those of incompressible tissue as they are usually cited; the last one is cited with the other sign, which makes
    /// less than a thousandth here.
    #[test]
    fn terms_are_the_cited_ones() {
        let cited = [1.0, 1.133, 1.283, 0.769, 0.0975];
        for (term, cited) in terms(0.5).iter().zip(cited) {
            assert!((term.abs() - cited).abs() < 1e-3, "{term}, {cited}");
        }
        let share = (RADIUS * DEPTH).sqrt() / HEIGHT;
        assert!((share - 0.2).abs() < 1e-12);
        assert!((terms(POISSON)[4] * share.powi(4)).abs() < 1e-3);
    }

    #[test]
    fn graded_distances_end_where_they_should() {
        let at = graded(3, 12, HALF_WIDTH);
        assert!((at(3.0) - CONTACT).abs() < 1e-15 && (at(12.0) - HALF_WIDTH).abs() < 1e-12);
    }

    #[test]
    fn values_that_err_by_the_square_are_extrapolated_exactly() {
        let value = |edges: usize| (edges, 3.0 + 0.7 / (edges * edges) as f64);
        assert!((extrapolated(&[2, 3, 4].map(value)) - 3.0).abs() < 1e-12);
    }
}
