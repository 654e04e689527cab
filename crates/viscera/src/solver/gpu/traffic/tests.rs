use super::counts::entries;
use super::table::Line;
use super::*;
use crate::material::{Material, MaterialModel};
use crate::mesh::shapes;
use crate::model::ModelBuilder;
use crate::settings::{Acceleration, Clusters, Colors, Elements, Method};
use crate::solver::gpu::kernels;
use crate::solver::gpu::layout::Table;
use crate::solver::gpu::slots::{Place, Slot};

/// Two bars, of a size that all levels are there.
fn model() -> Model<f32> {
    bars().build().expect("a model")
}

/// The same with samples of its surface.
fn touchable() -> Model<f32> {
    let mut builder = bars();
    builder.sample_surface(1);
    builder.build().expect("a model")
}

fn bars() -> ModelBuilder {
    let mut builder = ModelBuilder::new();
    for (law, viscosity) in
        [(MaterialModel::StableNeoHookean, 0.0), (MaterialModel::SaintVenantKirchhoff, 0.01)]
    {
        let tissue = Material::new(law, 1e4, 0.3, 1000.0).and_then(|t| t.with_viscosity(viscosity));
        let mesh = shapes::beam(0.16, 0.04, 0.04, 4, 0.1).expect("a beam");
        builder.add_body(&mesh, &tissue.expect("legal")).expect("a body");
    }
    builder
}

/// All ways to solve a model that have kernels of their own.
fn all_settings() -> Vec<SolverSettings> {
    let xpbd = SolverSettings::xpbd();
    let jacobi = SolverSettings { colors: Colors::Limited(1), ..xpbd.clone() };
    vec![
        SolverSettings { colors: Colors::Limited(4), ..xpbd.clone() },
        SolverSettings { acceleration: Acceleration::Anderson, ..jacobi.clone() },
        SolverSettings { acceleration: Acceleration::Chebyshev, ..jacobi },
        SolverSettings { method: Method::Explicit, ..xpbd.clone() },
        SolverSettings { method: Method::QuasiNewton, ..xpbd.clone() },
        SolverSettings { method: Method::Explicit, elements: Elements::Recovered, ..xpbd.clone() },
        SolverSettings {
            method: Method::QuasiNewton,
            elements: Elements::Recovered,
            ..xpbd.clone()
        },
        SolverSettings { clusters: Clusters::OfTets(512), ..xpbd.clone() },
        xpbd,
    ]
}

/// A kernel that is added has an entry, and an array that is bound has a line.
#[test]
fn every_kernel_has_an_entry_with_its_arrays() {
    for kernel in kernels::ALL {
        let own: Vec<_> = entries().filter(|entry| entry.kernel == *kernel).collect();
        let [entry] = own[..] else { panic!("{}: {} entries", kernel.entry, own.len()) };
        for slot in kernel.slots {
            let is_there = entry.lines.iter().any(|line| line.slot == *slot);
            assert!(is_there, "{}: no line of {slot:?}", kernel.entry);
        }
        for line in entry.lines {
            let is_bound = kernel.slots.contains(&line.slot);
            assert!(is_bound, "{}: {:?} is not bound", kernel.entry, line.slot);
            assert!(!(line.is_written && line.slot.is_read_only()), "{}: {line:?}", kernel.entry);
        }
    }
    assert_eq!(entries().count(), kernels::ALL.len());
}

/// A step written down, and what the host makes room for.
struct Laid {
    layout: Layout<f32>,
    recorded: Recorded,
    sizes: Vec<Size>,
    table: Table,
}

impl Laid {
    fn new(model: &Model<f32>, settings: &SolverSettings) -> Self {
        let layout = Layout::on_device(model, settings);
        let recorded = Recorded::new(&layout, settings);
        let table = recorded.on_device.table(&layout, settings);
        let levels = recorded.levels.as_ref().map(|(levels, _)| levels);
        let sizes = Buffers::sizes(&layout, settings, &recorded.on_device, levels, &table);
        Self { layout, recorded, sizes, table }
    }

    fn counts(&self, settings: &SolverSettings) -> Counts<'_> {
        let levels = self.recorded.levels.as_ref();
        let levels = levels.map(|(levels, words)| (levels, words.as_slice()));
        Counts::new(&self.layout, settings, &self.recorded.on_device, levels)
    }

    /// Bytes of what a dispatch is bound to: of a slot, or of the range that it is; none of tables of copies.
    fn room(&self, dispatch: &Dispatch, slot: Slot) -> Option<f64> {
        let of = |slot: Slot| self.sizes.iter().find(|size| size.slot == slot);
        let of = |slot: Slot| of(slot).map_or(0, |size| size.bytes);
        let first = multipliers_start(self.layout.vertex_count());
        let bytes = match slot {
            Slot::CornerIndices | Slot::Offsets if dispatch.on_copies => return None,
            Slot::Points if dispatch.places().any(|place| place == Place::CopiesOf(slot)) => {
                of(Slot::Copies).max(first)
            }
            Slot::Points => first,
            Slot::Multipliers => of(Slot::Unknowns) - first,
            _ => match self.table.ranges.iter().find(|range| range.slot == slot) {
                Some(range) => range.size,
                None => of(slot),
            },
        };
        Some(bytes as f64)
    }
}

/// Arrays that a kernel goes through as a whole, and whether it writes them.
const WHOLE: [(&str, Slot, bool); 13] = [
    ("evaluate_elements", Slot::Tets, false),
    ("load_forces", Slot::Tets, false),
    ("measure_end", Slot::Tets, false),
    ("evaluate_elements", Slot::Loads, true),
    ("load_forces", Slot::Loads, true),
    ("evaluate_vertices", Slot::Loads, false),
    ("advance_explicit", Slot::Loads, false),
    ("rebase", Slot::Loads, false),
    ("evaluate_elements", Slot::Points, false),
    ("evaluate_vertices", Slot::Points, false),
    ("predict", Slot::Points, false),
    ("remember_iterate", Slot::Unknowns, false),
    ("rescale_multipliers", Slot::Multipliers, true),
];

/// Nothing is counted twice: of no array a dispatch must read, or write, more than was made room for; of those that a
/// kernel goes through as a whole, all but padding.
#[test]
fn counted_bytes_fit_into_what_there_is_room_for() {
    let (plain, touchable) = (model(), touchable());
    let mut seen = Vec::new();
    let with_samples = all_settings().into_iter().map(|s| (&touchable, s));
    for (model, settings) in all_settings().into_iter().map(|s| (&plain, s)).chain(with_samples) {
        let has_samples = !model.samples.is_empty();
        let laid = Laid::new(model, &settings);
        let counts = laid.counts(&settings);
        let Record { prologue, body, epilogue, .. } = &laid.recorded.record;
        for dispatch in [prologue, body, epilogue].into_iter().flatten() {
            let kernel = dispatch.kernel;
            for (&slot, is_written) in kernel.slots.iter().flat_map(|s| [(s, false), (s, true)]) {
                let Some(room) = laid.room(dispatch, slot) else { continue };
                let own = |line: &&Line| line.slot == slot && line.is_written == is_written;
                let lines = counts.lines(dispatch).filter(own);
                let bytes: f64 = lines.map(|line| counts.bytes(line, dispatch)[0]).sum();
                let what = format!("{} {slot:?}: {bytes} of {room} B", kernel.entry);
                assert!(bytes <= room, "{what}");
                // One of two dispatches is for vertices alone.
                let is_half = *kernel == kernels::MEASURE_RECOVERED_END && dispatch.job.first > 0;
                // Samples are behind the loads, and read where tools are near.
                let is_whole = !has_samples || slot != Slot::Loads;
                if WHOLE.contains(&(kernel.entry, slot, is_written)) && !is_half && is_whole {
                    seen.push((kernel.entry, slot, is_written));
                    assert!(bytes > 0.9 * room, "{what}");
                }
            }
        }
    }
    assert!(WHOLE.iter().all(|whole| seen.contains(whole)), "{seen:?}");
}

/// Tables of levels are read by few kernels; together they read all of it, and no more.
#[test]
fn tables_of_levels_are_counted_whole() {
    let settings = SolverSettings { method: Method::QuasiNewton, ..SolverSettings::xpbd() };
    let laid = Laid::new(&model(), &settings);
    let counts = laid.counts(&settings);
    let (_, words) = laid.recorded.levels.as_ref().expect("the method's");
    let record = &laid.recorded.record;
    let mut seen: Vec<&str> = Vec::new();
    let mut bytes = 0.0;
    for dispatch in record.prologue.iter().chain(&record.body) {
        if !seen.contains(&dispatch.kernel.entry) {
            seen.push(dispatch.kernel.entry);
            let own = counts.lines(dispatch).filter(|line| line.slot == Slot::Levels);
            bytes += own.map(|line| counts.bytes(line, dispatch)[0]).sum::<f64>();
        }
    }
    let whole = 4.0 * words.len() as f64;
    println!("{bytes} of {whole} B");
    assert!((0.95 * whole..=1.02 * whole).contains(&bytes), "{bytes} of {whole} B");
}

/// Sums, rooflines and sizes go together, whatever the method.
#[test]
fn rooflines_follow_from_bytes_and_dispatches() {
    let model = model();
    for settings in all_settings() {
        let traffic = Traffic::new(&model, &settings, 20);
        let step = traffic.step();
        let by_kernel = traffic.by_kernel();
        let [bytes, count] =
            by_kernel.iter().fold([0.0; 2], |[b, c], (of, n)| [b + of.compulsory, c + *n as f64]);
        assert!((bytes / step.compulsory - 1.0).abs() < 1e-9);
        assert_eq!(count, traffic.dispatch_count() as f64);
        assert!(step.compulsory <= step.moved && step.operations > 0.0);
        let slow = traffic.roofline(1e6);
        assert!((slow * 1e6 / step.compulsory - 1.0).abs() < 1e-9);
        assert_eq!(traffic.roofline(f64::INFINITY), count * Traffic::LATENCY);
        let binding = 128 << 20;
        let largest = traffic.largest_mesh(binding);
        assert!(largest > 100_000 && (largest as f64) < binding as f64, "{largest}");
    }
}

/// Contact is three dispatches a step, and in an iteration none, or one where XPBD rebases. Explicit steps have three more at their
/// end, five with recovered-gradient tetrahedra: samples slip, and energy is limited.
#[test]
fn contact_adds_dispatches_to_a_step_but_none_to_an_iteration() {
    for settings in all_settings() {
        let [without, with] = [model(), touchable()].map(|model| {
            let all = Traffic::new(&model, &settings, 1);
            [0, 1, 2].map(|list| all.dispatches[list].len())
        });
        let more = [0, 1, 2].map(|list| with[list] - without[list]);
        let wanted = match (settings.method, settings.elements) {
            (Method::Xpbd, _) => [1, 1, 2],
            (Method::Explicit, Elements::Recovered) => [1, 0, 7],
            (Method::Explicit, _) => [1, 0, 5],
            _ => [1, 0, 2],
        };
        assert_eq!(more, wanted, "{:?}", settings.method);
    }
}
