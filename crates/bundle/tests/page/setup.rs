//! What the tests need: a browser, and the page as `cargo xtask web` has built it.

use std::path::PathBuf;
use std::sync::OnceLock;

use viscera_bundle::server::Server;

use crate::browser::{Browser, Kind, Tab, program, root};

/// Names the page's folder.
const VARIABLE: &str = "VISCERA_SITE";

/// A browser that all tests share, each with tabs of its own; none, said, where the test is to be skipped. With
/// VISCERA_REQUIRE=1 a test without one fails instead.
pub fn browser(kind: Kind) -> Option<&'static Browser> {
    static GPU: OnceLock<Browser> = OnceLock::new();
    static PLAIN: OnceLock<Browser> = OnceLock::new();
    if program().is_none() {
        return lacks("a browser: install Debian's chromium, or name one with VISCERA_BROWSER");
    }
    let place = if kind == Kind::Gpu { &GPU } else { &PLAIN };
    Some(place.get_or_init(|| Browser::start(kind)))
}

/// The page's folder; none, said, where the test is to be skipped.
pub fn site() -> Option<PathBuf> {
    let named = std::env::var_os(VARIABLE).map(PathBuf::from);
    let folder = named.unwrap_or_else(|| root().join("target/web/site"));
    match folder.join("index.html").exists() {
        true => Some(folder),
        false => lacks("the page: `cargo xtask web` builds it, VISCERA_SITE names another folder"),
    }
}

/// The address of the built page, and an empty tab to open it in.
pub fn page(kind: Kind) -> Option<(Tab, String)> {
    static SERVER: OnceLock<Server> = OnceLock::new();
    let folder = site()?;
    let browser = browser(kind)?;
    let server =
        SERVER.get_or_init(|| Server::start(&folder, 0).unwrap_or_else(|e| panic!("{e:#}")));
    Some((browser.tab(), server.url()))
}

fn lacks<T>(what: &str) -> Option<T> {
    let required = std::env::var_os("VISCERA_REQUIRE").is_some_and(|value| value == "1");
    assert!(!required, "VISCERA_REQUIRE=1 needs {what}");
    println!("skipped: this test needs {what}");
    None
}
