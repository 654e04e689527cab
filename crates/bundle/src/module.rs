//! JavaScript around the wasm module, by wasm-bindgen.

use std::path::Path;

use anyhow::{Context, Result, bail};
use wasm_bindgen_cli_support::Bindgen;

use crate::files::{self, Files};

/// The script around the module.
pub const SCRIPT: &str = "viscera.js";
/// The module.
pub const WASM: &str = "viscera_bg.wasm";
/// The module's interface for TypeScript.
pub const TYPES: &str = "viscera.d.ts";

/// What wasm-bindgen makes of a module for browsers: [`SCRIPT`], [`WASM`], [`TYPES`] and, where the module brings some, further
/// scripts.
pub fn build(wasm: &Path) -> Result<Files> {
    let folder = tempfile::tempdir().context("no temporary folder could be made")?;
    let mut bindgen = Bindgen::new();
    let generated = bindgen
        .input_path(wasm)
        .out_name("viscera")
        .web(true)
        .map(|bindgen| bindgen.typescript(true).omit_default_module_path(false))
        // Names of functions are an eighth of what travels, and only a debugger reads them.
        .map(|bindgen| bindgen.remove_name_section(true).remove_producers_section(true))
        .and_then(|bindgen| bindgen.generate(folder.path()));
    generated.with_context(|| format!("{}: wasm-bindgen refuses it", wasm.display()))?;
    let mut files = files::read(folder.path())?;
    for name in [SCRIPT, WASM, TYPES] {
        if !files.contains_key(name) {
            bail!("{name}: wasm-bindgen has written no such file");
        }
    }
    // Types of the raw exports, which nobody needs.
    files.remove("viscera_bg.wasm.d.ts");
    Ok(files)
}
