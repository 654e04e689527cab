//! Tests of the reference that need nothing but itself; it is held against the solver in `viscera-lab`.

mod balanced;
mod courses;
mod derivatives;
