//! Dispatches, and how they are made: what the recorders of all stages share.

use super::kernels::{Kernel, Swept, Variant};
use super::layout::Pieces;
use super::limits::window;
use super::members::element_range;
use super::slots::{Place, Slot};
use super::uniforms::Job;
use crate::elements::TetForm;
use crate::layout::Layout;
use crate::scalar::lanes::LANES;
use crate::settings::SolverSettings;
use crate::solver::quasi_newton::on_device::DeviceLevels;
use crate::solver::step::contacts::meetings::Meetings;
use crate::solver::step::contacts::on_device::Samples;
use crate::solver::step::recovered::on_device::Extent;
use crate::solver::xpbd::is_jacobi;

/// One dispatch.
#[derive(Clone, Debug, PartialEq)]
pub struct Dispatch {
    pub kernel: &'static Kernel,
    pub variant: Variant,
    pub job: Job,
    pub groups: u32,
    /// Whether it works on the copies of split vertices.
    pub on_copies: bool,
}

impl Dispatch {
    /// The place at each of the kernel's bindings. Kernels that know vertices and copies find both;
    /// those of a sweep find copies in the place of vertices.
    pub fn places(&self) -> impl Iterator<Item = Place> {
        // One kernel text serves vertices and copies: in a sweep of split vertices the copies are bound where the
        // kernel says `points`. A kernel that moves data between the two names both, and gets each as it says.
        let knows_both = self.kernel.slots.contains(&Slot::Copies);
        let place = move |&slot| match slot {
            Slot::Points if knows_both => Place::Whole(slot),
            _ if self.on_copies => Place::CopiesOf(slot),
            _ => Place::Whole(slot),
        };
        self.kernel.slots.iter().map(place)
    }
}

/// Makes dispatches for a model that is solved in one way.
pub struct Recorder<'a> {
    pub layout: &'a Layout<f32>,
    pub settings: &'a SolverSettings,
    /// Numbers of the long vector, and where multipliers begin in it.
    pub length: u32,
    pub multipliers_first: u32,
    swept: Swept,
    pub pieces: Pieces,
    /// Of the quasi-Newton method.
    pub levels: Option<&'a DeviceLevels>,
    /// Of recovered-gradient tetrahedra, which this method has.
    pub recovered: Option<Extent>,
    /// Of the surface, where this method computes contact.
    pub samples: Option<Samples>,
    /// Of tissue that meets tissue, where this method computes that.
    pub meetings: Option<Meetings>,
}

impl<'a> Recorder<'a> {
    /// For a model that is solved in this way; `vector` is the length of the long vector and the place
    /// of the first multiplier in it.
    pub fn new(
        layout: &'a Layout<f32>,
        settings: &'a SolverSettings,
        vector: [u32; 2],
        pieces: Pieces,
        levels: Option<&'a DeviceLevels>,
        samples: Option<Samples>,
    ) -> Self {
        let [length, multipliers_first] = vector;
        Self {
            layout,
            settings,
            length,
            multipliers_first,
            swept: match (layout.is_split(), is_jacobi(layout)) {
                // Without split vertices a copy is its vertex. With one colour no constraint reads what another
                // has moved, so that splitting and solving are one kernel.
                (false, _) => Swept::Vertices,
                (true, true) => Swept::Jacobi,
                (true, false) => Swept::Copies,
            },
            pieces,
            levels,
            recovered: Extent::new(layout),
            samples,
            meetings: Meetings::new(layout, settings),
        }
    }

    pub fn variant(&self, form: TetForm) -> Variant {
        Variant { form, swept: self.swept }
    }

    /// As many threads as the job counts.
    pub fn threads(&self, kernel: &'static Kernel, job: Job) -> Dispatch {
        // Most kernels do not depend on a formulation; for these any one names the same pipeline.
        let variant = self.variant(TetForm::GreenStrain);
        let groups = job.count.div_ceil(kernel.workgroup);
        Dispatch { kernel, variant, job, groups, on_copies: false }
    }

    pub fn on_copies(&self, dispatch: Dispatch) -> Dispatch {
        Dispatch { on_copies: true, ..dispatch }
    }

    /// A thread for each vertex.
    pub fn vertices(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        let count = self.layout.vertex_count() as u32;
        self.threads(kernel, Job { count, mode, ..Job::default() })
    }

    /// A thread for each number of the long vector.
    pub fn long(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        // Not every number has a field of its own in `Job`: on the long vector `set_first` is Anderson's window,
        // which is also the place of the newest vector in the history, behind the differences.
        let set_first = window(self.settings);
        let first = self.multipliers_first;
        self.threads(kernel, Job { first, count: self.length, set_first, mode, ..Job::default() })
    }

    /// The long vector part by part: as many workgroups as have enough to do.
    pub fn parts_of_long(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        Dispatch { groups: self.pieces.groups, ..self.long(kernel, mode) }
    }

    /// A workgroup for each part.
    pub fn each_part(&self, kernel: &'static Kernel, job: Job) -> Dispatch {
        let count = self.layout.part_count() as u32;
        Dispatch { groups: count, ..self.threads(kernel, Job { count, ..job }) }
    }

    /// Blocks of a set.
    pub fn blocks(
        &self,
        kernel: &'static Kernel,
        law: usize,
        blocks: std::ops::Range<usize>,
    ) -> Dispatch {
        let sets = &self.layout.tet_sets;
        let set = &sets[law];
        // Blocks of all laws stand in one buffer, law by law, and multipliers are counted within each law: a kernel
        // needs a block's number in the buffer and, less `set_first`, its number in the law.
        let set_first = sets[..law].iter().map(|set| set.block_count() as u32).sum();
        let job = Job {
            first: set_first + blocks.start as u32,
            count: (LANES * blocks.len()) as u32,
            set_first,
            multiplier_offset: set.multiplier_offset as u32,
            viscous_offset: set.viscous_offset as u32,
            is_viscous: set.viscous.into(),
            ..Job::default()
        };
        Dispatch { variant: self.variant(set.form), ..self.threads(kernel, job) }
    }

    pub fn each_set(&self, kernel: &'static Kernel, into: &mut Vec<Dispatch>) {
        for (law, set) in self.layout.tet_sets.iter().enumerate() {
            if !set.is_empty() {
                into.push(self.blocks(kernel, law, 0..set.block_count()));
            }
        }
    }

    /// Threads for all tetrahedra, padding lanes included.
    pub fn tet_threads(&self) -> u32 {
        (LANES * self.layout.block_count()) as u32
    }

    /// How many elements are no tetrahedra.
    pub fn element_count(&self) -> u32 {
        element_range(self.layout, None)[1]
    }

    /// A thread for each element that is no tetrahedron: of one colour, or of all; nothing where there is none.
    pub fn elements(&self, kernel: &'static Kernel, color: Option<usize>) -> Option<Dispatch> {
        let [first, count] = element_range(self.layout, color);
        let job = Job { first, count, ..Job::default() };
        (count > 0).then(|| self.threads(kernel, job))
    }

    /// A workgroup for each that the job counts.
    pub fn each(&self, kernel: &'static Kernel, job: Job) -> Dispatch {
        Dispatch { groups: job.count, ..self.threads(kernel, job) }
    }

    /// The points that sweeps of the model read and write.
    pub fn swept(&self) -> Swept {
        self.swept
    }
}
