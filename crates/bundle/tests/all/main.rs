//! Tests of the bundle, and of the page in a real browser.

mod module;
mod package;
mod server;
mod site;

use viscera_bundle::files::Files;

/// Files by path and text.
fn files(list: &[(&str, &str)]) -> Files {
    list.iter().map(|(path, text)| ((*path).to_owned(), text.as_bytes().to_vec())).collect()
}
