//! The Newton reference.
