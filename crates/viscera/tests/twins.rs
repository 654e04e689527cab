//! The WGSL twins of the elements' functions.

use viscera::elements::wgsl;
use viscera::solver::TISSUE_WGSL;

/// Parses and validates a shader as wgpu will.
fn validate(source: &str) {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)));
    let flags = naga::valid::ValidationFlags::all();
    let capabilities = naga::valid::Capabilities::empty();
    naga::valid::Validator::new(flags, capabilities)
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)));
}

#[test]
fn all_files_together_are_a_valid_shader() {
    validate(&[&wgsl::ALL[..], &[TISSUE_WGSL]].concat().concat());
}
