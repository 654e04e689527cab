//! The model: everything that does not move, and nothing of how it is solved. Meshes, rest shapes, materials, springs,
//! attachments; [`crate::layout`] sorts it for a solver.
//!
//! Vertices and tetrahedra are numbered over all bodies in the order in which the bodies were added; [`Body`] says
//! which range belongs to which. Beside that order there is one along a curve through space, one connected part after
//! the other, in which solvers number vertices; see `numbering`.

mod builder;
pub(crate) mod elements;
mod numbering;

use std::ops::Range;
use std::sync::Arc;

pub use builder::ModelBuilder;
pub(crate) use elements::for_each_kind;
pub use elements::{ElementList, ElementLists};
pub(crate) use numbering::{Numbering, Z_ORDER_BITS, z_order};

pub use crate::material::MaterialConstants;

use crate::contact::skin::Site;
use crate::contact::{Sample, Skin, TissueContact};
use crate::material::{Compliance, MaterialModel};
use crate::mesh::{edge_matrix, tet_volume};
use crate::scalar::{Mat3, Real, Vec3};

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
    /// An element that has a vertex twice.
    #[error("{what} has vertex {vertex} twice; give it different ones")]
    SameVertex {
        /// The kind of element.
        what: &'static str,
        /// The vertex given twice.
        vertex: u32,
    },
    /// Not what the kind of element needs.
    #[error("{what} has {expected} {of}, not {given}")]
    Count {
        /// The kind of element.
        what: &'static str,
        /// "constants" or "anchors".
        of: &'static str,
        /// How many were given.
        given: usize,
        /// How many it needs.
        expected: usize,
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
    /// A law of contact that is none.
    #[error("contact between tissues: {complaint}")]
    Contact {
        /// What is wrong with it.
        complaint: &'static str,
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

/// One tetrahedron, as [`Model::tets`] shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tet<S> {
    /// Its vertices.
    pub vertices: [u32; 4],
    /// `Dm^-1` [1/m].
    pub inverse_rest_shape: Mat3<S>,
    /// Rest volume [m^3].
    pub rest_volume: S,
    /// Index into [`Model::materials`].
    pub material: u32,
    /// Its law of tissue.
    pub law: MaterialModel,
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
    /// Vertices of the tetrahedra, and the materials of each, shape [tet_count]. The builder has the same arrays.
    pub(crate) tet_vertices: Arc<Vec<[u32; 4]>>,
    pub(crate) tet_materials: Arc<Vec<u32>>,
    /// The law of each material.
    pub(crate) laws: Vec<MaterialModel>,
    /// Rest positions [m] as they were given.
    pub(crate) places: Arc<Vec<Vec3<f64>>>,
    /// See [`Model::stress_free`]: shapes are computed in double precision where they are asked for.
    pub(crate) stress_free: Arc<Vec<Vec3<f64>>>,
    /// Springs, attachments: all elements that are no tetrahedra.
    pub elements: ElementLists<S>,
    /// Anchors of the elements that have one where nothing moves them [m], in the order in which they were added.
    pub rest_anchors: Vec<Vec3<S>>,
    /// Points of the surface that tools touch.
    pub samples: Arc<Vec<Sample>>,
    /// The surface on which tissue meets tissue; empty where it does not.
    pub(crate) skin: Arc<Skin>,
    /// Which tissue meets which.
    pub(crate) tissue_contact: TissueContact,
    /// Differs from model to model: whoever keeps numbers of vertices, or constants, keeps this beside them, and
    /// compares. Of two models of the same content it is the same.
    pub(crate) revision: u64,
    pub(crate) numbering: Arc<Numbering>,
    /// The connected part of each vertex, and how many there are.
    pub(crate) part_numbers: Vec<u32>,
    pub(crate) part_count: usize,
}

impl<S: Real> Model<S> {
    /// Number of vertices of all bodies.
    pub fn vertex_count(&self) -> usize {
        self.rest_positions.len()
    }

    /// Positions [m] at which no tetrahedron carries stress, shape [vertex_count]: the rest positions, except of bodies
    /// that rest under gravity as they were given.
    pub fn stress_free(&self) -> &[Vec3<f64>] {
        &self.stress_free
    }

    /// Number of tetrahedra of all bodies.
    pub fn tet_count(&self) -> usize {
        self.tet_vertices.len()
    }

    /// The tetrahedra, in the user's order.
    pub fn tets(&self) -> impl ExactSizeIterator<Item = Tet<S>> {
        (0..self.tet_count()).map(|i| self.tet(i))
    }

    /// Number `i` of [`Model::tets`].
    pub(crate) fn tet(&self, i: usize) -> Tet<S> {
        let vertices = self.tet_vertices[i];
        let corners = vertices.map(|v| self.stress_free[v as usize]);
        let material = self.tet_materials[i];
        Tet {
            vertices,
            inverse_rest_shape: edge_matrix(corners).inverse().cast(),
            rest_volume: S::from_f64(tet_volume(corners)),
            material,
            law: self.laws[material as usize],
        }
    }

    /// Young's modulus of the tissue under a sample over the length of the edges there [Pa/m]: contact is as many times
    /// stiffer as its law says.
    pub fn sample_stiffness(&self, sample: &Sample) -> f64 {
        let material = &self.materials[self.tet_materials[sample.tet as usize] as usize];
        let (lambda, mu) = (material.lame_lambda.to_f64(), material.lame_mu.to_f64());
        mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu) / sample.edge
    }

    /// Whether tissue meets other tissue than its own body's, or is tied to it: what not everything computes.
    pub(crate) fn ties_bodies(&self) -> bool {
        let meets = self.tissue_contact.bodies && self.bodies.len() > 1;
        !self.skin.ties.is_empty() || (meets && !self.skin.triangles.is_empty())
    }

    /// Whether tissue meets its own body.
    pub(crate) fn meets_itself(&self) -> bool {
        self.tissue_contact.itself && !self.skin.triangles.is_empty()
    }

    /// The same of each triangle of the skin: the mean of its samples', or of those at its corners.
    pub(crate) fn skin_stiffness(&self) -> Vec<f64> {
        let skin = &self.skin;
        let mut of_points = vec![0.0; skin.points.len()];
        let mut of_triangles = vec![0.0; skin.triangles.len()];
        for (sample, site) in skin.samples.iter().zip(&skin.sites) {
            let stiffness = self.sample_stiffness(sample);
            match *site {
                Site::Triangle(triangle) => of_triangles[triangle as usize] = stiffness,
                Site::Point(point) => of_points[point as usize] = stiffness,
            }
        }
        for (stiffness, triangle) in of_triangles.iter_mut().zip(&skin.triangles) {
            if *stiffness == 0.0 {
                let corners = triangle.map(|point| of_points[point as usize]);
                *stiffness = (corners[0] + corners[1] + corners[2]) / 3.0;
            }
        }
        of_triangles
    }

    /// The same for models of the same content, and another for others.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Number of connected parts: elements connect vertices.
    pub fn part_count(&self) -> usize {
        self.part_count
    }

    /// The number of the part that a vertex belongs to.
    pub fn part_of(&self, vertex: u32) -> usize {
        self.part_numbers[vertex as usize] as usize
    }

    /// See [`Model::revision`]: 64 bits of FNV-1a of everything, word by word.
    fn fingerprint(&self) -> u64 {
        let mut hash = 0xcbf2_9ce4_8422_2325u64;
        let mut add =
            |number: u64| hash = (hash ^ number).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
        for count in [self.bodies.len(), self.masses.len(), self.materials.len(), self.tet_count()]
        {
            add(count as u64);
        }
        let add_all = |add: &mut dyn FnMut(u64), values: &[S]| {
            values.iter().for_each(|value| add(value.to_f64().to_bits()));
        };
        for body in &self.bodies {
            let Body { vertices, tets } = body;
            [vertices.start, vertices.end, tets.start, tets.end]
                .iter()
                .for_each(|&n| add(n as u64));
        }
        for x in self.rest_positions.iter().chain(&self.rest_anchors) {
            add_all(&mut add, &x.to_array());
        }
        add_all(&mut add, &self.masses);
        for material in &self.materials {
            let MaterialConstants { lame_lambda, lame_mu, compliance, viscosity } = *material;
            let Compliance { normal, cross, shear } = compliance;
            add_all(&mut add, &[lame_lambda, lame_mu, normal, cross, shear, viscosity]);
        }
        for (vertices, &material) in self.tet_vertices.iter().zip(&*self.tet_materials) {
            add(material.into());
            vertices.iter().for_each(|&v| add(v.into()));
        }
        self.laws.iter().for_each(|&law| add(law as u64));
        for x in &*self.places {
            x.to_array().into_iter().for_each(|value| add(value.to_bits()));
        }
        if !Arc::ptr_eq(&self.places, &self.stress_free) {
            for x in &*self.stress_free {
                x.to_array().into_iter().for_each(|value| add(value.to_bits()));
            }
        }
        let TissueContact { itself, bodies, law } = self.tissue_contact;
        [itself, bodies].iter().for_each(|&is_on| add(u64::from(is_on)));
        [law.stiffness, law.thickness, law.friction].iter().for_each(|x| add(x.to_bits()));
        self.skin.triangles.as_flattened().iter().for_each(|&point| add(point.into()));
        for tie in &self.skin.ties {
            [tie.sample, tie.triangle, tie.group].iter().for_each(|&number| add(number.into()));
            let numbers =
                tie.weights.iter().chain(&tie.rest).chain([&tie.stiffness, &tie.strength]);
            numbers.for_each(|x| add(x.to_bits()));
        }
        for Sample { vertices, weights, area, edge, tet } in
            self.samples.iter().chain(&self.skin.samples)
        {
            vertices.iter().for_each(|&v| add(v.into()));
            weights.iter().chain([area, edge]).for_each(|value| add(value.to_bits()));
            add((*tet).into());
        }
        for_each_kind!(self, list => {
            add(list.len() as u64);
            list.vertices.as_flattened().iter().for_each(|&v| add(v.into()));
            list.anchors.iter().for_each(|&anchor| add(anchor.into()));
            add_all(&mut add, list.constants.as_flattened());
        });
        hash
    }

    /// Whether nobody has changed it since.
    pub(crate) fn is_as_built(&self) -> bool {
        self.fingerprint() == self.revision
    }

    /// A model without vertices.
    pub(crate) fn nothing() -> Self {
        Self {
            bodies: Vec::new(),
            rest_positions: Vec::new(),
            masses: Vec::new(),
            materials: Vec::new(),
            tet_vertices: Arc::default(),
            tet_materials: Arc::default(),
            laws: Vec::new(),
            places: Arc::default(),
            stress_free: Arc::default(),
            elements: ElementLists::new(&Default::default()),
            rest_anchors: Vec::new(),
            samples: Arc::default(),
            skin: Arc::default(),
            tissue_contact: TissueContact::NONE,
            revision: 0,
            numbering: Arc::default(),
            part_numbers: Vec::new(),
            part_count: 0,
        }
    }

    /// Bytes of the arrays that grow with meshes, springs and attachments.
    pub fn bytes(&self) -> usize {
        self.elements.bytes()
            + size_of_val(&self.tet_vertices[..])
            + size_of_val(&self.tet_materials[..])
            + size_of_val(&self.places[..])
            + size_of_val(&self.rest_anchors[..])
            + size_of_val(&self.samples[..])
            + self.skin.bytes()
            + size_of_val(&self.rest_positions[..])
            + size_of_val(&self.masses[..])
            + size_of_val(&self.numbering.order[..])
            + size_of_val(&self.numbering.rank[..])
            + size_of_val(&self.part_numbers[..])
    }
}
