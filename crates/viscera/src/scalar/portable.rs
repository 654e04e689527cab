//! Lanes as an array: any processor.
#![allow(unsafe_code)]

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use super::lanes::{Eight, LANES, Lanes, Point};
use super::{Real, Scalar};

/// Eight lanes as an array.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Portable<S>(Eight<S>);

impl<S: Real> Portable<S> {
    #[inline(always)]
    fn map(mut self, f: impl Fn(S) -> S) -> Self {
        for lane in 0..LANES {
            self.0[lane] = f(self.0[lane]);
        }
        self
    }

    #[inline(always)]
    fn zip(mut self, other: Self, f: impl Fn(S, S) -> S) -> Self {
        for lane in 0..LANES {
            self.0[lane] = f(self.0[lane], other.0[lane]);
        }
        self
    }
}

macro_rules! operator {
    ($trait:ident $method:ident $assign_trait:ident $assign:ident) => {
        operator!($trait $method);
        impl<S: Real> $assign_trait for Portable<S> {
            #[inline(always)]
            fn $assign(&mut self, other: Self) {
                *self = self.$method(other);
            }
        }
    };
    ($trait:ident $method:ident) => {
        impl<S: Real> $trait for Portable<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a.$method(b))
            }
        }
    };
}
operator!(Add add AddAssign add_assign);
operator!(Sub sub SubAssign sub_assign);
operator!(Mul mul MulAssign mul_assign);
operator!(Div div);

impl<S: Real> Neg for Portable<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl<S: Real> Scalar for Portable<S> {
    type Mask = Eight<bool>;
    const ZERO: Self = Self([S::ZERO; LANES]);
    const ONE: Self = Self([S::ONE; LANES]);
    const HALF: Self = Self([S::HALF; LANES]);
    const TWO: Self = Self([S::TWO; LANES]);
    const EPSILON: f64 = S::EPSILON;
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self([S::from_f64(value); LANES])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(S::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(S::abs)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, S::min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, S::max)
    }
    #[inline(always)]
    fn less(self, other: Self) -> Eight<bool> {
        let mut mask = [false; LANES];
        for lane in 0..LANES {
            mask[lane] = self.0[lane] < other.0[lane];
        }
        mask
    }
    #[inline(always)]
    fn all(mask: Eight<bool>) -> bool {
        let mut all = true;
        for lane in 0..LANES {
            all &= mask[lane];
        }
        all
    }
    #[inline(always)]
    fn select(mask: Eight<bool>, if_true: Self, mut if_false: Self) -> Self {
        for lane in 0..LANES {
            if_false.0[lane] = S::select(mask[lane], if_true.0[lane], if_false.0[lane]);
        }
        if_false
    }
}

impl<S: Real> Lanes for Portable<S> {
    type Real = S;
    #[inline(always)]
    fn splat(value: S) -> Self {
        Self([value; LANES])
    }
    #[inline(always)]
    fn load(values: &Eight<S>) -> Self {
        Self(*values)
    }
    #[inline(always)]
    fn store(self, values: &mut Eight<S>) {
        *values = self.0;
    }
    #[inline(always)]
    unsafe fn gather(points: *const Point<S>, indices: &Eight<u32>) -> Point<Self> {
        let mut columns = Point { x: Self::ZERO, y: Self::ZERO, z: Self::ZERO, w: Self::ZERO };
        for lane in 0..LANES {
            // SAFETY: the caller's promise.
            let point = unsafe { *points.add(indices[lane] as usize) };
            columns.x.0[lane] = point.x;
            columns.y.0[lane] = point.y;
            columns.z.0[lane] = point.z;
            columns.w.0[lane] = point.w;
        }
        columns
    }
    #[inline(always)]
    unsafe fn scatter(points: *mut Point<S>, indices: &Eight<u32>, values: Point<Self>) {
        for lane in 0..LANES {
            // SAFETY: the caller's promise.
            unsafe { *points.add(indices[lane] as usize) = row(&values, lane) };
        }
    }
    #[inline(always)]
    unsafe fn scatter_add(points: *mut Point<S>, indices: &Eight<u32>, values: Point<Self>) {
        for lane in 0..LANES {
            let value = row(&values, lane);
            // SAFETY: the caller's promise.
            let point = unsafe { &mut *points.add(indices[lane] as usize) };
            point.x += value.x;
            point.y += value.y;
            point.z += value.z;
            point.w += value.w;
        }
    }
}

#[inline(always)]
fn row<S: Real>(values: &Point<Portable<S>>, lane: usize) -> Point<S> {
    Point { x: values.x.0[lane], y: values.y.0[lane], z: values.z.0[lane], w: values.w.0[lane] }
}
