//! The page as people meet it.

use std::time::Instant;

use serde_json::Value;

use crate::browser::{Kind, Picture, Tab, View};
use crate::setup;

/// A bar that bends under its weight and comes to rest, with few tetrahedra. What a link says is not measured.
pub const BAR: &str = "#scene=cantilever&mesh=1.6&solver.device=cpu&solver.accuracy=draft";

/// Opens the page with a link and waits until its scene moves.
pub fn open(kind: Kind, link: &str) -> Option<Tab> {
    open_in(kind, View::DESK, link)
}

/// The same in a window of another size, or on a phone's screen.
pub fn open_in(kind: Kind, view: View, link: &str) -> Option<Tab> {
    let (tab, url) = setup::page(kind)?;
    tab.view(view);
    tab.go(&format!("{url}{link}"));
    begin(&tab);
    Some(tab)
}

/// Waits until the scene moves.
pub fn begin(tab: &Tab) {
    tab.wait("window.viscera && viscera.ready", 30.0);
    // A device's first frame waits for its kernels, which a driver in software compiles for seconds.
    tab.wait("viscera.state().frames >= 2", 60.0);
}

/// Takes messages away that lie over the picture.
pub fn dismiss(tab: &Tab) {
    tab.evaluate("document.querySelectorAll('#messages button').forEach((b) => b.click())");
}

/// Looks until there is tissue to be seen: a browser shows what was drawn when it comes to it.
pub fn wait_for_tissue(tab: &Tab) -> Picture {
    let begun = Instant::now();
    loop {
        let picture = tab.look();
        let is_late = begun.elapsed().as_secs() > 15;
        if is_late || share_of_tissue(tab, &picture) > 0.03 {
            assert_tissue(tab, &picture);
            return picture;
        }
    }
}

/// Where the picture of the tissue is, in pixels of a screenshot of scale 1.
pub fn stage(tab: &Tab) -> [usize; 4] {
    tab.area("#canvas").map(|number| number.max(0.0) as usize)
}

/// Red as flesh, lit or in shadow.
pub fn is_flesh([red, green, blue]: [u8; 3]) -> bool {
    let [red, green, blue] = [red, green, blue].map(f64::from);
    red > 40.0 && red > 1.35 * green && red > 1.35 * blue
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The page's picture has tissue, neither a trace of it nor nothing else.
fn assert_tissue(tab: &Tab, picture: &Picture) {
    let share = share_of_tissue(tab, picture);
    assert!((0.03..0.7).contains(&share), "{share} of the picture is tissue");
}

fn share_of_tissue(tab: &Tab, picture: &Picture) -> f64 {
    let scale = picture.width as f64 / number(&tab.evaluate("innerWidth"));
    let area = tab.area("#canvas").map(|number| (number.max(0.0) * scale) as usize);
    picture.share(area, is_flesh)
}

/// Numbers in a list of the page.
pub fn numbers(tab: &Tab, expression: &str) -> Vec<f64> {
    let value = tab.evaluate(&format!("(async () => [...(await {expression})])()"));
    value.as_array().expect("a list").iter().map(number).collect()
}

/// The largest distance between two sets of points [m].
pub fn farthest(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "points of one mesh");
    let distance = |(a, b): (&[f64], &[f64])| {
        a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    a.chunks(3).zip(b.chunks(3)).map(distance).fold(0.0, f64::max)
}

#[test]
fn it_shows_tissue() {
    let Some(tab) = open(Kind::Gpu, "") else { return };
    assert_eq!(tab.evaluate("viscera.state().screen.plain"), false, "drawn by the device");
    wait_for_tissue(&tab).save("desk");
}

/// The one that everybody can run in a few seconds.
#[test]
fn short_look_at_it_without_webgpu() {
    let Some(tab) = open(Kind::Plain, BAR) else { return };
    assert_eq!(tab.evaluate("viscera.state().screen.plain"), true, "drawn by the processor");
    wait_for_tissue(&tab).save("without_webgpu");
    let said = tab.evaluate("viscera.state().log.map((message) => message.text).join()");
    let said = said.as_str().expect("a text");
    assert!(said.contains("WebGPU") && said.contains("CPU"), "people are told why: {said}");
}

#[test]
fn it_looks_alike_with_and_without_webgpu() {
    let places = [Kind::Gpu, Kind::Plain].map(|kind| {
        let tab = open(kind, BAR)?;
        tab.evaluate("viscera.pause()");
        tab.evaluate("viscera.worker.post('reset')");
        tab.evaluate("viscera.step(40)");
        dismiss(&tab);
        let picture = wait_for_tissue(&tab);
        picture.save(if kind == Kind::Gpu { "bar_gpu" } else { "bar_cpu" });
        let area = stage(&tab);
        let flesh: Vec<[usize; 2]> =
            picture.pixels().filter(|(.., p)| is_flesh(*p)).map(|(x, y, _)| [x, y]).collect();
        let flesh = flesh.into_iter().filter(|[x, y]| {
            (area[0]..area[0] + area[2]).contains(x) && (area[1]..area[1] + area[3]).contains(y)
        });
        Some(flesh.collect::<std::collections::HashSet<_>>())
    });
    let [Some(gpu), Some(plain)] = places else { return };
    let common = gpu.intersection(&plain).count() as f64;
    let all = gpu.union(&plain).count() as f64;
    assert!(common / all > 0.9, "{common} of {all} pixels of tissue are in both pictures");
}

#[test]
fn another_method_goes_on_from_where_it_was() {
    let Some(tab) = open(Kind::Gpu, BAR) else { return };
    let method = "viscera.state().report.runs[0].method";
    assert_eq!(tab.evaluate(method), "quasi_newton");
    tab.evaluate("viscera.step(30)");
    let before = numbers(&tab, "viscera.vertices(0)");
    // The menu beside the word, as a person would.
    let choose = "(() => { const label = [...document.querySelectorAll('label')].find((l) => \
                  l.textContent === 'method'); const menu = document.getElementById(label.htmlFor); \
                  menu.value = 'xpbd'; menu.dispatchEvent(new Event('change')); })()";
    tab.evaluate(choose);
    tab.wait(&format!("{method} === 'xpbd'"), 10.0);
    assert!(farthest(&before, &numbers(&tab, "viscera.vertices(0)")) < 1e-9, "nothing jumps");
    tab.evaluate("viscera.step(1)");
    let after = farthest(&before, &numbers(&tab, "viscera.vertices(0)"));
    assert!((1e-6..2e-2).contains(&after), "{after} m in one frame");
    assert!(tab.evaluate("location.hash").to_string().contains("solver.method=xpbd"), "the link");
}

#[test]
fn xpbd_on_the_device_follows_the_processor() {
    let link = "#scene=cantilever&mesh=1.6&solver.method=xpbd&solver.device=";
    let ends = ["cpu", "gpu"].map(|device| {
        let tab = open(Kind::Gpu, &format!("{link}{device}"))?;
        tab.evaluate("viscera.pause()");
        tab.evaluate("viscera.worker.post('reset')");
        let start = numbers(&tab, "viscera.vertices(0)");
        // A driver in software takes a second a frame.
        tab.evaluate("viscera.step(8)");
        let computed = tab.evaluate("viscera.state().report.runs[0].device").to_string();
        let name = if device == "cpu" { "CPU" } else { "graphics processor" };
        assert!(computed.contains(name), "{device}: {computed}");
        Some((start, numbers(&tab, "viscera.vertices(0)")))
    });
    let [Some((start, processor)), Some((_, device))] = ends else { return };
    let motion = farthest(&start, &processor);
    let difference = farthest(&processor, &device);
    assert!(motion > 1e-3, "{motion} m: it moves");
    assert!(difference < 0.01 * motion, "{difference} m of {motion} m");
}

#[test]
fn memory_stays_over_many_scenes() {
    let Some(tab) = open(Kind::Plain, BAR) else { return };
    let mut memory = Vec::new();
    for round in 0..20 {
        let scene = ["stretch", "cantilever", "twist", "grab"][round % 4];
        let link = format!("scene={scene}&mesh=2&solver.device=cpu&solver.accuracy=draft");
        tab.evaluate(&format!("location.hash = '{link}'"));
        tab.wait(&format!("viscera.state().loaded.name === '{scene}'"), 10.0);
        tab.evaluate("viscera.frame(3)");
        memory.push(tab.memory());
    }
    let (fifth, last) = (memory[4], memory[19]);
    assert!(last < 1.1 * fifth, "{fifth} bytes after five scenes, {last} after twenty: {memory:?}");
    assert!(fifth > 1e6, "{fifth} bytes: the module's memory counts");
}

#[test]
fn it_is_dark_where_the_system_is() {
    let Some(tab) = open(Kind::Plain, BAR) else { return };
    let corner = |tab: &Tab| {
        let picture = tab.look();
        let [left, top, ..] = stage(tab);
        picture.at(left + 10, top + 10).map(u32::from).iter().sum::<u32>()
    };
    wait_for_tissue(&tab);
    let light = corner(&tab);
    tab.prefers("prefers-color-scheme", "dark");
    tab.wait("document.documentElement.dataset.theme === 'dark'", 5.0);
    tab.evaluate("viscera.frame(2)");
    tab.look().save("dark");
    let dark = corner(&tab);
    assert!(light > 600 && dark < 200, "the background is {light}, then {dark}");
}
