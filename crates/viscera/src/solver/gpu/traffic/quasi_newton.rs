//! The kernels of the quasi-Newton method.

use super::table::*;

table! {
    BEGIN_SOLVES, 50 each Vertex: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        // Whether samples of a vertex may touch anything.
        r(Loads, WORD, Sample),
        r(VertexData, 5 * ROW, Vertex),
        w(VertexData, 6 * ROW, Vertex),
        r(Table, PIECE, VertexPiece),
        r(Table, 2 * WORD, SampleCorner),
        r(Levels, LEVELS_PART, Part),
        r(Control, WORD, Part),
        w(Multilevel, 48, SampleVertex),
        w(Multilevel, WORD, Part),
        r(Progress, RECORD, Part),
        w(Progress, RECORD, Part),
    ];
    BEGIN_SECOND, 70 each Vertex: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(PartialSums, OF_END, VertexPiece).by(VertexPieceByVertexPiece),
        r(VertexData, 6 * ROW, Vertex),
        w(VertexData, 4 * ROW, Vertex),
        r(Control, WORD, Part),
        r(Table, PIECE, VertexPiece),
        r(Levels, LEVELS_PART, Part),
        r(Progress, RECORD, Part),
        w(Progress, RECORD, Part),
    ];
    TURN_GROUPS, 30 each GroupEntry: [
        r(VertexData, 2 * ROW, Vertex).by(GroupEntry),
        again(VertexData, ROW, TetGroup),
        r(Table, WORD, Never),
        r(Levels, GROUP, TetGroup),
        r(Levels, ROW, GroupEntry),
        w(Multilevel, 76, TetGroup),
    ];
    SUM_BLOCKS, 100 each Share: [
        r(VertexData, 2 * ROW, Vertex),
        r(Table, WORD, Never),
        r(Levels, 2 * WORD, Block),
        r(Levels, 2 * WORD, OrdinaryNode),
        r(Levels, SHARE, Share),
        r(Levels, ENTRY, Entry),
        r(Levels, 8 * WORD, PairRow),
        again(Levels, WEIGHT, Entry),
        // `A` and the factor of a turn; for dense pairs `R` as well.
        r(Multilevel, 40, TetGroup).by(Share),
        r(Multilevel, 36, TetGroup).by(Entry),
        again(Multilevel, 40, Entry),
        w(Multilevel, INVERSE, Block),
        w(Multilevel, WORD, DenseNumber),
    ];
    // Every number once for each six of up to 192 pivots.
    INVERT_DENSE, 400 each DenseNumber: [
        r(Levels, LEVELS_PART, Part),
        r(Multilevel, WORD, DenseNumber),
        again(Multilevel, 2 * 31 * WORD, DenseNumber),
        w(Multilevel, WORD, DenseNumber),
    ];
    EVALUATE_ELEMENTS, 460 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        r(VertexData, ROW, Vertex).by(Corner),
        r(VertexData, ROW, Vertex).by(ViscousCorner),
        w(Loads, ROW, Corner),
        // Its number among the members of a piece, and places of its loads.
        r(Table, WORD + CORNERS, Tet),
        r(Table, ELEMENT, Element),
        r(Table, PIECE, ElementPiece),
        w(PartialSums, 32, ElementPiece),
        r(Progress, 2 * WORD, Part).by(ElementPiece),
    ];
    EVALUATE_VERTICES, 40 each Vertex: [
        r(Points, ROW, Vertex),
        r(Loads, ROW, Corner),
        r(VertexData, 3 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, WORD, Vertex),
        r(Table, PIECE, VertexPiece),
        w(PartialSums, OF_TRIAL, VertexPiece),
        r(Progress, RECORD, Part),
        w(Progress, RECORD, Part),
    ];
    RESTRICT_GRADIENT, 6 each FineSource: [
        r(VertexData, ROW, Vertex).by(FineSource),
        r(Table, WORD, Never),
        r(Levels, WORD, FineNode),
        r(Levels, WEIGHT, FineSource),
        w(Multilevel, VECTOR, FineNode),
    ];
    CORRECT_COARSE, 6 each CoarseSource: [
        r(VertexData, ROW, Vertex).by(VertexSource),
        r(Table, WORD, Never),
        r(Levels, WORD, CoarseNode),
        r(Levels, WEIGHT, CoarseSource),
        r(Levels, WEIGHT, VertexSource),
        r(Multilevel, VECTOR, FineNode).by(CoarseSource),
        r(Multilevel, INVERSE, CoarseBlock),
        r(Multilevel, WORD, DenseNumber).by(DenseProduct),
        w(Multilevel, VECTOR, CoarseNode),
    ];
    CORRECT_FINE, 6 each Up: [
        r(Levels, WORD, FineNode),
        r(Levels, WEIGHT, Up),
        r(Multilevel, INVERSE, FineNode),
        r(Multilevel, VECTOR, FineNode),
        r(Multilevel, VECTOR, CoarseNode).by(Up),
        w(Multilevel, VECTOR, FineNode),
    ];
    TAKE_TRIAL, 24 each VertexPair: [
        r(Points, ROW, Vertex),
        r(PartialSums, OF_TRIAL, Piece).by(PieceByVertexPiece),
        w(PartialSums, SUMS, PieceChunk),
        // Trial, iterate, gradients there, `z`; the last three become those at the trial, and are read once more.
        r(VertexData, 4 * ROW, Vertex),
        w(VertexData, 3 * ROW, Vertex),
        again(VertexData, 2 * ROW, VertexChunk),
        r(Table, PIECE, VertexPiece),
        r(Levels, WORD, Vertex),
        r(Levels, WEIGHT, Parent),
        r(Multilevel, INVERSE, Vertex),
        r(Multilevel, VECTOR, Node).by(Parent),
        r(Pairs, 3 * ROW, OlderPair),
        w(Pairs, 3 * ROW, Vertex),
        again(Pairs, 3 * ROW, Vertex),
        again(Pairs, 2 * ROW, VertexChunk),
        r(Progress, STATE, Part).by(VertexPiece),
    ];
    CHOOSE_DIRECTION, 12 each VertexPair: [
        w(Points, ROW, Vertex),
        r(PartialSums, OF_TRIAL, Piece).by(PieceByVertexPiece),
        r(PartialSums, SUMS, PieceChunk).by(PieceChunkByPiece),
        w(PartialSums, WORD, VertexPiece),
        r(VertexData, 3 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, PIECE, VertexPiece),
        r(Levels, LEVELS_PART, Part),
        r(Pairs, 2 * ROW, VertexPair),
        r(Progress, RECORD, Part).by(VertexPiece),
        w(Progress, RECORD, Part),
    ];
    MEASURE_END, 700 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        again(Points, ROW, Vertex),
        // Of samples that tools are near.
        r(Loads, ROW, Never),
        r(PartialSums, OF_END, VertexPiece).by(PieceByVertexPiece),
        w(PartialSums, 2 * SUMS, Piece),
        r(VertexData, 5 * ROW, Vertex).by(Corner),
        again(VertexData, 5 * ROW, Vertex),
        r(VertexData, 3 * ROW, Vertex),
        r(Table, WORD, Tet),
        r(Table, ELEMENT, Element),
        r(Table, PIECE, Piece),
        r(Progress, STATE, Part).by(Piece),
    ];
    END_STEP, 30 each Vertex: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(PartialSums, OF_END, VertexPiece).by(VertexPieceByVertexPiece),
        r(PartialSums, 2 * SUMS, Piece).by(PieceByVertexPiece),
        w(Control, LINE, Part),
        r(VertexData, 5 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, PIECE, VertexPiece),
        r(Progress, STATE, Part).by(VertexPiece),
    ];
    RECOVER_GRADIENTS, 40 each RingEntry: [
        r(Points, ROW, Vertex).by(RingEntry),
        again(Points, ROW, Place),
        r(VertexData, ROW, Vertex).by(RingEntry),
        r(VertexData, ROW, Vertex).by(ViscousRingEntry),
        again(VertexData, 2 * ROW, Place),
        r(Table, ROW, RingEntry),
        r(Table, 2 * WORD, Place),
        r(Table, WORD, PlaceGroup),
        w(Recovery, 2 * MATRIX, Place),
        w(Recovery, MATRIX, ViscousPlace),
        r(Progress, 2 * WORD, Part).by(PlaceGroup),
    ];
    EVALUATE_RECOVERED, 1100 each Tet: [
        r(Tets, TET, Tet),
        r(Points, ROW, Vertex).by(Corner),
        r(VertexData, ROW, Vertex).by(Corner),
        r(VertexData, ROW, Vertex).by(ViscousCorner),
        w(Loads, ROW, PlainCorner),
        r(Table, WORD, Tet),
        r(Table, FRAME, RecoveredTet),
        r(Table, CORNERS, PlainTet),
        r(Table, ELEMENT, Element),
        r(Table, PIECE, ElementPiece),
        r(Recovery, 2 * MATRIX, Place).by(RecoveredCorner),
        r(Recovery, MATRIX, ViscousPlace).by(ViscousPlaceCorner),
        w(Recovery, 6 * ROW, RecoveredTet),
        w(PartialSums, 32, ElementPiece),
        r(Progress, 2 * WORD, Part).by(ElementPiece),
    ];
    AVERAGE_VOLUMES, 8 each RecoveredCorner: [
        r(Table, 5 * WORD, PlaceCluster),
        r(Table, PLACE + WORD, Place),
        r(Table, WORD, RecoveredCorner),
        r(Table, WORD, Average),
        r(Recovery, ROW, RecoveredTet).by(RecoveredCorner),
        r(Recovery, 2 * MATRIX, Place),
        r(Recovery, MATRIX, ViscousPlace),
        w(Recovery, WORD, Place),
        w(Recovery, ROW, Average),
        r(Progress, 2 * WORD, Part).by(Average),
    ];
    GATHER_STRESSES, 250 each RecoveredCorner: [
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
        // Pressures of all four corners.
        again(Recovery, 4 * WORD, RecoveredCorner),
        w(Recovery, MATRIX, Place),
        r(Progress, 2 * WORD, Part).by(PlaceGroup),
    ];
    EVALUATE_RECOVERED_VERTICES, 20 each RingEntry: [
        r(Points, ROW, Vertex),
        r(Loads, ROW, PlainCorner),
        r(VertexData, 3 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, 2 * WORD, Vertex),
        r(Table, ROW, RingEntry),
        r(Table, PIECE, VertexPiece),
        w(PartialSums, OF_TRIAL, VertexPiece),
        r(Recovery, MATRIX, Place).by(RingEntry),
        r(Recovery, ROW, Average),
        r(Progress, RECORD, Part),
        w(Progress, RECORD, Part),
    ];
    // Vertices and elements one after the other.
    MEASURE_RECOVERED_END, 1400 each PieceTet: [
        r(Tets, TET, PieceTet),
        r(Points, ROW, PieceVertex),
        r(Points, ROW, Vertex).by(PieceCorner),
        r(Loads, ROW, Never),
        r(PartialSums, OF_END, VertexPiece).by(PieceByVertexPiece),
        w(PartialSums, 2 * SUMS, JobPiece),
        r(VertexData, 8 * ROW, PieceVertex),
        again(VertexData, 5 * ROW, PieceCorner),
        r(Table, WORD, PieceTet),
        r(Table, FRAME, PieceRecoveredTet),
        r(Table, ELEMENT, PieceElement),
        r(Table, PIECE, JobPiece),
        r(Recovery, 3 * MATRIX, Place).by(PieceRecoveredCorner),
        w(Recovery, ROW, PieceRecoveredTet),
        r(Progress, STATE, Part).by(JobPiece),
    ];
    RECOVER_ENDS, 90 each RingEntry: [
        r(Points, ROW, Vertex).by(RingEntry),
        r(VertexData, 5 * ROW, Vertex).by(RingEntry),
        again(VertexData, 5 * ROW, Place),
        r(Table, ROW, RingEntry),
        r(Table, 2 * WORD, Place),
        r(Table, WORD, PlaceGroup),
        w(Recovery, 3 * MATRIX, Place),
        w(Recovery, MATRIX, ViscousPlace),
        r(Progress, WORD, Part).by(PlaceGroup),
    ];
    AVERAGE_ENDS, 8 each RecoveredCorner: [
        r(Table, 5 * WORD, PlaceCluster),
        r(Table, PLACE + WORD, Place),
        r(Table, WORD, RecoveredCorner),
        r(Recovery, ROW, RecoveredTet).by(RecoveredCorner),
        r(Recovery, 3 * MATRIX, Place),
        r(Recovery, MATRIX, ViscousPlace),
        w(Recovery, ROW, Average),
    ];
    END_RECOVERED_STEP, 30 each Vertex: [
        r(Points, ROW, Vertex),
        w(Points, ROW, Vertex),
        r(PartialSums, OF_END, VertexPiece).by(VertexPieceByVertexPiece),
        r(PartialSums, 2 * SUMS, Piece).by(PieceByVertexPiece),
        w(Control, LINE, Part),
        r(VertexData, 5 * ROW, Vertex),
        w(VertexData, ROW, Vertex),
        r(Table, PIECE, VertexPiece),
        r(Recovery, ROW, Average).by(AverageByVertexPiece),
        r(Progress, STATE, Part).by(VertexPiece),
    ];
    // Of a surface that nothing touches: where samples are, that none of their slots is in use, and sums.
    FIND_CONTACTS, 60 each Sample: [
        r(Points, ROW, Vertex).by(SampleCorner),
        r(Loads, ROW, Sample),
        w(Loads, ROW, Sample),
        r(VertexData, ROW, Vertex).by(SampleCorner),
        r(Table, 10 * WORD, Sample),
        w(Control, WORD, Never),
    ];
    END_CONTACTS, 30 each Sample: [
        r(Points, ROW, Vertex).by(SampleCorner),
        r(Loads, ROW, Sample),
        r(VertexData, ROW, Vertex).by(SampleCorner),
        w(PartialSums, 4 * 16, SampleGroup),
        r(Table, 9 * WORD, Sample),
    ];
    REPORT_TOOLS, 16 each SampleGroup: [
        r(PartialSums, 4 * 16, SampleGroup),
        w(PartialSums, 4 * 16, Part),
        r(Table, WORD, Never),
    ];
}
