//! The service worker: without a network, and with a newer build on the server.

use crate::browser::{Kind, Tab};
use crate::driver::Probe;
use crate::setup;

/// Everything has been kept.
pub const IS_KEPT: &str = "navigator.serviceWorker.ready.then(() => \
                       navigator.serviceWorker.controller !== null)";

fn version(tab: &Tab) -> String {
    let version = tab.wait("window.version", 20.0);
    version.as_str().expect("a text").to_owned()
}

#[test]
fn the_page_opens_without_its_server() {
    let Some(browser) = setup::browser(Kind::Plain) else { return };
    let Probe { server, folder: _folder } = Probe::new();
    let tab = browser.tab();
    let url = server.url();
    tab.go(&url);
    tab.wait(IS_KEPT, 20.0);
    drop(server);
    tab.expect("ERR_CONNECTION_REFUSED");
    tab.go(&format!("{url}?scene=any"));
    assert_eq!(version(&tab), "one");
    assert_eq!(tab.wait("window.result", 10.0)["adapter"], serde_json::Value::Null);
    tab.reload();
    assert_eq!(version(&tab), "one");
}

#[test]
fn a_newer_build_is_taken_at_the_next_load_and_kept() {
    let Some(browser) = setup::browser(Kind::Plain) else { return };
    let probe = Probe::new();
    let url = probe.server.url();
    let tab = browser.tab();
    tab.go(&url);
    tab.wait(IS_KEPT, 20.0);
    for newer in ["two", "three", "four"] {
        probe.replace(newer);
        tab.reload();
        assert_eq!(version(&tab), newer);
        // The newest build, whole, and at most one before it. What is still being kept has a name already; a
        // browser joins the next look for a newer build with one that still runs, and every fetch puts it off.
        let has_newest = "navigator.serviceWorker.getRegistration().then(async (r) => {
            const names = await caches.keys();
            const page = document.documentElement.outerHTML;
            const isWhole = !r.installing && !r.waiting && r.active.state === 'activated';
            return isWhole && names.length <= 2 && names.some((n) => page.includes(n.slice(-16)));
        })";
        tab.wait(has_newest, 20.0);
    }
    let Probe { server, folder: _folder } = probe;
    drop(server);
    tab.expect("ERR_CONNECTION_REFUSED");
    tab.reload();
    assert_eq!(version(&tab), "four", "without the server it is the newest that was seen");
}

#[test]
fn a_build_that_is_not_whole_is_not_kept() {
    let Some(browser) = setup::browser(Kind::Plain) else { return };
    let probe = Probe::new();
    let url = probe.server.url();
    let tab = browser.tab();
    tab.go(&url);
    tab.wait(IS_KEPT, 20.0);
    // A newer service worker beside the older page, as while files are copied to a server.
    let folder = probe.folder.path().join("site");
    let older = std::fs::read(folder.join("index.html")).expect("a page");
    probe.replace("two");
    std::fs::write(folder.join("index.html"), older).expect("written");
    tab.expect("404");
    tab.expect("is of another build");
    tab.expect("ServiceWorker script evaluation failed");
    tab.reload();
    assert_eq!(version(&tab), "one", "the older page has its older files from what was kept");
    let installs = "navigator.serviceWorker.getRegistration().then((r) => r.installing === null \
                    && r.waiting === null && caches.keys()).then((names) => names.length === 1)";
    tab.wait(installs, 20.0);
    let Probe { server, folder: _folder } = probe;
    drop(server);
    tab.expect("ERR_CONNECTION_REFUSED");
    tab.reload();
    assert_eq!(version(&tab), "one");
}

#[test]
fn a_page_of_the_older_build_keeps_its_files_beside_a_newer_one() {
    let Some(browser) = setup::browser(Kind::Plain) else { return };
    let probe = Probe::new();
    let url = probe.server.url();
    let older = browser.tab();
    older.go(&url);
    older.wait(IS_KEPT, 20.0);
    let script = "[...performance.getEntriesByType('resource')].find((e) => \
                  e.name.includes('/version.')).name";
    let script = older.evaluate(script);
    probe.replace("two");
    let newer = browser.tab_in(&older.context);
    newer.go(&url);
    assert_eq!(version(&newer), "two");
    newer.wait("caches.keys().then((names) => names.length === 2)", 20.0);
    let text = older.evaluate(&format!("fetch({script}).then((r) => r.text())"));
    assert!(text.to_string().contains("one"), "the server has it no more: {text}");
    assert_eq!(version(&older), "one");
}
