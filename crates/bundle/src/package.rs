//! The package for other people's pages, as a package registry takes it.

use anyhow::{Result, bail};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::files::{self, Files};
use crate::module::{SCRIPT, WASM};

/// The module within its script, for places where nothing else can be fetched.
pub const INLINE: &str = "viscera-inline.js";

/// How wasm-bindgen's script exports its parts, and where it would fetch the module from.
const EXPORTS: &str = "export { initSync, __wbg_init as default };";
const ADDRESS: &str = "new URL('viscera_bg.wasm', import.meta.url)";

/// The line of package.json that the version replaces.
const VERSION_LINE: &str = "\"version\": \"0.0.0\"";

/// All files of the package: its own sources, and those of wasm-bindgen beside them.
pub fn build(sources: &Files, generated: &Files, version: &str) -> Result<Files> {
    let mut package = sources.clone();
    let manifest = files::text(sources, "package.json")?;
    if manifest.matches(VERSION_LINE).count() != 1 {
        bail!("package.json: it must have `{VERSION_LINE}` once, which the version replaces");
    }
    let manifest = manifest.replace(VERSION_LINE, &format!("\"version\": \"{version}\""));
    package.insert("package.json".into(), manifest.into_bytes());
    package.extend(generated.iter().map(|(path, content)| (path.clone(), content.clone())));
    package.insert(INLINE.into(), inline(generated)?.into_bytes());
    Ok(package)
}

/// wasm-bindgen's script with the module in it as base64: the same exports, nothing to fetch.
fn inline(generated: &Files) -> Result<String> {
    let script = files::text(generated, SCRIPT)?;
    let Some(wasm) = generated.get(WASM) else { bail!("{WASM}: there is no such file") };
    for part in [EXPORTS, ADDRESS] {
        if script.matches(part).count() != 1 {
            bail!(
                "{SCRIPT}: it lacks `{part}`; wasm-bindgen writes something else now, and this must follow"
            );
        }
    }
    let script = script.replace(ADDRESS, "inlined()");
    let module = STANDARD.encode(wasm);
    Ok(format!(
        "{script}\n\
         function inlined() {{\n    \
             const text = atob(MODULE);\n    \
             const bytes = new Uint8Array(text.length);\n    \
             for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);\n    \
             return bytes;\n\
         }}\n\
         const MODULE = \"{module}\";\n"
    ))
}
