//! Names of places in the table, as kernels know them.

use super::clusters::ClusterRow;
use super::layout::{Header, Material};
use super::parts::{Fall, PartRow, Piece, SmallSteps, WHOLLY_FREE};
use super::slots::Element;
use crate::layout::HAS_CLUSTERS;
use crate::solver::step::contacts::meetings::{self, SkinRow};
use crate::solver::step::contacts::on_device::IS_THERE;

macro_rules! words {
    ($record:ty { $($name:literal $field:ident)* }) => {
        vec![$(($name, (std::mem::offset_of!($record, $field) / 4) as u32)),*]
    };
}

/// Names and places of words that kernels find in the table.
pub(super) fn words() -> Vec<(&'static str, u32)> {
    let mut all = words!(Header {
        "MATERIALS_AT" materials "CORNERS_AT" corners "OFFSETS_AT" offsets "ELEMENTS_AT" elements
        "PIECES_AT" pieces "MEMBERS_AT" members "PARTS_AT" parts
        "RUNS_AT" runs "BLOCK_PARTS_AT" block_parts "WEIGHTS_AT" weights
        "RECOVERED_AT" recovered
        "SMALL_STEPS_AT" small_steps "FALLS_AT" falls "STRIDE_AT" stride
        "ANCHORS_AT" anchors "LINES_AT" lines "ENERGIES_AT" energies "TET_LANES_AT" tet_lanes
        "LAW_ENDS_AT" law_ends
        "PART_COUNT_AT" part_count
    });
    // Of kernels that pages leave out.
    if HAS_CLUSTERS {
        all.extend(words!(Header {
            "CLUSTERS_AT" clusters "CLUSTER_STARTS_AT" cluster_starts
            "CLUSTER_VERTICES_AT" cluster_vertices "CLUSTER_CORNERS_AT" cluster_corners
        }));
        all.extend(words!(ClusterRow {
            "CLUSTER_FIRST_START" first_start "CLUSTER_COLORS" colors
            "CLUSTER_FIRST_VERTEX" first_vertex "CLUSTER_VERTEX_COUNT" vertex_count
        }));
        all.push(("CLUSTER_WORDS", (size_of::<ClusterRow>() / 4) as u32));
    }
    if IS_THERE {
        all.extend(words!(Header {
            "SAMPLES_AT" samples "FIRST_SAMPLE_AT" first_sample "SAMPLE_OFFSETS_AT" sample_offsets
            "SAMPLE_ENTRIES_AT" sample_entries "CONTACT_AT" contact "TOOL_SUMS_AT" tool_sums
        }));
    }
    all.push(("FIRST_MEETING_AT", (std::mem::offset_of!(Header, first_meeting) / 4) as u32));
    all.extend(meetings::IS_THERE.then(skin_words).into_iter().flatten());
    all.extend(words!(Piece {
        "PIECE_PART" part "PIECE_FIRST" first "PIECE_END" end "PIECE_ARE_VERTICES" are_vertices
    }));
    all.extend(words!(Element {
        "ELEMENT_KIND" kind "ELEMENT_PART" part "ELEMENT_MULTIPLIER" multiplier
        "ELEMENT_ANCHOR" anchor "ELEMENT_VERTICES" vertices "ELEMENT_COPIES" copies
        "ELEMENT_SLOTS" slots "ELEMENT_CONSTANTS" constants
    }));
    all.extend(words!(Material {
        "MATERIAL_LAMBDA" lame_lambda "MATERIAL_MU" lame_mu "MATERIAL_VISCOSITY" viscosity
    }));
    all.extend(words!(PartRow {
        "PART_ELEMENT_PIECES" element_pieces "PART_ELEMENT_PIECES_END" element_pieces_end
        "PART_VERTEX_PIECES" vertex_pieces "PART_VERTEX_PIECES_END" vertex_pieces_end
        "PART_VERTICES_END" vertices_end "PART_GROUPS_END" groups_end "PART_RUNS" runs
        "PART_RUNS_END" runs_end "PART_LENGTH" length "PART_REBASE_FACTOR" rebase_factor
        "PART_BOUND_SHARE" bound_share
    }));
    let size = |bytes: usize| (bytes / 4) as u32;
    all.extend(words!(SmallSteps {
        "SMALL_COUNT" count "SMALL_DT" dt "SMALL_INVERSE_DT" inverse_dt "SMALL_AHEAD" ahead
    }));
    all.extend(words!(Fall { "FALL_IS_FREE" is_free "FALL_ACCELERATION" acceleration }));
    all.extend([
        ("WHOLLY_FREE", WHOLLY_FREE),
        ("FALL_WORDS", size(size_of::<Fall>())),
        ("SMALL_WORDS", size(size_of::<SmallSteps>())),
        ("PIECE_WORDS", size(size_of::<Piece>())),
        ("PART_WORDS", size(size_of::<PartRow>())),
        ("ELEMENT_WORDS", size(size_of::<Element>())),
        ("MATERIAL_WORDS", size(size_of::<Material>())),
    ]);
    all
}

/// Of tissue that meets tissue.
fn skin_words() -> Vec<(&'static str, u32)> {
    let mut all = words!(Header { "SKIN_AT" skin });
    all.extend(words!(SkinRow {
        "SKIN_SAMPLES" samples "SKIN_TIES" ties "SKIN_POINTS" points "SKIN_TRIANGLES" triangles
        "SKIN_NODES" nodes "SKIN_ORDER" order "SKIN_LEVEL_OFFSETS" level_offsets
        "SKIN_LEVEL_NODES" level_nodes "SKIN_AROUND_OFFSETS" around_offsets
        "SKIN_AROUND" around "SKIN_NEIGHBOUR_OFFSETS" neighbour_offsets
        "SKIN_NEIGHBOURS" neighbours "SKIN_OWN_OFFSETS" own_offsets
        "SKIN_OWN_ENTRIES" own_entries "SKIN_REACTION_OFFSETS" reaction_offsets
        "SKIN_REACTION_ENTRIES" reaction_entries "SKIN_SHIFTS" shifts
        "SKIN_SHIFT_COUNT" shift_count "SKIN_SAMPLE_COUNT" sample_count
        "SKIN_NODE_COUNT" node_count "SKIN_MEETINGS" meetings "SKIN_POINTS_NOW" points_now
        "SKIN_TRIANGLES_NOW" triangles_now "SKIN_NODES_NOW" nodes_now "SKIN_SORTED" sorted
        "SKIN_SORTED_TOO" sorted_too "SKIN_TORN" torn "SKIN_REACH" reach
        "SKIN_ITSELF" itself "SKIN_BODIES" bodies "SKIN_THICKNESS" thickness
        "SKIN_STIFFNESS" stiffness "SKIN_FRICTION" friction "SKIN_DEPTH_OWN" depth_own
        "SKIN_DEPTH_OTHER" depth_other
    }));
    all
}
