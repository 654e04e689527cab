//! The server, by a plain socket.

use std::io::{Read, Write};
use std::net::TcpStream;

use flate2::read::GzDecoder;
use viscera_bundle::files;
use viscera_bundle::server::Server;

const LASTING: &str = "a.0123456789abcdef.js";

/// What lies outside the folder.
const HIDDEN: &str = "nobody may read this";

struct Site {
    server: Server,
    /// Vanishes with it.
    _folder: tempfile::TempDir,
}

fn site() -> Site {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path().join("site");
    let page = crate::files(&[
        ("index.html", "<p>page"),
        ("m.wasm", "module"),
        ("m.wasm.br", "module, smaller"),
        (LASTING, "let text = 'a text that repeats, a text that repeats, a text that repeats'"),
        ("deep/index.html", "<p>deep"),
    ]);
    files::write(&folder, &page).expect("written");
    std::fs::write(place.path().join("secret.txt"), HIDDEN).expect("written");
    Site { server: Server::start(&folder, 0).expect("a server"), _folder: place }
}

impl Site {
    /// Head and body of an answer.
    fn ask(&self, method: &str, path: &str, more: &str) -> (String, Vec<u8>) {
        let url = self.server.url();
        let address = url.trim_start_matches("http://").trim_end_matches('/');
        let mut stream = TcpStream::connect(address).expect("a connection");
        let request =
            format!("{method} {path} HTTP/1.1\r\nHost: x\r\n{more}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).expect("sent");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("an answer");
        let end = answer.windows(4).position(|w| w == b"\r\n\r\n").expect("a head") + 4;
        let body = answer.split_off(end);
        (String::from_utf8(answer).expect("text").to_lowercase(), body)
    }
}

#[test]
fn files_come_with_their_kind_and_how_long_they_last() {
    let site = site();
    let (head, body) = site.ask("GET", "/", "");
    assert!(head.starts_with("http/1.1 200") && body == b"<p>page", "{head}");
    assert!(head.contains("text/html") && head.contains("cache-control: no-cache"), "{head}");
    let (head, body) = site.ask("GET", "/m.wasm?x=1", "");
    assert!(head.contains("application/wasm") && body == b"module", "{head}");
    let (head, _) = site.ask("GET", &format!("/{LASTING}"), "");
    assert!(head.contains("immutable") && head.contains("text/javascript"), "{head}");
}

#[test]
fn answers_are_small_where_the_browser_can_read_them() {
    let site = site();
    let (head, body) = site.ask("GET", &format!("/{LASTING}"), "Accept-Encoding: br, gzip\r\n");
    assert!(head.contains("content-encoding: gzip"), "{head}");
    let mut text = String::new();
    GzDecoder::new(body.as_slice()).read_to_string(&mut text).expect("gzip");
    assert!(text.starts_with("let text") && body.len() < text.len());
    let (head, body) = site.ask("GET", &format!("/{LASTING}"), "");
    assert!(!head.contains("content-encoding") && body.starts_with(b"let text"), "{head}");
}

#[test]
fn only_the_head_comes_where_only_that_is_asked_for() {
    let (head, body) = site().ask("HEAD", "/", "");
    assert!(head.starts_with("http/1.1 200") && head.contains("content-length: 7"), "{head}");
    assert!(body.is_empty(), "{} bytes", body.len());
    let (head, _) = site().ask("POST", "/", "Content-Length: 0\r\n");
    assert!(head.starts_with("http/1.1 405"), "{head}");
}

#[test]
fn nothing_outside_the_folder_is_served() {
    let site = site();
    let outside =
        ["/../secret.txt", "/%2e%2e/secret.txt", "/deep/..%2f..%2fsecret.txt", "/..\\secret.txt"];
    for path in
        outside.into_iter().chain(["/.viscera-bundle", "/%zz", "/%c3", "//etc/passwd", "/a%00b"])
    {
        let (head, body) = site.ask("GET", path, "");
        let is_refused = head.starts_with("http/1.1 403") || head.starts_with("http/1.1 404");
        assert!(is_refused, "{path}: {head}");
        assert!(!String::from_utf8_lossy(&body).contains(HIDDEN), "{path}");
    }
}

#[cfg(unix)]
#[test]
fn a_link_leads_not_out_of_the_folder() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path().join("site");
    files::write(&folder, &crate::files(&[("index.html", "<p>page")])).expect("written");
    std::fs::write(place.path().join("secret.txt"), "secret").expect("written");
    std::os::unix::fs::symlink("../secret.txt", folder.join("link.txt")).expect("a link");
    let site = Site { server: Server::start(&folder, 0).expect("a server"), _folder: place };
    assert!(site.ask("GET", "/link.txt", "").0.starts_with("http/1.1 404"));
}

#[test]
fn folders_lead_to_their_page_and_what_is_missing_is_told() {
    let site = site();
    let (head, _) = site.ask("GET", "/deep", "");
    assert!(head.starts_with("http/1.1 301") && head.contains("location: /deep/\r\n"), "{head}");
    assert_eq!(site.ask("GET", "/deep/", "").1, b"<p>deep");
    let (head, body) = site.ask("GET", "/none.js", "");
    assert!(head.starts_with("http/1.1 404"), "{head}");
    assert!(String::from_utf8_lossy(&body).contains("no /none.js here"));
}

#[test]
fn a_port_in_use_and_a_folder_without_a_page_are_told() {
    let site = site();
    let url = site.server.url();
    let port = url.trim_end_matches('/').rsplit(':').next().expect("a port");
    let folder = site._folder.path().join("site");
    let error = Server::start(&folder, port.parse().expect("a number")).err().expect("refused");
    assert!(error.to_string().contains("cannot be used"), "{error}");
    let error = Server::start(site._folder.path(), 0).err().expect("refused");
    assert!(error.to_string().contains("no index.html"), "{error}");
}

#[test]
fn a_copy_that_lies_ready_is_sent_to_those_who_take_it() {
    let site = site();
    let (head, body) = site.ask("GET", "/m.wasm", "Accept-Encoding: gzip, br\r\n");
    assert!(head.contains("content-encoding: br") && head.contains("application/wasm"), "{head}");
    assert_eq!(body, b"module, smaller");
    let (head, body) = site.ask("GET", "/m.wasm", "Accept-Encoding: broken\r\n");
    assert!(!head.contains("content-encoding") && body == b"module", "{head}");
    // What does not lie ready goes by gzip.
    let (head, _) = site.ask("GET", &format!("/{LASTING}"), "Accept-Encoding: br, gzip\r\n");
    assert!(head.contains("content-encoding: gzip"), "{head}");
}
