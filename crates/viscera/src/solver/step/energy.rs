//! The energy limit: no step ends with more mechanical energy than it began with and was given, as far
//! as velocities can give it back.
//!
//! ```text
//! T_1 <= T_n + V(x_n with pins moved) - V(x_1) + sum_i (m_i g + f_i) . (x_1 - x_n)_i
//! v *= sqrt(limit/T_1) where it is exceeded;  T: kinetic energy of the free vertices, V: tissue with
//! its viscosity, springs, attachments, tethers
//! ```
//!
//! Implicit Euler dissipates: where the stored energy is convex along the step, its exact solution holds
//! this by itself. Sweeps that stop early do not: the step guard bounds `Phi`, which lets the kinetic
//! energy grow up to fourfold, and kept multipliers that trail a fast motion push it on, step after
//! step. With several substeps stiff, nearly incompressible tissue then never comes to rest. Scaling
//! velocities takes that energy back and moves no position, so that the state of rest is untouched.
//! Round-off gets no allowance: what a step may gain by it, step after step, would add up.
//!
//! Where tools move,
//!
//! ```text
//! T_1 <= min(A, max(B, T_n)),  A: the above, tools moved;   B = T_n + V(x_n, tools not moved) - V(x_1) + f.(x_1 - x_n) + W
//! ```
//!
//! with `W` the work of the forces that tools report (`contacts`): otherwise a tool could put in more than it says. Explicit
//! steps know the work of all forces along the way, and `T_1 <= B` with it is all that is asked.
//!
//! Every connected part of the model has a limit of its own, so that one body does not slow another. A
//! part that nothing holds keeps its momentum: there everything is relative to its center of mass. Where tissue meets tissue
//! it keeps its angular momentum as well, and what finding pairs anew adds to the energy of contact counts as made of nothing.

use super::contacts::Gift;
use super::data::{Step, StepConstants, StepData};
use crate::scalar::{Mat3, Real, Vec3};
use crate::solver::report::StepReport;

/// The energies of a connected part and the work done on it in a step; sums over its free vertices.
#[derive(Clone, Copy, Debug, Default)]
struct Energy {
    /// Whether a pin, an attachment or a tether holds it.
    held: bool,
    /// [kg].
    mass: f64,
    /// [N].
    load: Vec3<f64>,
    /// Work of the load [J].
    work: f64,
    /// Of tools.
    tools: Gift,
    /// Mass times displacement [kg m].
    shift: Vec3<f64>,
    /// Of tissue that meets tissue, at the end of the step.
    turning: Option<Turning>,
    /// With the places and velocities of the step's start, and of its end.
    start: Motion,
    end: Motion,
}

/// How a group of parts turns, about the origin.
#[derive(Clone, Copy, Debug, Default)]
struct Turning {
    /// Mass times place [kg m].
    place: Vec3<f64>,
    /// [kg m^2].
    inertia: Mat3<f64>,
    /// [kg m^2/s].
    angular: Vec3<f64>,
}

impl Turning {
    fn add(&mut self, mass: f64, place: Vec3<f64>, velocity: Vec3<f64>) {
        self.place += place * mass;
        self.angular += place.cross(velocity) * mass;
        self.inertia = self.inertia
            + (Mat3::IDENTITY * place.length_squared() + Mat3::outer(place, place) * -1.0) * mass;
    }

    fn plus(self, other: Self) -> Self {
        Self {
            place: self.place + other.place,
            inertia: self.inertia + other.inertia,
            angular: self.angular + other.angular,
        }
    }

    /// The centre of mass [m], the spin about it [rad/s] and the energy [J] that it has; what has no extent does not spin.
    fn spin(&self, mass: f64, momentum: Vec3<f64>) -> (Vec3<f64>, Vec3<f64>, f64) {
        let center = self.place * (1.0 / mass);
        let of_center =
            (Mat3::IDENTITY * center.length_squared() + Mat3::outer(center, center) * -1.0) * mass;
        let angular = self.angular - center.cross(momentum);
        let spin = (self.inertia + of_center * -1.0).inverse() * angular;
        if spin.is_finite() {
            (center, spin, 0.5 * angular.dot(spin))
        } else {
            (center, Vec3::ZERO, 0.0)
        }
    }
}

/// Motion as of a rigid body.
#[derive(Clone, Copy, Debug, Default)]
struct Rigid {
    /// [m/s].
    drift: Vec3<f64>,
    /// [m].
    center: Vec3<f64>,
    /// About the centre [rad/s].
    spin: Vec3<f64>,
}

impl Rigid {
    /// Velocity [m/s] of a place [m].
    fn at(&self, place: Vec3<f64>) -> Vec3<f64> {
        self.drift + self.spin.cross(place - self.center)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    /// Of tissue, springs and attachments [J].
    stored: f64,
    /// Kinetic energy [J].
    kinetic: f64,
    /// [kg m/s].
    momentum: Vec3<f64>,
}

impl Motion {
    fn plus(self, other: Self) -> Self {
        Self {
            stored: self.stored + other.stored,
            kinetic: self.kinetic + other.kinetic,
            momentum: self.momentum + other.momentum,
        }
    }

    fn add<S: Real>(&mut self, mass: f64, velocity: Vec3<S>) {
        let velocity = velocity.cast::<f64>();
        self.kinetic += 0.5 * mass * velocity.length_squared();
        self.momentum += velocity * mass;
    }
}

impl Energy {
    /// Of two parts of a group: what holds one holds both.
    fn plus(self, other: Self) -> Self {
        Self {
            held: self.held || other.held,
            mass: self.mass + other.mass,
            load: self.load + other.load,
            work: self.work + other.work,
            tools: self.tools.plus(other.tools),
            shift: self.shift + other.shift,
            turning: self.turning.zip(other.turning).map(|(a, b)| a.plus(b)),
            start: self.start.plus(other.start),
            end: self.end.plus(other.end),
        }
    }

    /// Kinetic energy [J] that is left to the end of the step, kinetic energy that it has, and the motion that neither counts.
    fn balance(&self) -> (f64, f64, Rigid) {
        let mut given = self.start.kinetic + self.start.stored - self.end.stored + self.work;
        let mut kinetic = self.end.kinetic;
        let mut rigid = Rigid::default();
        if !self.held && self.mass > 0.0 {
            // Inner forces change no momentum, so the limit must not either: the energy of the centre of mass is
            // taken out of both sides (`p^2/2M` of the kinetic energies, the work [J] of the total load along the
            // way of the centre). Otherwise a body in free fall would be braked because it swings.
            let inverse = 1.0 / self.mass;
            rigid.drift = self.end.momentum * inverse;
            kinetic -= 0.5 * inverse * self.end.momentum.length_squared();
            given -= 0.5 * inverse * self.start.momentum.length_squared();
            given -= inverse * self.load.dot(self.shift);
            if let Some(turning) = &self.turning {
                // Nor do they change how a group turns. How much energy that has is part of the balance.
                let (center, spin, energy) = turning.spin(self.mass, self.end.momentum);
                (rigid.center, rigid.spin) = (center, spin);
                kinetic -= energy;
                given -= energy;
            }
        }
        if self.tools.is_near {
            // Tools move while the tissue stands: that bound charges the overlap that they make. The other charges what
            // they say that they do, and only forbids to gain: it never stops a body.
            let by_work = given - self.tools.lifted + self.tools.work();
            given = match self.tools.exact {
                Some(_) => by_work,
                None => given.min(by_work.max(self.start.kinetic)),
            };
        }
        (given, kinetic, rigid)
    }

    /// Mechanical energy [J] that the step has made of nothing: what it ends with, less what there was and what loads and
    /// tools have given.
    fn surplus(&self, kept_speed: f64) -> f64 {
        let before = self.start.kinetic + self.start.stored - self.tools.lifted;
        let after = kept_speed * kept_speed * self.end.kinetic + self.end.stored;
        after - before - self.work - self.tools.work()
    }

    /// Motion that is not scaled, and the factor for velocities relative to it.
    fn limit(&self) -> (Rigid, f64) {
        let (given, kinetic, rigid) = self.balance();
        // `given` is below zero where more energy is stored than there was. Positions are not moved, so the most that
        // can be taken is all motion. A comparison with NaN is false: nothing is scaled by it. Nor is what does not move but
        // with its centre of mass.
        let moves_too_much = kinetic > given && kinetic > 0.0;
        let share = if moves_too_much { (given.max(0.0) / kinetic).sqrt() } else { 1.0 };
        (rigid, share)
    }
}

impl Ledger {
    fn add(&mut self, energy: &Energy, kept_speed: f64) {
        self.stored += energy.end.stored;
        self.most_stored = self.most_stored.max(self.stored);
        if energy.tools.is_near {
            self.work += energy.tools.mean_work();
            self.surplus += energy.surplus(kept_speed).max(0.0);
        }
    }
}

/// Of each connected part of a model.
#[derive(Clone, Debug)]
pub struct Energies {
    parts: Vec<Energy>,
    /// Of each part that of its group, after [`Energies::end`].
    groups: Vec<Energy>,
    ledger: Ledger,
}

/// What tools have put into tissue since the solver was built.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ledger {
    /// Work of tools on tissue [J].
    pub work: f64,
    /// Mechanical energy [J] that steps have made of nothing while tools touched tissue: the sum of what single steps of
    /// connected parts gained beyond what loads and tools gave.
    pub surplus: f64,
    /// Energy [J] stored in tissue and contact at the end of the last step.
    pub stored: f64,
    /// The most that was ever stored [J].
    pub most_stored: f64,
}

impl Energies {
    /// For so many parts.
    pub fn new(parts: usize) -> Self {
        let none = vec![Energy::default(); parts];
        Self { parts: none.clone(), groups: none, ledger: Ledger::default() }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.parts[..]) + size_of_val(&self.groups[..])
    }

    /// Remembers energy and momentum before the step; `stored` is the stored energy [J] of each part there.
    pub fn begin<S: Real>(&mut self, step: &Step<'_, S>, data: &StepData<S>, stored: &[f64]) {
        let (model, constants) = (step.layout, &data.constants);
        for (number, (energy, part)) in self.parts.iter_mut().zip(model.parts.iter()).enumerate() {
            // Sums are added to in `limit`: without this they would be those of all steps so far.
            *energy = Energy { tools: constants.contacts.gift(number), ..Energy::default() };
            // What finding pairs anew has added is nothing that the step began with.
            energy.start.stored = stored[number] - constants.contacts.pairs.gain(number);
            // A hold can stop the centre of mass, so that the centre's energy counts too: `limit` takes nothing out.
            // So can a tool that is met within the step.
            energy.held = constants.holds(number, part) || energy.tools.is_near;
            // Tethers are inertia to the solver and no elements, so `stored` of the evaluator leaves them out. Their
            // targets are those of the end of the step, as the pins are.
            for tether in constants.tethers_of(part) {
                energy.start.stored += tether.energy(constants.previous[tether.vertex].vec3());
            }
            for v in part.vertices.clone() {
                if constants.inverse_masses[v] != S::ZERO {
                    energy.start.add(constants.masses[v].to_f64(), data.velocities[v]);
                }
            }
        }
    }

    /// Gives a part a little [J] more than it had, after [`Energies::begin`].
    pub fn give(&mut self, part: usize, energy: f64) {
        self.parts[part].start.stored += energy;
    }

    /// What is left [J] of what a part's group had and was given, after [`Energies::end`]; of all that it has a share at most.
    pub fn left(&self, part: usize, share: f64) -> f64 {
        let energy = &self.groups[part];
        let (given, kinetic, _) = energy.balance();
        let left = (given - kinetic).min(share * (energy.end.kinetic + energy.end.stored));
        // Nothing also where that is no number.
        left.max(0.0)
    }

    /// Measures the end of a step; `stored` is the stored energy [J] of each part now.
    pub fn end<S: Real>(&mut self, step: &Step<'_, S>, data: &StepData<S>, stored: &[f64]) {
        let (model, constants) = (step.layout, &data.constants);
        for (number, (energy, part)) in self.parts.iter_mut().zip(model.parts.iter()).enumerate() {
            let Energy { held, start, mut tools, .. } = *energy;
            tools.exact = constants.contacts.gift(number).exact;
            *energy = Energy { held, start, tools, ..Energy::default() };
            let meets = |part: usize| constants.contacts.pairs.is_any(part);
            if !held && constants.groups.of(number).any(meets) {
                energy.turning = Some(Turning::default());
            }
            energy.tools.work[1] =
                constants.contacts.work_after(&step.contact(), number, &data.points);
            energy.end.stored = stored[number];
            for tether in constants.tethers_of(part) {
                energy.end.stored += tether.energy(data.points[tether.vertex].vec3());
            }
            for v in part.vertices.clone() {
                if constants.inverse_masses[v] == S::ZERO {
                    continue;
                }
                let mass = constants.masses[v].to_f64();
                let load = step.inputs.gravity * constants.masses[v] + constants.external[v];
                let load = load.cast::<f64>();
                let moved = (data.points[v].vec3() - constants.previous[v].vec3()).cast::<f64>();
                energy.end.add(mass, data.velocities[v]);
                energy.mass += mass;
                energy.load += load;
                energy.work += load.dot(moved);
                energy.shift += moved * mass;
                if let Some(turning) = &mut energy.turning {
                    turning.add(mass, data.points[v].vec3().cast(), data.velocities[v].cast());
                }
            }
        }
        self.groups.copy_from_slice(&self.parts);
        constants.groups.pool(&mut self.groups, Energy::plus);
    }

    /// Whether a part's group stores more at its end than all energy that it had and was given, or no number: then no
    /// velocity is small enough. `round_off` is that of energies, relative.
    pub fn stores_too_much(&self, part: usize, round_off: f64) -> bool {
        let energy = &self.groups[part];
        let (given, _, _) = energy.balance();
        // Round-off of energies that nearly cancel is none of the step's.
        let stored = energy.start.stored.abs().max(energy.end.stored.abs());
        let round_off = round_off * (stored + energy.start.kinetic + energy.work.abs());
        given < -round_off || !given.is_finite()
    }

    /// How the step of a part's group of `dt` [s] ended, told by its energies: what it stores and moves with after
    /// [`Energies::limit`], and what it had and was given, times the squared step.
    pub fn report(&self, part: usize, dt: f64, round_off: f64) -> StepReport {
        let energy = &self.groups[part];
        let (given, kinetic, _) = energy.balance();
        let (_, share) = energy.limit();
        let stored = energy.start.stored.abs().max(energy.end.stored.abs());
        let squared = dt * dt;
        StepReport {
            potential: squared * (energy.end.stored + share * share * kinetic),
            limit: squared * (energy.end.stored + given),
            noise: squared * round_off * (stored + energy.start.kinetic + energy.work.abs()),
            rejected: false,
            kept_speed: share,
        }
    }

    /// What tools have put into tissue.
    pub fn ledger(&self) -> Ledger {
        self.ledger
    }

    /// Scales velocities down after [`Energies::end`], of parts that `limits`. `kept` is called with each part that is slowed
    /// down, and the factor of its velocities.
    pub fn limit<S: Real>(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        limits: impl Fn(usize, &StepConstants<S>) -> bool,
        mut kept: impl FnMut(usize, f64),
    ) {
        let (model, constants) = (step.layout, &data.constants);
        let free = |v: &usize| constants.inverse_masses[*v] != S::ZERO;
        let Self { groups, ledger, .. } = self;
        ledger.stored = 0.0;
        for (number, (energy, part)) in groups.iter().zip(model.parts.iter()).enumerate() {
            let (rigid, share) = energy.limit();
            let is_limited = share < 1.0
                && energy.mass > 0.0
                && constants.groups.of(number).any(|part| limits(part, constants));
            if constants.groups.leads(number) {
                ledger.add(energy, if is_limited { share } else { 1.0 });
            }
            if !is_limited {
                continue;
            }
            // What remains beside that is scaled as a whole, so it keeps its direction; squares of it scale by
            // `share^2`, which brings the kinetic energy to `given`.
            let scale = S::from_f64(share);
            for v in part.vertices.clone().filter(free) {
                let stays = rigid.at(data.points[v].vec3().cast()).cast();
                let velocity = &mut data.velocities[v];
                *velocity = stays + (*velocity - stays) * scale;
            }
            kept(number, share);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    /// A part that nothing holds may be watched from a train: what its step gains, and what of its motion about
    /// its centre of mass it keeps, is the same; only the drift moves along.
    #[test]
    fn a_part_that_nothing_holds_is_slowed_alike_in_every_moving_frame() {
        // Two masses [kg] that fly apart faster than they did: velocities [m/s] before and after.
        let bodies = [
            (0.2, vec3(0.5, 0.0, 0.1), vec3(0.9, 0.1, 0.0)),
            (0.3, -vec3(0.4, 0.2, 0.0), vec3(-1.1, 0.0, 0.3)),
        ];
        let seen_from = |train: Vec3<f64>| {
            let mut energy = Energy::default();
            for (mass, before, after) in bodies {
                energy.start.add(mass, before + train);
                energy.end.add(mass, after + train);
                energy.mass += mass;
            }
            (energy.start.stored, energy.end.stored) = (0.05, 0.02);
            energy.limit()
        };
        let (still, share) = seen_from(Vec3::ZERO);
        assert!((0.1..0.9).contains(&share), "{share}");
        for train in [vec3(3.0, 0.0, 0.0), vec3(-20.0, 10.0, 5.0)] {
            let (drift, moving) = seen_from(train);
            assert!((drift.drift - still.drift - train).length() < 1e-13 * train.length());
            // Rounding of the train's energy, of that within.
            let rounding = f64::EPSILON * train.length_squared() / 0.05;
            assert!((moving - share).abs() < 16.0 * rounding, "{moving} and {share}");
        }
    }

    /// Masses that turn and fly apart end with the energy that they were given, and their momentum and angular momentum.
    #[test]
    fn a_group_that_is_slowed_has_what_it_was_given_and_turns_as_before() {
        let bodies = [
            (0.2, vec3(0.1, 0.0, 0.02), vec3(0.9, 0.8, 0.0)),
            (0.3, vec3(-0.1, 0.05, 0.0), vec3(-1.1, 0.1, 0.3)),
            (0.1, vec3(0.0, -0.1, 0.1), vec3(0.4, -0.9, 0.2)),
            (0.4, vec3(0.05, 0.1, -0.1), vec3(-0.6, 0.5, -0.7)),
        ];
        let mut energy = Energy { turning: Some(Turning::default()), ..Energy::default() };
        for (mass, place, velocity) in bodies {
            energy.end.add(mass, velocity);
            energy.mass += mass;
            energy.turning.as_mut().expect("it turns").add(mass, place, velocity);
        }
        // It began with the same momentum, and less energy.
        energy.start = energy.end;
        energy.start.stored = -0.1 * energy.end.kinetic;
        let (rigid, share) = energy.limit();
        assert!((0.1..0.95).contains(&share), "{share}");
        let (mut kinetic, mut momentum, mut angular) = (0.0, Vec3::ZERO, Vec3::ZERO);
        for (mass, place, velocity) in bodies {
            let stays = rigid.at(place);
            let kept = stays + (velocity - stays) * share;
            kinetic += 0.5 * mass * kept.length_squared();
            momentum += (kept - velocity) * mass;
            angular += place.cross(kept - velocity) * mass;
        }
        assert!((kinetic / (0.9 * energy.end.kinetic) - 1.0).abs() < 1e-13, "{kinetic}");
        assert!(momentum.length() < 1e-15 && angular.length() < 1e-15, "{momentum:?} {angular:?}");
    }
}
