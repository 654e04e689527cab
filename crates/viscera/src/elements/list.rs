//! The only list of the kinds of elements that are no tetrahedra. A new kind is a file beside this one, its twin for
//! graphics processors, and a line here.

use super::kinds::{CONSTANTS, Kind, Listed, MOST, sealed};

/// Evaluates `$with! { ($arguments) ... }` with the list of kinds: the field of the model that holds them, the
/// type, how many vertices and multipliers each has.
macro_rules! all_kinds {
    ([$($with:tt)*] $arguments:tt) => {
        $crate::elements::list::with_trials! {
            [$($with)*] $arguments
            springs spring::Springs 2 1;
            attachments attachment::Attachments 1 3;
        }
    };
}
pub(crate) use all_kinds;

/// Passes the list on.
#[cfg(not(test))]
macro_rules! with_trials {
    ([$($with:tt)*] $arguments:tt $($kinds:tt)*) => { $($with)*! { $arguments $($kinds)* } };
}
/// Puts the kinds behind it that only tests have.
#[cfg(test)]
macro_rules! with_trials {
    ([$($with:tt)*] $arguments:tt $($kinds:tt)*) => {
        $($with)*! { $arguments $($kinds)* hinges trial::Hinges 3 0; struts trial::Struts 4 1; }
    };
}
pub(crate) use with_trials;

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

        #[allow(non_camel_case_types)]
        enum Place { $($field),* }

        $(
            impl sealed::Sealed for $crate::elements::$file::$kind {}

            impl Listed for $crate::elements::$file::$kind {
                const NUMBER: usize = Place::$field as usize;
            }

            // What a record on a device has room for.
            const _: () = {
                let [vertices, multipliers]: [usize; 2] = [$n, $m];
                assert!(vertices <= MOST && multipliers <= MOST);
            };
            const _: () = assert!(
                <$crate::elements::$file::$kind as Kind<$n, $m>>::CONSTANTS.len() <= CONSTANTS
            );
        )*
    };
}
all_kinds! { [constants] () }

/// How many kinds there are.
pub const KINDS: usize = KIND_NAMES.len();
