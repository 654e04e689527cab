//! `viscera mesh`.

use anyhow::{Context, Result, bail, ensure};
use clap::{Args, Subcommand};
use serde::Serialize;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use viscera::mesh::io::{Mesh, MeshFile, MeshNames};
use viscera::mesh::topology::connected_components;
use viscera::mesh::{
    MeshRepairs, SurfaceMesh, TetMesh, boundary_surface, inspect, inspect_surface,
};
use viscera::scalar::{Vec3, vec3};
use viscera::scene::RegionLabel;
use viscera_import::{Found, Unit, angles_plot, guess_unit, is_image, open};
use viscera_resources::files;

use crate::import::{self, ImportArguments, label_name};
use crate::labels;
use crate::mesh_files::{check_other, ending_of, length, load, write_surface, write_tets};
use crate::quality::Verdict;
use crate::repair::{self, RepairArguments};

/// Look at mesh files and segmented scans, fill surfaces, convert formats
#[derive(Subcommand)]
pub enum MeshCommand {
    /// Counts, size, volume, shape quality, what is wrong, and what to do about it
    ///
    /// Reads Gmsh (.msh, all versions), VTK (.vtk, .vtu, .vtp), TetGen (.ele with .node), Medit (.mesh), Abaqus (.inp), and
    /// surfaces from OBJ, STL and PLY.
    Inspect {
        /// The mesh file
        file: PathBuf,
        /// The length that 1 in the file stands for, such as "1 mm"; guessed and said where it is not given, as by `viscera run FILE`
        #[arg(long)]
        unit: Option<String>,
        /// Print JSON, in SI units, instead of a table
        #[arg(long)]
        json: bool,
        /// Draw how often dihedral angles occur, as SVG
        #[arg(long, value_name = "FILE")]
        plot: Option<PathBuf>,
    },
    /// The labels of a segmented scan (NIfTI, NRRD): names, voxels, millilitres, pieces, where the image cuts them
    Labels {
        /// The label map
        file: PathBuf,
        /// Names of labels by number, in place of those in the file: 1=liver,2=tumor
        #[arg(long, value_name = "NUMBER=NAME", value_delimiter = ',', value_parser = label_name)]
        names: Vec<(u16, String)>,
    },
    /// Fill a surface, or labels of a scan, with tetrahedra
    ///
    /// Surfaces may have holes, gaps and parts that cross; where inside and outside cannot be told apart it says so. Of several labels each
    /// gets a file of its own, with its name before the ending.
    Tetrahedralize {
        /// The surface or the label map
        file: PathBuf,
        /// The mesh to write: .vtu, .vtk or .msh, in metres
        #[arg(long, short)]
        out: PathBuf,
        #[command(flatten)]
        import: ImportArguments,
    },
    /// Write a mesh in another format, another unit, or with other axes
    ///
    /// Writes tetrahedra as .vtu, .vtk and .msh (Gmsh 4.1), surfaces as .obj, .stl and .ply, in metres; the surface of tetrahedra where the format has
    /// no others.
    Convert(ConvertArguments),
    /// Write a mesh with what is wrong mended or left out
    ///
    /// Vertices in one place become one. Tetrahedra that are flat or inside out get a volume where moving vertices inside can give them one, and are
    /// left out elsewhere, as are those that repeat others; the boundary stays where it is. Surfaces are wound outwards and closed. Says what it did.
    Repair(RepairArguments),
}

/// What to change on the way.
#[derive(Args)]
pub struct ConvertArguments {
    /// The mesh or surface to read
    file: PathBuf,
    /// The file to write
    out: PathBuf,
    /// The length that 1 in the file stands for
    #[arg(long, default_value = "1 m")]
    unit: String,
    /// A factor on all lengths
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    scale: f64,
    /// Which axis of the file becomes x, y and z: "x,z,-y" lays down what stands
    #[arg(long, default_value = "x,y,z", allow_hyphen_values = true)]
    axes: String,
    /// Keep tetrahedra of these regions only, by label or by the name in the file
    #[arg(long, value_delimiter = ',', value_name = "LABELS")]
    region: Vec<String>,
    /// Keep one unconnected part only, as `viscera mesh inspect` counts them
    #[arg(long, value_name = "NUMBER")]
    component: Option<usize>,
}

/// Carries out a `viscera mesh` command.
pub fn execute(command: &MeshCommand) -> Result<()> {
    match command {
        MeshCommand::Inspect { file, unit, json, plot } => {
            inspect_file(file, unit.as_deref(), *json, plot.as_deref())
        }
        MeshCommand::Labels { file, names } => labels::list(file, names),
        MeshCommand::Tetrahedralize { file, out, import } => tetrahedralize(file, out, import),
        MeshCommand::Convert(arguments) => convert(arguments),
        MeshCommand::Repair(arguments) => repair::execute(arguments),
    }
}

fn inspect_file(file: &Path, given: Option<&str>, json: bool, plot: Option<&Path>) -> Result<()> {
    let name = file.display().to_string();
    let mesh = MeshFile::load(&name, load).map_err(anyhow::Error::msg)?;
    ensure!(
        !is_image(&name, &mesh.bytes),
        "{name} is a scan, not a mesh; look at it by `viscera mesh labels {name}`"
    );
    if let Some(plot) = plot {
        files::prepare_file(plot, "--plot")?;
    }
    let unit = match given {
        Some(unit) => Unit { meters: length(unit)?, reason: "unit as given".to_owned() },
        None => unit_of(file, &mesh)?,
    };
    match mesh.mesh(unit.meters)? {
        (Mesh::Surface(surface), report) => {
            ensure!(
                plot.is_none(),
                "--plot draws the angles of tetrahedra; {name} is a surface, fill it by `viscera mesh tetrahedralize`"
            );
            let summary = inspect_surface(&surface, &report);
            let verdict = Verdict::new(file, given, true, &summary.problems());
            print(&name, unit, (&summary, &verdict), verdict.text(true), json)
        }
        (Mesh::Tets(mesh), report) => {
            let summary = inspect(&mesh, &report);
            let verdict = Verdict::new(file, given, false, &summary.problems());
            print(&name, unit, (&summary, &verdict), verdict.text(false), json)?;
            let Some(plot) = plot else { return Ok(()) };
            let short = file.file_name().unwrap_or_default().to_string_lossy();
            let bodies = [(short.into_owned(), summary.angles)];
            files::write_atomic(plot, angles_plot(&bodies)?.as_bytes())
        }
    }
}

/// The unit that a scene of the file would have.
fn unit_of(file: &Path, mesh: &MeshFile) -> Result<Unit> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    Ok(match mesh.mesh(1.0)?.0 {
        Mesh::Surface(surface) => {
            guess_unit(&name, &surface.vertices, surface.enclosed_volume().abs())
        }
        Mesh::Tets(mesh) => guess_unit(&name, mesh.vertices(), mesh.volume()),
    })
}

/// A summary with the unit that its lengths were read by.
#[derive(Serialize)]
struct InUnit<'a, T> {
    /// Of 1 in the file [m].
    unit: f64,
    /// Where the unit is from.
    unit_reason: String,
    #[serde(flatten)]
    summary: &'a T,
    verdict: &'a Verdict,
}

fn print<T: Serialize + Display>(
    name: &str,
    unit: Unit,
    (summary, verdict): (&T, &Verdict),
    text: String,
    json: bool,
) -> Result<()> {
    if json {
        let Unit { meters, reason } = unit;
        let with_unit = InUnit { unit: meters, unit_reason: reason, summary, verdict };
        let text = serde_json::to_string_pretty(&with_unit).context("cannot write JSON")?;
        files::print(&format!("{text}\n"))
    } else {
        files::print(&format!("{name}\n{:<18} {}\n{summary}{text}", "unit", unit.reason))
    }
}

fn tetrahedralize(file: &Path, out: &Path, arguments: &ImportArguments) -> Result<()> {
    let ending = ending_of(out)?;
    ensure!(
        matches!(ending.as_str(), "vtu" | "vtk" | "msh"),
        "{}: tetrahedra are written as .vtu, .vtk or .msh",
        out.display()
    );
    check_other(file, out)?;
    files::prepare_file(out, "--out")?;
    let import = import::import_shapes(file, arguments)?;
    let mut written = String::new();
    for part in &import.parts {
        let target = if import.parts.len() == 1 {
            out.to_owned()
        } else {
            let stem = out.file_stem().unwrap_or_default().to_string_lossy();
            out.with_file_name(format!("{stem}_{}.{ending}", part.name))
        };
        files::write_atomic(&target, &write_tets(&part.mesh, &part.names, &ending)?)?;
        written.push_str(&format!("wrote {}\n", target.display()));
    }
    files::print(&format!("{}{written}", import.describe()))
}

fn convert(arguments: &ConvertArguments) -> Result<()> {
    let ConvertArguments { file, out, unit, scale, axes, region, component } = arguments;
    let ending = ending_of(out)?;
    let is_surface = matches!(ending.as_str(), "obj" | "stl" | "ply");
    ensure!(
        is_surface || matches!(ending.as_str(), "vtu" | "vtk" | "msh"),
        "{}: cannot write this format; tetrahedra go into .vtu, .vtk or .msh, surfaces into .obj, .stl or .ply",
        out.display()
    );
    ensure!(scale.is_finite() && *scale > 0.0, "--scale: a number above zero is needed");
    check_other(file, out)?;
    files::prepare_file(out, "the file to write")?;
    let turn = turn_of(axes)?;
    let factor = length(unit)? * scale;
    let place = |x: Vec3<f64>| {
        let x = x.to_array();
        let at = turn.map(|(axis, sign)| factor * sign * x[axis]);
        vec3(at[0], at[1], at[2])
    };
    let name = file.display().to_string();
    let mut notes = Vec::new();
    let bytes = match open(&name, load)? {
        Found::Labels(..) => {
            bail!("{name} is a segmented scan; fill it by `viscera mesh tetrahedralize`")
        }
        Found::Surface(surface, _) => {
            ensure!(
                is_surface,
                "{name} is a surface; fill it by `viscera mesh tetrahedralize {name} --out {}`",
                out.display()
            );
            ensure!(
                region.is_empty() && component.is_none(),
                "--region and --component choose tetrahedra; {name} is a surface"
            );
            let vertices = surface.vertices.iter().map(|x| place(*x)).collect();
            let mut surface = SurfaceMesh { vertices, triangles: surface.triangles };
            // What mirrors turns triangles inside out.
            if is_mirror(turn) {
                surface.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
            }
            write_surface(&surface, &ending)?
        }
        Found::Tets(mesh, mut report) => {
            let regions = labels_of(&name, &mesh, &report.names(), region)?;
            let (mesh, repairs) = chosen(&name, &mesh, &regions, *component)?;
            for patch in &mut report.patches {
                let kept = patch.vertices.iter().filter_map(|&v| repairs.vertex_after(v));
                patch.vertices = kept.collect();
            }
            report.patches.retain(|patch| !patch.vertices.is_empty());
            report.region_names.retain(|(region, _)| mesh.regions().contains(region));
            notes.extend(report.skipped_texts());
            notes.extend(report.unused_text());
            let vertices = mesh.vertices().iter().map(|x| place(*x)).collect();
            // What mirrors is rewound there.
            let (mesh, _) = TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec())?;
            match is_surface {
                true => write_surface(&boundary_surface(&mesh).surface, &ending)?,
                false => write_tets(&mesh, &report.names(), &ending)?,
            }
        }
    };
    files::write_atomic(out, &bytes)?;
    let notes = notes.iter().map(|note| format!("note: {note}\n"));
    files::print(&notes.collect::<String>())
}

/// The labels of regions that are given by label or by name.
fn labels_of(file: &str, mesh: &TetMesh, names: &MeshNames, wanted: &[String]) -> Result<Vec<u32>> {
    let mut labels = Vec::new();
    for text in wanted {
        let name = text.trim();
        let number = name.parse().ok().filter(|number| mesh.regions().contains(number));
        let region = number.map_or_else(|| RegionLabel::Name(name.to_owned()), RegionLabel::Number);
        let mut found = region.numbers(names);
        found.retain(|number| mesh.regions().contains(number));
        ensure!(
            !found.is_empty(),
            "{file}: no tetrahedron has the label {name}; its regions are {}",
            names.list_regions(mesh.regions())
        );
        labels.append(&mut found);
    }
    Ok(labels)
}

/// Which axis each coordinate comes from, and its sign.
fn turn_of(text: &str) -> Result<[(usize, f64); 3]> {
    let wrong =
        || format!("--axes: write x, y and z once each, such as \"x,z,-y\"; found \"{text}\"");
    let mut turn = [(0, 1.0); 3];
    let words: Vec<&str> = text.split([',', ' ']).filter(|word| !word.is_empty()).collect();
    ensure!(words.len() == 3, wrong());
    for (place, word) in turn.iter_mut().zip(words) {
        let (sign, axis) = match word.strip_prefix('-') {
            Some(axis) => (-1.0, axis),
            None => (1.0, word.strip_prefix('+').unwrap_or(word)),
        };
        let axis = ["x", "y", "z"].iter().position(|known| axis.eq_ignore_ascii_case(known));
        *place = (axis.with_context(wrong)?, sign);
    }
    ensure!((0..3).all(|axis| turn.iter().any(|(from, _)| *from == axis)), wrong());
    Ok(turn)
}

fn is_mirror(turn: [(usize, f64); 3]) -> bool {
    let axes = turn.map(|(axis, _)| axis);
    let is_even = matches!(axes, [0, 1, 2] | [1, 2, 0] | [2, 0, 1]);
    let signs: f64 = turn.iter().map(|(_, sign)| sign).product();
    is_even == (signs < 0.0)
}

/// The tetrahedra of some regions, and of one part.
fn chosen(
    name: &str,
    mesh: &TetMesh,
    regions: &[u32],
    component: Option<usize>,
) -> Result<(TetMesh, MeshRepairs)> {
    let parts = connected_components(mesh);
    if let Some(number) = component {
        ensure!(
            number < parts.count,
            "{name}: there is no component {number}; it has {}, counting from 0",
            parts.count
        );
    }
    let is_kept = |tet: usize| {
        let part = parts.labels[mesh.tets()[tet][0] as usize] as usize;
        (regions.is_empty() || regions.contains(&mesh.regions()[tet]))
            && component.is_none_or(|number| number == part)
    };
    let kept: Vec<usize> = (0..mesh.tets().len()).filter(|&tet| is_kept(tet)).collect();
    ensure!(!kept.is_empty(), "{name}: nothing is left; take other labels or another component");
    let tets = kept.iter().map(|&tet| mesh.tets()[tet]).collect();
    let regions = kept.iter().map(|&tet| mesh.regions()[tet]).collect();
    Ok(TetMesh::new(mesh.vertices().to_vec(), tets, regions)?)
}
