//! JavaScript around the wasm module, by wasm-bindgen.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};
use wasm_bindgen_cli_support::Bindgen;

use crate::files::{self, Files};

/// The script around the module.
pub const SCRIPT: &str = "viscera.js";
/// The module.
pub const WASM: &str = "viscera_bg.wasm";
/// The module's interface for TypeScript.
pub const TYPES: &str = "viscera.d.ts";

/// Proposals that every browser with WebGPU has; wasm-opt must be told, since it assumes none.
const FEATURES: [&str; 7] = [
    "--enable-bulk-memory",
    "--enable-simd",
    "--enable-nontrapping-float-to-int",
    "--enable-sign-ext",
    "--enable-mutable-globals",
    "--enable-reference-types",
    "--enable-multivalue",
];

/// What wasm-bindgen makes of the module, and what was done to it.
pub struct Module {
    /// [`SCRIPT`], [`WASM`], [`TYPES`] and, where the module brings some, further scripts.
    pub files: Files,
    /// Whether wasm-opt was there, for people.
    pub remark: String,
}

/// Runs wasm-bindgen for browsers, then wasm-opt where it is on the PATH.
pub fn build(wasm: &Path) -> Result<Module> {
    let folder = tempfile::tempdir().context("no temporary folder could be made")?;
    let mut bindgen = Bindgen::new();
    let generated = bindgen
        .input_path(wasm)
        .out_name("viscera")
        // Names of functions are half a megabyte, and no page shows them.
        .remove_name_section(true)
        .remove_producers_section(true)
        .web(true)
        .map(|bindgen| bindgen.typescript(true).omit_default_module_path(false))
        // Names of functions are an eighth of what travels, and only a debugger reads them.
        .map(|bindgen| bindgen.remove_name_section(true).remove_producers_section(true))
        .and_then(|bindgen| bindgen.generate(folder.path()));
    generated.with_context(|| format!("{}: wasm-bindgen refuses it", wasm.display()))?;
    let remark = optimize(&folder.path().join(WASM))?;
    let mut files = files::read(folder.path())?;
    for name in [SCRIPT, WASM, TYPES] {
        if !files.contains_key(name) {
            bail!("{name}: wasm-bindgen has written no such file");
        }
    }
    // Types of the raw exports, which nobody needs.
    files.remove("viscera_bg.wasm.d.ts");
    Ok(Module { files, remark })
}

fn optimize(wasm: &Path) -> Result<String> {
    let mut command = Command::new("wasm-opt");
    command.arg("-O3").args(FEATURES).arg(wasm).arg("-o").arg(wasm);
    match command.output() {
        Err(_) => Ok("wasm-opt is not on the PATH; the module is as the compiler left it.".into()),
        Ok(output) if output.status.success() => Ok("wasm-opt -O3 has been run.".into()),
        Ok(output) => {
            let said = String::from_utf8_lossy(&output.stderr);
            bail!("wasm-opt refuses the module; take it off the PATH, or a newer one: {said}")
        }
    }
}
