//! A tool that a spring holds in a hand: a rigid body that gives way to tissue, as it must where a haptic device is to feel it.
//!
//! ```text
//! m (a - ..) = k (t_h - t) + c (v_h - v) + F        hand's pose (R_h, t_h), the body's (R, t);   turning: the same times rho^2
//! step: min over u, w   m/2 |u/dt - v|^2 + k/2 |t + u - t_h|^2 + c/(2 dt) |u - dt v_h|^2 + (turning) + sum_s phi_s(G_s) + H_s
//! G_s = g_s + N_s/kappa + n.(u + w x r)              overlap of sample s and tool, with what the tissue there has yielded
//! N(G): contact of stiffness A k and tissue of stiffness kappa = 4 A E/h in a row;   H_s: friction, the same across n
//! ```
//!
//! The tool moves first, against tissue as the last step has left it, and the tissue follows in the step. Both are implicit:
//! neither can put energy into the other for want of steps, and at rest the force of the spring is the force of the tissue
//! exactly. Virtual coupling of a haptic device to a simulated body: Colgate, Stanley, Brown, "Issues in the haptic display of
//! tool use", IROS 1995.
//!
//! `kappa` decides how fast a tool comes to rest, not where. It is a little more than tissue has under the tip of a probe. Where
//! the tissue turns out to be firmer, as between a tool and a bone, what the step before has shown counts (`firm`): with
//! less than half of the true stiffness the tool would swing from step to step.

use super::law::{Foundation, SECOND_STAGE, tangential};
use super::{Tool, Touch};
use crate::scalar::rigid::{RigidTransform, rotation_matrix, rotation_vector};
use crate::scalar::{Mat3, Vec3};

/// How a hand holds a tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// `k`: from the hand to the tool's origin [N/m].
    pub stiffness: f64,
    /// `m`: of the tool with what of the hand moves with it [kg].
    pub mass: f64,
}

/// `rho`: radius of gyration of a tool in a hand [m]. Its spring resists turns by `rho^2` times as much.
pub const GYRATION: f64 = 0.03;

/// The damping of a spring, as a share of the critical one.
const DAMPING: f64 = 1.0;

/// `kappa h/(A E)`.
const YIELD: f64 = 4.0;

/// A step that has met so many times the stiffness that was expected makes the next one expect more; at most so much more.
const SURPRISE: f64 = 1.5;
const FIRMEST: f64 = 1e3;

/// Nothing is learned of less work than this [J].
const LEAST_WORK: f64 = 1e-13;

/// What was learned is forgotten by this factor in every step.
const FORGETS: f64 = 0.9;

/// Newton steps for where the tool goes. Forces are piecewise linear: two or three are enough.
const NEWTON_STEPS: usize = 8;

/// Puts the parts of a body from where a hand would have them to where the body is.
pub(crate) fn carry(parts: &mut [Tool], body: &RigidTransform) {
    for part in parts {
        let Some(Held { hand, .. }) = part.held else { continue };
        part.pose = RigidTransform {
            rotation: body.rotation * (hand.rotation.transpose() * part.pose.rotation),
            translation: body.apply(hand.undo(part.pose.translation)),
        };
    }
}

impl Default for Spring {
    fn default() -> Self {
        Self { stiffness: 400.0, mass: 0.03 }
    }
}

impl Spring {
    /// Between hand and tool [N s/m].
    pub fn damping(&self) -> f64 {
        2.0 * DAMPING * (self.stiffness * self.mass).sqrt()
    }

    /// What is wrong with it, in words; nothing where it is legal.
    pub fn complaint(&self) -> Option<&'static str> {
        if !(1e-3..=1e7).contains(&self.stiffness) {
            return Some(
                "the spring of a held tool is between 0.001 and 10000000 N/m; 400 N/m suits a hand",
            );
        }
        (!(1e-4..=1e3).contains(&self.mass))
            .then_some("the mass of a held tool is between 0.1 g and 1000 kg; 30 g suits a laparoscope's grasper")
    }
}

/// Part of a tool that a spring holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// How.
    pub spring: Spring,
    /// Where the hand is at the end of the step: the tool's own frame, where nothing is in its way.
    pub hand: RigidTransform,
    /// The body that it is a part of: tools one after the other in the list with one number are one rigid body.
    pub body: u32,
}

/// How a held tool moves, from step to step.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HeldMotion {
    /// Where the tool is and where the hand is; nothing before the first step.
    pub poses: Option<[RigidTransform; 2]>,
    /// Of the tool's origin [m/s].
    pub velocity: Vec3<f64>,
    /// [rad/s].
    pub spin: Vec3<f64>,
    /// The force [N] of its spring on the hand at the end of the step, damping among it: what a haptic device lets feel.
    pub force: Vec3<f64>,
    /// The same of the torque [N m].
    pub torque: Vec3<f64>,
    /// Samples of tissue that it pressed on where the step began.
    pub touches: u32,
    /// What it knows of the tissue's firmness.
    pub learned: Firmness,
}

/// What a held tool has found of the tissue it presses on.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Firmness {
    /// How many times as firm tissue is taken to be.
    pub firm: f64,
    /// The way of the last step [m, rad], the force and torque of tissue before it, and the stiffness expected along it [N/m].
    pub way: [Vec3<f64>; 2],
    /// [N, N m].
    pub before: [Vec3<f64>; 2],
    /// Times the squared way [J].
    pub expected: f64,
}

impl Default for Firmness {
    fn default() -> Self {
        let none = [Vec3::ZERO; 2];
        Self { firm: 1.0, way: none, before: none, expected: 0.0 }
    }
}

/// A sample that a held tool presses on where its step begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pressing {
    /// From the tool's origin [m].
    pub arm: Vec3<f64>,
    /// Away from the tool.
    pub normal: Vec3<f64>,
    /// Normal force [N].
    pub pressed: f64,
    /// Friction on the tissue [N].
    pub drag: Vec3<f64>,
    /// The most that friction may be [N].
    pub limit: f64,
    /// The constants of contact.
    pub foundation: Foundation,
    /// `kappa` [N/m], infinite where nothing yields.
    pub kappa: f64,
    /// How far it is inside the contact's thickness [m].
    pub overlap: f64,
}

impl Pressing {
    /// Of what the last step has left at a sample: `plain` is `A E/h` of the tissue [N/m].
    pub fn new(
        tool: &Tool,
        (pose, origin): (&RigidTransform, Vec3<f64>),
        (foundation, plain): (Foundation, f64),
        touch: &Touch,
    ) -> Self {
        let normal = pose.turn(touch.normal);
        let distance = touch.normal.dot(pose.undo(touch.place)) - touch.offset;
        let drag = touch.force - normal * touch.pressed;
        let limit = if touch.is_tied { f64::INFINITY } else { tool.law.friction * touch.pressed };
        Self {
            arm: touch.place - origin,
            normal,
            pressed: touch.pressed,
            drag,
            limit,
            foundation,
            kappa: YIELD * plain,
            overlap: foundation.thickness - distance,
        }
    }

    /// Normal force [N] and its derivative [N/m] after the tool has gone a way [m] into the tissue.
    fn squeeze(&self, way: f64, firm: f64) -> [f64; 2] {
        let Foundation { area, stiffness, thickness } = self.foundation;
        let (k, kappa) = (area * stiffness, self.kappa * firm);
        let all = self.overlap + self.pressed / kappa + way;
        let [soft, hard] =
            [(k, 0.0), (SECOND_STAGE * k, 0.5 * (SECOND_STAGE - 1.0) * k * thickness)].map(
                |(k, less)| {
                    let share = 1.0 / (1.0 + k / kappa);
                    [(k * all - less) * share, k * share]
                },
            );
        let most = if hard[0] > soft[0] { hard } else { soft };
        if most[0] > 0.0 { most } else { [0.0; 2] }
    }

    /// Friction on the tissue [N] and a bound of its derivative [N/m] after the tool has gone a way [m] along it.
    fn drag(&self, way: Vec3<f64>, firm: f64) -> (Vec3<f64>, f64) {
        let (k, kappa) = (self.foundation.area * self.foundation.stiffness, self.kappa * firm);
        if self.limit <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let stiffness = k / (1.0 + k / kappa);
        let force = self.drag + way * stiffness;
        let length = force.length();
        if length <= self.limit {
            return (force, stiffness);
        }
        let share = self.limit / length;
        (force * share, stiffness * share)
    }

    /// Force on the tissue [N] after the tool has moved and turned, and the derivative of it.
    fn force(&self, [moved, turned]: [Vec3<f64>; 2], firm: f64) -> (Vec3<f64>, [f64; 2]) {
        let way = moved + turned.cross(self.arm);
        let [pressed, stiffness] = self.squeeze(way.dot(self.normal), firm);
        // What is tied is held in every direction.
        let is_tied = self.limit.is_infinite();
        let slip = if is_tied { way } else { tangential(way, self.normal) };
        let (drag, across) = self.drag(slip, firm);
        let along = if is_tied { stiffness + across } else { stiffness };
        (self.normal * pressed + drag, [along, across])
    }
}

/// What holds a body at the beginning of a step.
struct Hands {
    /// How far the hand is [m, rad], and how far it goes in the step.
    away: [Vec3<f64>; 2],
    goes: [Vec3<f64>; 2],
}

impl HeldMotion {
    /// Moves a body for a step of `dt` [s] at whose end the hand is at `hand`. `each` calls with every sample that the body
    /// presses on; they are constants of the step.
    pub fn step(
        &mut self,
        spring: &Spring,
        hand: &RigidTransform,
        dt: f64,
        each: impl Fn(&mut dyn FnMut(&Pressing)),
    ) {
        let [pose, before] = self.poses.unwrap_or([*hand, *hand]);
        let hands = Hands { away: difference(&pose, hand), goes: difference(&before, hand) };
        let mut felt = [Vec3::ZERO; 2];
        let mut touches = 0;
        each(&mut |at| {
            touches += 1;
            let force = at.normal * at.pressed + at.drag;
            felt[0] -= force;
            felt[1] -= at.arm.cross(force);
        });
        self.touches = touches;
        self.learned.learn(&felt);
        let firm = self.learned.firm;
        let mut way = [self.velocity * dt, self.spin * dt];
        let mut matrix = [[0.0; 6]; 6];
        for _ in 0..NEWTON_STEPS {
            let mut residual = self.inertia(spring, &hands, &way, dt, &mut matrix);
            each(&mut |at| add_contact(at, &way, firm, &mut residual, &mut matrix));
            let change = solve(&matrix, residual);
            way[0] += change[0];
            way[1] += change[1];
            let size = change[0].length() + GYRATION * change[1].length();
            if size < 1e-12 {
                break;
            }
        }
        self.learned.way = way;
        self.learned.before = felt;
        let mut after = [Vec3::ZERO; 2];
        each(&mut |at| {
            let (force, _) = at.force(way, firm);
            after[0] -= force;
            after[1] -= at.arm.cross(force);
        });
        self.learned.expected = dot(&felt, &way) - dot(&after, &way);
        let rotation = orthonormal(rotation_matrix(way[1]) * pose.rotation);
        let pose = RigidTransform { rotation, translation: pose.translation + way[0] };
        self.velocity = way[0] * (1.0 / dt);
        self.spin = way[1] * (1.0 / dt);
        let (stretch, damping) = (difference(hand, &pose), spring.damping() / dt);
        let turning = GYRATION * GYRATION;
        self.force = stretch[0] * spring.stiffness + (way[0] - hands.goes[0]) * damping;
        self.torque =
            (stretch[1] * spring.stiffness + (way[1] - hands.goes[1]) * damping) * turning;
        self.poses = Some([pose, *hand]);
    }

    /// Puts a body where the hand is.
    pub fn put(&mut self, hand: &RigidTransform) {
        *self = Self { poses: Some([*hand, *hand]), ..Self::default() };
    }

    /// What inertia and spring ask for: minus the gradient [N, N m], and the matrix of their stiffness.
    fn inertia(
        &self,
        spring: &Spring,
        hands: &Hands,
        way: &[Vec3<f64>; 2],
        dt: f64,
        matrix: &mut [[f64; 6]; 6],
    ) -> [Vec3<f64>; 2] {
        let (mass, damping) = (spring.mass / (dt * dt), spring.damping() / dt);
        *matrix = [[0.0; 6]; 6];
        let start = [self.velocity * dt, self.spin * dt];
        let mut residual = [Vec3::ZERO; 2];
        for (half, times) in [(0, 1.0), (1, GYRATION * GYRATION)] {
            residual[half] = ((start[half] - way[half]) * mass
                + (hands.away[half] - way[half]) * spring.stiffness
                + (hands.goes[half] - way[half]) * damping)
                * times;
            for axis in 3 * half..3 * half + 3 {
                matrix[axis][axis] = (mass + spring.stiffness + damping) * times;
            }
        }
        residual
    }
}

impl Firmness {
    /// Compares what the last step has led to with what was expected.
    fn learn(&mut self, felt: &[Vec3<f64>; 2]) {
        let met = dot(&self.before, &self.way) - dot(felt, &self.way);
        // Rounding of places in single precision moves samples by nanometres.
        let is_firmer = met > SURPRISE * self.expected && met > LEAST_WORK;
        if is_firmer {
            let times = if self.expected > 0.0 { met / self.expected } else { 2.0 };
            self.firm = (self.firm * times.min(4.0)).min(FIRMEST);
        } else {
            self.firm = 1.0 + (self.firm - 1.0) * FORGETS;
        }
    }
}

fn dot(a: &[Vec3<f64>; 2], b: &[Vec3<f64>; 2]) -> f64 {
    a[0].dot(b[0]) + a[1].dot(b[1])
}

/// From one pose to another: of origins [m], and axis times angle [rad].
fn difference(from: &RigidTransform, to: &RigidTransform) -> [Vec3<f64>; 2] {
    let turn = rotation_vector(&(to.rotation * from.rotation.transpose()));
    [to.translation - from.translation, turn]
}

/// Adds what a sample does to a body that has gone a way.
fn add_contact(
    at: &Pressing,
    way: &[Vec3<f64>; 2],
    firm: f64,
    residual: &mut [Vec3<f64>; 2],
    matrix: &mut [[f64; 6]; 6],
) {
    let (force, [along, across]) = at.force(*way, firm);
    residual[0] -= force;
    residual[1] -= at.arm.cross(force);
    let block = super::law::block(at.normal, along, across);
    // `J^T B J` with `J = [I, -[r]]`: the way of the tool at the sample is `u + w x r`.
    let axes = [unit(0), unit(1), unit(2)];
    let columns: [Vec3<f64>; 6] =
        std::array::from_fn(|i| if i < 3 { axes[i] } else { axes[i - 3].cross(at.arm) });
    for (i, row) in matrix.iter_mut().enumerate() {
        let pulled = block * columns[i];
        for (entry, column) in row.iter_mut().zip(&columns) {
            *entry += pulled.dot(*column);
        }
    }
}

/// Of length 1 along an axis.
fn unit(axis: usize) -> Vec3<f64> {
    let mut unit = Vec3::ZERO;
    unit[axis] = 1.0;
    unit
}

/// `A^-1 b` of a positive definite matrix, by Cholesky's factors.
fn solve(matrix: &[[f64; 6]; 6], residual: [Vec3<f64>; 2]) -> [Vec3<f64>; 2] {
    let mut l = [[0.0; 6]; 6];
    for i in 0..6 {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let rest = matrix[i][j] - sum;
            l[i][j] = if i == j { rest.max(f64::MIN_POSITIVE).sqrt() } else { rest / l[j][j] };
        }
    }
    let [a, b] = residual;
    let mut x = [a.x, a.y, a.z, b.x, b.y, b.z];
    for i in 0..6 {
        let sum: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
        x[i] = (x[i] - sum) / l[i][i];
    }
    for i in (0..6).rev() {
        let sum: f64 = (i + 1..6).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - sum) / l[i][i];
    }
    [Vec3::from_f64([x[0], x[1], x[2]]), Vec3::from_f64([x[3], x[4], x[5]])]
}

/// A rotation again, after round-off of many steps.
fn orthonormal(rotation: Mat3<f64>) -> Mat3<f64> {
    let [a, b, _] = rotation.columns;
    let a = a * (1.0 / a.length());
    let b = b - a * a.dot(b);
    let b = b * (1.0 / b.length());
    Mat3::from_columns(a, b, a.cross(b))
}

#[cfg(test)]
mod tests;
