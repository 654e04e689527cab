//! The only list of the kinds of elements that are no tetrahedra. A new kind is a file beside this one, its twin for
//! graphics processors, and a line here.

use super::kinds::Kind;

/// Evaluates `$with! { ($arguments) ... }` with the list of kinds: the field of the model that holds them, the
/// type, how many vertices and multipliers each has.
macro_rules! all_kinds {
    ([$($with:tt)*] $arguments:tt) => {
        $($with)*! {
            $arguments
            springs spring::Springs 2 1;
            attachments attachment::Attachments 1 3;
        }
    };
}
pub(crate) use all_kinds;

macro_rules! constants {
    (() $($field:ident $file:ident::$kind:ident $n:literal $m:literal;)*) => {
        /// Names of all kinds, in order.
        pub const KIND_NAMES: &[&str] = &[$(<$crate::elements::$file::$kind as Kind<$n, $m>>::NAME),*];

        /// Vertices and multipliers of one element of each kind.
        pub const KIND_SIZES: &[[usize; 2]] = &[$([$n, $m]),*];

        /// Whether each kind has anchors.
        pub const ARE_ANCHORED: &[bool] = &[$(<$crate::elements::$file::$kind as Kind<$n, $m>>::IS_ANCHORED),*];

        /// The name of each kind's functions in WGSL, and their text.
        #[cfg(feature = "gpu")]
        pub const KIND_WGSL: &[[&str; 2]] =
            &[$([stringify!($field), <$crate::elements::$file::$kind as Kind<$n, $m>>::WGSL]),*];
    };
}
all_kinds! { [constants] () }

/// How many kinds there are.
pub const KINDS: usize = KIND_NAMES.len();

/// The place of a kind in the list.
pub fn number_of<K: Kind<N, M>, const N: usize, const M: usize>() -> usize {
    KIND_NAMES.iter().position(|name| *name == K::NAME).unwrap_or(KINDS)
}
