//! A device that is none: the stylus of one in a simulated hand.
//!
//! ```text
//! m x'' = F + k_h (p(t) - x) + b_h (p'(t) - x') - b x'       p(t): where the hand wants to be
//! ```
//!
//! A stylus of 80 g in a soft grip: what is hardest for a device is a hand that damps little.

use super::device::{DeviceError, HapticDevice, Stylus};
use crate::scalar::rigid::RigidTransform;
use crate::scalar::{Vec3, vec3};

/// Of the stylus [kg], [N s/m].
const MASS: f64 = 0.08;
const FRICTION: f64 = 0.2;

/// Of the hand [N/m], [N s/m].
const GRIP: f64 = 300.0;
const CALM: f64 = 2.0;

/// The motion is computed in so many steps a tick.
const STEPS: u32 = 20;

/// Where a hand wants to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Where it begins [m]: above the tissue, which is below along z.
    pub from: Vec3<f64>,
    /// How deep it goes from there [m], and how far to the sides.
    pub depth: f64,
    /// [m].
    pub width: f64,
    /// Angular frequencies [rad/s] and phases [rad] of the three axes.
    pub rates: [f64; 3],
    /// [rad].
    pub phases: [f64; 3],
}

impl Path {
    /// Palpation from a place [m], by a number: presses of up to `depth` [m] every second or two, and slides.
    pub fn palpation(from: Vec3<f64>, depth: f64, seed: u64) -> Self {
        // Fractions of multiples of square roots are spread evenly, and the same on every machine.
        let mut spread = 0.0;
        let mut next = |from: f64, to: f64| {
            spread += 0.754_877_666_246_692_8 * (seed as f64 + 1.0);
            from + (to - from) * (spread - libm::floor(spread))
        };
        let tau = 2.0 * std::f64::consts::PI;
        let rates = [next(1.0, 6.0), next(1.0, 6.0), next(3.0, 9.0)];
        let phases = [next(0.0, tau), next(0.0, tau), 0.0];
        Self { from, depth: depth * next(0.5, 1.0), width: next(0.0, 6e-3), rates, phases }
    }

    /// Where the hand wants to be at a time [s].
    pub fn at(&self, time: f64) -> Vec3<f64> {
        let side = |axis: usize| {
            let begins = libm::sin(self.phases[axis]);
            self.width * (libm::sin(self.rates[axis] * time + self.phases[axis]) - begins)
        };
        let down = 0.5 * self.depth * (1.0 - libm::cos(self.rates[2] * time));
        self.from + vec3(side(0), side(1), -down)
    }
}

/// A stylus in a simulated hand. Every reading of it is a tick later.
#[derive(Clone, Debug)]
pub struct VirtualDevice {
    path: Path,
    /// [s].
    tick: f64,
    ticks: u64,
    place: Vec3<f64>,
    velocity: Vec3<f64>,
    force: Vec3<f64>,
}

impl VirtualDevice {
    /// A hand that follows a path, read every `tick` [s].
    pub fn new(path: Path, tick: f64) -> Self {
        let (place, velocity, force) = (path.at(0.0), Vec3::ZERO, Vec3::ZERO);
        Self { path, tick, ticks: 0, place, velocity, force }
    }

    /// Time since its first tick [s].
    pub fn time(&self) -> f64 {
        self.ticks as f64 * self.tick
    }
}

impl HapticDevice for VirtualDevice {
    fn name(&self) -> String {
        "virtual".to_owned()
    }

    fn read(&mut self) -> Result<Stylus, DeviceError> {
        let begin = self.time();
        let dt = self.tick / f64::from(STEPS);
        for step in 0..STEPS {
            let now = begin + dt * f64::from(step);
            let [wants, later] = [now, now + dt].map(|time| self.path.at(time));
            let goes = (later - wants) * (1.0 / dt);
            let force = self.force + (later - self.place) * GRIP + (goes - self.velocity) * CALM
                - self.velocity * FRICTION;
            self.velocity += force * (dt / MASS);
            self.place += self.velocity * dt;
        }
        self.ticks += 1;
        let pose = RigidTransform { translation: self.place, ..RigidTransform::IDENTITY };
        Ok(Stylus { pose, is_pressed: false })
    }

    fn exert(&mut self, force: Vec3<f64>, _: Vec3<f64>) -> Result<(), DeviceError> {
        self.force = force;
        Ok(())
    }
}
