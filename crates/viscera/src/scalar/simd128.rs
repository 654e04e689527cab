//! Lanes in the registers of WebAssembly: four `f32`, or two `f64`.
//!
//! Every operation is the one that `f32` and `f64` do themselves, so that results are the same bits. Relaxed
//! instructions, whose results differ between machines, are not used.
#![allow(unsafe_code)]
// SAFETY, of loads and stores here: their callers' promises, see [`Lanes`].
#![allow(clippy::undocumented_unsafe_blocks)]

use std::arch::wasm32::*;
use std::fmt;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use super::Scalar;
use super::lanes::{Eight, Kernel, LANES, Lanes, Point};

/// Compiles a kernel for the registers and runs it.
///
/// # Safety
/// The engine knows them.
#[target_feature(enable = "simd128")]
pub(super) unsafe fn run<L: Lanes>(kernel: impl Kernel<L::Real>) {
    kernel.run::<L>();
}

// No closures in what follows: one that is not inlined is not compiled for the registers.
macro_rules! simd128_lanes {
    ($name:ident: $real:ident, $width:literal, $doc:literal,
     $set:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $abs:ident, $neg:ident,
     $min:ident, $max:ident, $less:ident, $all:ident) => {
        #[doc = $doc]
        #[derive(Clone, Copy)]
        #[repr(transparent)]
        pub struct $name(v128);

        impl $name {
            const fn constant(value: $real) -> Self {
                // Both are the same number of bytes, and every pattern is a value.
                Self(unsafe { std::mem::transmute::<[$real; $width], v128>([value; $width]) })
            }

            fn to_array(self) -> [$real; $width] {
                unsafe { std::mem::transmute::<v128, [$real; $width]>(self.0) }
            }
        }

        simd128_lanes!(@operator $name Add add $add AddAssign add_assign);
        simd128_lanes!(@operator $name Sub sub $sub SubAssign sub_assign);
        simd128_lanes!(@operator $name Mul mul $mul MulAssign mul_assign);
        simd128_lanes!(@operator $name Div div $div);

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self($neg(self.0))
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
            type Mask = v128;
            const ZERO: Self = Self::constant(0.0);
            const ONE: Self = Self::constant(1.0);
            const HALF: Self = Self::constant(0.5);
            const TWO: Self = Self::constant(2.0);
            const EPSILON: f64 = <$real as Scalar>::EPSILON;
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                Self($set(value as $real))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self($sqrt(self.0))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self($abs(self.0))
            }
            // "Pseudo" minimum and maximum: a comparison and a choice, the first where it is false.
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self($min(self.0, other.0))
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self($max(self.0, other.0))
            }
            #[inline(always)]
            fn less(self, other: Self) -> v128 {
                $less(self.0, other.0)
            }
            #[inline(always)]
            fn all(mask: v128) -> bool {
                $all(mask)
            }
            #[inline(always)]
            fn select(mask: v128, if_true: Self, if_false: Self) -> Self {
                Self(v128_bitselect(if_true.0, if_false.0, mask))
            }
        }
    };
    (@operator $name:ident $trait:ident $method:ident $intrinsic:ident
     $assign_trait:ident $assign:ident) => {
        simd128_lanes!(@operator $name $trait $method $intrinsic);
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
                Self($intrinsic(self.0, other.0))
            }
        }
    };
    (@memory $real:ident, $width:literal, $set:ident) => {
        type Real = $real;
        const WIDTH: usize = $width;
        #[inline(always)]
        fn splat(value: $real) -> Self {
            Self($set(value))
        }
        #[inline(always)]
        fn load(group: &Eight<$real>, first: usize) -> Self {
            assert!(first + $width <= LANES);
            Self(unsafe { v128_load(group.as_ptr().add(first).cast()) })
        }
        #[inline(always)]
        fn store(self, group: &mut Eight<$real>, first: usize) {
            assert!(first + $width <= LANES);
            unsafe { v128_store(group.as_mut_ptr().add(first).cast(), self.0) }
        }
    };
}

simd128_lanes!(F32x4: f32, 4, "Four `f32`.",
    f32x4_splat, f32x4_add, f32x4_sub, f32x4_mul, f32x4_div, f32x4_sqrt, f32x4_abs, f32x4_neg,
    f32x4_pmin, f32x4_pmax, f32x4_lt, u32x4_all_true);
simd128_lanes!(F64x2: f64, 2, "Two `f64`.",
    f64x2_splat, f64x2_add, f64x2_sub, f64x2_mul, f64x2_div, f64x2_sqrt, f64x2_abs, f64x2_neg,
    f64x2_pmin, f64x2_pmax, f64x2_lt, u64x2_all_true);

impl Lanes for F32x4 {
    simd128_lanes!(@memory f32, 4, f32x4_splat);

    #[inline(always)]
    unsafe fn gather(points: *const Point<f32>, indices: &Eight<u32>, first: usize) -> Point<Self> {
        unsafe {
            let mut rows = [f32x4_splat(0.0); 4];
            for lane in 0..4 {
                rows[lane] = v128_load(points.add(indices[first + lane] as usize).cast());
            }
            let [x, y, z, w] = transpose(rows);
            Point { x: Self(x), y: Self(y), z: Self(z), w: Self(w) }
        }
    }

    #[inline(always)]
    unsafe fn scatter(
        points: *mut Point<f32>,
        indices: &Eight<u32>,
        first: usize,
        Point { x, y, z, w }: Point<Self>,
    ) {
        unsafe {
            let rows = transpose([x.0, y.0, z.0, w.0]);
            for lane in 0..4 {
                v128_store(points.add(indices[first + lane] as usize).cast(), rows[lane]);
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter_add(
        points: *mut Point<f32>,
        indices: &Eight<u32>,
        first: usize,
        Point { x, y, z, w }: Point<Self>,
    ) {
        unsafe {
            let rows = transpose([x.0, y.0, z.0, w.0]);
            for lane in 0..4 {
                let point = points.add(indices[first + lane] as usize).cast();
                v128_store(point, f32x4_add(v128_load(point), rows[lane]));
            }
        }
    }

    #[inline(always)]
    unsafe fn add_in_order(
        points: *mut Point<f32>,
        indices: &[Eight<u32>; 4],
        first: usize,
        values: [Point<Self>; 4],
    ) {
        unsafe {
            let mut rows = [[f32x4_splat(0.0); 4]; 4];
            for corner in 0..4 {
                let Point { x, y, z, w } = values[corner];
                rows[corner] = transpose([x.0, y.0, z.0, w.0]);
            }
            for lane in 0..4 {
                for corner in 0..4 {
                    let point = points.add(indices[corner][first + lane] as usize).cast();
                    v128_store(point, f32x4_add(v128_load(point), rows[corner][lane]));
                }
            }
        }
    }
}

/// Transposes a 4 x 4 matrix.
#[inline(always)]
fn transpose([a, b, c, d]: [v128; 4]) -> [v128; 4] {
    let (ab_low, ab_high) = (i32x4_shuffle::<0, 4, 1, 5>(a, b), i32x4_shuffle::<2, 6, 3, 7>(a, b));
    let (cd_low, cd_high) = (i32x4_shuffle::<0, 4, 1, 5>(c, d), i32x4_shuffle::<2, 6, 3, 7>(c, d));
    [
        i64x2_shuffle::<0, 2>(ab_low, cd_low),
        i64x2_shuffle::<1, 3>(ab_low, cd_low),
        i64x2_shuffle::<0, 2>(ab_high, cd_high),
        i64x2_shuffle::<1, 3>(ab_high, cd_high),
    ]
}

/// A point of two registers: x and y, z and w.
#[inline(always)]
unsafe fn halves(point: *const Point<f64>) -> [v128; 2] {
    unsafe { [v128_load(point.cast()), v128_load(point.cast::<v128>().add(1))] }
}

/// Both registers of the points of two lanes.
#[inline(always)]
fn of_lanes(Point { x, y, z, w }: Point<F64x2>) -> [[v128; 2]; 2] {
    [
        [i64x2_shuffle::<0, 2>(x.0, y.0), i64x2_shuffle::<0, 2>(z.0, w.0)],
        [i64x2_shuffle::<1, 3>(x.0, y.0), i64x2_shuffle::<1, 3>(z.0, w.0)],
    ]
}

/// Adds to a point.
#[inline(always)]
unsafe fn add_halves(point: *mut Point<f64>, values: [v128; 2]) {
    unsafe {
        let [xy, zw] = halves(point);
        v128_store(point.cast(), f64x2_add(xy, values[0]));
        v128_store(point.cast::<v128>().add(1), f64x2_add(zw, values[1]));
    }
}

impl Lanes for F64x2 {
    simd128_lanes!(@memory f64, 2, f64x2_splat);

    #[inline(always)]
    unsafe fn gather(points: *const Point<f64>, indices: &Eight<u32>, first: usize) -> Point<Self> {
        unsafe {
            let [xy0, zw0] = halves(points.add(indices[first] as usize));
            let [xy1, zw1] = halves(points.add(indices[first + 1] as usize));
            Point {
                x: Self(i64x2_shuffle::<0, 2>(xy0, xy1)),
                y: Self(i64x2_shuffle::<1, 3>(xy0, xy1)),
                z: Self(i64x2_shuffle::<0, 2>(zw0, zw1)),
                w: Self(i64x2_shuffle::<1, 3>(zw0, zw1)),
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter(
        points: *mut Point<f64>,
        indices: &Eight<u32>,
        first: usize,
        values: Point<Self>,
    ) {
        unsafe {
            let rows = of_lanes(values);
            for lane in 0..2 {
                let point: *mut v128 = points.add(indices[first + lane] as usize).cast();
                v128_store(point, rows[lane][0]);
                v128_store(point.add(1), rows[lane][1]);
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter_add(
        points: *mut Point<f64>,
        indices: &Eight<u32>,
        first: usize,
        values: Point<Self>,
    ) {
        unsafe {
            let rows = of_lanes(values);
            for lane in 0..2 {
                add_halves(points.add(indices[first + lane] as usize), rows[lane]);
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
            let mut rows = [[[f64x2_splat(0.0); 2]; 2]; 4];
            for corner in 0..4 {
                rows[corner] = of_lanes(values[corner]);
            }
            for lane in 0..2 {
                for corner in 0..4 {
                    let point = points.add(indices[corner][first + lane] as usize);
                    add_halves(point, rows[corner][lane]);
                }
            }
        }
    }
}
