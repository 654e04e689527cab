//! The model: everything that does not move. Meshes, rest shapes, materials, springs,
//! attachments, colours; flat arrays, sorted by colour, ready for any backend.
//!
//! Vertices and tetrahedra are numbered over all bodies in the order in which the bodies were
//! added; [`Body`] says which range belongs to which. Constraint arrays are sorted by colour, and
//! `order` maps back to the user's numbers.

use std::ops::Range;

use crate::coloring::{Coloring, ConstraintGraph};
use crate::elements::TetForm;
use crate::material::{Material, MaterialModel};
use crate::mesh::{MAX_COORDINATE, TetMesh};
use crate::scalar::{Mat3, Real, Vec3};
use crate::settings::{NeoHookean, SolverSettings};

/// Why a model cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Nothing was added.
    #[error("the model has no body; add one with `ModelBuilder::add_body`")]
    Empty,
    /// An index names no body.
    #[error("body {body} does not exist; the model has {body_count}")]
    UnknownBody {
        /// The index given.
        body: usize,
        /// How many bodies there are.
        body_count: usize,
    },
    /// An index names no vertex.
    #[error("{what} refers to vertex {vertex}; the model has {vertex_count}")]
    UnknownVertex {
        /// The kind of element.
        what: &'static str,
        /// The index given.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A spring that connects nothing.
    #[error("a spring leads from vertex {vertex} to itself; give it two different ends")]
    SpringEnds {
        /// The vertex given twice.
        vertex: u32,
    },
    /// A stiffness or length that no spring has.
    #[error("{what} must be {range} and finite, not {value}")]
    BadValue {
        /// The quantity, with its unit.
        what: &'static str,
        /// The legal range in words.
        range: &'static str,
        /// The value given.
        value: f64,
    },
    /// More than 32-bit indices can number.
    #[error("{count} {what} are more than the {limit} that 32-bit indices can number")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How many.
        count: usize,
        /// How many would do.
        limit: usize,
    },
}

/// The ranges of one body in the user's numbering.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body {
    /// Its vertices.
    pub vertices: Range<usize>,
    /// Its tetrahedra.
    pub tets: Range<usize>,
}

/// Constants of one material in the solver's precision.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialConstants<S> {
    /// Lame's first parameter [Pa].
    pub lame_lambda: S,
    /// Lame's second parameter, the shear modulus [Pa].
    pub lame_mu: S,
    /// Compliance `D^-1` [1/Pa] for `C = (E00, E11, E22, 2 E12, 2 E02, 2 E01)`.
    pub compliance: [[S; 6]; 6],
    /// Retardation time [s] of the viscous stress; zero for none.
    pub viscosity: S,
}

/// Tetrahedra of one material model, sorted by colour.
#[derive(Clone, Debug, PartialEq)]
pub struct TetSet<S> {
    /// The elastic energy of the whole set.
    pub model: MaterialModel,
    /// Its constraints.
    pub form: TetForm,
    /// Vertices, shape [tet_count].
    pub vertices: Vec<[u32; 4]>,
    /// The copies that a sweep works on, shape [tet_count].
    pub copies: Vec<[u32; 4]>,
    /// `Dm^-1` [1/m], shape [tet_count].
    pub inverse_rest_shape: Vec<Mat3<S>>,
    /// Rest volume [m^3], shape [tet_count].
    pub rest_volume: Vec<S>,
    /// Index into [`Model::materials`], shape [tet_count].
    pub material: Vec<u32>,
    /// The user's number of each tetrahedron, shape [tet_count].
    pub order: Vec<u32>,
    /// Tetrahedra of colour `c` are `color_offsets[c] .. color_offsets[c + 1]`.
    pub color_offsets: Vec<u32>,
    /// First multiplier; a tetrahedron has [`TetForm::multiplier_count`] of them.
    pub multiplier_offset: usize,
    /// First multiplier of the viscous block, six per tetrahedron, where any material is viscous.
    pub viscous_offset: Option<usize>,
    /// First slot of the per-corner scratch; a tetrahedron has four.
    pub corner_offset: usize,
}

/// Springs between two vertices, sorted by colour.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpringSet<S> {
    /// The two ends, shape [spring_count].
    pub vertices: Vec<[u32; 2]>,
    /// The copies that a sweep works on, shape [spring_count].
    pub copies: Vec<[u32; 2]>,
    /// Length without force [m], shape [spring_count].
    pub rest_length: Vec<S>,
    /// Stiffness [N/m], shape [spring_count].
    pub stiffness: Vec<S>,
    /// The user's number of each spring, shape [spring_count].
    pub order: Vec<u32>,
    /// Springs of colour `c` are `color_offsets[c] .. color_offsets[c + 1]`.
    pub color_offsets: Vec<u32>,
    /// First multiplier, one per spring.
    pub multiplier_offset: usize,
    /// First slot of the per-corner scratch, two per spring.
    pub corner_offset: usize,
}

/// Elastic attachments of vertices to anchors, sorted by colour. The anchors move with the
/// inputs of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttachmentSet<S> {
    /// The vertex held, shape [attachment_count].
    pub vertices: Vec<u32>,
    /// The copy that a sweep works on, shape [attachment_count].
    pub copies: Vec<u32>,
    /// Stiffness [N/m], shape [attachment_count].
    pub stiffness: Vec<S>,
    /// The user's number of each attachment, shape [attachment_count].
    pub order: Vec<u32>,
    /// Attachments of colour `c` are `color_offsets[c] .. color_offsets[c + 1]`.
    pub color_offsets: Vec<u32>,
    /// First multiplier, three per attachment.
    pub multiplier_offset: usize,
    /// First slot of the per-corner scratch, one per attachment.
    pub corner_offset: usize,
}

/// Everything that does not move.
#[derive(Clone, Debug, PartialEq)]
pub struct Model<S> {
    /// The bodies in the order in which they were added.
    pub bodies: Vec<Body>,
    /// Rest positions [m], shape [vertex_count].
    pub rest_positions: Vec<Vec3<S>>,
    /// Lumped masses [kg]: a quarter of each tetrahedron's, shape [vertex_count].
    pub masses: Vec<S>,
    /// Materials in use.
    pub materials: Vec<MaterialConstants<S>>,
    /// Saint Venant-Kirchhoff tetrahedra.
    pub green_strain: TetSet<S>,
    /// Stable neo-Hookean tetrahedra.
    pub neo_hookean: TetSet<S>,
    /// Springs.
    pub springs: SpringSet<S>,
    /// Attachments.
    pub attachments: AttachmentSet<S>,
    /// Anchors of the attachments where nothing moves them [m], the user's order.
    pub rest_anchors: Vec<Vec3<S>>,
    /// Which part each vertex belongs to, shape [vertex_count]; tetrahedra and springs connect.
    pub component_of: Vec<u32>,
    /// Number of such parts.
    pub component_count: usize,
    /// Number of colours.
    pub color_count: usize,
    /// Copies of vertex `v` are `copy_offsets[v] .. copy_offsets[v + 1]`.
    pub copy_offsets: Vec<u32>,
    /// The most constraints at one vertex.
    pub largest_clique: usize,
    /// Slots of the per-corner scratch that belong to vertex `v`, always summed in this order:
    /// `gather_slots[gather_offsets[v] .. gather_offsets[v + 1]]`.
    pub gather_offsets: Vec<u32>,
    /// See [`Model::gather_offsets`].
    pub gather_slots: Vec<u32>,
    /// Number of multipliers of all constraints.
    pub multiplier_count: usize,
}

impl<S> TetSet<S> {
    /// Number of tetrahedra.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// True without tetrahedra.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }
}

impl<S: Real> Model<S> {
    /// Number of vertices of all bodies.
    pub fn vertex_count(&self) -> usize {
        self.rest_positions.len()
    }

    /// Number of tetrahedra of all bodies.
    pub fn tet_count(&self) -> usize {
        self.green_strain.len() + self.neo_hookean.len()
    }

    /// Number of copies that a sweep works on.
    pub fn copy_count(&self) -> usize {
        self.copy_offsets.last().map_or(0, |&count| count as usize)
    }

    /// True where a vertex has more than one copy.
    pub fn is_split(&self) -> bool {
        self.copy_count() > self.vertex_count()
    }

    /// The two sets of tetrahedra.
    pub fn tet_sets(&self) -> [&TetSet<S>; 2] {
        [&self.green_strain, &self.neo_hookean]
    }
}

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
        let (component_of, component_count) = graph.components(self.positions.len());
        let mut layout = Layout { graph: &graph, coloring: &coloring, multipliers: 0, corners: 0 };
        let green_strain = self.lay_out_tets(&mut layout, TetForm::GreenStrain);
        let neo_hookean = self.lay_out_tets(&mut layout, neo_hookean_form(settings));
        let springs = self.lay_out_springs(&mut layout);
        let attachments = self.lay_out_attachments(&mut layout);
        let (multiplier_count, corner_count) = (layout.multipliers, layout.corners);

        let corners = (green_strain.vertices.iter().flatten())
            .chain(neo_hookean.vertices.iter().flatten())
            .chain(springs.vertices.iter().flatten())
            .chain(attachments.vertices.iter())
            .copied();
        let (gather_offsets, gather_slots) =
            gather_lists(corners, corner_count, self.positions.len());

        let mut masses = vec![0.0; self.positions.len()];
        for (tet, &material) in self.tets.iter().zip(&self.tet_material) {
            let volume = crate::mesh::tet_volume(tet.map(|v| self.positions[v as usize]));
            let share = 0.25 * volume * self.materials[material as usize].density();
            for &v in tet {
                masses[v as usize] += share;
            }
        }
        Ok(Model {
            bodies: self.bodies.clone(),
            rest_positions: self.positions.iter().map(|p| p.cast()).collect(),
            masses: masses.into_iter().map(S::from_f64).collect(),
            materials: self.materials.iter().map(constants).collect(),
            green_strain,
            neo_hookean,
            springs,
            attachments,
            rest_anchors: self.attachments.iter().map(|(_, anchor, _)| anchor.cast()).collect(),
            component_of,
            component_count,
            color_count: coloring.color_count as usize,
            largest_clique: coloring.largest_clique as usize,
            copy_offsets: coloring.copy_offsets,
            gather_offsets,
            gather_slots,
            multiplier_count,
        })
    }

    fn lay_out_tets<S: Real>(&self, layout: &mut Layout<'_>, form: TetForm) -> TetSet<S> {
        let model = match form {
            TetForm::GreenStrain => MaterialModel::SaintVenantKirchhoff,
            TetForm::NeoHookeanPair | TetForm::NeoHookeanStretch => MaterialModel::StableNeoHookean,
        };
        let of_model =
            |&tet: &usize| self.materials[self.tet_material[tet] as usize].model() == model;
        let chosen: Vec<usize> = (0..self.tets.len()).filter(of_model).collect();
        let (order, color_offsets) = layout.sort(chosen);
        let material: Vec<u32> = order.iter().map(|&t| self.tet_material[t as usize]).collect();
        let viscous = material.iter().any(|&m| self.materials[m as usize].viscosity() > 0.0);
        let shapes = order.iter().map(|&t| {
            let corners = self.tets[t as usize].map(|v| self.positions[v as usize]);
            (crate::mesh::edge_matrix(corners).inverse(), crate::mesh::tet_volume(corners))
        });
        let (inverse_rest_shape, rest_volume) =
            shapes.map(|(shape, volume)| (shape.cast(), S::from_f64(volume))).unzip();
        let mut set = TetSet {
            model,
            form,
            vertices: order.iter().map(|&t| self.tets[t as usize]).collect(),
            copies: order.iter().map(|&t| layout.copies(t as usize)).collect(),
            inverse_rest_shape,
            rest_volume,
            material,
            color_offsets,
            multiplier_offset: 0,
            viscous_offset: None,
            corner_offset: layout.take_corners(4 * order.len()),
            order,
        };
        set.multiplier_offset = layout.take_multipliers(form.multiplier_count() * set.len());
        set.viscous_offset = viscous.then(|| layout.take_multipliers(6 * set.len()));
        set
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
            corner_offset: layout.take_corners(2 * order.len()),
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
            corner_offset: layout.take_corners(order.len()),
            order: order.iter().map(|&c| c - first as u32).collect(),
            color_offsets,
        }
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

/// Hands out places in the flat arrays while the sets are laid out one after the other.
struct Layout<'a> {
    graph: &'a ConstraintGraph,
    coloring: &'a Coloring,
    multipliers: usize,
    corners: usize,
}

impl Layout<'_> {
    /// Sorts constraints by colour, then by number; returns them with the offsets of the colours.
    fn sort(&self, mut constraints: Vec<usize>) -> (Vec<u32>, Vec<u32>) {
        constraints.sort_by_key(|&c| (self.coloring.color_of[c], c));
        let mut offsets = vec![0u32; self.coloring.color_count as usize + 1];
        for &c in &constraints {
            offsets[self.coloring.color_of[c] as usize + 1] += 1;
        }
        for color in 1..offsets.len() {
            offsets[color] += offsets[color - 1];
        }
        (constraints.into_iter().map(|c| c as u32).collect(), offsets)
    }

    fn copies<const N: usize>(&self, constraint: usize) -> [u32; N] {
        let first = self.graph.corner_range(constraint).start;
        std::array::from_fn(|corner| self.coloring.copy_of[first + corner])
    }

    fn take_multipliers(&mut self, count: usize) -> usize {
        self.multipliers += count;
        self.multipliers - count
    }

    fn take_corners(&mut self, count: usize) -> usize {
        self.corners += count;
        self.corners - count
    }
}

/// For each vertex the corner slots that act on it, in ascending order.
fn gather_lists(
    corners: impl Iterator<Item = u32> + Clone,
    corner_count: usize,
    vertex_count: usize,
) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; vertex_count + 1];
    for v in corners.clone() {
        offsets[v as usize + 1] += 1;
    }
    for v in 0..vertex_count {
        offsets[v + 1] += offsets[v];
    }
    let mut next = offsets.clone();
    let mut slots = vec![0u32; corner_count];
    for (slot, v) in corners.enumerate() {
        slots[next[v as usize] as usize] = slot as u32;
        next[v as usize] += 1;
    }
    (offsets, slots)
}

fn constants<S: Real>(material: &Material) -> MaterialConstants<S> {
    MaterialConstants {
        lame_lambda: S::from_f64(material.lame_lambda()),
        lame_mu: S::from_f64(material.lame_mu()),
        compliance: material.compliance_matrix().map(|row| row.map(S::from_f64)),
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
