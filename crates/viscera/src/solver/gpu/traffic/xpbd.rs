//! The kernels of XPBD.

use super::table::*;

table! {
    REBASE, 25 each Vertex: [
        r(Loads, ROW, Corner),
        // Whether tools are near to samples.
        r(Loads, WORD, Sample).by(SampleCorner),
        r(Table, 2 * WORD, SampleCorner),
        r(Points, ROW, Vertex),
        r(Previous, ROW, Vertex),
        r(Predicted, ROW, Vertex),
        r(ExternalForces, ROW, Vertex),
        r(Table, WORD, Vertex),
        w(Points, ROW, Vertex),
    ];
    RECOMPUTE_POSITIONS, 10 each Vertex: [
        r(Loads, ROW, Corner),
        r(Loads, WORD, Sample).by(SampleCorner),
        r(Table, 2 * WORD, SampleCorner),
        r(Points, ROW, Vertex),
        r(Predicted, ROW, Vertex),
        r(ExternalForces, ROW, Vertex),
        r(Table, WORD, Vertex),
        w(Points, ROW, Vertex),
    ];
    // Of a surface that nothing touches.
    LOAD_CONTACTS, 1 each Sample: [
        r(Loads, WORD, Sample),
        w(Loads, ROW, Never),
        r(Points, ROW, Never),
        r(Table, WORD, Never),
    ];
    SPLIT_COPIES, 0 each Vertex: [
        r(Offsets, WORD, Vertex),
        r(Points, ROW, Vertex),
        w(Copies, ROW, Copy),
    ];
    JOIN_COPIES, 6 each Copy: [
        r(Offsets, WORD, Vertex),
        r(Points, ROW, Vertex),
        r(Copies, ROW, Copy),
        w(Points, ROW, Vertex),
    ];
    // No two tetrahedra of a colour share a vertex: none of its gathers is read twice. Operations are those of the stable
    // neo-Hookean law, the Green strain has a third of them.
    SOLVE, 1500 each JobTet: [
        r(Tets, TET, JobTet),
        r(Points, ROW, JobCorner),
        w(Points, ROW, JobCorner),
        r(Multipliers, WORD, JobMultiplier),
        w(Multipliers, WORD, JobMultiplier),
        r(StartStrain, STRAIN, JobStrain),
        r(Materials, WORD, Never),
    ];
    SOLVE_COPIES, 1500 each JobTet: [
        r(Tets, TET, JobTet),
        r(CornerIndices, CORNERS, JobTet),
        r(Points, ROW, JobCorner),
        w(Points, ROW, JobCorner),
        r(Multipliers, WORD, JobMultiplier),
        w(Multipliers, WORD, JobMultiplier),
        r(StartStrain, STRAIN, JobStrain),
        r(Materials, WORD, Never),
    ];
    SOLVE_JACOBI, 1500 each JobTet: [
        r(Tets, TET, JobTet),
        r(CornerIndices, CORNERS, JobTet),
        r(Points, ROW, Vertex).by(JobCorner),
        w(Copies, ROW, JobCorner),
        r(Multipliers, WORD, JobMultiplier),
        w(Multipliers, WORD, JobMultiplier),
        r(StartStrain, STRAIN, JobStrain),
        r(Materials, WORD, Never),
    ];
    SOLVE_CLUSTERS, 1500 each JobTet: [
        r(Tets, TET, JobTet),
        r(Points, ROW, JobClusterVertex),
        w(Points, ROW, JobClusterVertex),
        r(Multipliers, WORD, JobMultiplier),
        w(Multipliers, WORD, JobMultiplier),
        r(StartStrain, STRAIN, JobStrain),
        r(Materials, WORD, Never),
        r(Table, 2 * WORD, JobTet),
        r(Table, WORD, JobClusterVertex),
        r(Table, ROW, JobCluster),
    ];
    SOLVE_ELEMENTS, 100 each JobElement: [
        r(Table, ELEMENT, JobElement),
        r(Points, 2 * ROW, JobElement),
        w(Points, 2 * ROW, JobElement),
        r(VertexData, 2 * ROW, JobElement),
        r(Multipliers, WORD, JobElement),
        w(Multipliers, WORD, JobElement),
    ];
    SOLVE_ELEMENTS_JACOBI, 100 each JobElement: [
        r(Table, ELEMENT, JobElement),
        r(Points, 2 * ROW, JobElement),
        w(Copies, 2 * ROW, JobElement),
        r(VertexData, 2 * ROW, JobElement),
        r(Multipliers, WORD, JobElement),
        w(Multipliers, WORD, JobElement),
    ];
    LOAD_ELEMENTS, 80 each JobElement: [
        r(Table, ELEMENT, JobElement),
        r(Points, 2 * ROW, JobElement),
        r(VertexData, 2 * ROW, JobElement),
        r(Multipliers, WORD, JobElement),
        w(Loads, 2 * ROW, JobElement),
    ];
    LOAD_MULTIPLIERS, 500 each JobTet: [
        r(Tets, TET, JobTet),
        r(CornerIndices, CORNERS, JobTet),
        r(Points, ROW, Vertex).by(JobCorner),
        r(Multipliers, WORD, JobMultiplier),
        w(Loads, ROW, JobCorner),
    ];
    RESCALE_MULTIPLIERS, 1 each Multiplier: [
        r(Multipliers, WORD, Multiplier),
        w(Multipliers, WORD, Multiplier),
    ];
    REMEMBER_ITERATE, 0 each Number: [
        r(Unknowns, WORD, Number),
        w(Iterate, WORD, Number),
    ];
    ANDERSON_PUSH, 4 each Difference: [
        r(Unknowns, WORD, Number),
        r(Iterate, WORD, Number),
        r(Residuals, WORD, Difference),
        r(Residuals, WORD, Number),
        w(Residuals, 2 * WORD, Number),
        r(Mapped, WORD, Number),
        w(Mapped, 2 * WORD, Number),
        w(PartialSums, OF_PRODUCTS, Group),
        r(Control, PIECE, Part).by(Group),
        r(Table, WORD, Number),
    ];
    ANDERSON_JOIN, 4 each Difference: [
        r(Copies, ROW, Copy),
        w(Unknowns, ROW, Vertex),
        r(Unknowns, WORD, Number),
        r(Iterate, WORD, Number),
        r(Residuals, WORD, Difference),
        r(Residuals, WORD, Number),
        w(Residuals, 2 * WORD, Number),
        r(Mapped, WORD, Number),
        w(Mapped, 2 * WORD, Number),
        w(PartialSums, OF_PRODUCTS, Group),
        r(Control, PIECE, Part).by(Group),
        r(Table, WORD, Number),
    ];
    ANDERSON_WEIGHTS, 1000 each Part: [
        r(PartialSums, OF_PRODUCTS, Group),
        r(Control, 440, Part),
        w(Control, 440, Part),
        r(Table, PIECE, Part),
    ];
    ANDERSON_MIX, 2 each Difference: [
        r(Mapped, WORD, Difference),
        r(Mapped, WORD, Number),
        w(Unknowns, WORD, Number),
        w(Iterate, WORD, Number).when(4),
        r(Control, 44, Part).by(Group),
        r(Table, PIECE, Part).by(Group),
    ];
    CHEBYSHEV_CHANGE, 4 each Number: [
        r(Unknowns, WORD, Number),
        r(Iterate, WORD, Number),
        r(Table, WORD, Number),
        w(PartialSums, WORD, Group),
    ];
    CHEBYSHEV_WEIGHT, 20 each Part: [
        r(PartialSums, WORD, Group),
        r(Control, PIECE, Part),
        w(Control, PIECE, Part),
        r(Table, PIECE, Part),
    ];
    CHEBYSHEV_MIX, 6 each Number: [
        r(Unknowns, WORD, Number),
        r(Iterate, WORD, Number),
        r(Older, WORD, Number),
        w(Unknowns, WORD, Number),
        w(Iterate, WORD, Number),
        w(Older, WORD, Number),
        r(Control, WORD, Part).by(Group),
        r(Table, PIECE, Part).by(Group),
    ];
    FIND_BROKEN, 1 each Multiplier: [
        r(Unknowns, WORD, Multiplier),
        w(Control, WORD, Never),
        r(Table, PIECE, Part).by(Group),
    ];
    // There is nothing to repair in an ordinary step, but every block asks for its part's mark.
    REPAIR_MULTIPLIERS, 0 each Never: [
        r(Tets, TET, Never),
        r(StartStrain, STRAIN, Never),
        w(Unknowns, WORD, Never),
        r(Control, WORD, Part).by(JobTet),
        r(Table, 1, JobTet),
    ];
    REPAIR_ELEMENTS, 0 each Never: [
        w(Unknowns, WORD, Never),
        r(Control, WORD, Part).by(JobElement),
        r(VertexData, ROW, Never),
        r(Table, WORD, JobElement),
    ];
}
