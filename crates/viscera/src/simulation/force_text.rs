//! Forces in words for people: in newtons, or where they are small in millinewtons.

/// Force [N] and torque [N m] with what each may be off by, to so many decimals.
pub(super) fn wrench_text(
    force: [f64; 3],
    torque: [f64; 3],
    errors: [Option<f64>; 2],
    digits: usize,
) -> String {
    let length = |[x, y, z]: [f64; 3]| x.hypot(y).hypot(z);
    let [of_force, of_torque] = [length(force), length(torque)].map(|size| Unit::of(size, digits));
    let [force_error, torque_error] = errors;
    let [x, y, z] = force.map(|component| of_force.number(component));
    format!(
        "force {}{} {}N, as a vector ({x}, {y}, {z}) {}N, torque {}{} {}N m",
        of_force.number(length(force)),
        of_force.error(force_error),
        of_force.prefix,
        of_force.prefix,
        of_torque.number(length(torque)),
        of_torque.error(torque_error),
        of_torque.prefix
    )
}

/// What numbers are written in.
pub(super) struct Unit {
    factor: f64,
    pub prefix: &'static str,
    digits: usize,
}

/// Forces below it are written in millinewtons.
const SMALL: f64 = 0.05;

impl Unit {
    /// For numbers up to a size in the whole unit, which have so many decimals in it.
    pub fn of(size: f64, digits: usize) -> Self {
        match size < SMALL && size > 0.0 {
            // A digit more than in the whole unit.
            true => Self { factor: 1e3, prefix: "m", digits: digits.saturating_sub(2) },
            false => Self { factor: 1.0, prefix: "", digits },
        }
    }

    pub fn number(&self, value: f64) -> String {
        let Self { factor, digits, .. } = *self;
        let value = factor * value;
        // What rounds to zero has no sign.
        let smallest = (0..digits).fold(0.5, |smallest, _| 0.1 * smallest);
        let value = if value.abs() < smallest { 0.0 } else { value };
        format!("{value:.digits$}")
    }

    fn error(&self, error: Option<f64>) -> String {
        // Rounded up: an error is no smaller than it is said to be.
        let scale = 10f64.powi(i32::try_from(self.digits).unwrap_or(4)) * self.factor;
        let digits = self.digits;
        error.map_or(String::new(), |error| {
            format!(" +- {:.digits$}", (error * scale).ceil() / scale * self.factor)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_forces_are_in_millinewtons_and_errors_are_no_smaller_than_they_are() {
        let errors = [Some(0.12341), Some(1.2341e-5)];
        let text = wrench_text([3.0, -4.0, 1e-6], [0.0, 3e-4, -4e-4], errors, 4);
        assert_eq!(
            text,
            "force 5.0000 +- 0.1235 N, as a vector (3.0000, -4.0000, 0.0000) N, torque 0.50 +- 0.02 mN m"
        );
        let text = wrench_text([0.0, -0.04, -1e-9], [0.0; 3], [None; 2], 4);
        assert_eq!(text, "force 40.00 mN, as a vector (0.00, -40.00, 0.00) mN, torque 0.0000 N m");
    }
}
