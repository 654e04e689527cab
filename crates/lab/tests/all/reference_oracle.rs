//! The Newton reference against an independent finite element program: the numbers under
//! `tests/fixtures`, whose README says how they were made and how exact they are.
//!
//! The reference stops at a gradient of 1e-10 of the first, by far the load: 0.3 N. The softest mode
//! of the bars has 0.04 N/m ("smallest_stiffness"), and they sag by 30 mm: an error of at most
//! 0.3 N * 1e-10 / 0.04 N/m / 30 mm = 3e-8 of the displacement, were all of the gradient in that one
//! mode. Newton's last step overshoots its goal by far, so 1e-8 is asked of positions, reactions and
//! energies.

use crate::common::{
    Fixture, configurations, difference, equilibria, largest, motions, position_error,
};
use viscera::scalar::Vec3;
use viscera::state::State;
use viscera_reference::Reference;
use viscera_reference::contact::Contacts;
use viscera_reference::matrix::Pattern;
use viscera_reference::objective::{Load, Objective};

const AGREEMENT: f64 = 1e-8;

/// Exact formulas at given positions: nothing but rounding, see the head of `oracle.rs`.
const ROUNDING: f64 = 1e-12;

fn reference(fixture: &Fixture) -> Reference {
    Reference::new(&fixture.model::<f64>())
}

#[test]
fn gradient_and_hessian_are_the_oracles() {
    for (name, fixture) in configurations() {
        let reference = reference(&fixture);
        let problem = reference.problem();
        let x = fixture.vectors("positions");
        let load = Load::Forces(vec![Vec3::ZERO; x.len()]);
        let objective =
            Objective { problem, anchors: &[], tethers: &[], contacts: Contacts::NONE, load };
        let forces: Vec<_> = objective.gradient(&x).into_iter().map(|g| -g).collect();
        let expected = fixture.vectors("forces");
        let force_error = largest(&difference(&forces, &expected)) / largest(&expected);
        let pattern = Pattern::new(problem, &vec![false; x.len()]);
        let hessian = objective.hessian(&x, &pattern, false);
        let image = hessian.multiply(&pattern, &fixture.vectors("direction"));
        let expected = fixture.vectors("hessian_times_direction");
        let hessian_error = largest(&difference(&image, &expected)) / largest(&expected);
        let energy_error = objective.value(&x).sum / fixture.value("elastic_energy") - 1.0;
        println!(
            "{name}: energy off by {:.1e}, gradient by {force_error:.1e}, Hessian by \
             {hessian_error:.1e}",
            energy_error.abs()
        );
        assert!(energy_error.abs() < ROUNDING && force_error < ROUNDING, "{name}");
        assert!(hessian_error < ROUNDING, "{name}");
    }
}

#[test]
fn equilibria_are_the_oracles() {
    for (name, fixture) in equilibria() {
        let mut reference = reference(&fixture);
        let (inputs, rest) = (fixture.inputs(), fixture.vectors("vertices"));
        let solution = reference.settle(&rest, &inputs).expect("an equilibrium");
        let expected = fixture.vectors("positions");
        let error = position_error(&solution.positions, &expected, &rest);
        let reactions = reference.reactions(&solution.positions, &inputs).expect("legal pins");
        let expected = fixture.vectors("reactions");
        let reaction_error = largest(&difference(&reactions, &expected)) / largest(&expected);
        let standing = reference.standing(&solution.positions, &inputs).expect("a legal state");
        let relative = |value: f64, key| (value / fixture.value(key) - 1.0).abs();
        let energy_error = relative(standing.elastic_energy, "elastic_energy");
        let potential_error = relative(standing.potential, "potential_energy");
        println!(
            "{name}: positions off by {error:.1e} of the displacement, reactions by \
             {reaction_error:.1e}, energy by {energy_error:.1e}, potential by {potential_error:.1e}; \
             {} Newton steps",
            solution.convergence.steps
        );
        assert!(solution.convergence.minimum, "{name}");
        assert!(error < AGREEMENT && reaction_error < AGREEMENT, "{name}: {error:e}");
        assert!(energy_error < AGREEMENT && potential_error < AGREEMENT, "{name}");
    }
}

#[test]
fn steps_are_the_oracles() {
    for (name, fixture) in motions() {
        let model = fixture.model::<f64>();
        let (mut reference, mut state) = (Reference::new(&model), State::at_rest(&model));
        for step in 1..=10 {
            let dt = fixture.value("step");
            reference.step(&mut state, &fixture.inputs(), dt).expect("a step");
            if [1, 2, 10].contains(&step) {
                let expected = fixture.vectors(&format!("positions_{step}"));
                let error = position_error(&state.positions, &expected, &model.rest_positions);
                println!("{name}, step {step}: off by {error:.1e} of the displacement");
                assert!(error < AGREEMENT, "{name}, step {step}: {error:e}");
            }
        }
    }
}
