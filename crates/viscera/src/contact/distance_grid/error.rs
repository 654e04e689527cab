//! Why a surface is no instrument.

use crate::scalar::Vec3;

/// A place [m], written in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot(pub Vec3<f64>);

impl std::fmt::Display for Spot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, z] = (self.0 * 1e3).to_array();
        write!(f, "({x:.3}, {y:.3}, {z:.3}) mm")
    }
}

/// Why a surface cannot be made into a [`DistanceGrid`](super::DistanceGrid).
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolidError {
    /// Nothing there.
    #[error("it has no triangles; export the surface of the instrument as triangles")]
    Empty,
    /// More than memory and time are meant for.
    #[error("it has {count} triangles, of which {allowed} are allowed; decimate it to that number")]
    TooManyTriangles {
        /// Given.
        count: usize,
        /// At most.
        allowed: usize,
    },
    /// Contact that begins nowhere.
    #[error(
        "contact that begins {thickness} m from it; take a thickness above zero, 1 mm suits organs"
    )]
    Thickness {
        /// [m].
        thickness: f64,
    },
    /// A vertex that is nowhere.
    #[error(
        "its vertex {vertex} has a coordinate that is no finite number; remove it and export again"
    )]
    NonFinite {
        /// Its number, from 0 on.
        vertex: usize,
    },
    /// A triangle of a vertex that is not there.
    #[error(
        "its triangle {triangle} names vertex {vertex}, and there are {vertex_count}; export it again"
    )]
    UnknownVertex {
        /// Its number, from 0 on.
        triangle: usize,
        /// What it names.
        vertex: u32,
        /// How many there are.
        vertex_count: usize,
    },
    /// A surface with an inside that leaks.
    #[error(
        "its surface is open at {edges} edges, one of them from {from} to {to}; close its holes, and merge vertices that \
         lie in one place"
    )]
    Open {
        /// Edges that do not have a triangle on each side.
        edges: usize,
        /// Beginning of the first.
        from: Spot,
        /// Its end.
        to: Spot,
    },
    /// Neighbours of which one is wound outwards and the other inwards.
    #[error(
        "its triangles are wound against each other at {edges} edges, one of them at {at}; let the program that made it \
         recalculate normals outwards"
    )]
    Wound {
        /// Edges where that is so.
        edges: usize,
        /// The middle of the first.
        at: Spot,
    },
    /// Wound inwards.
    #[error("it is inside out: its triangles are wound inwards; flip its normals")]
    InsideOut,
    /// Without volume.
    #[error("it encloses no volume; give its walls a thickness")]
    Flat,
    /// A surface that goes through itself.
    #[error(
        "it goes through itself: triangle {first} crosses triangle {second} at {at}; make one solid of its parts (a union, \
         or a remesh by voxels)"
    )]
    Crossing {
        /// Of the surface, from 0 on.
        first: usize,
        /// The same.
        second: usize,
        /// Where.
        at: Spot,
    },
    /// A closed surface inside another, both wound outwards, or the same surface twice.
    #[error(
        "at {at} it is inside itself {times} times; remove what lies within its outer surface, or wind it inwards where it \
         is a hollow"
    )]
    Nested {
        /// Where.
        at: Spot,
        /// Winding number there.
        times: i32,
    },
    /// Walls that fall between the points of the grid.
    #[error(
        "its walls are {:.3} mm thick at its thinnest and its distances have cells of {:.3} mm, half of the contact's \
         `thickness`; take a `thickness` of {:.3} mm at most, or thicker walls", 1e3 * .wall, 1e3 * .cell, 2e3 * .wall
    )]
    TooThin {
        /// [m].
        wall: f64,
        /// [m].
        cell: f64,
    },
    /// A grid that takes too much memory.
    #[error(
        "its distances would take {} MiB at cells of {:.3} mm, half of the contact's `thickness`, and {} are allowed; take a \
         `thickness` of {:.3} mm or more, or cut off what tissue never meets",
        .bytes >> 20, 1e3 * .cell, .allowed >> 20, 1e3 * .thickness
    )]
    TooLarge {
        /// About so many.
        bytes: u64,
        /// At most.
        allowed: u64,
        /// [m].
        cell: f64,
        /// With which it would fit [m].
        thickness: f64,
    },
}
