//! Numbers side by side: what kernels compute with when speed matters.
//!
//! Storage holds numbers in groups of eight. A kernel generic over [`Lanes`] takes as many of a group at
//! a time as its type has lanes: one (`f32`, `f64`: any processor), or a register of AVX2 or of WebAssembly, chosen once
//! at run time ([`Instructions::detect`]). The bits are the same: no build flag decides, nothing is
//! fused, and sums keep the lanes of the group apart. A function is compiled for AVX2 by being inlined
//! into one that carries `#[target_feature]` ([`run`]), so everything a kernel calls is
//! `#[inline(always)]`.

#![allow(unsafe_code)]

use super::{Real, Scalar, Vec3, vec3};

/// Numbers of a group.
pub const LANES: usize = 8;

/// A group in memory.
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
    /// The number that travels along.
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

    /// Adds all four components.
    #[inline(always)]
    pub fn add(&mut self, other: Self) {
        self.x += other.x;
        self.y += other.y;
        self.z += other.z;
        self.w += other.w;
    }

    /// Adds all four components of another, times a number.
    #[inline(always)]
    pub fn add_scaled(&mut self, other: &Self, factor: S) {
        self.x += other.x * factor;
        self.y += other.y * factor;
        self.z += other.z * factor;
        self.w += other.w * factor;
    }

    /// Replaces the three components.
    #[inline(always)]
    pub fn set_vec3(&mut self, v: Vec3<S>) {
        (self.x, self.y, self.z) = (v.x, v.y, v.z);
    }
}

/// Some lanes of a group, from one on.
pub trait Lanes: Scalar {
    /// The number that each lane holds.
    type Real: Real;

    /// How many lanes; divides [`LANES`].
    const WIDTH: usize;

    /// The same value in all lanes.
    fn splat(value: Self::Real) -> Self;

    /// From memory, the lanes from `first` on.
    fn load(group: &Eight<Self::Real>, first: usize) -> Self;

    /// To memory, the lanes from `first` on.
    fn store(self, group: &mut Eight<Self::Real>, first: usize);

    /// Components of the points whose indices stand from `first` on.
    ///
    /// # Safety
    /// Every index is that of a point that may be read.
    unsafe fn gather(
        points: *const Point<Self::Real>,
        indices: &Eight<u32>,
        first: usize,
    ) -> Point<Self>;

    /// Writes the points whose indices stand from `first` on.
    ///
    /// # Safety
    /// Every index is that of a point that nobody else reads or writes meanwhile.
    unsafe fn scatter(
        points: *mut Point<Self::Real>,
        indices: &Eight<u32>,
        first: usize,
        values: Point<Self>,
    );

    /// Adds to the points whose indices stand from `first` on.
    ///
    /// # Safety
    /// As [`Lanes::scatter`].
    unsafe fn scatter_add(
        points: *mut Point<Self::Real>,
        indices: &Eight<u32>,
        first: usize,
        values: Point<Self>,
    );

    /// As [`Lanes::scatter_add`] of four points for each lane, lane by lane: points may be the same.
    ///
    /// # Safety
    /// As [`Lanes::scatter`], but for points that are the same.
    unsafe fn add_in_order(
        points: *mut Point<Self::Real>,
        indices: &[Eight<u32>; 4],
        first: usize,
        values: [Point<Self>; 4],
    );
}

/// One lane: the number itself.
impl<R: Real> Lanes for R {
    type Real = R;
    const WIDTH: usize = 1;

    #[inline(always)]
    fn splat(value: R) -> Self {
        value
    }

    #[inline(always)]
    fn load(group: &Eight<R>, first: usize) -> Self {
        group[first]
    }

    #[inline(always)]
    fn store(self, group: &mut Eight<R>, first: usize) {
        group[first] = self;
    }

    #[inline(always)]
    unsafe fn gather(points: *const Point<R>, indices: &Eight<u32>, first: usize) -> Point<R> {
        // SAFETY: the caller's promise.
        unsafe { *points.add(indices[first] as usize) }
    }

    #[inline(always)]
    unsafe fn scatter(points: *mut Point<R>, indices: &Eight<u32>, first: usize, values: Point<R>) {
        // SAFETY: the caller's promise.
        unsafe { *points.add(indices[first] as usize) = values };
    }

    #[inline(always)]
    unsafe fn scatter_add(
        points: *mut Point<R>,
        indices: &Eight<u32>,
        first: usize,
        values: Point<R>,
    ) {
        // SAFETY: the caller's promise.
        unsafe { (*points.add(indices[first] as usize)).add(values) };
    }

    #[inline(always)]
    unsafe fn add_in_order(
        points: *mut Point<R>,
        indices: &[Eight<u32>; 4],
        first: usize,
        values: [Point<R>; 4],
    ) {
        for (corner, value) in values.into_iter().enumerate() {
            // SAFETY: the caller's promise.
            unsafe { (*points.add(indices[corner][first] as usize)).add(value) };
        }
    }
}

/// The instructions that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// What every processor of the target has: one number at a time.
    Portable,
    /// 256-bit registers of x86-64.
    Avx2,
    /// 128-bit registers of WebAssembly, without its relaxed instructions.
    Simd128,
}

impl Instructions {
    /// The fastest that this processor has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        match cfg!(target_arch = "wasm32") {
            // Whatever loads the module knows them.
            true => Self::Simd128,
            false => Self::Portable,
        }
    }

    /// This choice where the processor has it, else what it has. A module of WebAssembly has one copy of every kernel, that
    /// in registers: a page is to be small.
    pub fn or_detect(self) -> Self {
        if self == Self::Portable && cfg!(not(target_arch = "wasm32")) {
            self
        } else {
            Self::detect()
        }
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
        // SAFETY: `or_detect` answers registers only where the processor has them.
        #[cfg(any(target_arch = "x86_64", target_arch = "wasm32"))]
        #[allow(unsafe_code)]
        Instructions::Avx2 | Instructions::Simd128 => unsafe { R::run_in_registers(kernel) },
        #[cfg(not(target_arch = "wasm32"))]
        _ => kernel.run::<R>(),
        #[cfg(target_arch = "wasm32")]
        _ => unreachable!("every engine that loads the module has its registers"),
    }
}
