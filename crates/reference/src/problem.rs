//! What is in balance: tetrahedra with any number of nodes and quadrature points, springs,
//! attachments, lumped masses.
//!
//! A linear tetrahedron has 4 nodes and 1 point, a quadratic one 10 and 4. Everything after this file
//! is the same for both.

use viscera::elements::law::ALL_LAWS;
use viscera::elements::shape_gradients;
use viscera::layout::Smoothing;
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::model::Model;
use viscera::scalar::{Mat3, Vec3};

use super::contact::SurfacePoint;
use super::recovered::Recovered;
use super::tissue::TissueLaw;

/// One quadrature point of a tetrahedron.
#[derive(Clone, Copy, Debug)]
pub struct Point<const N: usize> {
    /// Gradients [1/m] of the shape functions of the nodes.
    pub gradients: [Vec3<f64>; N],
    /// Share of the rest volume [m^3].
    pub volume: f64,
}

/// Tetrahedra of `N` nodes.
#[derive(Clone, Debug)]
pub struct TetElements<const N: usize> {
    /// Nodes, shape [tet_count].
    pub nodes: Vec<[u32; N]>,
    /// Quadrature points, shape [tet_count * points_per_tet].
    pub points: Vec<Point<N>>,
    /// How many points belong to one tetrahedron.
    pub points_per_tet: usize,
    /// Index into the problem's tissues, shape [tet_count].
    pub tissue: Vec<u32>,
}

impl<const N: usize> TetElements<N> {
    fn new(points_per_tet: usize) -> Self {
        Self { nodes: Vec::new(), points: Vec::new(), points_per_tet, tissue: Vec::new() }
    }

    /// The tetrahedron to which a quadrature point belongs.
    pub fn tet_of(&self, point: usize) -> usize {
        point / self.points_per_tet
    }

    /// `F = sum_i x_i g_i^T`, from edges: the gradients add up to zero, so any origin will do, and a
    /// near one keeps the digits.
    pub fn deformation_gradient(&self, point: usize, x: &[Vec3<f64>]) -> Mat3<f64> {
        let nodes = &self.nodes[self.tet_of(point)];
        let origin = x[nodes[0] as usize];
        let mut f = Mat3::ZERO;
        for (&node, &g) in nodes.iter().zip(&self.points[point].gradients).skip(1) {
            f = f + Mat3::outer(x[node as usize] - origin, g);
        }
        f
    }
}

/// A spring: the ends, stiffness [N/m], rest length [m].
#[derive(Clone, Copy, Debug)]
pub struct Spring {
    /// Its two vertices.
    pub ends: [u32; 2],
    /// [N/m].
    pub stiffness: f64,
    /// [m].
    pub rest_length: f64,
}

/// An elastic attachment: the vertex, stiffness [N/m], and the number of its anchor.
#[derive(Clone, Copy, Debug)]
pub struct Attachment {
    /// The vertex held.
    pub vertex: u32,
    /// [N/m].
    pub stiffness: f64,
    /// Index into the anchors.
    pub anchor: u32,
}

/// Everything that does not move.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Rest positions [m], shape [vertex_count].
    pub rest_positions: Vec<Vec3<f64>>,
    /// What gravity acts on [kg], shape [vertex_count]: the integral of density times shape
    /// function. Negative at the corners of quadratic tetrahedra, as it must be.
    pub masses: Vec<f64>,
    /// Of quadratic tetrahedra [kg/m^3].
    pub density: f64,
    /// Materials in use.
    pub tissues: Vec<TissueLaw>,
    /// Linear tetrahedra.
    pub linear: TetElements<4>,
    /// Quadratic tetrahedra.
    pub quadratic: TetElements<10>,
    /// Recovered-gradient tetrahedra.
    pub recovered: Recovered,
    /// Springs.
    pub springs: Vec<Spring>,
    /// Attachments.
    pub attachments: Vec<Attachment>,
    /// Anchors where nothing moves them [m].
    pub rest_anchors: Vec<Vec3<f64>>,
    /// What tools touch, by the model's samples; none of quadratic tetrahedra.
    pub samples: Vec<SurfacePoint>,
}

impl Problem {
    /// What the library's solver solves.
    pub fn linear(model: &Model<f64>) -> Self {
        // A tissue for each law and material, whether or not any tetrahedron has it.
        let mut tissues = Vec::new();
        for law in ALL_LAWS {
            tissues.extend(model.materials.iter().map(|material| TissueLaw {
                model: law,
                lame_lambda: material.lame_lambda,
                lame_mu: material.lame_mu,
                viscosity: material.viscosity,
            }));
        }
        let mut linear = TetElements::new(1);
        for tet in model.tets() {
            linear.nodes.push(tet.vertices);
            let of_law = tet.law as usize * model.materials.len();
            linear.tissue.push(of_law as u32 + tet.material);
            linear.points.push(Point {
                gradients: shape_gradients(&tet.inverse_rest_shape),
                volume: tet.rest_volume,
            });
        }
        let (springs, attachments) = (&model.elements.springs, &model.elements.attachments);
        Self {
            rest_positions: model.rest_positions.clone(),
            masses: model.masses.clone(),
            density: 0.0,
            tissues,
            linear,
            quadratic: TetElements::new(QUADRATURE.len()),
            recovered: Recovered::default(),
            springs: (0..springs.vertices.len())
                .map(|i| Spring {
                    ends: springs.vertices[i],
                    stiffness: springs.stiffness(i),
                    rest_length: springs.rest_length(i),
                })
                .collect(),
            attachments: (0..attachments.vertices.len())
                .map(|i| Attachment {
                    vertex: attachments.vertices[i][0],
                    stiffness: attachments.stiffness(i),
                    anchor: attachments.anchors[i],
                })
                .collect(),
            rest_anchors: model.rest_anchors.clone(),
            samples: SurfacePoint::of_model(model),
        }
    }

    /// The same with its stable neo-Hookean tetrahedra as recovered-gradient ones.
    pub fn recovered(model: &Model<f64>, smoothing: Smoothing) -> Self {
        let mut problem = Self::linear(model);
        problem.recovered = Recovered::new(model, smoothing);
        let linear = &mut problem.linear;
        let is_linear: Vec<bool> =
            model.tets().map(|tet| tet.law != MaterialModel::StableNeoHookean).collect();
        let mut kept = is_linear.iter();
        linear.nodes.retain(|_| kept.next() == Some(&true));
        let mut kept = is_linear.iter();
        linear.tissue.retain(|_| kept.next() == Some(&true));
        let mut kept = is_linear.iter();
        linear.points.retain(|_| kept.next() == Some(&true));
        problem
    }

    /// The same mesh with a node on every edge: ten-node tetrahedra, straight at rest, which do not
    /// lock. The mesh's vertices keep their numbers; the edges' follow. Region 0 is of the first material, the others
    /// are of the second, if there is one; both have the first one's density.
    pub fn quadratic(mesh: &TetMesh, material: &Material, second: Option<&Material>) -> Self {
        let density = material.density();
        let mut edges: Vec<[u32; 2]> = mesh.tets().iter().flat_map(edges_of).collect();
        edges.sort_unstable();
        edges.dedup();
        let first_edge = mesh.vertices().len();
        let mut rest_positions = mesh.vertices().to_vec();
        for edge in &edges {
            let [a, b] = edge.map(|v| mesh.vertices()[v as usize]);
            rest_positions.push((a + b) * 0.5);
        }
        let tissue = |material: &Material| TissueLaw {
            model: material.model(),
            lame_lambda: material.lame_lambda(),
            lame_mu: material.lame_mu(),
            viscosity: 0.0,
        };
        let mut masses = vec![0.0; rest_positions.len()];
        let mut quadratic = TetElements::new(QUADRATURE.len());
        for (tet, &region) in mesh.tets().iter().zip(mesh.regions()) {
            let corners = tet.map(|v| mesh.vertices()[v as usize]);
            let shape = viscera::elements::edge_matrix(&corners);
            let volume = shape.determinant() / 6.0;
            let g = shape_gradients(&shape.inverse());
            let mut nodes = [0; 10];
            nodes[..4].copy_from_slice(tet);
            for (node, edge) in nodes[4..].iter_mut().zip(edges_of(tet)) {
                // Every edge of every tetrahedron is in the list.
                let place = edges.binary_search(&edge).unwrap_or_default();
                *node = (first_edge + place) as u32;
            }
            for (i, &node) in nodes.iter().enumerate() {
                let share = if i < 4 { -1.0 / 20.0 } else { 1.0 / 5.0 };
                masses[node as usize] += share * density * volume;
            }
            quadratic.nodes.push(nodes);
            quadratic.tissue.push(u32::from(region > 0 && second.is_some()));
            for barycentric in QUADRATURE {
                let gradients = quadratic_gradients(&barycentric, &g);
                let volume = volume / QUADRATURE.len() as f64;
                quadratic.points.push(Point { gradients, volume });
            }
        }
        Self {
            rest_positions,
            masses,
            density,
            tissues: std::iter::once(material).chain(second).map(tissue).collect(),
            linear: TetElements::new(1),
            quadratic,
            recovered: Recovered::default(),
            springs: Vec::new(),
            attachments: Vec::new(),
            rest_anchors: Vec::new(),
            samples: Vec::new(),
        }
    }

    /// Number of nodes.
    pub fn vertex_count(&self) -> usize {
        self.rest_positions.len()
    }

    /// Pairs and larger groups of nodes that act on each other: tetrahedra, springs, then samples of the surface.
    pub fn connections(&self) -> impl Iterator<Item = &[u32]> {
        let linear = self.linear.nodes.iter().map(|nodes| nodes.as_slice());
        let quadratic = self.quadratic.nodes.iter().map(|nodes| nodes.as_slice());
        let recovered = self.recovered.connections();
        let springs = self.springs.iter().map(|spring| spring.ends.as_slice());
        let samples = self.samples.iter().map(|sample| sample.vertices.as_slice());
        linear.chain(quadratic).chain(recovered).chain(springs).chain(samples)
    }
}

/// Corners of the six edges, in the order of the nodes 4 to 9.
const EDGES: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// Barycentric coordinates of the four points that integrate squares of linear functions exactly:
/// `(5 + 3 sqrt 5)/20` once, `(5 - sqrt 5)/20` three times.
const QUADRATURE: [[f64; 4]; 4] = {
    const A: f64 = 0.585_410_196_624_968_5;
    const B: f64 = 0.138_196_601_125_010_5;
    [[A, B, B, B], [B, A, B, B], [B, B, A, B], [B, B, B, A]]
};

fn edges_of(tet: &[u32; 4]) -> [[u32; 2]; 6] {
    EDGES.map(|(a, b)| [tet[a].min(tet[b]), tet[a].max(tet[b])])
}

/// Gradients of `N_i = L_i (2 L_i - 1)` at corners and `N_ij = 4 L_i L_j` on edges.
fn quadratic_gradients(barycentric: &[f64; 4], g: &[Vec3<f64>; 4]) -> [Vec3<f64>; 10] {
    let mut gradients = [Vec3::ZERO; 10];
    for i in 0..4 {
        gradients[i] = g[i] * (4.0 * barycentric[i] - 1.0);
    }
    for (gradient, (a, b)) in gradients[4..].iter_mut().zip(EDGES) {
        *gradient = (g[b] * barycentric[a] + g[a] * barycentric[b]) * 4.0;
    }
    gradients
}
