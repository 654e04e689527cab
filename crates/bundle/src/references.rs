//! Where one file of the page names another.
//!
//! References are plain literals: in quotes or in the brackets of `url(...)`, relative to the file they stand in,
//! beginning with `./` or `../`. What wasm-bindgen writes, `new URL('name', import.meta.url)`, and attributes of
//! HTML may leave `./` out.

use std::ops::Range;

/// A literal that may name a file.
#[derive(Debug, PartialEq, Eq)]
pub struct Reference {
    /// Where its path stands in the text, without what follows `?` or `#`.
    pub place: Range<usize>,
    /// The path from the page's folder.
    pub path: String,
    /// It begins with a dot, so that nothing but a file can be meant.
    pub is_certain: bool,
}

/// All of them in a text that is the file at `from`.
pub fn find(text: &str, from: &str) -> Vec<Reference> {
    let mut found = Vec::new();
    for (at, opening) in text.char_indices() {
        let closing = match opening {
            '"' | '\'' | '`' => opening,
            '(' => ')',
            _ => continue,
        };
        let start = at + opening.len_utf8();
        let is_part = |c: char| c.is_ascii_alphanumeric() || "./_-?#=&%".contains(c);
        let length = text[start..].find(|c| !is_part(c)).unwrap_or(0);
        if !text[start + length..].starts_with(closing) {
            continue;
        }
        let literal = &text[start..start + length];
        let name = &literal[..literal.find(['?', '#']).unwrap_or(length)];
        let is_certain = name.starts_with("./") || name.starts_with("../");
        if !is_certain && !may_be_bare(&text[..at], opening) || !has_extension(name) {
            continue;
        }
        if let Some(path) = resolve(from, name) {
            found.push(Reference { place: start..start + name.len(), path, is_certain });
        }
    }
    found
}

/// What stands before the literal says that a file is meant.
fn may_be_bare(before: &str, opening: char) -> bool {
    let before = before.trim_end();
    match opening {
        '(' => before.ends_with("url"),
        _ => ["new URL(", "src=", "href="].iter().any(|words| before.ends_with(words)),
    }
}

fn has_extension(name: &str) -> bool {
    let last = name.rsplit('/').next().unwrap_or("");
    last.rsplit_once('.')
        .is_some_and(|(stem, extension)| !stem.is_empty() && !extension.is_empty() && stem != ".")
}

/// The path from the page's folder; nothing where it leads out of it.
fn resolve(from: &str, name: &str) -> Option<String> {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in name.split('/') {
        match part {
            "." | "" => {}
            ".." => {
                parts.pop()?;
            }
            _ => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(text: &str, from: &str) -> Vec<String> {
        find(text, from).into_iter().map(|reference| reference.path).collect()
    }

    #[test]
    fn literals_that_name_files_are_found() {
        let script = "import a from \"./a.js\"; new Worker(new URL('../w.js', import.meta.url));\n\
                      new URL( 'bare.wasm', import.meta.url); fetch(`./t.toml?x=1`); // don't";
        assert_eq!(paths(script, "sub/m.js"), ["sub/a.js", "w.js", "sub/bare.wasm", "sub/t.toml"]);
        let page = "<link href=\"style.css\"><script src=./no.js></script><a href='./x.html#top'>";
        assert_eq!(paths(page, "index.html"), ["style.css", "x.html"]);
        let style = "src: url(./f.woff2), url(g.woff2)";
        assert_eq!(paths(style, "style.css"), ["f.woff2", "g.woff2"]);
    }

    #[test]
    fn other_words_are_no_references() {
        let script =
            "x = \"a.js\"; f(b.js); y = './'; z = \"https://example.org/a.js\"; '../../out.js'";
        assert!(paths(script, "m.js").is_empty(), "{:?}", paths(script, "m.js"));
    }

    #[test]
    fn the_place_is_that_of_the_path_alone() {
        let text = "import './a.js?v=1'";
        let found = find(text, "m.js");
        assert_eq!(&text[found[0].place.clone()], "./a.js");
    }
}
