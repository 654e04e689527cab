//! From meshes and materials to a [`Model`].

use std::sync::Arc;

use super::numbering::Numbering;
use super::parts::Laid;
use super::tets::{TetBlock, TetSet};
use super::{AttachmentSet, Body, MaterialConstants, Model, ModelError, SpringSet};
use crate::coloring::{Coloring, ConstraintGraph};
use crate::elements::TetForm;
use crate::material::{Compliance, Material, MaterialModel};
use crate::mesh::{MAX_COORDINATE, TetMesh};
use crate::scalar::lanes::{Eight, LANES};
use crate::scalar::{Real, Vec3};
use crate::settings::{NeoHookean, SolverSettings};

/// Collects bodies, springs and attachments, then builds the [`Model`].
#[derive(Clone, Debug, Default)]
pub struct ModelBuilder {
    bodies: Vec<Body>,
    positions: Vec<Vec3<f64>>,
    tets: Vec<[u32; 4]>,
    regions: Vec<u32>,
    materials: Vec<Material>,
    tet_material: Vec<u32>,
    springs: Vec<([u32; 2], f64, f64)>,
    attachments: Vec<(u32, Vec3<f64>, f64)>,
}

impl ModelBuilder {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a mesh of one material and returns its number.
    pub fn add_body(&mut self, mesh: &TetMesh, material: &Material) -> Result<usize, ModelError> {
        let first_vertex = self.positions.len();
        let first_tet = self.tets.len();
        let vertex_count = first_vertex + mesh.vertices().len();
        // Eight corner slots per tetrahedron would still be numbered by 32 bits.
        check_count("vertices", vertex_count, u32::MAX as usize / 8)?;
        check_count("tetrahedra", first_tet + mesh.tets().len(), u32::MAX as usize / 16)?;
        let material = self.intern(material);
        self.positions.extend_from_slice(mesh.vertices());
        let shift = first_vertex as u32;
        self.tets.extend(mesh.tets().iter().map(|tet| tet.map(|v| v + shift)));
        self.regions.extend_from_slice(mesh.regions());
        self.tet_material.resize(self.tets.len(), material);
        let tets = first_tet..self.tets.len();
        self.bodies.push(Body { vertices: first_vertex..vertex_count, tets });
        Ok(self.bodies.len() - 1)
    }

    /// Gives all of a body another material.
    pub fn set_material(&mut self, body: usize, material: &Material) -> Result<(), ModelError> {
        let range = self.body(body)?.tets.clone();
        let material = self.intern(material);
        self.tet_material[range].fill(material);
        self.forget_unused_materials();
        Ok(())
    }

    /// Gives one region of a body another material; returns how many tetrahedra that concerns.
    pub fn set_region_material(
        &mut self,
        body: usize,
        region: u32,
        material: &Material,
    ) -> Result<usize, ModelError> {
        let range = self.body(body)?.tets.clone();
        let material = self.intern(material);
        let mut count = 0;
        for tet in range {
            if self.regions[tet] == region {
                self.tet_material[tet] = material;
                count += 1;
            }
        }
        Ok(count)
    }

    /// The ranges of a body.
    pub fn body(&self, body: usize) -> Result<&Body, ModelError> {
        let body_count = self.bodies.len();
        self.bodies.get(body).ok_or(ModelError::UnknownBody { body, body_count })
    }

    /// Rest positions [m] of all vertices added so far.
    pub fn positions(&self) -> &[Vec3<f64>] {
        &self.positions
    }

    /// Adds a spring of the given stiffness [N/m] between two vertices; returns its number.
    /// Without `rest_length` [m] the present distance is the rest length.
    pub fn add_spring(
        &mut self,
        ends: [u32; 2],
        stiffness: f64,
        rest_length: Option<f64>,
    ) -> Result<usize, ModelError> {
        for vertex in ends {
            self.check_vertex("a spring", vertex)?;
        }
        if ends[0] == ends[1] {
            return Err(ModelError::SpringEnds { vertex: ends[0] });
        }
        check_positive("spring stiffness [N/m]", stiffness)?;
        let [a, b] = ends.map(|v| self.positions[v as usize]);
        let rest_length = rest_length.unwrap_or((b - a).length());
        if !(rest_length >= 0.0 && rest_length.is_finite()) {
            let (what, range) = ("rest length [m]", "zero or more");
            return Err(ModelError::BadValue { what, range, value: rest_length });
        }
        self.springs.push((ends, stiffness, rest_length));
        Ok(self.springs.len() - 1)
    }

    /// Holds a vertex at an anchor [m] with the given stiffness [N/m]; returns the number under
    /// which the inputs of a step move the anchor.
    pub fn add_attachment(
        &mut self,
        vertex: u32,
        anchor: Vec3<f64>,
        stiffness: f64,
    ) -> Result<usize, ModelError> {
        self.check_vertex("an attachment", vertex)?;
        for value in anchor.to_array() {
            if value.is_nan() || value.abs() > MAX_COORDINATE {
                let (what, range) = ("anchor's coordinate [m]", "within 1e9 m of the origin");
                return Err(ModelError::BadValue { what, range, value });
            }
        }
        check_positive("attachment stiffness [N/m]", stiffness)?;
        self.attachments.push((vertex, anchor, stiffness));
        Ok(self.attachments.len() - 1)
    }

    /// Colours the constraints and lays out the arrays.
    ///
    /// The layout depends on the solver's colours and on the form in which it solves the stable
    /// neo-Hookean energy: build a solver for the model with the same settings.
    pub fn build<S: Real>(&self, settings: &SolverSettings) -> Result<Model<S>, ModelError> {
        if self.bodies.is_empty() {
            return Err(ModelError::Empty);
        }
        let mut graph = ConstraintGraph::new();
        for tet in &self.tets {
            graph.push(tet);
        }
        for (ends, ..) in &self.springs {
            graph.push(ends);
        }
        for (vertex, ..) in &self.attachments {
            graph.push(&[*vertex]);
        }
        let coloring = graph.color(self.positions.len(), settings.colors);
        debug_assert_eq!(coloring.validate(&graph), None);
        let (part_of, part_count) = graph.parts(self.positions.len());
        let numbering = Numbering::along_curves(&self.positions, &part_of, part_count);
        let part_of: Vec<u32> = numbering.order.iter().map(|&v| part_of[v as usize]).collect();
        let copy_offsets = renumbered_copies(&coloring, &numbering);
        let mut layout = Layout {
            graph: &graph,
            coloring: &coloring,
            numbering: &numbering,
            part_of: &part_of,
            copy_offsets: &copy_offsets,
            multipliers: 0,
        };
        let green_strain = self.lay_out_tets(&mut layout, TetForm::GreenStrain);
        let neo_hookean = self.lay_out_tets(&mut layout, neo_hookean_form(settings));
        let springs = self.lay_out_springs(&mut layout);
        let attachments = self.lay_out_attachments(&mut layout);
        let multiplier_count = layout.multipliers;
        let place = |v: u32| numbering.of(v) as u32;
        let parts = Laid {
            part_of: &part_of,
            copy_offsets: &copy_offsets,
            sets: [&green_strain, &neo_hookean],
            springs: &springs,
            attachments: &attachments,
            first_ends: springs.vertices.iter().map(|ends| place(ends[0])).collect(),
            held: attachments.vertices.iter().map(|&v| place(v)).collect(),
            color_count: coloring.color_count as usize,
        }
        .parts();
        Ok(Model {
            bodies: self.bodies.clone(),
            rest_positions: self.positions.iter().map(|p| p.cast()).collect(),
            masses: self.masses(),
            materials: self.materials.iter().map(constants).collect(),
            green_strain,
            neo_hookean,
            springs,
            attachments,
            rest_anchors: self.attachments.iter().map(|(_, anchor, _)| anchor.cast()).collect(),
            color_count: coloring.color_count as usize,
            largest_clique: coloring.largest_clique as usize,
            multiplier_count,
            parts: Arc::from(parts),
            numbering,
            copy_offsets,
        })
    }

    /// A quarter of each tetrahedron's [kg].
    fn masses<S: Real>(&self) -> Vec<S> {
        let mut masses = vec![0.0; self.positions.len()];
        for (tet, &material) in self.tets.iter().zip(&self.tet_material) {
            let volume = crate::mesh::tet_volume(tet.map(|v| self.positions[v as usize]));
            let share = 0.25 * volume * self.materials[material as usize].density();
            for &v in tet {
                masses[v as usize] += share;
            }
        }
        masses.into_iter().map(S::from_f64).collect()
    }

    fn lay_out_tets<S: Real>(&self, layout: &mut Layout<'_>, form: TetForm) -> TetSet<S> {
        let model = match form {
            TetForm::GreenStrain => MaterialModel::SaintVenantKirchhoff,
            TetForm::NeoHookeanPair | TetForm::NeoHookeanStretch => MaterialModel::StableNeoHookean,
        };
        let of_model =
            |&tet: &usize| self.materials[self.tet_material[tet] as usize].model() == model;
        let chosen: Vec<usize> = (0..self.tets.len()).filter(of_model).collect();
        let (order, colors) = layout.sort(chosen);
        let viscous_parts = self.viscous_parts(layout, &order);
        let is_viscous = viscous_parts.contains(&true);
        let in_blocks = |color: &[u32]| layout.blocks(&order, color).count();
        let count = colors.windows(2).map(in_blocks).sum();
        let mut set = TetSet {
            model,
            form,
            viscous: is_viscous,
            blocks: Vec::with_capacity(count),
            filled: Vec::with_capacity(count),
            uniform: Vec::with_capacity(count),
            viscous_blocks: Vec::with_capacity(if is_viscous { count } else { 0 }),
            copies: Vec::with_capacity(if layout.is_split() { count } else { 0 }),
            color_offsets: vec![0],
            multiplier_offset: 0,
            viscous_offset: 0,
            bounds: [self.positions.len(), layout.copy_count()],
            order,
        };
        for color in colors.windows(2) {
            for chosen in layout.blocks(&set.order, color) {
                set.filled.push(chosen.len() as u8);
                let block = self.block(layout, chosen);
                set.uniform.push(block.material.iter().all(|&m| m == block.material[0]));
                set.blocks.push(block);
                if is_viscous {
                    set.viscous_blocks.push(viscous_parts[layout.part(chosen[0])]);
                }
                if layout.is_split() {
                    set.copies.push(layout.block_copies(chosen));
                }
            }
            set.color_offsets.push(set.blocks.len() as u32);
        }
        [set.multiplier_offset, set.viscous_offset] =
            set.multiplier_counts().map(|count| layout.take_multipliers(count));
        set
    }

    /// Whether any of some tetrahedra in each part is viscous.
    fn viscous_parts(&self, layout: &Layout<'_>, tets: &[u32]) -> Vec<bool> {
        let count = layout.part_of.last().map_or(0, |&last| last as usize + 1);
        let mut viscous = vec![false; count];
        for &tet in tets {
            let material = self.tet_material[tet as usize] as usize;
            viscous[layout.part(tet)] |= self.materials[material].viscosity() > 0.0;
        }
        viscous
    }

    /// The constants of up to eight tetrahedra.
    fn block<S: Real>(&self, layout: &Layout<'_>, tets: &[u32]) -> TetBlock<S> {
        let mut block = TetBlock::empty();
        for lane in 0..LANES {
            let tet = tets[lane.min(tets.len() - 1)] as usize;
            let vertices = self.tets[tet];
            let corners = vertices.map(|v| self.positions[v as usize]);
            block.set_shape(lane, &crate::mesh::edge_matrix(corners).inverse().cast());
            block.rest_volume[lane] = S::from_f64(crate::mesh::tet_volume(corners));
            block.material[lane] = self.tet_material[tet];
            for (corner, v) in vertices.into_iter().enumerate() {
                block.vertices[corner][lane] = layout.numbering.of(v) as u32;
            }
        }
        block
    }

    fn lay_out_springs<S: Real>(&self, layout: &mut Layout<'_>) -> SpringSet<S> {
        let first = self.tets.len();
        let (order, color_offsets) = layout.sort((first..first + self.springs.len()).collect());
        let spring = |&c: &u32| &self.springs[c as usize - first];
        SpringSet {
            vertices: order.iter().map(|c| spring(c).0).collect(),
            copies: order.iter().map(|&c| layout.copies(c as usize)).collect(),
            stiffness: order.iter().map(|c| S::from_f64(spring(c).1)).collect(),
            rest_length: order.iter().map(|c| S::from_f64(spring(c).2)).collect(),
            multiplier_offset: layout.take_multipliers(order.len()),
            order: order.iter().map(|&c| c - first as u32).collect(),
            color_offsets,
        }
    }

    fn lay_out_attachments<S: Real>(&self, layout: &mut Layout<'_>) -> AttachmentSet<S> {
        let first = self.tets.len() + self.springs.len();
        let chosen = (first..first + self.attachments.len()).collect();
        let (order, color_offsets) = layout.sort(chosen);
        let attachment = |&c: &u32| &self.attachments[c as usize - first];
        AttachmentSet {
            vertices: order.iter().map(|c| attachment(c).0).collect(),
            copies: order.iter().map(|&c| layout.copies::<1>(c as usize)[0]).collect(),
            stiffness: order.iter().map(|c| S::from_f64(attachment(c).2)).collect(),
            multiplier_offset: layout.take_multipliers(3 * order.len()),
            order: order.iter().map(|&c| c - first as u32).collect(),
            color_offsets,
        }
    }

    /// A body whose material is changed a thousand times still has one.
    fn forget_unused_materials(&mut self) {
        let mut new_number = vec![None; self.materials.len()];
        let mut kept = Vec::new();
        for number in &mut self.tet_material {
            let old = *number as usize;
            *number = *new_number[old].get_or_insert_with(|| {
                kept.push(self.materials[old]);
                kept.len() as u32 - 1
            });
        }
        self.materials = kept;
    }

    fn intern(&mut self, material: &Material) -> u32 {
        let known = self.materials.iter().position(|m| m == material);
        let index = known.unwrap_or_else(|| {
            self.materials.push(*material);
            self.materials.len() - 1
        });
        index as u32
    }

    fn check_vertex(&self, what: &'static str, vertex: u32) -> Result<(), ModelError> {
        let vertex_count = self.positions.len();
        if (vertex as usize) < vertex_count {
            return Ok(());
        }
        Err(ModelError::UnknownVertex { what, vertex, vertex_count })
    }
}

/// The stretch form is made for the rebase; XPBD as published has the pair.
fn neo_hookean_form(settings: &SolverSettings) -> TetForm {
    match (settings.neo_hookean, settings.rebase) {
        (NeoHookean::Pair, _) | (NeoHookean::Auto, false) => TetForm::NeoHookeanPair,
        (NeoHookean::Stretch, _) | (NeoHookean::Auto, true) => TetForm::NeoHookeanStretch,
    }
}

/// First copy of each vertex in the solver's numbering.
fn renumbered_copies(coloring: &Coloring, numbering: &Numbering) -> Vec<u32> {
    let mut offsets = Vec::with_capacity(numbering.order.len() + 1);
    let mut next = 0;
    offsets.push(next);
    for &v in &numbering.order {
        let v = v as usize;
        next += coloring.copy_offsets[v + 1] - coloring.copy_offsets[v];
        offsets.push(next);
    }
    offsets
}

/// Hands out places in the flat arrays while the sets are laid out one after the other.
struct Layout<'a> {
    graph: &'a ConstraintGraph,
    coloring: &'a Coloring,
    numbering: &'a Numbering,
    /// Of the solver's vertices, ascending.
    part_of: &'a [u32],
    /// Of the solver's vertices.
    copy_offsets: &'a [u32],
    multipliers: usize,
}

impl Layout<'_> {
    /// Sorts constraints by colour, then by place, and so by part, then by number; returns them with the offsets of
    /// the colours.
    fn sort(&self, mut constraints: Vec<usize>) -> (Vec<u32>, Vec<u32>) {
        let place = |c: usize| {
            let vertices = self.graph.vertices(c).iter();
            vertices.map(|&v| self.numbering.of(v)).min()
        };
        constraints.sort_by_cached_key(|&c| (self.coloring.color_of[c], place(c), c));
        let mut offsets = vec![0u32; self.coloring.color_count as usize + 1];
        for &c in &constraints {
            offsets[self.coloring.color_of[c] as usize + 1] += 1;
        }
        for color in 1..offsets.len() {
            offsets[color] += offsets[color - 1];
        }
        // By reference: collected in place, the memory of the larger numbers would be kept.
        (constraints.iter().map(|&c| c as u32).collect(), offsets)
    }

    /// The part of a constraint.
    fn part(&self, constraint: u32) -> usize {
        let first = self.graph.vertices(constraint as usize)[0];
        self.part_of[self.numbering.of(first)] as usize
    }

    /// Tetrahedra of a colour in blocks: up to eight of one part.
    fn blocks<'t>(&self, order: &'t [u32], color: &[u32]) -> impl Iterator<Item = &'t [u32]> {
        order[color[0] as usize..color[1] as usize]
            .chunk_by(|&a, &b| self.part(a) == self.part(b))
            .flat_map(|of_part| of_part.chunks(LANES))
    }

    fn copy_count(&self) -> usize {
        self.copy_offsets.last().map_or(0, |&count| count as usize)
    }

    fn is_split(&self) -> bool {
        self.copy_count() > self.numbering.order.len()
    }

    /// The copies of a constraint's corners, in the solver's numbering.
    fn copies<const N: usize>(&self, constraint: usize) -> [u32; N] {
        let first = self.graph.corner_range(constraint).start;
        let vertices = self.graph.vertices(constraint);
        std::array::from_fn(|corner| {
            let v = vertices[corner];
            let local =
                self.coloring.copy_of[first + corner] - self.coloring.copy_offsets[v as usize];
            self.copy_offsets[self.numbering.of(v)] + local
        })
    }

    /// The copies of up to eight tetrahedra.
    fn block_copies(&self, tets: &[u32]) -> [Eight<u32>; 4] {
        let mut block = [[0; LANES]; 4];
        for lane in 0..LANES {
            let copies = self.copies::<4>(tets[lane.min(tets.len() - 1)] as usize);
            for (corner, copy) in copies.into_iter().enumerate() {
                block[corner][lane] = copy;
            }
        }
        block
    }

    fn take_multipliers(&mut self, count: usize) -> usize {
        self.multipliers += count;
        self.multipliers - count
    }
}

fn constants<S: Real>(material: &Material) -> MaterialConstants<S> {
    let Compliance { normal, cross, shear } = material.compliance();
    let [normal, cross, shear] = [normal, cross, shear].map(S::from_f64);
    MaterialConstants {
        lame_lambda: S::from_f64(material.lame_lambda()),
        lame_mu: S::from_f64(material.lame_mu()),
        compliance: Compliance { normal, cross, shear },
        viscosity: S::from_f64(material.viscosity()),
    }
}

fn check_count(what: &'static str, count: usize, limit: usize) -> Result<(), ModelError> {
    if count <= limit { Ok(()) } else { Err(ModelError::TooLarge { what, count, limit }) }
}

fn check_positive(what: &'static str, value: f64) -> Result<(), ModelError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(ModelError::BadValue { what, range: "above zero", value })
}
