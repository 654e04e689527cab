//! The kernels of the explicit method.

use super::table::*;

table! {
    BEGIN_EXPLICIT, 12 each Vertex: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(VertexData, 4 * ROW, Vertex),
        w(VertexData, 2 * ROW, Vertex),
        w(Control, WORD, Never),
        r(Table, PIECE, Part),
    ];
    BEGIN_STRAIN, 100 each ViscousTet: [
        r(Tets, TET, ViscousTet),
        r(VertexData, 2 * ROW, Vertex).by(ViscousCorner),
        w(StartStrain, STRAIN, ViscousTet),
        r(Table, PIECE, Part),
    ];
    LOAD_FORCES, 200 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        w(Loads, ROW, Corner),
        r(StartStrain, STRAIN, ViscousTet),
        w(StartStrain, STRAIN, ViscousTet),
        r(VertexData, 2 * ROW, Element),
        r(Table, CORNERS, Tet),
        r(Table, ELEMENT, Element),
        // The parts of blocks.
        r(Table, 1, Tet),
        r(Control, WORD, Never),
    ];
    ADVANCE_EXPLICIT, 40 each Vertex: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(Loads, ROW, Corner),
        r(VertexData, 3 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Control, WORD, Never),
        r(Table, WORD, Vertex),
    ];
    END_EXPLICIT, 40 each Vertex: [
        r(Points, ROW, Vertex),
        r(Loads, ROW, Corner),
        r(VertexData, 4 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, WORD, Vertex),
    ];
    RECOVER_PLACES, 20 each RingEntry: [
        r(Points, ROW, Vertex).by(RingEntry),
        again(Points, ROW, Place),
        // One small step before the first.
        r(VertexData, ROW, Never),
        r(Table, ROW, RingEntry),
        r(Table, 2 * WORD, Place),
        r(Table, WORD, PlaceGroup),
        r(Recovery, MATRIX, ViscousPlace),
        w(Recovery, MATRIX, ViscousPlace),
        w(Recovery, MATRIX, Place),
        r(Control, WORD, Never),
    ];
    BEGIN_STRAIN_RECOVERED, 300 each ViscousTet: [
        r(Tets, TET, ViscousTet),
        r(VertexData, 2 * ROW, Vertex).by(ViscousCorner),
        w(StartStrain, STRAIN, ViscousTet),
        r(Table, PIECE, Part),
        r(Table, FRAME, RecoveredTet),
        r(Recovery, MATRIX, ViscousPlace).by(ViscousPlaceCorner),
    ];
    LOAD_RECOVERED_FORCES, 450 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        w(Loads, ROW, PlainCorner),
        r(StartStrain, STRAIN, ViscousTet),
        w(StartStrain, STRAIN, ViscousTet),
        r(VertexData, 2 * ROW, Element),
        r(Table, FRAME, RecoveredTet),
        r(Table, CORNERS, PlainTet),
        r(Table, ELEMENT, Element),
        r(Table, 1, Tet),
        r(Recovery, MATRIX, Place).by(RecoveredCorner),
        w(Recovery, 6 * ROW, RecoveredTet),
        r(Control, WORD, Never),
    ];
    AVERAGE_PRESSURES, 4 each RecoveredCorner: [
        r(Table, 5 * WORD, PlaceCluster),
        r(Table, PLACE + WORD, Place),
        r(Table, WORD, RecoveredCorner),
        r(Table, WORD, Average),
        r(Recovery, ROW, RecoveredTet).by(RecoveredCorner),
        w(Recovery, WORD, Place),
        r(Control, WORD, Never),
    ];
    GATHER_SMALL_STRESSES, 250 each RecoveredCorner: [
        r(Tets, SHAPE, RecoveredTet).by(RecoveredCorner),
        // Of tetrahedra below the volume floor.
        r(Points, ROW, Never),
        r(Table, WORD, RecoveredCorner),
        r(Table, FRAME, RecoveredTet).by(RecoveredCorner),
        r(Table, PLACE + WORD, Place),
        r(Table, WORD, PlaceGroup),
        r(Recovery, 5 * ROW, RecoveredTet).by(RecoveredCorner),
        r(Recovery, MATRIX, Place),
        r(Recovery, MATRIX, ViscousPlace),
        again(Recovery, 4 * WORD, RecoveredCorner),
        w(Recovery, MATRIX, Place),
        r(Control, WORD, Never),
    ];
    ADVANCE_RECOVERED, 20 each RingEntry: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(Loads, ROW, PlainCorner),
        r(VertexData, 3 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Control, WORD, Never),
        r(Table, 2 * WORD, Vertex),
        r(Table, ROW, RingEntry),
        r(Recovery, MATRIX, Place).by(RingEntry),
    ];
    END_EXPLICIT_RECOVERED, 20 each RingEntry: [
        r(Points, ROW, Vertex),
        r(Loads, ROW, PlainCorner),
        r(VertexData, 4 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, 2 * WORD, Vertex),
        r(Table, ROW, RingEntry),
        r(Recovery, MATRIX, Place).by(RingEntry),
    ];
    LOAD_TOUCHED, 200 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        w(Loads, ROW, Corner),
        r(StartStrain, STRAIN, ViscousTet),
        w(StartStrain, STRAIN, ViscousTet),
        r(VertexData, 2 * ROW, Element),
        r(Table, CORNERS, Tet),
        r(Table, ELEMENT, Element),
        // The parts of blocks.
        r(Table, 1, Tet),
        r(Control, WORD, Never),
        // Of samples that nothing touches.
        r(Loads, ROW, Sample),
        again(Points, ROW, SampleCorner),
        r(Table, 10 * WORD, Sample),
    ];
    LOAD_TOUCHED_RECOVERED, 450 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        w(Loads, ROW, PlainCorner),
        r(StartStrain, STRAIN, ViscousTet),
        w(StartStrain, STRAIN, ViscousTet),
        r(VertexData, 2 * ROW, Element),
        r(Table, FRAME, RecoveredTet),
        r(Table, CORNERS, PlainTet),
        r(Table, ELEMENT, Element),
        r(Table, 1, Tet),
        r(Recovery, MATRIX, Place).by(RecoveredCorner),
        w(Recovery, 6 * ROW, RecoveredTet),
        r(Control, WORD, Never),
        r(Loads, ROW, Sample),
        again(Points, ROW, SampleCorner),
        r(Table, 10 * WORD, Sample),
    ];
    ADVANCE_TOUCHED, 40 each Vertex: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(Loads, ROW, Corner),
        r(VertexData, 3 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Control, WORD, Never),
        r(Table, WORD, Vertex),
        // Its samples, and their force.
        again(Loads, ROW, SampleCorner),
        r(Table, 2 * WORD, SampleCorner),
        r(Table, WORD, SampleVertex),
        w(VertexData, ROW, Vertex),
    ];
    ADVANCE_TOUCHED_RECOVERED, 20 each RingEntry: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(Loads, ROW, PlainCorner),
        r(VertexData, 3 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Control, WORD, Never),
        r(Table, 2 * WORD, Vertex),
        r(Table, ROW, RingEntry),
        r(Recovery, MATRIX, Place).by(RingEntry),
        again(Loads, ROW, SampleCorner),
        r(Table, 2 * WORD, SampleCorner),
        r(Table, WORD, SampleVertex),
        w(VertexData, ROW, Vertex),
    ];
    END_TOUCHED, 40 each Vertex: [
        r(Points, ROW, Vertex),
        r(Loads, ROW, Corner),
        r(VertexData, 5 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, WORD, Vertex),
    ];
    END_TOUCHED_RECOVERED, 20 each RingEntry: [
        r(Points, ROW, Vertex),
        r(Loads, ROW, PlainCorner),
        r(VertexData, 5 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, 2 * WORD, Vertex),
        r(Table, ROW, RingEntry),
        r(Recovery, MATRIX, Place).by(RingEntry),
    ];
    SLIP_CONTACTS, 20 each Sample: [
        r(Points, ROW, Vertex).by(SampleCorner),
        r(Loads, ROW, Sample),
        r(Table, 9 * WORD, Sample),
        // Of small steps.
        r(VertexData, ROW, Never),
        r(Control, WORD, Never),
    ];
    MEASURE_ENERGY, 250 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        r(VertexData, 3 * ROW, Vertex).by(Corner),
        r(VertexData, 3 * ROW, Vertex),
        r(Loads, ROW, Sample),
        r(Table, WORD, Tet),
        r(Table, ELEMENT, Element),
        r(Table, PIECE, Piece),
        w(PartialSums, 8 * WORD, Piece),
        r(Control, WORD, Never),
    ];
    LIMIT_ENERGY, 8 each PieceByVertexPiece: [
        r(Points, ROW, Never),
        r(PartialSums, 8 * WORD, Piece).by(PieceByVertexPiece),
        r(VertexData, ROW, Never),
        w(Control, 3 * WORD, Part),
        r(Table, PIECE, VertexPiece),
    ];
    MEASURE_RECOVERED_ENERGY, 550 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        r(VertexData, 3 * ROW, Vertex).by(Corner),
        r(VertexData, 3 * ROW, Vertex),
        r(Loads, ROW, Sample),
        r(Table, WORD, Tet),
        r(Table, FRAME, RecoveredTet),
        r(Table, ELEMENT, Element),
        r(Table, PIECE, Piece),
        r(Recovery, 2 * MATRIX, Place).by(RecoveredCorner),
        w(Recovery, ROW, RecoveredTet),
        w(PartialSums, 8 * WORD, Piece),
        r(Control, WORD, Never),
    ];
    AVERAGE_ENERGIES, 4 each RecoveredCorner: [
        r(Table, 5 * WORD, PlaceCluster),
        r(Table, PLACE + WORD, Place),
        r(Table, WORD, RecoveredCorner),
        r(Table, WORD, Average),
        r(Recovery, ROW, RecoveredTet).by(RecoveredCorner),
        r(Recovery, 2 * MATRIX, Place),
        w(Recovery, ROW, Average),
    ];
    LIMIT_RECOVERED_ENERGY, 8 each PieceByVertexPiece: [
        r(Points, ROW, Never),
        r(PartialSums, 8 * WORD, Piece).by(PieceByVertexPiece),
        r(VertexData, ROW, Never),
        w(Control, 3 * WORD, Part),
        r(Table, PIECE, VertexPiece),
        r(Recovery, ROW, Average).by(AverageByVertexPiece),
    ];
}
