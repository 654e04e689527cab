//! The tests' own driver, on a page of a few lines: what it does reaches the page, what the page does is seen.

use std::path::Path;

use serde_json::Value;
use viscera_bundle::files::{self, Files};
use viscera_bundle::server::Server;
use viscera_bundle::site;

use crate::browser::{Kind, Tab, View, root};
use crate::setup;

/// A small page with the real service worker, served from a folder of its own.
pub struct Probe {
    pub server: Server,
    pub folder: tempfile::TempDir,
}

impl Probe {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        build(&folder.path().join("site"), "one");
        let server = Server::start(&folder.path().join("site"), 0).expect("a server");
        Self { server, folder }
    }

    /// Puts another build in place.
    pub fn replace(&self, version: &str) {
        build(&self.folder.path().join("site"), version);
    }
}

fn build(folder: &Path, version: &str) {
    let bundle = root().join("crates/bundle");
    let mut sources = files::read(&bundle.join("tests/page/probe")).expect("the probe");
    let worker = std::fs::read(root().join("crates/web/page/offline.js")).expect("offline.js");
    sources.insert("offline.js".into(), worker);
    let text = format!("export const version = \"{version}\";");
    sources.insert("version.js".into(), text.into_bytes());
    let site = site::build(&sources, &Files::new()).expect("a site");
    files::write(folder, &site.files).expect("written");
}

fn opened(kind: Kind) -> Option<(Tab, Probe)> {
    let browser = setup::browser(kind)?;
    let probe = Probe::new();
    let tab = browser.tab();
    tab.go(&probe.server.url());
    tab.wait("window.result", 20.0);
    Some((tab, probe))
}

fn is_red([red, green, blue]: [u8; 3]) -> bool {
    red > 180 && green < 60 && blue < 60
}

fn is_green([red, green, blue]: [u8; 3]) -> bool {
    red < 60 && green > 180 && blue < 60
}

#[test]
fn webgpu_in_a_worker_reaches_the_screenshot() {
    let Some((tab, _probe)) = opened(Kind::Gpu) else { return };
    assert_eq!(tab.evaluate("window.result.adapter"), "swiftshader");
    let picture = tab.look();
    assert_eq!((picture.width, picture.height), (1440, 900));
    assert!(picture.share([0, 0, 200, 200], is_red) > 0.99, "{:?}", picture.at(100, 100));
    assert!(picture.share([0, 200, 200, 200], is_green) > 0.99, "{:?}", picture.at(100, 300));
    assert!(picture.share([300, 0, 200, 200], is_red) < 0.01, "the rest is white");
}

#[test]
fn a_worker_draws_without_webgpu() {
    let Some((tab, _probe)) = opened(Kind::Plain) else { return };
    assert_eq!(tab.evaluate("window.result.adapter"), Value::Null);
    let picture = tab.look();
    assert!(picture.share([0, 200, 200, 200], is_green) > 0.99, "{:?}", picture.at(100, 300));
}

#[test]
fn hands_reach_the_page() {
    let Some((tab, probe)) = opened(Kind::Plain) else { return };
    let seen = |kind: &str, what: &str| {
        let event = format!("window.events.filter((e) => e.kind === '{kind}' && ({what})).length");
        assert!(tab.evaluate(&event) != 0, "{kind}: {}", tab.evaluate("window.events"));
    };
    tab.mouse("mouseMoved", [10.0, 20.0], "none");
    tab.mouse("mousePressed", [10.0, 20.0], "left");
    tab.mouse("mouseMoved", [50.0, 60.0], "left");
    tab.mouse("mouseReleased", [50.0, 60.0], "left");
    seen("pointerdown", "e.pointerType === 'mouse' && e.clientX === 10");
    seen("pointermove", "e.clientX === 50 && e.clientY === 60");
    seen("pointerup", "e.clientX === 50");
    tab.wheel([50.0, 60.0], 120.0);
    tab.wait("window.events.some((e) => e.kind === 'wheel' && e.deltaY === 120)", 5.0);
    tab.evaluate("document.getElementById('field').focus()");
    tab.key("a", 0);
    tab.key("Escape", 0);
    seen("keydown", "e.key === 'Escape'");
    assert_eq!(tab.evaluate("document.getElementById('field').value"), "a");
    let file = probe.folder.path().join("mesh.obj");
    std::fs::write(&file, "v 0 0 0").expect("written");
    tab.drop_files([100.0, 100.0], &[&file]);
    tab.wait("window.events.some((e) => e.kind === 'drop' && e.files[0] === 'mesh.obj')", 5.0);
}

#[test]
fn fingers_reach_the_page() {
    let Some((tab, _probe)) = opened(Kind::Plain) else { return };
    tab.view(View::PHONE);
    tab.touch("touchStart", &[[30.0, 40.0], [80.0, 90.0]]);
    tab.touch("touchMove", &[[20.0, 30.0], [90.0, 99.0]]);
    tab.touch("touchEnd", &[]);
    let touched = "new Set(window.events.filter((e) => e.kind === 'pointerdown' \
                   && e.pointerType === 'touch').map((e) => e.pointerId)).size";
    assert_eq!(tab.evaluate(touched), 2, "{}", tab.evaluate("window.events"));
    assert_eq!(tab.evaluate("[innerWidth, innerHeight, devicePixelRatio].join()"), "390,844,2");
    assert_eq!(tab.look().width, 780);
}

#[test]
fn errors_of_page_and_worker_are_seen() {
    let Some((tab, _probe)) = opened(Kind::Plain) else { return };
    assert_eq!(tab.errors(), [""; 0]);
    tab.evaluate("setTimeout(() => { throw new Error('page is wrong') })");
    tab.evaluate("console.error('console is wrong')");
    tab.evaluate("window.failInWorker()");
    tab.evaluate("fetch('./none.js').then(() => 1)");
    for words in ["page is wrong", "console is wrong", "told to fail", "404"] {
        let begun = std::time::Instant::now();
        while !tab.errors().iter().any(|error| error.contains(words)) {
            assert!(begun.elapsed().as_secs() < 5, "{words} is not among {:?}", tab.errors());
            std::thread::yield_now();
        }
        tab.expect(words);
    }
    assert_eq!(tab.errors(), [""; 0]);
}

#[test]
fn memory_of_the_worker_counts() {
    let Some((tab, _probe)) = opened(Kind::Plain) else { return };
    let before = tab.memory();
    assert!(before > 100_000.0, "{before}");
    tab.evaluate_in_worker("worker", "self.kept = new Uint8Array(50e6).fill(1); 1");
    let more = tab.memory() - before;
    assert!((50e6..52e6).contains(&more), "{more} bytes more");
}
