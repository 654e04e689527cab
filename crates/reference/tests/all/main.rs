//! Tests of the reference that need nothing but itself; it is held against the solver in `viscera-lab`.

mod courses;
mod derivatives;
