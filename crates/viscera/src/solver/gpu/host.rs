//! What host and kernels share, as the host lays it out.

use super::buffers::{Attachment, Spring, Update};
use super::record::Job;
use super::{FrameConstants, layout};

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
            first count set_first multiplier_offset viscous_offset is_viscous is_neo_hookean mode
            parameter tet_count spring_count
        }),
        record!("Frame" FrameConstants {
            gravity dt squared_dt inverse_dt rescale relaxation_multipliers relaxation_positions
            rebase_factor bound_share update_count small_dt inverse_small_dt small_steps
            chebyshev_damping
        }),
        record!("Update" Update { vertex is_pinned force place stiffness inertia }),
        record!("Spring" Spring {
            vertices copies slots multiplier rest_length stiffness part
        }),
        record!("Attachment" Attachment {
            vertex copy_index slot multiplier stiffness part
        }),
        record!("TetBlock" crate::model::TetBlock<f32> {
            vertices inverse_rest_shape rest_volume material
        }),
    ]
}

/// Constants that host and kernels share.
#[doc(hidden)]
pub fn host_constants() -> [(&'static str, u32); 4] {
    use crate::scalar::lanes::LANES;
    use crate::solver::acceleration::LARGEST_WINDOW;
    [
        ("LANES", LANES as u32),
        ("FILLING", layout::FILLING),
        ("LARGEST_WINDOW", LARGEST_WINDOW as u32),
        ("PRODUCTS", layout::PRODUCTS as u32),
    ]
}

/// Bytes of `Control`, which only kernels write.
#[doc(hidden)]
pub const HOST_CONTROL_SIZE: u64 = layout::CONTROL_SIZE;
