//! The kernels: which text each is made of, and what it is bound to.

use super::meetings;
use super::shown::SHOWS_VALUES;
use super::slots::Slot;
use crate::elements::TetForm;
use crate::elements::text::kernel_text;
use crate::elements::wgsl;
use crate::layout::HAS_CLUSTERS;
use crate::solver::explicit::texts::{Which, texts as explicit};
use crate::solver::quasi_newton::on_device::IS_THERE;
use crate::solver::step::tissue::{TISSUE_WGSL, VISCOUS_WGSL};

/// A kernel: an entry point of one of the files, with the storage that it names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Kernel {
    /// The entry point.
    pub entry: &'static str,
    /// The file that holds it.
    pub file: File,
    /// Threads of a workgroup.
    pub workgroup: u32,
    /// Its bindings.
    pub slots: &'static [Slot],
}

/// Files with entry points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum File {
    Predict,
    Rebase,
    Sweep,
    SweepClusters,
    SweepElements,
    Loads,
    LoadsElements,
    Strain,
    Multipliers,
    Acceleration,
    AndersonPush,
    History,
    HistoryTets,
    HistoryElements,
    Explicit,
    ExplicitRecovered,
    ExplicitTouched,
    TouchedRecovered,
    ExplicitEnergy,
    EnergyRecovered,
    Evaluate,
    Search,
    Take,
    Energy,
    Begin,
    Refresh,
    Invert,
    EvaluateTrial,
    EvaluateRecovered,
    Apply,
    Direction,
    End,
    EndRecovered,
    FindContacts,
    LoadContacts,
    EndContacts,
    Values,
    Pressures,
    Skin,
    SortMeetings,
    EndMeetings,
}

/// Choices that the text of a file depends on, beside the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// The form of the tetrahedra's constraints.
    pub form: TetForm,
    /// The points that sweeps read and write.
    pub swept: Swept,
}

/// The points that sweeps read and write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Swept {
    /// Vertices.
    Vertices,
    /// Copies of them.
    Copies,
    /// One colour, every copy with one constraint: reads vertices, writes copies.
    Jacobi,
}

impl Swept {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Vertices, Self::Copies, Self::Jacobi];
}

macro_rules! kernels {
    ($($name:ident = $file:ident $entry:literal $workgroup:literal [$($slot:ident)*];)*) => {
        $(
            #[doc = concat!("`", $entry, "`")]
            pub const $name: Kernel = Kernel {
                entry: $entry,
                file: File::$file,
                workgroup: $workgroup,
                slots: &[$(Slot::$slot),*],
            };
        )*

        /// All of them.
        pub const ALL: &[Kernel] = &[$($name),*];
    };
}

kernels! {
    APPLY_UPDATES = Predict "apply_updates" 64 [Predicted ExternalForces Targets Updates Control];
    PREDICT = Predict "predict" 64 [Points Control VertexData Table];
    REBASE = Rebase "rebase" 64 [Points Loads Previous Predicted ExternalForces Table];
    RECOMPUTE_POSITIONS = Rebase "recompute_positions" 64 [Points Loads Predicted ExternalForces Table];
    SPLIT_COPIES = Rebase "split_copies" 64 [Offsets Points Copies];
    JOIN_COPIES = Rebase "join_copies" 64 [Offsets Points Copies];
    UPDATE_VELOCITIES = Predict "update_velocities" 64 [Points Velocities Previous];
    SOLVE = Sweep "solve" 64 [Tets Materials Points Multipliers StartStrain];
    SOLVE_COPIES = Sweep "solve" 64 [Tets Materials CornerIndices Points Multipliers StartStrain];
    SOLVE_JACOBI = Sweep "solve" 64
        [Tets Materials CornerIndices Points Copies Multipliers StartStrain];
    SOLVE_CLUSTERS = SweepClusters "solve_clusters" 64
        [Tets Materials Points Multipliers StartStrain Table];
    SOLVE_ELEMENTS = SweepElements "solve_elements" 64 [Points Multipliers VertexData Table];
    SOLVE_ELEMENTS_JACOBI = SweepElements "solve_elements" 64
        [Points Copies Multipliers VertexData Table];
    LOAD_ELEMENTS = LoadsElements "load_elements" 64 [Points Multipliers Loads VertexData Table];
    LOAD_MULTIPLIERS = Loads "load_multipliers" 64 [Tets CornerIndices Points Multipliers Loads];
    MEASURE_STRAIN = Strain "measure_strain" 64 [Tets Points StartStrain];
    RESCALE_MULTIPLIERS = Multipliers "rescale_multipliers" 256 [Multipliers];
    REMEMBER_ITERATE = Acceleration "remember_iterate" 256 [Unknowns Iterate];
    ANDERSON_PUSH = AndersonPush "anderson_push" 128
        [Unknowns Iterate Residuals Mapped PartialSums Control Table];
    ANDERSON_JOIN = AndersonPush "anderson_push" 128
        [Copies Unknowns Iterate Residuals Mapped PartialSums Control Table];
    ANDERSON_WEIGHTS = Acceleration "anderson_weights" 256 [PartialSums Control Table];
    ANDERSON_MIX = Acceleration "anderson_mix" 256 [Unknowns Iterate Mapped Control Table];
    CHEBYSHEV_CHANGE = Acceleration "chebyshev_change" 128 [Unknowns Iterate PartialSums Table];
    CHEBYSHEV_WEIGHT = Acceleration "chebyshev_weight" 128 [PartialSums Control Table];
    FIND_BROKEN = History "find_broken" 256 [Unknowns Control Table];
    REPAIR_MULTIPLIERS = HistoryTets "repair_multipliers" 64
        [Tets StartStrain Unknowns Control Table];
    REPAIR_ELEMENTS = HistoryElements "repair_elements" 64 [Unknowns Control VertexData Table];
    BEGIN_EXPLICIT = Explicit "begin_explicit" 64
        [Points Control VertexData Table];
    BEGIN_STRAIN = Explicit "begin_strain" 64 [Tets StartStrain VertexData Table];
    LOAD_FORCES = Explicit "load_forces" 64
        [Tets Points Loads StartStrain Control VertexData Table];
    ADVANCE_EXPLICIT = Explicit "advance_explicit" 64 [Points Loads Control VertexData Table];
    END_EXPLICIT = Explicit "end_explicit" 64 [Points Loads VertexData Table];
    RECOVER_PLACES = ExplicitRecovered "recover_places" 64
        [Points Control VertexData Table Recovery];
    BEGIN_STRAIN_RECOVERED = ExplicitRecovered "begin_strain" 64
        [Tets StartStrain VertexData Table Recovery];
    LOAD_RECOVERED_FORCES = ExplicitRecovered "load_forces" 64
        [Tets Points Loads StartStrain Control VertexData Table Recovery];
    AVERAGE_PRESSURES = ExplicitRecovered "average_pressures" 256 [Control Table Recovery];
    GATHER_SMALL_STRESSES = ExplicitRecovered "gather_stresses" 64
        [Tets Points Control Table Recovery];
    ADVANCE_RECOVERED = ExplicitRecovered "advance_explicit" 64
        [Points Loads Control VertexData Table Recovery];
    END_EXPLICIT_RECOVERED = ExplicitRecovered "end_explicit" 64
        [Points Loads VertexData Table Recovery];
    LOAD_TOUCHED = ExplicitTouched "load_forces" 64
        [Tets Points Loads StartStrain Control VertexData Table];
    ADVANCE_TOUCHED = ExplicitTouched "advance_explicit" 64 [Points Loads Control VertexData Table];
    END_TOUCHED = ExplicitTouched "end_explicit" 64 [Points Loads VertexData Table];
    SLIP_CONTACTS = ExplicitTouched "slip_contacts" 64 [Points Loads Control VertexData Table];
    LOAD_TOUCHED_RECOVERED = TouchedRecovered "load_forces" 64
        [Tets Points Loads StartStrain Control VertexData Table Recovery];
    ADVANCE_TOUCHED_RECOVERED = TouchedRecovered "advance_explicit" 64
        [Points Loads Control VertexData Table Recovery];
    END_TOUCHED_RECOVERED = TouchedRecovered "end_explicit" 64 [Points Loads VertexData Table Recovery];
    MEASURE_ENERGY = ExplicitEnergy "measure_energy" 256 [Tets Points Loads PartialSums Control VertexData Table];
    LIMIT_ENERGY = ExplicitEnergy "limit_energy" 256 [Points PartialSums Control VertexData Table];
    MEASURE_RECOVERED_ENERGY = EnergyRecovered "measure_energy" 256
        [Tets Points Loads PartialSums Control VertexData Table Recovery];
    AVERAGE_ENERGIES = EnergyRecovered "average_energies" 256 [Table Recovery];
    LIMIT_RECOVERED_ENERGY = EnergyRecovered "limit_energy" 256
        [Points PartialSums Control VertexData Table Recovery];
    CHEBYSHEV_MIX = Acceleration "chebyshev_mix" 256 [Unknowns Iterate Older Control Table];
    EVALUATE = Evaluate "evaluate" 256
        [Tets Points Loads StartStrain PartialSums Control VertexData Table];
    SEARCH = Search "search" 256
        [Tets Points Loads StartStrain PartialSums Control VertexData Table];
    TAKE = Take "take" 256 [Unknowns Mapped PartialSums Control VertexData Table];
    BEGIN_SOLVES = Begin "begin_solves" 256
        [Points Loads Control VertexData Table Levels Multilevel Progress];
    BEGIN_SECOND = Begin "begin_second" 256
        [Points PartialSums Control VertexData Table Levels Progress];
    TURN_GROUPS = Refresh "turn_groups" 64 [VertexData Table Levels Multilevel];
    SUM_BLOCKS = Refresh "sum_blocks" 64 [VertexData Table Levels Multilevel];
    INVERT_DENSE = Invert "invert_dense" 256 [Levels Multilevel];
    EVALUATE_ELEMENTS = EvaluateTrial "evaluate_elements" 256
        [Tets Points Loads PartialSums VertexData Table Progress];
    EVALUATE_VERTICES = EvaluateTrial "evaluate_vertices" 256
        [Points Loads PartialSums VertexData Table Progress];
    RECOVER_GRADIENTS = EvaluateRecovered "recover_gradients" 64
        [Points VertexData Table Progress Recovery];
    EVALUATE_RECOVERED = EvaluateRecovered "evaluate_elements" 256
        [Tets Points Loads PartialSums VertexData Table Progress Recovery];
    AVERAGE_VOLUMES = EvaluateRecovered "average_volumes" 256 [Table Progress Recovery];
    GATHER_STRESSES = EvaluateRecovered "gather_stresses" 64
        [Tets Points Table Progress Recovery];
    EVALUATE_RECOVERED_VERTICES = EvaluateRecovered "evaluate_vertices" 256
        [Points Loads PartialSums VertexData Table Progress Recovery];
    RESTRICT_GRADIENT = Apply "restrict_gradient" 64 [VertexData Table Levels Multilevel];
    CORRECT_COARSE = Apply "correct_coarse" 256 [VertexData Table Levels Multilevel];
    CORRECT_FINE = Apply "correct_fine" 64 [Levels Multilevel];
    TAKE_TRIAL = Direction "take_trial" 256
        [Points PartialSums VertexData Table Levels Multilevel Pairs Progress];
    CHOOSE_DIRECTION = Direction "choose_direction" 256
        [Points PartialSums VertexData Table Levels Pairs Progress];
    MEASURE_END = End "measure_end" 256
        [Tets Points Loads PartialSums VertexData Table Progress];
    END_STEP = End "end_step" 256 [Points PartialSums Control VertexData Table Progress];
    MEASURE_RECOVERED_END = EndRecovered "measure_end" 256
        [Tets Points Loads PartialSums VertexData Table Progress Recovery];
    RECOVER_ENDS = EndRecovered "recover_ends" 64 [Points VertexData Table Progress Recovery];
    AVERAGE_ENDS = EndRecovered "average_ends" 256 [Table Recovery];
    END_RECOVERED_STEP = EndRecovered "end_step" 256
        [Points PartialSums Control VertexData Table Progress Recovery];
    FIND_CONTACTS = FindContacts "find_contacts" 64
        [Points Loads Control VertexData Table];
    LOAD_CONTACTS = LoadContacts "load_contacts" 64 [Points Loads Table];
    END_CONTACTS = EndContacts "end_contacts" 256 [Points Loads PartialSums VertexData Table];
    REPORT_TOOLS = EndContacts "report_tools" 256 [PartialSums Table];
    MEASURE_TETS = Values "measure_tets" 64 [Tets Table FramePoints Measured];
    AVERAGE_TETS = Values "average_tets" 64 [Tets FramePoints Measured Around];
    MEASURE_PRESSURES = Pressures "measure_pressures" 64 [Loads Table FramePoints Measured];
    PLACE_SKIN = Skin "place_skin" 64 [Points Loads Table];
    TURN_SKIN = Skin "turn_skin" 64 [Loads Table];
    BOX_SKIN = Skin "box_skin" 64 [Loads Table];
    PREPARE_SKIN = Skin "prepare_skin" 256 [Points Loads VertexData Table];
    FIND_MEETINGS = Skin "find_meetings" 64 [Points Loads Control VertexData Table];
    SORT_MEETINGS = SortMeetings "sort_meetings" 128 [Loads Table];
    END_MEETINGS = EndMeetings "end_meetings" 64 [Points Loads Table];
    LIMIT_VELOCITIES = Energy "limit_velocities" 256 [Points PartialSums Control VertexData Table];
}

/// Records and storage, for every kernel.
const SHARED: [&str; 7] = [
    wgsl::KINEMATICS,
    wgsl::GREEN_STRAIN,
    kernel_text!("../quasi_newton/progress_record.wgsl"),
    kernel_text!("../step/control.wgsl"),
    kernel_text!("control.wgsl"),
    kernel_text!("bindings.wgsl"),
    kernel_text!("table.wgsl"),
];

/// Sums over parts of the long vector.
const SPANS: &str = kernel_text!("spans.wgsl");
const SUMS: &str = kernel_text!("sums.wgsl");

/// How elements that are no tetrahedra lie in the table.
const ELEMENTS: &str = kernel_text!("elements.wgsl");

/// Samples and tools.
const TOOLS: &str = kernel_text!("../step/contacts/tools.wgsl");

/// Contact at vertices, or nothing.
const CONTACT: &str = if IS_THERE {
    kernel_text!("../step/contacts/gather.wgsl")
} else {
    kernel_text!("../step/contacts/none.wgsl")
};

/// Contact in the incremental potential; beside nothing at vertices it is empty.
const SAMPLES: &[&str] =
    if IS_THERE { &[TOOLS, kernel_text!("../step/contacts/potential.wgsl")] } else { &[] };

/// In the place of recovered-gradient tetrahedra.
const PLAIN: &str = kernel_text!("../step/recovered/none.wgsl");

/// The constraints of a tetrahedron.
const SWEEP_TET: &str = kernel_text!("../xpbd/sweep_tet.wgsl");

/// How a sweep reads and writes, and how an acceleration finds what a sweep has left.
fn swept(swept: Swept) -> [&'static str; 2] {
    let copies = kernel_text!("../xpbd/acceleration_mapped_copies.wgsl");
    match swept {
        Swept::Vertices => [
            kernel_text!("../xpbd/sweep_vertices.wgsl"),
            kernel_text!("../xpbd/acceleration_mapped_vertices.wgsl"),
        ],
        Swept::Copies => [kernel_text!("../xpbd/sweep_copies.wgsl"), copies],
        Swept::Jacobi => [kernel_text!("../xpbd/sweep_jacobi.wgsl"), copies],
    }
}

/// The files of a kernel, each whole, in order.
fn files(kernel: &Kernel, variant: Variant) -> Vec<&'static str> {
    let [swept, mapped] = swept(variant.swept);
    let form = wgsl::form_texts(variant.form);
    let own = |file| vec![file];
    let history = kernel_text!("../xpbd/history.wgsl");
    // The potential, and what the guard decides by it.
    let guard = |own: Vec<&'static str>| {
        let potential =
            [kernel_text!("../step/potential.wgsl"), kernel_text!("../step/guard_decide.wgsl")];
        [laws(), pieces(), vec![CONTACT], SAMPLES.to_vec(), potential.to_vec(), own].concat()
    };
    match kernel.file {
        File::Predict => own(kernel_text!("../step/predict.wgsl")),
        File::Rebase => vec![CONTACT, kernel_text!("../xpbd/rebase.wgsl")],
        File::Sweep => [form, vec![swept, SWEEP_TET, kernel_text!("../xpbd/sweep.wgsl")]].concat(),
        File::SweepClusters if !HAS_CLUSTERS => Vec::new(),
        File::SweepClusters => {
            [form, vec![SWEEP_TET, kernel_text!("../xpbd/sweep_cluster.wgsl")]].concat()
        }
        File::SweepElements => {
            [vec![swept], elements(kernel_text!("../xpbd/sweep_elements.wgsl"))].concat()
        }
        File::LoadsElements => elements(kernel_text!("../xpbd/loads_elements.wgsl")),
        File::Loads => [form, own(kernel_text!("../xpbd/loads.wgsl"))].concat(),
        File::Strain => own(kernel_text!("../step/strain.wgsl")),
        File::Multipliers => own(kernel_text!("../xpbd/multipliers.wgsl")),
        File::Acceleration => vec![SPANS, SUMS, kernel_text!("../xpbd/acceleration.wgsl")],
        File::AndersonPush => {
            vec![SPANS, SUMS, mapped, kernel_text!("../xpbd/acceleration_push.wgsl")]
        }
        File::History => vec![SPANS, history, kernel_text!("../xpbd/history_broken.wgsl")],
        File::HistoryTets => {
            let own = vec![VISCOUS_WGSL, history, kernel_text!("../xpbd/history_tets.wgsl")];
            [form, own].concat()
        }
        File::HistoryElements => {
            [vec![history], elements(kernel_text!("../xpbd/history_elements.wgsl"))].concat()
        }
        File::Explicit => small_steps(File::Explicit, &elements(""), &[]),
        File::Evaluate => guard(own(kernel_text!("../step/guard_evaluate.wgsl"))),
        File::Search => guard(own(kernel_text!("../step/guard_search.wgsl"))),
        File::Take => guard(vec![SPANS, kernel_text!("../step/guard_take.wgsl")]),
        File::Energy => guard(own(kernel_text!("../step/energy.wgsl"))),
        File::Values if SHOWS_VALUES => [laws(), own(kernel_text!("values.wgsl"))].concat(),
        file if IS_THERE => files_of_solves(file),
        _ => Vec::new(),
    }
}

/// The files of kernels that builds without `gpu-solves` leave out.
fn files_of_solves(file: File) -> Vec<&'static str> {
    let levels = kernel_text!("../quasi_newton/preconditioner/levels.wgsl");
    let solve = |own: Vec<&'static str>| {
        [laws(), pieces(), vec![kernel_text!("../quasi_newton/progress.wgsl")], own].concat()
    };
    let tables = [wgsl::RECOVERED, kernel_text!("../step/recovered/tables.wgsl")];
    let forces = kernel_text!("../step/recovered/forces.wgsl");
    let none = kernel_text!("../quasi_newton/recovered_none.wgsl");
    let samples = kernel_text!("../step/contacts/solve.wgsl");
    let samples_end = kernel_text!("../step/contacts/solve_end.wgsl");
    match file {
        File::Begin => {
            let own = kernel_text!("../quasi_newton/begin.wgsl");
            solve([meetings::IN_BEGIN, &[own]].concat())
        }
        File::Refresh => {
            let own = kernel_text!("../quasi_newton/preconditioner/refresh.wgsl");
            [laws(), vec![levels, own]].concat()
        }
        File::Invert => {
            vec![levels, kernel_text!("../quasi_newton/preconditioner/invert.wgsl")]
        }
        File::EvaluateTrial => {
            let own = [samples, kernel_text!("../quasi_newton/evaluate.wgsl")];
            solve([&[PLAIN, none, TOOLS], meetings::IN_TRIAL, &own].concat())
        }
        File::EvaluateRecovered => {
            let first = [forces, kernel_text!("../quasi_newton/recovered.wgsl"), TOOLS];
            let own = [samples, kernel_text!("../quasi_newton/evaluate.wgsl")];
            solve([&tables, &first[..], meetings::IN_TRIAL, &own].concat())
        }
        File::Apply => vec![levels, kernel_text!("../quasi_newton/preconditioner/apply.wgsl")],
        File::Direction => solve(vec![levels, kernel_text!("../quasi_newton/direction.wgsl")]),
        File::End => {
            let own = [samples_end, kernel_text!("../quasi_newton/end.wgsl")];
            solve([&[PLAIN, none, TOOLS], meetings::IN_END, &own].concat())
        }
        File::EndRecovered => {
            let first = [kernel_text!("../quasi_newton/recovered_end.wgsl"), TOOLS];
            let own = [samples_end, kernel_text!("../quasi_newton/end.wgsl")];
            solve([&tables, &first[..], meetings::IN_END, &own].concat())
        }
        File::FindContacts => vec![TOOLS, kernel_text!("../step/contacts/find.wgsl")],
        File::LoadContacts => SAMPLES.to_vec(),
        File::EndContacts => {
            [pieces(), vec![TOOLS, kernel_text!("../step/contacts/end.wgsl")]].concat()
        }
        File::Skin => [&[TOOLS], meetings::FIND].concat(),
        File::SortMeetings => meetings::SORT.to_vec(),
        File::EndMeetings => [&[TOOLS], meetings::END].concat(),
        File::Pressures if SHOWS_VALUES => vec![TOOLS, kernel_text!("pressures.wgsl")],
        // Of the explicit method.
        _ => small_steps(file, &pieces(), &[&tables[..], &[forces]].concat()),
    }
}

/// Files of the explicit method, behind what they share, with those `of` recovered-gradient tetrahedra.
fn small_steps(file: File, all: &[&'static str], of: &[&'static str]) -> Vec<&'static str> {
    let [touched, energy] = [File::TouchedRecovered, File::EnergyRecovered];
    let which = Which {
        limits_energy: [File::ExplicitEnergy, energy].contains(&file),
        touches: [File::ExplicitTouched, touched].contains(&file),
        is_recovered: [File::ExplicitRecovered, touched, energy].contains(&file),
    };
    explicit(which, &[&laws()[..], all].concat(), of, [PLAIN, TOOLS])
}

fn laws() -> Vec<&'static str> {
    vec![wgsl::LAW_TEXT.as_str(), TISSUE_WGSL]
}

fn elements(file: &'static str) -> Vec<&'static str> {
    vec![wgsl::KIND_TEXT.as_str(), ELEMENTS, file]
}

/// Sums over pieces.
fn pieces() -> Vec<&'static str> {
    elements(kernel_text!("../step/pieces.wgsl"))
}

/// The whole text that a kernel is compiled from: constants that the host shares, then whole files.
pub fn source(kernel: &Kernel, variant: Variant) -> String {
    let constants = super::shared::constants();
    let all = [&[constants.as_str()][..], &SHARED, &files(kernel, variant)].concat();
    all.join("\n")
}

/// Every text that there is, with a name: the entry point, and the variant where the text depends on it.
pub fn texts() -> Vec<(String, String)> {
    let variants =
        TetForm::ALL.into_iter().flat_map(|form| Swept::ALL.map(|swept| Variant { form, swept }));
    let mut texts: Vec<(String, String)> = Vec::new();
    for kernel in ALL {
        for variant in variants.clone() {
            let text = source(kernel, variant);
            let name = key(kernel, variant).replace(' ', "-");
            if !texts.iter().any(|(known, _)| *known == name) {
                texts.push((name, text));
            }
        }
    }
    texts
}

/// The key of a pipeline.
pub(super) fn key(kernel: &Kernel, variant: Variant) -> String {
    if varies(kernel) {
        format!("{} {:?} {:?}", kernel.entry, variant.form, variant.swept)
    } else if matches!(
        kernel.file,
        File::ExplicitRecovered
            | File::ExplicitTouched
            | File::TouchedRecovered
            | File::EnergyRecovered
            | File::EvaluateRecovered
            | File::EndRecovered
    ) {
        // Some have the names of those for plain tetrahedra, or of another method.
        format!("{} {:?}", kernel.entry, kernel.file)
    } else {
        kernel.entry.to_owned()
    }
}

/// Whether the text depends on the variant.
fn varies(kernel: &Kernel) -> bool {
    matches!(
        kernel.file,
        File::Sweep
            | File::SweepClusters
            | File::SweepElements
            | File::AndersonPush
            | File::Loads
            | File::HistoryTets
    )
}
