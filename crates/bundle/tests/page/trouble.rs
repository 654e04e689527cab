//! What goes wrong is said, and leaves something that works.

use std::path::PathBuf;

use viscera::mesh::io::{MeshNames, vtu};
use viscera::mesh::shapes;

use crate::browser::{Kind, Tab, pause};
use crate::page::{BAR, begin, farthest, number, numbers, open, wait_for_tissue};
use crate::setup;

/// Everything that the page has said.
fn said(tab: &Tab) -> String {
    let log = tab.evaluate("viscera.state().log.map((message) => message.text).join('\\n')");
    log.as_str().expect("a text").to_owned()
}

/// Waits until the page says something.
fn wait_for(tab: &Tab, words: &str) {
    let begun = std::time::Instant::now();
    while !said(tab).contains(words) {
        assert!(
            begun.elapsed().as_secs() < 90,
            "`{words}` is not in what the page says: {}",
            said(tab)
        );
        pause(0.05);
    }
}

#[test]
fn a_link_of_nonsense_is_told_part_by_part() {
    let link = "#scene=nothing&mesh=99&solver.method=magic&frobnicate=1&solver.iterations=many\
                &%3Cscript%3E=1&color=stress";
    let Some(tab) = open(Kind::Plain, link) else { return };
    let said = said(&tab);
    for part in ["nothing", "99", "magic", "frobnicate"] {
        assert!(said.contains(part), "{part} is not told of: {said}");
    }
    assert_eq!(tab.evaluate("viscera.state().loaded.name"), "liver_lifted");
    assert_eq!(tab.evaluate("viscera.state().link.color"), "stress", "what is right in it holds");
    assert_eq!(tab.evaluate("document.querySelectorAll('#messages script').length"), 0);
}

#[test]
fn the_simulation_goes_on_when_the_device_is_lost() {
    let Some(tab) = open(Kind::Gpu, BAR) else { return };
    tab.evaluate("viscera.pause()");
    tab.evaluate("viscera.step(20)");
    let before = numbers(&tab, "viscera.vertices(0)");
    tab.evaluate("viscera.lose()");
    wait_for(&tab, "The simulation goes on where it was");
    assert!(said(&tab).contains("The graphics device is gone"), "{}", said(&tab));
    assert!(farthest(&before, &numbers(&tab, "viscera.vertices(0)")) < 1e-9, "where it was");
    tab.evaluate("viscera.step(3)");
    assert!(farthest(&before, &numbers(&tab, "viscera.vertices(0)")) > 1e-6, "and goes on");
    wait_for_tissue(&tab);
}

#[test]
fn a_simulation_on_a_lost_device_goes_on() {
    let link = "#scene=cantilever&mesh=1.6&solver.method=xpbd&solver.device=gpu";
    let Some(tab) = open(Kind::Gpu, link) else { return };
    tab.evaluate("viscera.lose()");
    wait_for(&tab, "The simulation goes on where it was");
    let time = number(&tab.evaluate("viscera.state().time"));
    tab.evaluate("viscera.frame(3)");
    let later = number(&tab.evaluate("viscera.state().time"));
    assert!(later > time, "{time} s, then {later} s");
    wait_for_tissue(&tab);
}

#[test]
fn a_module_that_died_can_be_started_again() {
    let Some(tab) = open(Kind::Plain, BAR) else { return };
    tab.expect("panic");
    tab.expect("unreachable");
    tab.evaluate("viscera.panic()");
    tab.wait("viscera.state().card", 10.0);
    tab.look().save("card");
    tab.click_on("#card-buttons button");
    wait_for_tissue(&tab);
    assert_eq!(tab.evaluate("viscera.state().loaded.name"), "cantilever");
    tab.evaluate("viscera.frame(2)");
}

fn dropped(name: &str, content: &[u8]) -> Option<(Tab, tempfile::TempDir)> {
    let tab = open(Kind::Plain, BAR)?;
    let folder = tempfile::tempdir().expect("a folder");
    let file: PathBuf = folder.path().join(name);
    std::fs::write(&file, content).expect("written");
    tab.drop_files([500.0, 500.0], &[&file]);
    Some((tab, folder))
}

/// A cube of 8 cm: 27 cells of six tetrahedra each, as Gmsh 2.2.
fn cube() -> String {
    let line = |number: usize, rest: &str| format!("{number} {rest}\n");
    let at = |i: usize, j: usize, k: usize| i + 4 * (j + 4 * k) + 1;
    let step = |n: usize| 0.08 / 3.0 * n as f64;
    let (mut nodes, mut tets) = (String::new(), Vec::new());
    for (i, j, k) in (0..64).map(|n| (n % 4, n / 4 % 4, n / 16)) {
        nodes.push_str(&line(at(i, j, k), &format!("{} {} {}", step(i), step(j), step(k))));
        if i == 3 || j == 3 || k == 3 {
            continue;
        }
        // From corner to opposite corner along the edges, in each order of the axes.
        for axes in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mut corner = [i, j, k];
            let mut tet = vec![at(i, j, k)];
            for axis in axes {
                corner[axis] += 1;
                tet.push(at(corner[0], corner[1], corner[2]));
            }
            // An odd order of the axes is a mirror image.
            if [[0, 2, 1], [1, 0, 2], [2, 1, 0]].contains(&axes) {
                tet.swap(2, 3);
            }
            tets.push(tet.iter().map(usize::to_string).collect::<Vec<_>>().join(" "));
        }
    }
    let elements: String =
        tets.iter().enumerate().map(|(n, tet)| line(n + 1, &format!("4 2 0 0 {tet}"))).collect();
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n64\n{nodes}$EndNodes\n$Elements\n{}\n{elements}\
         $EndElements\n",
        tets.len()
    )
}

#[test]
fn a_mesh_that_is_dropped_moves() {
    let ball = shapes::sphere(0.03, 0.012).expect("a ball").tets;
    let file = vtu::write_mesh(&ball, &MeshNames::default()).expect("a file");
    for (name, bytes, tets) in
        [("cube.msh", cube().into_bytes(), 162), ("ball.vtu", file, ball.tets().len())]
    {
        let Some((tab, _folder)) = dropped(name, &bytes) else { return };
        wait_for(&tab, &format!("{name} is open"));
        assert_eq!(tab.evaluate("viscera.state().own"), name, "{}", said(&tab));
        assert_eq!(tab.evaluate("viscera.state().loaded.tets"), tets);
        tab.evaluate("viscera.frame(3)");
        wait_for_tissue(&tab).save("own_mesh");
    }
}

/// A segmented scan of 3 mm voxels as NIfTI: two balls that touch, labels without names.
fn scan() -> Vec<u8> {
    const SIZE: [usize; 3] = [24, 20, 20];
    let mut bytes = vec![0u8; 352];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, &348i32.to_le_bytes());
    for (i, size) in [3, SIZE[0], SIZE[1], SIZE[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &(size as i16).to_le_bytes());
    }
    put(70, &2i16.to_le_bytes());
    put(72, &8i16.to_le_bytes());
    for i in 0..4 {
        put(76 + 4 * i, &3f32.to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(123, &[2]);
    put(254, &1i16.to_le_bytes());
    for row in 0..3 {
        put(280 + 16 * row + 4 * row, &3f32.to_le_bytes());
    }
    put(344, b"n+1\0");
    for n in 0..SIZE.iter().product() {
        let [x, y, z] = [n % SIZE[0], n / SIZE[0] % SIZE[1], n / SIZE[0] / SIZE[1]];
        let apart = |at: [f64; 3], radius: f64| {
            let d = [x as f64 - at[0], y as f64 - at[1], z as f64 - at[2]];
            d.iter().map(|d| d * d).sum::<f64>().sqrt() < radius
        };
        bytes.push(match (apart([7.0, 9.5, 9.5], 5.5), apart([16.0, 9.5, 9.5], 6.0)) {
            (_, true) => 5,
            (true, _) => 2,
            _ => 0,
        });
    }
    bytes
}

/// It is filled, tied and held by the second module; and rests as it was scanned by the first one.
#[test]
fn a_scan_that_is_dropped_becomes_organs_that_rest_as_they_are() {
    let Some((tab, _folder)) = dropped("scan.nii", &scan()) else { return };
    wait_for(&tab, "scan.nii is open");
    let bodies = tab.evaluate("viscera.state().loaded.bodies.map((body) => body.name).join()");
    assert_eq!(bodies, "label_2,label_5", "{}", said(&tab));
    tab.evaluate("viscera.pause()");
    tab.evaluate("viscera.worker.post('reset')");
    let before = numbers(&tab, "viscera.vertices(0)");
    tab.evaluate("viscera.step(60)");
    let moved = farthest(&before, &numbers(&tab, "viscera.vertices(0)"));
    assert!(moved < 1e-4, "{moved} m");
    assert!(!said(&tab).contains("sags"), "{}", said(&tab));
    wait_for_tissue(&tab).save("own_scan");
}

#[test]
fn a_file_that_is_no_mesh_is_told_and_the_scene_goes_on() {
    for (name, content, words) in [
        ("letter.txt", &b"Dear reader"[..], "letter.txt"),
        ("broken.msh", &b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\nthree\n"[..], "broken.msh"),
        ("broken.toml", &b"title = \n"[..], "broken.toml"),
        ("empty.obj", &b""[..], "empty.obj"),
    ] {
        let Some((tab, _folder)) = dropped(name, content) else { return };
        wait_for(&tab, words);
        assert_eq!(tab.evaluate("viscera.state().loaded.name"), "cantilever");
        tab.evaluate("viscera.frame(2)");
    }
}

#[test]
fn the_page_works_without_its_server_after_the_first_visit() {
    use viscera_bundle::server::Server;
    let (Some(site), Some(browser)) = (setup::site(), setup::browser(Kind::Plain)) else { return };
    let server = Server::start(&site, 0).expect("a server");
    let tab = browser.tab();
    let url = server.url();
    tab.go(&format!("{url}{BAR}"));
    begin(&tab);
    tab.wait(crate::offline::IS_KEPT, 15.0);
    drop(server);
    tab.expect("ERR_CONNECTION_REFUSED");
    tab.reload();
    begin(&tab);
    assert_eq!(tab.evaluate("viscera.state().loaded.name"), "cantilever");
    wait_for_tissue(&tab);
}
