//! The errors that a run foretells, beside those that it has.

use std::fmt;

use anyhow::Result;
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::Block;
use viscera::scalar::{Real, vec3};
use viscera::scene::Scene;
use viscera::settings::{Accuracy, Elements, Method, SolverSettings};

use super::course::{Places, SAFETY, begin, distance, follow, small_steps};
use super::organs::{Organ, places};
use super::{Context, Section};
use crate::unstructured::shuffled;
use viscera_report::{Table, percent};

pub(super) const SECTION: Section = Section {
    name: "expected",
    title: "Errors that are foretold",
    cases: |quick, _| cases(quick).len(),
    run,
};

const BAR: &str = r#"
[[body]]
name = "organ"
mesh = "bar.msh"
unit = "1 m"
material = { young = "5 kPa", density = "1000 kg/m^3" }
[[fixing]]
body = "organ"
half_space = { point = ["0.1 mm", 0, 0], normal = [-1, 0, 0] }
"#;

/// Duration [s] of the motion.
const MOTION: f64 = 0.5;

const ACCURACIES: [Accuracy; 3] = [Accuracy::Draft, Accuracy::Standard, Accuracy::Fine];

/// What is foretold may be so many times the truth, and never less than it, in all scenes but so many.
const LARGEST_RATIO: f64 = 4.0;

/// Of errors as small as this it is enough to know that they are: half a millimetre of a way of 12 cm.
const UNSEEN: f64 = 4e-3;
const EXCEPTIONS: usize = 1;

/// What is chosen may cost so many times what the cheapest method does that is as accurate as asked.
const LARGEST_COST: f64 = 1.3;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Body {
    /// 80 x 20 x 20 mm, boxes of five tetrahedra.
    Bar,
    /// The same, its vertices pushed about: slivers.
    Shuffled,
    Organ(Organ),
}

impl fmt::Display for Body {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bar => f.write_str("bar"),
            Self::Shuffled => f.write_str("unstructured bar"),
            Self::Organ(organ) => organ.fmt(f),
        }
    }
}

/// A body, Young's modulus [Pa], Poisson's ratio.
#[derive(Clone, Copy, Debug)]
struct Tissue(Body, f64, f64);

impl fmt::Display for Tissue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {} kPa, nu {}", self.0, self.1 / 1e3, self.2)
    }
}

const TISSUES: [Tissue; 20] = [
    Tissue(Body::Bar, 1e3, 0.3),
    Tissue(Body::Bar, 1e3, 0.45),
    Tissue(Body::Bar, 3e3, 0.49),
    Tissue(Body::Bar, 5e3, 0.3),
    Tissue(Body::Bar, 5e3, 0.45),
    Tissue(Body::Bar, 2e4, 0.3),
    Tissue(Body::Bar, 2e4, 0.45),
    Tissue(Body::Bar, 2e4, 0.49),
    Tissue(Body::Bar, 1e5, 0.3),
    Tissue(Body::Bar, 1e5, 0.45),
    Tissue(Body::Bar, 5e5, 0.3),
    Tissue(Body::Bar, 5e5, 0.45),
    Tissue(Body::Shuffled, 5e3, 0.4),
    Tissue(Body::Shuffled, 5e4, 0.45),
    Tissue(Body::Organ(Organ::Liver), 3e3, 0.45),
    Tissue(Body::Organ(Organ::Liver), 2e4, 0.47),
    Tissue(Body::Organ(Organ::Kidney), 3e3, 0.45),
    Tissue(Body::Organ(Organ::Kidney), 2e4, 0.45),
    Tissue(Body::Organ(Organ::Bowel), 5e3, 0.37),
    Tissue(Body::Organ(Organ::Bowel), 2e4, 0.45),
];

fn cases(quick: bool) -> Vec<Tissue> {
    TISSUES.into_iter().step_by(if quick { 5 } else { 1 }).collect()
}

impl Tissue {
    fn problem(self) -> Result<(Scene, TetMesh)> {
        let Self(body, young, poisson) = self;
        let bar = || Block::new(vec3(0.08, 0.02, 0.02), [16, 4, 4]).mesh();
        let mesh = match body {
            Body::Bar => bar()?,
            Body::Shuffled => shuffled(&bar()?, 1)?,
            // A look takes seconds: coarse ones tell as much.
            Body::Organ(organ) => organ.mesh(true)?,
        };
        let mut scene = match body {
            Body::Organ(organ) => organ.scene(young, poisson)?,
            _ => {
                let (young, poisson) = (format!("{young} Pa"), poisson.to_string());
                let keys = ["body.organ.material.young", "body.organ.material.poisson"];
                Scene::parse("a bar", BAR, &[(keys[0], &young), (keys[1], &poisson)])?
            }
        };
        scene.time.duration = MOTION;
        Ok((scene, mesh))
    }
}

/// One method at one accuracy.
#[derive(Clone, Copy, Debug)]
struct Told {
    method: Method,
    substeps: u32,
    /// In passes that add up the forces of all tetrahedra once.
    cost: f64,
    foretold: f64,
    found: f64,
}

/// What is chosen, and what else there is.
struct Answer {
    chosen: Told,
    other: Told,
}

impl Answer {
    /// What the choice costs, over the cheapest that is as accurate as asked; nothing where none is.
    fn over_cheapest(&self, accuracy: Accuracy) -> Option<f64> {
        let meets = |told: &&Told| told.found <= accuracy.share();
        let costs = [&self.chosen, &self.other].into_iter().filter(meets).map(|told| told.cost);
        costs.min_by(f64::total_cmp).map(|cheapest| self.chosen.cost / cheapest)
    }
}

fn answer(case: &Tissue) -> Result<Vec<Answer>> {
    let (scene, mesh) = case.problem()?;
    // Half as long as elsewhere, beside the explicit steps that are judged.
    let elements = Elements::Recovered;
    let truth = SolverSettings { explicit_safety: 0.5 * SAFETY, elements, ..small_steps() };
    let (exact, _) = moved::<f64>(&scene, truth, &mesh)?;
    let of = |method, accuracy| -> Result<Told> {
        let solver = SolverSettings { method, accuracy, ..SolverSettings::default() };
        let (ours, told) = moved::<f32>(&scene, solver, &mesh)?;
        Ok(Told { found: distance(&ours, &exact), ..told })
    };
    let explicit = of(Method::Explicit, Accuracy::Standard)?;
    let mut all = Vec::new();
    for accuracy in ACCURACIES {
        let quasi_newton = of(Method::QuasiNewton, accuracy)?;
        let solver = SolverSettings { accuracy, ..SolverSettings::default() };
        let mut scene = scene.clone();
        scene.solver = solver;
        let chosen = begin::<f32>(scene, Some(&mesh))?.solver().method;
        all.push(match chosen == Method::Explicit {
            true => Answer { chosen: explicit, other: quasi_newton },
            false => Answer { chosen: quasi_newton, other: explicit },
        });
    }
    Ok(all)
}

fn moved<S: Real>(scene: &Scene, solver: SolverSettings, mesh: &TetMesh) -> Result<(Places, Told)> {
    let mut scene = scene.clone();
    scene.solver = solver;
    let mut simulation = begin::<S>(scene, Some(mesh))?;
    let told = Told {
        method: simulation.solver().method,
        substeps: simulation.substeps(),
        cost: simulation.expected_cost(),
        foretold: simulation.expected_errors().motion.unwrap_or(f64::NAN),
        found: f64::NAN,
    };
    Ok((follow(&mut simulation, places)?, told))
}

fn run(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    context.document.paragraph(format!(
        "With `method = \"auto\"` a run says before it begins by how much its motion will be off. Bars of 80 x 20 x 20 \
         mm and coarse organs, stable neo-Hookean, are let go at their rest shapes and swing undamped for {MOTION} s, in \
         single precision. *Foretold* is what the run says, *found* the root mean square distance of all vertices from \
         small explicit steps in double precision, over their root mean square displacement, over all frames. Of a body \
         that no error is asked to be smaller for than it is anyway, more is foretold than found."
    ));
    let mut head = vec!["tissue".to_owned()];
    for accuracy in ACCURACIES {
        let name = accuracy.to_string().replace('"', "");
        head.extend([
            format!("{name}: method"),
            "substeps".into(),
            "foretold".into(),
            "found".into(),
        ]);
    }
    let mut table = Table::new(head);
    for (case, answer) in cases.iter().zip(&answers) {
        let mut row = vec![case.to_string()];
        for Answer { chosen: told, .. } in answer {
            let [foretold, found] = [told.foretold, told.found].map(percent);
            row.extend([told.method.to_string(), told.substeps.to_string(), foretold, found]);
        }
        table.row(row);
    }
    context.document.table(&table);
    costs(context, &cases, &answers);
    for (index, accuracy) in ACCURACIES.into_iter().enumerate() {
        let of = |is: &dyn Fn(&Told) -> bool| {
            answers.iter().filter(|all| is(&all[index].chosen)).count()
        };
        let honest = of(&|told| {
            let most = (LARGEST_RATIO * told.found).max(UNSEEN);
            told.found <= told.foretold && told.foretold <= most
        });
        let kept = of(&|told| told.found <= accuracy.share());
        let (count, name) = (answers.len(), accuracy.to_string());
        context.verdict(
            format!(
                "{name}: scenes whose error is foretold, at most {LARGEST_RATIO} times too large or {}",
                percent(UNSEEN)
            ),
            format!(">= {}", count - EXCEPTIONS),
            honest.to_string(),
            honest + EXCEPTIONS >= count,
        );
        context.verdict(
            format!("{name}: scenes that keep {}", percent(accuracy.share())),
            count.to_string(),
            kept.to_string(),
            kept == count,
        );
        let cheap = |answer: &&Vec<Answer>| {
            answer[index].over_cheapest(accuracy).is_some_and(|over| over <= LARGEST_COST)
        };
        let cheap = answers.iter().filter(cheap).count();
        context.verdict(
            format!("{name}: scenes that cost at most {LARGEST_COST} times the cheapest method"),
            count.to_string(),
            cheap.to_string(),
            cheap == count,
        );
    }
    Ok(())
}

/// What the choice costs, beside the other method.
fn costs(context: &mut Context, cases: &[Tissue], answers: &[Vec<Answer>]) {
    context.document.paragraph(
        "What a frame costs, counted in passes that add up the forces of all tetrahedra once: small steps, and in each \
         substep as much as 2.6 of them; a pass of the quasi-Newton method, which does more, counts as so many of them as it takes as \
         long. *Over the cheapest*: of the two methods, those whose error found is at most what is asked.",
    );
    let mut head = vec!["tissue".to_owned()];
    for accuracy in ACCURACIES {
        let name = accuracy.to_string().replace('"', "");
        head.extend([
            format!("{name}: chosen"),
            "passes".into(),
            "the other's".into(),
            "its error".into(),
            "over the cheapest".into(),
        ]);
    }
    let mut table = Table::new(head);
    for (case, answer) in cases.iter().zip(answers) {
        let mut row = vec![case.to_string()];
        for (Answer { chosen, other }, accuracy) in answer.iter().zip(ACCURACIES) {
            let over = Answer { chosen: *chosen, other: *other }.over_cheapest(accuracy);
            row.extend([
                chosen.method.to_string(),
                format!("{:.0}", chosen.cost),
                format!("{:.0}", other.cost),
                percent(other.found),
                over.map_or("-".to_owned(), |over| format!("{over:.2}")),
            ]);
        }
        table.row(row);
    }
    context.document.table(&table);
}
