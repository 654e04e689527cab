//! The kernels of pictures.

use super::table::*;

table! {
    MEASURE_TETS, 250 each Tet: [
        r(Tets, TET, Tet),
        r(FramePoints, ROW, Vertex).by(Corner),
        w(Measured, WORD, Tet),
        r(Table, WORD, Never),
    ];
    AVERAGE_TETS, 3 each Corner: [
        // Of tetrahedra the volume alone.
        r(Tets, WORD, Tet).by(Corner),
        r(Measured, WORD, Tet).by(Corner),
        r(Around, WORD, Corner),
        w(FramePoints, ROW, Vertex),
    ];
    MEASURE_PRESSURES, 4 each SampleCorner: [
        // Nothing but a word of each sample where nothing touches.
        r(Loads, ROW, Sample).by(SampleCorner),
        r(Table, 2 * WORD, SampleCorner),
        r(Measured, WORD, SampleVertex),
        w(FramePoints, ROW, SampleVertex),
    ];
}
