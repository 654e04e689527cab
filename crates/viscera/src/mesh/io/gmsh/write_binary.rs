//! Writing version 4.1 as bytes: "MSH file format" in the Gmsh reference manual.
//!
//! ```text
//! entities   a volume for each region, a surface or a point for each patch, each with its physical group
//! nodes      one block, numbered from 1 as in the mesh
//! elements   a block for each patch; then tetrahedra in the order of the mesh, a block wherever the region changes
//! ```

use std::collections::BTreeMap;

use crate::mesh::TetMesh;
use crate::mesh::io::error::{WriteError, check_patch};
use crate::mesh::io::parsed::{MeshNames, Patch};
use crate::mesh::io::text::name_of;
use crate::mesh::topology::{BoundingBox, boundary_faces};

/// Element types of Gmsh.
const TRIANGLE: i32 = 2;
const TET: i32 = 4;
const POINT: i32 = 15;

/// A patch as elements of Gmsh, which knows groups of elements only.
enum Group<'a> {
    Triangles(Vec<[u32; 3]>),
    Points(&'a [u32]),
}

/// Numbers of a file, little-endian.
struct File(Vec<u8>);

impl File {
    fn text(&mut self, text: &str) {
        self.0.extend_from_slice(text.as_bytes());
    }

    fn ints<const N: usize>(&mut self, numbers: [i32; N]) {
        numbers.iter().for_each(|number| self.0.extend_from_slice(&number.to_le_bytes()));
    }

    fn sizes<const N: usize>(&mut self, numbers: [u64; N]) {
        numbers.iter().for_each(|number| self.0.extend_from_slice(&number.to_le_bytes()));
    }

    fn floats(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|number| self.0.extend_from_slice(&number.to_le_bytes()));
    }

    /// The header of a block of entities.
    fn block(&mut self, dimension: i32, tag: i32, kind: i32, count: usize) {
        self.ints([dimension, tag, kind]);
        self.sizes([count as u64]);
    }

    /// Elements of a block, by number and vertices, which count from 1.
    fn elements<const N: usize>(
        &mut self,
        next: &mut u64,
        elements: impl Iterator<Item = [u32; N]>,
    ) {
        for vertices in elements {
            self.sizes([*next]);
            self.sizes(vertices.map(|vertex| u64::from(vertex) + 1));
            *next += 1;
        }
    }
}

/// A mesh as Gmsh 4.1 in bytes, in metres: regions as physical volumes, patches as physical surfaces where the
/// boundary's triangles between their vertices make up all of them, and as physical points elsewhere.
///
/// Names are those of regions by number; quotation marks in names become `'`.
pub fn write_binary(mesh: &TetMesh, names: &MeshNames) -> Result<Vec<u8>, WriteError> {
    let MeshNames { patches, regions: region_names } = names;
    let mut file =
        File(Vec::with_capacity(1000 + 32 * mesh.vertices().len() + 41 * mesh.tets().len()));
    file.text("$MeshFormat\n4.1 1 8\n");
    file.ints([1]);
    file.text("\n$EndMeshFormat\n");
    let regions = regions_of(mesh)?;
    let groups = groups_of(mesh, patches)?;
    write_names(&mut file, patches, &groups, (&regions, region_names));
    write_entities(&mut file, mesh, &groups, &regions);

    let count = mesh.vertices().len() as u64;
    file.text("$Nodes\n");
    file.sizes([1, count, 1, count]);
    file.block(3, 1, 0, mesh.vertices().len());
    (1..=count).for_each(|number| file.sizes([number]));
    mesh.vertices().iter().for_each(|x| file.floats(&x.to_array()));
    file.text("\n$EndNodes\n");
    write_elements(&mut file, mesh, &groups, &regions);
    Ok(file.0)
}

/// The volume of each region, counting from 1.
fn regions_of(mesh: &TetMesh) -> Result<BTreeMap<u32, i32>, WriteError> {
    let mut regions = BTreeMap::new();
    for &region in mesh.regions() {
        regions.entry(region).or_insert(0);
    }
    for (tag, (&region, volume)) in (1..).zip(&mut regions) {
        if i32::try_from(region).is_err() {
            let (value, limit, format) = (u64::from(region), i32::MAX as u64, "Gmsh files");
            return Err(WriteError::TooLarge { what: "region", value, limit, format });
        }
        *volume = tag;
    }
    Ok(regions)
}

fn groups_of<'a>(mesh: &TetMesh, patches: &'a [Patch]) -> Result<Vec<Group<'a>>, WriteError> {
    let faces = if patches.is_empty() { Vec::new() } else { boundary_faces(mesh.tets()) };
    let mut groups = Vec::new();
    for patch in patches {
        check_patch(patch, mesh.vertices().len())?;
        let mut is_member = vec![false; mesh.vertices().len()];
        patch.vertices.iter().for_each(|&vertex| is_member[vertex as usize] = true);
        let inside = |face: &[u32; 3]| face.iter().all(|&vertex| is_member[vertex as usize]);
        let triangles: Vec<[u32; 3]> = faces.iter().map(|(_, face)| *face).filter(inside).collect();
        let mut covered = is_member.clone();
        triangles.iter().flatten().for_each(|&vertex| covered[vertex as usize] = false);
        let is_surface = !triangles.is_empty() && !covered.contains(&true);
        groups.push(match is_surface {
            true => Group::Triangles(triangles),
            false => Group::Points(&patch.vertices),
        });
    }
    Ok(groups)
}

fn write_names(
    file: &mut File,
    patches: &[Patch],
    groups: &[Group],
    (regions, names): (&BTreeMap<u32, i32>, &[(u32, String)]),
) {
    let quoted = |name: &str| name_of(name).replace('"', "'");
    let mut lines = Vec::new();
    for (tag, (patch, group)) in (1..).zip(patches.iter().zip(groups)) {
        let dimension = if matches!(group, Group::Triangles(_)) { 2 } else { 0 };
        lines.push(format!("{dimension} {tag} \"{}\"\n", quoted(&patch.name)));
    }
    for (region, name) in names {
        if regions.contains_key(region) {
            lines.push(format!("3 {region} \"{}\"\n", quoted(name)));
        }
    }
    if !lines.is_empty() {
        file.text(&format!(
            "$PhysicalNames\n{}\n{}$EndPhysicalNames\n",
            lines.len(),
            lines.concat()
        ));
    }
}

fn write_entities(file: &mut File, mesh: &TetMesh, groups: &[Group], regions: &BTreeMap<u32, i32>) {
    let BoundingBox { min: low, max: high } = BoundingBox::around(mesh.vertices());
    let corners = [low.to_array(), high.to_array()];
    let surfaces = groups.iter().filter(|group| matches!(group, Group::Triangles(_))).count();
    file.text("$Entities\n");
    file.sizes([groups.len() - surfaces, 0, surfaces, regions.len()].map(|count| count as u64));
    for (tag, group) in (1..).zip(groups) {
        if let Group::Points(vertices) = group {
            let first = vertices.first().map(|&vertex| mesh.vertices()[vertex as usize]);
            file.ints([tag]);
            file.floats(&first.unwrap_or(low).to_array());
            file.sizes([1]);
            file.ints([tag]);
        }
    }
    for (tag, group) in (1..).zip(groups) {
        if let Group::Triangles(_) = group {
            file.ints([tag]);
            file.floats(corners.as_flattened());
            file.sizes([1]);
            file.ints([tag]);
            // Curves around it, which are not known.
            file.sizes([0]);
        }
    }
    for (&region, &volume) in regions {
        file.ints([volume]);
        file.floats(corners.as_flattened());
        // Region 0 too: programs leave out what is in no group, or refuse files in which some volumes are and others are not.
        file.sizes([1]);
        file.ints([region as i32]);
        file.sizes([0]);
    }
    file.text("\n$EndEntities\n");
}

fn write_elements(file: &mut File, mesh: &TetMesh, groups: &[Group], regions: &BTreeMap<u32, i32>) {
    let of_groups: usize = groups
        .iter()
        .map(|group| match group {
            Group::Triangles(triangles) => triangles.len(),
            Group::Points(vertices) => vertices.len(),
        })
        .sum();
    let runs: Vec<&[u32]> = mesh.regions().chunk_by(|a, b| a == b).collect();
    let (blocks, count) = (groups.len() + runs.len(), of_groups + mesh.tets().len());
    file.text("$Elements\n");
    file.sizes([blocks as u64, count as u64, 1, count as u64]);
    let mut next = 1;
    for (tag, group) in (1..).zip(groups) {
        match group {
            Group::Triangles(triangles) => {
                file.block(2, tag, TRIANGLE, triangles.len());
                file.elements(&mut next, triangles.iter().copied());
            }
            Group::Points(vertices) => {
                file.block(0, tag, POINT, vertices.len());
                file.elements(&mut next, vertices.iter().map(|&vertex| [vertex]));
            }
        }
    }
    let mut tets = mesh.tets().iter();
    for run in runs {
        file.block(3, regions[&run[0]], TET, run.len());
        file.elements(&mut next, tets.by_ref().take(run.len()).copied());
    }
    file.text("\n$EndElements\n");
}
