//! Tissue that meets tissue: where it lies in the device's memory, and the texts of its kernels.

use super::layout::{DeviceLayout, Header};
use super::slots::{Range, Slot};
use crate::elements::text::kernel_text;
use crate::layout::LaidSkin;
use crate::solver::step::contacts::meetings::{IS_THERE, MEETING_VECTORS, Meetings, put};
use crate::solver::step::contacts::on_device::Samples;

impl DeviceLayout {
    /// Vectors behind the loads: of samples that tools touch, then of meetings.
    pub fn vectors(&self) -> u64 {
        let contact = Samples::known(self.samples).map_or(0, Samples::vectors);
        contact + Meetings::known(self.meetings).map_or(0, Meetings::vectors)
    }

    /// Where meetings begin among the loads.
    fn first_meeting(&self) -> u64 {
        self.slot_count() + Samples::known(self.samples).map_or(0, Samples::vectors)
    }

    /// Puts the skin into the table; returns where its row stands.
    pub fn place_meetings(
        &self,
        (skin, meetings): (&LaidSkin, Meetings),
        add: &mut dyn FnMut(Option<Slot>, &[u8]) -> u32,
    ) -> u32 {
        let mut words = |words: &[u32]| add(None, bytemuck::cast_slice(words));
        let row = put(skin, meetings, self.first_meeting(), &mut words);
        words(bytemuck::cast_slice(&[row]))
    }

    /// Where meetings and ties stand among the loads, and their numbers among elements.
    pub fn place_ranges(&self, header: &mut Header, ranges: &mut Vec<Range>) {
        let Some(meetings) = Meetings::known(self.meetings) else { return };
        let samples = Samples::known(self.samples).map_or(0, |samples| samples.count);
        header.first_meeting = header.tet_lanes + self.elements.len() as u32 + samples;
        let first = self.first_meeting();
        let mut add = |slot, first: u64, vectors: u64| {
            let [start, size] = [16 * first, 16 * vectors.max(1)];
            ranges.push(Range { slot, owner: Slot::Loads, start, size });
        };
        add(Slot::Meetings, first, MEETING_VECTORS as u64 * u64::from(meetings.count()));
        add(Slot::Torn, first + meetings.first_torn(), meetings.ties.into());
    }
}

const RECORDS: &str = kernel_text!("../step/contacts/meetings/records.wgsl");
const LAW: &str = kernel_text!("../step/contacts/meetings/law.wgsl");
const NONE: &str = kernel_text!("../step/contacts/meetings/none.wgsl");

/// What kernels of a solve know of meetings: as it begins, of its trials, at its end; the latter two behind those of tools.
pub(super) const IN_BEGIN: &[&str] = if IS_THERE {
    &[RECORDS, kernel_text!("../step/contacts/meetings/begin.wgsl")]
} else {
    &[NONE]
};
pub(super) const IN_TRIAL: &[&str] = if IS_THERE {
    &[RECORDS, LAW, kernel_text!("../step/contacts/meetings/solve.wgsl")]
} else {
    &[NONE, kernel_text!("../step/contacts/meetings/none_solve.wgsl")]
};
pub(super) const IN_END: &[&str] = if IS_THERE {
    &[RECORDS, LAW, kernel_text!("../step/contacts/meetings/solve_end.wgsl")]
} else {
    &[NONE, kernel_text!("../step/contacts/meetings/none_end.wgsl")]
};

const NEAREST: &str = kernel_text!("../step/contacts/meetings/nearest.wgsl");

/// The files of kernels of their own, behind those of samples and tools where they take these: what finds meetings, sorts them, and
/// ends a step.
pub(super) const FIND: &[&str] = if IS_THERE {
    &[
        RECORDS,
        LAW,
        NEAREST,
        kernel_text!("../step/contacts/meetings/prepare.wgsl"),
        kernel_text!("../step/contacts/meetings/find.wgsl"),
    ]
} else {
    &[]
};
pub(super) const SORT: &[&str] =
    if IS_THERE { &[RECORDS, kernel_text!("../step/contacts/meetings/sort.wgsl")] } else { &[] };
pub(super) const END: &[&str] = if IS_THERE {
    &[RECORDS, LAW, NEAREST, kernel_text!("../step/contacts/meetings/end.wgsl")]
} else {
    &[]
};
