//! The outer surface of all bodies, on which tissue meets tissue.
//!
//! Samples are the middles of outer triangles or, where a fine surface is embedded in the tetrahedra, its vertices: what is
//! seen is what touches. They meet triangles of other bodies and of their own, but none near by: a triangle whose corners
//! hang on a vertex that an edge of the mesh connects with the sample's own.

use super::ContactLaw;
use super::surface::{Sample, sample_boundary, sample_embedded};
use crate::mesh::SurfaceMesh;
use crate::mesh::embed::Embedding;
use crate::mesh::topology::boundary_faces;
use crate::scalar::Vec3;

/// Which tissue meets which, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissueContact {
    /// Whether a body meets itself.
    pub itself: bool,
    /// Whether bodies meet each other.
    pub bodies: bool,
    /// How: stiffness in units of each tissue's own, of which half the compliance is each's.
    pub law: ContactLaw,
}

impl Default for TissueContact {
    fn default() -> Self {
        let law = ContactLaw { friction: 0.1, ..ContactLaw::default() };
        Self { itself: true, bodies: true, law }
    }
}

impl TissueContact {
    /// No tissue meets tissue.
    pub const NONE: Self = Self {
        itself: false,
        bodies: false,
        law: ContactLaw { stiffness: 10.0, thickness: 1e-3, friction: 0.0 },
    };
}

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinPoint {
    /// The vertices that it hangs on; a weight of zero where it has fewer.
    pub vertices: [u32; 4],
    /// Sum to one.
    pub weights: [f64; 4],
}

/// Where a sample is on the skin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    /// In the middle of a triangle.
    Triangle(u32),
    /// At a point.
    Point(u32),
}

/// A tie: a sample that is bound to a triangle of another body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tie {
    /// The sample's number on the skin.
    pub sample: u32,
    /// The triangle.
    pub triangle: u32,
    /// Barycentric weights of the point that it is bound to.
    pub weights: [f64; 3],
    /// From that point to the sample without force: in terms of the triangle's edges from its first corner, and along its
    /// normal [m].
    pub rest: [f64; 3],
    /// [N/m].
    pub stiffness: f64,
    /// The force [N] at which it tears; infinite where nothing tears it.
    pub strength: f64,
    /// Which of the scene's ties it belongs to.
    pub group: u32,
}

impl Tie {
    /// The triangle's point [m], where its corners are at these places.
    pub fn point(&self, corners: [Vec3<f64>; 3]) -> Vec3<f64> {
        corners.iter().zip(self.weights).fold(Vec3::ZERO, |sum, (x, weight)| sum + *x * weight)
    }

    /// The triangle's normal, and from that point to the sample without force [m].
    pub fn unstretched(&self, corners: [Vec3<f64>; 3]) -> [Vec3<f64>; 2] {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let normal = normal * (1.0 / normal.length());
        let normal = if normal.is_finite() { normal } else { Vec3::ZERO };
        let [on_b, on_c, along] = self.rest;
        [normal, (b - a) * on_b + (c - a) * on_c + normal * along]
    }
}

/// What is near what on a body, by vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// Vertices that an edge connects with each.
    neighbours: Lists,
    /// Vertices that each triangle hangs on.
    corners: Lists,
    /// Triangles around each point.
    around: Lists,
}

/// Lists of numbers, in a row.
#[derive(Clone, Debug, Default, PartialEq)]
struct Lists {
    first: Vec<u32>,
    all: Vec<u32>,
}

impl Lists {
    /// Of pairs of a list's number and an entry.
    fn new(count: usize, mut entries: Vec<(u32, u32)>) -> Self {
        entries.sort_unstable();
        entries.dedup();
        let mut first = vec![0; count + 1];
        entries.iter().for_each(|(list, _)| first[*list as usize + 1] += 1);
        (0..count).for_each(|list| first[list + 1] += first[list]);
        Self { first, all: entries.into_iter().map(|(_, entry)| entry).collect() }
    }

    fn of(&self, list: u32) -> &[u32] {
        let list = list as usize;
        &self.all[self.first[list] as usize..self.first[list + 1] as usize]
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.first[..]) + size_of_val(&self.all[..])
    }
}

impl Topology {
    /// Of a skin on tetrahedra of so many vertices.
    pub fn new(skin: &Skin, tets: &[[u32; 4]], vertex_count: usize) -> Self {
        let bears = |weights: &[f64; 4], i: usize| weights[i] != 0.0;
        let edges = tets.iter().flat_map(|tet| {
            let ends = |&a: &u32| tet.iter().filter(move |&&b| b != a).map(move |&b| (a, b));
            tet.iter().flat_map(ends)
        });
        let corners = (0..).zip(&skin.triangles).flat_map(|(number, triangle)| {
            triangle.iter().flat_map(move |&point| {
                let point = skin.points[point as usize];
                let bearing = (0..4).filter(move |&i| bears(&point.weights, i));
                bearing.map(move |i| (number, point.vertices[i]))
            })
        });
        let around = (0..)
            .zip(&skin.triangles)
            .flat_map(|(number, triangle)| triangle.iter().map(move |&point| (point, number)));
        Self {
            neighbours: Lists::new(vertex_count, edges.collect()),
            corners: Lists::new(skin.triangles.len(), corners.collect()),
            around: Lists::new(skin.points.len(), around.collect()),
        }
    }

    /// Vertices that an edge connects with one.
    pub fn neighbours(&self, vertex: u32) -> &[u32] {
        self.neighbours.of(vertex)
    }

    /// Vertices that a triangle hangs on.
    pub fn corners(&self, triangle: u32) -> &[u32] {
        self.corners.of(triangle)
    }

    /// Triangles around a point.
    pub fn around(&self, point: u32) -> &[u32] {
        self.around.of(point)
    }

    /// How many vertices there are.
    pub fn vertex_count(&self) -> usize {
        self.neighbours.first.len().saturating_sub(1)
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.neighbours.bytes() + self.corners.bytes() + self.around.bytes()
    }
}

/// The outer surface of all bodies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Points of all bodies.
    pub points: Vec<SkinPoint>,
    /// Points of each triangle, wound outwards.
    pub triangles: Vec<[u32; 3]>,
    /// The tetrahedron behind each triangle.
    pub tets: Vec<u32>,
    /// The body of each triangle.
    pub bodies: Vec<u32>,
    /// Samples, body by body.
    pub samples: Vec<Sample>,
    /// Where each is, and on which body.
    pub sites: Vec<Site>,
    /// The body of each sample.
    pub sample_bodies: Vec<u32>,
    /// What distances between two bodies, the lower first, or on one are longer by [m]: where they are closer than the
    /// thickness of contact at rest it begins there. The same everywhere, or what slides would meet a step. Others have none.
    pub shifts: Vec<([u32; 2], f64)>,
    /// Ties between bodies, by sample.
    pub ties: Vec<Tie>,
    pub(crate) topology: Topology,
}

impl Skin {
    /// Adds the outer faces of a body's tetrahedra, which are the last of `tets`: from `first_tet` on; `positions` [m] of all
    /// vertices.
    pub fn add_boundary(
        &mut self,
        body: u32,
        (tets, first_tet): (&[[u32; 4]], u32),
        positions: &[Vec3<f64>],
    ) {
        let own = &tets[first_tet as usize..];
        let faces = boundary_faces(own);
        let mut of_vertex = std::collections::BTreeMap::new();
        for vertex in faces.iter().flat_map(|(_, triangle)| *triangle) {
            of_vertex.entry(vertex).or_insert_with(|| {
                let vertices = [vertex; 4];
                self.points.push(SkinPoint { vertices, weights: [1.0, 0.0, 0.0, 0.0] });
                self.points.len() as u32 - 1
            });
        }
        for (sample, (tet, triangle)) in sample_boundary(own, positions, 0).into_iter().zip(&faces)
        {
            self.sites.push(Site::Triangle(self.triangles.len() as u32));
            self.sample_bodies.push(body);
            self.samples.push(Sample { tet: sample.tet + first_tet, ..sample });
            self.triangles.push(triangle.map(|vertex| of_vertex[&vertex]));
            self.tets.push(tet + first_tet);
            self.bodies.push(body);
        }
    }

    /// Adds a fine surface that is embedded in the tetrahedra of a body, of which the first vertex and tetrahedron have these
    /// numbers; `positions` [m] of all vertices.
    pub fn add_embedded(
        &mut self,
        body: u32,
        (surface, embedding): (&SurfaceMesh, &Embedding),
        (first_vertex, first_tet): (u32, u32),
        positions: &[Vec3<f64>],
    ) {
        let first = self.points.len() as u32;
        let bound = embedding.corners().iter().zip(embedding.weights());
        self.points.extend(bound.map(|(corners, weights)| SkinPoint {
            vertices: corners.map(|v| v + first_vertex),
            weights: *weights,
        }));
        for triangle in &surface.triangles {
            self.triangles.push(triangle.map(|point| point + first));
            self.tets.push(embedding.tets()[triangle[0] as usize] + first_tet);
            self.bodies.push(body);
        }
        let samples = sample_embedded(surface, embedding, positions, first_vertex, first_tet);
        for (point, sample) in samples {
            self.sites.push(Site::Point(point + first));
            self.sample_bodies.push(body);
            self.samples.push(sample);
        }
    }

    /// The same surface with other numbers of vertices.
    pub(crate) fn renumbered(&self, of: impl Fn(u32) -> u32, tets: &[[u32; 4]]) -> Self {
        let mut other = self.clone();
        other.points.iter_mut().for_each(|point| point.vertices = point.vertices.map(&of));
        other.samples.iter_mut().for_each(|sample| sample.vertices = sample.vertices.map(&of));
        let tets: Vec<[u32; 4]> = tets.iter().map(|tet| tet.map(&of)).collect();
        let count = self.topology.vertex_count();
        other.topology = Topology::new(&other, &tets, count);
        other
    }

    /// What distances between two bodies are longer by [m].
    pub fn shift(&self, bodies: [u32; 2]) -> f64 {
        let [a, b] = bodies;
        let place = self.shifts.binary_search_by_key(&[a.min(b), a.max(b)], |(bodies, _)| *bodies);
        place.map_or(0.0, |place| self.shifts[place].1)
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.points[..])
            + size_of_val(&self.triangles[..])
            + size_of_val(&self.tets[..])
            + size_of_val(&self.bodies[..])
            + size_of_val(&self.samples[..])
            + size_of_val(&self.sites[..])
            + size_of_val(&self.sample_bodies[..])
            + size_of_val(&self.shifts[..])
            + size_of_val(&self.ties[..])
            + self.topology.bytes()
    }
}

/// The mean of places of vertices [m] by these weights.
pub(crate) fn mean(vertices: [u32; 4], weights: [f64; 4], positions: &[Vec3<f64>]) -> Vec3<f64> {
    let all = vertices.iter().zip(weights);
    all.fold(Vec3::ZERO, |sum, (&v, weight)| sum + positions[v as usize] * weight)
}
