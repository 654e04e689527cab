//! Pressure of contact at vertices: the forces of samples, spread to what they hang on.
//!
//! ```text
//! N_a = sum_s b_a N_s,   A_a = sum_s b_a A_s,   p_a = N_a/A_a          so that  sum_a p_a A_a = sum_s N_s
//! ```
//!
//! with the samples' weights `b_a`, areas at rest `A_s` and normal forces `N_s` at the end of the last step.

use super::{Sample, Touch};

/// Pressure and the area that it acts on, of each vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VertexPressures {
    /// Normal force over area at rest [Pa], shape [vertex_count]; zero where nothing touches.
    pub pressures: Vec<f64>,
    /// Area of the surface at rest that is a vertex's own [m^2], shape [vertex_count]; zero inside.
    pub areas: Vec<f64>,
}

impl VertexPressures {
    /// Of so many vertices, from samples ([`crate::model::Model::samples`]) and what presses on them
    /// ([`crate::state::ContactState::touches`]). Samples and vertices that are not there are left out.
    pub fn of(samples: &[Sample], touches: &[Touch], vertex_count: usize) -> Self {
        let mut forces = vec![0.0; vertex_count];
        let mut areas = vec![0.0; vertex_count];
        for sample in samples {
            spread(sample, sample.area, &mut areas);
        }
        for touch in touches {
            if let Some(sample) = samples.get(touch.sample as usize) {
                spread(sample, touch.pressed, &mut forces);
            }
        }
        let pressure = |(force, &area): (f64, &f64)| if area > 0.0 { force / area } else { 0.0 };
        Self { pressures: forces.into_iter().zip(&areas).map(pressure).collect(), areas }
    }

    /// Integral of the pressure over the surface [N].
    pub fn force(&self) -> f64 {
        self.pressures.iter().zip(&self.areas).map(|(pressure, area)| pressure * area).sum()
    }
}

/// Adds a sample's share of something to its vertices.
fn spread(sample: &Sample, amount: f64, sums: &mut [f64]) {
    for (&vertex, weight) in sample.vertices.iter().zip(sample.weights) {
        if let Some(sum) = sums.get_mut(vertex as usize) {
            *sum += weight * amount;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::sample_boundary;
    use crate::scalar::{Vec3, vec3};

    fn touch(sample: u32, pressed: f64) -> Touch {
        Touch {
            sample,
            tool: 0,
            anchor: Vec3::ZERO,
            normal: vec3(0.0, 0.0, 1.0),
            offset: 0.0,
            pressed,
            force: Vec3::ZERO,
            place: Vec3::ZERO,
            is_tied: false,
        }
    }

    fn corner() -> Vec<Sample> {
        let positions =
            [vec3(0.0, 0.0, 0.0), vec3(0.03, 0.0, 0.0), vec3(0.0, 0.05, 0.0), vec3(0.0, 0.0, 0.02)];
        sample_boundary(&[[0, 1, 2, 3]], &positions, 1)
    }

    #[test]
    fn integral_over_vertices_is_the_sum_of_pressed_forces() {
        let samples = corner();
        // Two tools on one sample, and a sample that is not there.
        let touches = [touch(0, 0.7), touch(0, 0.2), touch(5, 1.3), touch(11, 0.1), touch(99, 5.0)];
        let found = VertexPressures::of(&samples, &touches, 6);
        assert!((found.force() - 2.3).abs() < 1e-12, "{}", found.force());
        let area: f64 = samples.iter().map(|sample| sample.area).sum();
        assert!((found.areas.iter().sum::<f64>() - area).abs() < 1e-15);
        assert_eq!(found.pressures[4..], [0.0, 0.0]);
    }

    #[test]
    fn a_pressure_that_is_the_same_everywhere_stays_so() {
        let samples = corner();
        let touches: Vec<_> =
            (0..).zip(&samples).map(|(s, sample)| touch(s, 250.0 * sample.area)).collect();
        let found = VertexPressures::of(&samples, &touches, 4);
        assert!(found.pressures.iter().all(|p| (p - 250.0).abs() < 1e-9), "{found:?}");
    }
}
