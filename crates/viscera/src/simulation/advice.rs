//! Next moves that a scene still has: advice that is already followed, or that the method does not heed, is none.

use crate::material::MaterialModel;
use crate::scene::{Body, Scene};
use crate::settings::{Acceleration, Elements, Method};

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

/// Whether a body has tissue of this law.
fn has(body: &Body, law: MaterialModel) -> bool {
    let regions = body.regions.iter().map(|region| &region.material);
    regions.chain([&body.material]).any(|material| material.model() == law)
}

/// What is left of linear tetrahedra where a scene asks for recovered-gradient ones.
pub fn plain_elements(scene: &Scene) -> Option<String> {
    let law = MaterialModel::SaintVenantKirchhoff;
    let is_asked = scene.solver.elements == Elements::Recovered;
    let body = scene.bodies.iter().find(|body| is_asked && has(body, law))?;
    Some(format!(
        "body \"{}\" keeps linear tetrahedra: recovered-gradient ones are of stable neo-Hookean tissue; use model = \
         \"stable_neo_hookean\", or solver.elements = \"plain\"",
        body.name
    ))
}

/// With stiffer contact, in units of E/h, XPBD moves light bodies along tools too slowly.
const SLIDING: f64 = 2.0;

/// Against stiff contact, along which XPBD's bodies hardly slide.
pub fn stiff_contact(scene: &Scene) -> Option<String> {
    let tool = scene.tools.iter().find(|tool| tool.law.stiffness > SLIDING)?;
    (scene.solver.method == Method::Xpbd).then(|| {
        format!(
            "tool \"{}\": with method \"xpbd\" light bodies slide too slowly along contact as stiff as {}; set its \
             `stiffness` to {SLIDING}, or solver.method = \"quasi_newton\"",
            tool.name, tool.law.stiffness
        )
    })
}

/// Against tetrahedra that are turned inside out.
pub fn inverted(scene: &Scene) -> String {
    let mut choices = Vec::new();
    if !scene.motions.is_empty() || !scene.forces.is_empty() {
        choices.extend(["pull less", "spread the pull over more vertices"]);
    }
    if scene.bodies.iter().any(|body| has(body, MaterialModel::SaintVenantKirchhoff)) {
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
