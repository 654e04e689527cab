//! `viscera mesh repair`.

use anyhow::{Context, Result, ensure};
use clap::Args;
use std::path::{Path, PathBuf};
use viscera::mesh::io::{MendedFile, MeshFile, MeshNames, ReadReport};
use viscera::mesh::topology::{count_open_edges, edges};
use viscera::mesh::winding::fill;
use viscera::mesh::{
    SurfaceMesh, TetMesh, boundary_surface, inspect, inspect_surface, topology::BoundingBox,
};
use viscera_import::is_image;
use viscera_resources::files;

use crate::mesh_files::{check_other, ending_of, length, load, write_surface, write_tets};
use crate::progress;
use crate::quality::Verdict;

/// What to mend.
#[derive(Args)]
pub struct RepairArguments {
    /// The mesh or surface to read
    file: PathBuf,
    /// The file to write: tetrahedra as .vtu, .vtk or .msh, surfaces as .obj, .stl or .ply
    out: PathBuf,
    /// The length that 1 in the file stands for; what is written is in metres
    #[arg(long, default_value = METRES)]
    unit: String,
    /// Make vertices one that are no farther apart; a millionth of the mesh's size where nothing is said
    #[arg(long, value_name = "LENGTH")]
    weld: Option<String>,
    /// Fill the boundary with new tetrahedra, in place of moving vertices: regions and named patches are lost
    #[arg(long)]
    refill: bool,
    /// The length of edges where a surface is closed, or filled anew; the mean one of what there is where nothing is said
    #[arg(long, value_name = "LENGTH")]
    edge: Option<String>,
}

/// The unit of files that are in metres.
const METRES: &str = "1 m";

/// Boxes around a mesh have at most so many edges along their diagonal: a million tetrahedra or two.
const FINEST: f64 = 100.0;

/// Carries out the command.
pub fn execute(arguments: &RepairArguments) -> Result<()> {
    let RepairArguments { file, out, unit, weld, refill, edge } = arguments;
    let ending = ending_of(out)?;
    check_other(file, out)?;
    let name = file.display().to_string();
    let mesh = MeshFile::load(&name, load).map_err(anyhow::Error::msg)?;
    ensure!(
        !is_image(&name, &mesh.bytes),
        "{name} is a scan, not a mesh; fill its labels by `viscera mesh tetrahedralize {name}`"
    );
    let weld = weld.as_deref().map(|weld| named(weld, "--weld")).transpose()?;
    let edge = edge.as_deref().map(|edge| named(edge, "--edge")).transpose()?;
    files::prepare_file(out, "the file to write")?;
    let bar = progress::spinner(format!("mending {name}"));
    let done = match mesh.mended(length(unit)?, weld)? {
        MendedFile::Surface(surface, mending) => {
            check_ending(out, &ending, &["obj", "stl", "ply"], "surfaces are")?;
            ensure!(
                !refill,
                "--refill makes tetrahedra of a boundary; {name} is a surface, fill it by `viscera mesh tetrahedralize {name} --out mesh.vtu`"
            );
            let mut texts = mending.texts();
            let surface = closed(surface, edge, &mut texts).with_context(|| name.clone())?;
            let problems = inspect_surface(&surface, &ReadReport::default()).problems();
            let verdict = Verdict::new(out, None, true, &problems).without_repair().text(true);
            (write_surface(&surface, &ending)?, texts, verdict)
        }
        MendedFile::Tets(mended, names) => {
            check_ending(out, &ending, &["vtu", "vtk", "msh"], "tetrahedra are")?;
            let mut texts = mended.mending.texts();
            let (mesh, names) = match refill {
                true => {
                    let mesh =
                        refilled(&mended.mesh, edge, &mut texts).with_context(|| name.clone())?;
                    (mesh, MeshNames::default())
                }
                false => (mended.mesh, names),
            };
            let problems = inspect(&mesh, &ReadReport::default()).problems();
            let verdict = Verdict::new(out, None, false, &problems).without_repair();
            let mut text = verdict.text(false);
            if !refill && !verdict.good {
                let (from, to) = (files::word(&name), files::word(&out.display().to_string()));
                let unit =
                    if unit == METRES { String::new() } else { format!(" --unit \"{unit}\"") };
                text.push_str(&format!(
                    "{:<18} viscera mesh repair {from} {to}{unit} --refill\n",
                    ""
                ));
            }
            (write_tets(&mesh, &names, &ending)?, texts, text)
        }
    };
    bar.finish_and_clear();
    let (bytes, mut texts, verdict) = done;
    files::write_atomic(out, &bytes)?;
    if texts.is_empty() {
        texts.push("nothing to mend".to_owned());
    }
    let rows = texts.iter().zip(std::iter::once("repaired").chain(std::iter::repeat("")));
    let rows: String = rows.map(|(text, head)| format!("{head:<18} {text}\n")).collect();
    files::print(&format!("{rows}{:<18} {}\n{verdict}", "wrote", out.display()))
}

fn named(text: &str, flag: &str) -> Result<f64> {
    length(text).map_err(|error| anyhow::anyhow!("{}", error.to_string().replace("--unit", flag)))
}

fn check_ending(out: &Path, ending: &str, known: &[&str], what: &str) -> Result<()> {
    let known_texts: Vec<String> = known.iter().map(|ending| format!(".{ending}")).collect();
    ensure!(
        known.contains(&ending),
        "{}: {what} written as {}",
        out.display(),
        known_texts.join(", ")
    );
    Ok(())
}

/// The surface itself where it is closed, or that of what is inside of it.
fn closed(surface: SurfaceMesh, edge: Option<f64>, texts: &mut Vec<String>) -> Result<SurfaceMesh> {
    if count_open_edges(&surface) == 0 {
        return Ok(surface);
    }
    let lengths = surface.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let edge = edge.unwrap_or_else(|| mean_edge(&surface.vertices, lengths));
    let filled = fill(&surface, edge)?;
    let skin = boundary_surface(&filled.mesh).surface;
    texts.push(format!(
        "closed, with {} triangles in place of {}; {:.1} % of its area lies where there was none",
        skin.triangles.len(),
        surface.triangles.len(),
        100.0 * filled.invented
    ));
    Ok(skin)
}

/// New tetrahedra within the boundary of others.
fn refilled(mesh: &TetMesh, edge: Option<f64>, texts: &mut Vec<String>) -> Result<TetMesh> {
    let surface = boundary_surface(mesh).surface;
    let edge = edge.unwrap_or_else(|| mean_edge(mesh.vertices(), edges(mesh)));
    let filled = fill(&surface, edge)?;
    let change = 100.0 * (filled.mesh.volume() / mesh.volume() - 1.0);
    texts.push(format!(
        "filled anew with {} tetrahedra in place of {}, which changes the volume by {change:.2} %",
        filled.mesh.tets().len(),
        mesh.tets().len()
    ));
    Ok(filled.mesh)
}

/// A mean length, but none that would give millions of tetrahedra.
fn mean_edge(
    places: &[viscera::scalar::Vec3<f64>],
    ends: impl IntoIterator<Item = [u32; 2]>,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for [a, b] in ends {
        sum += (places[a as usize] - places[b as usize]).length();
        count += 1.0;
    }
    let size = BoundingBox::around(places).size().length();
    (sum / f64::max(count, 1.0)).max(size / FINEST)
}
