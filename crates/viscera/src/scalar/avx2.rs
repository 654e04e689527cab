//! Lanes in AVX2 registers: eight `f32`, or four `f64`.
//!
//! Every operation is the one that `f32` and `f64` do themselves, so that results are the same bits.
#![allow(unsafe_code)]
// SAFETY, of every intrinsic here: values of these types are made and used only in kernels that
// [`run`] has started, and that is called only where the processor has AVX2.
#![allow(clippy::undocumented_unsafe_blocks)]

use std::arch::x86_64::*;
use std::fmt;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use super::Scalar;
use super::lanes::{Eight, Kernel, LANES, Lanes, Point};

/// Compiles a kernel for AVX2 and runs it.
///
/// # Safety
/// The processor has AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn run<L: Lanes>(kernel: impl Kernel<L::Real>) {
    kernel.run::<L>();
}

// No closures in what follows: one that is not inlined is not compiled for AVX2.
macro_rules! avx2_lanes {
    ($name:ident: $real:ident, $register:ident, $width:literal, $doc:literal,
     $set:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $min:ident,
     $max:ident, $and_not:ident, $xor:ident, $compare:ident, $blend:ident, $movemask:ident) => {
        #[doc = $doc]
        #[derive(Clone, Copy)]
        #[repr(transparent)]
        pub struct $name($register);

        impl $name {
            const fn constant(value: $real) -> Self {
                // Both are the same number of bytes, and every pattern is a value.
                Self(unsafe { std::mem::transmute::<[$real; $width], $register>([value; $width]) })
            }

            fn to_array(self) -> [$real; $width] {
                unsafe { std::mem::transmute::<$register, [$real; $width]>(self.0) }
            }
        }

        avx2_lanes!(@operator $name Add add $add AddAssign add_assign);
        avx2_lanes!(@operator $name Sub sub $sub SubAssign sub_assign);
        avx2_lanes!(@operator $name Mul mul $mul MulAssign mul_assign);
        avx2_lanes!(@operator $name Div div $div);

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(unsafe { $xor(self.0, $set(-0.0)) })
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::ZERO
            }
        }

        impl PartialEq for $name {
            fn eq(&self, other: &Self) -> bool {
                self.to_array() == other.to_array()
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.to_array().fmt(f)
            }
        }

        impl Scalar for $name {
            type Mask = $register;
            const ZERO: Self = Self::constant(0.0);
            const ONE: Self = Self::constant(1.0);
            const HALF: Self = Self::constant(0.5);
            const TWO: Self = Self::constant(2.0);
            const EPSILON: f64 = <$real as Scalar>::EPSILON;
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                Self(unsafe { $set(value as $real) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(unsafe { $and_not($set(-0.0), self.0) })
            }
            // The instruction answers its second operand where the comparison is false.
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self(unsafe { $min(other.0, self.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self(unsafe { $max(other.0, self.0) })
            }
            #[inline(always)]
            fn less(self, other: Self) -> $register {
                unsafe { $compare::<_CMP_LT_OQ>(self.0, other.0) }
            }
            #[inline(always)]
            fn all(mask: $register) -> bool {
                (unsafe { $movemask(mask) }) == (1 << $width) - 1
            }
            #[inline(always)]
            fn select(mask: $register, if_true: Self, if_false: Self) -> Self {
                Self(unsafe { $blend(if_false.0, if_true.0, mask) })
            }
        }
    };
    (@operator $name:ident $trait:ident $method:ident $intrinsic:ident
     $assign_trait:ident $assign:ident) => {
        avx2_lanes!(@operator $name $trait $method $intrinsic);
        impl $assign_trait for $name {
            #[inline(always)]
            fn $assign(&mut self, other: Self) {
                *self = self.$method(other);
            }
        }
    };
    (@operator $name:ident $trait:ident $method:ident $intrinsic:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
    (@memory $real:ident, $width:literal, $set:ident, $load:ident, $store:ident) => {
        type Real = $real;
        const WIDTH: usize = $width;
        #[inline(always)]
        fn splat(value: $real) -> Self {
            Self(unsafe { $set(value) })
        }
        #[inline(always)]
        fn load(group: &Eight<$real>, first: usize) -> Self {
            assert!(first + $width <= LANES);
            Self(unsafe { $load(group.as_ptr().add(first)) })
        }
        #[inline(always)]
        fn store(self, group: &mut Eight<$real>, first: usize) {
            assert!(first + $width <= LANES);
            unsafe { $store(group.as_mut_ptr().add(first), self.0) }
        }
    };
}

avx2_lanes!(F32x8: f32, __m256, 8, "Eight `f32`.",
    _mm256_set1_ps, _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_div_ps, _mm256_sqrt_ps,
    _mm256_min_ps, _mm256_max_ps, _mm256_andnot_ps, _mm256_xor_ps, _mm256_cmp_ps,
    _mm256_blendv_ps, _mm256_movemask_ps);
avx2_lanes!(F64x4: f64, __m256d, 4, "Four `f64`.",
    _mm256_set1_pd, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_div_pd, _mm256_sqrt_pd,
    _mm256_min_pd, _mm256_max_pd, _mm256_andnot_pd, _mm256_xor_pd, _mm256_cmp_pd,
    _mm256_blendv_pd, _mm256_movemask_pd);

impl Lanes for F32x8 {
    avx2_lanes!(@memory f32, 8, _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps);

    #[inline(always)]
    unsafe fn gather(points: *const Point<f32>, indices: &Eight<u32>, _: usize) -> Point<Self> {
        unsafe {
            // Lanes 0 to 3 in the lower half, 4 to 7 in the upper one.
            let mut rows = [_mm256_setzero_ps(); 4];
            for lane in 0..4 {
                let lower = _mm_load_ps(points.add(indices[lane] as usize).cast());
                let upper = _mm_load_ps(points.add(indices[lane + 4] as usize).cast());
                rows[lane] = _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(lower), upper);
            }
            let [x, y, z, w] = transpose(rows);
            Point { x: Self(x), y: Self(y), z: Self(z), w: Self(w) }
        }
    }

    #[inline(always)]
    unsafe fn scatter(
        points: *mut Point<f32>,
        indices: &Eight<u32>,
        _: usize,
        Point { x, y, z, w }: Point<Self>,
    ) {
        unsafe {
            let rows = transpose([x.0, y.0, z.0, w.0]);
            for lane in 0..4 {
                let lower = points.add(indices[lane] as usize).cast();
                _mm_store_ps(lower, _mm256_castps256_ps128(rows[lane]));
                let upper = points.add(indices[lane + 4] as usize).cast();
                _mm_store_ps(upper, _mm256_extractf128_ps::<1>(rows[lane]));
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter_add(
        points: *mut Point<f32>,
        indices: &Eight<u32>,
        _: usize,
        Point { x, y, z, w }: Point<Self>,
    ) {
        unsafe {
            let rows = transpose([x.0, y.0, z.0, w.0]);
            for lane in 0..4 {
                let lower = points.add(indices[lane] as usize).cast();
                let value = _mm256_castps256_ps128(rows[lane]);
                _mm_store_ps(lower, _mm_add_ps(_mm_load_ps(lower), value));
                let upper = points.add(indices[lane + 4] as usize).cast();
                let value = _mm256_extractf128_ps::<1>(rows[lane]);
                _mm_store_ps(upper, _mm_add_ps(_mm_load_ps(upper), value));
            }
        }
    }

    #[inline(always)]
    unsafe fn add_in_order(
        points: *mut Point<f32>,
        indices: &[Eight<u32>; 4],
        _: usize,
        values: [Point<Self>; 4],
    ) {
        unsafe {
            let mut rows = [[_mm256_setzero_ps(); 4]; 4];
            for corner in 0..4 {
                let Point { x, y, z, w } = values[corner];
                rows[corner] = transpose([x.0, y.0, z.0, w.0]);
            }
            for lane in 0..4 {
                for corner in 0..4 {
                    let point = points.add(indices[corner][lane] as usize).cast();
                    let value = _mm256_castps256_ps128(rows[corner][lane]);
                    _mm_store_ps(point, _mm_add_ps(_mm_load_ps(point), value));
                }
            }
            for lane in 0..4 {
                for corner in 0..4 {
                    let point = points.add(indices[corner][lane + 4] as usize).cast();
                    let value = _mm256_extractf128_ps::<1>(rows[corner][lane]);
                    _mm_store_ps(point, _mm_add_ps(_mm_load_ps(point), value));
                }
            }
        }
    }
}

/// Transposes the 4 x 4 matrices in both halves.
#[inline(always)]
unsafe fn transpose(rows: [__m256; 4]) -> [__m256; 4] {
    unsafe {
        let pairs = [
            _mm256_castps_pd(_mm256_unpacklo_ps(rows[0], rows[1])),
            _mm256_castps_pd(_mm256_unpackhi_ps(rows[0], rows[1])),
            _mm256_castps_pd(_mm256_unpacklo_ps(rows[2], rows[3])),
            _mm256_castps_pd(_mm256_unpackhi_ps(rows[2], rows[3])),
        ];
        [
            _mm256_castpd_ps(_mm256_unpacklo_pd(pairs[0], pairs[2])),
            _mm256_castpd_ps(_mm256_unpackhi_pd(pairs[0], pairs[2])),
            _mm256_castpd_ps(_mm256_unpacklo_pd(pairs[1], pairs[3])),
            _mm256_castpd_ps(_mm256_unpackhi_pd(pairs[1], pairs[3])),
        ]
    }
}

impl Lanes for F64x4 {
    avx2_lanes!(@memory f64, 4, _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd);

    #[inline(always)]
    unsafe fn gather(points: *const Point<f64>, indices: &Eight<u32>, first: usize) -> Point<Self> {
        unsafe {
            let mut rows = [_mm256_setzero_pd(); 4];
            for lane in 0..4 {
                rows[lane] = _mm256_loadu_pd(points.add(indices[first + lane] as usize).cast());
            }
            let [x, y, z, w] = transpose_doubles(rows);
            Point { x: Self(x), y: Self(y), z: Self(z), w: Self(w) }
        }
    }

    #[inline(always)]
    unsafe fn scatter(
        points: *mut Point<f64>,
        indices: &Eight<u32>,
        first: usize,
        Point { x, y, z, w }: Point<Self>,
    ) {
        unsafe {
            let rows = transpose_doubles([x.0, y.0, z.0, w.0]);
            for lane in 0..4 {
                let point = points.add(indices[first + lane] as usize).cast();
                _mm256_storeu_pd(point, rows[lane]);
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter_add(
        points: *mut Point<f64>,
        indices: &Eight<u32>,
        first: usize,
        Point { x, y, z, w }: Point<Self>,
    ) {
        unsafe {
            let rows = transpose_doubles([x.0, y.0, z.0, w.0]);
            for lane in 0..4 {
                let point = points.add(indices[first + lane] as usize).cast();
                _mm256_storeu_pd(point, _mm256_add_pd(_mm256_loadu_pd(point), rows[lane]));
            }
        }
    }

    #[inline(always)]
    unsafe fn add_in_order(
        points: *mut Point<f64>,
        indices: &[Eight<u32>; 4],
        first: usize,
        values: [Point<Self>; 4],
    ) {
        unsafe {
            let mut rows = [[_mm256_setzero_pd(); 4]; 4];
            for corner in 0..4 {
                let Point { x, y, z, w } = values[corner];
                rows[corner] = transpose_doubles([x.0, y.0, z.0, w.0]);
            }
            for lane in 0..4 {
                for corner in 0..4 {
                    let point = points.add(indices[corner][first + lane] as usize).cast();
                    let sum = _mm256_add_pd(_mm256_loadu_pd(point), rows[corner][lane]);
                    _mm256_storeu_pd(point, sum);
                }
            }
        }
    }
}

/// Transposes a 4 x 4 matrix.
#[inline(always)]
unsafe fn transpose_doubles(rows: [__m256d; 4]) -> [__m256d; 4] {
    unsafe {
        let pairs = [
            _mm256_unpacklo_pd(rows[0], rows[1]),
            _mm256_unpackhi_pd(rows[0], rows[1]),
            _mm256_unpacklo_pd(rows[2], rows[3]),
            _mm256_unpackhi_pd(rows[2], rows[3]),
        ];
        [
            _mm256_permute2f128_pd::<0x20>(pairs[0], pairs[2]),
            _mm256_permute2f128_pd::<0x20>(pairs[1], pairs[3]),
            _mm256_permute2f128_pd::<0x31>(pairs[0], pairs[2]),
            _mm256_permute2f128_pd::<0x31>(pairs[1], pairs[3]),
        ]
    }
}
