//! The momentum of what nothing outside holds.
//!
//! ```text
//! x_i += a + w x (x_i - c),   a = -sum m (x - xt)/sum m,   I w = -sum (x - c) x m (x + a - xt),   c: centre of mass
//! ```
//!
//! At the minimum of the incremental potential inner forces cancel: `sum m (x - xt) = 0`, and the same of moments. A solve
//! that stops early leaves a rest, which is small where only elements act. Contact is stiff and new in every step, so that two
//! bodies that collide would gain a share of their momentum. Moving all of a group as one rigid body takes the rest away, and
//! changes no strain. Velocities get the angular momentum in the same way that the step began with, which implicit steps lose.

use super::data::{Step, StepConstants};
use crate::scalar::lanes::Point;
use crate::scalar::{Mat3, Real, Vec3};

/// Whether tissue may meet tissue in the group of a part and nothing else acts on it but loads; true once for a group, of the
/// part that leads it.
fn is_free<S: Real>(step: &Step<'_, S>, constants: &StepConstants<S>, part: usize) -> bool {
    let (groups, parts) = (&constants.groups, &step.layout.parts);
    let holds = |number: usize| {
        // A tool that is near may push before the step is over.
        constants.contacts.gift(number).is_near || constants.holds(number, &parts[number])
    };
    step.layout.skin.is_some() && groups.leads(part) && !groups.of(part).any(holds)
}

/// Moves every group to where its momentum is what it has to be. `x` are places [m]; `xt` those of the constants.
pub fn keep_momentum<S: Real>(
    step: &Step<'_, S>,
    constants: &StepConstants<S>,
    x: &mut [Point<S>],
    part: usize,
) {
    if !is_free(step, constants, part) {
        return;
    }
    let (groups, parts) = (&constants.groups, &step.layout.parts);
    let vertices = || groups.of(part).flat_map(|part| parts[part].vertices.clone());
    let (mut mass, mut center, mut rest) = (0.0, Vec3::<f64>::ZERO, Vec3::<f64>::ZERO);
    for v in vertices() {
        let (m, place) = (constants.masses[v].to_f64(), x[v].vec3().cast::<f64>());
        mass += m;
        center += place * m;
        rest += (place - constants.predicted[v].vec3().cast()) * m;
    }
    let (center, shift) = (center * (1.0 / mass), rest * (-1.0 / mass));
    let (mut inertia, mut moment) = (Mat3::<f64>::ZERO, Vec3::<f64>::ZERO);
    for v in vertices() {
        let (m, place) = (constants.masses[v].to_f64(), x[v].vec3().cast::<f64>());
        let arm = place - center;
        inertia = inertia + inertia_of(arm) * m;
        moment += arm.cross(place + shift - constants.predicted[v].vec3().cast()) * m;
    }
    let turn = turn(&inertia, -moment);
    for v in vertices() {
        let place = x[v].vec3().cast::<f64>();
        x[v].set_vec3((place + shift + turn.cross(place - center)).cast());
    }
}

/// `I - a a^T` of a unit mass at an arm [m], for `w`: moment over mass.
fn inertia_of(arm: Vec3<f64>) -> Mat3<f64> {
    Mat3::IDENTITY * arm.length_squared() + Mat3::outer(arm, arm) * -1.0
}

/// The turn by which a body of this inertia has this moment; what has no extent turns about nothing.
fn turn(inertia: &Mat3<f64>, moment: Vec3<f64>) -> Vec3<f64> {
    let turn = inertia.inverse() * moment;
    if turn.is_finite() { turn } else { Vec3::ZERO }
}

/// Gives velocities `after` [m/s] at places `x` [m], those of a step's end, the momentum that follows from velocities
/// `before` at its start and from what acts.
pub fn keep_spin<S: Real>(
    step: &Step<'_, S>,
    constants: &StepConstants<S>,
    x: &[Point<S>],
    before: &[Vec3<S>],
    after: &mut [Vec3<S>],
) {
    for part in 0..step.layout.part_count() {
        if is_free(step, constants, part) {
            keep_spin_of(step, constants, x, before, after, part);
        }
    }
}

fn keep_spin_of<S: Real>(
    step: &Step<'_, S>,
    constants: &StepConstants<S>,
    x: &[Point<S>],
    before: &[Vec3<S>],
    after: &mut [Vec3<S>],
    part: usize,
) {
    let (groups, parts) = (&constants.groups, &step.layout.parts);
    let vertices = || groups.of(part).flat_map(|part| parts[part].vertices.clone());
    let wide = |v: Vec3<S>| v.cast::<f64>();
    let (mut mass, mut center, mut linear) = (0.0, Vec3::ZERO, Vec3::ZERO);
    let mut angular = Vec3::ZERO;
    for v in vertices() {
        let m = constants.masses[v].to_f64();
        let (start, end) = (wide(constants.previous[v].vec3()), wide(x[v].vec3()));
        let impulse = (wide(step.inputs.gravity) * m + wide(constants.external[v])) * step.dt;
        let middle = (start + end) * 0.5;
        mass += m;
        center += end * m;
        linear += (wide(before[v]) - wide(after[v])) * m + impulse;
        angular += start.cross(wide(before[v])) * m - end.cross(wide(after[v])) * m;
        angular += middle.cross(impulse);
    }
    let (center, shift) = (center * (1.0 / mass), linear * (1.0 / mass));
    let mut inertia = Mat3::<f64>::ZERO;
    for v in vertices() {
        let arm = wide(x[v].vec3()) - center;
        inertia = inertia + inertia_of(arm) * constants.masses[v].to_f64();
    }
    let turn = turn(&inertia, angular - center.cross(linear));
    for v in vertices() {
        let arm = wide(x[v].vec3()) - center;
        after[v] = (wide(after[v]) + shift + turn.cross(arm)).cast();
    }
}
