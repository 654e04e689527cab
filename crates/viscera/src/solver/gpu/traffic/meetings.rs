//! The kernels that find where tissue meets tissue. Of a skin that nothing meets: the tree of every sample is looked at in its
//! first nodes, and triangles of leaves that are near.

use super::table::*;

table! {
    PLACE_SKIN, 15 each SkinPoint: [
        r(Points, ROW, Vertex).by(SkinPoint),
        w(Loads, ROW, SkinPoint),
        r(Table, 8 * WORD, SkinPoint),
    ];
    TURN_SKIN, 25 each SkinTriangle: [
        r(Loads, ROW, SkinPoint).by(SkinCorner),
        w(Loads, 2 * ROW, SkinTriangle),
        r(Table, 3 * WORD, SkinTriangle),
    ];
    BOX_SKIN, 6 each SkinCorner: [
        r(Loads, ROW, SkinPoint).by(SkinCorner),
        w(Loads, 2 * ROW, SkinLeaf),
        r(Table, 4 * WORD, SkinTriangle),
    ];
    PREPARE_SKIN, 20 each Vertex: [
        r(Points, ROW, Never),
        r(Loads, 2 * ROW, SkinNode),
        w(Loads, 2 * ROW, SkinNode),
        r(VertexData, 2 * ROW, Vertex),
        again(VertexData, ROW, Vertex),
        r(Table, 2 * WORD, SkinNode),
    ];
    FIND_MEETINGS, 400 each Meeting: [
        r(Points, ROW, Vertex).by(MeetingCorner),
        r(Loads, 2 * ROW, Meeting),
        // Boxes on the way down, and corners of what is near.
        again(Loads, 40 * ROW, Meeting),
        w(Loads, ROW, Meeting),
        w(Control, WORD, Never),
        r(VertexData, ROW, Never),
        r(Table, 13 * WORD, Meeting),
        again(Table, 40 * WORD, Meeting),
    ];
    SORT_MEETINGS, 4 each Meeting: [
        r(Loads, ROW, Meeting),
        w(Loads, ROW, Never),
        r(Table, WORD, Never),
    ];
    END_MEETINGS, 4 each Meeting: [
        r(Points, ROW, Never),
        r(Loads, 2 * ROW, Meeting),
        w(Loads, 2 * ROW, Meeting),
        r(Table, WORD, Never),
    ];
}
