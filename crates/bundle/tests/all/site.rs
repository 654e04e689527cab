//! Names after content, references, the service worker's list, sizes.

use viscera_bundle::files::Files;
use viscera_bundle::site;
use viscera_bundle::sizes::{BUDGET, FILES_BUDGET, Sizes, small_copies};

use crate::files;

/// The real service worker.
const WORKER: &str = include_str!("../../../web/page/offline.js");

/// A page with a circle of scripts, a worker and a module; one text can be changed.
fn sources(changed: &str, text: &str) -> (Files, Files) {
    let page = files(&[
        ("index.html", "<head></head><script type=module src=\"./main.js\"></script>"),
        ("main.js", "import './part.js'; new Worker(new URL(\"./worker.js\", import.meta.url))"),
        ("part.js", "import \"./main.js\"; // one"),
        ("worker.js", "import init from './viscera.js'"),
        ("style.css", "b { color: red }"),
        ("offline.js", WORKER),
    ]);
    let generated = files(&[
        ("viscera.js", "new URL('viscera_bg.wasm', import.meta.url); imports[\"./viscera_bg.js\"]"),
        ("viscera_bg.wasm", "module"),
    ]);
    let mut all = (page, generated);
    for files in [&mut all.0, &mut all.1] {
        if let Some(content) = files.get_mut(changed) {
            *content = text.as_bytes().to_vec();
        }
    }
    all
}

fn site_with(changed: &str, text: &str) -> site::Site {
    let (page, generated) = sources(changed, text);
    site::build(&page, &generated).expect("a site")
}

/// The final path of a file, by its name before.
fn name<'a>(site: &'a site::Site, before: &str) -> &'a str {
    let (stem, extension) = before.split_once('.').expect("an extension");
    let is_it = |path: &&String| {
        **path == before
            || path.starts_with(&format!("{stem}.")) && path.ends_with(&format!(".{extension}"))
    };
    site.files.keys().find(is_it).unwrap_or_else(|| panic!("{before}: {:?}", site.files.keys()))
}

fn text(site: &site::Site, before: &str) -> String {
    String::from_utf8(site.files[name(site, before)].clone()).expect("text")
}

#[test]
fn what_refers_to_a_file_says_its_final_name() {
    let site = site_with("", "");
    for (file, target) in [
        ("index.html", "main.js"),
        ("main.js", "part.js"),
        ("main.js", "worker.js"),
        ("part.js", "main.js"),
        ("worker.js", "viscera.js"),
        ("viscera.js", "viscera_bg.wasm"),
    ] {
        let target = name(&site, target);
        assert!(site::is_named_after_content(target), "{target}");
        assert!(text(&site, file).contains(target), "{file} does not say {target}");
    }
    assert!(text(&site, "viscera.js").contains("\"./viscera_bg.js\""), "no file, so left alone");
}

#[test]
fn a_name_changes_with_all_that_a_file_leads_to_and_nothing_else() {
    let before = site_with("", "");
    let all = ["main.js", "part.js", "worker.js", "viscera.js", "viscera_bg.wasm", "style.css"];
    let changes = |changed: &str| {
        let after = site_with(changed, "import './viscera.js' // two");
        assert_ne!(before.build, after.build, "{changed}");
        let differs = all.into_iter().filter(|file| name(&before, file) != name(&after, file));
        differs.collect::<Vec<_>>()
    };
    assert_eq!(
        changes("viscera_bg.wasm"),
        ["main.js", "part.js", "worker.js", "viscera.js", "viscera_bg.wasm"]
    );
    assert_eq!(changes("worker.js"), ["main.js", "part.js", "worker.js"]);
    assert_eq!(changes("part.js"), ["main.js", "part.js"]);
    assert_eq!(changes("style.css"), ["style.css"]);
}

#[test]
fn the_service_worker_lists_every_other_file_and_the_build() {
    let site = site_with("", "");
    let worker = text(&site, "offline.js");
    assert!(worker.contains(&format!("const BUILD = \"{}\";", site.build)));
    assert!(text(&site, "index.html").contains(&format!("content=\"{}\"", site.build)));
    for path in site.files.keys().filter(|path| *path != "offline.js") {
        assert!(worker.contains(&format!("\"./{path}\",\n")), "{path} is not listed");
    }
    assert!(!worker.contains("\"./offline.js\""), "a service worker does not keep itself");
}

#[test]
fn a_reference_to_nothing_is_refused_with_its_line() {
    let (page, generated) = sources("main.js", "// one\nimport './parts.js'");
    let error = site::build(&page, &generated).err().expect("refused").to_string();
    assert!(error.contains("main.js, line 2") && error.contains("./parts.js"), "{error}");
}

#[test]
fn files_in_folders_are_referred_to_from_where_they_are() {
    let page = files(&[
        ("index.html", "<head></head><img src=\"icons/a.svg\">"),
        ("icons/a.svg", "<svg/>"),
        ("icons/b.css", "url(../fonts/c.woff2)"),
        ("fonts/c.woff2", "font"),
    ]);
    let site = site::build(&page, &Files::new()).expect("a site");
    let find = |part: &str| site.files.keys().find(|path| path.starts_with(part)).expect(part);
    let index = String::from_utf8(site.files["index.html"].clone()).expect("text");
    assert!(index.contains(&format!("src=\"{}\"", find("icons/a."))), "{index}");
    let style = String::from_utf8(site.files[find("icons/b.")].clone()).expect("text");
    assert_eq!(style.trim_end(), format!("url(../{})", find("fonts/c.")));
}

#[test]
fn a_page_beyond_the_budget_is_refused() {
    // Noise: nothing takes nothing off it.
    let mut state = 1_u64;
    let mut noise = |bytes: usize| (0..bytes).map(|_| next_byte(&mut state)).collect::<Vec<u8>>();
    let sizes_of = |name: &str, content: Vec<u8>| {
        let files = Files::from([(name.to_owned(), content)]);
        Sizes::new(&files, &small_copies(&files))
    };
    let refused = |sizes: &Sizes| sizes.check().expect_err("refused").to_string();
    let sizes = sizes_of("module.wasm", noise(BUDGET + 10));
    let (error, table) = (refused(&sizes), sizes.table());
    assert!(error.contains("page") && error.contains("more than the 1000000"), "{error}");
    let sum = error.split(' ').find(|word| word.parse::<usize>().is_ok()).expect("a sum");
    assert!(table.contains("module.wasm") && table.contains(sum), "{table}");
    let zeros = vec![0; 2 * BUDGET];
    sizes_of("zeros", zeros).check().expect("what counts is what travels");
    // The second module is not of the page as it opens, and has a limit of its own.
    let second = "viscera_files_bg.0.wasm";
    sizes_of(second, noise(FILES_BUDGET - 1000)).check().expect("within its limit");
    let error = refused(&sizes_of(second, noise(FILES_BUDGET + 10)));
    assert!(error.contains("second module"), "{error}");
}

fn next_byte(state: &mut u64) -> u8 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 56) as u8
}
