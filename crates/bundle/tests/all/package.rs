//! The package for other people's pages.

use viscera_bundle::files::Files;
use viscera_bundle::package;

use crate::files;

/// The end of what wasm-bindgen writes.
const SCRIPT: &str = "async function __wbg_init(x) { x = new URL('viscera_bg.wasm', import.meta.url); }\n\
                      export { initSync, __wbg_init as default };\n";

fn sources() -> Files {
    files(&[
        ("package.json", "{\n  \"name\": \"viscera\",\n  \"version\": \"0.0.0\"\n}"),
        ("index.js", ""),
    ])
}

#[test]
fn the_version_is_the_programs() {
    let generated = files(&[("viscera.js", SCRIPT), ("viscera_bg.wasm", "module")]);
    let package = package::build(&sources(), &generated, "1.2.3").expect("a package");
    let manifest = String::from_utf8(package["package.json"].clone()).expect("text");
    assert_eq!(manifest, "{\n  \"name\": \"viscera\",\n  \"version\": \"1.2.3\"\n}");
    let names: Vec<&str> = package.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        ["index.js", "package.json", "viscera-inline.js", "viscera.js", "viscera_bg.wasm"]
    );
}

#[test]
fn the_inlined_script_has_the_module_and_fetches_nothing() {
    let generated = files(&[("viscera.js", SCRIPT), ("viscera_bg.wasm", "module")]);
    let package = package::build(&sources(), &generated, "1.2.3").expect("a package");
    let script = String::from_utf8(package[package::INLINE].clone()).expect("text");
    assert!(script.contains("\"bW9kdWxl\""), "{script}");
    assert!(!script.contains("new URL"), "{script}");
    assert!(script.contains("export { initSync, __wbg_init as default };"), "{script}");
}

#[test]
fn a_script_of_another_shape_is_refused() {
    let generated = files(&[("viscera.js", "export {}"), ("viscera_bg.wasm", "module")]);
    let error = package::build(&sources(), &generated, "1.2.3").expect_err("refused");
    assert!(error.to_string().contains("viscera.js: it lacks"), "{error}");
}
