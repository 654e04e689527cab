//! From a scene and its files to meshes in the world, vertex patches and a model builder.

use std::sync::Arc;

use super::assemble_error::{AssembleError, MOST_REFINED};
use super::balance::Balance;
use crate::mesh::embed::Embedding;
use crate::mesh::io::{MeshFile, MeshNames, ReadReport};
use crate::mesh::refine::{self, Middles};
use crate::mesh::shapes;
use crate::mesh::topology::{boundary_surface, connected_components};
use crate::mesh::{SurfaceMesh, TetMesh};
use crate::model::{ModelBuilder, ModelError};
use crate::scalar::Vec3;
use crate::scene::{Body, BodyShape, Instrument, RegionLabel, Scene, nearest_pair};
use crate::settings::Elements;

/// A mesh before it was refined.
#[derive(Clone, Debug)]
pub struct Refinement {
    /// The mesh that patches are chosen on.
    pub coarse: TetMesh,
    /// What each refinement has added.
    pub middles: Vec<Middles>,
}

/// One body in the world.
#[derive(Clone, Debug)]
pub struct AssembledBody {
    /// The name.
    pub name: String,
    /// Its tetrahedra at rest, world coordinates.
    pub mesh: TetMesh,
    /// What its mesh file has names for, by the vertices of the mesh that patches are chosen on.
    pub names: MeshNames,
    /// What `mesh` was refined from, where the scene asks for that.
    pub refinement: Option<Refinement>,
    /// The surface to show, at rest.
    pub surface: SurfaceMesh,
    /// Binds the surface to the tetrahedra.
    pub embedding: Embedding,
    /// True where the surface is finer than the tetrahedra's boundary.
    pub has_fine_surface: bool,
    /// Its vertices among those of all bodies.
    pub vertices: std::ops::Range<usize>,
    /// Its tetrahedra among those of all bodies.
    pub tets: std::ops::Range<usize>,
}

/// The vertices that a fixing, motion or force concerns, numbered over all bodies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResolvedPatch {
    /// The vertices, ascending.
    pub vertices: Vec<u32>,
    /// Numbers of the attachments' anchors, for an elastic fixing.
    pub attachments: Vec<usize>,
}

/// A scene with its meshes.
#[derive(Clone, Debug, Default)]
pub struct Assembly {
    /// The bodies, in the scene's order.
    pub bodies: Vec<AssembledBody>,
    /// The model to build.
    pub builder: ModelBuilder,
    /// Patches of the scene's fixings.
    pub fixings: Vec<ResolvedPatch>,
    /// Patches of the scene's motions.
    pub motions: Vec<ResolvedPatch>,
    /// Patches of the scene's forces.
    pub forces: Vec<ResolvedPatch>,
    /// The scene's tools, paths from files as keys.
    pub tools: Vec<Instrument>,
    /// The elements that bodies which rest under gravity as they are have been balanced for.
    pub(super) balanced_for: Option<Elements>,
    /// How they carry gravity: what was found, or was given before anything was.
    pub(super) balance: Option<Arc<Balance>>,
    /// What was repaired, and what a person should know before waiting for the result.
    pub notes: Vec<String>,
}

impl Assembly {
    /// Reads or makes the meshes of a scene and finds its patches. `load` gets the name of a file
    /// as the scene has it and returns its bytes, or a message that says what went wrong.
    pub fn new(
        scene: &Scene,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Self, AssembleError> {
        Self::with_balance(scene, load, None)
    }

    /// The same with what [`Assembly::balance`] has of another assembly. Of bodies with other materials, meshes, holds or loads
    /// it is not used.
    pub fn with_balance(
        scene: &Scene,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
        balance: Option<Balance>,
    ) -> Result<Self, AssembleError> {
        let mut assembly = Self::without_balance(scene, load)?;
        assembly.balance = balance.map(Arc::new);
        assembly.apply_balance(scene, scene.solver.foreseen_elements(false))?;
        Ok(assembly)
    }

    pub(super) fn without_balance(
        scene: &Scene,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Self, AssembleError> {
        let mut assembly = Self::default();
        for body in &scene.bodies {
            assembly.add_body(body, load)?;
        }
        assembly.add_patches(scene)?;
        assembly.add_tools(scene, load)?;
        assembly.take_samples(scene)?;
        assembly.take_skin(scene)?;
        assembly.check_tools_outside(scene)?;
        assembly.note_overlaps(scene);
        assembly.note_loose_parts(scene);
        Ok(assembly)
    }

    /// What models are built from, with the materials of another scene of the same bodies.
    pub fn with_materials(&self, scene: &Scene) -> Result<ModelBuilder, ModelError> {
        let mut builder = self.builder.clone();
        for (index, (body, assembled)) in scene.bodies.iter().zip(&self.bodies).enumerate() {
            builder.set_material(index, &body.material)?;
            for region in &body.regions {
                for label in region.label.numbers(&assembled.names) {
                    builder.set_region_material(index, label, &region.material)?;
                }
            }
        }
        Ok(builder)
    }

    /// The scene that this was made from with every tetrahedron divided into eight. The vertices of each body keep their
    /// places in it, the middles of edges follow.
    pub fn refined(&self, scene: &Scene) -> Result<Self, AssembleError> {
        let mut finer = Self::default();
        for (assembled, body) in self.bodies.iter().zip(&scene.bodies) {
            let refined = refine::refine(&assembled.mesh);
            let (mesh, middles) = refined
                .map_err(|error| AssembleError::Placement { body: body.name.clone(), error })?;
            let mut refinement = match &assembled.refinement {
                Some(refinement) => refinement.clone(),
                None => Refinement { coarse: assembled.mesh.clone(), middles: Vec::new() },
            };
            refinement.middles.push(middles);
            let fine = assembled.has_fine_surface.then(|| assembled.surface.clone());
            let names = assembled.names.clone();
            finer.put(body, (mesh, names), Some(refinement), fine)?;
        }
        finer.add_patches(scene)?;
        finer.tools.clone_from(&self.tools);
        finer.take_samples(scene)?;
        finer.take_skin(scene)?;
        if let Some(elements) = self.balanced_for {
            finer.apply_balance(scene, elements)?;
        }
        finer.notes.clear();
        Ok(finer)
    }

    /// What acts on the bodies that are there.
    fn add_patches(&mut self, scene: &Scene) -> Result<(), AssembleError> {
        let assembly = self;
        for fixing in &scene.fixings {
            let mut patch = assembly.placed(&fixing.patch)?;
            if let Some(stiffness) = fixing.stiffness {
                let share = stiffness / patch.vertices.len() as f64;
                for &v in &patch.vertices {
                    let anchor = assembly.builder.positions()[v as usize];
                    patch.attachments.push(assembly.builder.add_attachment(v, anchor, share)?);
                }
            }
            assembly.fixings.push(patch);
        }
        for motion in &scene.motions {
            let patch = assembly.placed(&motion.patch)?;
            assembly.motions.push(patch);
        }
        for force in &scene.forces {
            let patch = assembly.placed(&force.patch)?;
            assembly.forces.push(patch);
        }
        for spring in &scene.springs {
            let from = assembly.placed(&spring.from)?.vertices;
            let to = assembly.placed(&spring.to)?.vertices;
            let points = |patch: &[u32]| -> Vec<Vec3<f64>> {
                patch.iter().map(|&v| assembly.builder.positions()[v as usize]).collect()
            };
            let Some((a, b)) = nearest_pair(&points(&from), &points(&to)) else {
                return Err(AssembleError::Spring { spring: spring.name.clone() });
            };
            let ends = [from[a], to[b]];
            assembly.builder.add_spring(ends, spring.stiffness, spring.rest_length)?;
        }
        Ok(())
    }

    fn add_body(
        &mut self,
        body: &Body,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Result<(), AssembleError> {
        let (mesh, surface, report) = make_mesh(body, load)?;
        let place = |points: &[Vec3<f64>]| -> Vec<Vec3<f64>> {
            points.iter().map(|x| body.placement.apply(*x)).collect()
        };
        let placed =
            TetMesh::new(place(mesh.vertices()), mesh.tets().to_vec(), mesh.regions().to_vec());
        let (mesh, _) =
            placed.map_err(|error| AssembleError::Placement { body: body.name.clone(), error })?;
        self.note_report(&body.name, &report);
        let mesh = labelled(body, mesh)?;
        let (mesh, refinement) = refined(body, mesh)?;
        let surface =
            surface.map(|surface| SurfaceMesh { vertices: place(&surface.vertices), ..surface });
        self.put(body, (mesh, report.names()), refinement, surface)
    }

    /// Adds a body whose mesh is where it is to be, with a surface that is finer than its boundary where it has one.
    fn put(
        &mut self,
        body: &Body,
        (mesh, names): (TetMesh, MeshNames),
        refinement: Option<Refinement>,
        surface: Option<SurfaceMesh>,
    ) -> Result<(), AssembleError> {
        let has_fine_surface = surface.is_some();
        let surface = surface.unwrap_or_else(|| boundary_surface(&mesh).surface);
        let embedding = Embedding::new(&mesh, &surface)
            .map_err(|error| AssembleError::Embedding { body: body.name.clone(), error })?;
        let typical = libm::cbrt(mesh.volume() / mesh.tets().len() as f64);
        if has_fine_surface && embedding.max_distance() > 3.0 * typical {
            self.notes.push(format!(
                "body `{}`: the surface lies up to {:.1} mm outside the tetrahedra; do mesh and \
                 surface belong together?",
                body.name,
                1e3 * embedding.max_distance()
            ));
        }

        let index = self.builder.add_body(&mesh, &body.material)?;
        for region in &body.regions {
            let mut count = 0;
            for label in region.label.numbers(&names) {
                count += self.builder.set_region_material(index, label, &region.material)?;
            }
            if count == 0 {
                return Err(AssembleError::UnknownRegion {
                    body: body.name.clone(),
                    label: region.label.clone(),
                    known: names.list_regions(mesh.regions()),
                });
            }
        }
        let ranges = self.builder.body(index)?.clone();
        self.bodies.push(AssembledBody {
            name: body.name.clone(),
            mesh,
            names,
            refinement,
            surface,
            embedding,
            has_fine_surface,
            vertices: ranges.vertices,
            tets: ranges.tets,
        });
        Ok(())
    }

    /// The vertices of a patch, of a body that there is.
    pub(super) fn resolve(
        &self,
        patch: &crate::scene::Patch,
    ) -> Result<ResolvedPatch, AssembleError> {
        let body = &self.bodies[patch.body];
        let mesh = body.refinement.as_ref().map_or(&body.mesh, |from| &from.coarse);
        let mut local = patch.select(mesh, &body.names)?;
        for middles in body.refinement.iter().flat_map(|from| &from.middles) {
            local = middles.patch(&local);
        }
        let first = body.vertices.start as u32;
        let vertices = local.into_iter().map(|v| v + first).collect();
        Ok(ResolvedPatch { vertices, attachments: Vec::new() })
    }

    /// The same, with a note on what is probably a slip in the scene.
    pub(super) fn placed(
        &mut self,
        patch: &crate::scene::Patch,
    ) -> Result<ResolvedPatch, AssembleError> {
        self.notes.extend(patch.doubt(&self.bodies[patch.body].mesh));
        self.resolve(patch)
    }

    fn note_report(&mut self, name: &str, report: &ReadReport) {
        let repairs = &report.repairs;
        if repairs.rewound_tets > 0 {
            self.notes.push(format!(
                "body `{name}`: reversed the winding of {} tetrahedra",
                repairs.rewound_tets
            ));
        }
        if !repairs.removed_vertices.is_empty() {
            self.notes.push(format!(
                "body `{name}`: left out {} vertices that no tetrahedron uses",
                repairs.removed_vertices.len()
            ));
        }
        for split in &report.split {
            let (count, kind) = (split.count, &split.kind);
            self.notes.push(format!("body `{name}`: cut {count} x {kind} into tetrahedra"));
        }
        if report.curved > 0 {
            self.notes.push(format!(
                "body `{name}`: took {} second-order elements by their corners; their edges were up to {:.3} mm from straight",
                report.curved, 1e3 * report.bulge
            ));
        }
        if let Some(text) = report.unused_text() {
            self.notes.push(format!("body `{name}`: {text}"));
        }
        let skipped = report.skipped_texts();
        self.notes.extend(skipped.into_iter().map(|text| format!("body `{name}`: {text}")));
    }

    /// A vertex that is both fixed and moved follows the motion, the later of two motions wins, and springs
    /// do nothing where something rigid holds: worth saying.
    fn note_overlaps(&mut self, scene: &Scene) {
        let fixings = scene.fixings.iter().zip(&self.fixings);
        let fixings = fixings.filter(|(fixing, _)| fixing.stiffness.is_none());
        let mut rigid: Vec<(&str, &[u32])> =
            fixings.map(|(fixing, patch)| (fixing.name.as_str(), &patch.vertices[..])).collect();
        let mut soft: Vec<(&str, &[u32])> = Vec::new();
        for (motion, patch) in scene.motions.iter().zip(&self.motions) {
            let patches = if motion.stiffness.is_none() { &mut rigid } else { &mut soft };
            patches.push((motion.name.as_str(), &patch.vertices[..]));
        }
        let shared = |a: &[u32], b: &[u32]| a.iter().filter(|v| b.binary_search(v).is_ok()).count();
        let mut notes = Vec::new();
        for (later, (name, vertices)) in rigid.iter().enumerate() {
            for (other, others) in &rigid[..later] {
                let count = shared(vertices, others);
                if count > 0 {
                    notes.push(format!(
                        "{count} vertices belong to both `{other}` and `{name}`; they follow `{name}`, \
                         and their forces count as its own"
                    ));
                }
            }
        }
        for (name, vertices) in &soft {
            for (other, others) in &rigid {
                let count = shared(vertices, others);
                if count > 0 {
                    notes.push(format!(
                        "{count} vertices belong to both `{other}` and `{name}`; the springs of \
                         `{name}` do nothing there while `{other}` holds them"
                    ));
                }
            }
        }
        self.notes.append(&mut notes);
    }

    /// Parts of a mesh that nothing ties to the rest, and parts that nothing holds up.
    fn note_loose_parts(&mut self, scene: &Scene) {
        let held: Vec<u32> = (self.fixings.iter().chain(&self.motions))
            .flat_map(|patch| patch.vertices.iter().copied())
            .collect();
        let mut is_held = vec![false; self.builder.positions().len()];
        held.iter().for_each(|&v| is_held[v as usize] = true);
        let is_tied = !scene.springs.is_empty() || !scene.ties.is_empty();
        let falls = scene.world.gravity.length() > 0.0 && !is_tied;
        for body in &self.bodies {
            let parts = connected_components(&body.mesh);
            let mut part_held = vec![false; parts.count];
            for (v, &part) in parts.labels.iter().enumerate() {
                part_held[part as usize] |= is_held[body.vertices.start + v];
            }
            let loose = part_held.iter().filter(|&&held| !held).count();
            if parts.count > 1 {
                self.notes.push(format!(
                    "body `{}` is in {} parts that share no vertex; they do not hold together",
                    body.name, parts.count
                ));
            }
            if falls && loose > 0 {
                let what = if parts.count == 1 { "it".into() } else { format!("{loose} of them") };
                self.notes.push(format!(
                    "body `{}`: no fixing or motion holds {what}, so gravity pulls {what} down",
                    body.name
                ));
            }
        }
    }
}

/// A mesh in the world with the labels of the body's balls: of several the last.
fn labelled(body: &Body, mesh: TetMesh) -> Result<TetMesh, AssembleError> {
    let balls = || {
        let of_number = |label: &RegionLabel| match label {
            RegionLabel::Number(number) => Some(*number),
            RegionLabel::Name(_) => None,
        };
        body.regions
            .iter()
            .filter_map(move |region| Some((of_number(&region.label)?, region.ball?)))
    };
    if balls().next().is_none() {
        return Ok(mesh);
    }
    let middle = |tet: &[u32; 4]| {
        tet.iter().fold(Vec3::ZERO, |sum, &v| sum + mesh.vertices()[v as usize] * 0.25)
    };
    let middles: Vec<Vec3<f64>> = mesh.tets().iter().map(middle).collect();
    let mut labels = mesh.regions().to_vec();
    for (label, ball) in balls() {
        let mut nearest = f64::INFINITY;
        for (own, middle) in labels.iter_mut().zip(&middles) {
            let distance = (*middle - ball.center).length() - ball.radius;
            nearest = nearest.min(distance);
            if distance <= 0.0 {
                *own = label;
            }
        }
        if nearest > 0.0 {
            let body = body.name.clone();
            return Err(AssembleError::EmptyBall { body, label, distance: nearest });
        }
    }
    TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), labels)
        .map(|(mesh, _)| mesh)
        .map_err(|error| AssembleError::Placement { body: body.name.clone(), error })
}

/// The mesh of a body as fine as it is asked for, and what it comes from.
fn refined(body: &Body, mesh: TetMesh) -> Result<(TetMesh, Option<Refinement>), AssembleError> {
    let (refine, before) = (body.refine, mesh.tets().len());
    if refine == 0 {
        return Ok((mesh, None));
    }
    let count = before.saturating_mul(8usize.saturating_pow(refine));
    let name = || body.name.clone();
    if count > MOST_REFINED {
        return Err(AssembleError::TooFine { body: name(), refine, before, count });
    }
    let (mut fine, mut all) = (mesh.clone(), Vec::new());
    for _ in 0..refine {
        let (finer, middles) = refine::refine(&fine)
            .map_err(|error| AssembleError::Placement { body: name(), error })?;
        all.push(middles);
        fine = finer;
    }
    Ok((fine, Some(Refinement { coarse: mesh, middles: all })))
}

/// A body's tetrahedra, its fine surface where it has one, and what reading said; before placing.
fn make_mesh(
    body: &Body,
    load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
) -> Result<(TetMesh, Option<SurfaceMesh>, ReadReport), AssembleError> {
    let built = |mesh| (mesh, None, ReadReport::default());
    let curved =
        |shape: shapes::CurvedShape| (shape.tets, Some(shape.surface), ReadReport::default());
    let made = match &body.shape {
        BodyShape::File { mesh, unit, surface } => {
            let mut file = |name: &str| {
                MeshFile::load(name, |file| load(file))
                    .map_err(|message| AssembleError::Load { message })
            };
            let (tets, mut report) = file(mesh)?.tets(*unit)?;
            let surface = match surface {
                Some(name) => {
                    let (surface, of_surface) = file(name)?.surface(*unit)?;
                    report.skipped.extend(of_surface.skipped);
                    Some(surface)
                }
                None => None,
            };
            return Ok((tets, surface, report));
        }
        &BodyShape::Beam { length, width, height, cells_across, cut } => {
            shapes::beam(length, width, height, cells_across as usize, cut).map(built)
        }
        BodyShape::Block { size, cells } => {
            shapes::block(Vec3::from_f64(*size), cells.map(|c| c as usize)).map(built)
        }
        &BodyShape::Sphere { radius, spacing } => shapes::sphere(radius, spacing).map(curved),
        &BodyShape::Capsule { radius, length, spacing } => {
            shapes::capsule(radius, length, spacing).map(curved)
        }
        &BodyShape::Liver { spacing, scale } => shapes::liver(spacing, scale).map(curved),
    };
    made.map_err(|error| AssembleError::Shape { body: body.name.clone(), error })
}
