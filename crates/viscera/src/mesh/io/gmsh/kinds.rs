//! Element types of Gmsh: "Node ordering" in its reference manual.

use crate::mesh::io::cells::Shape;

/// An element type.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    pub shape: Shape,
    /// Nodes, corners first.
    pub nodes: usize,
}

/// The type of this number; none for the types that have no corners, or no published layout.
pub(super) fn kind_of(number: u64) -> Option<Kind> {
    use Shape::{Hexahedron, Line, Point, Pyramid, Quad, Tet, Triangle, Wedge};
    let (shape, nodes) = match number {
        1 => (Line, 2),
        2 => (Triangle, 3),
        3 => (Quad, 4),
        4 => (Tet, 4),
        5 => (Hexahedron, 8),
        6 => (Wedge, 6),
        7 => (Pyramid, 5),
        8 => (Line, 3),
        9 => (Triangle, 6),
        10 => (Quad, 9),
        11 => (Tet, 10),
        12 => (Hexahedron, 27),
        13 => (Wedge, 18),
        14 => (Pyramid, 14),
        15 => (Point, 1),
        16 => (Quad, 8),
        17 => (Hexahedron, 20),
        18 => (Wedge, 15),
        19 => (Pyramid, 13),
        20 => (Triangle, 9),
        21 => (Triangle, 10),
        22 => (Triangle, 12),
        23 | 24 => (Triangle, 15),
        25 => (Triangle, 21),
        26 => (Line, 4),
        27 => (Line, 5),
        28 => (Line, 6),
        29 => (Tet, 20),
        30 => (Tet, 35),
        31 => (Tet, 56),
        92 => (Hexahedron, 64),
        93 => (Hexahedron, 125),
        _ => return None,
    };
    Some(Kind { shape, nodes })
}
