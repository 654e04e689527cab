//! Contact of tissue with tools, once more from its formulas: nothing of the library's law, distances or friction is
//! used, so that both can be compared.
//!
//! ```text
//! E    = sum_s A_s psi(phi(p_s)),   psi = k/2 max(dh - d, 0)^2 + 9 k/2 max(dh/2 - d, 0)^2
//! d2E  = b_a b_b A (psi'' n n^T + psi' H),   n = grad phi,  H = (P - n n^T)/(r + d)
//! E_f  = K u^2/2 up to K u = L, then L u - L^2/(2 K);   d2E_f = K Q, then L/u (Q - u u^T/u^2)
//! ```
//!
//! `H` is that of the distance: `P` projects onto the directions in which the nearest point of the tool's core stays.
//! `Q` is `I - n n^T`, or `I` where the sample is tied. A sample that was touched before the step has the tangent plane
//! of then, in the tool's frame, in place of the distance, and friction.

use viscera::contact::{DistanceGrid, Shape, Tool};
use viscera::model::Model;
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Mat3, Vec3, vec3};

use super::matrix::{MatrixValues, Pattern};
use super::objective::Value;

/// A point of the surface that tools touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The vertices that it hangs on.
    pub vertices: [u32; 4],
    /// `b`: their shares.
    pub weights: [f64; 4],
    /// `A`: at rest [m^2].
    pub area: f64,
    /// Young's modulus over the length of edges there [Pa/m].
    pub stiffness: f64,
}

impl SurfacePoint {
    /// The samples of a model, in its order.
    pub fn of_model(model: &Model<f64>) -> Vec<Self> {
        let samples = model.samples.iter().map(|sample| Self {
            vertices: sample.vertices,
            weights: sample.weights,
            area: sample.area,
            stiffness: model.sample_stiffness(sample),
        });
        samples.collect()
    }

    /// `p` [m].
    pub fn place(&self, x: &[Vec3<f64>]) -> Vec3<f64> {
        let mut place = Vec3::ZERO;
        for (&v, &weight) in self.vertices.iter().zip(&self.weights) {
            place += x[v as usize] * weight;
        }
        place
    }
}

/// A sample that a tool has pressed on before a step: what the step holds constant of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touched {
    /// Number of the sample in the model.
    pub sample: u32,
    /// Number of the tool in the inputs.
    pub tool: u32,
    /// Of the plane `n . x = o` that the sample touches, in the tool's frame; of length 1.
    pub normal: Vec3<f64>,
    /// `o` [m].
    pub offset: f64,
    /// Where the sample would be without slip, in the tool's frame [m].
    pub anchor: Vec3<f64>,
    /// `L` [N]: coefficient of friction times the normal force of the step before. Zero is no friction; infinite ties
    /// the sample to the tool in all directions.
    pub limit: f64,
}

/// A distance [m], its gradient and its second derivative [1/m].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// [m], negative inside.
    pub value: f64,
    /// Of length 1.
    pub normal: Vec3<f64>,
    /// The gradient's magnitude along it: 1, but for a mesh.
    pub slope: f64,
    /// [1/m].
    pub hessian: Mat3<f64>,
}

impl Clearance {
    /// From a plane `n . x = o`.
    fn of_plane(x: Vec3<f64>, normal: Vec3<f64>, offset: f64) -> Self {
        Self { value: normal.dot(x) - offset, normal, slope: 1.0, hessian: Mat3::ZERO }
    }

    /// From a shape in its own frame at a point [m].
    pub fn of(shape: &Shape, x: Vec3<f64>) -> Self {
        match *shape {
            Shape::HalfSpace => Self::of_plane(x, vec3(0.0, 0.0, 1.0), 0.0),
            Shape::Mesh(ref grid) => Self::of_grid(grid, x),
            Shape::Sphere { radius } => Self::from_core(x, Vec3::splat(1.0), radius),
            Shape::Capsule { length, radius } => {
                let is_beside = x.z > 0.0 && x.z < length;
                let along =
                    if is_beside { 0.0 } else { x.z - if x.z > 0.0 { length } else { 0.0 } };
                let free = vec3(1.0, 1.0, if is_beside { 0.0 } else { 1.0 });
                Self::from_core(vec3(x.x, x.y, along), free, radius)
            }
            Shape::RoundedBox { half, radius } => {
                let core = half - Vec3::splat(radius);
                let beyond = |axis: usize| x[axis].abs() - core[axis];
                let mut away = Vec3::ZERO;
                let mut free = Vec3::ZERO;
                for axis in (0..3).filter(|&axis| beyond(axis) > 0.0) {
                    away[axis] = beyond(axis) * x[axis].signum();
                    free[axis] = 1.0;
                }
                if free != Vec3::ZERO {
                    return Self::from_core(away, free, radius);
                }
                // The face that is nearest, the first of several.
                let axis =
                    (1..3).fold(0, |best, a| if beyond(a) > beyond(best) { a } else { best });
                let mut normal = Vec3::ZERO;
                normal[axis] = if x[axis] < 0.0 { -1.0 } else { 1.0 };
                Self { value: beyond(axis) - radius, normal, slope: 1.0, hessian: Mat3::ZERO }
            }
        }
    }

    /// From a grid of distances, the library's: value and gradient are of one function, which has a second derivative within
    /// cells only, and here one of differences over a cell.
    fn of_grid(grid: &DistanceGrid, x: Vec3<f64>) -> Self {
        let gradient = |x: Vec3<f64>| {
            let there = grid.distance(x);
            there.normal * there.slope
        };
        let half = 0.5 * grid.cell();
        let column = |axis: usize| {
            let mut step = Vec3::ZERO;
            step[axis] = half;
            (gradient(x + step) - gradient(x - step)) * (1.0 / grid.cell())
        };
        let second = Mat3::from_columns(column(0), column(1), column(2));
        let here = grid.distance(x);
        let hessian = (second + second.transpose()) * 0.5;
        Self { value: here.value, normal: here.normal, slope: here.slope, hessian }
    }

    /// `away` [m] from the nearest point of a core that is rounded; that point stays where `x` moves along `free` axes.
    fn from_core(away: Vec3<f64>, free: Vec3<f64>, radius: f64) -> Self {
        let length = away.length();
        if length == 0.0 {
            // In the middle there is no direction: the first axis, and no curvature that could be told.
            return Self::of_plane(Vec3::ZERO, vec3(1.0, 0.0, 0.0), radius);
        }
        let normal = away * (1.0 / length);
        let mut projected = Mat3::ZERO;
        for axis in 0..3 {
            projected.columns[axis][axis] = free[axis];
        }
        let hessian = (projected - Mat3::outer(normal, normal)) * (1.0 / length);
        Self { value: length - radius, normal, slope: 1.0, hessian }
    }

    /// The same in the world.
    fn turned(self, pose: &RigidTransform) -> Self {
        let hessian = pose.rotation * self.hessian * pose.rotation.transpose();
        Self { normal: pose.rotation * self.normal, hessian, ..self }
    }
}

/// `psi` [J/m^2], `psi'` [Pa] and `psi''` [Pa/m] at a distance, for `k` [Pa/m] and `dh` [m].
pub fn pressure_law(stiffness: f64, thickness: f64, distance: f64) -> [f64; 3] {
    let mut law = [0.0; 3];
    for (times, begin) in [(1.0, thickness), (9.0, 0.5 * thickness)] {
        let gap = begin - distance;
        if gap > 0.0 {
            let k = times * stiffness;
            law = [law[0] + 0.5 * k * gap * gap, law[1] - k * gap, law[2] + k];
        }
    }
    law
}

/// Energy [J], gradient [N] and second derivative [N/m] of friction at a slip `u` [m] across what `Q` projects out.
pub fn friction(
    k: f64,
    limit: f64,
    u: Vec3<f64>,
    across: Mat3<f64>,
) -> (f64, Vec3<f64>, Mat3<f64>) {
    let length = u.length();
    if k * length <= limit {
        return (0.5 * k * length * length, u * k, across * k);
    }
    let along = u * (1.0 / length);
    let second = (across - Mat3::outer(along, along)) * (limit / length);
    (limit * length - 0.5 * limit * limit / k, along * limit, second)
}

/// One sample at one tool.
#[derive(Clone, Copy, Debug)]
pub struct Felt {
    /// Number of the sample.
    pub sample: u32,
    /// Number of the tool.
    pub tool: u32,
    /// Where the sample is [m].
    pub place: Vec3<f64>,
    /// In the world.
    pub clearance: Clearance,
    /// Of contact and friction [J].
    pub energy: f64,
    /// Of the energy by the place [N]: the force on the tool.
    pub gradient: Vec3<f64>,
    /// Of contact, exact [N/m].
    pub contact: Mat3<f64>,
    /// Of contact without what is negative [N/m].
    pub positive: Mat3<f64>,
    /// Of friction [N/m]: convex.
    pub friction: Mat3<f64>,
    /// `N` [N].
    pub pressed: f64,
}

/// All samples and tools.
#[derive(Clone, Debug)]
pub struct Contacts<'a> {
    samples: &'a [SurfacePoint],
    tools: &'a [Tool],
    touched: &'a [Touched],
    /// By sample, then tool: number in `touched` plus one. Empty where nothing is touched.
    places: Vec<u32>,
}

impl<'a> Contacts<'a> {
    /// Nothing touches anything.
    pub const NONE: Self = Self { samples: &[], tools: &[], touched: &[], places: Vec::new() };

    /// Samples and tools, and which of them have touched before; legal ones.
    pub fn new(samples: &'a [SurfacePoint], tools: &'a [Tool], touched: &'a [Touched]) -> Self {
        let mut places = Vec::new();
        if !touched.is_empty() {
            places.resize(samples.len() * tools.len(), 0);
        }
        for (number, touched) in (1..).zip(touched) {
            places[touched.sample as usize * tools.len() + touched.tool as usize] = number;
        }
        Self { samples, tools, touched, places }
    }

    /// What a sample has touched.
    pub fn touched(&self, sample: u32, tool: u32) -> Option<&'a Touched> {
        let place = sample as usize * self.tools.len() + tool as usize;
        let number = *self.places.get(place)?;
        self.touched.get(number.wrapping_sub(1) as usize)
    }

    /// Constants of contact at a sample: `k` [Pa/m] and `dh` [m].
    fn constants(&self, sample: &SurfacePoint, tool: &Tool) -> (f64, f64) {
        (tool.law.stiffness * sample.stiffness, tool.law.thickness)
    }

    /// All that is felt at `x` [m].
    pub fn felt(&self, x: &[Vec3<f64>]) -> impl Iterator<Item = Felt> {
        let samples = (0..).zip(self.samples).filter(|_| !self.tools.is_empty());
        samples.flat_map(move |(number, sample)| {
            let place = sample.place(x);
            (0..).zip(self.tools).filter_map(move |(tool, _)| self.feel(number, tool, place))
        })
    }

    /// What a sample feels at a place; nothing where tool and friction are out of reach.
    fn feel(&self, number: u32, tool_number: u32, place: Vec3<f64>) -> Option<Felt> {
        let (sample, tool) = (&self.samples[number as usize], &self.tools[tool_number as usize]);
        let (k, thickness) = self.constants(sample, tool);
        let local = tool.pose.rotation.transpose() * (place - tool.pose.translation);
        let touched = self.touched(number, tool_number);
        let clearance = match touched {
            Some(touched) => Clearance::of_plane(local, touched.normal, touched.offset),
            None => Clearance::of(&tool.shape, local),
        };
        let grip = touched.filter(|touched| touched.limit > 0.0);
        if clearance.value >= thickness && grip.is_none() {
            return None;
        }
        let clearance = clearance.turned(&tool.pose);
        let Clearance { value, normal, slope: steep, hessian } = clearance;
        let [psi, slope, second] = pressure_law(k, thickness, value).map(|y| y * sample.area);
        let along = Mat3::outer(normal, normal);
        let positive = along * (second * steep * steep);
        let mut felt = Felt {
            sample: number,
            tool: tool_number,
            place,
            clearance,
            energy: psi,
            gradient: normal * (slope * steep),
            contact: positive + hessian * slope,
            positive,
            friction: Mat3::ZERO,
            pressed: -slope * steep,
        };
        if let Some(grip) = grip {
            let is_tied = grip.limit == f64::INFINITY;
            let across = if is_tied { Mat3::IDENTITY } else { Mat3::IDENTITY - along };
            let slip = across * (place - tool.pose.apply(grip.anchor));
            let (energy, gradient, second) = friction(k * sample.area, grip.limit, slip, across);
            felt.energy += energy;
            felt.gradient += gradient;
            felt.friction = second;
        }
        Some(felt)
    }

    /// Adds the energy at `x` [m].
    pub fn add_energy(&self, x: &[Vec3<f64>], value: &mut Value) {
        self.felt(x).for_each(|felt| value.add(felt.energy));
    }

    /// Adds the gradient [N] at `x` [m], shape [vertex_count].
    pub fn add_gradient(&self, x: &[Vec3<f64>], gradient: &mut [Vec3<f64>]) {
        for felt in self.felt(x) {
            let sample = &self.samples[felt.sample as usize];
            for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
                gradient[v as usize] += felt.gradient * weight;
            }
        }
    }

    /// Adds the Hessian [N/m] at `x` [m], or what of it is positive.
    pub fn add_hessian(
        &self,
        x: &[Vec3<f64>],
        positive: bool,
        pattern: &Pattern,
        matrix: &mut MatrixValues,
    ) {
        for felt in self.felt(x) {
            let sample = &self.samples[felt.sample as usize];
            let of_contact = if positive { felt.positive } else { felt.contact };
            let second = of_contact + felt.friction;
            for (&a, &of_a) in sample.vertices.iter().zip(&sample.weights) {
                for (&b, &of_b) in sample.vertices.iter().zip(&sample.weights) {
                    if of_a * of_b != 0.0 && pattern.holds(a, b) {
                        let block = second * (of_a * of_b);
                        // Symmetric: columns are rows.
                        let rows = block.columns.map(|column| column.to_array());
                        matrix.add(pattern, a, b, &rows);
                    }
                }
            }
        }
    }

    /// What the next step holds constant after one that has ended at `x` [m]: by sample, then tool.
    pub fn touched_after(&self, x: &[Vec3<f64>]) -> Vec<Touched> {
        let pressed = self.felt(x).filter(|felt| felt.pressed > 0.0);
        pressed.map(|felt| self.kept(&felt)).collect()
    }

    /// Anchor and plane of a sample that has been pressed.
    fn kept(&self, felt: &Felt) -> Touched {
        let Felt { sample, tool: number, place, pressed, clearance, .. } = *felt;
        let tool = &self.tools[number as usize];
        let back = |x: Vec3<f64>| tool.pose.rotation.transpose() * (x - tool.pose.translation);
        let local = back(place);
        let live = Clearance::of(&tool.shape, local);
        let mut anchor = local;
        let mut limit = tool.law.friction * pressed;
        if let Some(before) = self.touched(sample, number).filter(|before| before.limit > 0.0) {
            if before.limit == f64::INFINITY {
                (anchor, limit) = (before.anchor, before.limit);
            } else {
                let away = place - tool.pose.apply(before.anchor);
                let slip = away - clearance.normal * clearance.normal.dot(away);
                let point = &self.samples[sample as usize];
                let elastic = self.constants(point, tool).0 * point.area * slip.length();
                let most = before.limit.min(limit);
                let share = if elastic > most { most / elastic } else { 1.0 };
                anchor = back(place - slip * share);
            }
        }
        let normal = match &tool.shape {
            Shape::Mesh(grid) => grid.normal(local),
            _ => live.normal,
        };
        let offset = normal.dot(local) - live.value;
        Touched { sample, tool: number, normal, offset, anchor, limit }
    }
}
