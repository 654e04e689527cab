//! The scheme of SDIRK2 ([`super::time`]): its constant, and what it makes of oscillations.

use crate::solver::oscillations::Growth;

/// `c`: the part of a step that each of its solves takes.
pub const SHARE: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// What a step of SDIRK2 makes of an oscillation that turns by an angle in it: `R(z) = (1 + (1 - 2 c) z)/(1 - c z)^2`,
/// `z` imaginary.
pub fn growth(angle: f64) -> Growth {
    let [above, below] = [(1.0 - 2.0 * SHARE) * angle, SHARE * angle];
    let logarithm = 0.5 * libm::log1p(above * above) - libm::log1p(below * below);
    Growth { logarithm, angle: libm::atan(above) + 2.0 * libm::atan(below) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One step of the scheme of `time.rs` on `x'' = -x`, both of its solves exact, multiplies `x - i v` by `R`.
    #[test]
    fn growth_is_that_of_the_scheme() {
        for h in [0.01, 0.3, 1.7] {
            let he = SHARE * h;
            // Of (1 + he^2) x = xs + he vs, v = (x - xs)/he.
            let solve = |xs: f64, vs: f64| {
                let x = (xs + he * vs) / (1.0 + he * he);
                (x, (x - xs) / he)
            };
            let d = (1.0 - SHARE) * h;
            let (_, v1) = solve(1.0, 0.0);
            let a1 = v1 / he;
            let (x, v) = solve(1.0 + d * v1, d * a1);
            let found = growth(h);
            let length = libm::exp(found.logarithm);
            let [along, beside] = [libm::cos(found.angle), libm::sin(found.angle)];
            assert!((x - length * along).abs() < 1e-12, "{h}: {x}");
            assert!((v + length * beside).abs() < 1e-12, "{h}: {v}");
        }
    }
}
