//! The WGSL twins of the elements' functions against the oracle in double precision.
//!
//! Not against each other: both languages round, and neither is right. The device may err twice as
//! much as the processor in single precision.

use crate::common::device::device;
use crate::gpu_common::comparison::{check_nasty, check_percentiles, compare};
use crate::gpu_common::functions::{of_recovered, of_springs, of_tets};
use crate::gpu_common::{Gpu, inputs};
use viscera::elements::wgsl;
use viscera::solver::TISSUE_WGSL;

/// Records of each kind.
const COUNT: usize = 10_000;

fn library() -> String {
    wgsl::everything() + TISSUE_WGSL
}

#[test]
fn all_files_together_are_a_valid_shader() {
    let source = library();
    let module = naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
    let flags = naga::valid::ValidationFlags::all();
    let capabilities = naga::valid::Capabilities::empty();
    naga::valid::Validator::new(flags, capabilities)
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
}

#[test]
fn device_errs_at_most_twice_as_much_as_processor() {
    let kinds = [
        ("rotated", of_tets(), inputs::tets(COUNT, true)),
        ("unrotated", of_tets(), inputs::tets(COUNT, false)),
        ("any", of_springs(), inputs::springs(COUNT)),
        ("bent", of_recovered(), inputs::recovered_tets(COUNT)),
    ];
    let (gpu, library) = (Gpu(device()), library());
    println!("{}: relative errors, processor and device", gpu.0.name());
    let mut wrong = Vec::new();
    for (kind, twins, records) in &kinds {
        for twin in twins {
            let results = compare(&gpu, &library, twin, records);
            wrong.extend(results.iter().filter_map(|result| check_percentiles(kind, result)));
        }
    }
    assert!(
        wrong.is_empty(),
        "{} errs more than twice as much:\n{}",
        gpu.0.name(),
        wrong.join("\n")
    );
}

#[test]
fn nasty_inputs_stay_finite_and_close() {
    let kinds = [
        (of_tets(), inputs::nasty_tets()),
        (of_springs(), inputs::nasty_springs()),
        (of_recovered(), inputs::nasty_recovered_tets()),
    ];
    let (gpu, library) = (Gpu(device()), library());
    let mut wrong = Vec::new();
    for (twins, records) in &kinds {
        for twin in twins {
            let results = compare(&gpu, &library, twin, records);
            let (found, close) = check_nasty(twin, &results, records);
            println!("{}: {:.0} % of the results are well-conditioned", twin.name, 100.0 * close);
            assert!(close > 0.3, "{}: too few results were held close: {close}", twin.name);
            wrong.extend(found);
        }
    }
    let few = wrong.len().min(10);
    let text = wrong[..few].join("\n");
    assert!(wrong.is_empty(), "{} results on {}:\n{text}", wrong.len(), gpu.0.name());
}
