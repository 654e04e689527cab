//! A server of static files for one's own machine: what plain hosting does, with the headers that the page likes
//! best. It serves what is in the folder at that moment.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};
use std::sync::Mutex;

use anyhow::{Result, anyhow, bail};

use crate::http::{Answer, Listener, Question};
use crate::site::is_named_after_content;
use crate::sizes::gzip;

/// A running server; it ends when this is dropped.
pub struct Server(Listener);

/// A folder, and the smaller forms of its files, made once.
struct Folder {
    root: PathBuf,
    small: Mutex<HashMap<PathBuf, Vec<u8>>>,
}

impl Server {
    /// Serves a folder on this machine alone. Port 0 is any that is free.
    pub fn start(folder: &Path, port: u16) -> Result<Self> {
        if !folder.join("index.html").exists() {
            let place = folder.display();
            bail!(
                "{place}: there is no index.html in it; `cargo xtask web` makes a folder that has one"
            );
        }
        let folder = Folder::new(folder);
        let listener = Listener::start(port, move |question| folder.answer(question));
        listener.map(Self).map_err(|e| {
            anyhow!("port {port} cannot be used ({e}); name another, or 0 for any that is free")
        })
    }

    /// `http://127.0.0.1:PORT/`. A browser takes that for a safe place: it allows WebGPU and service workers.
    pub fn url(&self) -> String {
        format!("http://{}/", self.0.address())
    }

    /// Serves until the program is ended.
    pub fn wait(self) {
        self.0.wait();
    }
}

fn text(status: u16, text: String) -> Answer {
    let headers = vec![
        ("Content-Type", "text/plain; charset=utf-8".to_owned()),
        ("Cache-Control", "no-store".to_owned()),
    ];
    Answer { status, headers, body: text.into_bytes() }
}

/// What a browser unpacks.
#[derive(Clone, Copy, Debug, Default)]
struct Accepts {
    brotli: bool,
    gzip: bool,
}

impl Accepts {
    fn of(question: &Question) -> Self {
        let named = question.headers.iter().filter(|(name, _)| name == "accept-encoding");
        let lists: Vec<&str> = named.map(|(_, value)| value.as_str()).collect();
        let has = |word: &str| {
            let words = lists.iter().flat_map(|list| list.split([',', ';']));
            words.into_iter().any(|found| found.trim() == word)
        };
        Self { brotli: has("br"), gzip: has("gzip") }
    }
}

impl Folder {
    fn new(root: &Path) -> Self {
        Self { root: root.to_owned(), small: Mutex::default() }
    }

    fn answer(&self, question: &Question) -> Answer {
        if !["GET", "HEAD"].contains(&question.method.as_str()) {
            let mut answer = text(405, "405: this server only reads.\n".into());
            answer.headers.push(("Allow", "GET, HEAD".into()));
            return answer;
        }
        let accepts = Accepts::of(question);
        let asked = question.url.split(['?', '#']).next().unwrap_or("");
        let Some(path) = path_of(asked) else {
            return text(403, "403: there is nothing for you outside the page's folder.\n".into());
        };
        let mut file = self.root.join(&path);
        if file.is_dir() {
            if !asked.ends_with('/') {
                // Else the page's relative references would lead beside it.
                let mut answer = text(301, "301: with a / at the end.\n".into());
                answer.headers.push(("Location", format!("{asked}/")));
                return answer;
            }
            file.push("index.html");
        }
        if !self.is_inside(&file) {
            return text(404, format!("404: there is no {asked} here. The page is at /.\n"));
        }
        let Ok(content) = std::fs::read(&file) else {
            return text(404, format!("404: {asked} cannot be read.\n"));
        };
        self.found(&file, content, accepts)
    }

    fn found(&self, file: &Path, content: Vec<u8>, accepts: Accepts) -> Answer {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let (kind, is_worth) = kind_of(&name);
        let is_lasting = is_named_after_content(&name);
        let cache = if is_lasting { "public, max-age=31536000, immutable" } else { "no-cache" };
        let mut headers = vec![
            ("Content-Type", kind.to_owned()),
            ("Cache-Control", cache.to_owned()),
            ("X-Content-Type-Options", "nosniff".to_owned()),
        ];
        let mut body = content;
        if is_worth {
            headers.push(("Vary", "Accept-Encoding".to_owned()));
            let mut copy = file.as_os_str().to_owned();
            copy.push(".br");
            let ready = accepts.brotli.then(|| PathBuf::from(copy)).filter(|c| self.is_inside(c));
            if let Some(small) = ready.and_then(|copy| std::fs::read(copy).ok()) {
                headers.push(("Content-Encoding", "br".to_owned()));
                body = small;
            } else if accepts.gzip {
                headers.push(("Content-Encoding", "gzip".to_owned()));
                body = if is_lasting { self.small_once(file, &body) } else { gzip(&body) };
            }
        }
        Answer { status: 200, headers, body }
    }

    /// The smaller form of a file whose name says its content.
    fn small_once(&self, file: &Path, content: &[u8]) -> Vec<u8> {
        let known = || self.small.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(small) = known().get(file) {
            return small.clone();
        }
        // Nobody waits for another file's.
        let small = gzip(content);
        known().insert(file.to_owned(), small.clone());
        small
    }

    /// It is a file, and no link leads out of the folder.
    fn is_inside(&self, file: &Path) -> bool {
        let (Ok(file), Ok(root)) = (file.canonicalize(), self.root.canonicalize()) else {
            return false;
        };
        file.starts_with(root) && file.is_file()
    }
}

/// The path inside the folder; nothing where it would lead out, or to what is hidden.
fn path_of(asked: &str) -> Option<PathBuf> {
    let decoded = decoded(asked)?;
    if decoded.contains(['\\', '\0', ':']) {
        return None;
    }
    let path = PathBuf::from(decoded.trim_start_matches('/'));
    let is_plain = path.components().all(|part| match part {
        Component::Normal(name) => !name.to_string_lossy().starts_with('.'),
        _ => false,
    });
    is_plain.then_some(path)
}

/// `%20` and the like as what they mean.
fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, after @ ..] = rest {
        rest = after;
        if *first != b'%' {
            bytes.push(*first);
            continue;
        }
        let (digits, after) = rest.split_at_checked(2)?;
        let is_hex = digits.iter().all(u8::is_ascii_hexdigit);
        let digits = std::str::from_utf8(digits).ok().filter(|_| is_hex)?;
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        rest = after;
    }
    String::from_utf8(bytes).ok()
}

/// What a browser must be told, and whether gzip is worth it.
fn kind_of(name: &str) -> (&'static str, bool) {
    match name.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "html" => ("text/html; charset=utf-8", true),
        "css" => ("text/css; charset=utf-8", true),
        "js" | "mjs" => ("text/javascript; charset=utf-8", true),
        "wasm" => ("application/wasm", true),
        "json" | "map" => ("application/json", true),
        "webmanifest" => ("application/manifest+json", true),
        "svg" => ("image/svg+xml", true),
        "ts" | "txt" | "md" | "toml" | "obj" | "vtk" | "msh" => ("text/plain; charset=utf-8", true),
        "png" => ("image/png", false),
        "jpg" | "jpeg" => ("image/jpeg", false),
        "ico" => ("image/x-icon", false),
        "woff2" => ("font/woff2", false),
        "gif" => ("image/gif", false),
        _ => ("application/octet-stream", false),
    }
}
