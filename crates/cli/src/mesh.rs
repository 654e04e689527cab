//! `viscera mesh`.

use anyhow::{Context, Result};
use clap::Subcommand;
use serde::Serialize;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use viscera::mesh::io::{Mesh, MeshFile};
use viscera::mesh::{inspect, inspect_surface};
use viscera::units::Dimension;
use viscera_resources::files;

/// Look at mesh files
#[derive(Subcommand)]
pub enum MeshCommand {
    /// Counts, size, volume, shape quality and what would be repaired
    ///
    /// Reads Gmsh (.msh, all versions), VTK (.vtk, .vtu, .vtp), TetGen (.ele with .node), Medit (.mesh), Abaqus (.inp), and
    /// surfaces from OBJ, STL and PLY.
    Inspect {
        /// The mesh file
        file: PathBuf,
        /// The length that 1 in the file stands for; files rarely say
        #[arg(long, default_value = "1 m")]
        unit: String,
        /// Print JSON, in SI units, instead of a table
        #[arg(long)]
        json: bool,
    },
}

/// Carries out a `viscera mesh` command.
pub fn execute(command: &MeshCommand) -> Result<()> {
    let MeshCommand::Inspect { file, unit, json } = command;
    let unit = Dimension::Length
        .parse(unit)
        .map_err(|error| anyhow::anyhow!("--unit: {error}"))
        .and_then(|unit| {
            anyhow::ensure!(
                unit > 0.0,
                "--unit: a length above zero is needed, for example \"1 mm\""
            );
            Ok(unit)
        })?;
    let name = file.display().to_string();
    let mesh = MeshFile::load(&name, |name| files::read(Path::new(name)))?;
    match mesh.mesh(unit)? {
        (Mesh::Surface(surface), report) => {
            print(&name, &inspect_surface(&surface, &report), *json)
        }
        (Mesh::Tets(mesh), report) => print(&name, &inspect(&mesh, &report), *json),
    }
}

fn print<T: Serialize + Display>(name: &str, summary: &T, json: bool) -> Result<()> {
    if json {
        let text = serde_json::to_string_pretty(summary).context("cannot write JSON")?;
        files::print(&format!("{text}\n"))
    } else {
        files::print(&format!("{name}\n{summary}"))
    }
}
