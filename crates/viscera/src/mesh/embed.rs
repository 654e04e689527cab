//! A fine surface bound to coarse tetrahedra, so that pictures show the organ and not the mesh.
//!
//! Barycentric embedding: a surface vertex `x` in a tetrahedron with corners `x_i` is
//!
//! ```text
//! x = sum_i w_i x_i,   sum_i w_i = 1,   (w_1, w_2, w_3) = Ds^-1 (x - x_0),   w_0 = 1 - w_1 - w_2 - w_3
//! ```
//!
//! and follows the corners with constant weights. Affine motions are reproduced exactly. A vertex
//! outside every tetrahedron is bound to the nearest one, its weights extrapolated: some are then
//! negative, and how far outside it lies is recorded.

pub use super::nearest::closest_point_on_triangle;
use super::{SurfaceMesh, TetMesh, edge_matrix};
use crate::scalar::{Real, Vec3};

/// Constant weights that make a surface follow tetrahedra.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedding {
    tets: Vec<u32>,
    corners: Vec<[u32; 4]>,
    weights: Vec<[f64; 4]>,
    distances: Vec<f64>,
    tet_vertex_count: usize,
    tolerance: f64,
}

/// Why a surface cannot be bound or moved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EmbeddingError {
    /// There is nothing to bind to.
    #[error("the mesh has no tetrahedra to embed a surface in")]
    NoTets,
    /// A surface vertex is infinite or not a number.
    #[error("surface vertex {vertex} is not finite")]
    NotFinite {
        /// The vertex, counted from 0.
        vertex: usize,
    },
    /// An array of the wrong length.
    #[error("{found} {what}; the embedding was made for {expected}")]
    Length {
        /// What the array holds.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it must have.
        expected: usize,
    },
    /// Other tetrahedra than those that it was made for, as many though their vertices are.
    #[error("surface vertex {vertex} follows a tetrahedron that the body does not have")]
    OtherTets {
        /// The vertex, counted from 0.
        vertex: usize,
    },
}

impl Embedding {
    /// Binds every vertex of a surface to the tetrahedron that holds it, or else to the nearest.
    pub fn new(tets: &TetMesh, surface: &SurfaceMesh) -> Result<Self, EmbeddingError> {
        let tree = TetTree::new(tets).ok_or(EmbeddingError::NoTets)?;
        let count = surface.vertices.len();
        let mut embedding = Self {
            tets: Vec::with_capacity(count),
            corners: Vec::with_capacity(count),
            weights: Vec::with_capacity(count),
            distances: Vec::with_capacity(count),
            tet_vertex_count: tets.vertices().len(),
            tolerance: tree.tolerance,
        };
        for (vertex, &point) in surface.vertices.iter().enumerate() {
            if !point.is_finite() {
                return Err(EmbeddingError::NotFinite { vertex });
            }
            let found = tree.nearest(point);
            embedding.tets.push(found.tet);
            embedding.corners.push(tets.tets()[found.tet as usize]);
            embedding.weights.push(found.weights);
            embedding.distances.push(found.distance);
        }
        Ok(embedding)
    }

    /// The tetrahedron each surface vertex follows, shape `[surface_vertex_count]`.
    pub fn tets(&self) -> &[u32] {
        &self.tets
    }

    /// How many vertices the tetrahedra have.
    pub fn tet_vertex_count(&self) -> usize {
        self.tet_vertex_count
    }

    /// That tetrahedron's vertices, shape `[surface_vertex_count]`.
    pub fn corners(&self) -> &[[u32; 4]] {
        &self.corners
    }

    /// Weights of those vertices, summing to 1, shape `[surface_vertex_count]`.
    pub fn weights(&self) -> &[[f64; 4]] {
        &self.weights
    }

    /// How far outside its tetrahedron each surface vertex lies `[m]`, zero inside, shape
    /// `[surface_vertex_count]`.
    pub fn distances(&self) -> &[f64] {
        &self.distances
    }

    /// The largest distance `[m]` of a surface vertex from the tetrahedra. Extrapolation is exact for
    /// affine motions whatever the distance; beyond about the size of a tetrahedron it exaggerates
    /// bending and twisting, and the surface probably belongs to another mesh or unit.
    pub fn max_distance(&self) -> f64 {
        self.distances.iter().copied().fold(0.0, f64::max)
    }

    /// How many surface vertices lie outside every tetrahedron, by more than round-off.
    pub fn outside_count(&self) -> usize {
        self.distances.iter().filter(|&&distance| distance > self.tolerance).count()
    }

    /// Moves the surface: `tet_positions` `[m]`, shape `[tet_vertex_count]`, to `surface_positions` `[m]`,
    /// shape `[surface_vertex_count]`. Allocates nothing.
    pub fn apply<S: Real>(
        &self,
        tet_positions: &[Vec3<S>],
        surface_positions: &mut [Vec3<S>],
    ) -> Result<(), EmbeddingError> {
        check_length("tetrahedron vertices", tet_positions.len(), self.tet_vertex_count)?;
        check_length("surface vertices", surface_positions.len(), self.weights.len())?;
        let bound = self.corners.iter().zip(&self.weights);
        for (position, (corners, weights)) in surface_positions.iter_mut().zip(bound) {
            // Relative to corner 0: keeps f32 exact far from the origin.
            let origin = tet_positions[corners[0] as usize];
            let mut offset = Vec3::ZERO;
            for i in 1..4 {
                offset += (tet_positions[corners[i] as usize] - origin) * S::from_f64(weights[i]);
            }
            *position = origin + offset;
        }
        Ok(())
    }
}

fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), EmbeddingError> {
    if found == expected { Ok(()) } else { Err(EmbeddingError::Length { what, found, expected }) }
}

/// A tetrahedron near a point.
#[derive(Clone, Copy)]
struct Found {
    tet: u32,
    /// Distance `[m]` to the tetrahedron, zero inside.
    distance: f64,
    weights: [f64; 4],
}

impl Found {
    fn smallest_weight(&self) -> f64 {
        self.weights.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// A box in the tree over tetrahedra.
struct Branch {
    lower: Vec3<f64>,
    upper: Vec3<f64>,
    /// The range of `TetTree::order` below this box.
    first: usize,
    last: usize,
    /// The second child; the first one follows its parent. `None` for a leaf.
    second_child: Option<usize>,
}

/// A tree of boxes over tetrahedra, halved at the median along the longest side.
struct TetTree<'a> {
    mesh: &'a TetMesh,
    order: Vec<u32>,
    branches: Vec<Branch>,
    /// Distances `[m]` closer than this are equal: round-off on the scale of the mesh.
    tolerance: f64,
}

/// Few enough to test one by one, enough to keep the tree small.
const TETS_PER_LEAF: usize = 4;

impl<'a> TetTree<'a> {
    fn new(mesh: &'a TetMesh) -> Option<Self> {
        if mesh.tets().is_empty() {
            return None;
        }
        // Four times the centres: they are compared with each other only.
        let centers: Vec<Vec3<f64>> = (0..mesh.tets().len())
            .map(|tet| mesh.corners(tet).into_iter().fold(Vec3::ZERO, |sum, x| sum + x))
            .collect();
        let order = (0..mesh.tets().len() as u32).collect();
        let mut tree = Self { mesh, order, branches: Vec::new(), tolerance: 0.0 };
        tree.split(&centers, 0, mesh.tets().len());
        let Branch { lower, upper, .. } = tree.branches[0];
        tree.tolerance = 1e-12 * (upper - lower).length();
        Some(tree)
    }

    fn split(&mut self, centers: &[Vec3<f64>], first: usize, last: usize) {
        let corners = |&tet: &u32| self.mesh.corners(tet as usize);
        let everywhere = (Vec3::splat(f64::INFINITY), Vec3::splat(f64::NEG_INFINITY));
        let (lower, upper) = self.order[first..last]
            .iter()
            .flat_map(corners)
            .fold(everywhere, |(low, high), x| (low.min(x), high.max(x)));
        let branch = self.branches.len();
        self.branches.push(Branch { lower, upper, first, last, second_child: None });
        if last - first <= TETS_PER_LEAF {
            return;
        }
        let size = upper - lower;
        // Across the longest side, so that boxes become cubes: a point is near fewer of them.
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        // At the median and not the middle of the box: halves are equal however unevenly tetrahedra lie, so the
        // depth is a logarithm and the stack in `nearest` has a bound. Ties by number, for the same tree everywhere.
        let middle = (last - first) / 2;
        self.order[first..last].select_nth_unstable_by(middle, |&a, &b| {
            let (x, y) = (centers[a as usize][axis], centers[b as usize][axis]);
            x.total_cmp(&y).then(a.cmp(&b))
        });
        // Depth first: the first child stands right behind its parent, only the second needs a place written down.
        self.split(centers, first, first + middle);
        self.branches[branch].second_child = Some(self.branches.len());
        self.split(centers, first + middle, last);
    }

    /// The nearest tetrahedron. Of several at the same distance (a point on a shared face, or
    /// outside nearest to a shared corner) the one that extrapolates least, so that weights stay
    /// small; then the one with the lowest number.
    fn nearest(&self, point: Vec3<f64>) -> Found {
        let mut best: Option<Found> = None;
        // Depth is the logarithm of the number of tetrahedra: 64 is never reached.
        let mut stack = [(0_usize, 0.0_f64); 64];
        stack[0].1 = self.branches[0].distance(point);
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (index, distance) = stack[height];
            // With the tolerance, or boxes at the same distance would be left out by the order of the tree, and not by
            // `is_better`: which tetrahedron a vertex on a shared face follows would depend on rounding.
            if best.is_some_and(|best| distance > best.distance + self.tolerance) {
                continue;
            }
            let branch = &self.branches[index];
            let Some(second) = branch.second_child else {
                for &tet in &self.order[branch.first..branch.last] {
                    let candidate = self.measure(tet, point);
                    if best.is_none_or(|best| self.is_better(&candidate, &best)) {
                        best = Some(candidate);
                    }
                }
                continue;
            };
            // The nearer child is searched first: what it finds leaves out most of the other.
            let mut children = [index + 1, second].map(|c| (c, self.branches[c].distance(point)));
            if children[1].1 > children[0].1 {
                children.swap(0, 1);
            }
            // Last in, first out.
            stack[height..height + 2].copy_from_slice(&children);
            height += 2;
        }
        best.unwrap_or(Found { tet: 0, distance: f64::INFINITY, weights: [1.0, 0.0, 0.0, 0.0] })
    }

    fn is_better(&self, new: &Found, old: &Found) -> bool {
        if (new.distance - old.distance).abs() > self.tolerance {
            return new.distance < old.distance;
        }
        let (new_weight, old_weight) = (new.smallest_weight(), old.smallest_weight());
        new_weight > old_weight || (new_weight == old_weight && new.tet < old.tet)
    }

    fn measure(&self, tet: u32, point: Vec3<f64>) -> Found {
        let corners = self.mesh.corners(tet as usize);
        // Weights of zero and more mean inside. Outside, the distance is to the nearest of all faces: the sign of one
        // weight does not say which face is nearest where tetrahedra are sharp.
        let weights = barycentric_weights(corners, point);
        let distance = if weights.iter().all(|&w| w >= 0.0) {
            0.0
        } else {
            let [a, b, c, d] = corners;
            [[b, c, d], [a, d, c], [a, b, d], [a, c, b]]
                .map(|face| (closest_point_on_triangle(face, point) - point).length())
                .into_iter()
                .fold(f64::INFINITY, f64::min)
        };
        Found { tet, distance, weights }
    }
}

impl Branch {
    /// Distance `[m]` from a point to the box, zero inside.
    fn distance(&self, point: Vec3<f64>) -> f64 {
        (self.lower - point).max(point - self.upper).max(Vec3::ZERO).length()
    }
}

/// Weights of a tetrahedron's corners that sum to 1 and place the point.
pub fn barycentric_weights(corners: [Vec3<f64>; 4], point: Vec3<f64>) -> [f64; 4] {
    let w = edge_matrix(corners).inverse() * (point - corners[0]);
    [1.0 - w.x - w.y - w.z, w.x, w.y, w.z]
}
