//! A small driver for a headless browser.

mod connection;
mod picture;
mod tab;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};

use serde_json::{Value, json};

pub use picture::Picture;
pub use tab::{Tab, View, pause};

use connection::Connection;

/// Names the browser's program.
const VARIABLE: &str = "VISCERA_BROWSER";

/// Debian's.
const USUAL: &str = "/usr/bin/chromium";

/// So that a test is alone: no network of its own, no questions.
const FLAGS: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--remote-debugging-pipe",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-backgrounding-occluded-windows",
];

/// WebGPU without a graphics processor. With fewer of them it computes, but nothing is seen.
const GPU_FLAGS: [&str; 5] = [
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=swiftshader",
];

/// What a browser has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// WebGPU, computed in software.
    Gpu,
    /// No WebGPU.
    Plain,
}

/// A running browser, which ends with this or with the process.
pub struct Browser {
    connection: Connection,
    process: Mutex<Child>,
}

/// A browser reads commands from its file 3 and answers to 4; it ends when these close. Its folder goes then.
const SHELL: &str = "\"$@\" 3<&0 4>&1 </dev/null >/dev/null; rm -rf \"$FOLDER\"";

/// The browser's program; nothing where there is none.
pub fn program() -> Option<PathBuf> {
    let named = std::env::var_os(VARIABLE).map(PathBuf::from);
    named.or_else(|| Some(USUAL.into())).filter(|program| program.exists())
}

impl Browser {
    /// Starts one.
    pub fn start(kind: Kind) -> Self {
        let program = program().expect("a browser, which `setup` has looked for");
        let folder = tempfile::tempdir().expect("a temporary folder").keep();
        let mut command = Command::new("sh");
        command.args(["-c", SHELL, "sh"]).arg(&program).env("FOLDER", &folder);
        command.args(FLAGS).arg(format!("--user-data-dir={}", folder.display()));
        if kind == Kind::Gpu {
            command.args(GPU_FLAGS);
        }
        command.arg("about:blank");
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process =
            command.spawn().unwrap_or_else(|e| panic!("{} does not start: {e}", program.display()));
        let pipe = process.stdin.take().expect("a pipe to the browser");
        let output = process.stdout.take().expect("a pipe from the browser");
        let connection = Connection::new(pipe, output);
        Self { connection, process: Mutex::new(process) }
    }

    /// A tab that shares nothing with others: no storage, no service worker, no cache.
    pub fn tab(&self) -> Tab {
        let context = self.ask("Target.createBrowserContext", json!({}));
        let context = context["browserContextId"].as_str().expect("a context").to_owned();
        self.tab_in(&context)
    }

    /// One more tab of the same visitor.
    pub fn tab_in(&self, context: &str) -> Tab {
        let place = json!({ "url": "about:blank", "browserContextId": context, "newWindow": true });
        let target = self.ask("Target.createTarget", place)["targetId"].clone();
        let attach = json!({ "targetId": target, "flatten": true });
        let session = self.ask("Target.attachToTarget", attach)["sessionId"].clone();
        let session = session.as_str().expect("a session").to_owned();
        let target = target.as_str().expect("a target").to_owned();
        Tab::new(self.connection.clone(), session, target, context.to_owned())
    }

    fn ask(&self, method: &str, parameters: Value) -> Value {
        self.connection.ask("", method, parameters).unwrap_or_else(|e| panic!("{e}"))
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.connection.ask("", "Browser.close", json!({}));
        let process = self.process.get_mut().unwrap_or_else(PoisonError::into_inner);
        let _ = process.wait();
    }
}

/// The folder of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}
