//! `viscera-lab rest`: what the Newton reference says about a scene file.

mod comparison;
mod files;
mod path;
pub(crate) mod tools;

use anyhow::{Context as _, Result, bail};
use clap::Args;
use std::path::{Path, PathBuf};
use viscera::measure::{TetMeasure, measure_displacements, measure_tets, summarize_deformation};
use viscera::mesh::io::vtu::{self, Array};
use viscera::scene::Scene;
use viscera::simulation::Simulation;

use crate::sections::Progress;
pub use files::read_scene;
use path::{LoadPath, Rest};
use viscera_report::{percent, scientific, si};
use viscera_resources::Memory;
use viscera_resources::files::{prepare_file, write_atomic};

/// Find the exact state of rest at the end of a scene with the Newton reference
///
/// Says first what it will cost, then follows the scene's motions and forces to its end in
/// increments of time, each a state of rest by Newton's method in double precision. Inertia and
/// viscosity play no part. Prints the deformation, whether the state is a minimum, and the force on
/// every fixing, moved patch and pulled patch.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct RestArguments {
    /// The scene file
    pub scene: PathBuf,
    /// Change a setting: KEY=VALUE, as in `body.liver.material.young="8 kPa"`; may be repeated.
    /// `viscera scene describe` lists keys
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub settings: Vec<String>,
    /// Folder where mesh files are looked for that are not beside the scene
    #[arg(long, value_name = "DIR", env = "VISCERA_DATA")]
    pub data: Option<PathBuf>,
    /// Increments of time; more where large motions defeat Newton's method
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub parts: u32,
    /// Memory that the reference may take
    #[arg(long, value_name = "SIZE", default_value = "8 GB")]
    pub memory: Memory,
    /// Write the state of rest as VTU: displacement, J, von Mises stress, body
    #[arg(long, value_name = "FILE.vtu")]
    pub out: Option<PathBuf>,
    /// Let the library's solver settle in the same scene, with the scene's settings and 3 s more at
    /// 0.9 of the velocities per frame, and say how far from the reference it ends
    #[arg(long)]
    pub compare: bool,
}

const EXAMPLES: &str = "\
Examples:
  viscera-lab rest scenes/cantilever.toml            the droop, and the force at the wall
  viscera-lab rest scenes/grab.toml --compare        how far `viscera run` is from the truth
  viscera-lab rest scenes/twist.toml --parts 48 --out out/twist.vtu
                                                     a long way, in small parts
  viscera-lab rest scenes/cantilever.toml --set body.bar.cells_across=8 --memory \"16 GB\"
                                                     a finer mesh";

/// Carries out `viscera-lab rest`; `print` gets the text part by part.
pub fn run(arguments: &RestArguments, print: &dyn Fn(&str) -> Result<()>) -> Result<()> {
    if let Some(out) = &arguments.out {
        if out.extension().is_none_or(|extension| extension != "vtu") {
            bail!("--out {}: give the file a name that ends in .vtu", out.display());
        }
        prepare_file(out, "--out")?;
    }
    let (scene, assembly) =
        files::load(&arguments.scene, &arguments.settings, arguments.data.as_deref())?;
    refuse_what_rest_does_not_determine(&scene)?;
    let simulation = Simulation::<f64>::new(scene, assembly)?;
    let mut path = LoadPath::new(&simulation, arguments.parts, arguments.memory)?;
    for note in &simulation.assembly().notes {
        eprintln!("note: {note}");
    }
    if let Some(note) = tools::note(simulation.scene()) {
        eprintln!("note: {note}");
    }
    print(&heading(&simulation))?;
    let (cost, seconds) = path.cost()?;
    let parts = match arguments.parts - path.len() as u32 {
        0 if arguments.parts == 1 => "one part".to_owned(),
        0 => format!("{} parts", arguments.parts),
        idle => format!("{} of {} parts; {idle} change nothing", path.len(), arguments.parts),
    };
    print(&format!(
        "reference: {} unknowns, {} entries in the matrix, {} in its factor; about {} and {} for \
         {parts}\n",
        cost.unknowns,
        cost.matrix_entries,
        cost.factor_entries,
        Memory(cost.bytes),
        si(seconds, "s"),
    ))?;
    path.check_memory(&cost)?;

    let frames = comparison::frame_count(simulation.scene());
    let cases = path.len() + if arguments.compare { frames as usize } else { 0 };
    let progress = Progress::new(cases);
    let work = || -> Result<_> {
        let rest = progress.section("reference", || path.follow(&progress))?;
        let settled = arguments
            .compare
            .then(|| progress.section("library", || comparison::settle(&simulation, &progress)));
        Ok((rest, settled))
    };
    let done = work();
    // The bar goes before anything is printed, an error included.
    progress.finish();
    let (rest, settled) = done?;
    let mut tets = Vec::new();
    measure_tets(simulation.model(), &rest.state.positions, &mut tets);
    print(&describe(&simulation, &rest, &tets, arguments.parts))?;
    if let Some(out) = &arguments.out {
        write(&simulation, &rest, &tets, out)?;
        print(&format!("state of rest: {}\n", out.display()))?;
    }
    if let Some(settled) = settled {
        let rows = comparison::compare(&simulation, &rest, &settled?, arguments.memory)?;
        print(&format!("the library's solver after {frames} frames, against the reference:\n"))?;
        print(&lines(&rows))?;
    }
    Ok(())
}

/// Refuses scenes whose end depends on more than what acts there.
pub fn refuse_what_rest_does_not_determine(scene: &Scene) -> Result<()> {
    viscera_reference::check_determined(scene).with_context(|| scene.name.clone())
}

fn heading(simulation: &Simulation<f64>) -> String {
    let model = simulation.model();
    format!(
        "{}: {} tetrahedra, {} vertices, {:.3} kg\n",
        simulation.scene().title,
        model.tet_count(),
        model.vertex_count(),
        model.masses.iter().sum::<f64>(),
    )
}

/// The state of rest in words.
fn describe(simulation: &Simulation<f64>, rest: &Rest, tets: &[TetMeasure], parts: u32) -> String {
    let moved = measure_displacements(simulation.model(), &rest.state.positions, &mut Vec::new());
    let deformation = summarize_deformation(tets);
    let smallest = tets.iter().map(|tet| tet.volume_ratio).fold(f64::INFINITY, f64::min);
    let minimum = match rest.state.convergence.minimum {
        true => "yes",
        false => "no: a saddle, from which a push leads elsewhere; try other --parts",
    };
    let inverted = match deformation.inverted {
        0 => "0".to_owned(),
        count => format!(
            "{count}; smaller parts may lead to another minimum, for example --parts {}",
            parts.saturating_mul(4)
        ),
    };
    let gradient = rest.standing.gradient;
    let mut text = format!("at rest at {:.3} s:\n", rest.state.time);
    text.push_str(&lines(&[
        ("largest displacement", si(moved, "m")),
        ("volume change", percent(deformation.volume_ratio - 1.0)),
        ("elastic energy", format!("{:.6} mJ", 1e3 * rest.standing.elastic_energy)),
        ("smallest volume ratio", format!("{smallest:.4}")),
        ("inverted tetrahedra", inverted),
        ("Newton steps", rest.steps.to_string()),
        ("|grad| / load", format!("{} ({gradient:.1e} N)", scientific(rest.relative_gradient()))),
        ("minimum", minimum.to_owned()),
    ]));
    // More digits than a run has: Newton's method has them.
    for patch in
        simulation.patch_forces_at(rest.state.time, &rest.state.positions, &rest.state.holding)
    {
        text.push_str(&format!("{patch:.6}\n"));
    }
    for tool in tools::forces(simulation, rest) {
        text.push_str(&format!("{tool:.6}\n"));
    }
    text
}

/// Rows of name and value.
fn lines(rows: &[(&str, String)]) -> String {
    rows.iter().map(|(name, value)| format!("  {name:<26}{value}\n")).collect()
}

fn write(
    simulation: &Simulation<f64>,
    rest: &Rest,
    measures: &[TetMeasure],
    out: &Path,
) -> Result<()> {
    let (mut tets, mut bodies) = (Vec::new(), Vec::new());
    for (index, body) in simulation.assembly().bodies.iter().enumerate() {
        let first = body.vertices.start as u32;
        tets.extend(body.mesh.tets().iter().map(|tet| tet.map(|v| v + first)));
        bodies.resize(tets.len(), index as u32);
    }
    let mut displacements = Vec::new();
    measure_displacements(simulation.model(), &rest.state.positions, &mut displacements);
    let scalars = |name: &str, value: fn(&TetMeasure) -> f64| {
        Array::scalars(name, &measures.iter().map(value).collect::<Vec<f64>>())
    };
    let point_data = [Array::vectors("displacement [m]", &displacements)];
    let cell_data = [
        scalars("J", |tet| tet.volume_ratio),
        scalars("von Mises Cauchy stress [Pa]", |tet| tet.von_mises),
        Array::integers("body", &bodies),
    ];
    let bytes = vtu::write(&rest.state.positions, &tets, &point_data, &cell_data);
    write_atomic(out, &bytes.with_context(|| format!("cannot write {}", out.display()))?)
}
