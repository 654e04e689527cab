//! Elements that are not tetrahedra, in the order in which they were added; the list of kinds stands in [`crate::elements::list`].

use std::marker::PhantomData;

use crate::elements::attachment::Attachments;
use crate::elements::kinds::{CONSTANTS, Kind, Moment};
use crate::elements::list::{KINDS, all_kinds};
use crate::elements::spring::Springs;
use crate::scalar::{Real, Vec3};

/// The elements of one kind, each on `N` vertices with `M` multipliers.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementList<S, K, const N: usize, const M: usize> {
    /// The user's vertices, shape [element_count].
    pub vertices: Vec<[u32; N]>,
    /// Constants in the kind's order, shape [element_count].
    pub constants: Vec<[S; CONSTANTS]>,
    /// The number of each element's anchor, shape [element_count]; empty where the kind has none.
    pub anchors: Vec<u32>,
    kind: PhantomData<K>,
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

macro_rules! lists {
    (() $($field:ident $file:ident::$kind:ident $n:literal $m:literal;)*) => {
        /// The elements of all kinds.
        #[derive(Clone, Debug, PartialEq)]
        pub struct ElementLists<S> {
            $(
                #[doc = concat!("See [`crate::elements::", stringify!($file), "`].")]
                pub $field: ElementList<S, $crate::elements::$file::$kind, $n, $m>,
            )*
        }

        impl<S: Real> ElementLists<S> {
            /// From what was added of each kind.
            pub(super) fn new(given: &[Vec<Given>; KINDS]) -> Self {
                let [$($field),*] = given;
                Self { $($field: ElementList::new($field)),* }
            }

            /// Bytes of all arrays.
            pub(super) fn bytes(&self) -> usize {
                0 $(+ self.$field.bytes())*
            }
        }
    };
}
all_kinds! { [lists] () }

/// An element as it was added.
#[derive(Clone, Debug)]
pub(super) struct Given {
    pub vertices: Vec<u32>,
    pub constants: [f64; CONSTANTS],
    pub anchor: Option<u32>,
}

impl<S, K, const N: usize, const M: usize> ElementList<S, K, N, M> {
    fn new(given: &[Given]) -> Self
    where
        S: Real,
    {
        let corners = |of: &Given| std::array::from_fn(|corner| of.vertices[corner]);
        let mut anchors: Vec<u32> = given.iter().filter_map(|of| of.anchor).collect();
        anchors.shrink_to_fit();
        Self {
            vertices: given.iter().map(corners).collect(),
            constants: given.iter().map(|of| of.constants.map(S::from_f64)).collect(),
            anchors,
            kind: PhantomData,
        }
    }

    /// The same elements in another order.
    pub(crate) fn sorted(&self, order: &[u32]) -> Self
    where
        S: Copy,
    {
        let of_anchors = if self.anchors.is_empty() { &[] } else { order };
        Self {
            vertices: order.iter().map(|&i| self.vertices[i as usize]).collect(),
            constants: order.iter().map(|&i| self.constants[i as usize]).collect(),
            anchors: of_anchors.iter().map(|&i| self.anchors[i as usize]).collect(),
            kind: PhantomData,
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

    /// Bytes of its arrays.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.vertices[..])
            + size_of_val(&self.constants[..])
            + size_of_val(&self.anchors[..])
    }
}

impl<S: Real, K: Kind<N, M>, const N: usize, const M: usize> ElementList<S, K, N, M> {
    /// Element `i` in no step: nothing has moved.
    pub(crate) fn element<T: Real>(&self, i: usize, anchors: &[Vec3<S>]) -> K::Element<T> {
        self.element_in(i, anchors, None, 0.0)
    }

    /// Element `i` in a step of `dt` [s], whose vertices were at `start` [m]; `anchors` are those of all kinds.
    pub(crate) fn element_in<T: Real>(
        &self,
        i: usize,
        anchors: &[Vec3<S>],
        start: Option<[Vec3<T>; N]>,
        dt: f64,
    ) -> K::Element<T> {
        let anchor = if K::IS_ANCHORED { anchors[self.anchors[i] as usize] } else { Vec3::ZERO };
        let moment = Moment { anchor: anchor.cast(), start, dt: T::from_f64(dt) };
        K::element(self.constants[i].map(|value| T::from_f64(value.to_f64())), &moment)
    }
}

impl<S: Copy> ElementList<S, Springs, 2, 1> {
    /// Length without force [m] of one spring.
    pub fn rest_length(&self, i: usize) -> S {
        self.constants[i][0]
    }

    /// Stiffness [N/m] of one spring.
    pub fn stiffness(&self, i: usize) -> S {
        self.constants[i][1]
    }
}

impl<S: Copy> ElementList<S, Attachments, 1, 3> {
    /// Stiffness [N/m] of one attachment.
    pub fn stiffness(&self, i: usize) -> S {
        self.constants[i][0]
    }
}
