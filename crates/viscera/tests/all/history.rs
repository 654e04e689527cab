//! Multipliers that are kept from step to step are a history; when it ends and a new one starts.

use crate::common::{Random, Run, everything};
use viscera::scalar::{Real, vec3};
use viscera::settings::{Count, SolverSettings};
use viscera::solver::Inputs;

fn gravity<S: Real>() -> Inputs<S> {
    Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), ..Inputs::default() }
}

/// `|a - b|` and `|b|`.
fn distance<S: Real>(a: &[S], b: &[S]) -> (f64, f64) {
    let squares = a.iter().zip(b).map(|(a, b)| (*a - *b).to_f64().powi(2));
    (squares.sum::<f64>().sqrt(), b.iter().map(|b| b.to_f64().powi(2)).sum::<f64>().sqrt())
}

/// At rest the kept multipliers are the forces of the elements: taking them from the positions
/// finds the same.
#[test]
fn a_new_history_of_a_settled_body_changes_nothing() {
    let model = everything::<f64>();
    let settings = SolverSettings {
        substeps: Count::Of(1),
        iterations: Count::Of(10),
        ..SolverSettings::xpbd()
    };
    let mut run = Run::new(&model, &settings);
    for _ in 0..120 {
        run.frame(&gravity(), 0.8);
    }
    let kept = run.state.multipliers.clone();
    run.solver.restart(&model, &mut run.state, &gravity(), run.dt).expect("a new history");
    let (change, size) = distance(&run.state.multipliers, &kept);
    println!("multipliers change by {change:.1e} of {size:.1e}");
    assert!(change < 1e-6 * size, "{change:e} of {size:e}");
    // Another step is another scale of the same forces.
    run.solver.restart(&model, &mut run.state, &gravity(), 0.5 * run.dt).expect("a new history");
    let doubled: Vec<f64> = run.state.multipliers.iter().map(|l| 4.0 * l).collect();
    assert!(distance(&doubled, &kept).0 < 1e-6 * size);
    assert_eq!(run.state.multiplier_dt, 0.5 * run.dt);
}

/// Every vertex is put somewhere else, a new history starts, and the body comes back to its rest.
#[test]
fn a_scrambled_body_returns_to_its_rest() {
    let model = everything::<f32>();
    let mut run = Run::new(&model, &SolverSettings::xpbd());
    let settle = |run: &mut Run<f32>| {
        for _ in 0..60 {
            run.frame(&gravity(), 0.8);
        }
        run.state.positions.clone()
    };
    let rest = settle(&mut run);
    let mut random = Random(3);
    for x in &mut run.state.positions {
        *x += random.vector(0.004).cast();
    }
    run.solver.restart(&model, &mut run.state, &gravity(), run.dt).expect("a new history");
    let again = settle(&mut run);
    let farthest = rest.iter().zip(&again).map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
    println!("returns to within {farthest:.1e} m");
    // A thousandth of the bodies' size, which single precision reaches with room to spare.
    assert!(farthest < 6e-5, "{farthest:e} m");
}

/// One multiplier that is no number would spread through its tetrahedra to all others.
#[test]
fn multipliers_that_are_no_numbers_start_a_new_history() {
    let model = everything::<f32>();
    for broken in [f32::NAN, f32::INFINITY, f32::MAX] {
        let mut run = Run::new(&model, &SolverSettings::xpbd());
        for _ in 0..60 {
            run.frame(&gravity(), 0.8);
        }
        let rest = run.state.positions.clone();
        run.state.multipliers[0] = broken;
        run.step(&gravity());
        assert!(run.state.is_finite(), "{broken}");
        assert!(run.state.multipliers.iter().all(|l| l.is_finite()), "{broken}");
        assert_eq!(run.solver.rejected_steps(), 1, "{broken}");
        run.frame(&gravity(), 0.8);
        let farthest = rest.iter().zip(&run.state.positions).map(|(a, b)| (*a - *b).length());
        let farthest = farthest.fold(0.0, f32::max);
        println!("{broken}: moved by {farthest:.1e} m");
        assert!(farthest < 6e-5, "{broken}: {farthest:e} m");
    }
}
