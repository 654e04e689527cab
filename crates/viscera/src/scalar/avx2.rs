//! Lanes in AVX2 registers: one of eight `f32`, or two of four `f64`.
//!
//! Every operation is the one that [`super::Portable`] does lane by lane, so that results are the
//! same bits.
#![allow(unsafe_code)]
// SAFETY, of every intrinsic here: values of these types are made and used only in kernels that
// [`run`] has started, and that is called only where the processor has AVX2.
#![allow(clippy::undocumented_unsafe_blocks)]

use std::arch::x86_64::*;
use std::fmt;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use super::lanes::{Eight, Kernel, LANES, Lanes, Point};
use super::{Real, Scalar};

/// Compiles a kernel for AVX2 and runs it.
///
/// # Safety
/// The processor has AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn run<R: Real>(kernel: impl Kernel<R>) {
    kernel.run::<R::Fast>();
}

macro_rules! avx2_lanes {
    ($name:ident: $real:ident, $register:ident, $count:literal, $doc:literal,
     $set:ident, $load:ident, $store:ident, $add:ident, $sub:ident, $mul:ident, $div:ident,
     $sqrt:ident, $min:ident, $max:ident, $and_not:ident, $xor:ident, $compare:ident,
     $blend:ident, $movemask:ident) => {
        #[doc = $doc]
        #[derive(Clone, Copy)]
        #[repr(transparent)]
        pub struct $name([$register; $count]);

        impl $name {
            const fn constant(value: $real) -> Self {
                // SAFETY: both are the same number of bytes, and every pattern is a value.
                Self(unsafe { std::mem::transmute::<Eight<$real>, [$register; $count]>([value; LANES]) })
            }
        }

        avx2_lanes!(@operator $name $count Add add $add AddAssign add_assign);
        avx2_lanes!(@operator $name $count Sub sub $sub SubAssign sub_assign);
        avx2_lanes!(@operator $name $count Mul mul $mul MulAssign mul_assign);
        avx2_lanes!(@operator $name $count Div div $div);

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                avx2_lanes!(@each $count i: $xor(self.0[i], $set(-0.0)))
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::ZERO
            }
        }

        impl PartialEq for $name {
            #[inline(always)]
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
            type Mask = [$register; $count];
            const ZERO: Self = Self::constant(0.0);
            const ONE: Self = Self::constant(1.0);
            const HALF: Self = Self::constant(0.5);
            const TWO: Self = Self::constant(2.0);
            const EPSILON: f64 = <$real as Scalar>::EPSILON;
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                Self::splat(value as $real)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                avx2_lanes!(@each $count i: $sqrt(self.0[i]))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                avx2_lanes!(@each $count i: $and_not($set(-0.0), self.0[i]))
            }
            // The instruction answers its second operand where the comparison is false.
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                avx2_lanes!(@each $count i: $min(other.0[i], self.0[i]))
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                avx2_lanes!(@each $count i: $max(other.0[i], self.0[i]))
            }
            #[inline(always)]
            fn less(self, other: Self) -> Self::Mask {
                avx2_lanes!(@each $count i: $compare::<_CMP_LT_OQ>(self.0[i], other.0[i])).0
            }
            #[inline(always)]
            fn all(mask: Self::Mask) -> bool {
                let mut all = true;
                for i in 0..$count {
                    all &= unsafe { $movemask(mask[i]) } == (1 << (LANES / $count)) - 1;
                }
                all
            }
            #[inline(always)]
            fn select(mask: Self::Mask, if_true: Self, mut if_false: Self) -> Self {
                for i in 0..$count {
                    if_false.0[i] = unsafe { $blend(if_false.0[i], if_true.0[i], mask[i]) };
                }
                if_false
            }
        }
    };
    (@operator $name:ident $count:literal $trait:ident $method:ident $intrinsic:ident
     $assign_trait:ident $assign:ident) => {
        avx2_lanes!(@operator $name $count $trait $method $intrinsic);
        impl $assign_trait for $name {
            #[inline(always)]
            fn $assign(&mut self, other: Self) {
                *self = self.$method(other);
            }
        }
    };
    (@operator $name:ident $count:literal $trait:ident $method:ident $intrinsic:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                avx2_lanes!(@each $count i: $intrinsic(self.0[i], other.0[i]))
            }
        }
    };
    // No closures: one that is not inlined is not compiled for AVX2.
    (@each $count:literal $i:ident: $value:expr) => {{
        let mut result = Self::ZERO;
        for $i in 0..$count {
            result.0[$i] = unsafe { $value };
        }
        result
    }};
    (@memory $real:ident, $count:literal, $set:ident, $load:ident, $store:ident) => {
        type Real = $real;
        #[inline(always)]
        fn splat(value: $real) -> Self {
            Self([unsafe { $set(value) }; $count])
        }
        #[inline(always)]
        fn load(values: &Eight<$real>) -> Self {
            let mut loaded = Self::ZERO;
            for i in 0..$count {
                // SAFETY: `$count` registers are eight numbers.
                loaded.0[i] = unsafe { $load(values.as_ptr().add(i * LANES / $count)) };
            }
            loaded
        }
        #[inline(always)]
        fn store(self, values: &mut Eight<$real>) {
            for i in 0..$count {
                // SAFETY: as in `load`.
                unsafe { $store(values.as_mut_ptr().add(i * LANES / $count), self.0[i]) }
            }
        }
    };
}

avx2_lanes!(F32x8: f32, __m256, 1, "Eight `f32` in one register.",
    _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_add_ps, _mm256_sub_ps,
    _mm256_mul_ps, _mm256_div_ps, _mm256_sqrt_ps, _mm256_min_ps, _mm256_max_ps,
    _mm256_andnot_ps, _mm256_xor_ps, _mm256_cmp_ps, _mm256_blendv_ps, _mm256_movemask_ps);
avx2_lanes!(F64x8: f64, __m256d, 2, "Eight `f64` in two registers.",
    _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_add_pd, _mm256_sub_pd,
    _mm256_mul_pd, _mm256_div_pd, _mm256_sqrt_pd, _mm256_min_pd, _mm256_max_pd,
    _mm256_andnot_pd, _mm256_xor_pd, _mm256_cmp_pd, _mm256_blendv_pd, _mm256_movemask_pd);

impl Lanes for F32x8 {
    avx2_lanes!(@memory f32, 1, _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps);

    #[inline(always)]
    unsafe fn gather(points: *const Point<f32>, indices: &Eight<u32>) -> Point<Self> {
        unsafe {
            // Lanes 0 to 3 in the lower half, 4 to 7 in the upper one.
            let mut rows = [_mm256_setzero_ps(); 4];
            for lane in 0..4 {
                let lower = _mm_load_ps(points.add(indices[lane] as usize).cast());
                let upper = _mm_load_ps(points.add(indices[lane + 4] as usize).cast());
                rows[lane] = _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(lower), upper);
            }
            let [x, y, z, w] = transpose(rows);
            Point { x: Self([x]), y: Self([y]), z: Self([z]), w: Self([w]) }
        }
    }

    #[inline(always)]
    unsafe fn scatter(points: *mut Point<f32>, indices: &Eight<u32>, values: Point<Self>) {
        unsafe {
            let rows = transpose([values.x.0[0], values.y.0[0], values.z.0[0], values.w.0[0]]);
            for lane in 0..4 {
                let lower = points.add(indices[lane] as usize).cast();
                _mm_store_ps(lower, _mm256_castps256_ps128(rows[lane]));
                let upper = points.add(indices[lane + 4] as usize).cast();
                _mm_store_ps(upper, _mm256_extractf128_ps::<1>(rows[lane]));
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter_add(points: *mut Point<f32>, indices: &Eight<u32>, values: Point<Self>) {
        unsafe {
            let rows = transpose([values.x.0[0], values.y.0[0], values.z.0[0], values.w.0[0]]);
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

impl Lanes for F64x8 {
    avx2_lanes!(@memory f64, 2, _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd);

    #[inline(always)]
    unsafe fn gather(points: *const Point<f64>, indices: &Eight<u32>) -> Point<Self> {
        unsafe {
            let mut rows = [_mm256_setzero_pd(); LANES];
            for lane in 0..LANES {
                rows[lane] = _mm256_loadu_pd(points.add(indices[lane] as usize).cast());
            }
            let lower = transpose_doubles([rows[0], rows[1], rows[2], rows[3]]);
            let upper = transpose_doubles([rows[4], rows[5], rows[6], rows[7]]);
            Point {
                x: Self([lower[0], upper[0]]),
                y: Self([lower[1], upper[1]]),
                z: Self([lower[2], upper[2]]),
                w: Self([lower[3], upper[3]]),
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter(points: *mut Point<f64>, indices: &Eight<u32>, values: Point<Self>) {
        unsafe {
            let Point { x, y, z, w } = values;
            for half in 0..2 {
                let rows = transpose_doubles([x.0[half], y.0[half], z.0[half], w.0[half]]);
                for lane in 0..4 {
                    let point = points.add(indices[4 * half + lane] as usize).cast();
                    _mm256_storeu_pd(point, rows[lane]);
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter_add(points: *mut Point<f64>, indices: &Eight<u32>, values: Point<Self>) {
        unsafe {
            let Point { x, y, z, w } = values;
            for half in 0..2 {
                let rows = transpose_doubles([x.0[half], y.0[half], z.0[half], w.0[half]]);
                for lane in 0..4 {
                    let point = points.add(indices[4 * half + lane] as usize).cast();
                    _mm256_storeu_pd(point, _mm256_add_pd(_mm256_loadu_pd(point), rows[lane]));
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
