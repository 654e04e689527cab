//! The force that a haptic device exerts, tick by tick.
//!
//! ```text
//! F* = r k (t - x)                    t the tool as last seen, x the stylus, k its spring;  r 0 .. 1 in 10 ms of contact
//! |F*| <= sqrt(E 0.05 N/w)            while the stylus gives way by w = F.dx/|F| a tick: it falls no faster, see below
//! F* += dx (E - F*.dx)/|dx|^2         where E - F*.dx < 0: passivity controller
//! F = F_before + (F* - F_before) min(1, 0.05 N/|F* - F_before|)
//! E += -F.dx                          energy that the hand has put into the device [J]
//! ```
//!
//! Passivity in the time domain: Hannaford, Ryu, "Time-domain passivity control of haptic interfaces", IEEE Transactions on
//! Robotics and Automation 18, 2002. A force that is held for a tick gives back a little more than was put in; what is
//! missing is taken from the part of the force along the motion.

use crate::scalar::Vec3;
use crate::scalar::rigid::RigidTransform;

/// What a simulation has last told of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Where it is.
    pub pose: RigidTransform,
    /// Whether tissue touches it.
    pub touches: bool,
    /// Of the simulation [s].
    pub time: f64,
}

/// The force changes by no more than this [N] from tick to tick: what changes faster is felt as a knock.
pub const MOST_CHANGE: f64 = 0.05;

/// A contact's force comes, and goes, in this time [s].
const FADES: f64 = 0.01;

/// Energy [J] that a device has given to a hand, and been given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observer {
    /// What the hand has put in so far, less what it got back [J]; below zero the device has made energy.
    pub energy: f64,
    /// The least that this ever was [J].
    pub least: f64,
}

impl Observer {
    /// A force [N] that was held while the stylus went a way [m].
    pub fn watch(&mut self, force: Vec3<f64>, way: Vec3<f64>) {
        self.energy -= force.dot(way);
        self.least = self.least.min(self.energy);
    }
}

/// The force of a tool's spring as a device exerts it.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// Of the spring [N/m].
    stiffness: f64,
    /// The most that the device can do [N].
    strongest: f64,
    force: Vec3<f64>,
    /// How much of the contact is felt.
    share: f64,
    before: Option<Vec3<f64>>,
    observer: Observer,
    /// The largest change of the force so far [N].
    most_change: f64,
}

impl Rendering {
    /// For a spring [N/m] and a device that can push with so much [N].
    pub fn new(stiffness: f64, strongest: f64) -> Self {
        Self {
            stiffness,
            strongest,
            force: Vec3::ZERO,
            share: 0.0,
            before: None,
            observer: Observer::default(),
            most_change: 0.0,
        }
    }

    /// The force [N] on the hand for the tick of `dt` [s] that begins now, with the stylus there [m].
    pub fn tick(&mut self, at: Vec3<f64>, seen: &Seen, dt: f64) -> Vec3<f64> {
        let way = self.before.map_or(Vec3::ZERO, |before| at - before);
        self.before = Some(at);
        self.observer.watch(self.force, way);
        let towards = if seen.touches { dt } else { -dt };
        self.share = (self.share + towards / FADES).clamp(0.0, 1.0);
        let mut wanted = (seen.pose.translation - at) * (self.stiffness * self.share);
        let length = wanted.length();
        if length > self.strongest {
            wanted = wanted * (self.strongest / length);
        }
        // While the force falls by what it may in a tick it goes on giving energy: `F^2 w/(2 c)` where the stylus gives way by
        // `w` a tick. No more than half of what there is.
        let length = wanted.length();
        let gives_way = if length > 0.0 { wanted.dot(way) / length } else { 0.0 };
        if gives_way > 0.0 {
            let most = (self.observer.energy.max(0.0) * MOST_CHANGE / gives_way).sqrt();
            wanted = if most < length { wanted * (most / length) } else { wanted };
        }
        // As the stylus went in the last tick it goes on in this one.
        let after = self.observer.energy - wanted.dot(way);
        if after < 0.0 && way.length_squared() > 0.0 {
            wanted += way * (after / way.length_squared());
        }
        let change = wanted - self.force;
        let size = change.length();
        let share = if size > MOST_CHANGE { MOST_CHANGE / size } else { 1.0 };
        self.force += change * share;
        self.most_change = self.most_change.max(size * share);
        self.force
    }

    /// Takes the force away at once: the device does not answer.
    pub fn let_go(&mut self) {
        (self.force, self.share, self.before) = (Vec3::ZERO, 0.0, None);
    }

    /// What the hand has put in.
    pub fn observer(&self) -> &Observer {
        &self.observer
    }

    /// The largest change of the force from tick to tick so far [N].
    pub fn most_change(&self) -> f64 {
        self.most_change
    }

    /// The force on the hand now [N].
    pub fn force(&self) -> Vec3<f64> {
        self.force
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    fn seen(z: f64, touches: bool) -> Seen {
        let pose = RigidTransform { translation: vec3(0.0, 0.0, z), ..RigidTransform::IDENTITY };
        Seen { pose, touches, time: 0.0 }
    }

    #[test]
    fn the_spring_is_felt_in_contact_only_and_comes_steadily() {
        let mut rendering = Rendering::new(400.0, 8.0);
        let at = vec3(0.0, 0.0, -1e-3);
        assert_eq!(rendering.tick(at, &seen(0.0, false), 1e-3), Vec3::ZERO);
        let mut before = 0.0;
        for _ in 0..10 {
            let force = rendering.tick(at, &seen(0.0, true), 1e-3).z;
            assert!(force > before && force - before <= MOST_CHANGE + 1e-15);
            before = force;
        }
        (0..10).for_each(|_| before = rendering.tick(at, &seen(0.0, true), 1e-3).z);
        assert!((before - 0.4).abs() < 1e-12, "{before}");
        assert!(rendering.most_change() <= MOST_CHANGE + 1e-15);
        rendering.let_go();
        assert_eq!(rendering.force(), Vec3::ZERO);
    }

    /// A spring that is felt 20 ms late gives back more than was put in.
    #[test]
    fn a_force_that_comes_late_makes_no_energy() {
        let path = |tick: i32| vec3(0.0, 0.0, -2e-3 * libm::sin(0.05 * f64::from(tick)).abs());
        let mut plain = Observer::default();
        let mut rendering = Rendering::new(400.0, 8.0);
        let mut force = Vec3::ZERO;
        for tick in 1..2000 {
            plain.watch(force, path(tick) - path(tick - 1));
            let tool = path(tick).z - path((tick - 20).max(0)).z;
            force = (vec3(0.0, 0.0, tool) - path(tick)) * 400.0;
            rendering.tick(path(tick), &seen(tool, true), 1e-3);
        }
        assert!(plain.least < -1e-3, "{plain:?}");
        assert!(rendering.observer().least > -1e-4, "{:?}", rendering.observer());
    }
}
