//! wasm-bindgen on a module of a few bytes.

use viscera_bundle::module;

/// A module with one empty function, exported as `f`.
const MODULE: [u8; 36] = [
    0, b'a', b's', b'm', 1, 0, 0, 0, // version 1
    1, 4, 1, 0x60, 0, 0, // a type: nothing in, nothing out
    3, 2, 1, 0, // a function of it
    5, 3, 1, 0, 1, // a page of memory
    7, 5, 1, 1, b'f', 0, 0, // its name outside
    10, 4, 1, 2, 0, 0x0b, // its body
];

#[test]
fn each_module_gets_a_script_that_finds_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("m.wasm");
    std::fs::write(&file, MODULE).expect("written");
    let all = module::build_all(&file, &file).expect("two modules");
    for (script, wasm) in [(module::SCRIPT, module::WASM), ("viscera_files.js", module::FILES_WASM)]
    {
        let script = String::from_utf8(all[script].clone()).expect("text");
        assert!(script.contains(&format!("new URL('{wasm}', import.meta.url)")), "{script}");
        assert!(all[wasm].starts_with(b"\0asm"));
    }
    let types: Vec<&String> = all.keys().filter(|path| module::is_types(path)).collect();
    assert_eq!(types, ["viscera.d.ts", "viscera_files.d.ts"]);
}

#[test]
fn what_is_no_module_is_refused_with_its_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("m.wasm");
    std::fs::write(&file, "no module").expect("written");
    let error = format!("{:#}", module::build_all(&file, &file).expect_err("refused"));
    assert!(error.contains("m.wasm") && error.contains("wasm-bindgen refuses it"), "{error}");
}
