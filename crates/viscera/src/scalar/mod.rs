//! One scalar trait for every kernel: `f64` is the oracle, `f32` the product.
//!
//! Kernels are generic over [`Scalar`] and nothing else, so the same source runs in double and in
//! single precision. A kernel never branches on a scalar: it compares into a [`Scalar::Mask`] and
//! selects, so that a type of several lanes can implement the trait as well. Storage and solvers,
//! which do look at single numbers, are generic over [`Real`].
//!
//! No operation here is fused or approximated, so results are the same bits on every machine.
//! [`lanes`] holds numbers side by side.

#[cfg(target_arch = "x86_64")]
mod avx2;
pub mod lanes;
pub mod rigid;
#[cfg(target_arch = "wasm32")]
mod simd128;

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, MulAssign, Neg, Sub, SubAssign};

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::avx2::F32x8 {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::avx2::F64x4 {}
    #[cfg(target_arch = "wasm32")]
    impl Sealed for super::simd128::F32x4 {}
    #[cfg(target_arch = "wasm32")]
    impl Sealed for super::simd128::F64x2 {}
}

/// The operations of kernels on a number, or on several numbers side by side.
pub trait Scalar:
    sealed::Sealed
    + Copy
    + Default
    + PartialEq
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// Result of a comparison: one truth value per lane.
    type Mask: Copy;
    /// Zero in every lane.
    const ZERO: Self;
    /// One in every lane.
    const ONE: Self;
    /// One half in every lane.
    const HALF: Self;
    /// Two in every lane.
    const TWO: Self;
    /// Distance from 1 to the next larger number.
    const EPSILON: f64;
    /// The nearest representable value, in every lane.
    fn from_f64(value: f64) -> Self;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The smaller of two values.
    fn min(self, other: Self) -> Self;
    /// The larger of two values.
    fn max(self, other: Self) -> Self;
    /// Lane by lane, `self < other`; false where either is not a number.
    fn less(self, other: Self) -> Self::Mask;
    /// True where the mask holds in every lane: for loops that all lanes leave together.
    fn all(mask: Self::Mask) -> bool;
    /// Lane by lane, `if_true` where the mask holds and `if_false` elsewhere.
    fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self;
}

/// A single number: what state is stored in.
pub trait Real: Scalar<Mask = bool> + PartialOrd {
    /// "f32" or "f64".
    const NAME: &'static str;
    /// Runs a kernel in the target's registers of several lanes; [`lanes::run`] chooses.
    ///
    /// # Safety
    /// The processor has them: AVX2, or SIMD128 of WebAssembly.
    #[cfg(any(target_arch = "x86_64", target_arch = "wasm32"))]
    #[doc(hidden)]
    #[allow(unsafe_code)]
    unsafe fn run_in_registers(kernel: impl lanes::Kernel<Self>);
    /// The same value in double precision.
    fn to_f64(self) -> f64;
    /// True unless infinite or not a number.
    fn is_finite(self) -> bool;
}

macro_rules! implement_real {
    ($type:ident $avx2:ident $simd128:ident) => {
        impl Scalar for $type {
            type Mask = bool;
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const HALF: Self = 0.5;
            const TWO: Self = 2.0;
            const EPSILON: f64 = $type::EPSILON as f64;
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $type::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $type::abs(self)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if other < self { other } else { self }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self < other { other } else { self }
            }
            #[inline(always)]
            fn less(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn all(mask: bool) -> bool {
                mask
            }
            #[inline(always)]
            fn select(mask: bool, if_true: Self, if_false: Self) -> Self {
                if mask { if_true } else { if_false }
            }
        }

        impl Real for $type {
            const NAME: &'static str = stringify!($type);
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)]
            #[inline]
            unsafe fn run_in_registers(kernel: impl lanes::Kernel<Self>) {
                // SAFETY: the caller's promise.
                unsafe { avx2::run::<avx2::$avx2>(kernel) }
            }
            #[cfg(target_arch = "wasm32")]
            #[allow(unsafe_code)]
            #[inline]
            unsafe fn run_in_registers(kernel: impl lanes::Kernel<Self>) {
                // SAFETY: the caller's promise.
                unsafe { simd128::run::<simd128::$simd128>(kernel) }
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $type::is_finite(self)
            }
        }
    };
}
implement_real!(f32 F32x8 F32x4);
implement_real!(f64 F64x4 F64x2);

/// A vector of three components.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub struct Vec3<S> {
    /// First component.
    pub x: S,
    /// Second component.
    pub y: S,
    /// Third component; up, where up matters.
    pub z: S,
}

/// Shorthand for [`Vec3::new`].
#[inline(always)]
pub const fn vec3<S>(x: S, y: S, z: S) -> Vec3<S> {
    Vec3 { x, y, z }
}

impl<S: Scalar> Vec3<S> {
    /// The zero vector.
    pub const ZERO: Self = vec3(S::ZERO, S::ZERO, S::ZERO);

    /// A vector from its components.
    #[inline(always)]
    pub const fn new(x: S, y: S, z: S) -> Self {
        vec3(x, y, z)
    }

    /// The same value in all three components.
    #[inline(always)]
    pub const fn splat(value: S) -> Self {
        vec3(value, value, value)
    }

    /// The components of vectors, one after the other.
    #[allow(unsafe_code)]
    pub(crate) fn components(vectors: &[Self]) -> &[S] {
        // SAFETY: `repr(C)` of three numbers of one type has no gaps.
        unsafe { std::slice::from_raw_parts(vectors.as_ptr().cast(), 3 * vectors.len()) }
    }

    /// A vector from an array in double precision.
    #[inline(always)]
    pub fn from_f64(v: [f64; 3]) -> Self {
        vec3(S::from_f64(v[0]), S::from_f64(v[1]), S::from_f64(v[2]))
    }

    /// The components as an array.
    #[inline(always)]
    pub fn to_array(self) -> [S; 3] {
        [self.x, self.y, self.z]
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> S {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        vec3(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// Squared length.
    #[inline(always)]
    pub fn length_squared(self) -> S {
        self.dot(self)
    }

    /// Length.
    #[inline(always)]
    pub fn length(self) -> S {
        self.dot(self).sqrt()
    }

    /// Component-wise smaller value.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        vec3(self.x.min(other.x), self.y.min(other.y), self.z.min(other.z))
    }

    /// Component-wise larger value.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        vec3(self.x.max(other.x), self.y.max(other.y), self.z.max(other.z))
    }

    /// Component-wise product.
    #[inline(always)]
    pub fn scale(self, other: Self) -> Self {
        vec3(self.x * other.x, self.y * other.y, self.z * other.z)
    }
}

impl<S: Real> Vec3<S> {
    /// The same vector in another precision.
    #[inline(always)]
    pub fn cast<T: Scalar>(self) -> Vec3<T> {
        Vec3::from_f64([self.x.to_f64(), self.y.to_f64(), self.z.to_f64()])
    }

    /// True unless a component is infinite or not a number.
    #[inline(always)]
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }
}

impl<S> Index<usize> for Vec3<S> {
    type Output = S;
    #[inline(always)]
    fn index(&self, axis: usize) -> &S {
        match axis {
            0 => &self.x,
            1 => &self.y,
            _ => &self.z,
        }
    }
}

impl<S> IndexMut<usize> for Vec3<S> {
    #[inline(always)]
    fn index_mut(&mut self, axis: usize) -> &mut S {
        match axis {
            0 => &mut self.x,
            1 => &mut self.y,
            _ => &mut self.z,
        }
    }
}

impl<S: Scalar> Add for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        vec3(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<S: Scalar> Sub for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        vec3(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<S: Scalar> Neg for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

impl<S: Scalar> Mul<S> for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: S) -> Self {
        vec3(self.x * s, self.y * s, self.z * s)
    }
}

impl<S: Scalar> AddAssign for Vec3<S> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<S: Scalar> SubAssign for Vec3<S> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

/// A 3 x 3 matrix, stored by columns.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub struct Mat3<S> {
    /// The three columns.
    pub columns: [Vec3<S>; 3],
}

impl<S: Scalar> Mat3<S> {
    /// The zero matrix.
    pub const ZERO: Self = Self { columns: [Vec3::ZERO; 3] };

    /// The identity.
    pub const IDENTITY: Self = Self {
        columns: [
            vec3(S::ONE, S::ZERO, S::ZERO),
            vec3(S::ZERO, S::ONE, S::ZERO),
            vec3(S::ZERO, S::ZERO, S::ONE),
        ],
    };

    /// A matrix from its columns.
    #[inline(always)]
    pub const fn from_columns(a: Vec3<S>, b: Vec3<S>, c: Vec3<S>) -> Self {
        Self { columns: [a, b, c] }
    }

    /// The transposed matrix.
    #[inline(always)]
    pub fn transpose(self) -> Self {
        let [a, b, c] = self.columns;
        Self::from_columns(vec3(a.x, b.x, c.x), vec3(a.y, b.y, c.y), vec3(a.z, b.z, c.z))
    }

    /// Determinant.
    #[inline(always)]
    pub fn determinant(self) -> S {
        let [a, b, c] = self.columns;
        a.dot(b.cross(c))
    }

    /// Cofactor matrix: the derivative of the determinant; `cof F = det F * F^-T`, defined for
    /// singular matrices too.
    #[inline(always)]
    pub fn cofactor(self) -> Self {
        let [a, b, c] = self.columns;
        Self::from_columns(b.cross(c), c.cross(a), a.cross(b))
    }

    /// Inverse. Not finite where the determinant is zero.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        let scale = S::ONE / self.determinant();
        self.cofactor().transpose() * scale
    }

    /// Sum of the diagonal.
    #[inline(always)]
    pub fn trace(self) -> S {
        self.columns[0].x + self.columns[1].y + self.columns[2].z
    }

    /// Squared Frobenius norm: the sum of all squared entries.
    #[inline(always)]
    pub fn norm_squared(self) -> S {
        let [a, b, c] = self.columns;
        a.dot(a) + b.dot(b) + c.dot(c)
    }

    /// Inner product `A : B`: the sum of the products of entries at the same place.
    #[inline(always)]
    pub fn dot(self, other: Self) -> S {
        let ([a, b, c], [d, e, f]) = (self.columns, other.columns);
        a.dot(d) + b.dot(e) + c.dot(f)
    }

    /// The outer product `a b^T`.
    #[inline(always)]
    pub fn outer(a: Vec3<S>, b: Vec3<S>) -> Self {
        Self::from_columns(a * b.x, a * b.y, a * b.z)
    }
}

impl<S: Real> Mat3<S> {
    /// The same matrix in another precision.
    #[inline(always)]
    pub fn cast<T: Scalar>(self) -> Mat3<T> {
        let [a, b, c] = self.columns;
        Mat3::from_columns(a.cast(), b.cast(), c.cast())
    }
}

impl<S: Scalar> Add for Mat3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.columns, o.columns);
        Self::from_columns(a + d, b + e, c + f)
    }
}

impl<S: Scalar> Sub for Mat3<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.columns, o.columns);
        Self::from_columns(a - d, b - e, c - f)
    }
}

impl<S: Scalar> Mul<S> for Mat3<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: S) -> Self {
        let [a, b, c] = self.columns;
        Self::from_columns(a * s, b * s, c * s)
    }
}

impl<S: Scalar> Mul<Vec3<S>> for Mat3<S> {
    type Output = Vec3<S>;
    #[inline(always)]
    fn mul(self, v: Vec3<S>) -> Vec3<S> {
        let [a, b, c] = self.columns;
        a * v.x + b * v.y + c * v.z
    }
}

impl<S: Scalar> Mul for Mat3<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        let [a, b, c] = o.columns;
        Self::from_columns(self * a, self * b, self * c)
    }
}
