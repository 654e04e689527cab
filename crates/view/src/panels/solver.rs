//! How steps are solved: all of it can be changed while the simulation runs.

use eframe::egui::Ui;
use viscera::settings::{
    Acceleration, Colors, Count, DeviceRequest, Elements, Method, Precision, SolverSettings,
};

use super::choice::{Chooser, Row};
use super::{Action, section};
use crate::choices::Side;

/// One solver's settings.
pub fn show(
    ui: &mut Ui,
    title: &str,
    side: Side,
    solver: &SolverSettings,
    device: Option<&str>,
    actions: &mut Vec<Action>,
) {
    section(ui, title, true, |ui| {
        ui.push_id(title, |ui| {
            let mut chooser = Chooser { side, actions };
            known(ui, &mut chooser);
            // On a device that is named "automatic" is known, and has the rows of its method.
            let in_force = &solver.foreseen();
            method(ui, solver.method, in_force, &mut chooser);
            if chooses_counts(in_force) {
                passes(ui, in_force, &mut chooser);
            }
            if in_force.method == Method::Xpbd {
                sweeps(ui, in_force, &mut chooser);
                acceleration(ui, in_force, &mut chooser);
                exactness(ui, in_force, &mut chooser);
            }
            where_computed(ui, solver, device, &mut chooser);
        });
    });
}

/// Solvers worth comparing, by one click. Each says everything that another may have changed.
const KNOWN: [(&str, &str, KnownSettings); 5] = [
    (
        "default",
        "What is cheapest at the accuracy below: every step solved in a dozen passes, whatever the mesh.",
        known_settings("auto", "unlimited", "auto", "auto", "none", "true"),
    ),
    (
        "XPBD (exact at rest)",
        "Rebase and kept multipliers: in balance when it comes to rest. Coloured Gauss-Seidel, two iterations per \
         substep.",
        known_settings("xpbd", "unlimited", "10", "2", "none", "true"),
    ),
    (
        "Jacobi 40",
        "One colour, 40 iterations of one step per frame.",
        known_settings("xpbd", "1", "1", "40", "none", "true"),
    ),
    (
        "Anderson 40",
        "The same with Anderson acceleration.",
        known_settings("xpbd", "1", "1", "40", "anderson", "true"),
    ),
    (
        "as published",
        "XPBD as published: its stiffness depends on substeps and iterations.",
        known_settings("xpbd", "unlimited", "10", "2", "none", "false"),
    ),
];

type KnownSettings = [(&'static str, &'static str); 8];

const fn known_settings(
    method: &'static str,
    colors: &'static str,
    substeps: &'static str,
    iterations: &'static str,
    acceleration: &'static str,
    exact: &'static str,
) -> KnownSettings {
    [
        ("solver.method", method),
        ("solver.colors", colors),
        ("solver.substeps", substeps),
        ("solver.iterations", iterations),
        ("solver.acceleration", acceleration),
        ("solver.rebase", exact),
        ("solver.keep_multipliers", exact),
        ("solver.elements", "auto"),
    ]
}

fn known(ui: &mut Ui, chooser: &mut Chooser<'_>) {
    ui.horizontal_wrapped(|ui| {
        for (name, help, settings) in &KNOWN {
            if ui.button(*name).on_hover_text(*help).clicked() {
                chooser.all(settings);
            }
        }
    });
}

/// Whether substeps and passes can be left to the method.
fn chooses_counts(solver: &SolverSettings) -> bool {
    matches!(solver.method, Method::Auto | Method::QuasiNewton)
}

fn method(ui: &mut Ui, asked: Method, solver: &SolverSettings, chooser: &mut Chooser<'_>) {
    let value = match asked {
        Method::Auto => "auto",
        Method::Xpbd => "xpbd",
        Method::Explicit => "explicit",
        Method::QuasiNewton => "quasi_newton",
    };
    let help = "Automatic takes the cheapest at the accuracy below, and quasi-Newton on a device that is named. \
                XPBD sweeps over constraints in large steps. Quasi-Newton solves each step in a dozen passes, \
                whatever the mesh. Explicit takes many small steps: no sweeps, no guards, cheap for small soft bodies.";
    let names = [
        ("auto", "automatic"),
        ("quasi_newton", "quasi-Newton"),
        ("xpbd", "XPBD"),
        ("explicit", "explicit"),
    ];
    chooser.menu(ui, &Row::new("solver.method", "method", help), value, &names);
    if chooses_counts(solver) {
        let help = "The error of motion for which substeps and passes are chosen: about 15 % for a draft, 5 %, or \
                    0.5 %. Where tissue comes to rest does not depend on it.";
        let names = [("draft", "draft"), ("standard", "standard"), ("fine", "fine")];
        let value = solver.accuracy.to_string();
        let row = Row::new("solver.accuracy", "accuracy", help);
        chooser.menu(ui, &row, value.trim_matches('"'), &names);
    }
    if solver.method != Method::Xpbd {
        let help = "Linear tetrahedra bend too little where the mesh is coarse. Recovered-gradient ones also see how their \
                    neighbours are deformed. Automatic takes these.";
        let names =
            [("auto", "automatic"), ("recovered", "recovered-gradient"), ("plain", "linear")];
        let value = match solver.elements {
            Elements::Auto => "auto",
            Elements::Plain => "plain",
            Elements::Recovered => "recovered",
        };
        chooser.menu(ui, &Row::new("solver.elements", "tetrahedra", help), value, &names);
    }
    let help =
        "Divide every frame. More lose less motion to numerical damping; the cost grows alike.";
    let row = Row::new("solver.substeps", "substeps", help).rail(1.0..=100.0).whole().logarithmic();
    count(ui, solver, chooser, &row, solver.substeps, solver.substeps());
}

fn passes(ui: &mut Ui, solver: &SolverSettings, chooser: &mut Chooser<'_>) {
    let help = "Passes over the mesh in each of the two solves of a substep. A dozen solve it; fewer still end in \
                balance at rest.";
    let row = Row::new("solver.iterations", "passes", help).rail(1.0..=60.0);
    count(ui, solver, chooser, &row.whole().logarithmic(), solver.iterations, solver.iterations());
}

/// A number that the quasi-Newton method can choose by itself: a box for that, and a slider where it is not ticked.
/// `usual` is what the slider begins with.
fn count(
    ui: &mut Ui,
    solver: &SolverSettings,
    chooser: &mut Chooser<'_>,
    row: &Row<'_>,
    chosen: Count,
    usual: u32,
) {
    if chooses_counts(solver) {
        chooser.automatic(ui, row, chosen == Count::Auto, usual);
    }
    if !chooses_counts(solver) || chosen != Count::Auto {
        chooser.number(ui, row, f64::from(usual));
    }
}

fn sweeps(ui: &mut Ui, solver: &SolverSettings, chooser: &mut Chooser<'_>) {
    let help = "Sweeps over all constraints in each substep.";
    let row = Row::new("solver.iterations", "iterations", help).rail(1.0..=200.0);
    chooser.number(ui, &row.whole().logarithmic(), f64::from(solver.iterations()));
    let help = "Colours of the constraint graph: unlimited for Gauss-Seidel, 1 for Jacobi, a few for \
                clique separation. Fewer run more in parallel and need more sweeps.";
    let shown = match solver.colors {
        Colors::Unlimited => "unlimited".to_owned(),
        Colors::Limited(count) => count.to_string(),
    };
    let counts = [
        ("unlimited", "unlimited (Gauss-Seidel)"),
        ("1", "1 (Jacobi)"),
        ("2", "2"),
        ("3", "3"),
        ("4", "4"),
        ("6", "6"),
        ("8", "8"),
        ("12", "12"),
        ("16", "16"),
    ];
    chooser.menu(ui, &Row::new("solver.colors", "colours", help), &shown, &counts);
    let help = "Over-relaxation: above 1 hurries, below 1 calms. Safe up to 1.2 for unlimited colours; \
                with one colour only 1 is.";
    let row = Row::new("solver.relaxation", "relaxation", help).rail(0.1..=1.95);
    chooser.number(ui, &row, solver.relaxation);
}

fn acceleration(ui: &mut Ui, solver: &SolverSettings, chooser: &mut Chooser<'_>) {
    let value = match solver.acceleration {
        Acceleration::None => "none",
        Acceleration::Chebyshev => "chebyshev",
        Acceleration::Anderson => "anderson",
    };
    let help = "How the sequence of sweeps of a substep is accelerated. Pays with several iterations only.";
    let names = [("none", "none"), ("chebyshev", "Chebyshev"), ("anderson", "Anderson")];
    chooser.menu(ui, &Row::new("solver.acceleration", "acceleration", help), value, &names);
    if solver.acceleration == Acceleration::Anderson {
        let help = "How many past sweeps Anderson mixes.";
        let row = Row::new("solver.anderson_window", "window", help).rail(1.0..=10.0).whole();
        chooser.number(ui, &row, f64::from(solver.anderson_window));
    }
}

fn exactness(ui: &mut Ui, solver: &SolverSettings, chooser: &mut Chooser<'_>) {
    let help =
        "Stabilised rebase before each sweep: the iteration converges to implicit Euler exactly.";
    chooser.tick(ui, "solver.rebase", "rebase", help, solver.rebase);
    let help = "With the rebase this makes the stiffness independent of the number of iterations; \
                without it the body freezes.";
    chooser.tick(ui, "solver.keep_multipliers", "keep multipliers", help, solver.keep_multipliers);
    let help = "Reject a step that raises the incremental potential, and slow down tissue that would gain \
                energy. Acts with the rebase.";
    chooser.tick(ui, "solver.step_guard", "step guard", help, solver.step_guard);
}

fn where_computed(
    ui: &mut Ui,
    solver: &SolverSettings,
    device: Option<&str>,
    chooser: &mut Chooser<'_>,
) {
    let help =
        "The device that computes the steps: auto takes the one that is expected to be faster.";
    let value = match &solver.device {
        DeviceRequest::Named(name) => name.clone(),
        known => known.to_string(),
    };
    let names = [("auto", "auto"), ("cpu", "CPU"), ("gpu", "GPU")];
    chooser.menu(ui, &Row::new("solver.device", "device", help), &value, &names);
    let precision = match solver.precision {
        Precision::F32 => "single precision",
        Precision::F64 => "double precision",
    };
    let text = format!("{}; {precision}", device.unwrap_or("not built yet"));
    let help =
        "Precision is chosen when a scene is opened: solver.precision in the file, or --set.";
    ui.weak(text).on_hover_text(help);
}
