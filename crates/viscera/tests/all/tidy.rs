//! The shape of the project: what ARCHITECTURE.md and README.md promise, and who may use whom.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}; write it"))
}

/// All Rust files of the library with their path below its `src`, sorted.
fn library_sources() -> Vec<(String, String)> {
    let src = root().join("crates/viscera/src");
    let mut files = Vec::new();
    let mut folders = vec![src.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.expect("a readable folder entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(&src).expect("a path below src");
                let name = name.to_string_lossy().replace('\\', "/");
                files.push((name, fs::read_to_string(&path).expect("readable source")));
            }
        }
    }
    files.sort();
    files
}

/// Source without line comments, where words are only words. A quoted text is cut at `//` too.
fn code_of(source: &str) -> String {
    source.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// Modules of the library from the ground up. A module uses those of its own layer and of the
/// layers below.
const LAYERS: &[&[&str]] = &[
    &["scalar", "settings", "sorting", "units"],
    &["mesh"],
    &["material"],
    &["elements"],
    &["coloring", "contact", "haptics"],
    &["scene", "model", "state"],
    &["layout"],
    &["solver"],
    &["measure", "rest"],
    &["simulation"],
    &["record", "worlds"],
];

fn layer_of(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

/// Modules named in `crate::a` and in `crate::{a, b::c}`.
fn used_modules(code: &str) -> Vec<String> {
    let first_name = |text: &str| -> String {
        text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
    };
    let mut modules = Vec::new();
    for (at, found) in code.match_indices("crate::") {
        // `$crate::` in a macro counts; `mycrate::` does not.
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &code[at + found.len()..];
        let Some(group) = rest.strip_prefix('{') else {
            modules.push(first_name(rest));
            continue;
        };
        let (mut depth, mut name_follows) = (0, true);
        for (i, c) in group.char_indices() {
            match c {
                '}' if depth == 0 => break,
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => name_follows = true,
                c if name_follows && !c.is_whitespace() => {
                    modules.push(first_name(&group[i..]));
                    name_follows = false;
                }
                _ => {}
            }
        }
    }
    modules.retain(|m| !m.is_empty());
    modules
}

#[test]
fn used_modules_are_found_alone_and_in_groups() {
    let code =
        "use crate::{mesh::{TetMesh, io}, scalar::Vec3,\n solver};\nfn f() { crate::units::x() }";
    assert_eq!(used_modules(code), ["mesh", "scalar", "solver", "units"]);
}

#[test]
fn modules_use_only_what_lies_below_them() {
    let mut complaints = Vec::new();
    for (name, source) in library_sources() {
        let module = name.split('/').next().unwrap_or("").trim_end_matches(".rs");
        if module == "lib" {
            continue;
        }
        let Some(own) = layer_of(module) else {
            complaints.push(format!("{name}: give `{module}` a place in LAYERS of this test"));
            continue;
        };
        for used in used_modules(&code_of(&source)) {
            if layer_of(&used).is_some_and(|layer| layer > own) {
                complaints.push(format!("{name}: `{module}` must not use `{used}`, a layer above"));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn library_touches_neither_files_nor_clocks() {
    let forbidden = ["std::fs", "std::env", "std::net", "Instant", "SystemTime"];
    let mut complaints = Vec::new();
    for (name, source) in library_sources() {
        // Tests inside the library may read data.
        let code = code_of(&source);
        let code = code.split("#[cfg(test)]").next().unwrap_or("");
        for word in forbidden.into_iter().filter(|w| code.contains(w)) {
            complaints.push(format!("{name}: `{word}`; take bytes or seconds as an argument"));
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// Packages that programs are built from; every other package is a program.
const LIBRARIES: &[&str] = &["crates/viscera", "crates/picture"];

/// One that is not inlined is not compiled for the processor's registers: every operation in it is a call.
#[test]
fn all_that_kernels_call_is_inlined() {
    let mut kernels = 0;
    for (name, source) in library_sources() {
        let lines: Vec<&str> = source.lines().map(str::trim).collect();
        for (at, line) in lines.iter().enumerate() {
            let is_kernel = line.contains("fn ") && line.contains("L: Lanes");
            if !is_kernel || line.ends_with(';') {
                continue;
            }
            kernels += 1;
            let above = lines[..at].iter().rev().take_while(|line| line.starts_with(['#', '/']));
            let mut attributes = above.filter(|line| line.starts_with('#'));
            assert!(
                attributes.any(|a| a.contains("inline(always)") || a.contains("target_feature")),
                "{name}, line {}: {line} needs #[inline(always)]",
                at + 1
            );
        }
    }
    assert!(kernels > 20, "{kernels} kernels");
}

#[test]
fn libraries_leave_arguments_and_reports_to_programs() {
    for library in LIBRARIES {
        let manifest = read(&format!("{library}/Cargo.toml"));
        let used = |name: &str| manifest.lines().any(|line| line.trim_start().starts_with(name));
        for name in ["clap", "anyhow"] {
            assert!(!used(name), "{library}/Cargo.toml: `{name}` belongs in programs");
        }
    }
}

/// Folders of the workspace's packages.
fn members() -> Vec<String> {
    let manifest = read("Cargo.toml");
    let list = manifest.split_once("\nmembers = [").expect("the members of the workspace").1;
    let list = list.split_once(']').expect("the end of the members").0;
    list.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// A package's own name.
fn package_name(manifest: &str) -> &str {
    let package = manifest.split_once("[package]").expect("a package").1;
    let line = package.lines().find(|line| line.starts_with("name = ")).expect("a name");
    line.split('"').nth(1).expect("a name in quotes")
}

/// Packages that a manifest names in any section of dependencies: of the program, its tests, its build, of one
/// system, renamed ones by their own names.
fn dependencies(manifest: &str) -> Vec<&str> {
    let mut names = Vec::new();
    let mut is_list = false;
    for line in manifest.lines().map(str::trim) {
        if let Some(header) = line.strip_prefix('[') {
            let header = header.split(']').next().unwrap_or("");
            is_list = header.ends_with("dependencies");
            // `[dependencies.name]`
            let one = header.rsplit_once("dependencies.");
            names.extend(one.map(|(_, name)| name.trim_matches('"')));
        } else if is_list && !line.starts_with('#') {
            let end = line.find(['.', '=', ' ']).unwrap_or(0);
            names.push(line[..end].trim_matches('"'));
        }
        if !line.starts_with('#')
            && let Some((_, renamed)) = line.split_once("package = \"")
        {
            names.extend(renamed.split('"').next());
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

#[test]
fn dependencies_are_found_in_every_section() {
    let manifest = "[package]\nname = \"own\"\n\n[dependencies]\n# c = \"1\"\na.workspace = true\n\
                    b = { path = \"x\" }\nlong = [\n    \"std\",\n]\n\n[dev-dependencies]\nd = { package = \"e\" }\n\
                    [target.'cfg(unix)'.dependencies]\nf = \"1\"\n[build-dependencies.g]\npath = \"y\"\n[lints]\nh = 1\n";
    assert_eq!(package_name(manifest), "own");
    let found = dependencies(manifest);
    for name in ["a", "b", "d", "e", "f", "g"] {
        assert!(found.contains(&name), "{name} is missing in {found:?}");
    }
    for name in ["own", "c", "h"] {
        assert!(!found.contains(&name), "{name} is no dependency: {found:?}");
    }
}

/// A program is a package with a `main.rs` or a `[[bin]]`. What two programs need is a library of its own.
#[test]
fn no_program_uses_another() {
    let manifests: Vec<(String, String)> =
        members().into_iter().map(|m| (read(&format!("{m}/Cargo.toml")), m)).collect();
    let is_program = |(manifest, member): &&(String, String)| {
        root().join(member).join("src/main.rs").exists() || manifest.contains("[[bin]]")
    };
    let programs: Vec<_> = manifests.iter().filter(is_program).collect();
    let names: Vec<&str> = programs.iter().map(|(manifest, _)| package_name(manifest)).collect();
    for known in ["viscera-cli", "viscera-view", "viscera-lab"] {
        assert!(names.contains(&known), "{known} is not among the programs {names:?}");
    }
    // Nor does a library use a program.
    for (manifest, member) in &manifests {
        let own = package_name(manifest);
        let used = dependencies(manifest);
        assert!(
            own == "viscera" || own == "xtask" || used.contains(&"viscera"),
            "{member}: {used:?}"
        );
        for name in names.iter().filter(|name| **name != own) {
            assert!(
                !used.contains(name),
                "{member}/Cargo.toml: `{name}` is a program; put what both need into a library"
            );
        }
    }
}

/// Texts between single backticks, code blocks left out.
fn code_spans(markdown: &str) -> Vec<&str> {
    let mut spans = Vec::new();
    let mut in_block = false;
    for line in markdown.lines() {
        if line.trim_start().starts_with("```") {
            in_block = !in_block;
        } else if !in_block {
            spans.extend(line.split('`').skip(1).step_by(2));
        }
    }
    spans
}

/// True for `crates/viscera/src/scalar.rs`, `mesh/` and `README.md`; not for commands, patterns
/// and Rust paths.
fn looks_like_a_path(text: &str) -> bool {
    let plain = text.chars().all(|c| c.is_ascii_alphanumeric() || "/._-".contains(c))
        && text.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '.');
    let endings = ["/", ".rs", ".md", ".toml", ".cff", ".wgsl", ".yml"];
    let folders = ["crates/", "scenes/", "docs/", ".ci/", ".cargo/"];
    plain
        && !endings.contains(&text)
        && (endings.iter().any(|e| text.ends_with(e))
            || folders.iter().any(|folder| text.starts_with(folder)))
}

#[test]
fn paths_in_architecture_exist() {
    let text = read("ARCHITECTURE.md");
    let paths: Vec<&str> = code_spans(&text).into_iter().filter(|s| looks_like_a_path(s)).collect();
    assert!(paths.len() >= 5, "ARCHITECTURE.md names hardly a path; put paths in backticks");
    // From the repository's root, or from the library's source.
    let exists =
        |p: &str| ["", "crates/viscera/src"].iter().any(|at| root().join(at).join(p).exists());
    let missing: Vec<&str> = paths.into_iter().filter(|p| !exists(p)).collect();
    assert!(missing.is_empty(), "ARCHITECTURE.md names what does not exist: {missing:?}");
}

/// `file::test`, of the integration tests.
#[test]
fn tests_in_architecture_exist() {
    let text = read("ARCHITECTURE.md");
    let start = text.find("## Invariants").expect("the invariants");
    let rows: Vec<&str> =
        text[start..].lines().filter(|line| line.starts_with("| ")).skip(1).collect();
    assert!(rows.len() >= 10, "{} invariants", rows.len());
    for row in rows {
        let tests: Vec<&str> = code_spans(row).into_iter().filter(|s| s.contains("::")).collect();
        assert!(!tests.is_empty(), "{row}: name its test");
        for test in tests {
            let (file, name) = test.split_once("::").expect("a test of a file");
            let source = read(&format!("crates/viscera/tests/all/{file}.rs"));
            let is_test = source.contains(&format!("#[test]\nfn {name}()"));
            assert!(is_test, "{test}: no such test");
        }
    }
}

/// The code names of glossary and symbols are names in the library.
#[test]
fn symbols_of_the_algorithm_are_in_the_code() {
    let text = read("docs/algorithm.md");
    let sources: String = library_sources().into_iter().map(|(_, source)| source).collect();
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let words: std::collections::BTreeSet<&str> = sources.split(|c| !is_part(c)).collect();
    let mut count = 0;
    for (head, column) in [("| term | symbol |", 4), ("| symbol | code |", 2)] {
        let start = text.find(head).unwrap_or_else(|| panic!("no table `{head}`"));
        let rows = text[start..].lines().skip(2).take_while(|line| line.starts_with('|'));
        for row in rows {
            let code = row.split('|').nth(column).expect("a column");
            let names = code_spans(code).into_iter().flat_map(|span| span.split(|c| !is_part(c)));
            // Numbers and single letters are mathematics.
            for name in names.filter(|name| name.len() > 2 && name.parse::<f64>().is_err()) {
                assert!(words.contains(name), "{row}: `{name}` is not in the library");
                count += 1;
            }
        }
    }
    assert!(count > 50, "{count} names");
}

#[test]
fn readme_example_is_the_file_that_is_tested() {
    let text = read("README.md");
    let Some((before, rest)) = text.split_once("```rust\n") else {
        panic!("README.md: show the library's example in a ```rust block");
    };
    let block = rest.split("```").next().unwrap_or("");
    let is_example = |s: &&str| s.starts_with("crates/viscera/examples/") && s.ends_with(".rs");
    let Some(name) = code_spans(before).into_iter().rfind(is_example) else {
        panic!("README.md: name `crates/viscera/examples/<name>.rs` before the ```rust block");
    };
    // Checked out on Windows, files may end their lines otherwise.
    let same = |s: &str| s.replace("\r\n", "\n").trim().to_owned();
    assert_eq!(same(block), same(&read(name)), "README.md and {name} differ: copy the file");
}

/// Sources of all packages, with their paths from the root.
fn all_sources() -> Vec<(String, String)> {
    let mut files = Vec::new();
    let mut folders = vec![root().join("crates"), root().join("xtask")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of sources").flatten() {
            let path = entry.path();
            if path.is_dir() && !path.ends_with("target") {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs" || e == "wgsl") {
                let text = fs::read_to_string(&path).expect("readable source");
                files
                    .push((path.strip_prefix(root()).unwrap_or(&path).display().to_string(), text));
            }
        }
    }
    files
}

/// A file and a function are read at one sitting.
#[test]
fn files_and_functions_are_short() {
    let indent = |line: &str| line.len() - line.trim_start().len();
    let mut complaints = Vec::new();
    let sources = all_sources();
    assert!(sources.len() > 300, "{} sources", sources.len());
    let mut functions = 0;
    for (name, text) in &sources {
        let lines: Vec<&str> = text.lines().collect();
        if lines.len() >= 500 {
            complaints.push(format!("{name}: {} lines; below 500", lines.len()));
        }
        for (first, line) in lines.iter().enumerate() {
            let words = line.trim_start();
            let is_function =
                ["fn ", "pub fn ", "pub(super) fn ", "pub(crate) fn ", "pub unsafe fn "]
                    .iter()
                    .any(|start| words.starts_with(start));
            // What a trait only declares ends before it begins.
            let opens = lines[first..].iter().find(|l| l.ends_with(['{', ';', '}']));
            let has_body = opens.is_some_and(|line| line.ends_with('{'));
            let is_end = |other: &str| indent(other) == indent(line) && other.trim() == "}";
            if is_function
                && has_body
                && let Some(length) = lines[first..].iter().position(|other| is_end(other))
            {
                functions += 1;
                let length = length + 1;
                if length >= 80 {
                    complaints.push(format!("{name}:{}: {length} lines; below 80", first + 1));
                }
            }
        }
    }
    assert!(functions > 2000, "{functions} functions");
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}
