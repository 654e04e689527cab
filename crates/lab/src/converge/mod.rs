//! `viscera-lab converge`: a scene on finer and finer meshes, and what they lead to.

pub mod levels;

use anyhow::{Result, bail};
use clap::Args;
use std::path::{Path, PathBuf};
use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::settings::{Elements, SolverSettings};
use viscera::simulation::{Assembly, Simulation};
use viscera_report::{Axis, Plot, Series, Style, Table, percent};
use viscera_resources::files::{prepare_file, write_atomic};
use viscera_resources::{Memory, MeshFiles, memory};

use crate::rest_command::{read_scene, refuse_what_rest_does_not_determine, tools};
use crate::sections::Progress;
use levels::{AtRest, Limit, PARTS, at_rest, error, limit, refined};

/// Show how a scene's state of rest depends on its mesh, and what the body itself would do
///
/// Divides every tetrahedron into eight, again and again, brings the scene's end to rest on each mesh, with linear and with
/// recovered-gradient tetrahedra, and extrapolates to no mesh at all. Prints displacement and forces of each mesh, how far
/// they are off, and what `viscera run` says of the mesh beside it; draws the curve. The boundary stays the polyhedron that
/// it is, patches keep the places that they have on the scene's own mesh.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct ConvergeArguments {
    /// The scene file
    pub scene: PathBuf,
    /// Change a setting: KEY=VALUE, as in `body.liver.material.young="8 kPa"`; may be repeated.
    /// `viscera scene describe` lists keys
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub settings: Vec<String>,
    /// Folder where mesh files are looked for that are not beside the scene
    #[arg(long, value_name = "DIR", env = "VISCERA_DATA")]
    pub data: Option<PathBuf>,
    /// Meshes, the scene's own included; each has eight times the tetrahedra of the one before
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(2..=4))]
    pub meshes: u32,
    /// Memory that may be used [default: what is free]
    #[arg(long, value_name = "SIZE")]
    pub memory: Option<Memory>,
    /// The plot [default: out/NAME-OF-THE-SCENE-meshes.svg]
    #[arg(long, value_name = "FILE.svg")]
    pub out: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  viscera-lab converge scenes/cantilever.toml                  three meshes, a minute
  viscera-lab converge scenes/liver_lifted.toml --meshes 2
  viscera-lab converge scenes/cantilever.toml --set body.bar.cells_across=2 --meshes 4";

/// The kinds of tetrahedra that are compared.
const ELEMENTS: [(&str, Elements); 2] =
    [("linear", Elements::Plain), ("recovered-gradient", Elements::Recovered)];

/// A scene on all meshes with one kind of tetrahedra.
pub struct Curve {
    /// From coarse to fine.
    pub meshes: Vec<AtRest>,
}

/// Both kinds, and what they lead to.
pub struct Found {
    /// The vertices that all meshes have, at rest [m].
    pub rest: Vec<Vec3<f64>>,
    /// Their masses [kg] on the coarsest.
    pub masses: Vec<f64>,
    /// In the order linear, recovered-gradient.
    pub curves: [Curve; 2],
    /// Of the recovered-gradient ones.
    pub limit: Limit,
}

impl Found {
    /// How far a mesh is off, of the displacement.
    pub fn error(&self, mesh: &AtRest) -> f64 {
        error(&self.rest, &self.masses, &mesh.places, &self.limit.places)
    }
}

/// Computes a scene on so many meshes; `load` gets the names of mesh files.
pub fn compute(
    scene: &Scene,
    load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    meshes: u32,
    progress: Option<&Progress>,
) -> Result<Found> {
    let coarse = Assembly::new(scene, load)?;
    let kept: Vec<usize> = coarse.bodies.iter().map(|body| body.vertices.len()).collect();
    let model = coarse.builder.build::<f64>()?;
    let mut curves = ELEMENTS.map(|_| Curve { meshes: Vec::new() });
    for times in 0..meshes {
        let finer = refined(scene, times);
        let assembly = Assembly::new(&finer, load)?;
        for ((_, elements), curve) in ELEMENTS.into_iter().zip(&mut curves) {
            let estimates = times == 0;
            curve.meshes.push(at_rest(&finer, &assembly, elements, &kept, estimates, progress)?);
        }
    }
    let limit = limit(&curves[1].meshes);
    Ok(Found { rest: model.rest_positions, masses: model.masses, curves, limit })
}

/// Cases of the bar for so many meshes.
pub fn cases(meshes: u32) -> usize {
    (meshes * PARTS) as usize * ELEMENTS.len()
}

/// Carries out `viscera-lab converge`; `print` gets the text part by part.
pub fn run(arguments: &ConvergeArguments, print: &dyn Fn(&str) -> Result<()>) -> Result<()> {
    let stem = arguments.scene.file_stem().unwrap_or(arguments.scene.as_os_str());
    let usual = || Path::new("out").join(format!("{}-meshes.svg", stem.to_string_lossy()));
    let out = arguments.out.clone().unwrap_or_else(usual);
    if out.extension().is_none_or(|extension| extension != "svg") {
        bail!("--out {}: give the file a name that ends in .svg", out.display());
    }
    prepare_file(&out, "--out")?;
    let scene = read_scene(&arguments.scene, &arguments.settings)?;
    refuse_what_rest_does_not_determine(&scene)?;
    let files = MeshFiles::new(&arguments.scene, arguments.data.as_deref());
    let mut load = |name: &str| files.load(name);
    let coarse = Assembly::new(&scene, &mut load)?;
    for note in coarse.notes.iter().cloned().chain(tools::note(&scene)) {
        eprintln!("note: {note}");
    }
    let tets: usize = coarse.bodies.iter().map(|body| body.tets.len()).sum();
    let finest = tets << (3 * (arguments.meshes - 1));
    let precision = viscera::settings::Precision::F64;
    let needed = memory::of_run(finest, &SolverSettings { precision, ..SolverSettings::default() });
    let what = format!("{}: a mesh of {finest} tetrahedra", scene.name);
    memory::check(&what, needed, arguments.memory, "take fewer --meshes")?;
    // Bodies that nothing holds are found before anything is computed.
    Simulation::<f64>::new(scene.clone(), coarse)?;
    let progress = Progress::new(cases(arguments.meshes));
    let found = compute(&scene, &mut load, arguments.meshes, Some(&progress));
    // The bar goes before anything is printed, an error included.
    progress.finish();
    let found = found?;
    print(&describe(&scene, &found))?;
    write_atomic(&out, plot(&scene, &found).to_svg()?.as_bytes())?;
    print(&format!("plot: {}\n", out.display()))
}

fn describe(scene: &Scene, found: &Found) -> String {
    let mut heads = vec!["tetrahedra", "edges", "kind", "displacement", "off by"];
    let patches: Vec<&str> =
        found.curves[0].meshes[0].forces.iter().map(|patch| patch.name.as_str()).collect();
    heads.extend(patches.iter().copied());
    heads.push("inverted");
    let mut table = Table::new(heads);
    let moved = |places: &[Vec3<f64>]| -> f64 {
        let masses: f64 = found.masses.iter().sum();
        let squares = places.iter().zip(&found.rest).zip(&found.masses);
        (squares.map(|((x, y), m)| m * (*x - *y).length_squared()).sum::<f64>() / masses).sqrt()
    };
    for ((name, _), curve) in ELEMENTS.iter().zip(&found.curves) {
        for mesh in &curve.meshes {
            let mut row = vec![
                mesh.tets.to_string(),
                format!("{:.2} mm", 1e3 * mesh.edge),
                (*name).to_owned(),
                format!("{:.3} mm", 1e3 * moved(&mesh.places)),
                percent(found.error(mesh)),
            ];
            row.extend(
                mesh.forces
                    .iter()
                    .map(|patch| format!("{:.4} N", Vec3::<f64>::from_f64(patch.force).length())),
            );
            row.push(mesh.inverted.to_string());
            table.row(row);
        }
    }
    let mut text = format!("{}: the state of rest at its end\n{}", scene.title, table.to_text());
    text.push_str(&format!(
        "the body itself: {:.3} mm, extrapolated from recovered-gradient tetrahedra; errors fall with the power {:.1} of \
         the edges' length\n",
        1e3 * moved(&found.limit.places),
        found.limit.order
    ));
    for ((name, _), curve) in ELEMENTS.iter().zip(&found.curves) {
        let coarsest = &curve.meshes[0];
        if let Some(estimate) = &coarsest.estimate {
            text.push_str(&format!(
                "{name} tetrahedra of the scene's own mesh: off by {}, estimated {}{}\n",
                percent(found.error(coarsest)),
                if estimate.complete { "" } else { "at least " },
                percent(estimate.displacement)
            ));
        }
        if let Some(mesh) = curve.meshes.iter().find(|mesh| mesh.left > levels::ENOUGH) {
            text.push_str(&format!(
                "warning: {name}, {} tetrahedra: {} of the displacement from rest; errors are no smaller than that\n",
                mesh.tets,
                percent(mesh.left)
            ));
        }
    }
    text
}

fn plot(scene: &Scene, found: &Found) -> Plot {
    let mut plot = Plot::new(
        format!("{}: how far its mesh is off", scene.title),
        Axis::logarithmic("length of edges [mm]"),
        Axis::logarithmic("error of places, percent of the displacement"),
    );
    for ((name, _), curve) in ELEMENTS.iter().zip(&found.curves) {
        let points = curve.meshes.iter();
        let points = points.map(|mesh| [1e3 * mesh.edge, 100.0 * found.error(mesh)]);
        plot.series(Series::new(format!("{name} tetrahedra"), points));
        if let Some(estimate) = &curve.meshes[0].estimate {
            let point = [1e3 * curve.meshes[0].edge, 100.0 * estimate.displacement];
            let name = format!("{name}, as estimated by a run");
            plot.series(Series::new(name, [point]).with_style(Style::Markers));
        }
    }
    plot
}
