//! Elements that are not tetrahedra, sorted by colour.

use std::ops::{Deref, Range};

use super::order::Order;
use super::parts::{LaidElements, Part};
use crate::elements::kinds::Kind;
use crate::elements::list::{KINDS, all_kinds};
use crate::model::{ElementList, ElementLists};
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};

/// The elements of one kind, each on `N` vertices with `M` multipliers, sorted by colour.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementSet<S, K, const N: usize, const M: usize> {
    /// The elements, sorted.
    pub list: ElementList<S, K, N, M>,
    /// The solver's vertices, shape [element_count].
    pub(crate) points: Vec<[u32; N]>,
    /// The copies that a sweep works on, shape [element_count].
    pub copies: Vec<[u32; N]>,
    /// The user's number of each element, shape [element_count].
    pub order: Vec<u32>,
    /// Elements of colour `c` are `color_offsets[c] .. color_offsets[c + 1]`.
    pub color_offsets: Vec<u32>,
    /// First multiplier of the set.
    pub multiplier_offset: usize,
    /// Which of the list of kinds it is.
    pub(crate) number: usize,
}

/// What elements of a step depend on beside their constants.
pub(crate) struct Moments<'a, S> {
    /// Of all kinds, the user's order [m].
    pub anchors: &'a [Vec3<S>],
    pub start: Before<'a, S>,
    /// The step [s].
    pub dt: f64,
}

/// Where vertices were one step ago, the solver's order.
#[derive(Clone, Copy)]
pub(crate) enum Before<'a, S> {
    /// There [m].
    Places(&'a [Point<S>]),
    /// Their places [m] and velocities [m/s] are so.
    Moving(&'a [Point<S>], &'a [Vec3<S>]),
}

impl<S, K, const N: usize, const M: usize> Deref for ElementSet<S, K, N, M> {
    type Target = ElementList<S, K, N, M>;

    fn deref(&self) -> &Self::Target {
        &self.list
    }
}

macro_rules! sets {
    (() $($field:ident $file:ident::$kind:ident $n:literal $m:literal;)*) => {
        /// The sets of all kinds.
        #[derive(Clone, Debug, PartialEq)]
        pub struct ElementSets<S> {
            $(
                #[doc = concat!("See [`crate::elements::", stringify!($file), "`].")]
                pub $field: ElementSet<S, $crate::elements::$file::$kind, $n, $m>,
            )*
        }

        impl<S: Real> ElementSets<S> {
            /// One set after the other.
            pub(super) fn new(lists: &ElementLists<S>, order: &mut Order<'_>) -> Self {
                let mut number = 0;
                let mut next = || {
                    number += 1;
                    number - 1
                };
                Self { $($field: ElementSet::new(&lists.$field, next(), order)),* }
            }

            /// For the parts.
            pub(super) fn laid(&self) -> [LaidElements<'_>; KINDS] {
                [$(self.$field.laid()),*]
            }

            /// Bytes of all arrays.
            pub(super) fn bytes(&self) -> usize {
                0 $(+ self.$field.bytes())*
            }
        }
    };
}
all_kinds! { [sets] () }

impl<S: Copy, K, const N: usize, const M: usize> ElementSet<S, K, N, M> {
    /// Behind all that the order has sorted so far.
    fn new(list: &ElementList<S, K, N, M>, number: usize, sorted: &mut Order<'_>) -> Self {
        let (first, count) = (sorted.sorted, list.len());
        sorted.sorted += count;
        let (constraints, color_offsets) = sorted.sort(first as u32..(first + count) as u32);
        let order: Vec<u32> = constraints.iter().map(|&c| c - first as u32).collect();
        let copies = constraints.iter().map(|&c| sorted.copies(c as usize)).collect();
        let multiplier_offset = sorted.take_multipliers(M * count);
        let list = list.sorted(&order);
        let points = list.vertices.iter().map(|all| all.map(|v| sorted.numbering.of(v) as u32));
        let points = points.collect();
        Self { list, points, copies, order, color_offsets, multiplier_offset, number }
    }

    fn laid(&self) -> LaidElements<'_> {
        LaidElements {
            vertices: self.points.iter().map(|all| all[0]).collect(),
            color_offsets: &self.color_offsets,
            multiplier_offset: self.multiplier_offset,
        }
    }

    /// Those of one colour.
    pub(crate) fn color(&self, color: usize) -> Range<usize> {
        self.color_offsets[color] as usize..self.color_offsets[color + 1] as usize
    }

    /// Those of one connected part.
    pub(crate) fn of_part<'p>(
        &self,
        part: &'p Part,
    ) -> impl Iterator<Item = usize> + use<'p, S, K, N, M> {
        part.elements(self.number)
    }

    /// Where the multipliers of an element stand.
    pub fn multipliers(&self, i: usize) -> Range<usize> {
        let first = self.multiplier_offset + M * i;
        first..first + M
    }

    /// Its multipliers.
    pub(crate) fn read(&self, i: usize, multipliers: &[S]) -> [S; M] {
        let first = self.multipliers(i).start;
        std::array::from_fn(|p| multipliers[first + p])
    }

    /// Bytes of its arrays.
    fn bytes(&self) -> usize {
        self.list.bytes()
            + size_of_val(&self.points[..])
            + size_of_val(&self.copies[..])
            + size_of_val(&self.order[..])
    }
}

impl<S: Real, K: Kind<N, M>, const N: usize, const M: usize> ElementSet<S, K, N, M> {
    /// Element `i` in one step.
    pub(crate) fn element<T: Real>(&self, i: usize, moments: &Moments<'_, S>) -> K::Element<T> {
        let start = match moments.start {
            Before::Places(places) => self.points[i].map(|v| places[v as usize].vec3()),
            Before::Moving(places, velocities) => {
                let dt = S::from_f64(moments.dt);
                self.points[i].map(|v| places[v as usize].vec3() - velocities[v as usize] * dt)
            }
        };
        self.element_in(i, moments.anchors, Some(start.map(|x| x.cast())), moments.dt)
    }

    /// Where its vertices are, out of positions in the solver's numbering [m].
    pub(crate) fn places(&self, i: usize, x: &[Point<S>]) -> [Vec3<S>; N] {
        self.points[i].map(|v| x[v as usize].vec3())
    }
}
