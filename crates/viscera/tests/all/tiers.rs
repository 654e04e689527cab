//! The two tiers of tests: whatever is slow has a fast sibling that calls the same function.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// What the name of a slow test ends with; before that stands the name of its fast sibling.
const AT_LENGTH: &str = "_at_length";

/// All Rust files of the workspace's packages.
fn sources() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut folders = vec![root.join("crates"), root.join("xtask/src")];
    let mut sources = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.expect("a readable folder entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let source = fs::read_to_string(&path).expect("readable source");
                sources.push((path, source));
            }
        }
    }
    sources.sort();
    sources
}

/// A function of a file: what stands above it, its name, what it calls.
struct Function<'a> {
    attributes: Vec<&'a str>,
    name: &'a str,
    calls: BTreeSet<&'a str>,
}

/// The functions of a file that begin a line, but for indentation, in the layout of rustfmt.
fn functions(source: &str) -> Vec<Function<'_>> {
    let lines: Vec<&str> = source.lines().collect();
    let mut functions = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let Some(name) = line.trim_start().strip_prefix("fn ").map(first_word) else { continue };
        let above = lines[..at].iter().rev().map(|l| l.trim());
        let attributes = above.take_while(|l| l.starts_with("#[") || l.starts_with("//")).collect();
        // Rustfmt ends a function with a brace below its first letter.
        let end = format!("{}}}", &line[..line.len() - line.trim_start().len()]);
        let body = lines[at + 1..].iter().take_while(|l| **l != end);
        let calls = body.flat_map(|l| calls(l)).collect();
        functions.push(Function { attributes, name, calls });
    }
    functions
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn first_word(text: &str) -> &str {
    text.split(|c| !is_word(c)).next().unwrap_or("")
}

/// Names before an opening parenthesis, types of generic functions left out.
fn calls(line: &str) -> Vec<&str> {
    let code = line.split("//").next().unwrap_or("");
    let called = code.match_indices('(').map(|(at, _)| {
        let before = &code[..at];
        let before = if before.ends_with('>') {
            before.rfind("::<").map_or(before, |generic| &before[..generic])
        } else {
            before
        };
        before.rsplit(|c| !is_word(c)).next().unwrap_or("")
    });
    called.filter(|name| !name.is_empty()).collect()
}

/// What is wrong with the slow tests of a file.
fn complaints(source: &str) -> Vec<String> {
    let functions = functions(source);
    let own: BTreeSet<&str> = functions.iter().map(|f| f.name).collect();
    let mut complaints = Vec::new();
    for slow in &functions {
        let Some(ignored) = slow.attributes.iter().find(|a| a.starts_with("#[ignore")) else {
            continue;
        };
        let name = slow.name;
        if !ignored.starts_with("#[ignore = \"slow: ") {
            complaints.push(format!("{name}: write #[ignore = \"slow: <what takes so long>\"]"));
        }
        let Some(fast) = name.strip_suffix(AT_LENGTH) else {
            complaints.push(format!("{name}: name it `<its fast sibling>{AT_LENGTH}`"));
            continue;
        };
        let is_fast = |f: &&Function<'_>| {
            f.name == fast
                && f.attributes.contains(&"#[test]")
                && !f.attributes.iter().any(|a| a.starts_with("#[ignore"))
        };
        match functions.iter().find(is_fast) {
            None => complaints.push(format!("{name}: there is no fast test `{fast}` beside it")),
            Some(fast) => {
                let shared = fast.calls.intersection(&slow.calls);
                if shared.filter(|call| own.contains(*call)).count() == 0 {
                    complaints.push(format!(
                        "{name}: its fast sibling calls no function of this file that it calls"
                    ));
                }
            }
        }
    }
    complaints
}

#[test]
fn slow_tests_have_fast_siblings_that_call_the_same_function() {
    let mut all = Vec::new();
    let mut slow = 0;
    for (path, source) in sources() {
        // This file's own examples are no tests.
        if !path.ends_with("tiers.rs") {
            slow += source.matches("#[ignore").count();
            all.extend(complaints(&source).into_iter().map(|c| format!("{}: {c}", path.display())));
        }
    }
    assert!(slow > 0, "slow tests are not found where they were");
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn a_slow_test_without_its_sibling_is_complained_of() {
    let pair = "
fn settle(steps: u32) {
    assert!(steps > 0);
}

#[test]
fn bodies_settle() {
    settle(3);
}

#[test]
#[ignore = \"slow: many steps\"]
fn bodies_settle_at_length() {
    settle::<f32>(3000);
}
";
    assert_eq!(complaints(pair), Vec::<String>::new());
    for (from, to) in [
        ("fn bodies_settle() ", "fn they_settle() "),
        ("    settle(3);", "    other(3);"),
        ("_at_length", "_slowly"),
        ("slow: many", "many"),
        ("#[test]\nfn bodies", "#[test]\n#[ignore = \"slow: too\"]\nfn bodies"),
        ("#[test]\nfn bodies", "fn bodies"),
    ] {
        let broken = pair.replace(from, to);
        assert_ne!(broken, pair);
        assert!(!complaints(&broken).is_empty(), "nothing is said of {to}");
    }
}
