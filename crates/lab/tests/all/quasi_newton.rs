//! The quasi-Newton method against Newton's: a converged step is the minimum of the incremental potential.

use viscera::material::MaterialModel;
use viscera::scalar::Real;
use viscera::settings::{Count, Integrator, Method, SolverSettings, Threads};
use viscera_lab::load_cases::{LoadCase, Size, tissue};
use viscera_lab::study::step::MeasuredStep;

const STVK: MaterialModel = MaterialModel::SaintVenantKirchhoff;
const SNH: MaterialModel = MaterialModel::StableNeoHookean;

/// Scenes and the frames before the measured step, in the middle of the motion: pins of twist and grab and the
/// anchor of the organ move in it.
const MOMENTS: [(&str, u32); 4] = [("cantilever", 6), ("twist", 5), ("grab", 4), ("organ", 5)];

/// One solve that ends where rounding ends it.
fn converged() -> SolverSettings {
    SolverSettings {
        method: Method::QuasiNewton,
        integrator: Integrator::ImplicitEuler,
        substeps: Count::Of(1),
        iterations: Count::Of(600),
        history: 10,
        threads: Threads::Count(1),
        ..SolverSettings::xpbd()
    }
}

/// Distance from Newton's end of a step, over that of the inertial prediction, in double and single precision, and
/// what rounding may leave in single precision: of the body's extent a unit of the precision, which is the round-off of the
/// gradient's stiffest term, through the inverse of the least curvature: `(lambda + 2 mu)/mu` times.
fn errors(
    name: &'static str,
    size: Size,
    frames: u32,
    model: MaterialModel,
    (young, poisson): (f64, f64),
) -> [f64; 3] {
    fn error<S: Real>(step: &MeasuredStep) -> f64 {
        step.error(&step.end::<S>(&converged()).expect("a step"))
    }
    let tissue = tissue(model, young, poisson).expect("a tissue");
    let load_case = LoadCase::new(name, size, tissue).expect("a scene");
    let step = MeasuredStep::new(load_case, frames).expect("a reference");
    let errors = [error::<f64>(&step), error::<f32>(&step)];
    println!(
        "{}, frame {}, {model:?}: {:.1e} in double, {:.1e} in single precision",
        step.load_case,
        frames + 1,
        errors[0],
        errors[1]
    );
    let (mut moved, mut extent) = (0.0, 0.0f64);
    for (x, y) in step.predicted().iter().zip(&step.exact) {
        moved += (*x - *y).length_squared() / step.exact.len() as f64;
        extent = extent.max(y.length());
    }
    let stiffness = (2.0 - 2.0 * poisson) / (1.0 - 2.0 * poisson);
    let rounding = stiffness * f64::from(f32::EPSILON);
    [errors[0], errors[1], rounding * extent / moved.sqrt()]
}

fn assert_exact(size: Size, tissues: &[(MaterialModel, f64, f64)]) {
    for (name, frames) in MOMENTS {
        for &(model, young, poisson) in tissues {
            let [double, single, rounding] = errors(name, size, frames, model, (young, poisson));
            assert!(double < 1e-6, "{name}, {model:?}, {young} Pa, nu {poisson}: {double:e}");
            assert!(
                single < rounding.max(3e-4),
                "{name}, {model:?}, {young} Pa, nu {poisson}: {single:e}"
            );
        }
    }
}

#[test]
fn a_converged_step_is_newtons() {
    assert_exact(Size::Tiny, &[(SNH, 1e4, 0.45), (STVK, 1e5, 0.3)]);
}

#[test]
#[ignore = "slow: Newton's method on finer meshes, soft, stiff and nearly incompressible"]
fn a_converged_step_is_newtons_at_length() {
    let mut tissues = vec![(STVK, 1e5, 0.3), (STVK, 1e5, 0.45)];
    for young in [1e3, 1e4, 1e5] {
        tissues.extend([0.3, 0.45, 0.49].map(|poisson| (SNH, young, poisson)));
    }
    assert_exact(Size::Small, &tissues);
}
