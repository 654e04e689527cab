//! The example of the README runs.

#[path = "../../examples/hanging_beam.rs"]
mod hanging_beam;

#[test]
fn the_example_of_the_readme_runs() {
    hanging_beam::main().expect("the example should run");
}
