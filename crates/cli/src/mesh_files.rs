//! Files of meshes on the command line.

use anyhow::{Context, Result, ensure};
use std::path::Path;
use viscera::mesh::io::{MeshNames, gmsh, obj, ply, stl, vtk, vtu};
use viscera::mesh::{SurfaceMesh, TetMesh};
use viscera::units::Dimension;
use viscera_resources::files;

/// A length above zero [m].
pub fn length(unit: &str) -> Result<f64> {
    let unit = Dimension::Length.parse(unit).map_err(|error| anyhow::anyhow!("--unit: {error}"))?;
    ensure!(unit > 0.0, "--unit: a length above zero is needed, for example \"1 mm\"");
    Ok(unit)
}

/// The bytes of a file.
pub fn load(name: &str) -> Result<Vec<u8>, String> {
    files::read(Path::new(name)).map_err(|error| error.to_string())
}

/// Refuses to write over the file that is read.
pub fn check_other(file: &Path, out: &Path) -> Result<()> {
    // What is not there yet is another.
    if let (Ok(from), Ok(to)) = (file.canonicalize(), out.canonicalize()) {
        ensure!(
            from != to,
            "{} is the file that is read; give the file to write another name",
            out.display()
        );
    }
    Ok(())
}

/// In lower case, without its dot.
pub fn ending_of(path: &Path) -> Result<String> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    ending.with_context(|| format!("{}: the ending says which format to write", path.display()))
}

/// In the format of an ending.
pub fn write_tets(mesh: &TetMesh, names: &MeshNames, ending: &str) -> Result<Vec<u8>> {
    Ok(match ending {
        "msh" => gmsh::write_binary(mesh, names)?,
        "vtk" => vtk::write(mesh, names)?,
        _ => vtu::write_mesh(mesh, names)?,
    })
}

/// In the format of an ending.
pub fn write_surface(surface: &SurfaceMesh, ending: &str) -> Result<Vec<u8>> {
    Ok(match ending {
        "stl" => stl::write(surface),
        "ply" => ply::write(surface),
        _ => obj::write(surface, None)?.into_bytes(),
    })
}
