//! Whether a run has come to rest, and what to do where it has not.

use super::{PatchForce, Simulation};
use crate::rest::WayToRest;
use crate::scalar::{Real, Vec3};
use crate::scene::Scene;
use crate::settings::{HAS_MEETINGS, Method};
use crate::solver::balance::ForceBalance;
use crate::state::ContactState;

/// A run is at rest where it is less than this share of its displacement away. Half of a percent: an error of one percent must
/// be warned of, one of a fifth of a percent must not.
const AWAY: f64 = 0.005;

/// Differences of forces below this share of the forces of unseen strains count as nothing. The latter are a sum over all
/// tetrahedra; a patch carries a small part of it.
const UNSEEN: f64 = 0.05;

/// The share of the displacement that a run which goes on longer is to come to.
const NEAR: f64 = 0.001;

/// A way that takes longer than this many times what was simulated so far is not gone any more: the budget decides
/// where the tissue stands.
const PATIENCE: f64 = 10.0;

/// What is away from rest swings where its motion alone would carry it this share of the way: what creeps moves
/// by thousandths of that.
const SWINGING: f64 = 0.2;

/// What stands elsewhere has unbalanced forces of the share of its way that is left. Where inertia accounts for all but this
/// share of them, the tissue has only begun to move.
const UNBALANCED: f64 = 0.2;

/// A run at its end, whose loads no longer change, beside its state of rest.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RestReport {
    /// Estimate of the largest distance [m] of a vertex from its place at rest.
    pub distance: f64,
    /// The same over the largest displacement at rest.
    pub error: f64,
    /// The largest difference between the force on a patch and what it is at rest, over the largest such force.
    pub force_error: f64,
    /// Apparent stiffness over the true one, minus one: above zero the tissue is displaced too little so far.
    pub stiffness: f64,
    /// Estimate of the largest excursion over the largest displacement, if all that moves swings.
    pub swing: f64,
    /// Largest speed [m/s].
    pub speed: f64,
    /// The share of the way that is gone in a second [1/s]; zero or less where it is not gone.
    pub approach: f64,
    /// Unbalanced forces of the last step, inertia among them, over the loads.
    pub residual: f64,
    /// False where the estimate ended early: the distance is at least so much.
    pub complete: bool,
    /// False where the forces push tissue on rather than back along some way.
    pub stable: bool,
}

/// Where a run stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// As near as matters.
    AtRest,
    /// It swings.
    Swinging,
    /// It goes there slowly.
    Creeping,
    /// It stands elsewhere.
    Elsewhere,
}

impl RestReport {
    /// Where the run stands, after so long a time [s].
    pub fn standing(&self, time: f64) -> Standing {
        let error = self.largest_error();
        let has_far_to_go = error > AWAY || !self.stable && error > NEAR;
        match () {
            () if self.swing > AWAY && self.swing > SWINGING * error => Standing::Swinging,
            () if !has_far_to_go => Standing::AtRest,
            () if self.swing > SWINGING * error => Standing::Swinging,
            () if self.approach > 0.0 && self.time_left() < PATIENCE * time => Standing::Creeping,
            () if self.stable && self.residual < UNBALANCED * self.error => Standing::Swinging,
            () => Standing::Elsewhere,
        }
    }

    /// Of displacement and forces.
    pub fn largest_error(&self) -> f64 {
        self.error.max(self.force_error)
    }

    /// How long [s] until a tenth of a percent is left, where the way goes on as it does.
    pub fn time_left(&self) -> f64 {
        (self.largest_error() / NEAR).max(1.0).ln() / self.approach
    }

    /// What a person should know, and do, where a scene has not come to rest after a time [s].
    pub fn warning(&self, scene: &Scene, time: f64) -> Option<String> {
        let standing = self.standing(time);
        let error = self.largest_error();
        let away = format!(
            "{} {:.1} % of the displacement ({:.2} mm) and {:.1} % of the forces away from the state of rest",
            if self.complete { "about" } else { "at least" },
            100.0 * self.error,
            1e3 * self.distance,
            100.0 * self.force_error,
        );
        let damping = match scene.time.velocity_factor {
            factor if factor > 0.9 => "set time.velocity_factor = 0.9, give tissue viscosity, or ",
            _ => "",
        };
        Some(match standing {
            Standing::AtRest => return None,
            Standing::Swinging => format!(
                "not at rest yet: the tissue still moves at up to {:.1} mm/s and swings by about {:.1} % of its \
                 displacement; {damping}raise time.duration",
                1e3 * self.speed,
                100.0 * self.swing.max(error),
            ),
            Standing::Creeping => format!(
                "not at rest yet: {away} and still moving at up to {:.2} mm/s; raise time.duration to about {:.0} s{}",
                1e3 * self.speed,
                (time + self.time_left()).ceil(),
                match scene.solver.method {
                    Method::Xpbd => ", or solver.iterations, which brings it there faster",
                    Method::Auto | Method::Explicit | Method::QuasiNewton => "",
                },
            ),
            Standing::Elsewhere if !self.stable => format!(
                "the tissue is not in a stable state: {away}, and some of it is pushed on rather than back; it \
                 may be about to buckle; {}",
                if scene.solver.rebase {
                    "raise time.duration".into()
                } else {
                    super::advice::budget(scene)
                },
            ),
            Standing::Elsewhere => format!(
                "the solver falls short: {away}, as if the tissue were {:.1} % {}; {}",
                100.0 * self.stiffness.abs(),
                if self.stiffness > 0.0 { "stiffer" } else { "softer" },
                super::advice::budget(scene),
            ),
        })
    }
}

impl<S: Real> Simulation<S> {
    /// How far the last frame is from the state of rest; nothing before the first frame, where nothing is held, and
    /// while what the scene does changes, and where there is contact, of which the way to rest knows nothing: then there is none to come to. Takes about as long as some dozens of frames of a small mesh,
    /// seconds for a large one, and memory while it lasts: for the end of a run.
    pub fn rest(&self) -> Option<RestReport> {
        let (time, frame) = (self.time(), self.scene.time.frame);
        if !self.stepped || self.unread > 0 || self.has_contact() {
            return None;
        }
        let inputs = self.inputs_at(time);
        if self.inputs_at(time - frame) != inputs {
            return None;
        }
        // Over the frame: velocities of a last substep are also what sweeps correct.
        let positions = &self.state.positions;
        let steps = positions.iter().zip(&self.before).map(|(x, y)| x.cast::<f64>() - y.cast());
        let lasted = frame * self.frames_since_before as f64;
        let velocities: Vec<Vec3<f64>> = steps.map(|step| step * (1.0 / lasted)).collect();
        let measured =
            WayToRest::measure(&self.model, positions, &velocities, &inputs, self.solver.elements)?;
        let speed = velocities.iter().map(|v| v.length()).fold(0.0, f64::max);
        let gone: f64 = velocities.iter().zip(&measured.way).map(|(v, way)| v.dot(*way)).sum();
        let length: f64 = measured.way.iter().map(|way| way.length_squared()).sum();
        let is_displaced = measured.displacement > 0.0;
        Some(RestReport {
            distance: measured.distance,
            error: measured.error(),
            force_error: self.force_error(&measured),
            stiffness: measured.stiffness,
            swing: if is_displaced { measured.excursion / measured.displacement } else { 0.0 },
            speed,
            approach: if length > 0.0 { gone / length } else { 0.0 },
            residual: self.balance.relative_residual(),
            complete: measured.complete,
            stable: measured.stable,
        })
    }

    /// Whether there are tools or ties, or tissue that presses on tissue.
    pub(super) fn has_contact(&self) -> bool {
        let Self { scene, state, backend, .. } = self;
        let is_any = |contact: &ContactState| !contact.pairs.is_empty();
        // What tissue presses on stays on a device until it is asked for.
        let is_there = HAS_MEETINGS && backend.device().is_some();
        !scene.tools.is_empty()
            || !scene.ties.is_empty()
            || is_any(&state.contact)
            || (is_there && is_any(&self.contact_of(state)))
    }

    /// How far the forces on patches are from those at rest, over the largest of those.
    fn force_error(&self, measured: &WayToRest) -> f64 {
        let positions = self.state.positions.iter().zip(&measured.way);
        let there: Vec<Vec3<f64>> = positions.map(|(x, way)| x.cast::<f64>() + *way).collect();
        let at_rest = self.patch_forces_at(self.time(), &there, &measured.holding);
        self.apart(&self.patch_forces(), &at_rest)
    }

    /// The largest difference between forces on patches and the true ones, over the largest of those.
    pub(super) fn apart(&self, ours: &[PatchForce], true_ones: &[PatchForce]) -> f64 {
        let length = |force: [f64; 3]| Vec3::from_f64(force).length();
        let largest = true_ones.iter().map(|patch| length(patch.force)).fold(0.0, f64::max);
        let apart = ours.iter().zip(true_ones);
        let apart =
            apart.map(|(a, b)| (Vec3::from_f64(a.force) - Vec3::from_f64(b.force)).length());
        // What rounding makes is no difference, and the forces of strains that nobody sees are no measure.
        let ForceBalance { rounding, force_floor, .. } = self.balance;
        let unseen = rounding.max(UNSEEN * force_floor);
        let apart = (apart.fold(0.0, f64::max) - unseen).max(0.0);
        if apart > 0.0 { apart / (largest + force_floor) } else { 0.0 }
    }
}
