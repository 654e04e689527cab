//! The page as people meet it.

use serde_json::Value;

use crate::browser::{Kind, Picture, Tab};
use crate::setup;

/// Opens the page with a link and waits until its scene moves.
pub fn open(kind: Kind, link: &str) -> Option<Tab> {
    let (tab, url) = setup::page(kind)?;
    tab.go(&format!("{url}{link}"));
    tab.wait("window.viscera && viscera.ready", 30.0);
    tab.evaluate("viscera.frame(2)");
    Some(tab)
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

fn assert_tissue(tab: &Tab, picture: &Picture) {
    let share = picture.share(stage(tab), is_flesh);
    assert!((0.03..0.7).contains(&share), "{share} of the picture is tissue");
}

#[test]
fn it_shows_tissue() {
    let Some(tab) = open(Kind::Gpu, "") else { return };
    let picture = tab.look();
    picture.save("gpu");
    println!("{}", tab.evaluate("JSON.stringify(viscera.state())"));
    assert_tissue(&tab, &picture);
}

#[test]
fn it_shows_tissue_without_webgpu() {
    let Some(tab) = open(Kind::Plain, "") else { return };
    let picture = tab.look();
    picture.save("plain");
    println!("{}", tab.evaluate("JSON.stringify(viscera.state())"));
    assert_tissue(&tab, &picture);
}
