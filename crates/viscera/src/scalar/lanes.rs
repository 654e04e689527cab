//! Eight numbers side by side: what kernels compute with when speed matters.
//!
//! A kernel generic over [`Scalar`] runs on one number or on eight. Eight come in two types with the
//! same bits: [`Portable`], an array, and on x86-64 a type of AVX2 registers, chosen once at run time
//! ([`Instructions::detect`]); no build flag decides, and nothing is fused. A function is compiled
//! for AVX2 by being inlined into one that carries `#[target_feature]` ([`run`]), so everything a
//! kernel calls is `#[inline(always)]`.

#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
use super::avx2;
pub use super::portable::Portable;
use super::{Real, Scalar, Vec3, vec3};

/// Numbers side by side.
pub const LANES: usize = 8;

/// Positions of storage: a value for each lane.
pub type Eight<S> = [S; LANES];

/// Three components and a fourth that travels with them: a position with its weight, a force with
/// its bound. Sixteen bytes in single precision, so that one load brings all four.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct Point<S> {
    /// First component.
    pub x: S,
    /// Second component.
    pub y: S,
    /// Third component.
    pub z: S,
    /// What travels along.
    pub w: S,
}

impl<S: Scalar> Point<S> {
    /// From a vector and what travels along.
    #[inline(always)]
    pub fn new(v: Vec3<S>, w: S) -> Self {
        Self { x: v.x, y: v.y, z: v.z, w }
    }

    /// The three components.
    #[inline(always)]
    pub fn vec3(self) -> Vec3<S> {
        vec3(self.x, self.y, self.z)
    }

    /// Replaces the three components.
    #[inline(always)]
    pub fn set_vec3(&mut self, v: Vec3<S>) {
        (self.x, self.y, self.z) = (v.x, v.y, v.z);
    }
}

/// Eight lanes of a [`Real`].
pub trait Lanes: Scalar {
    /// What each lane holds.
    type Real: Real;

    /// The same value in all lanes.
    fn splat(value: Self::Real) -> Self;

    /// From memory.
    fn load(values: &Eight<Self::Real>) -> Self;

    /// To memory.
    fn store(self, values: &mut Eight<Self::Real>);

    /// Components of eight points.
    ///
    /// # Safety
    /// Every index is that of a point that may be read.
    unsafe fn gather(points: *const Point<Self::Real>, indices: &Eight<u32>) -> Point<Self>;

    /// Writes eight points.
    ///
    /// # Safety
    /// Every index is that of a point that nobody else reads or writes meanwhile.
    unsafe fn scatter(points: *mut Point<Self::Real>, indices: &Eight<u32>, values: Point<Self>);

    /// Adds to eight points.
    ///
    /// # Safety
    /// As [`Lanes::scatter`].
    unsafe fn scatter_add(
        points: *mut Point<Self::Real>,
        indices: &Eight<u32>,
        values: Point<Self>,
    );

    /// The lanes as an array.
    #[inline(always)]
    fn to_array(self) -> Eight<Self::Real> {
        let mut values = [Self::Real::ZERO; LANES];
        self.store(&mut values);
        values
    }
}

/// The instructions that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// What every processor of the target has.
    Portable,
    /// 256-bit registers of x86-64.
    Avx2,
}

impl Instructions {
    /// The fastest that this processor has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Portable
    }

    /// This choice where the processor has it, else what it has.
    pub fn or_detect(self) -> Self {
        if self == Self::Avx2 { Self::detect() } else { self }
    }
}

/// Something to be run with lanes.
pub trait Kernel<R: Real> {
    /// Runs it; `#[inline(always)]`, or it is not compiled for the instructions chosen.
    fn run<L: Lanes<Real = R>>(self);
}

/// Runs a kernel with the instructions given, if the processor has them.
#[inline]
pub fn run<R: Real>(instructions: Instructions, kernel: impl Kernel<R>) {
    match instructions.or_detect() {
        // SAFETY: `or_detect` answers `Avx2` only where the processor has it.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code)]
        Instructions::Avx2 => unsafe { avx2::run(kernel) },
        _ => kernel.run::<Portable<R>>(),
    }
}

/// The fastest lanes of the target, for [`Real::Fast`].
pub(super) mod fast {
    #[cfg(target_arch = "x86_64")]
    pub use super::avx2::{F32x8 as F32, F64x8 as F64};
    #[cfg(not(target_arch = "x86_64"))]
    pub type F32 = super::Portable<f32>;
    #[cfg(not(target_arch = "x86_64"))]
    pub type F64 = super::Portable<f64>;
}
