//! Nodal domains: a mesh as recovered-gradient tetrahedra work on it ([`crate::elements::recovered`]).
//!
//! A domain is a vertex with those of its tetrahedra that are of one material and hang together by faces. Bodies that
//! touch at a vertex or along an edge only are hinged there: their gradients have nothing to do with each other. Nor
//! have those of two materials, whose gradients jump where stress does not.

use crate::elements::recovered::{RECOVERY, RestFrame, VERTEX_SHARE};
use crate::elements::shape_gradients;
use crate::material::MaterialModel;
use crate::mesh::topology::TET_FACES;
use crate::model::Model;
use crate::scalar::{Mat3, Real, Vec3};

/// Domains of a cluster, at most. More lose what volume does within; fewer lock.
const CLUSTER: usize = 4;

/// A recovered bend counts at most so many times.
const LARGEST_FIT: f64 = 3.0;

/// The constants of the energy, for comparisons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// `alpha`: the share of the energy that counts at vertices.
    pub vertex_share: f64,
    /// `beta`: how much of the recovered bend counts.
    pub recovery: f64,
    /// Whether bulk stiffness above [`crate::elements::recovered::CLUSTERED_ABOVE`] counts per cluster.
    pub clustered: bool,
    /// Whether the recovered bend is fitted to quadratic fields, face by face: averages stand for the middle of a
    /// vertex's tetrahedra, which at the surface and in poor meshes is far from the vertex. Each face keeps one weight
    /// for both sides, so that the patch test is kept.
    pub fitted: bool,
}

impl Smoothing {
    /// The recovered-gradient tetrahedron.
    pub const RECOVERED: Self =
        Self { vertex_share: VERTEX_SHARE, recovery: RECOVERY, clustered: true, fitted: false };

    /// The same with fitted faces: the same stiffness on meshes of any shape, and stiffer where sound ones are turned.
    pub const FITTED: Self = Self { recovery: 0.6, fitted: true, ..Self::RECOVERED };

    /// Averages alone: cheaper, stiffer where thick bodies bend, softer in short waves.
    pub const AVERAGED: Self =
        Self { vertex_share: 0.6, recovery: 0.0, clustered: false, fitted: false };
}

/// Domains of the stable neo-Hookean tetrahedra of a model, with the model's numbers of vertices and tetrahedra.
#[derive(Clone, Debug, PartialEq)]
pub struct Domains<S> {
    /// That of the model.
    pub revision: u64,
    /// What they are made for.
    pub smoothing: Smoothing,
    /// The model's number of each tetrahedron, ascending, shape [tet_count].
    pub tets: Vec<u32>,
    /// Vertices of the tetrahedra, shape [tet_count].
    pub tet_vertices: Vec<[u32; 4]>,
    /// Domains of the tetrahedra's corners, shape [tet_count].
    pub tet_domains: Vec<[u32; 4]>,
    /// The tetrahedra at rest, shape [tet_count].
    pub frames: Vec<RestFrame<S>>,
    /// Rest volumes of the tetrahedra [m^3], shape [tet_count].
    pub tet_volumes: Vec<S>,
    /// The vertex of each domain, ascending, shape [domain_count].
    pub vertices: Vec<u32>,
    /// The material of each domain, an index into [`Model::materials`], shape [domain_count].
    pub materials: Vec<u32>,
    /// `V_n`: a quarter of the tetrahedra's rest volume [m^3], shape [domain_count].
    pub volumes: Vec<S>,
    /// Domain `n` sees vertices `ring_offsets[n] .. ring_offsets[n + 1]` of the next two, shape [domain_count + 1].
    pub ring_offsets: Vec<u32>,
    /// Vertices of a domain's tetrahedra, ascending, itself among them.
    pub ring_vertices: Vec<u32>,
    /// `b_nj` [1/m]: `G_n = sum_j x_j b_nj^T`.
    pub ring_gradients: Vec<Vec3<S>>,
    /// The cluster of each domain, shape [domain_count].
    pub clusters: Vec<u32>,
    /// Rest volumes of the clusters [m^3], shape [cluster_count].
    pub cluster_volumes: Vec<S>,
}

impl<S: Real> Domains<S> {
    /// Of the model's stable neo-Hookean tetrahedra; those of other laws have none.
    pub fn new(model: &Model<S>, smoothing: Smoothing) -> Self {
        Self::cast_from(model, smoothing)
    }

    /// As [`Domains::new`], of a model in any precision.
    pub fn cast_from<M: Real>(model: &Model<M>, smoothing: Smoothing) -> Self {
        let is_of_law = |&tet: &u32| {
            let material = model.tet_materials[tet as usize] as usize;
            model.laws[material] == MaterialModel::StableNeoHookean
        };
        let tets: Vec<u32> = (0..model.tet_count() as u32).filter(is_of_law).collect();
        let corners: Vec<[u32; 4]> =
            tets.iter().map(|&tet| model.tet_vertices[tet as usize]).collect();
        let materials: Vec<u32> =
            tets.iter().map(|&tet| model.tet_materials[tet as usize]).collect();
        let inner = inner_faces(&corners, &materials);
        let (tet_domains, vertices) = number_domains(&corners, &inner);
        let weight = smoothing.recovery * 3.0 / 8.0;
        let shapes: Vec<Shape> = corners
            .iter()
            .map(|tet| Shape::new(tet.map(|v| model.stress_free[v as usize])))
            .collect();
        let domain_volumes = volumes_of_domains(&tet_domains, &shapes, vertices.len());
        let mut domain_materials = vec![0; vertices.len()];
        for (domains, &material) in tet_domains.iter().zip(&materials) {
            domains.iter().for_each(|&n| domain_materials[n as usize] = material);
        }
        let mut rings = Rings::new(&corners, &tet_domains, vertices.len());
        rings.find_gradients(&corners, &tet_domains, &shapes, &domain_volumes);
        let mut face_weights = vec![[0.0; 4]; corners.len()];
        for sides in &inner {
            let fit = match smoothing.fitted {
                true => rings.fit(sides[0], &corners, &tet_domains, &model.stress_free),
                false => 1.0,
            };
            for [tet, face] in sides {
                face_weights[*tet as usize][*face as usize] = fit * weight;
            }
        }
        let places: Vec<Vec3<f64>> = vertices.iter().map(|&v| model.places[v as usize]).collect();
        let (clusters, order) = cluster(&tet_domains, &places);
        let cluster_volumes = volumes_of_clusters(&clusters, order, &domain_volumes);
        let cast = |v: Vec3<f64>| v.cast();
        let frames = shapes.iter().zip(&face_weights).map(|(shape, weights)| RestFrame {
            gradients: shape.gradients.map(cast),
            arms: shape.arms.map(cast),
            face_weights: weights.map(S::from_f64),
        });
        Self {
            revision: model.revision,
            smoothing,
            frames: frames.collect(),
            tet_volumes: shapes.iter().map(|shape| S::from_f64(shape.volume)).collect(),
            tets,
            tet_vertices: corners,
            tet_domains,
            vertices,
            materials: domain_materials,
            volumes: domain_volumes.into_iter().map(S::from_f64).collect(),
            ring_offsets: rings.offsets,
            ring_vertices: rings.vertices,
            ring_gradients: rings.gradients.into_iter().map(cast).collect(),
            clusters,
            cluster_volumes: cluster_volumes.into_iter().map(S::from_f64).collect(),
        }
    }

    /// The same domains with no stress at other places [m], shape [vertex_count]. Faces stay fitted to where they were.
    pub(crate) fn with_stress_free(mut self, places: &[Vec3<f64>]) -> Self {
        let corners = &self.tet_vertices;
        let shapes: Vec<Shape> =
            corners.iter().map(|tet| Shape::new(tet.map(|v| places[v as usize]))).collect();
        let domain_volumes = volumes_of_domains(&self.tet_domains, &shapes, self.vertices.len());
        let mut rings = Rings {
            offsets: std::mem::take(&mut self.ring_offsets),
            vertices: std::mem::take(&mut self.ring_vertices),
            gradients: Vec::new(),
        };
        rings.find_gradients(corners, &self.tet_domains, &shapes, &domain_volumes);
        let cluster_volumes =
            volumes_of_clusters(&self.clusters, 0..self.clusters.len(), &domain_volumes);
        let cast = |v: Vec3<f64>| v.cast();
        for (frame, shape) in self.frames.iter_mut().zip(&shapes) {
            (frame.gradients, frame.arms) = (shape.gradients.map(cast), shape.arms.map(cast));
        }
        self.tet_volumes = shapes.iter().map(|shape| S::from_f64(shape.volume)).collect();
        self.volumes = domain_volumes.into_iter().map(S::from_f64).collect();
        (self.ring_offsets, self.ring_vertices) = (rings.offsets, rings.vertices);
        self.ring_gradients = rings.gradients.into_iter().map(cast).collect();
        self.cluster_volumes = cluster_volumes.into_iter().map(S::from_f64).collect();
        self
    }

    /// Number of domains.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// True where no tetrahedron is of the law.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// `G_n` of places `x` [m]; differences to the domain's own vertex keep the digits.
    #[inline(always)]
    pub fn gradient(&self, n: usize, x: &[Vec3<S>]) -> Mat3<S> {
        let origin = x[self.vertices[n] as usize];
        let mut gradient = Mat3::ZERO;
        for i in self.ring(n) {
            let edge = x[self.ring_vertices[i] as usize] - origin;
            gradient = gradient + Mat3::outer(edge, self.ring_gradients[i]);
        }
        gradient
    }

    /// Where a domain's vertices and gradients stand in the rings.
    #[inline(always)]
    pub fn ring(&self, n: usize) -> std::ops::Range<usize> {
        self.ring_offsets[n] as usize..self.ring_offsets[n + 1] as usize
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.tets[..])
            + size_of_val(&self.tet_vertices[..])
            + size_of_val(&self.tet_domains[..])
            + size_of_val(&self.frames[..])
            + size_of_val(&self.tet_volumes[..])
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.materials[..])
            + size_of_val(&self.volumes[..])
            + size_of_val(&self.ring_offsets[..])
            + size_of_val(&self.ring_vertices[..])
            + size_of_val(&self.ring_gradients[..])
            + size_of_val(&self.clusters[..])
            + size_of_val(&self.cluster_volumes[..])
    }
}

/// A tetrahedron at rest in double precision.
struct Shape {
    gradients: [Vec3<f64>; 4],
    arms: [Vec3<f64>; 4],
    volume: f64,
}

impl Shape {
    fn new(corners: [Vec3<f64>; 4]) -> Self {
        let inverse = crate::mesh::edge_matrix(corners).inverse();
        let [a, b, c, d] = corners;
        // From a corner, so that a far-off place costs no digits.
        let centroid = a + ((b - a) + (c - a) + (d - a)) * 0.25;
        Self {
            gradients: shape_gradients(&inverse),
            arms: corners.map(|x| x - centroid),
            volume: crate::mesh::tet_volume(corners),
        }
    }
}

/// Faces between two tetrahedra of one material that lie on either side of it, as `[tet, face]` of both. Faces that
/// more tetrahedra have, or two on the same side, are no such faces: nothing opposite balances what they add.
fn inner_faces(tets: &[[u32; 4]], materials: &[u32]) -> Vec<[[u32; 2]; 2]> {
    let mut sides: Vec<([u32; 3], bool, [u32; 2])> = Vec::with_capacity(4 * tets.len());
    for (tet, corners) in (0..).zip(tets) {
        for (face, local) in (0..).zip(&TET_FACES) {
            let [a, b, c] = local.map(|corner| corners[corner]);
            let mut key = [a, b, c];
            key.sort_unstable();
            // Rotations of three ascending numbers wind as they do; the other orders the other way.
            let ascends = key == [a, b, c] || key == [b, c, a] || key == [c, a, b];
            sides.push((key, ascends, [tet, face]));
        }
    }
    sides.sort_unstable();
    let groups = sides.chunk_by(|a, b| a.0 == b.0);
    let inner = groups.filter_map(|group| match group {
        [(_, a_ascends, a), (_, b_ascends, b)] => {
            let same = materials[a[0] as usize] == materials[b[0] as usize];
            (same && a_ascends != b_ascends).then_some([*a, *b])
        }
        _ => None,
    });
    inner.collect()
}

/// The domains of each tetrahedron's corners, and the vertex of each domain: corners of two tetrahedra at a vertex are
/// one where an inner face connects them. Domains are numbered by vertex, then by their first tetrahedron.
fn number_domains(tets: &[[u32; 4]], inner: &[[[u32; 2]; 2]]) -> (Vec<[u32; 4]>, Vec<u32>) {
    // A forest of corners in which every root is the lowest of its tree.
    let mut parent: Vec<u32> = (0..4 * tets.len() as u32).collect();
    for [[a, face], [b, _]] in inner {
        for corner in TET_FACES[*face as usize] {
            let vertex = tets[*a as usize][corner];
            let other = tets[*b as usize].iter().position(|&v| v == vertex).unwrap_or(0);
            let a = root(&mut parent, 4 * a + corner as u32);
            let b = root(&mut parent, 4 * b + other as u32);
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let vertex_of = |slot: u32| tets[slot as usize / 4][slot as usize % 4];
    let mut roots: Vec<u32> =
        (0..parent.len() as u32).filter(|&slot| parent[slot as usize] == slot).collect();
    roots.sort_unstable_by_key(|&slot| (vertex_of(slot), slot));
    let mut number = vec![0; parent.len()];
    for (n, &slot) in (0..).zip(&roots) {
        number[slot as usize] = n;
    }
    let of_corner = |slot: u32, parent: &mut [u32]| number[root(parent, slot) as usize];
    let domains = (0..tets.len() as u32)
        .map(|tet| [0, 1, 2, 3].map(|corner| of_corner(4 * tet + corner, &mut parent)))
        .collect();
    (domains, roots.into_iter().map(vertex_of).collect())
}

fn root(parent: &mut [u32], mut slot: u32) -> u32 {
    while parent[slot as usize] != slot {
        let above = parent[parent[slot as usize] as usize];
        parent[slot as usize] = above;
        slot = above;
    }
    slot
}

/// Gradients of the domains as sums over vertices, one domain after the other.
struct Rings {
    offsets: Vec<u32>,
    vertices: Vec<u32>,
    gradients: Vec<Vec3<f64>>,
}

impl Rings {
    /// Which vertices each domain sees; gradients are to be found.
    fn new(tets: &[[u32; 4]], tet_domains: &[[u32; 4]], count: usize) -> Self {
        let mut seen: Vec<(u32, u32)> = Vec::with_capacity(16 * tets.len());
        for (domains, tet) in tet_domains.iter().zip(tets) {
            domains.iter().for_each(|&n| seen.extend(tet.map(|v| (n, v))));
        }
        seen.sort_unstable();
        seen.dedup();
        let mut offsets = vec![0; count + 1];
        seen.iter().for_each(|&(n, _)| offsets[n as usize + 1] += 1);
        (0..count).for_each(|n| offsets[n + 1] += offsets[n]);
        let vertices = seen.into_iter().map(|(_, v)| v).collect();
        Self { offsets, vertices, gradients: Vec::new() }
    }

    /// `b_nj = (1/V_n) sum_t V_t/4 g_tj`.
    fn find_gradients(
        &mut self,
        tets: &[[u32; 4]],
        tet_domains: &[[u32; 4]],
        shapes: &[Shape],
        volumes: &[f64],
    ) {
        self.gradients.clear();
        self.gradients.resize(self.vertices.len(), Vec3::ZERO);
        for ((tet, domains), shape) in tets.iter().zip(tet_domains).zip(shapes) {
            for &n in domains {
                let share = 0.25 * shape.volume / volumes[n as usize];
                let first = self.offsets[n as usize] as usize;
                let ring = &self.vertices[first..self.offsets[n as usize + 1] as usize];
                for (v, gradient) in tet.iter().zip(shape.gradients) {
                    // The ring has all vertices of the domain's tetrahedra.
                    if let Ok(place) = ring.binary_search(v) {
                        self.gradients[first + place] += gradient * share;
                    }
                }
            }
        }
    }

    /// By what the recovered bend of a face must be multiplied to be, in the least squares over all quadratic fields,
    /// the field's own: `k_o` with the recovered gradients of `x_j x_k` at the face's corners, and with the exact ones.
    fn fit(
        &self,
        [tet, face]: [u32; 2],
        tets: &[[u32; 4]],
        tet_domains: &[[u32; 4]],
        places: &[Vec3<f64>],
    ) -> f64 {
        let face = TET_FACES[face as usize];
        let at = |vertex: u32| places[vertex as usize];
        let [a, b, c] = face.map(|corner| at(tets[tet as usize][corner]));
        let center = (a + b + c) * (1.0 / 3.0);
        let (mut product, mut square) = (0.0, 0.0);
        for (j, k) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
            let field = |x: Vec3<f64>| (x - center)[j] * (x - center)[k];
            let (mut recovered, mut exact) = (0.0, 0.0);
            for corner in face {
                let arm = at(tets[tet as usize][corner]) - center;
                let n = tet_domains[tet as usize][corner] as usize;
                let ring = self.offsets[n] as usize..self.offsets[n + 1] as usize;
                let mut gradient = Vec3::ZERO;
                for i in ring {
                    gradient += self.gradients[i] * field(at(self.vertices[i]));
                }
                recovered += gradient.dot(arm);
                exact += 2.0 * arm[j] * arm[k];
            }
            // Fields of two axes stand for two: the sum does not depend on the axes.
            let weight = if j == k { 1.0 } else { 2.0 };
            product += weight * recovered * exact;
            square += weight * recovered * recovered;
        }
        if square > 0.0 { (product / square).clamp(0.0, LARGEST_FIT) } else { 1.0 }
    }
}

/// A quarter of each tetrahedron's volume [m^3].
fn volumes_of_domains(tet_domains: &[[u32; 4]], shapes: &[Shape], count: usize) -> Vec<f64> {
    let mut volumes = vec![0.0; count];
    for (domains, shape) in tet_domains.iter().zip(shapes) {
        domains.iter().for_each(|&n| volumes[n as usize] += 0.25 * shape.volume);
    }
    volumes
}

/// Sums of their domains' [m^3], added up in an order.
fn volumes_of_clusters(
    clusters: &[u32],
    order: impl IntoIterator<Item = usize>,
    volumes: &[f64],
) -> Vec<f64> {
    let count = clusters.iter().max().map_or(0, |last| *last as usize + 1);
    let mut sums = vec![0.0; count];
    for n in order {
        sums[clusters[n] as usize] += volumes[n];
    }
    sums
}

/// Clusters of up to [`CLUSTER`] domains that share tetrahedra: each domain that is still free, in order, takes the
/// nearest free ones beside it. Returns the cluster of each domain, and the order in which they were taken.
fn cluster(tet_domains: &[[u32; 4]], places: &[Vec3<f64>]) -> (Vec<u32>, Vec<usize>) {
    let mut pairs: Vec<[u32; 2]> = Vec::with_capacity(12 * tet_domains.len());
    for domains in tet_domains {
        for &a in domains {
            pairs.extend(domains.iter().filter(|&&b| b != a).map(|&b| [a, b]));
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    const FREE: u32 = u32::MAX;
    let mut clusters = vec![FREE; places.len()];
    let (mut number, mut order) = (0, Vec::with_capacity(places.len()));
    for beside in pairs.chunk_by(|a, b| a[0] == b[0]) {
        let n = beside[0][0] as usize;
        if clusters[n] != FREE {
            continue;
        }
        let mut near: Vec<(f64, usize)> = beside
            .iter()
            .map(|&[_, m]| m as usize)
            .filter(|&m| clusters[m] == FREE)
            .map(|m| ((places[m] - places[n]).length_squared(), m))
            .collect();
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let members = near.iter().take(CLUSTER - 1).map(|&(_, m)| m);
        for m in std::iter::once(n).chain(members) {
            clusters[m] = number;
            order.push(m);
        }
        number += 1;
    }
    (clusters, order)
}
