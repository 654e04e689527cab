//! The kernels that methods share.

use super::table::*;

table! {
    APPLY_UPDATES, 0 each Part: [
        w(Predicted, WORD, Never),
        w(ExternalForces, ROW, Never),
        w(Targets, ROW, Never),
        r(Updates, 48, Never),
        w(Control, 36, Part),
    ];
    PREDICT, 40 each Vertex: [
        r(Points, ROW, Vertex),
        // Starts, masses, velocities, loads and holds.
        r(VertexData, 5 * ROW, Vertex),
        w(Points, ROW, Vertex),
        w(VertexData, 2 * ROW, Vertex),
        // Steps that are guarded keep three starts.
        w(VertexData, 3 * ROW, Vertex).when(4),
        r(Table, PIECE, Part),
        r(Control, WORD, Part),
    ];
    UPDATE_VELOCITIES, 6 each Vertex: [
        r(Points, ROW, Vertex),
        r(Previous, ROW, Vertex),
        w(Velocities, ROW, Vertex),
    ];
    MEASURE_STRAIN, 100 each JobTet: [
        r(Tets, TET, JobTet),
        r(Points, ROW, Vertex).by(JobCorner),
        w(StartStrain, STRAIN, JobTet),
    ];
    EVALUATE, 250 each Tet, idle IF_REJECTED | UNLESS_GOOD: [
        r(Tets, TET, Tet),
        r(StartStrain, STRAIN, ViscousTet),
        r(Points, ROW, Vertex).by(Corner),
        again(Points, ROW, Vertex),
        r(Table, WORD, Tet),
        r(Table, ELEMENT, Element),
        r(Table, PIECE, Piece),
        // Of samples that tools are near.
        r(Loads, WORD, Sample),
        // Of inertia.
        r(VertexData, 3 * ROW, Vertex),
        // The other starts, and energies at the reference.
        r(VertexData, 3 * ROW, Vertex).by(Corner).when(WITH_STARTS),
        w(PartialSums, WORD, Tet).when(WITH_STARTS),
        r(PartialSums, WORD, Tet),
        // Of velocities and loads.
        r(VertexData, 2 * ROW, Vertex).when(WITH_MOTION),
        w(PartialSums, SUMS, Piece),
        r(Control, WORD, Never),
    ];
    SEARCH, 7 each PieceByPiece, idle PICKS_SHARE | PICKS_LENGTH | TRIES_LENGTHS: [
        r(PartialSums, OF_POTENTIAL, Piece).by(PieceByPiece),
        r(Table, PIECE, Piece),
        w(Control, LINE, Part),
        r(Tets, TET, Never),
        r(Points, ROW, Never),
        r(Loads, ROW, Never),
        r(StartStrain, STRAIN, Never),
        r(VertexData, ROW, Never),
    ];
    TAKE, 7 each PieceByGroup, idle TAKES_DESCENT: [
        r(PartialSums, OF_POTENTIAL, Piece).by(PieceByGroup),
        r(Table, PIECE, Part).by(Group),
        r(Unknowns, WORD, Never),
        r(Mapped, WORD, Never),
        w(Control, LINE, Part),
        r(VertexData, ROW, Vertex).when(CHOOSES),
        w(VertexData, ROW, Vertex).when(CHOOSES),
    ];
    LIMIT_VELOCITIES, 20 each Vertex: [
        r(PartialSums, SUMS, Piece).by(PieceByVertexPiece),
        r(Table, PIECE, VertexPiece),
        r(Points, ROW, Vertex),
        r(VertexData, 2 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        w(Control, LINE, Part),
    ];
}
