//! Bits of `Job::mode` in the kernels of the guard; WGSL has them under the same names.

macro_rules! modes {
    ($($name:ident = $value:literal;)*) => {
        $(pub const $name: u32 = $value;)*

        /// All of them.
        pub const MODES: &[(&str, u32)] = &[$((stringify!($name), $name)),*];
    };
}

modes! {
    // Of `evaluate`.
    WITH_STARTS = 1;
    WITH_MOTION = 2;
    UNLESS_GOOD = 4;
    IF_REJECTED = 8;
    // Of `search` and `take`: what is decided,
    CHOOSES = 1;
    JUDGES_STEP = 2;
    JUDGES_MIXTURE = 4;
    JUDGES_PLAIN = 8;
    PICKS_SHARE = 16;
    PICKS_LENGTH = 32;
    TAKES_DESCENT = 64;
    // and what is done.
    TRIES_SHARES = 128;
    LOADS_FORCES = 256;
    TRIES_LENGTHS = 512;
}
