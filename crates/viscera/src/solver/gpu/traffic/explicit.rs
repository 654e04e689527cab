//! The kernels of the explicit method.

use super::table::*;

table! {
    BEGIN_EXPLICIT, 12 each Vertex: [
        r(Points, ROW, Vertex),
        r(Velocities, ROW, Vertex),
        r(Previous, ROW, Vertex),
        r(Predicted, ROW, Vertex),
        r(ExternalForces, ROW, Vertex),
        r(Targets, ROW, Never),
        w(Previous, ROW, Vertex),
        w(Predicted, ROW, Vertex),
        w(Points, ROW, Vertex),
        w(Control, WORD, Never),
        r(Table, PIECE, Part),
    ];
    BEGIN_STRAIN, 100 each ViscousTet: [
        r(Tets, TET, ViscousTet),
        r(Previous, ROW, Vertex).by(ViscousCorner),
        r(Predicted, ROW, Vertex).by(ViscousCorner),
        w(StartStrain, STRAIN, ViscousTet),
        r(Table, PIECE, Part),
    ];
    LOAD_FORCES, 200 each Tet: [
        r(Tets, TET, Tet),
        r(CornerIndices, CORNERS, Tet),
        r(Points, ROW, Vertex).by(Corner),
        w(Loads, ROW, Corner),
        r(StartStrain, STRAIN, ViscousTet),
        w(StartStrain, STRAIN, ViscousTet),
        r(VertexData, 2 * ROW, Element),
        r(Table, ELEMENT, Element),
        // The parts of blocks.
        r(Table, 1, Tet),
        r(Control, WORD, Never),
    ];
    ADVANCE_EXPLICIT, 40 each Vertex: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(Loads, ROW, Corner),
        r(Velocities, ROW, Vertex),
        w(Velocities, ROW, Vertex),
        r(Previous, ROW, Never),
        r(ExternalForces, ROW, Vertex),
        r(Targets, ROW, Vertex),
        r(Control, WORD, Never),
        r(Table, WORD, Vertex),
    ];
    END_EXPLICIT, 40 each Vertex: [
        r(Points, ROW, Vertex),
        r(Loads, ROW, Corner),
        r(Velocities, ROW, Vertex),
        r(Predicted, ROW, Vertex),
        w(Predicted, ROW, Vertex),
        r(ExternalForces, ROW, Vertex),
        r(Targets, ROW, Vertex),
        r(Table, WORD, Vertex),
    ];
}
