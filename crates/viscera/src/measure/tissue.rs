//! Measures of tetrahedra, eight at a time: all of each one, or sums and extremes of all.
//!
//! What every frame reports needs no principal stretch but the largest and the smallest. With `A = F^T F` and the
//! extremes `s_max`, `s_min` found so far, a tetrahedron changes neither where
//!
//! ```text
//! s_max^2 I - A  and  A - s_min^2 I   are positive definite, and J > 0
//! ```
//!
//! which a factorisation `L D L^T` tells for a tenth of what singular values cost. Only where it does not are they
//! computed, so that the extremes are to the bit those of all singular values.

use crate::elements::law::{ALL_LAWS, Law, with_law};
use crate::elements::singular_values::signed_svd;
use crate::elements::{deformation_gradient, edge_matrix};
use crate::material::MaterialModel;
use crate::model::Model;
use crate::scalar::lanes::{Eight, Instructions, Kernel, LANES, Lanes, run};
use crate::scalar::{Mat3, Real, Scalar, Vec3, vec3};

/// The measures of one tetrahedron.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TetMeasure {
    /// Rest volume [m^3].
    pub rest_volume: f64,
    /// Relative volume `J`; zero or less where inverted.
    pub volume_ratio: f64,
    /// Principal stretches, largest first.
    pub stretches: [f64; 3],
    /// Von Mises stress [Pa] of the Cauchy stress.
    pub von_mises: f64,
    /// Elastic energy density [Pa] of the rest volume.
    pub energy_density: f64,
}

impl TetMeasure {
    /// Whether it is turned inside out, flat, or NaN.
    pub fn is_inverted(&self) -> bool {
        is_inverted(self.volume_ratio)
    }
}

/// Written so that a volume that is NaN counts.
fn is_inverted(volume_ratio: f64) -> bool {
    !matches!(volume_ratio.partial_cmp(&0.0), Some(std::cmp::Ordering::Greater))
}

/// Extremes and sums over tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct DeformationSummary {
    /// Present volume over rest volume.
    pub volume_ratio: f64,
    /// Largest principal stretch.
    pub largest_stretch: f64,
    /// Smallest principal stretch; negative where a tetrahedron is inverted.
    pub smallest_stretch: f64,
    /// Number of tetrahedra with `J <= 0`.
    pub inverted: usize,
}

impl Default for DeformationSummary {
    /// Of no tetrahedra.
    fn default() -> Self {
        Self {
            volume_ratio: 1.0,
            largest_stretch: 0.0,
            smallest_stretch: f64::INFINITY,
            inverted: 0,
        }
    }
}

/// What the tissue of a model does as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TissueMeasure {
    /// Elastic energy [J] of the tetrahedra.
    pub elastic_energy: f64,
    /// Extremes and sums.
    pub deformation: DeformationSummary,
    /// Whether stresses and energies are far from the end of single precision, without computing each.
    pub(crate) is_moderate: bool,
}

/// Measures every tetrahedron; `measures` gets the user's order, shape [tet_count].
pub fn measure_tets<S: Real>(
    model: &Model<S>,
    positions: &[Vec3<S>],
    measures: &mut Vec<TetMeasure>,
) {
    measures.clear();
    measures.resize(model.tet_count(), TetMeasure::default());
    run(Instructions::detect(), Each { tets: Tets { model, positions }, first: 0, measures });
}

/// As [`measure_tets`], a piece after the other in the user's order: for who need not have them all at a time.
pub fn measure_tets_by_pieces<S: Real>(
    model: &Model<S>,
    positions: &[Vec3<S>],
    mut with: impl FnMut(&[TetMeasure]),
) {
    let count = model.tet_count();
    let mut measures = vec![TetMeasure::default(); count.min(LANES * PIECE)];
    for first in (0..count.div_ceil(LANES)).step_by(PIECE) {
        let measures = &mut measures[..(LANES * PIECE).min(count - LANES * first)];
        run(Instructions::detect(), Each { tets: Tets { model, positions }, first, measures });
        with(measures);
    }
}

/// Groups of a piece.
const PIECE: usize = 128;

/// Measures the tissue as a whole: what sums and extremes of [`measure_tets`] would be, to the bit.
pub fn measure_tissue<S: Real>(model: &Model<S>, positions: &[Vec3<S>]) -> TissueMeasure {
    measure_tissue_with(Instructions::detect(), model, positions)
}

fn measure_tissue_with<S: Real>(
    instructions: Instructions,
    model: &Model<S>,
    positions: &[Vec3<S>],
) -> TissueMeasure {
    let mut sums = Sums::default();
    run(instructions, Whole { tets: Tets { model, positions }, sums: &mut sums });
    let stiffness = |m: &crate::material::MaterialConstants<S>| {
        m.lame_lambda.to_f64() + 2.0 * m.lame_mu.to_f64()
    };
    sums.measure.is_moderate &= model.materials.iter().all(|m| stiffness(m) < MODERATE_STIFFNESS);
    if sums.rest_volume > 0.0 {
        sums.measure.deformation.volume_ratio = sums.volume / sums.rest_volume;
    }
    sums.measure
}

/// Stress of a collapsed tetrahedron is divided by at least this relative volume, so that it
/// stays a number.
const SMALLEST_VOLUME_RATIO: f64 = 1e-6;

/// `|F|^2` and stiffness [Pa] up to which no law's stress comes near the end of single precision, 3e38: those of the
/// stable neo-Hookean law grow with `lambda |F|^6`, here 1e30, and are divided by [`SMALLEST_VOLUME_RATIO`] at most.
const MODERATE_NORM: f64 = 1e6;
const MODERATE_STIFFNESS: f64 = 1e12;

/// An extreme is safe from what is this much nearer to it [relative]: far above the rounding of a factorisation and of
/// singular values, far below differences that anyone sees.
const MARGIN: f64 = 1e-9;

/// Of so many groups one is looked at first. Strains that grow along a body would otherwise be new extremes from one
/// end to the other.
const FIRST_LOOK: usize = 61;

struct Tets<'a, S> {
    model: &'a Model<S>,
    positions: &'a [Vec3<S>],
}

/// Eight tetrahedra that follow one another; the last of all fills its group up.
struct Group {
    /// Positions [m] of the corners, at rest and now.
    rest: [[Eight<f64>; 3]; 4],
    now: [[Eight<f64>; 3]; 4],
    lame_lambda: Eight<f64>,
    lame_mu: Eight<f64>,
    laws: Eight<MaterialModel>,
    /// `Dm^-1` [1/m] by columns and rest volume [m^3], rounded as the model's precision has them.
    shape: [Eight<f64>; 9],
    rest_volume: Eight<f64>,
    filled: usize,
}

impl<S: Real> Tets<'_, S> {
    fn group_count(&self) -> usize {
        self.model.tet_count().div_ceil(LANES)
    }

    #[inline(always)]
    fn group<L: Lanes<Real = f64>>(&self, index: usize) -> Group {
        let (first, count) = (LANES * index, self.model.tet_count());
        let none = [0.0; LANES];
        let mut group = Group {
            rest: [[none; 3]; 4],
            now: [[none; 3]; 4],
            lame_lambda: none,
            lame_mu: none,
            laws: [ALL_LAWS[0]; LANES],
            shape: [none; 9],
            rest_volume: none,
            filled: (count - first).min(LANES),
        };
        for lane in 0..LANES {
            let tet = (first + lane).min(count - 1);
            let vertices = self.model.tet_vertices[tet];
            for corner in 0..4 {
                let v = vertices[corner] as usize;
                let (rest, now) = (self.model.stress_free[v], self.positions[v]);
                group.rest[corner][0][lane] = rest.x;
                group.rest[corner][1][lane] = rest.y;
                group.rest[corner][2][lane] = rest.z;
                group.now[corner][0][lane] = now.x.to_f64();
                group.now[corner][1][lane] = now.y.to_f64();
                group.now[corner][2][lane] = now.z.to_f64();
            }
            let material = self.model.tet_materials[tet] as usize;
            let constants = &self.model.materials[material];
            group.lame_lambda[lane] = constants.lame_lambda.to_f64();
            group.lame_mu[lane] = constants.lame_mu.to_f64();
            group.laws[lane] = self.model.laws[material];
        }
        group.find_shapes::<S, L>();
        group
    }
}

#[inline(always)]
fn corners<L: Lanes<Real = f64>>(x: &[[Eight<f64>; 3]; 4], lane: usize) -> [Vec3<L>; 4] {
    let mut corners = [Vec3::ZERO; 4];
    for corner in 0..4 {
        let [a, b, c] = &x[corner];
        corners[corner] = vec3(L::load(a, lane), L::load(b, lane), L::load(c, lane));
    }
    corners
}

impl Group {
    /// As [`Model::tets`] has them.
    #[inline(always)]
    fn find_shapes<S: Real, L: Lanes<Real = f64>>(&mut self) {
        for lane in (0..LANES).step_by(L::WIDTH) {
            let edges = edge_matrix(&corners::<L>(&self.rest, lane));
            (edges.determinant() / L::splat(6.0)).store(&mut self.rest_volume, lane);
            let columns = edges.inverse().columns;
            for c in 0..3 {
                columns[c].x.store(&mut self.shape[3 * c], lane);
                columns[c].y.store(&mut self.shape[3 * c + 1], lane);
                columns[c].z.store(&mut self.shape[3 * c + 2], lane);
            }
        }
        for lane in 0..LANES {
            self.rest_volume[lane] = S::from_f64(self.rest_volume[lane]).to_f64();
        }
        for entry in 0..9 {
            for lane in 0..LANES {
                self.shape[entry][lane] = S::from_f64(self.shape[entry][lane]).to_f64();
            }
        }
    }

    #[inline(always)]
    fn deformation_gradient<L: Lanes<Real = f64>>(&self, lane: usize) -> Mat3<L> {
        let entries = &self.shape;
        let mut shape = Mat3::ZERO;
        for c in 0..3 {
            shape.columns[c] = vec3(
                L::load(&entries[3 * c], lane),
                L::load(&entries[3 * c + 1], lane),
                L::load(&entries[3 * c + 2], lane),
            );
        }
        deformation_gradient(&corners::<L>(&self.now, lane), &shape)
    }

    #[inline(always)]
    fn lame<L: Lanes<Real = f64>>(&self, lane: usize) -> [L; 2] {
        [L::load(&self.lame_lambda, lane), L::load(&self.lame_mu, lane)]
    }

    /// Where any tetrahedron has this law: those that have it.
    #[inline(always)]
    fn has(&self, law: MaterialModel) -> Option<Eight<bool>> {
        let (mut has, mut any) = ([false; LANES], false);
        for lane in 0..LANES {
            has[lane] = self.laws[lane] == law;
            any |= has[lane];
        }
        any.then_some(has)
    }

    /// Energy densities [Pa]; of a law that all lanes are taken to have.
    #[inline(always)]
    fn energies<L: Lanes<Real = f64>, W: Law>(&self) -> Eight<f64> {
        let mut densities = [0.0; LANES];
        for lane in (0..LANES).step_by(L::WIDTH) {
            let (f, [lambda, mu]) = (self.deformation_gradient::<L>(lane), self.lame(lane));
            W::energy_density(&f, lambda, mu).store(&mut densities, lane);
        }
        densities
    }

    /// Von Mises stresses [Pa], likewise.
    #[inline(always)]
    fn stresses<L: Lanes<Real = f64>, W: Law>(&self) -> Eight<f64> {
        let mut stresses = [0.0; LANES];
        for lane in (0..LANES).step_by(L::WIDTH) {
            let (f, [lambda, mu]) = (self.deformation_gradient::<L>(lane), self.lame(lane));
            let volume_ratio = f.determinant();
            let size = volume_ratio.abs().max(L::splat(SMALLEST_VOLUME_RATIO));
            let divisor = L::select(volume_ratio.less(L::ZERO), -size, size);
            let cauchy = W::piola(&f, lambda, mu) * f.transpose() * (L::ONE / divisor);
            von_mises(&cauchy).store(&mut stresses, lane);
        }
        stresses
    }
}

#[inline(always)]
fn von_mises<S: Scalar>(cauchy: &Mat3<S>) -> S {
    let pressure = cauchy.trace() / S::from_f64(3.0);
    let deviator = *cauchy - Mat3::IDENTITY * pressure;
    (S::from_f64(1.5) * deviator.norm_squared()).sqrt()
}

/// All measures of each tetrahedron.
struct Each<'a, S> {
    tets: Tets<'a, S>,
    /// The group that the first of `measures` is of.
    first: usize,
    measures: &'a mut [TetMeasure],
}

impl<S: Real> Kernel<f64> for Each<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = f64>>(self) {
        for (index, measures) in (self.first..).zip(self.measures.chunks_mut(LANES)) {
            let group = self.tets.group::<L>(index);
            for lane in (0..group.filled).step_by(L::WIDTH) {
                let f = group.deformation_gradient::<L>(lane);
                let stretches = signed_svd(&f).sigma;
                let mut rows = [[0.0; LANES]; 4];
                f.determinant().store(&mut rows[0], lane);
                for i in 0..3 {
                    stretches[i].store(&mut rows[i + 1], lane);
                }
                for (at, measure) in (lane..lane + L::WIDTH).zip(&mut measures[lane..]) {
                    measure.volume_ratio = rows[0][at];
                    measure.stretches = [rows[1][at], rows[2][at], rows[3][at]];
                }
            }
            for law in ALL_LAWS {
                let Some(has) = group.has(law) else { continue };
                let (energies, stresses) =
                    with_law!(law, W => (group.energies::<L, W>(), group.stresses::<L, W>()));
                for (lane, measure) in measures.iter_mut().enumerate() {
                    if has[lane] {
                        measure.rest_volume = group.rest_volume[lane];
                        measure.energy_density = energies[lane];
                        measure.von_mises = stresses[lane];
                    }
                }
            }
        }
    }
}

/// Sums and extremes in the making.
struct Sums {
    measure: TissueMeasure,
    /// [m^3].
    rest_volume: f64,
    volume: f64,
}

impl Default for Sums {
    fn default() -> Self {
        let measure = TissueMeasure { is_moderate: true, ..TissueMeasure::default() };
        Self { measure, rest_volume: 0.0, volume: 0.0 }
    }
}

/// Sums and extremes of all tetrahedra.
struct Whole<'a, S> {
    tets: Tets<'a, S>,
    sums: &'a mut Sums,
}

impl<S: Real> Kernel<f64> for Whole<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = f64>>(self) {
        let count = self.tets.group_count();
        for index in (0..count).step_by(FIRST_LOOK) {
            let group = self.tets.group::<L>(index);
            self.sums.find_extremes::<L>(&group);
        }
        for index in 0..count {
            let group = self.tets.group::<L>(index);
            self.sums.add::<L>(&group);
        }
    }
}

impl Sums {
    /// Adds what is summed, in the user's order.
    #[inline(always)]
    fn add<L: Lanes<Real = f64>>(&mut self, group: &Group) {
        let ratios = self.find_extremes::<L>(group);
        let mut densities = [0.0; LANES];
        for law in ALL_LAWS {
            let Some(has) = group.has(law) else { continue };
            let of_law = with_law!(law, W => group.energies::<L, W>());
            for lane in 0..LANES {
                densities[lane] = if has[lane] { of_law[lane] } else { densities[lane] };
            }
        }
        for lane in 0..group.filled {
            let rest_volume = group.rest_volume[lane];
            self.measure.elastic_energy += rest_volume * densities[lane];
            self.rest_volume += rest_volume;
            self.volume += rest_volume * ratios[lane];
            self.measure.deformation.inverted += usize::from(is_inverted(ratios[lane]));
        }
    }

    /// Extremes with those of a group, and its relative volumes.
    #[inline(always)]
    fn find_extremes<L: Lanes<Real = f64>>(&mut self, group: &Group) -> Eight<f64> {
        let mut ratios = [0.0; LANES];
        for lane in (0..group.filled).step_by(L::WIDTH) {
            let f = group.deformation_gradient::<L>(lane);
            let volume_ratio = f.determinant();
            volume_ratio.store(&mut ratios, lane);
            let [a, b, c] = f.columns;
            let diagonal = [a.dot(a), b.dot(b), c.dot(c)];
            let others = [b.dot(c), a.dot(c), a.dot(b)];
            let norm = diagonal[0] + diagonal[1] + diagonal[2];
            self.measure.is_moderate &= L::all(norm.less(L::splat(MODERATE_NORM)));
            let is_upright = L::all(L::ZERO.less(volume_ratio));
            if !(is_upright && self.holds(diagonal, others)) {
                let stretches = signed_svd(&f).sigma;
                let mut rows = [[0.0; LANES]; 2];
                stretches[0].store(&mut rows[0], lane);
                stretches[2].store(&mut rows[1], lane);
                let summary = &mut self.measure.deformation;
                for at in lane..(lane + L::WIDTH).min(group.filled) {
                    summary.largest_stretch = summary.largest_stretch.max(rows[0][at]);
                    summary.smallest_stretch = summary.smallest_stretch.min(rows[1][at]);
                }
            }
        }
        ratios
    }

    /// Whether tetrahedra that are not inverted leave the extremes as they are: by `F^T F`, its diagonal and its
    /// entries yz, xz, xy.
    #[inline(always)]
    fn holds<L: Lanes<Real = f64>>(&self, diagonal: [L; 3], others: [L; 3]) -> bool {
        let DeformationSummary { largest_stretch, smallest_stretch, .. } = self.measure.deformation;
        let above = L::splat(largest_stretch * largest_stretch * (1.0 - MARGIN));
        let below = L::splat(smallest_stretch * smallest_stretch * (1.0 + MARGIN));
        let [xx, yy, zz] = diagonal;
        let [yz, xz, xy] = others;
        is_definite([above - xx, above - yy, above - zz], [-yz, -xz, -xy])
            // What is not inverted is above any that is.
            && (smallest_stretch <= 0.0 || is_definite([xx - below, yy - below, zz - below], others))
    }
}

/// Whether symmetric matrices are positive definite in all lanes, by the pivots of `L D L^T`; false where numbers are
/// not finite.
#[inline(always)]
fn is_definite<S: Scalar>([xx, yy, zz]: [S; 3], [yz, xz, xy]: [S; 3]) -> bool {
    let second = yy - xy * (xy / xx);
    let mixed = yz - xz * (xy / xx);
    let third = zz - xz * (xz / xx) - mixed * (mixed / second);
    S::all(S::ZERO.less(xx)) && S::all(S::ZERO.less(second)) && S::all(S::ZERO.less(third))
}

#[cfg(test)]
mod tests;
