//! Nested lattices over one connected part: the coarse spaces of an additive preconditioner of several levels.
//!
//! J. H. Bramble, J. E. Pasciak and J. Xu, "Parallel multilevel preconditioners", Mathematics of Computation 55(191),
//! 1990, add the corrections of a sequence of nested spaces. Here they are trilinear functions on cubic lattices laid
//! over the rest shape: the mesh itself needs no hierarchy. (The lattice in `mesh` is another one: it makes meshes.)
//!
//! ```text
//! cell       c = (6 V)^(1/3)                V mean volume of a tetrahedron; a cube of a structured mesh has six
//! spacing    s_0 = 2 c,  s_l = 2^l s_0
//! points     R^T (origin + s_l k)           k >= 0, three whole numbers; R x along the axes of the smallest box
//! weight     w_l(x, k) = hat(x_1 / s_l - k_1) hat(x_2 / s_l - k_2) hat(x_3 / s_l - k_3),   hat(t) = max(0, 1 - |t|)
//! nested     w_(l+1)(x, K) = sum over k of w_l(x, k) hat(k_1 / 2 - K_1) hat(k_2 / 2 - K_2) hat(k_3 / 2 - K_3)
//! ```
//!
//! Points follow connectivity. The vertices with a weight at a point are its support; those that elements tie to each
//! other within it are a component. Each component has its own copy of the point, a node. So the two sides of a cut or
//! of a gap move apart at every level that is fine enough to go around its end. (Nesme, Kry, Jerabkova and Faure,
//! "Preserving topology and elasticity for embedded deformable models", SIGGRAPH 2009, do the same with the cells that
//! they embed a body in.)
//!
//! - Copies keep the spaces nested: a support lies within the supports of its point's parents, and what hangs together
//!   in it does so in theirs, so that each component lies within one component of each parent.
//! - A vertex at the corner of a support, all of whose neighbours happen to lie outside, has a node to itself, which
//!   separates nothing: up to a quarter more nodes where the planes of the lattice run through jittered vertices. To join
//!   what a vertex outside of the support ties together would save them, and join the sides of a cut at its end as well:
//!   a bar of 50,000 tetrahedra cut by 60 % needed half as many iterations more.

mod frame;
mod nodes;
#[cfg(test)]
mod tests;

pub(crate) use nodes::Weights;
use nodes::{Neighbors, Nodes};

use crate::mesh::tet_volume;
use crate::model::{Z_ORDER_BITS, z_order};
use crate::scalar::{Mat3, Vec3};

/// Nested lattices over a connected part. It depends on nothing but the part's own data.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Lattice {
    /// Spacing `[m]` of the finest level; each next one has twice that of the one before. Zero without levels.
    pub spacing: f64,
    /// `R`: its rows are the axes of the lattices.
    axes: Mat3<f64>,
    /// Where the points `[0, 0, 0]` of all levels are along the axes `[m]`: the part's smallest coordinates.
    origin: Vec3<f64>,
    /// From fine to coarse; none for small parts.
    pub levels: Vec<Level>,
}

/// One level of a [`Lattice`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Level {
    /// The lattice point of each node, in spacings of this level from the origin, shape `[node_count]`. Nodes ascend
    /// along a Z-order curve through the points; the copies of one by the smallest vertex of each.
    pub points: Vec<[u32; 3]>,
    /// At most eight nodes of each vertex and its trilinear weights there, which add up to 1, shape `[vertex_count]`.
    pub of_vertices: Weights,
    /// At most eight parents at this level of each node of the next finer one, with weights that are products of
    /// 1 and 1/2 and add up to 1, shape `[finer node_count]`; empty for the finest level.
    pub of_finer: Weights,
}

impl Level {
    /// How many nodes, copies counted.
    pub fn node_count(&self) -> usize {
        self.points.len()
    }
}

impl Lattice {
    /// Builds as many levels as are of use.
    ///
    /// `places`: rest positions `[m]` of the part's vertices; `tets`: their tetrahedra, `links`: pairs of vertices that
    /// other elements tie, both in the part's own numbers. `most_coarse`: the coarsest level has at most so many nodes,
    /// if levels can be made so.
    ///
    /// A level is added while the coarsest has more than `most_coarse` nodes and the next has fewer than it and is
    /// spaced less than twice the part's largest side. A part without tetrahedra has no levels, nor one whose finest
    /// lattice would have half as many nodes as it has vertices, or more.
    pub fn new(
        places: &[Vec3<f64>],
        tets: &[[u32; 4]],
        links: &[[u32; 2]],
        most_coarse: usize,
    ) -> Self {
        let Some(grid) = Grid::new(places, tets) else { return Self::default() };
        let mut coordinates = grid.coordinates(places);
        let neighbors = Neighbors::new(places.len(), tets, links);
        let mut coarsest = Nodes::new(&coordinates, &neighbors);
        if 2 * coarsest.points.len() >= places.len() {
            return Self::default();
        }
        let mut levels = Vec::new();
        let mut of_finer = Weights::default();
        let mut spacing = grid.spacing;
        loop {
            let Nodes { points, first_vertices, of_vertices } = coarsest;
            levels.push(Level { points, of_vertices, of_finer });
            let finer = &levels[levels.len() - 1];
            spacing *= 2.0;
            if finer.node_count() <= most_coarse || spacing >= 2.0 * grid.side {
                break;
            }
            // Halves are exact, so a point's support lies within those of its parents, and weights are nested to
            // round-off, however close to a plane of the lattice a vertex lies.
            coordinates.iter_mut().for_each(|x| *x = *x * 0.5);
            coarsest = Nodes::new(&coordinates, &neighbors);
            if coarsest.points.len() >= finer.node_count() {
                break;
            }
            of_finer = parents(&finer.points, &first_vertices, &coarsest);
        }
        Self { spacing: grid.spacing, axes: grid.axes, origin: grid.origin, levels }
    }

    /// A place `[m]` along the axes from the origin `[m]`.
    pub fn along_axes(&self, place: Vec3<f64>) -> Vec3<f64> {
        self.axes * place - self.origin
    }
}

/// The parents of the nodes at `points`, whose smallest vertices are `first_vertices`, among the nodes of the next level.
fn parents(points: &[[u32; 3]], first_vertices: &[u32], coarser: &Nodes) -> Weights {
    let mut weights = Weights { offsets: vec![0], entries: Vec::new() };
    for (point, &first) in points.iter().zip(first_vertices) {
        // A parent moves all of the node's vertices, so it is among the nodes of any of them, and no other copy of its
        // point is.
        for &(parent, _) in coarser.of_vertices.of(first as usize) {
            let at = coarser.points[parent as usize];
            let weight: f32 = (0..3).map(|axis| weight_of_parent(point[axis], at[axis])).product();
            if weight > 0.0 {
                weights.entries.push((parent, weight));
            }
        }
        weights.offsets.push(weights.entries.len() as u32);
    }
    weights
}

/// `hat(k / 2 - K)`: 1 at the parent's own place, 1/2 beside it.
fn weight_of_parent(k: u32, parent: u32) -> f32 {
    match k.abs_diff(2 * parent) {
        0 => 1.0,
        1 => 0.5,
        _ => 0.0,
    }
}

/// A sort key of each vertex of a part, shape `[vertex_count]`: in its order vertices stand cell by cell of the part's
/// finest lattice along a Z-order curve, within a cell along a finer one. Arguments as in [`Lattice::new`]; cells are
/// those of the finest lattice even where the part is too small for levels. Vertices at one place have the same key.
pub(crate) fn cell_order(places: &[Vec3<f64>], tets: &[[u32; 4]]) -> Vec<u64> {
    let grid = Grid::new(places, tets).unwrap_or_else(|| Grid::one_cell(places));
    let coordinates = grid.coordinates(places);
    // One curve is both, as long as whole numbers of its own cells fill a cell: a power of two along each axis.
    let most = f64::from(1_u32 << Z_ORDER_BITS);
    let mut refinement = 1.0;
    while 2.0 * refinement * (grid.side / grid.spacing + 1.0) < most {
        refinement *= 2.0;
    }
    let along = |x: f64| (x * refinement) as u64;
    coordinates.iter().map(|x| z_order(x.to_array().map(along))).collect()
}

/// Where the points of the finest lattice lie.
struct Grid {
    /// See [`Lattice::axes`].
    axes: Mat3<f64>,
    /// The smallest coordinates of the vertices along the axes `[m]`.
    origin: Vec3<f64>,
    /// The largest side of the part `[m]`.
    side: f64,
    /// `s_0` `[m]`.
    spacing: f64,
}

/// A coordinate so close to a whole number, in spacings, is that number. Coordinates of a structured mesh in single
/// precision are off by some 1e-7 of the part's side, which is tens of spacings; without this a vertex in a plane of the
/// lattice would get nodes beside the plane, with weights of nothing.
const SNAP: f64 = 1e-5;

impl Grid {
    /// Nothing for a part that has no lattice: no tetrahedra, or more cells along an axis than [`z_order`] tells apart.
    fn new(places: &[Vec3<f64>], tets: &[[u32; 4]]) -> Option<Self> {
        let volume: f64 = tets.iter().map(|tet| tet_volume(tet.map(|v| places[v as usize]))).sum();
        let spacing = 2.0 * libm::cbrt(6.0 * volume / tets.len() as f64);
        let grid = Self { spacing, ..Self::one_cell(places) };
        // Two more points than whole spacings, at most. False for what is no number.
        let fits = grid.side / spacing < f64::from((1_u32 << Z_ORDER_BITS) - 2);
        (spacing > 0.0 && fits).then_some(grid)
    }

    /// One cell for the whole part.
    fn one_cell(places: &[Vec3<f64>]) -> Self {
        let axes = frame::axes(places);
        let nothing = (Vec3::splat(f64::INFINITY), Vec3::splat(f64::NEG_INFINITY));
        let extent = |(low, high): (Vec3<f64>, Vec3<f64>), p: Vec3<f64>| (low.min(p), high.max(p));
        let (origin, high) = places.iter().map(|p| axes * *p).fold(nothing, extent);
        let size = high - origin;
        let side = size.x.max(size.y).max(size.z).max(0.0);
        Self { axes, origin, side, spacing: side.max(f64::MIN_POSITIVE) }
    }

    /// Places `[m]` in spacings from the origin, none below zero.
    fn coordinates(&self, places: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let snapped = |x: f64| if (x - x.round()).abs() < SNAP { x.round() } else { x };
        let coordinate = |p: &Vec3<f64>| {
            let x = self.axes * *p - self.origin;
            Vec3::from_f64(x.to_array().map(|x| snapped(x / self.spacing)))
        };
        places.iter().map(coordinate).collect()
    }
}
