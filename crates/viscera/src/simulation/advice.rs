//! Next moves that a scene still has: advice that is already followed, or that the method does not heed, is none.

use crate::material::MaterialModel;
use crate::scene::Scene;
use crate::settings::{Acceleration, Method};

/// Choices in a row, "a, b or c".
fn either(choices: &[&str]) -> String {
    match choices {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// Against a run that diverges.
pub fn diverged(scene: &Scene) -> String {
    let solver = &scene.solver;
    if solver.method == Method::Explicit {
        let two_digits = (100.0 * solver.explicit_safety).round() / 100.0;
        let lower = format!("lower solver.explicit_safety below {two_digits}");
        return either(&[&lower, "choose solver.method = \"quasi_newton\""]);
    }
    let mut choices = vec!["raise solver.substeps"];
    if matches!(solver.method, Method::Auto | Method::QuasiNewton) {
        return either(&choices);
    }
    if solver.relaxation > 1.0 {
        choices.push("lower solver.relaxation to 1");
    }
    if solver.acceleration != Acceleration::None {
        choices.push("set solver.acceleration = \"none\"");
    }
    if !solver.rebase {
        choices.push("set solver.rebase = true");
    }
    if !solver.step_guard {
        choices.push("set solver.step_guard = true");
    }
    either(&choices)
}

/// Against a solver that falls short.
pub fn budget(scene: &Scene) -> String {
    let solver = &scene.solver;
    if solver.method == Method::Explicit {
        return "raise time.duration".into();
    }
    if matches!(solver.method, Method::Auto | Method::QuasiNewton) {
        return "raise solver.iterations or solver.substeps".into();
    }
    let off: Vec<&str> = [
        ("solver.rebase = true", solver.rebase),
        ("solver.keep_multipliers = true", solver.keep_multipliers),
    ]
    .into_iter()
    .filter_map(|(setting, on)| (!on).then_some(setting))
    .collect();
    if off.is_empty() {
        "raise solver.iterations or solver.substeps".into()
    } else {
        format!("set {}, without which more sweeps do not lead there", off.join(" and "))
    }
}

/// Against tetrahedra that are turned inside out.
pub fn inverted(scene: &Scene) -> String {
    let has = |law: MaterialModel| {
        let regions = scene.bodies.iter().flat_map(|body| &body.regions);
        let materials = scene.bodies.iter().map(|body| &body.material);
        materials.chain(regions.map(|region| &region.material)).any(|m| m.model() == law)
    };
    let mut choices = Vec::new();
    if !scene.motions.is_empty() || !scene.forces.is_empty() {
        choices.extend(["pull less", "spread the pull over more vertices"]);
    }
    if has(MaterialModel::SaintVenantKirchhoff) {
        choices.push("use model = \"stable_neo_hookean\", which resists it");
    }
    if scene.solver.method != Method::Explicit {
        choices.push("raise solver.iterations");
    }
    if choices.is_empty() {
        choices.push("lower solver.explicit_safety");
    }
    either(&choices)
}
