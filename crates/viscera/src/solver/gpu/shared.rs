//! Constants and records that host and kernels share, as the host lays them out.

use super::control::{Control, PartControl};
use super::layout;
use super::slots::Update;
use super::uniforms::{FrameConstants, Job};
use super::words;
use crate::elements::law::LAWS;
use crate::layout::CLUSTER_VERTICES;
use crate::scalar::lanes::LANES;
use crate::settings::MOST_HISTORY;
use crate::solver::cpu::products::LARGEST_WINDOW;
use crate::solver::quasi_newton::on_device::IS_THERE;
use crate::solver::quasi_newton::progress::{PartProgress, SolveState};
use crate::solver::quasi_newton::tables;
use crate::solver::step::contacts::meetings;
use crate::solver::step::contacts::on_device as contact;
use crate::solver::step::control::PartGuard;
use crate::solver::step::modes::MODES;
use crate::solver::step::recovered::on_device;
use crate::solver::step::{descent, guard};

/// Name, bytes, and the name and place [bytes] of every field.
pub type HostLayout = (&'static str, usize, Vec<(&'static str, usize)>);

/// Records that host and kernels share, as the host lays them out: for the test that compares both.
#[doc(hidden)]
pub fn host_layouts() -> Vec<HostLayout> {
    macro_rules! record {
        ($name:literal $record:ty { $($field:ident)* }) => {
            (
                $name,
                size_of::<$record>(),
                vec![$((stringify!($field), std::mem::offset_of!($record, $field))),*],
            )
        };
    }
    vec![
        record!("Job" Job {
            first count set_first multiplier_offset viscous_offset is_viscous mode
            parameter tet_count
        }),
        record!("Frame" FrameConstants {
            gravity dt squared_dt inverse_dt rescale relaxation_multipliers relaxation_positions
            update_count part_count chebyshev_damping
        }),
        record!("Control" Control { small_step small_steps_done step rejected_step rejected parts }),
        record!("PartControl" PartControl {
            sweeps next differences last_norm shares gram iteration omega radius last_change guard
            is_broken pressed_step
        }),
        record!("PartGuard" PartGuard<f32> {
            limit was_rejected share descends potential noise kept_speed best_value failures
            mixture_best mixture_failures is_good
        }),
        record!("SolveState" SolveState {
            phase passes_left accepted ahead failures rejections calm count newest scale length slope
        }),
        record!("PartProgress" PartProgress { states sy yw was_rejected calm takes_trial slides }),
        record!("ToolMotion" contact::ToolMotion { poses way turn }),
        record!("ToolKind" contact::ToolKind { lengths law grid bricks bounds }),
        record!("Tools" contact::ToolRecords { count all kinds }),
        record!("Update" Update { vertex is_pinned force place stiffness inertia }),
        record!("TetBlock" crate::layout::TetBlock<f32> {
            vertices inverse_rest_shape rest_volume material
        }),
    ]
}

/// Constants that host and kernels share, as WGSL: every kernel's text begins with them.
pub(super) fn constants() -> String {
    let guarded = [
        ("SHARE_COUNT", guard::SHARES.len() as u32),
        ("SHORTENINGS", descent::SHORTENINGS as u32),
        ("TOLERATED", guard::TOLERATED),
    ];
    let shared = [
        ("LANES", LANES as u32),
        ("LAW_COUNT", LAWS as u32),
        ("FILLING", layout::FILLING),
        ("WHOLE", layout::WHOLE),
        ("PRODUCTS", layout::PRODUCTS as u32),
        ("SUMS", layout::PIECE_SUMS as u32),
        ("LINE_SUMS", layout::LINE_SUMS as u32),
        ("LARGEST_WINDOW", LARGEST_WINDOW as u32),
        ("MOST_HISTORY", MOST_HISTORY as u32),
        ("CLUSTER_VERTICES", CLUSTER_VERTICES as u32),
    ];
    // Of kernels that builds without `gpu-solves` leave out.
    let of_solves = IS_THERE
        .then(|| tables::words().into_iter().chain(on_device::names()).chain(contact::names()));
    let of_meetings = meetings::IS_THERE.then(meetings::names);
    let ranges = layout::vertex_ranges()
        .chain(of_solves.into_iter().flatten())
        .chain(of_meetings.into_iter().flatten());
    let numbers = words::words().into_iter().chain(MODES.iter().copied());
    let numbers = numbers.chain(ranges).chain(guarded).chain(shared);
    let mut text: String =
        numbers.map(|(name, value)| format!("const {name}: u32 = {value}u;\n")).collect();
    for (name, value) in [("SUFFICIENT", descent::SUFFICIENT), ("SHORTEN", descent::SHORTEN)] {
        text += &format!("const {name}: f32 = {value:?};\n");
    }
    let shares = guard::SHARES.map(|share| format!("{share:?}")).join(", ");
    text + &format!("const SHARES = array<f32, {}>({shares});\n", guard::SHARES.len())
}
