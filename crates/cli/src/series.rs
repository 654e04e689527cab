//! The time series of a run: one VTU file per written frame and a PVD file that lists them.

use crate::output::OutputFolder;
use anyhow::Result;
use viscera::measure::measure_displacements;
use viscera::mesh::SurfaceMesh;
use viscera::mesh::io::vtu::{self, Array};
use viscera::mesh::io::{obj, pvd};
use viscera::scalar::{Real, Vec3};
use viscera::simulation::Simulation;

const FOLDER: &str = "frames";

/// The list is rewritten with every frame up to this many, and every so many frames beyond, so
/// that a long series does not spend its time on its table of contents.
const LIST_EVERY: usize = 100;

/// Frames written so far.
#[derive(Default)]
pub struct Series {
    tets: Vec<(f64, String)>,
    surfaces: Vec<(f64, String)>,
}

impl Series {
    /// An empty series.
    pub fn create(out: &OutputFolder) -> Result<Self> {
        clear(out)?;
        Ok(Self::default())
    }

    /// Writes the present frame.
    pub fn push<S: Real>(&mut self, out: &OutputFolder, simulation: &Simulation<S>) -> Result<()> {
        let (time, number) = (simulation.time(), simulation.frame());
        let output = &simulation.scene().output;
        if output.tets {
            let name = format!("{FOLDER}/tets_{number:06}.vtu");
            out.write(&name, &tets(simulation)?)?;
            self.tets.push((time, name));
        }
        if output.surface && simulation.assembly().bodies.iter().any(|b| b.has_fine_surface) {
            let name = format!("{FOLDER}/surface_{number:06}.vtu");
            out.write(&name, &surface(simulation)?)?;
            self.surfaces.push((time, name));
        }
        let count = self.tets.len().max(self.surfaces.len());
        if count <= LIST_EVERY || count.is_multiple_of(LIST_EVERY) {
            self.write_lists(out)?;
        }
        Ok(())
    }

    /// Writes the lists, and the last frame as meshes of their own.
    pub fn finish<S: Real>(&self, out: &OutputFolder, simulation: &Simulation<S>) -> Result<()> {
        self.write_lists(out)?;
        out.write("final.vtu", &tets(simulation)?)?;
        if simulation.scene().output.surface {
            let surface = deformed_surface(simulation);
            out.write("final_surface.obj", obj::write(&surface, None)?.as_bytes())?;
        }
        Ok(())
    }

    /// Writes the lists of all frames so far.
    pub fn write_lists(&self, out: &OutputFolder) -> Result<()> {
        for (name, frames) in [("tissue.pvd", &self.tets), ("surface.pvd", &self.surfaces)] {
            if !frames.is_empty() {
                let list: Vec<(f64, &str)> = frames.iter().map(|(t, f)| (*t, f.as_str())).collect();
                out.write(name, pvd::write(&list).as_bytes())?;
            }
        }
        Ok(())
    }
}

/// Removes an earlier run's results, so that no file of it is taken for one of this run. The lists
/// go first: they never name a frame that is gone.
fn clear(out: &OutputFolder) -> Result<()> {
    for name in [
        "tissue.pvd",
        "surface.pvd",
        "summary.json",
        "final.vtu",
        "final_surface.obj",
        "picture.png",
        "motion.gif",
    ] {
        out.remove(name)?;
    }
    out.clear(FOLDER, &["tets_", "surface_"], ".vtu")
}

/// All bodies' tetrahedra with what is known of them.
fn tets<S: Real>(simulation: &Simulation<S>) -> Result<Vec<u8>> {
    let (model, state) = (simulation.model(), simulation.state());
    let (mut tets, mut regions, mut bodies) = (Vec::new(), Vec::new(), Vec::new());
    for (index, body) in simulation.assembly().bodies.iter().enumerate() {
        let first = body.vertices.start as u32;
        tets.extend(body.mesh.tets().iter().map(|tet| tet.map(|v| v + first)));
        regions.extend_from_slice(body.mesh.regions());
        bodies.resize(tets.len(), index as u32);
    }
    let mut displacements = Vec::new();
    measure_displacements(model, &state.positions, &mut displacements);
    let measures = simulation.tets();
    let scalars = |name: &str, value: fn(&viscera::measure::TetMeasure) -> f64| {
        Array::scalars(name, &measures.iter().map(value).collect::<Vec<f64>>())
    };
    let stretches: Vec<Vec3<f64>> =
        measures.iter().map(|tet| Vec3::from_f64(tet.stretches)).collect();
    let point_data = [
        Array::vectors("displacement [m]", &displacements),
        Array::vectors("velocity [m/s]", &state.velocities),
    ];
    let cell_data = [
        scalars("J", |tet| tet.volume_ratio),
        Array::vectors("principal stretches", &stretches),
        scalars("von Mises Cauchy stress [Pa]", |tet| tet.von_mises),
        scalars("energy density [J/m^3]", |tet| tet.energy_density),
        Array::integers("region", &regions),
        Array::integers("body", &bodies),
    ];
    Ok(vtu::write(&state.positions, &tets, &point_data, &cell_data)?)
}

/// All bodies' surfaces as they are now.
pub fn deformed_surface<S: Real>(simulation: &Simulation<S>) -> SurfaceMesh {
    let mut all = SurfaceMesh::default();
    for body in &simulation.assembly().bodies {
        let first = all.vertices.len();
        let positions = &simulation.state().positions[body.vertices.clone()];
        let mut moved = vec![Vec3::ZERO; body.surface.vertices.len()];
        // The embedding was made for these very arrays.
        if body.embedding.apply(positions, &mut moved).is_ok() {
            all.vertices.extend(moved.iter().map(|x| x.cast::<f64>()));
            let triangles = body.surface.triangles.iter();
            all.triangles.extend(triangles.map(|t| t.map(|v| v + first as u32)));
        }
    }
    all
}

/// All bodies' surfaces at rest.
pub fn rest_surface<S: Real>(simulation: &Simulation<S>) -> SurfaceMesh {
    let mut all = SurfaceMesh::default();
    for body in &simulation.assembly().bodies {
        let first = all.vertices.len() as u32;
        all.vertices.extend_from_slice(&body.surface.vertices);
        all.triangles.extend(body.surface.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

fn surface<S: Real>(simulation: &Simulation<S>) -> Result<Vec<u8>> {
    let moved = deformed_surface(simulation);
    let rest = rest_surface(simulation);
    let pairs = moved.vertices.iter().zip(&rest.vertices);
    let displacements: Vec<Vec3<f64>> = pairs.map(|(x, rest)| *x - *rest).collect();
    let point_data = [Array::vectors("displacement [m]", &displacements)];
    Ok(vtu::write_surface(&moved.vertices, &moved.triangles, &point_data, &[])?)
}
