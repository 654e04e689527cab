//! A simulation as meshes that other programs open: all bodies' tetrahedra with what is known of them, and their surfaces.

use super::assemble::{AssembledBody, Assembly};
use crate::measure::measure_tets_by_pieces;
use crate::mesh::SurfaceMesh;
use crate::mesh::io::WriteError;
use crate::mesh::io::vtu::{Array, Grid};
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use std::borrow::Cow;

impl Assembly {
    /// All bodies' surfaces at rest [m].
    pub fn rest_surface(&self) -> SurfaceMesh {
        rest_surface(&self.bodies)
    }

    /// Vertices [m] of all bodies' surfaces, where those of the tetrahedra are at these positions [m], shape
    /// [vertex_count].
    pub fn deformed_surface<S: Real>(&self, positions: &[Vec3<S>]) -> Vec<Vec3<f64>> {
        deformed_surface(&self.bodies, positions)
    }
}

fn rest_surface(bodies: &[AssembledBody]) -> SurfaceMesh {
    let mut all = SurfaceMesh::default();
    for body in bodies {
        let first = all.vertices.len() as u32;
        all.vertices.extend_from_slice(&body.surface.vertices);
        all.triangles.extend(body.surface.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

fn deformed_surface<S: Real>(bodies: &[AssembledBody], positions: &[Vec3<S>]) -> Vec<Vec3<f64>> {
    bodies.iter().flat_map(|body| body.deformed_surface(positions)).collect()
}

impl AssembledBody {
    /// Vertices [m] of its surface, where those of all bodies' tetrahedra are at these positions [m], shape [vertex_count].
    pub fn deformed_surface<S: Real>(&self, positions: &[Vec3<S>]) -> Vec<Vec3<f64>> {
        let mut moved = vec![Vec3::ZERO; self.surface.vertices.len()];
        let bound = self.embedding.apply(&positions[self.vertices.clone()], &mut moved);
        // The embedding was made for these very arrays.
        debug_assert!(bound.is_ok(), "{bound:?}");
        moved.iter().map(|x| x.cast::<f64>()).collect()
    }
}

/// All bodies' tetrahedra as VTU files; what is the same in all of them is packed once.
#[derive(Debug)]
pub struct TissueFiles<S> {
    grid: Grid,
    rest_positions: Vec<Vec3<S>>,
}

impl<S: Real> TissueFiles<S> {
    /// Of a scene and its model.
    pub fn new(assembly: &Assembly, model: &Model<S>) -> Result<Self, WriteError> {
        let (mut tets, mut regions, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
        for (number, body) in (0..).zip(&assembly.bodies) {
            let first = body.vertices.start as u32;
            tets.extend(body.mesh.tets().iter().map(|tet| tet.map(|v| v + first)));
            regions.extend_from_slice(body.mesh.regions());
            numbers.resize(tets.len(), number);
        }
        let stays = vec![Array::integers("region", &regions), Array::integers("body", &numbers)];
        let grid = Grid::of_tets(model.vertex_count(), &tets, stays)?;
        Ok(Self { grid, rest_positions: model.rest_positions.clone() })
    }

    /// The parts of a file of one moment: displacement, velocity, J, principal stretches, von Mises stress, energy density,
    /// region and body. Positions [m] and velocities [m/s] have shape [vertex_count].
    pub fn file(
        &self,
        model: &Model<S>,
        positions: &[Vec3<S>],
        velocities: &[Vec3<S>],
    ) -> Result<Vec<Cow<'_, [u8]>>, WriteError> {
        let count = model.tet_count();
        let scalars = |name| Array::with_room::<1>(name, count);
        let mut ratios = scalars("J");
        let mut stretches = Array::with_room::<3>("principal stretches", count);
        let mut stresses = scalars("von Mises Cauchy stress [Pa]");
        let mut energies = scalars("energy density [J/m^3]");
        measure_tets_by_pieces(model, positions, |tets| {
            for tet in tets {
                ratios.push([tet.volume_ratio as f32]);
                stretches.push(tet.stretches.map(|stretch| stretch as f32));
                stresses.push([tet.von_mises as f32]);
                energies.push([tet.energy_density as f32]);
            }
        });
        let cell_data = vec![ratios, stretches, stresses, energies];
        let displacements = displacements(positions, &self.rest_positions);
        let point_data = vec![
            Array::vectors("displacement [m]", &displacements),
            Array::vectors("velocity [m/s]", velocities),
        ];
        self.grid.frame(positions, point_data, cell_data)
    }
}

/// All bodies' surfaces as VTU files.
#[derive(Debug)]
pub struct SurfaceFiles {
    bodies: Vec<AssembledBody>,
    rest: SurfaceMesh,
    grid: Grid,
}

impl SurfaceFiles {
    /// Of a scene.
    pub fn new(assembly: &Assembly) -> Result<Self, WriteError> {
        let rest = assembly.rest_surface();
        let grid = Grid::of_triangles(rest.vertices.len(), &rest.triangles, Vec::new())?;
        Ok(Self { bodies: assembly.bodies.clone(), rest, grid })
    }

    /// The parts of a file of one moment: displacement. Positions [m] are those of the tetrahedra, shape [vertex_count].
    pub fn file<S: Real>(&self, positions: &[Vec3<S>]) -> Result<Vec<Cow<'_, [u8]>>, WriteError> {
        let moved = deformed_surface(&self.bodies, positions);
        let displacements = displacements(&moved, &self.rest.vertices);
        let point_data = vec![Array::vectors("displacement [m]", &displacements)];
        self.grid.frame(&moved, point_data, vec![])
    }
}

fn displacements<S: Real>(positions: &[Vec3<S>], rest: &[Vec3<S>]) -> Vec<Vec3<f64>> {
    let pairs = positions.iter().zip(rest);
    pairs.map(|(x, rest)| x.cast::<f64>() - rest.cast()).collect()
}
