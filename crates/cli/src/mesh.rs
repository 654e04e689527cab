//! `viscera mesh`.

use anyhow::{Context, Result};
use clap::Subcommand;
use serde::Serialize;
use std::fmt::Display;
use std::path::PathBuf;
use viscera::mesh::{inspect, inspect_surface, io};
use viscera::units::Dimension;
use viscera_resources::files;

/// Look at mesh files
#[derive(Subcommand)]
pub enum MeshCommand {
    /// Counts, size, volume, shape quality and what would be repaired
    ///
    /// Reads tetrahedra from Gmsh 1 and 2.2 (ASCII) and VTU (ASCII), surfaces from OBJ.
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
    let bytes = files::read(file)?;
    let name = file.display().to_string();
    let is_surface = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
    if is_surface {
        let (surface, report) = io::read_surface(&name, &bytes, unit)?;
        print(&name, &inspect_surface(&surface, &report), *json)
    } else {
        let (mesh, report) = io::read_tet_mesh(&name, &bytes, unit)?;
        print(&name, &inspect(&mesh, &report), *json)
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
