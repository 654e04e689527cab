//! What a file holds, before it becomes tissue or a surface.

use std::collections::BTreeMap;

use super::cells::{Cells, Curved};
use super::error::{Fault, Place, ReadProblem};
use super::parsed::{CountedElements, Format, MendedFile, MeshNames, Patch, ReadReport};
use super::text::name_of;
use crate::mesh::mend::{mend, mend_surface};
use crate::mesh::{
    MeshError, MeshPlace, MeshRepairs, SurfaceMesh, TetMesh, boundary_surface, check_vertex,
};
use crate::scalar::Vec3;

/// Where a vertex, or a cell in the file's order, stands in the file.
type Places<'a> = Box<dyn Fn(MeshPlace) -> Option<Place> + 'a>;

/// Vertices, cells and names of a file.
pub(super) struct Content<'a> {
    pub format: Format,
    /// Positions in the unit of the file.
    pub vertices: Vec<Vec3<f64>>,
    pub cells: Cells,
    /// By vertices as the file lists them.
    pub patches: Vec<Patch>,
    pub region_names: Vec<(u32, String)>,
    pub places: Places<'a>,
}

impl<'a> Content<'a> {
    /// Without names.
    pub fn of_cells(
        format: Format,
        vertices: Vec<Vec3<f64>>,
        cells: Cells,
        places: Places<'a>,
    ) -> Self {
        let (patches, region_names) = Default::default();
        Self { format, vertices, cells, patches, region_names, places }
    }

    /// The tetrahedra; positions are multiplied by the unit.
    pub fn into_tets(self, unit_in_meters: f64) -> Result<(TetMesh, ReadReport), Fault> {
        let Self { format, mut vertices, cells, patches, region_names, places } = self;
        scale(&mut vertices, unit_in_meters);
        if cells.tets.is_empty() {
            return Err(no_tets(format, &cells));
        }
        let unused_arrays = cells.unused.iter().map(|name| name_of(name)).collect();
        let Cells { tets, regions, of_tets, triangles, mut skipped, split, curved, nodes, .. } =
            cells;
        let bulge = largest_bulge(&vertices, &curved, &nodes);
        if !triangles.is_empty() {
            let entry = CountedElements { kind: "triangle".into(), count: triangles.len() };
            skipped.insert(0, entry);
        }
        let vertex_count = vertices.len();
        let (mesh, repairs) = TetMesh::new(vertices, tets, regions).map_err(|error| {
            let place = match error.place() {
                MeshPlace::Whole => None,
                MeshPlace::Vertex(vertex) => places(MeshPlace::Vertex(vertex)),
                MeshPlace::Tet(tet) => {
                    of_tets.get(tet).and_then(|&cell| places(MeshPlace::Tet(cell as usize)))
                }
            };
            Fault { place, problem: ReadProblem::Mesh(error) }
        })?;
        let patches = patches_of_mesh(patches, &repairs, vertex_count)?;
        let named = region_names.into_iter().map(|(region, name)| (region, name_of(&name)));
        let region_names = named.collect();
        let format = Some(format);
        let curved = curved.len();
        let report = ReadReport {
            format,
            repairs,
            skipped,
            split,
            curved,
            bulge,
            patches,
            region_names,
            unused_arrays,
        };
        Ok((mesh, report))
    }

    /// What it holds, mended, see [`mend`](crate::mesh::mend); positions are multiplied by the unit.
    pub fn into_mended(
        mut self,
        unit_in_meters: f64,
        weld: Option<f64>,
    ) -> Result<MendedFile, Fault> {
        scale(&mut self.vertices, unit_in_meters);
        let Self { format, vertices, cells, patches, region_names, .. } = self;
        let wrong = |error: MeshError| Fault { place: None, problem: ReadProblem::Mesh(error) };
        if !cells.tets.is_empty() {
            let mended = mend(&vertices, &cells.tets, &cells.regions, weld).map_err(wrong)?;
            let patches = patches_of_mesh(patches, &MeshRepairs::default(), vertices.len())?;
            let named = region_names.into_iter().map(|(region, name)| (region, name_of(&name)));
            let mut names = MeshNames { patches, regions: named.collect() };
            names.follow(&mended);
            return Ok(MendedFile::Tets(mended, names));
        }
        if cells.triangles.is_empty() {
            return Err(no_tets(format, &cells));
        }
        let surface = SurfaceMesh { vertices, triangles: cells.triangles };
        let (surface, mending) = mend_surface(&surface, weld).map_err(wrong)?;
        Ok(MendedFile::Surface(surface, mending))
    }

    /// The surface; positions are multiplied by the unit. That of the tetrahedra where the file has no triangles.
    pub fn into_surface(mut self, unit_in_meters: f64) -> Result<(SurfaceMesh, ReadReport), Fault> {
        if self.cells.triangles.is_empty() && !self.cells.tets.is_empty() {
            let (mesh, report) = self.into_tets(unit_in_meters)?;
            return Ok((boundary_surface(&mesh).surface, report));
        }
        scale(&mut self.vertices, unit_in_meters);
        let Self { format, vertices, cells, places, .. } = self;
        let Cells { tets, mut skipped, triangles, of_triangles, curved, nodes, .. } = cells;
        if triangles.is_empty() {
            let what = format!("triangles (it has {})", CountedElements::list(&skipped));
            return Err(Fault::whole_file(ReadProblem::Missing { what }));
        }
        for (vertex, &position) in vertices.iter().enumerate() {
            check_vertex(vertex, position).map_err(|error: MeshError| Fault {
                place: places(MeshPlace::Vertex(vertex)),
                problem: ReadProblem::Mesh(error),
            })?;
        }
        for (triangle, &cell) in triangles.iter().zip(&of_triangles) {
            if let Some(vertex) = triangle.iter().find(|&&v| v as usize >= vertices.len()) {
                let problem = ReadProblem::UnknownVertex {
                    element: format!("face {cell}"),
                    vertex: vertex.to_string(),
                    vertex_count: vertices.len(),
                    numbers: None,
                };
                return Err(Fault { place: places(MeshPlace::Tet(cell as usize)), problem });
            }
        }
        if !tets.is_empty() {
            skipped.push(CountedElements { kind: "tetrahedron".into(), count: tets.len() });
        }
        let bulge = largest_bulge(&vertices, &curved, &nodes);
        let (mesh, removed_vertices) = SurfaceMesh { vertices, triangles }.without_unused();
        let repairs = MeshRepairs { removed_vertices, ..MeshRepairs::default() };
        let (format, curved) = (Some(format), curved.len());
        Ok((mesh, ReadReport { format, repairs, skipped, curved, bulge, ..ReadReport::default() }))
    }
}

/// Patches by vertices of the mesh, those of the same name as one.
fn patches_of_mesh(
    patches: Vec<Patch>,
    repairs: &MeshRepairs,
    vertex_count: usize,
) -> Result<Vec<Patch>, Fault> {
    let mut merged: Vec<Patch> = Vec::new();
    let mut index: BTreeMap<String, usize> = BTreeMap::new();
    for Patch { name, mut vertices } in patches {
        let name = name_of(&name);
        if let Some(vertex) = vertices.iter().find(|vertex| **vertex as usize >= vertex_count) {
            return Err(Fault::whole_file(ReadProblem::UnknownVertex {
                element: format!("`{name}`"),
                // Only numbers that count from 1 get here: other readers look for numbers, or compare counts.
                vertex: (u64::from(*vertex) + 1).to_string(),
                vertex_count,
                numbers: None,
            }));
        }
        match index.get(&name) {
            Some(&at) => merged[at].vertices.append(&mut vertices),
            None => {
                index.insert(name.clone(), merged.len());
                merged.push(Patch { name, vertices });
            }
        }
    }
    for patch in &mut merged {
        patch.vertices = patch.vertices.iter().filter_map(|&v| repairs.vertex_after(v)).collect();
        patch.vertices.sort_unstable();
        patch.vertices.dedup();
    }
    merged.retain(|patch| !patch.vertices.is_empty());
    Ok(merged)
}

fn scale(vertices: &mut [Vec3<f64>], unit_in_meters: f64) {
    vertices.iter_mut().for_each(|x| *x = *x * unit_in_meters);
}

fn no_tets(format: Format, cells: &Cells) -> Fault {
    Fault::whole_file(if cells.triangles.is_empty() {
        ReadProblem::NoTets { others: CountedElements::list(&cells.skipped) }
    } else {
        ReadProblem::OnlySurface { format, triangles: cells.triangles.len() }
    })
}

/// How far a node between corners is from the nearest line between two of them [m], at most: an edge, or a diagonal, on which
/// the middles of faces and of cells lie. Zero where edges are straight, whatever order the format has the nodes in.
fn largest_bulge(vertices: &[Vec3<f64>], curved: &[Curved], nodes: &[u32]) -> f64 {
    if !cfg!(feature = "formats") {
        return 0.0;
    }
    let mut largest = 0.0f64;
    let mut places: Vec<Vec3<f64>> = Vec::new();
    for &Curved { first, count, corners } in curved {
        let all = &nodes[first..first + count];
        let at = |node: &u32| vertices.get(*node as usize).copied();
        let (corners, middles) = all.split_at(corners);
        places.clear();
        places.extend(corners.iter().filter_map(at));
        for x in middles.iter().filter_map(at) {
            let mut nearest = f64::INFINITY;
            for (i, &a) in places.iter().enumerate() {
                for &b in &places[..i] {
                    let along = b - a;
                    let share = (x - a).dot(along) / along.length_squared();
                    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
                    nearest = nearest.min((a + along * share - x).length_squared());
                }
            }
            if nearest.is_finite() {
                largest = largest.max(nearest);
            }
        }
    }
    largest.sqrt()
}
