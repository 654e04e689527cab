//! Parts of tools that are closed surfaces: read or made, and their distances computed.

use std::sync::Arc;

use super::assemble_error::AssembleError;
use crate::contact::{DistanceGrid, Shape};
use crate::mesh::SurfaceMesh;
use crate::mesh::io::MeshFile;
use crate::scene::{Instrument, Part, Solid, SolidSource};
use crate::units::Dimension;

/// Grids of distances that have been made: tools of one surface share one.
#[derive(Default)]
pub(super) struct Solids(Vec<(SolidSource, f64, Arc<DistanceGrid>)>);

impl Solids {
    /// Makes parts of a tool's solids.
    pub fn make(
        &mut self,
        tool: &mut Instrument,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Result<(), AssembleError> {
        for solid in std::mem::take(&mut tool.solids) {
            let grid = self.grid(tool, &solid, load)?;
            if solid.opens != 0.0 && matches!(solid.source, SolidSource::File { .. }) {
                measure_jaws(tool, grid.surface())?;
            }
            let Solid { place, opens, .. } = solid;
            tool.parts.push(Part { shape: Shape::Mesh(grid), place, opens });
        }
        Ok(())
    }

    fn grid(
        &mut self,
        tool: &Instrument,
        solid: &Solid,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Arc<DistanceGrid>, AssembleError> {
        let thickness = tool.law.thickness;
        let known =
            self.0.iter().find(|(source, of, _)| *source == solid.source && *of == thickness);
        if let Some((_, _, grid)) = known {
            return Ok(grid.clone());
        }
        let (file, surface) = match &solid.source {
            SolidSource::File { mesh, unit } => {
                let file = MeshFile::load(mesh, |file| load(file))
                    .map_err(|message| AssembleError::Load { message })?;
                (Some(mesh.clone()), file.surface(*unit)?.0)
            }
            made => (None, made.surface().unwrap_or_default()),
        };
        let grid =
            DistanceGrid::new(&surface, thickness).map_err(|error| AssembleError::Solid {
                place: tool.place.clone(),
                tool: tool.name.clone(),
                file: file.map_or(String::new(), |file| format!("{file}: ")),
                error: Box::new(error),
            })?;
        let grid = Arc::new(grid);
        self.0.push((solid.source.clone(), thickness, grid.clone()));
        Ok(grid)
    }
}

/// How long jaws from a file are, and whether they overlap at one of their angles.
fn measure_jaws(tool: &mut Instrument, surface: &SurfaceMesh) -> Result<(), AssembleError> {
    let fail = |problem: String| AssembleError::Jaws {
        place: tool.place.clone(),
        tool: tool.name.clone(),
        problem,
    };
    let Some(jaws) = &tool.jaws else { return Ok(()) };
    let lowest = surface.vertices.iter().map(|x| x.z).fold(f64::INFINITY, f64::min);
    let inner = surface.vertices.iter().map(|x| x.y).fold(f64::INFINITY, f64::min);
    if lowest >= 0.0 {
        return Err(fail(
            "its jaw does not reach below the hinge; turn the mesh so that it goes along -z".into(),
        ));
    }
    let length = -lowest;
    // A thousandth of its length is a slip of rounding.
    if inner < -1e-3 * length {
        return Err(fail(format!(
            "its jaw reaches {:.3} mm beyond the plane between both; move the mesh along y by that",
            -1e3 * inner
        )));
    }
    let mut measured = jaws.clone();
    measured.length = length;
    let least = measured.least_angle();
    if let Some(key) =
        measured.keys.iter().find(|key| !measured.follow_force() && key.value < least)
    {
        return Err(fail(format!(
            "at {} its jaws overlap; close them to {} at most, or give them a larger `jaw_gap`",
            Dimension::Angle.format(key.value),
            Dimension::Angle.format(least + 0.0)
        )));
    }
    tool.jaws = Some(measured);
    Ok(())
}
