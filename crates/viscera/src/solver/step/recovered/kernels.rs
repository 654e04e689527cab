//! What the stages of [`super`] do to eight tetrahedra, eight domains, eight vertices.
#![allow(unsafe_code)]

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use crate::elements::green_strain::{self, Voigt};
use crate::elements::law::{Law, StableNeoHookean};
use crate::elements::neo_hookean::{self, volume_change};
use crate::elements::recovered::{
    RestFrame, VOLUME_FLOOR, bulk_shares, floor_piola, recovered_gradient, tet_stress,
    vertex_stresses,
};
use crate::elements::{deformation_gradient, shape_gradients};
use crate::layout::{Entry, Frames, Layout, RecoveredTables};
use crate::scalar::lanes::{Eight, Kernel, LANES, Lanes, Point};
use crate::scalar::{Mat3, Real, Vec3, vec3};
use crate::solver::cpu::tets::{Block, TetPass};
use crate::solver::cpu::threads::Shared;

/// Three points that stand one after the other, as the columns of matrices.
///
/// # Safety
/// As [`Lanes::gather`], of all three.
#[inline(always)]
pub unsafe fn gather_matrix<L: Lanes>(
    points: *const Point<L::Real>,
    rows: &Eight<u32>,
    lane: usize,
) -> Mat3<L> {
    let mut matrix = Mat3::ZERO;
    for column in 0..3 {
        // SAFETY: the caller's promise.
        matrix.columns[column] = unsafe { L::gather(points.add(column), rows, lane) }.vec3();
    }
    matrix
}

/// Where the rows of a group of places stand.
#[inline(always)]
pub fn rows_of(group: usize) -> Eight<u32> {
    std::array::from_fn(|lane| (3 * (LANES * group + lane)) as u32)
}

/// Eight numbers that stand one after the other.
#[inline(always)]
pub fn eight<S: Copy>(all: &[S], group: usize) -> &Eight<S> {
    &all.as_chunks().0[group]
}

/// `G_n = sum_j (x_j - x_n) b_nj^T`: differences to the domain's own vertex keep the digits.
pub struct VertexGradients<'a, S> {
    pub tables: &'a RecoveredTables<S>,
    pub x: &'a [Point<S>],
    pub groups: Range<usize>,
    pub into: Shared<'a, Point<S>>,
}

impl<S: Real> Kernel<S> for VertexGradients<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        let x = self.x.as_ptr();
        for group in self.groups {
            let own = eight(&self.tables.vertices, group);
            for lane in (0..LANES).step_by(L::WIDTH) {
                // SAFETY: indices are those of vertices of the layout, and `evaluate` has checked that they are there.
                let origin = unsafe { L::gather(x, own, lane) }.vec3();
                let mut gradient = Mat3::<L>::ZERO;
                for Entry { index, gradient: b } in self.tables.domain_rings.of(group) {
                    // SAFETY: as above.
                    let edge = unsafe { L::gather(x, index, lane) }.vec3() - origin;
                    gradient = gradient + Mat3::outer(edge, load_vector(b, lane));
                }
                for column in 0..3 {
                    let value = Point::new(gradient.columns[column], L::ZERO);
                    // SAFETY: every group has places of its own and is worked on once.
                    unsafe {
                        L::scatter(self.into.pointer().add(column), &rows_of(group), lane, value);
                    }
                }
            }
        }
    }
}

impl<S: Real> Frames<S> {
    /// At rest, some lanes of it.
    #[inline(always)]
    pub fn rest<L: Lanes<Real = S>>(&self, shape: &Mat3<L>, lane: usize) -> RestFrame<L> {
        let arms = load_matrix::<L>(&self.arms, lane);
        let [b, c, d] = arms.columns;
        let mut face_weights = [L::ZERO; 4];
        for o in 0..4 {
            face_weights[o] = L::load(&self.face_weights[o], lane);
        }
        RestFrame {
            gradients: shape_gradients(shape),
            arms: [-((b + c) + d), b, c, d],
            face_weights,
        }
    }
}

/// `Fh_t`, and its volume to the corners' places.
pub struct TetGradients<'a, S> {
    pub frames: &'a [Frames<S>],
    pub x: &'a [Point<S>],
    pub gradients: &'a [Point<S>],
    pub recovered: Shared<'a, [Eight<S>; 9]>,
    pub changes: Shared<'a, S>,
    pub inverted: &'a AtomicBool,
    /// Whether one is below the volume floor.
    pub crushed: &'a AtomicBool,
}

impl<S: Real> TetPass<S> for TetGradients<'_, S> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let (frame, lane) = (&self.frames[tets.index], tets.lane);
        let shape = tets.shape::<L>();
        let f = deformation_gradient(&tets.corners::<L>(self.x).x, &shape);
        let volume = f.determinant();
        if !L::all(L::ZERO.less(volume)) {
            self.inverted.store(true, Relaxed);
        }
        if !L::all(L::from_f64(VOLUME_FLOOR).less(volume)) {
            self.crushed.store(true, Relaxed);
        }
        let mut of_corners = [Mat3::ZERO; 4];
        for corner in 0..4 {
            // SAFETY: places of the tables, whose gradients there are.
            of_corners[corner] =
                unsafe { gather_matrix(self.gradients.as_ptr(), &frame.places[corner], lane) };
        }
        let recovered = recovered_gradient(&f, &of_corners, &frame.rest(&shape, lane));
        // SAFETY: every block is worked on once.
        let into = unsafe { self.recovered.at(tets.index) };
        for column in 0..3 {
            let Vec3 { x, y, z } = recovered.columns[column];
            x.store(&mut into[3 * column], lane);
            y.store(&mut into[3 * column + 1], lane);
            z.store(&mut into[3 * column + 2], lane);
        }
        // SAFETY: the piece has copies of its own, and one thread does all of it.
        unsafe { scatter_changes(tets, frame, volume_change(&recovered), &self.changes) };
    }
}

/// Adds a change of volume, of so much of each tetrahedron, to the copies of its corners' places.
///
/// # Safety
/// No one else works on the copies of the block's piece.
#[inline(always)]
pub unsafe fn scatter_changes<S: Real, L: Lanes<Real = S>>(
    tets: &Block<'_, S>,
    frame: &Frames<S>,
    change: L,
    into: &Shared<'_, S>,
) {
    let quarter = tets.volume::<L>() * L::from_f64(0.25);
    let mut changes = [S::ZERO; LANES];
    (change * quarter).store(&mut changes, tets.lane);
    for lane in tets.lane..(tets.lane + L::WIDTH).min(tets.filled()) {
        for rows in &frame.rows {
            // SAFETY: the caller's promise.
            unsafe { *into.at(rows[lane] as usize / 3) += changes[lane] };
        }
    }
}

/// `Fh_t` of some lanes of a block.
#[inline(always)]
pub fn load_matrix<L: Lanes>(of: &[Eight<L::Real>; 9], lane: usize) -> Mat3<L> {
    let mut matrix = Mat3::ZERO;
    for (column, of) in matrix.columns.iter_mut().zip(of.as_chunks().0) {
        *column = load_vector(of, lane);
    }
    matrix
}

#[inline(always)]
fn load_vector<L: Lanes>([x, y, z]: &[Eight<L::Real>; 3], lane: usize) -> Vec3<L> {
    vec3(L::load(x, lane), L::load(y, lane), L::load(z, lane))
}

/// What forces are wanted.
pub struct Load<'a, S> {
    /// They are multiplied by it.
    pub scale: S,
    /// Where viscosity acts, the Green strains of tetrahedra since which it does, and one over the time since then [1/s].
    pub viscous: Option<(Shared<'a, [Eight<S>; 6]>, S)>,
    /// Whether the strains of now take the place of those.
    pub goes_on: bool,
    /// Where the bound of stiffness is wanted beside forces, also times `scale`: what of it does not depend on the shape
    /// [m], block by block.
    pub at_rest: Option<&'a [Eight<S>]>,
}

/// The Green strain in the place of another, of which a share of the change since then is left.
#[inline(always)]
fn put_strain<S: Real, L: Lanes<Real = S>>(
    f: &Mat3<L>,
    place: &mut [Eight<S>; 6],
    lane: usize,
    share: S,
) {
    for (component, place) in green_strain::strain(f).into_iter().zip(place) {
        let mut strain = component;
        if share != S::ZERO {
            strain += (L::load(place, lane) - component) * L::splat(share);
        }
        strain.store(place, lane);
    }
}

/// Stress [Pa] by the change of the Green strain since the start, in the place of which it is put where it `goes_on`. Volume counts by the part
/// of Lame's first parameter that counts here: what is averaged over clusters has no viscosity.
#[inline(always)]
fn viscous_stress<S: Real, L: Lanes<Real = S>>(
    f: &Mat3<L>,
    (local, mu): (L, L),
    (start, goes_on): (&mut [Eight<S>; 6], bool),
    lane: usize,
) -> Mat3<L> {
    let mut change: Voigt<L> = green_strain::strain(f);
    for p in 0..6 {
        change[p] -= L::load(&start[p], lane);
    }
    if goes_on {
        put_strain(f, start, lane, S::ZERO);
    }
    green_strain::piola(f, &change, local, mu)
}

/// The Green strain of blocks where they are, see [`put_strain`].
pub struct TetStrains<'a, S> {
    pub recovered: &'a [[Eight<S>; 9]],
    pub share: S,
    pub strains: Shared<'a, [Eight<S>; 6]>,
}

impl<S: Real> TetPass<S> for TetStrains<'_, S> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let recovered = load_matrix::<L>(&self.recovered[tets.index], tets.lane);
        // SAFETY: every block has a place of its own and is worked on once.
        put_strain(&recovered, unsafe { self.strains.at(tets.index) }, tets.lane, self.share);
    }
}

/// The same of groups of places.
pub struct PlaceStrains<'a, S> {
    pub gradients: &'a [Point<S>],
    pub groups: Range<usize>,
    pub share: S,
    pub strains: Shared<'a, [Eight<S>; 6]>,
}

impl<S: Real> Kernel<S> for PlaceStrains<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        for group in self.groups {
            for lane in (0..LANES).step_by(L::WIDTH) {
                // SAFETY: the group's places.
                let gradient: Mat3<L> =
                    unsafe { gather_matrix(self.gradients.as_ptr(), &rows_of(group), lane) };
                // SAFETY: every group has a place of its own and is worked on once.
                put_strain(&gradient, unsafe { self.strains.at(group) }, lane, self.share);
            }
        }
    }
}

/// `S_t = V_t dE/dFh_t`: to the corners `-S_t g_a`, to their places what it is by `G_n`.
pub struct TetForces<'a, S> {
    pub frames: &'a [Frames<S>],
    pub recovered: &'a [[Eight<S>; 9]],
    /// Where vertices are, if one is below the volume floor.
    pub crushed: Option<&'a [Point<S>]>,
    pub pressures: &'a [S],
    pub share: S,
    pub load: &'a Load<'a, S>,
    pub of_tets: Shared<'a, Point<S>>,
    pub loads: Shared<'a, Point<S>>,
}

impl<S: Real> TetPass<S> for TetForces<'_, S> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let (frame, lane) = (&self.frames[tets.index], tets.lane);
        let shape = tets.shape::<L>();
        let rest = frame.rest(&shape, lane);
        let mut mean = [S::ZERO; LANES];
        for lane in lane..lane + L::WIDTH {
            let pressure = |corner: usize| self.pressures[frame.places[corner][lane] as usize / 3];
            let sums = [pressure(0) + pressure(1), pressure(2) + pressure(3)];
            mean[lane] = (sums[0] + sums[1]) * S::from_f64(0.25);
        }
        let material = tets.material::<L>();
        let local = bulk_shares(material.lame_lambda, material.lame_mu).local;
        let recovered = load_matrix::<L>(&self.recovered[tets.index], lane);
        let (share, mean) = (L::splat(self.share), L::load(&mean, lane));
        let volume = tets.volume::<L>() * L::splat(self.load.scale);
        let mut stress = tet_stress(&recovered, local, material.lame_mu, share, mean);
        if let Some((strains, rate)) = self.load.viscous.as_ref().filter(|_| tets.is_viscous()) {
            // SAFETY: every block has a place of its own and is worked on once.
            let start = (unsafe { strains.at(tets.index) }, self.load.goes_on);
            let rate = material.viscosity * L::splat(*rate) * share;
            let viscous = viscous_stress(&recovered, (local, material.lame_mu), start, lane);
            stress = stress + viscous * rate;
        }
        let stress = stress * volume;
        let mut bound = L::ZERO;
        if let Some(at_rest) = self.load.at_rest {
            let stiffness =
                StableNeoHookean::stiffness(&recovered, material.lame_lambda, material.lame_mu);
            bound = L::load(&at_rest[tets.index], lane) * stiffness * L::splat(self.load.scale);
        }
        let mut of_linear = stress;
        if let Some(x) = self.crushed {
            let f = deformation_gradient(&tets.corners::<L>(x).x, &shape);
            of_linear = of_linear + floor_piola(&f, material.lame_mu) * volume;
        }
        let mut forces = [Vec3::ZERO; 4];
        for corner in 1..4 {
            forces[corner] = -(of_linear * rest.gradients[corner]);
        }
        forces[0] = -((forces[1] + forces[2]) + forces[3]);
        // SAFETY: the piece has copies of its own, and one thread does all of it.
        unsafe { tets.add_bound_in_order(&self.loads, &forces, bound) };
        let of_corners = vertex_stresses(&stress, &rest);
        for column in 0..3 {
            let mut values = [Point::new(Vec3::ZERO, L::ZERO); 4];
            for corner in 0..4 {
                values[corner] = Point::new(of_corners[corner].columns[column], L::ZERO);
            }
            // SAFETY: as above; three points to a copy.
            unsafe { tets.add_rows_in_order(&self.of_tets, column, &frame.rows, values) };
        }
    }
}

/// `N_n`: what tetrahedra do to `G_n`, piece by piece, and `V_n alpha P(G_n)`.
pub struct PlaceStresses<'a, S> {
    pub tables: &'a RecoveredTables<S>,
    pub gradients: &'a [Point<S>],
    pub of_tets: &'a [Point<S>],
    pub load: &'a Load<'a, S>,
    /// Of groups, as those of tetrahedra.
    pub strains: Shared<'a, [Eight<S>; 6]>,
    pub groups: Range<usize>,
    pub into: Shared<'a, Point<S>>,
}

impl<S: Real> Kernel<S> for PlaceStresses<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        let tables = self.tables;
        for group in self.groups {
            let rows = rows_of(group);
            for lane in (0..LANES).step_by(L::WIDTH) {
                // SAFETY: the group's places.
                let gradient: Mat3<L> =
                    unsafe { gather_matrix(self.gradients.as_ptr(), &rows, lane) };
                let [local, mu, viscosity] = local_of(tables, group, lane);
                let scale = L::splat(tables.shares[1] * self.load.scale);
                let volume = L::load(eight(&tables.volumes, group), lane) * scale;
                let mut stress = neo_hookean::piola(&gradient, local, mu);
                if let Some((_, rate)) = &self.load.viscous {
                    // SAFETY: every group has a place of its own and is worked on once.
                    let start = (unsafe { self.strains.at(group) }, self.load.goes_on);
                    let viscous = viscous_stress(&gradient, (local, mu), start, lane);
                    stress = stress + viscous * (viscosity * L::splat(*rate));
                }
                let stress = stress * volume;
                for column in 0..3 {
                    let value = Point::new(stress.columns[column], L::ZERO);
                    // SAFETY: every group has places of its own and is worked on once.
                    unsafe {
                        L::scatter(self.into.pointer().add(column), &rows, lane, value);
                    }
                }
            }
            for n in LANES * group..LANES * (group + 1) {
                // SAFETY: as above.
                let into = unsafe { self.into.range(3 * n..3 * n + 3) };
                for copy in tables.copy_offsets[n] as usize..tables.copy_offsets[n + 1] as usize {
                    let of_piece = &self.of_tets[3 * copy..3 * copy + 3];
                    into.iter_mut().zip(of_piece).for_each(|(sum, more)| sum.add(*more));
                }
            }
        }
    }
}

/// `l` and `mu` [Pa] and the retardation time [s] of some places of a group.
#[inline(always)]
pub fn local_of<S: Real, L: Lanes<Real = S>>(
    tables: &RecoveredTables<S>,
    group: usize,
    lane: usize,
) -> [L; 3] {
    let mut of = [L::ZERO; 3];
    for (of, group_of) in of.iter_mut().zip(&tables.local[group]) {
        *of = L::load(group_of, lane);
    }
    of
}

/// `-sum_n N_n b_ni` to the vertices' first copies.
pub struct VertexForces<'a, S> {
    pub tables: &'a RecoveredTables<S>,
    pub layout: &'a Layout<S>,
    pub stresses: &'a [Point<S>],
    pub groups: Range<usize>,
    pub loads: Shared<'a, Point<S>>,
}

impl<S: Real> Kernel<S> for VertexForces<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        let points = self.stresses.as_ptr();
        for group in self.groups {
            let mut sums = [[S::ZERO; LANES]; 3];
            for lane in (0..LANES).step_by(L::WIDTH) {
                let mut sum = Vec3::<L>::ZERO;
                for Entry { index, gradient: b } in self.tables.vertex_rings.of(group) {
                    // SAFETY: rows of places of the tables.
                    let stress: Mat3<L> = unsafe { gather_matrix(points, index, lane) };
                    sum += stress * load_vector(b, lane);
                }
                sum.x.store(&mut sums[0], lane);
                sum.y.store(&mut sums[1], lane);
                sum.z.store(&mut sums[2], lane);
            }
            for lane in 0..LANES {
                if self.tables.counts[LANES * group + lane] {
                    let v = self.tables.ring_vertices[LANES * group + lane] as usize;
                    let force = -vec3(sums[0][lane], sums[1][lane], sums[2][lane]);
                    let copy = self.layout.copy_offsets[v] as usize;
                    // SAFETY: a vertex stands in one group once where it counts.
                    unsafe { self.loads.at(copy) }.add(Point::new(force, S::ZERO));
                }
            }
        }
    }
}
