//! JavaScript around the wasm modules, by wasm-bindgen.

use std::path::Path;

use anyhow::{Context, Result, bail};
use wasm_bindgen_cli_support::Bindgen;

use crate::files::{self, Files};

/// The script around the page's module.
pub const SCRIPT: &str = "viscera.js";
/// The page's module.
pub const WASM: &str = "viscera_bg.wasm";
/// The module that is fetched where a person opens a file of their own.
pub const FILES_WASM: &str = "viscera_files_bg.wasm";

/// What wasm-bindgen makes of the page's module and of the one for files, for browsers: scripts, modules, their interfaces for
/// TypeScript and, where a module brings some, further scripts.
pub fn build_all(wasm: &Path, files_wasm: &Path) -> Result<Files> {
    let mut all = build(wasm, "viscera")?;
    all.extend(build(files_wasm, "viscera_files")?);
    Ok(all)
}

/// Whether a file is an interface for TypeScript, which no browser reads.
pub fn is_types(path: &str) -> bool {
    path.ends_with(".d.ts")
}

fn build(wasm: &Path, name: &str) -> Result<Files> {
    let folder = tempfile::tempdir().context("no temporary folder could be made")?;
    let mut bindgen = Bindgen::new();
    let generated = bindgen
        .input_path(wasm)
        .out_name(name)
        .web(true)
        .map(|bindgen| bindgen.typescript(true).omit_default_module_path(false))
        // Names of functions are an eighth of what travels, and only a debugger reads them.
        .map(|bindgen| bindgen.remove_name_section(true).remove_producers_section(true))
        .and_then(|bindgen| bindgen.generate(folder.path()));
    generated.with_context(|| format!("{}: wasm-bindgen refuses it", wasm.display()))?;
    let mut files = files::read(folder.path())?;
    for end in [".js", "_bg.wasm", ".d.ts"] {
        if !files.contains_key(&format!("{name}{end}")) {
            bail!("{name}{end}: wasm-bindgen has written no such file");
        }
    }
    // Types of the raw exports, which nobody needs.
    files.remove(&format!("{name}_bg.wasm.d.ts"));
    Ok(files)
}
