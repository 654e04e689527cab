//! Fills a signed distance function with tetrahedra of proved quality.
//!
//! Isosurface stuffing, uniform variant: F. Labelle and J. R. Shewchuk, "Isosurface Stuffing: Fast
//! Tetrahedral Meshes with Good Dihedral Angles", SIGGRAPH 2007.
//!
//! 1. Lay a body-centred cubic lattice over the shape: two interlaced grids of cubes. Its *long*
//!    edges (length 1) join neighbours of one grid, its *short* edges (length sqrt(3)/2) join a
//!    cube's centre with its corners. Four lattice vertices around a long edge and its opposite
//!    long edge form a tetrahedron; all are congruent.
//! 2. Find the sign of the function at each lattice vertex, and a cut point, where the function is
//!    zero, on each edge whose ends have opposite signs.
//! 3. Warp: a vertex with a cut point nearer than `alpha` times that edge's length moves onto
//!    the nearest such cut point. It is then on the surface, and its edges are no longer cut.
//! 4. Fill each lattice tetrahedron by a stencil that depends only on the four signs.
//!
//! Every vertex of the resulting boundary lies on the zero set, and all dihedral angles keep to
//! [`DIHEDRAL_BOUNDS_DEG`], whatever the function.

pub(super) mod error;
mod grading;

use self::grading::Grading;
use super::distance::SignedDistance;
use super::lattice::{Corner, Lattice, Sign};
use super::topology::{TET_FACES, connected_components, count_open_edges};
use super::{SurfaceMesh, TetMesh, boundary_surface};
use crate::scalar::Vec3;
pub use error::{MAX_LATTICE_VERTICES, TetrahedralizeError};

#[cfg(test)]
mod stencil_tests;

/// Smallest and largest dihedral angle `[degrees]` of any mesh that [`tetrahedralize`] makes.
///
/// The angles depend only on the signs, cut points and warps of one lattice tetrahedron, a bounded
/// set: the paper proves 10.7 and 164.8 for its choice of thresholds, a test here enumerates the set
/// for the two below.
pub const DIHEDRAL_BOUNDS_DEG: (f64, f64) = (10.78, 164.71);

/// The report of a [`tetrahedralize`] call, beside the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TetrahedralizeReport {
    /// Lattice vertices where the function was evaluated.
    pub lattice_vertices: usize,
    /// Lattice vertices that moved onto the surface.
    pub warped_vertices: usize,
    /// Parts that share no vertex. More than the shape has: the spacing does not resolve it.
    pub components: usize,
    /// Boundary edges not shared by exactly two boundary triangles. Not zero: two sheets of the
    /// surface touch, because the spacing does not resolve the gap or the wall between them.
    pub non_manifold_edges: usize,
}

/// How long edges are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// The edge of the lattice's cubes at the surface [m], where edges are a little shorter.
    pub surface: f64,
    /// How often it doubles towards the inside, where there is room for that: 0 keeps it the same everywhere.
    pub doublings: u32,
}

impl From<f64> for Spacing {
    /// The same everywhere.
    fn from(surface: f64) -> Self {
        Self { surface, doublings: 0 }
    }
}

/// Fills a shape with tetrahedra.
///
/// `spacing` is the edge length of the lattice's cubes [m], and of the longest edges in the
/// interior; one cube of the interior holds 12 tetrahedra. A [`Spacing`] lets cubes grow inwards, and keeps the bounds of
/// angles. All tetrahedra get region 0. The same arguments give the same bits, on every machine.
pub fn tetrahedralize(
    shape: &dyn SignedDistance,
    spacing: impl Into<Spacing>,
) -> Result<(TetMesh, TetrahedralizeReport), TetrahedralizeError> {
    let filling = Filling::of_something(shape, spacing.into(), Extent::Whole)?;
    let mut report = TetrahedralizeReport {
        lattice_vertices: filling.lattice_vertices,
        warped_vertices: filling.warped_vertices,
        components: 0,
        non_manifold_edges: count_open_edges(&filling.surface()),
    };
    let regions = vec![0; filling.tets.len()];
    let (mesh, _) = TetMesh::new(filling.vertices, filling.tets, regions)?;
    report.components = connected_components(&mesh).count;
    Ok((mesh, report))
}

/// [`tetrahedralize_to`] stops at this relative error of the volume,
const NEAR_ENOUGH: f64 = 2e-3;
/// or after this number of meshes.
const MOST_MESHES: usize = 5;

/// Fills a shape so that the tetrahedra have a volume [m^3]: on their own they lie below a convex surface, the more the
/// coarser they are. `shape` is the shape whose surface lies so much [m] further out, of which some tenths of the
/// spacing are asked for; vertices of the boundary lie on that. As near as it comes where the volume is not reached.
pub fn tetrahedralize_to<Shape: SignedDistance>(
    shape: impl Fn(f64) -> Shape,
    spacing: impl Into<Spacing>,
    volume: f64,
) -> Result<(TetMesh, TetrahedralizeReport), TetrahedralizeError> {
    let spacing = spacing.into();
    let mut out = 0.0;
    let mut best = tetrahedralize(&shape(out), spacing)?;
    let off = |mesh: &TetMesh| (mesh.volume() / volume - 1.0).abs();
    for _ in 1..MOST_MESHES {
        if off(&best.0) <= NEAR_ENOUGH {
            break;
        }
        // A layer as thick as that over all of the boundary has what is missing.
        let area = boundary_surface(&best.0).surface.area();
        out += (volume - best.0.volume()) / area;
        let next = tetrahedralize(&shape(out), spacing)?;
        if off(&next.0) >= off(&best.0) {
            break;
        }
        best = next;
    }
    Ok(best)
}

/// A closed triangle surface of a shape: the boundary of its tetrahedra, every vertex on the zero
/// set. `spacing` `[m]` as for [`tetrahedralize`]; most triangle edges are a little shorter.
pub fn surface(
    shape: &dyn SignedDistance,
    spacing: f64,
) -> Result<SurfaceMesh, TetrahedralizeError> {
    Ok(Filling::of_something(shape, spacing.into(), Extent::Skin)?.surface())
}

/// How much of a shape is filled.
#[derive(Clone, Copy, PartialEq)]
enum Extent {
    /// All of it.
    Whole,
    /// Only lattice tetrahedra that can have a face on the surface.
    Skin,
}

/// Tetrahedra in the making.
struct Filling {
    /// Positions `[m]`, shape `[vertex_count]`.
    vertices: Vec<Vec3<f64>>,
    /// True for cut points and for lattice vertices on the surface, shape `[vertex_count]`.
    on_surface: Vec<bool>,
    /// Vertex indices, positively wound, shape `[tet_count]`.
    tets: Vec<[u32; 4]>,
    lattice_vertices: usize,
    warped_vertices: usize,
}

const NO_VERTEX: u32 = u32::MAX;

/// Where the search for a spacing that finds the shape gives up: halvings of the given spacing.
const SEARCH_HALVINGS: usize = 10;
/// And the size of lattice `[vertices]` that it tries, a fraction of a second each.
const SEARCH_LATTICE_VERTICES: usize = 1_000_000;

impl Filling {
    /// A filling that is not empty. The error of an empty one names a spacing that was tried.
    fn of_something(
        shape: &dyn SignedDistance,
        spacing: Spacing,
        extent: Extent,
    ) -> Result<Self, TetrahedralizeError> {
        let filling = Self::new(shape, spacing, extent)?;
        if !filling.tets.is_empty() {
            return Ok(filling);
        }
        // Empty: the shape lies between lattice vertices. The error names a spacing that was seen to work, since a
        // guess from the bounds would fail for thin shells. The lattice is bounded, so that this ends in seconds.
        let (lower, upper) = shape.bounds();
        let size = (upper - lower).to_array();
        let (spacing, mut suggestion) = (spacing.surface, spacing.surface);
        for _ in 0..SEARCH_HALVINGS {
            suggestion *= 0.5;
            if Lattice::around(shape, suggestion)?.vertex_count() > SEARCH_LATTICE_VERTICES {
                break;
            }
            if !Self::new(shape, suggestion.into(), extent)?.tets.is_empty() {
                return Err(TetrahedralizeError::TooCoarse { spacing, size, suggestion });
            }
        }
        Err(TetrahedralizeError::Empty)
    }

    fn new(
        shape: &dyn SignedDistance,
        spacing: Spacing,
        extent: Extent,
    ) -> Result<Self, TetrahedralizeError> {
        // Warping comes before filling: a stencil sees final signs only, so that all tetrahedra at a vertex agree on
        // whether it is on the surface.
        let mut lattice = Lattice::sample(shape, spacing.surface)?;
        let warped_vertices = lattice.warp();
        let mut builder = Builder {
            lattice_index: vec![NO_VERTEX; lattice.vertex_count()],
            cut_index: vec![NO_VERTEX; lattice.cut_count()],
            lattice: &lattice,
            vertices: Vec::new(),
            on_surface: Vec::new(),
            tets: Vec::new(),
        };
        let is_wanted =
            |corners: &[Corner; 4]| extent == Extent::Whole || may_touch_surface(corners);
        let mut fill = |corners| {
            if is_wanted(&corners) {
                builder.fill(corners);
            }
        };
        if spacing.doublings > 0 {
            let grading = Grading::new(&lattice, spacing.doublings);
            lattice.for_each_tet(|cube| grading.is_fine(cube), &mut fill);
            grading.for_each_tet(&lattice, fill);
        } else {
            lattice.for_each_tet(|_| true, fill);
        }
        let Builder { vertices, on_surface, tets, .. } = builder;
        let lattice_vertices = lattice.vertex_count();
        Ok(Self { vertices, on_surface, tets, lattice_vertices, warped_vertices })
    }

    /// The boundary: faces that belong to one tetrahedron only, wound outwards.
    fn surface(&self) -> SurfaceMesh {
        let mut faces = Vec::new();
        for tet in &self.tets {
            for face in TET_FACES {
                let face = face.map(|corner| tet[corner]);
                // Only these can be on the boundary: it lies on the zero set.
                if face.iter().all(|&v| self.on_surface[v as usize]) {
                    let mut key = face;
                    key.sort_unstable();
                    faces.push((key, face));
                }
            }
        }
        // Equal faces stand side by side then, in an order that depends on vertex numbers alone: triangles come out
        // the same on every machine, which a hash map would not promise.
        faces.sort_unstable();
        let single = faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1);
        let mut surface_index = vec![NO_VERTEX; self.vertices.len()];
        let mut surface = SurfaceMesh::default();
        for same in single {
            let triangle = same[0].1.map(|vertex| {
                let index = &mut surface_index[vertex as usize];
                if *index == NO_VERTEX {
                    *index = surface.vertices.len() as u32;
                    surface.vertices.push(self.vertices[vertex as usize]);
                }
                *index
            });
            surface.triangles.push(triangle);
        }
        surface
    }
}

/// True if filling this lattice tetrahedron can leave a face on the surface.
fn may_touch_surface(corners: &[Corner; 4]) -> bool {
    let count = |sign| corners.iter().filter(|corner| corner.sign == sign).count();
    count(Sign::Outside) > 0 || count(Sign::Surface) >= 3
}

/// Step 4: the stencils.
struct Builder<'a> {
    lattice: &'a Lattice<'a>,
    /// Mesh vertex of a lattice vertex.
    lattice_index: Vec<u32>,
    /// Mesh vertex of a cut point.
    cut_index: Vec<u32>,
    vertices: Vec<Vec3<f64>>,
    on_surface: Vec<bool>,
    tets: Vec<[u32; 4]>,
}

impl Builder<'_> {
    /// Fills one lattice tetrahedron according to the signs at its corners.
    fn fill(&mut self, corners: [Corner; 4]) {
        // Inside before surface before outside: of 81 patterns of signs only their counts remain. Which of two inner
        // corners is p does not matter, since `diagonal_leaves_first` gives the same diagonal for both orders.
        let mut ordered = corners;
        ordered.sort_by_key(|corner| match corner.sign {
            Sign::Inside => 0,
            Sign::Surface => 1,
            Sign::Outside => 2,
        });
        let count = |sign| corners.iter().filter(|corner| corner.sign == sign).count();
        let [p, q, r, s] = ordered;
        match (count(Sign::Inside), count(Sign::Outside)) {
            // Also four corners on the surface: no sign says that there is tissue between them.
            (0, _) => {}
            // Nothing outside: the tetrahedron itself, with a face on the surface where three corners are.
            (_, 0) => {
                let tet = ordered.map(|corner| self.vertex(corner));
                self.push(tet);
            }
            // One corner inside: the tetrahedron shrinks towards it.
            (1, _) => {
                let apex = self.vertex(p);
                let base = [q, r, s].map(|other| match other.sign {
                    Sign::Outside => self.cut(p, other),
                    _ => self.vertex(other),
                });
                self.push([apex, base[0], base[1], base[2]]);
            }
            // A pyramid: the corner on the surface over the quadrilateral that is cut from the face p, q, s. Its
            // diagonal follows from the face alone: the tetrahedron on the other side has to find the same one.
            (2, 1) => {
                let (near, far) = ([p, q].map(|v| self.vertex(v)), [p, q].map(|v| self.cut(v, s)));
                let apex = self.vertex(r);
                for [a, b, c] in split_quad(near, far, diagonal_leaves_first(p, q, s)) {
                    self.push([apex, a, b, c]);
                }
            }
            // Two outside: a prism between the triangles at p and at q. Sides 0 and 2 lie in lattice faces, side 1
            // on the surface. Side 2 runs from the cut points at s back to p and q, the other way round than
            // `diagonal_leaves_first` counts, so that its diagonal is the negation of that for p, q, s.
            (2, _) => {
                let first = [self.vertex(p), self.cut(p, r), self.cut(p, s)];
                let second = [self.vertex(q), self.cut(q, r), self.cut(q, s)];
                // By the rules of `diagonal_leaves_first` the two lattice faces never both use
                // the same inner corner, so the diagonal on the surface has no choice left.
                let toward_r = diagonal_leaves_first(p, q, r);
                debug_assert_ne!(toward_r, diagonal_leaves_first(p, q, s));
                self.push_prism(first, second, [toward_r, !toward_r, toward_r]);
            }
            // Three inside, one outside: a prism below the triangle of cut points, all its sides in lattice faces.
            _ => {
                let inner = [p, q, r].map(|v| self.vertex(v));
                let outer = [p, q, r].map(|v| self.cut(v, s));
                let diagonals =
                    [(p, q), (q, r), (r, p)].map(|(a, b)| diagonal_leaves_first(a, b, s));
                self.push_prism(inner, outer, diagonals);
            }
        }
    }

    /// Splits a triangular prism into three tetrahedra. Where `diagonals[i]` is true, the side between
    /// edges `i` and `i + 1` is split from `top[i]` to `bottom[i + 1]`, else from `top[i + 1]` to
    /// `bottom[i]`; they must not all agree, since such a prism has no splitting.
    fn push_prism(&mut self, top: [u32; 3], bottom: [u32; 3], diagonals: [bool; 3]) {
        // Of diagonals that do not all agree, two end in some corner of the prism: that is the apex. It makes one
        // tetrahedron with the triangle opposite, two with the one side that does not contain it.
        for i in 0..3 {
            let (next, last) = ((i + 1) % 3, (i + 2) % 3);
            let (apex, end, near, far, leaves_first) = if diagonals[i] && !diagonals[last] {
                let near = [top[next], top[last]];
                (top[i], bottom, near, [bottom[next], bottom[last]], diagonals[next])
            } else if !diagonals[i] && diagonals[last] {
                let near = [bottom[next], bottom[last]];
                (bottom[i], top, near, [top[next], top[last]], !diagonals[next])
            } else {
                continue;
            };
            self.push([apex, end[0], end[1], end[2]]);
            for [a, b, c] in split_quad(near, far, leaves_first) {
                self.push([apex, a, b, c]);
            }
            return;
        }
    }

    /// Adds a tetrahedron, wound to positive volume.
    fn push(&mut self, mut tet: [u32; 4]) {
        if super::tet_volume(tet.map(|v| self.vertices[v as usize])) < 0.0 {
            tet.swap(2, 3);
        }
        self.tets.push(tet);
    }

    fn vertex(&mut self, corner: Corner) -> u32 {
        let index = &mut self.lattice_index[corner.id as usize];
        if *index == NO_VERTEX {
            *index = self.vertices.len() as u32;
            self.vertices.push(self.lattice.position(corner.id));
            self.on_surface.push(corner.sign == Sign::Surface);
        }
        *index
    }

    fn cut(&mut self, inside: Corner, outside: Corner) -> u32 {
        let cut = self.lattice.find_cut(inside.id, outside.id);
        let index = &mut self.cut_index[cut];
        if *index == NO_VERTEX {
            *index = self.vertices.len() as u32;
            self.vertices.push(self.lattice.cut_position(cut));
            self.on_surface.push(true);
        }
        *index
    }
}

/// The two triangles of a quadrilateral `near[0], near[1], far[1], far[0]`.
fn split_quad(near: [u32; 2], far: [u32; 2], diagonal_leaves_first: bool) -> [[u32; 3]; 2] {
    if diagonal_leaves_first {
        [[near[0], near[1], far[1]], [near[0], far[1], far[0]]]
    } else {
        [[near[0], near[1], far[0]], [near[1], far[1], far[0]]]
    }
}

/// Which diagonal splits the quadrilateral that a lattice face with corners `p`, `q` inside and
/// `outside` outside leaves: true for the one from `p` to the cut point on the edge of `q`.
///
/// Both tetrahedra at the face must agree, and must find a splitting that keeps the bounds:
///
/// - one cut edge is long: the diagonal leaves the inner end of the short cut edge and ends at the
///   cut point of the long one;
/// - both are short: the parity rule. The diagonal leaves the inner corner of which an even number
///   of coordinates exceed those of the outer corner. That singles one corner out, since `p` and
///   `q` lie on either side of `outside` along one axis and on the same side along the two others.
fn diagonal_leaves_first(p: Corner, q: Corner, outside: Corner) -> bool {
    if p.is_long_neighbor(q) {
        let exceeding = (0..3).filter(|&axis| p.coordinates[axis] > outside.coordinates[axis]);
        exceeding.count() % 2 == 0
    } else {
        q.is_long_neighbor(outside)
    }
}
