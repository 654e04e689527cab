//! Newton's method with a backtracking line search.
//!
//! ```text
//! H d = -grad Phi;  x += t d,  t = 1, 1/2, 1/4 ...  until  Phi(x + t d) <= Phi(x) + 1e-4 t d . grad Phi
//! H: exact; where that is indefinite, without the negative curvature of every quadrature point
//! ```
//!
//! Nocedal, Wright, "Numerical Optimization", 2nd ed. 2006, algorithms 3.1 (backtracking) and 3.2
//! (modified Hessian). Near the end `Phi` no longer tells a step from round-off; what counts there
//! is that the gradient shrinks.

use viscera::scalar::Vec3;

use super::matrix::{FactorError, Factorization, Pattern};
use super::objective::Objective;

/// Of the decrease that the slope promises, a step must deliver this share (Armijo).
const SUFFICIENT: f64 = 1e-4;

/// A line search gives up after this many halvings.
const HALVINGS: u32 = 40;

/// First share of the largest diagonal entry that is added where even the projected matrix cannot be
/// factorised; ten times more each time.
const FIRST_SHIFT: f64 = 1e-12;

/// As often: up to a thousand times the entry.
const SHIFTS: i32 = 17;

/// How far to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Done when the gradient is this share of the one at the start.
    pub relative: f64,
    /// Steps at most.
    pub steps: u32,
}

impl Default for Tolerance {
    fn default() -> Self {
        Self { relative: 1e-10, steps: 500 }
    }
}

/// How a solve went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Newton steps.
    pub steps: u32,
    /// How many of them had to leave negative curvature out.
    pub projected: u32,
    /// Norm of the gradient [N] over free vertices at the end.
    pub gradient: f64,
    /// Norm of the gradient [N] at the start.
    pub start_gradient: f64,
    /// True where the gradient is as small as was asked, or as small as round-off lets it be.
    pub converged: bool,
    /// True where the exact Hessian at the end is positive definite: a minimum, not a saddle.
    pub minimum: bool,
}

/// Minimises from `x`, whose pinned vertices stay, as long as `goes_on` says so before a step.
pub fn minimise(
    objective: &Objective<'_>,
    pattern: &Pattern,
    factorization: &mut Factorization,
    (tolerance, goes_on): (&Tolerance, &dyn Fn() -> bool),
    x: &mut Vec<Vec3<f64>>,
) -> Result<Convergence, FactorError> {
    let mut gradient = objective.gradient(x);
    let start_gradient = free_norm(pattern, &gradient);
    let mut convergence = Convergence {
        steps: 0,
        projected: 0,
        gradient: start_gradient,
        start_gradient,
        converged: false,
        minimum: false,
    };
    let mut trial = x.clone();
    while convergence.gradient > tolerance.relative * start_gradient
        && convergence.steps < tolerance.steps
    {
        if !goes_on() {
            return Err(FactorError::Stopped);
        }
        let exact = factorize(objective, pattern, factorization, x)?;
        let step = factorization.solve(pattern, &gradient);
        // `step` is H^-1 grad: the direction is its negative.
        let slope: f64 = step.iter().zip(&gradient).map(|(s, g)| -s.dot(*g)).sum();
        let before = objective.value(x);
        // Terms round by themselves, and sums of many by the root of their number.
        let noise = (16.0 + (x.len() as f64).sqrt()) * f64::EPSILON * before.size;
        let mut accepted = None;
        let mut length = 1.0;
        for _ in 0..HALVINGS {
            for ((t, x), s) in trial.iter_mut().zip(x.iter()).zip(&step) {
                *t = *x + *s * -length;
            }
            let after = objective.value(&trial);
            if after.sum <= before.sum + SUFFICIENT * length * slope {
                accepted = Some(objective.gradient(&trial));
            } else if length * slope.abs() < noise && after.sum <= before.sum + noise {
                let candidate = objective.gradient(&trial);
                let shrinks = free_norm(pattern, &candidate) < 0.5 * convergence.gradient;
                accepted = shrinks.then_some(candidate);
                if accepted.is_none() {
                    break;
                }
            }
            if accepted.is_some() {
                break;
            }
            length *= 0.5;
        }
        let Some(accepted) = accepted else {
            // Neither potential nor gradient can be lowered further: this is round-off's floor, if
            // what the step promised is within the noise of the potential.
            convergence.converged = slope.abs() < noise;
            break;
        };
        std::mem::swap(x, &mut trial);
        gradient = accepted;
        convergence.gradient = free_norm(pattern, &gradient);
        convergence.steps += 1;
        convergence.projected += u32::from(!exact);
    }
    convergence.converged |= convergence.gradient <= tolerance.relative * start_gradient;
    let hessian = objective.hessian(x, pattern, false);
    // Positions are stored to eps |x|, which the stiffness turns into this much of a gradient; where
    // nothing acts there is no other, and no share of it can be asked for.
    let noise = 4.0 * f64::EPSILON * hessian.largest_diagonal(pattern) * free_norm(pattern, x);
    convergence.converged |= convergence.gradient <= noise;
    convergence.minimum = factorization.factorize(pattern, &hessian).is_ok();
    Ok(convergence)
}

/// Factorises the exact Hessian, or the nearest thing to it that is positive; tells which.
fn factorize(
    objective: &Objective<'_>,
    pattern: &Pattern,
    factorization: &mut Factorization,
    x: &[Vec3<f64>],
) -> Result<bool, FactorError> {
    let exact = objective.hessian(x, pattern, false);
    match factorization.factorize(pattern, &exact) {
        Ok(()) => return Ok(true),
        Err(FactorError::Indefinite) => {}
        Err(error) => return Err(error),
    }
    let mut matrix = objective.hessian(x, pattern, true);
    // The exact matrix's, because everywhere compressed tissue may have nothing positive at all.
    let scale = exact.largest_diagonal(pattern);
    let mut shift = 0.0;
    for step in 0..SHIFTS {
        match factorization.factorize(pattern, &matrix) {
            Ok(()) => return Ok(false),
            Err(error @ (FactorError::TooLarge | FactorError::Stopped)) => return Err(error),
            Err(FactorError::Indefinite) => {
                let next = scale * FIRST_SHIFT * 10f64.powi(step);
                matrix.shift(pattern, next - shift);
                shift = next;
            }
        }
    }
    // Not even a multiple of the identity helps: its entries are NaN.
    Err(FactorError::Indefinite)
}

/// Euclidean norm [N] over free vertices.
pub fn free_norm(pattern: &Pattern, gradient: &[Vec3<f64>]) -> f64 {
    let squares = pattern.free().iter().map(|&v| gradient[v as usize].length_squared());
    squares.sum::<f64>().sqrt()
}
