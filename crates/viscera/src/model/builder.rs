//! From meshes and materials to a [`Model`].

use std::sync::Arc;

use super::elements::{ElementLists, Given};
use super::numbering::Numbering;
use super::{Body, MaterialConstants, Model, ModelError};
use crate::coloring::ConstraintGraph;
use crate::contact::Overlap;
use crate::contact::{Sample, Skin, TissueContact, sample_boundary};
use crate::elements::attachment::Attachments;
use crate::elements::kinds::{CONSTANTS, Constant, Kind, Legal};
use crate::elements::list::KINDS;
use crate::elements::spring::Springs;
use crate::material::{Compliance, Material};
use crate::mesh::{MAX_COORDINATE, TetMesh};
use crate::scalar::{Real, Vec3};

/// Collects bodies, springs and attachments, then builds the [`Model`].
///
/// What is as long as the mesh is shared with the models that are built and with clones: a simulation keeps its builder, and
/// clones it whenever a material changes.
#[derive(Clone, Debug, Default)]
pub struct ModelBuilder {
    bodies: Vec<Body>,
    positions: Arc<Vec<Vec3<f64>>>,
    /// Where tetrahedra carry no stress; empty where that is at `positions`.
    stress_free: Arc<Vec<Vec3<f64>>>,
    tets: Arc<Vec<[u32; 4]>>,
    regions: Arc<Vec<u32>>,
    materials: Vec<Material>,
    tet_material: Arc<Vec<u32>>,
    /// By kind.
    elements: [Vec<Given>; KINDS],
    anchors: Vec<Vec3<f64>>,
    samples: Arc<Vec<Sample>>,
    skin: Arc<Skin>,
    tissue_contact: TissueContact,
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
        Arc::make_mut(&mut self.positions).extend_from_slice(mesh.vertices());
        if !self.stress_free.is_empty() {
            Arc::make_mut(&mut self.stress_free).extend_from_slice(mesh.vertices());
        }
        let shift = first_vertex as u32;
        Arc::make_mut(&mut self.tets).extend(mesh.tets().iter().map(|tet| tet.map(|v| v + shift)));
        Arc::make_mut(&mut self.regions).extend_from_slice(mesh.regions());
        Arc::make_mut(&mut self.tet_material).resize(self.tets.len(), material);
        let tets = first_tet..self.tets.len();
        self.bodies.push(Body { vertices: first_vertex..vertex_count, tets });
        Ok(self.bodies.len() - 1)
    }

    /// Gives all of a body another material.
    pub fn set_material(&mut self, body: usize, material: &Material) -> Result<(), ModelError> {
        let range = self.body(body)?.tets.clone();
        let material = self.intern(material);
        Arc::make_mut(&mut self.tet_material)[range].fill(material);
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
        let tet_material = Arc::make_mut(&mut self.tet_material);
        for tet in range {
            if self.regions[tet] == region {
                tet_material[tet] = material;
                count += 1;
            }
        }
        Ok(count)
    }

    /// Says where the tetrahedra of a body carry no stress [m], shape [vertex_count of the body]: it begins where it was
    /// added, under the stress of that deformation. Masses, contact and patches stay those of the shape that was added.
    pub fn set_stress_free(
        &mut self,
        body: usize,
        positions: &[Vec3<f64>],
    ) -> Result<(), ModelError> {
        let Body { vertices, tets } = self.body(body)?.clone();
        if positions.len() != vertices.len() {
            let (given, expected) = (positions.len(), vertices.len());
            let (what, of) = ("the stress-free shape of a body", "positions");
            return Err(ModelError::Count { what, of, given, expected });
        }
        let corner = |v: u32| positions[v as usize - vertices.start];
        for tet in &self.tets[tets] {
            let value = crate::mesh::tet_volume(tet.map(corner));
            if value.is_nan() || value <= 0.0 {
                let (what, range) = ("volume of a tetrahedron without stress [m^3]", "above zero");
                return Err(ModelError::BadValue { what, range, value });
            }
        }
        if self.stress_free.is_empty() {
            self.stress_free = Arc::new(self.positions.to_vec());
        }
        Arc::make_mut(&mut self.stress_free)[vertices].copy_from_slice(positions);
        Ok(())
    }

    /// The anchor [m] of an attachment, and of other elements that have one, by its number.
    pub fn anchor(&self, number: usize) -> Option<Vec3<f64>> {
        self.anchors.get(number).copied()
    }

    /// Puts an anchor elsewhere [m]; does nothing where there is none of this number.
    pub(crate) fn set_anchor(&mut self, number: usize, place: Vec3<f64>) {
        if let Some(anchor) = self.anchors.get_mut(number) {
            *anchor = place;
        }
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

    /// Takes samples of the surface of all bodies added so far, for tools to touch: `4^cuts` of each triangle. One cut
    /// suits tools that are no larger than three edges, none suits larger ones.
    pub fn sample_surface(&mut self, cuts: u32) {
        let samples = sample_boundary(&self.tets, &self.positions, cuts.min(4));
        self.samples = Arc::new(samples);
    }

    /// Takes these samples in place of others.
    pub fn set_samples(&mut self, samples: Vec<Sample>) -> Result<(), ModelError> {
        for sample in &samples {
            for vertex in sample.vertices {
                self.check_vertex("a sample of the surface", vertex)?;
            }
            let numbers = sample.weights.iter().chain([&sample.area, &sample.edge]);
            let sum: f64 = sample.weights.iter().sum();
            let is_legal = sample.area > 0.0
                && sample.edge > 0.0
                && numbers.copied().all(f64::is_finite)
                && (sum - 1.0).abs() < 1e-9
                && (sample.tet as usize) < self.tets.len();
            if !is_legal {
                let (what, range) =
                    ("sum of a sample's weights", "one, its area and edge above zero");
                return Err(ModelError::BadValue { what, range, value: sum });
            }
        }
        self.samples = Arc::new(samples);
        Ok(())
    }

    /// Lets the surfaces of all bodies added so far meet: the outer faces of their tetrahedra. Bodies that are closer than the
    /// thickness of contact at rest meet from there on; returns the closest two. An error where the law is none.
    pub fn touch_tissue(&mut self, contact: &TissueContact) -> Result<Option<Overlap>, ModelError> {
        if let Some(complaint) = contact.law.complaint() {
            return Err(ModelError::Contact { complaint });
        }
        let mut skin = Skin::default();
        for (number, body) in (0..).zip(&self.bodies) {
            let first = body.tets.start as u32;
            skin.add_boundary(number, (&self.tets[..body.tets.end], first), &self.positions);
        }
        Ok(self.set_skin(skin, contact))
    }

    /// The same with other surfaces, of bodies that have been added.
    pub(crate) fn set_skin(&mut self, mut skin: Skin, contact: &TissueContact) -> Option<Overlap> {
        let bodies: Vec<_> = self.bodies.iter().map(|body| body.tets.clone()).collect();
        let overlap = skin.finish(&self.tets, &self.positions, &bodies, contact);
        self.tissue_contact = *contact;
        self.skin = Arc::new(skin);
        overlap
    }

    /// The surface on which tissue meets tissue.
    pub(crate) fn skin(&self) -> &Skin {
        &self.skin
    }

    /// Says where ties are without force, by their numbers, as [`Tie`](crate::contact::Tie) has it; does nothing where there are none of these.
    pub(crate) fn set_tie_rests(&mut self, rests: &[(usize, [f64; 3])]) {
        if rests.is_empty() {
            return;
        }
        let ties = &mut Arc::make_mut(&mut self.skin).ties;
        for (number, rest) in rests {
            if let Some(tie) = ties.get_mut(*number) {
                tie.rest = *rest;
            }
        }
    }

    /// Vertices of all tetrahedra added so far.
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.tets
    }

    /// Samples of the surface taken so far.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
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
        let [a, b] = ends.map(|v| self.positions[v as usize]);
        let rest_length = rest_length.unwrap_or((b - a).length());
        self.add_element::<Springs, 2, 1>(ends, &[rest_length, stiffness], None)
    }

    /// Holds a vertex at an anchor [m] with the given stiffness [N/m]; returns the number under
    /// which the inputs of a step move the anchor.
    pub fn add_attachment(
        &mut self,
        vertex: u32,
        anchor: Vec3<f64>,
        stiffness: f64,
    ) -> Result<usize, ModelError> {
        self.add_element::<Attachments, 1, 3>([vertex], &[stiffness], Some(anchor))?;
        Ok(self.anchors.len() - 1)
    }

    /// Adds an element of any kind with its constants, in the order of [`Kind::CONSTANTS`], and its anchor [m]
    /// where the kind has one; returns its number among those of its kind. The number of an anchor, under which the
    /// inputs of a step move it, is how many anchors were added before: attachments have them as well.
    pub fn add_element<K: Kind<N, M>, const N: usize, const M: usize>(
        &mut self,
        vertices: [u32; N],
        constants: &[f64],
        anchor: Option<Vec3<f64>>,
    ) -> Result<usize, ModelError> {
        for (i, &vertex) in vertices.iter().enumerate() {
            self.check_vertex(K::NAME, vertex)?;
            if vertices[..i].contains(&vertex) {
                return Err(ModelError::SameVertex { what: K::NAME, vertex });
            }
        }
        let given = [constants.len(), usize::from(anchor.is_some())];
        let expected = [K::CONSTANTS.len(), usize::from(K::IS_ANCHORED)];
        for (of, (given, expected)) in
            ["constants", "anchors"].into_iter().zip(given.into_iter().zip(expected))
        {
            if given != expected {
                return Err(ModelError::Count { what: K::NAME, of, given, expected });
            }
        }
        for value in anchor.map(Vec3::to_array).into_iter().flatten() {
            if value.is_nan() || value.abs() > MAX_COORDINATE {
                let (what, range) = ("anchor's coordinate [m]", "within 1e9 m of the origin");
                return Err(ModelError::BadValue { what, range, value });
            }
        }
        let mut given = [0.0; CONSTANTS];
        for (i, constant) in K::CONSTANTS.iter().enumerate() {
            check_constant(constant, constants[i])?;
            given[i] = constants[i];
        }
        let anchor = K::IS_ANCHORED.then(|| {
            self.anchors.push(anchor.unwrap_or(Vec3::ZERO));
            self.anchors.len() as u32 - 1
        });
        let element = Given { vertices: vertices.to_vec(), constants: given, anchor };
        let of_kind = &mut self.elements[K::NUMBER];
        of_kind.push(element);
        Ok(of_kind.len() - 1)
    }

    /// Puts everything together.
    pub fn build<S: Real>(&self) -> Result<Model<S>, ModelError> {
        if self.bodies.is_empty() {
            return Err(ModelError::Empty);
        }
        let (part_numbers, part_count) = self.parts();
        let numbering = Numbering::along_curves(&self.positions, &part_numbers, part_count);
        let mut model = Model {
            bodies: self.bodies.clone(),
            rest_positions: self.positions.iter().map(|p| p.cast()).collect(),
            masses: self.masses(),
            materials: self.materials.iter().map(constants).collect(),
            tet_vertices: Arc::clone(&self.tets),
            tet_materials: Arc::clone(&self.tet_material),
            laws: self.materials.iter().map(Material::model).collect(),
            places: Arc::clone(&self.positions),
            stress_free: match self.stress_free.is_empty() {
                true => Arc::clone(&self.positions),
                false => Arc::clone(&self.stress_free),
            },
            elements: ElementLists::new(&self.elements),
            rest_anchors: self.anchors.iter().map(|anchor| anchor.cast()).collect(),
            samples: Arc::clone(&self.samples),
            skin: Arc::clone(&self.skin),
            tissue_contact: self.tissue_contact,
            revision: 0,
            numbering: Arc::new(numbering),
            part_numbers,
            part_count,
        };
        model.revision = model.fingerprint();
        Ok(model)
    }

    /// The connected part of each vertex, and how many there are.
    fn parts(&self) -> (Vec<u32>, usize) {
        let mut graph = ConstraintGraph::new();
        self.tets.iter().for_each(|tet| graph.push(tet));
        self.elements.iter().flatten().for_each(|element| graph.push(&element.vertices));
        graph.parts(self.positions.len())
    }

    /// A quarter of each tetrahedron's [kg].
    fn masses<S: Real>(&self) -> Vec<S> {
        let mut masses = vec![0.0; self.positions.len()];
        for (tet, &material) in self.tets.iter().zip(&*self.tet_material) {
            let volume = crate::mesh::tet_volume(tet.map(|v| self.positions[v as usize]));
            let share = 0.25 * volume * self.materials[material as usize].density();
            for &v in tet {
                masses[v as usize] += share;
            }
        }
        masses.into_iter().map(S::from_f64).collect()
    }

    /// A body whose material is changed a thousand times still has one.
    fn forget_unused_materials(&mut self) {
        let mut new_number = vec![None; self.materials.len()];
        let mut kept = Vec::new();
        for number in Arc::make_mut(&mut self.tet_material) {
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

fn check_constant(constant: &Constant, value: f64) -> Result<(), ModelError> {
    let (is_legal, range) = match constant.legal {
        Legal::Positive => (value > 0.0, "above zero"),
        Legal::NotNegative => (value >= 0.0, "zero or more"),
        Legal::Any => (true, "a number"),
    };
    if is_legal && value.is_finite() {
        return Ok(());
    }
    Err(ModelError::BadValue { what: constant.name, range, value })
}
