//! Recovered-gradient tetrahedra as the library's, put together from their definition: every mean gradient is a sum
//! over vertices, found once by following unit displacements through averages, middles of edges and faces.
//!
//! ```text
//! F_i  = sum_j x_j b_ij^T           over the vertices of point i: a tetrahedron, or a domain
//! E    = sum_i V_i s_i W(F_i) + sum_q V_q k_q/2 (J_q - 1)^2,   J_q = sum_t w_qt det F_t
//! d2E  = sum_i ... + sum_q V_q k_q (dJ_q dJ_q + (J_q - 1) d2J_q)
//! ```
//!
//! Which tetrahedra belong to a domain and a cluster is the library's ([`Domains`]); the formulas of
//! `viscera::elements::recovered` are not used, so that they can be compared with these.

mod shares;

use std::collections::BTreeMap;
use std::ops::Range;

use viscera::elements::neo_hookean::volume_change;
use viscera::elements::recovered::{FLOOR_STIFFNESS, VOLUME_FLOOR};
use viscera::layout::{Domains, Smoothing};
use viscera::material::MaterialModel;
use viscera::mesh::topology::{TET_EDGES, TET_FACES};
use viscera::model::Model;
use viscera::scalar::{Mat3, Vec3};

use super::matrix::{MatrixValues, Pattern};
use super::objective::Value;
use super::tissue::{Creep, Stiffness, TissueLaw, cofactor_change, project};
use shares::shares;

/// A gradient as a sum over vertices: `F = sum_j x_j b_j^T`, by ascending vertex.
type Gradient = BTreeMap<u32, Vec3<f64>>;

/// Where tissue is evaluated: a tetrahedron's mean gradient, or a domain's.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Of [`Recovered::vertices`] and [`Recovered::gradients`].
    first: usize,
    end: usize,
    /// Rest volume times the share of the energy [m^3].
    volume: f64,
    /// Index into [`Recovered::tissues`].
    tissue: u32,
}

/// A volume that is kept: the mean over tetrahedra.
#[derive(Clone, Debug)]
struct Volume {
    /// Tetrahedra with their weights, which add up to one.
    tets: Vec<(u32, f64)>,
    /// Vertices of these tetrahedra's gradients, ascending.
    vertices: Vec<u32>,
    /// At rest [m^3].
    rest: f64,
    /// Whether it is a cluster's.
    is_cluster: bool,
    /// Index into [`Recovered::tissues`].
    tissue: u32,
    /// Rest volume times bulk stiffness [J].
    stiffness: f64,
    /// Retardation time [s].
    viscosity: f64,
}

/// A linear tetrahedron that is pushed back below a fifth of its volume.
#[derive(Clone, Copy, Debug)]
struct Floor {
    nodes: [u32; 4],
    gradients: [Vec3<f64>; 4],
    /// Rest volume times the floor's stiffness over the shear modulus [m^3].
    share: f64,
    /// Index into [`Recovered::tissues`].
    tissue: u32,
    /// Rest volume times the floor's stiffness [J].
    stiffness: f64,
}

/// All such tetrahedra of a problem.
#[derive(Clone, Debug, Default)]
pub struct Recovered {
    /// Corners of the tetrahedra, shape [tet_count].
    pub nodes: Vec<[u32; 4]>,
    /// Laws of the shear and of the bulk stiffness that counts beside it.
    tissues: Vec<TissueLaw>,
    /// Tetrahedra, then domains.
    places: Vec<Place>,
    vertices: Vec<u32>,
    gradients: Vec<Vec3<f64>>,
    volumes: Vec<Volume>,
    floors: Vec<Floor>,
}

/// Shapes and volumes at the start of a step.
#[derive(Clone, Debug, Default)]
pub struct Start {
    creep: Vec<Option<Creep>>,
    /// `J - 1` and `eta/dt` of each volume.
    volumes: Vec<(f64, f64)>,
}

impl Start {
    /// Where nothing is viscous.
    pub const NONE: Self = Self { creep: Vec::new(), volumes: Vec::new() };
}

impl Recovered {
    /// Those of a model.
    pub fn new(model: &Model<f64>, smoothing: Smoothing) -> Self {
        let domains = &Domains::new(model, smoothing);
        let tissue = |material: &viscera::model::MaterialConstants<f64>| TissueLaw {
            model: MaterialModel::StableNeoHookean,
            lame_lambda: shares(material, smoothing).0,
            lame_mu: material.lame_mu,
            viscosity: material.viscosity,
        };
        let mut recovered = Self {
            nodes: domains.tet_vertices.clone(),
            tissues: model.materials.iter().map(tissue).collect(),
            ..Self::default()
        };
        let averages: Vec<Gradient> = (0..domains.len()).map(|n| average(domains, n)).collect();
        for t in 0..domains.tets.len() {
            let gradient = mean_gradient(domains, model.stress_free(), &averages, t);
            let material = domains.materials[domains.tet_domains[t][0] as usize];
            let volume = (1.0 - smoothing.vertex_share) * domains.tet_volumes[t];
            recovered.push(&gradient, volume, material);
            let share = FLOOR_STIFFNESS * domains.tet_volumes[t];
            recovered.floors.push(Floor {
                nodes: domains.tet_vertices[t],
                gradients: domains.frames[t].gradients,
                share,
                tissue: material,
                stiffness: share * model.materials[material as usize].lame_mu,
            });
        }
        for (n, gradient) in averages.iter().enumerate() {
            let volume = smoothing.vertex_share * domains.volumes[n];
            recovered.push(gradient, volume, domains.materials[n]);
        }
        recovered.add_volumes(model, domains);
        recovered
    }

    fn push(&mut self, gradient: &Gradient, volume: f64, tissue: u32) {
        let first = self.vertices.len();
        self.vertices.extend(gradient.keys());
        self.gradients.extend(gradient.values());
        self.places.push(Place { first, end: self.vertices.len(), volume, tissue });
    }

    /// Of domains, then of clusters; those without stiffness are left out.
    fn add_volumes(&mut self, model: &Model<f64>, domains: &Domains<f64>) {
        let cluster_count = domains.cluster_volumes.len();
        let mut tets = vec![Vec::new(); domains.len() + cluster_count];
        let mut materials = vec![0; tets.len()];
        for (t, of_tet) in domains.tet_domains.iter().enumerate() {
            let quarter = 0.25 * domains.tet_volumes[t];
            for n in of_tet.map(|n| n as usize) {
                let c = domains.len() + domains.clusters[n] as usize;
                tets[n].push((t as u32, quarter / domains.volumes[n]));
                tets[c].push((t as u32, quarter / domains.cluster_volumes[c - domains.len()]));
                materials[n] = domains.materials[n];
                materials[c] = domains.materials[n];
            }
        }
        let rest = domains.volumes.iter().chain(&domains.cluster_volumes);
        for (q, ((tets, tissue), volume)) in tets.into_iter().zip(materials).zip(rest).enumerate() {
            let material = &model.materials[tissue as usize];
            let is_cluster = q >= domains.len();
            let (_, domain, cluster) = shares(material, domains.smoothing);
            let stiffness = volume * if is_cluster { cluster } else { domain };
            if stiffness == 0.0 {
                continue;
            }
            let all = tets.iter().flat_map(|&(t, _)| self.vertices[self.span(t as usize)].to_vec());
            let mut vertices: Vec<u32> = all.collect();
            vertices.sort_unstable();
            vertices.dedup();
            let (rest, viscosity) = (*volume, material.viscosity);
            self.volumes.push(Volume {
                tets,
                vertices,
                rest,
                is_cluster,
                tissue,
                stiffness,
                viscosity,
            });
        }
    }

    fn span(&self, i: usize) -> Range<usize> {
        self.places[i].first..self.places[i].end
    }

    /// `F_i`, from edges.
    fn gradient_at(&self, i: usize, x: &[Vec3<f64>]) -> Mat3<f64> {
        let span = self.span(i);
        let origin = x[self.vertices[span.start] as usize];
        let mut f = Mat3::ZERO;
        for k in span {
            f = f + Mat3::outer(x[self.vertices[k] as usize] - origin, self.gradients[k]);
        }
        f
    }

    /// `J - 1` of a volume.
    fn change(&self, volume: &Volume, x: &[Vec3<f64>]) -> f64 {
        let of_tet =
            |&(t, weight): &(u32, f64)| weight * volume_change(&self.gradient_at(t as usize, x));
        volume.tets.iter().map(of_tet).sum()
    }

    /// Pressure times rest volume [J] at `J - 1`, its derivative, and the energy.
    fn bulk(&self, q: usize, change: f64, start: &Start) -> [f64; 3] {
        let stiffness = self.volumes[q].stiffness;
        let (at_start, rate) = start.volumes.get(q).copied().unwrap_or_default();
        let gone = change - at_start;
        let energy = 0.5 * (change * change + rate * gone * gone);
        [change + rate * gone, 1.0 + rate, energy].map(|value| stiffness * value)
    }

    /// Groups of vertices that act on each other.
    pub fn connections(&self) -> impl Iterator<Item = &[u32]> {
        let places = (0..self.places.len()).map(|i| &self.vertices[self.span(i)]);
        places.chain(self.volumes.iter().map(|volume| &volume.vertices[..]))
    }

    /// Shapes at `x`, and the resistance to leaving them in a step of `dt` [s].
    pub fn start(&self, x: &[Vec3<f64>], dt: f64) -> Start {
        if self.tissues.iter().all(|tissue| tissue.viscosity == 0.0) {
            return Start::default();
        }
        let of_place = |i: usize| {
            let rate = self.tissues[self.places[i].tissue as usize].viscosity / dt;
            (rate > 0.0).then(|| Creep::new(&self.gradient_at(i, x), rate))
        };
        Start {
            creep: (0..self.places.len()).map(of_place).collect(),
            volumes: self.volumes.iter().map(|q| (self.change(q, x), q.viscosity / dt)).collect(),
        }
    }

    /// Adds the energy [J].
    pub fn add_energy(&self, x: &[Vec3<f64>], start: &Start, value: &mut Value) {
        for (i, place) in self.places.iter().enumerate() {
            let creep = start.creep.get(i).and_then(Option::as_ref);
            let tissue = &self.tissues[place.tissue as usize];
            value.add(place.volume * tissue.energy_density(&self.gradient_at(i, x), creep));
        }
        for floor in &self.floors {
            let (_, below) = floor.at(x);
            value.add(0.5 * floor.stiffness * below * below);
        }
        for (q, volume) in self.volumes.iter().enumerate() {
            let [pressure, _, energy] = self.bulk(q, self.change(volume, x), start);
            value.add(energy);
            // Where bodies have turned, a volume is the small difference of products of three entries of `F`, and that
            // is what rounds.
            let product = |&(t, weight): &(u32, f64)| {
                let squared = self.gradient_at(t as usize, x).norm_squared();
                weight * squared * squared.sqrt()
            };
            value.size += pressure.abs() * volume.tets.iter().map(product).sum::<f64>();
        }
    }

    /// Pressures of all volumes gathered by tetrahedron [J], shape [tet_count].
    fn pressures(&self, x: &[Vec3<f64>], start: &Start) -> Vec<f64> {
        let mut pressures = vec![0.0; self.nodes.len()];
        for (q, volume) in self.volumes.iter().enumerate() {
            let pressure = self.bulk(q, self.change(volume, x), start)[0];
            for &(t, weight) in &volume.tets {
                pressures[t as usize] += pressure * weight;
            }
        }
        pressures
    }

    /// Pressures of the tetrahedra [Pa], of rest volumes `volumes` [m^3]: of their own gradients, and of all volumes they
    /// are part of.
    pub fn pressures_at(&self, x: &[Vec3<f64>], volumes: &[f64]) -> Vec<f64> {
        let mut pressures = self.pressures(x, &Start::NONE);
        for (t, (pressure, volume)) in pressures.iter_mut().zip(volumes).enumerate() {
            let f = self.gradient_at(t, x);
            let piola = self.tissues[self.places[t].tissue as usize].piola(&f, None);
            *pressure = super::tissue::pressure(&piola, &f) - *pressure / volume;
        }
        pressures
    }

    /// Adds the gradient [N].
    pub fn add_gradient(&self, x: &[Vec3<f64>], start: &Start, gradient: &mut [Vec3<f64>]) {
        let pressures = self.pressures(x, start);
        for (i, place) in self.places.iter().enumerate() {
            let f = self.gradient_at(i, x);
            let creep = start.creep.get(i).and_then(Option::as_ref);
            let tissue = &self.tissues[place.tissue as usize];
            let mut stress = tissue.piola(&f, creep) * place.volume;
            if let Some(&pressure) = pressures.get(i) {
                stress = stress + f.cofactor() * pressure;
            }
            for k in self.span(i) {
                gradient[self.vertices[k] as usize] += stress * self.gradients[k];
            }
        }
        for floor in &self.floors {
            let (f, below) = floor.at(x);
            let stress = f.cofactor() * (floor.stiffness * below);
            for (node, g) in floor.nodes.iter().zip(floor.gradients) {
                gradient[*node as usize] += stress * g;
            }
        }
    }

    /// Adds the Hessian [N/m]; `positive` without the negative curvature of every place.
    pub fn add_hessian(
        &self,
        x: &[Vec3<f64>],
        start: &Start,
        positive: bool,
        pattern: &Pattern,
        matrix: &mut MatrixValues,
    ) {
        let pressures = self.pressures(x, start);
        for (i, place) in self.places.iter().enumerate() {
            let f = self.gradient_at(i, x);
            let creep = start.creep.get(i).and_then(Option::as_ref);
            let tissue = &self.tissues[place.tissue as usize];
            let mut stiffness =
                tissue.stiffness(&f, creep).map(|row| row.map(|e| e * place.volume));
            if let Some(&pressure) = pressures.get(i) {
                add_volume_curvature(&mut stiffness, &f, pressure);
            }
            if positive {
                project(&mut stiffness);
            }
            for b in self.span(i) {
                let column = self.vertices[b];
                // `A : (. b^T)` once per column.
                let images = images(&stiffness, self.gradients[b]);
                for a in self.span(i).filter(|&a| pattern.holds(self.vertices[a], column)) {
                    let block = block_of(&images, self.gradients[a]);
                    matrix.add(pattern, self.vertices[a], column, &block);
                }
            }
        }
        for floor in &self.floors {
            let (f, below) = floor.at(x);
            if below == 0.0 {
                continue;
            }
            let slope = f.cofactor().columns.map(|column| column.to_array());
            let slope = slope.as_flattened();
            let row = |a: usize| [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|b| slope[a] * slope[b]);
            let mut stiffness =
                [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|a| row(a).map(|entry| entry * floor.stiffness));
            add_volume_curvature(&mut stiffness, &f, floor.stiffness * below);
            if positive {
                project(&mut stiffness);
            }
            for (&column, b) in floor.nodes.iter().zip(floor.gradients) {
                let images = images(&stiffness, b);
                for (&row, a) in floor.nodes.iter().zip(floor.gradients) {
                    if pattern.holds(row, column) {
                        matrix.add(pattern, row, column, &block_of(&images, a));
                    }
                }
            }
        }
        for (q, volume) in self.volumes.iter().enumerate() {
            let curvature = self.bulk(q, 0.0, start)[1];
            let slopes = self.slopes(volume, x);
            for (&row, a) in volume.vertices.iter().zip(&slopes) {
                for (&column, b) in volume.vertices.iter().zip(&slopes) {
                    if pattern.holds(row, column) {
                        let a = *a * curvature;
                        let block = a.to_array().map(|a| (*b * a).to_array());
                        matrix.add(pattern, row, column, &block);
                    }
                }
            }
        }
    }

    /// `dJ/dx` of a volume by its vertices [1/m].
    fn slopes(&self, volume: &Volume, x: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut slopes = vec![Vec3::ZERO; volume.vertices.len()];
        for &(t, weight) in &volume.tets {
            let cofactor = self.gradient_at(t as usize, x).cofactor() * weight;
            for k in self.span(t as usize) {
                // Made of just these vertices.
                let place = volume.vertices.binary_search(&self.vertices[k]).unwrap_or_default();
                slopes[place] += cofactor * self.gradients[k];
            }
        }
        slopes
    }
}

impl Floor {
    /// `F` of the linear tetrahedron, and by how much its volume is below the floor.
    fn at(&self, x: &[Vec3<f64>]) -> (Mat3<f64>, f64) {
        let mut f = Mat3::ZERO;
        for a in 1..4 {
            let edge = x[self.nodes[a] as usize] - x[self.nodes[0] as usize];
            f = f + Mat3::outer(edge, self.gradients[a]);
        }
        (f, (f.determinant() - VOLUME_FLOOR).min(0.0))
    }
}

/// `dP/dF : (e_c g^T)` for each axis `c`.
fn images(stiffness: &Stiffness, g: Vec3<f64>) -> [Mat3<f64>; 3] {
    let mut images = [Mat3::ZERO; 3];
    for (c, image) in images.iter_mut().enumerate() {
        for row in 0..9 {
            let entry = |d: usize| stiffness[row][3 * d + c] * g[d];
            image.columns[row / 3][row % 3] = entry(0) + entry(1) + entry(2);
        }
    }
    images
}

/// `g^T A b` as a 3 x 3 block, rows by the force's axis, from the images of `b`.
fn block_of(images: &[Mat3<f64>; 3], g: Vec3<f64>) -> [[f64; 3]; 3] {
    let columns = images.map(|image| (image * g).to_array());
    [0, 1, 2].map(|a| [columns[0][a], columns[1][a], columns[2][a]])
}

/// Adds `pressure` times the second derivative of the determinant.
fn add_volume_curvature(stiffness: &mut Stiffness, f: &Mat3<f64>, pressure: f64) {
    for column in 0..9 {
        let mut direction = Mat3::ZERO;
        direction.columns[column / 3][column % 3] = 1.0;
        let change = cofactor_change(f, &direction);
        for row in 0..9 {
            stiffness[row][column] += pressure * change.columns[row / 3][row % 3];
        }
    }
}

/// `G_n` as a sum over vertices.
fn average(domains: &Domains<f64>, n: usize) -> Gradient {
    let mut gradient = Gradient::new();
    for (t, of_tet) in domains.tet_domains.iter().enumerate() {
        if of_tet.contains(&(n as u32)) {
            let share = 0.25 * domains.tet_volumes[t] / domains.volumes[n];
            for (vertex, g) in domains.tet_vertices[t].iter().zip(domains.frames[t].gradients) {
                *gradient.entry(*vertex).or_default() += g * share;
            }
        }
    }
    gradient
}

/// `Fh_t` as a sum over vertices: through the middles of the edges, each on two faces.
fn mean_gradient(
    domains: &Domains<f64>,
    rest: &[Vec3<f64>],
    averages: &[Gradient],
    t: usize,
) -> Gradient {
    let (vertices, frame) = (domains.tet_vertices[t], &domains.frames[t]);
    let mut gradient = Gradient::new();
    for (vertex, g) in vertices.iter().zip(frame.gradients) {
        *gradient.entry(*vertex).or_default() += g;
    }
    for [a, b] in TET_EDGES {
        // Of the two faces that the edge lies on, as far as each counts: `g_a + g_b` where both do.
        let mut sides = Vec3::ZERO;
        for (o, face) in TET_FACES.iter().enumerate() {
            if face.contains(&a) && face.contains(&b) {
                sides += frame.gradients[o] * (-8.0 / 3.0 * frame.face_weights[o]);
            }
        }
        let edge = rest[vertices[b] as usize] - rest[vertices[a] as usize];
        for (corner, sign) in [(a, 1.0), (b, -1.0)] {
            // The middle moves by an eighth of G_a (X_b - X_a), less the same of b.
            for (&vertex, slope) in &averages[domains.tet_domains[t][corner] as usize] {
                let moved = sign * slope.dot(edge) / 8.0;
                *gradient.entry(vertex).or_default() += sides * moved;
            }
        }
    }
    gradient
}
