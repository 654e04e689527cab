//! Imports inside the library make no circle: every file can be read with what lies below it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A module by its path below the library, `[]` for the root.
type Module = Vec<String>;

/// Files and code of all modules; tests inside them are left out.
fn modules() -> BTreeMap<Module, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut folders = vec![root.clone()];
    let mut modules = BTreeMap::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder of sources").flatten() {
            let path: PathBuf = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let relative = path.strip_prefix(&root).expect("below the root").with_extension("");
                let mut module: Module =
                    relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
                if matches!(module.last().map(String::as_str), Some("mod" | "lib")) {
                    module.pop();
                }
                let source = std::fs::read_to_string(&path).expect("a source");
                modules.insert(module, code_of(&source));
            }
        }
    }
    modules
}

/// Without comments, without the tests at the end, and without paths that only say who may see something.
fn code_of(source: &str) -> String {
    let lines = source.lines().map(|line| line.split("//").next().unwrap_or(""));
    let code = lines.collect::<Vec<_>>().join("\n");
    let code = code.split("#[cfg(test)]\nmod tests {").next().unwrap_or("");
    let mut parts = code.split("pub(in ");
    let first = parts.next().unwrap_or("").to_owned();
    parts.fold(first, |code, part| code + "pub" + part.split_once(')').map_or("", |(_, rest)| rest))
}

/// The paths of a `use` tree: `a::{b, c::d}` are `a::b` and `a::c::d`.
fn paths(tree: &str) -> Vec<Vec<String>> {
    let names = |text: &str| -> Vec<String> {
        let text = text.split(" as ").next().unwrap_or("");
        text.split("::").map(|name| name.trim().to_owned()).filter(|n| !n.is_empty()).collect()
    };
    let Some((head, rest)) = tree.split_once('{') else { return vec![names(tree)] };
    let group = &rest[..rest.rfind('}').unwrap_or(rest.len())];
    let (mut depth, mut parts) = (0, vec![String::new()]);
    for c in group.chars() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        parts.last_mut().expect("never empty").push(c);
    }
    let head = names(head);
    let within = parts.iter().filter(|part| !part.trim().is_empty()).flat_map(|part| paths(part));
    within.map(|path| [head.clone(), path].concat()).collect()
}

/// What a module names: paths of its `use`s, each with whether it is given on, and paths in its code.
fn named(code: &str) -> Vec<(bool, Vec<String>)> {
    let mut found = Vec::new();
    let mut rest = String::new();
    for (i, statement) in code.split(';').enumerate() {
        // A statement begins behind the last brace or attribute.
        let start = statement.rfind("use ").filter(|&at| {
            let before = statement[..at].trim_end();
            before.is_empty() || before.ends_with(['}', ']', '{', ')']) || before.ends_with("pub")
        });
        match start {
            Some(at) => {
                let is_public = statement[..at].trim_end().ends_with(['b', ')'])
                    && statement[..at].contains("pub");
                found.extend(paths(&statement[at + 4..]).into_iter().map(|path| (is_public, path)));
            }
            None => {
                rest.push_str(if i > 0 { ";" } else { "" });
                rest.push_str(statement);
            }
        }
    }
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    for (at, _) in rest.match_indices("::") {
        let head: String = rest[..at].chars().rev().take_while(|&c| is_name(c)).collect();
        let head: String = head.chars().rev().collect();
        let before = rest[..at - head.len()].ends_with("::");
        if head.is_empty() || before {
            continue;
        }
        let tail = rest[at..].split(|c: char| !is_name(c) && c != ':').next().unwrap_or("");
        let tail = tail.split("::").filter(|name| !name.is_empty()).map(str::to_owned);
        found.push((false, std::iter::once(head).chain(tail).collect()));
    }
    found
}

struct Library {
    modules: BTreeMap<Module, String>,
    /// Where the names that modules give on come from.
    given_on: BTreeMap<(Module, String), Vec<String>>,
}

impl Library {
    fn new() -> Self {
        let mut library = Self { modules: modules(), given_on: BTreeMap::new() };
        let mut given_on = BTreeMap::new();
        for (module, code) in &library.modules {
            for (is_public, path) in named(code) {
                if let Some(path) = library.absolute(module, &path).filter(|_| is_public)
                    && let Some(name) = path.last()
                {
                    given_on.insert((module.clone(), name.clone()), path.clone());
                }
            }
        }
        library.given_on = given_on;
        library
    }

    /// From the root of the library; nothing for what is not in it.
    fn absolute(&self, module: &Module, path: &[String]) -> Option<Vec<String>> {
        let first = path.first()?.as_str();
        let up = path.iter().take_while(|name| *name == "super").count();
        match first {
            "crate" => Some(path[1..].to_vec()),
            "self" => Some([module, &path[1..]].concat()),
            "super" => Some([&module[..module.len().checked_sub(up)?], &path[up..]].concat()),
            _ => {
                let own = [module.as_slice(), &path[..1]].concat();
                self.modules.contains_key(&own).then(|| [module, path].concat())
            }
        }
    }

    /// The file that a path leads to.
    fn file_of(&self, path: &[String], depth: usize) -> Module {
        let longest = (0..=path.len()).rev().find(|&n| self.modules.contains_key(&path[..n]));
        let module = path[..longest.unwrap_or(0)].to_vec();
        let Some(name) = path.get(module.len()) else { return module };
        match self.given_on.get(&(module.clone(), name.clone())) {
            Some(origin) if depth < 8 && origin != path => {
                let rest = &path[module.len() + 1..];
                self.file_of(&[origin, rest].concat(), depth + 1)
            }
            _ => module,
        }
    }

    fn uses(&self, module: &Module) -> BTreeSet<Module> {
        let mut used = BTreeSet::new();
        for (is_public, path) in named(&self.modules[module]) {
            let Some(path) = self.absolute(module, &path) else { continue };
            let file = self.file_of(&path, 0);
            // What a module only gives on from its own folder it need not know.
            let is_own = is_public && file.starts_with(module);
            if file != *module && !is_own {
                used.insert(file);
            }
        }
        used
    }
}

/// Numbers and lanes of numbers are defined by each other: a number knows how to run a kernel in lanes, and a
/// lane is a number.
const ONE_DEFINITION: [&str; 4] = ["", "avx2", "lanes", "simd128"];

#[test]
fn imports_make_no_circle() {
    let library = Library::new();
    assert!(library.modules.len() > 100, "{} modules", library.modules.len());
    let uses: BTreeMap<&Module, BTreeSet<Module>> =
        library.modules.keys().map(|module| (module, library.uses(module))).collect();
    // Modules that use only what is known already are known, until nothing is left, or a circle.
    let mut left: BTreeSet<&Module> = library.modules.keys().collect();
    let scalar = |name: &str| match name {
        "" => vec!["scalar".to_owned()],
        name => vec!["scalar".to_owned(), name.to_owned()],
    };
    let excused: Vec<Module> = ONE_DEFINITION.iter().map(|name| scalar(name)).collect();
    loop {
        let known = left.iter().copied().filter(|module| {
            let waits_for = |other: &Module| {
                left.contains(other) && !(excused.contains(module) && excused.contains(other))
            };
            !uses[*module].iter().any(waits_for)
        });
        let known: Vec<&Module> = known.collect();
        if known.is_empty() {
            break;
        }
        left.retain(|module| !known.contains(module));
    }
    let shown: Vec<String> = left
        .iter()
        .map(|module| {
            let others = uses[*module].iter().filter(|other| left.contains(other));
            let others: Vec<String> = others.map(|other| other.join("::")).collect();
            format!("{} uses {}", module.join("::"), others.join(", "))
        })
        .collect();
    assert!(shown.is_empty(), "circles, or what uses them:\n{}", shown.join("\n"));
}

#[test]
fn imports_are_found() {
    let code = "pub use a::b;\nuse crate::{c::{d, e as f}, g};\nfn h() { super::i::j(); k::l() }";
    let found: Vec<(bool, String)> =
        named(code).into_iter().map(|(is_public, path)| (is_public, path.join("::"))).collect();
    let expected = [
        (true, "a::b"),
        (false, "crate::c::d"),
        (false, "crate::c::e"),
        (false, "crate::g"),
        (false, "super::i::j"),
        (false, "k::l"),
    ];
    assert_eq!(found, expected.map(|(is_public, path)| (is_public, path.to_owned())));
}
