//! Elements that are not tetrahedra, set by set; the list of kinds stands in [`crate::elements::list`].

use std::marker::PhantomData;
use std::ops::Range;

use super::Model;
use super::numbering::Numbering;
use super::parts::{LaidElements, Part};
use crate::elements::attachment::Attachments;
use crate::elements::kinds::{CONSTANTS, Kind, Moment};
use crate::elements::list::{KINDS, all_kinds};
use crate::elements::spring::Springs;
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};

/// The elements of one kind, each on `N` vertices with `M` multipliers, sorted by colour.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementSet<S, K, const N: usize, const M: usize> {
    /// The user's vertices, shape [element_count].
    pub vertices: Vec<[u32; N]>,
    /// The copies that a sweep works on, shape [element_count].
    pub copies: Vec<[u32; N]>,
    /// Constants in the kind's order, shape [element_count].
    pub constants: Vec<[S; CONSTANTS]>,
    /// The number of each element's anchor, shape [element_count]; empty where the kind has none.
    pub anchors: Vec<u32>,
    /// The user's number of each element, shape [element_count].
    pub order: Vec<u32>,
    /// Elements of colour `c` are `color_offsets[c] .. color_offsets[c + 1]`.
    pub color_offsets: Vec<u32>,
    /// First multiplier of the set.
    pub multiplier_offset: usize,
    /// Which of the list of kinds it is.
    pub(crate) number: usize,
    pub(super) kind: PhantomData<K>,
}

/// What elements of a step depend on beside their constants.
pub(crate) struct Moments<'a, S> {
    /// Of all kinds, the user's order [m].
    pub anchors: &'a [Vec3<S>],
    pub start: Before<'a, S>,
    /// The step [s].
    pub dt: f64,
    pub numbering: &'a Numbering,
}

/// Where vertices were one step ago, the solver's order.
#[derive(Clone, Copy)]
pub(crate) enum Before<'a, S> {
    /// Where they are.
    AtRest,
    /// There [m].
    Places(&'a [Point<S>]),
    /// Their places [m] and velocities [m/s] are so.
    Moving(&'a [Point<S>], &'a [Vec3<S>]),
}

impl<'a, S: Real> Moments<'a, S> {
    /// In no step: anchors are where they are, nothing has moved.
    pub fn at_rest(model: &'a Model<S>, anchors: &'a [Vec3<S>]) -> Self {
        Self { anchors, start: Before::AtRest, dt: 0.0, numbering: &model.numbering }
    }
}

/// Evaluates an expression with `$set` as the set of each kind in turn.
macro_rules! for_each_kind {
    ($model:expr, $set:ident => $result:expr) => {
        $crate::elements::list::all_kinds! { [$crate::model::elements::each_set] ($model, $set, $result) }
    };
}
pub(crate) use for_each_kind;

macro_rules! each_set {
    (($model:expr, $set:ident, $result:expr) $($field:ident $file:ident::$kind:ident $n:literal $m:literal;)*) => {{
        $({
            let $set = &$model.elements.$field;
            $result
        })*
    }};
}
pub(crate) use each_set;

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
            pub(super) fn laid_out(layout: &mut impl LayOut<S>) -> Self {
                let mut numbers = 0..;
                let mut next = || numbers.next().unwrap_or_default();
                Self { $($field: layout.lay_out::<$crate::elements::$file::$kind, $n, $m>(next())),* }
            }

            /// For the parts.
            pub(super) fn laid(&self, numbering: &Numbering) -> [LaidElements<'_>; KINDS] {
                [$(self.$field.laid(numbering)),*]
            }

            /// Bytes of all arrays.
            pub(super) fn bytes(&self) -> usize {
                0 $(+ self.$field.bytes())*
            }
        }
    };
}
all_kinds! { [sets] () }

/// Lays out the elements of one kind, whose place in the list is `number`.
pub(super) trait LayOut<S> {
    fn lay_out<K: Kind<N, M>, const N: usize, const M: usize>(
        &mut self,
        number: usize,
    ) -> ElementSet<S, K, N, M>;
}

impl<S, K, const N: usize, const M: usize> ElementSet<S, K, N, M> {
    /// Nothing yet.
    pub(super) fn new(number: usize) -> Self {
        Self {
            vertices: Vec::new(),
            copies: Vec::new(),
            constants: Vec::new(),
            anchors: Vec::new(),
            order: Vec::new(),
            color_offsets: Vec::new(),
            multiplier_offset: 0,
            number,
            kind: PhantomData,
        }
    }

    fn laid(&self, numbering: &Numbering) -> LaidElements<'_> {
        LaidElements {
            vertices: self.vertices.iter().map(|all| numbering.of(all[0]) as u32).collect(),
            color_offsets: &self.color_offsets,
            multiplier_offset: self.multiplier_offset,
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// True where there is none.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
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

    /// Bytes of its arrays.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.vertices[..])
            + size_of_val(&self.copies[..])
            + size_of_val(&self.constants[..])
            + size_of_val(&self.anchors[..])
            + size_of_val(&self.order[..])
    }
}

impl<S: Real, K: Kind<N, M>, const N: usize, const M: usize> ElementSet<S, K, N, M> {
    /// Element `i` in one step.
    pub(crate) fn element<T: Real>(&self, i: usize, moments: &Moments<'_, S>) -> K::Element<T> {
        let before = |place: &dyn Fn(usize) -> Vec3<S>| {
            Some(self.vertices[i].map(|v| place(moments.numbering.of(v)).cast()))
        };
        let start = match moments.start {
            Before::AtRest => None,
            Before::Places(places) => before(&|v| places[v].vec3()),
            Before::Moving(places, velocities) => {
                let dt = S::from_f64(moments.dt);
                before(&|v| places[v].vec3() - velocities[v] * dt)
            }
        };
        let anchor =
            if K::IS_ANCHORED { moments.anchors[self.anchors[i] as usize] } else { Vec3::ZERO };
        let moment = Moment { anchor: anchor.cast(), start, dt: T::from_f64(moments.dt) };
        K::element(self.constants[i].map(|value| T::from_f64(value.to_f64())), &moment)
    }

    /// Its multipliers.
    pub(crate) fn read(&self, i: usize, multipliers: &[S]) -> [S; M] {
        let first = self.multipliers(i).start;
        std::array::from_fn(|p| multipliers[first + p])
    }

    /// Where its vertices are, out of positions in the solver's numbering [m].
    pub(crate) fn places(&self, i: usize, numbering: &Numbering, x: &[Point<S>]) -> [Vec3<S>; N] {
        self.vertices[i].map(|v| x[numbering.of(v)].vec3())
    }
}

impl<S: Copy> ElementSet<S, Springs, 2, 1> {
    /// Length without force [m] of one spring.
    pub fn rest_length(&self, i: usize) -> S {
        self.constants[i][0]
    }

    /// Stiffness [N/m] of one spring.
    pub fn stiffness(&self, i: usize) -> S {
        self.constants[i][1]
    }
}

impl<S: Copy> ElementSet<S, Attachments, 1, 3> {
    /// Stiffness [N/m] of one attachment.
    pub fn stiffness(&self, i: usize) -> S {
        self.constants[i][0]
    }
}
